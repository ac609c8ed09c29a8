//! The sinks of a running box: what they need to begin, and where they tell how they are.

use crate::config::Config;
use crate::history::Outbox;
use crate::sinks::{self, Board, SinkAddress, Sinks};
use std::path::PathBuf;

/// Sinks that are configured.
#[derive(Debug)]
pub struct Outputs {
    /// What waits for them.
    pub outbox: Outbox,
    /// How they are.
    pub board: Board,
    sinks: Vec<(String, SinkAddress)>,
    history: PathBuf,
}

impl Outputs {
    /// `None` where no sink is configured.
    #[must_use]
    pub fn of(config: &Config) -> Option<Self> {
        if config.sinks.is_empty() {
            return None;
        }
        let sinks: Vec<_> = config.sinks.iter().map(|sink| (sink.name.clone(), sink.address.clone())).collect();
        let names = sinks.iter().map(|(name, _)| name.clone());
        let outbox = Outbox::new(&config.gateway.name, config.outbox.clone(), names);
        let board = Board::new(outbox.clone(), sinks.iter().map(|(name, at)| (name.clone(), at.text().to_owned())));
        Some(Self { outbox, board, sinks, history: config.history.path.clone() })
    }

    /// Starts their tasks on the runtime that is running.
    #[must_use]
    pub fn start(&self) -> Sinks {
        sinks::start(&self.sinks, &self.outbox, &self.board, &self.history)
    }

    /// Threads that may be needed for what cannot be waited for asynchronously: reading the outbox, and a line.
    #[must_use]
    pub fn threads(&self) -> usize {
        2 * self.sinks.len()
    }
}
