//! The sinks of a running box: what they need to begin, and where they tell how they are.

use gateway_config::{self as config, Config};
use gateway_control::OrderSender;
use gateway_history::Outbox;
use gateway_sinks::{self as sinks, Board, Sinks};
use std::path::PathBuf;

/// Sinks that are configured.
#[derive(Debug)]
pub struct ConfiguredSinks {
    /// What waits for them.
    pub outbox: Outbox,
    /// State and counts of each sink, for the status.
    pub board: Board,
    sinks: Vec<config::SinkConfig>,
    history: PathBuf,
}

impl ConfiguredSinks {
    /// `None` where no sink is configured.
    #[must_use]
    pub fn from_config(config: &Config) -> Option<Self> {
        if config.sinks.is_empty() {
            return None;
        }
        let sinks = config.sinks.clone();
        let names = sinks.iter().map(|sink| sink.name.clone());
        let outbox = Outbox::new(config.gateway.machine.clone(), config.outbox.clone(), names);
        let board =
            Board::new(outbox.clone(), sinks.iter().map(|sink| (sink.name.clone(), sink.address.text().to_owned())));
        Some(Self { outbox, board, sinks, history: config.history.path.clone() })
    }

    /// Starts their tasks on the runtime that is running; what the network asks for goes by this post.
    #[must_use]
    pub fn start(&self, orders: &OrderSender) -> Sinks {
        sinks::start_sinks(&self.sinks, orders, (&self.outbox, &self.board), &self.history)
    }

    /// Threads that may be needed for what cannot be waited for asynchronously: reading the outbox, and a line.
    #[must_use]
    pub fn count_threads(&self) -> usize {
        2 * self.sinks.len()
    }
}
