//! A receiver inside the test: takes items, fails when it is told to, and remembers everything.

use gateway::sinks::{Batch, Pending, Sink, SinkError};
use std::sync::{Arc, Mutex};

/// What the receiver has seen, and how it shall behave.
#[derive(Debug, Default)]
pub(crate) struct Seen {
    /// Number, and whether it came as history.
    pub(crate) items: Vec<(u64, bool)>,
    pub(crate) connections: u32,
    /// While set, nothing connects and nothing is taken.
    pub(crate) down: bool,
    /// Numbers that are never taken.
    pub(crate) poison: Vec<u64>,
    /// Fails after this many further items, in the middle of a batch.
    pub(crate) fails_after: Option<usize>,
}

/// The receiver; clones of `seen` are its memory.
pub(crate) struct FakeSink {
    pub(crate) seen: Arc<Mutex<Seen>>,
    pub(crate) batch: usize,
    pub(crate) takes_history: bool,
}

fn down() -> SinkError {
    SinkError::failed_line("the receiver is down", "wait")
}

impl Sink for FakeSink {
    fn connect(&mut self) -> Pending<'_, Result<(), SinkError>> {
        let mut seen = self.seen.lock().expect("whole");
        let result = if seen.down { Err(down()) } else { Ok(()) };
        seen.connections += u32::from(result.is_ok());
        Box::pin(std::future::ready(result))
    }

    fn send_batch<'a>(&'a mut self, batch: Batch<'a>) -> Pending<'a, Result<(), SinkError>> {
        Box::pin(async move {
            assert!(!batch.items.is_empty() && batch.items.len() <= self.batch, "a batch of {}", batch.items.len());
            let mut seen = self.seen.lock().expect("whole");
            for item in batch.items {
                if seen.down {
                    return Err(down());
                }
                if let Some(left) = &mut seen.fails_after {
                    if *left == 0 {
                        seen.fails_after = None;
                        return Err(down());
                    }
                    *left -= 1;
                }
                if seen.poison.contains(&item.sequence) {
                    let (what, next) = ("too large".to_owned(), "shorten it".to_owned());
                    return Err(SinkError::Item { sequence: item.sequence, what, next });
                }
                seen.items.push((item.sequence, batch.historical));
            }
            Ok(())
        })
    }

    fn takes_history(&self) -> bool {
        self.takes_history
    }

    fn items_max(&self) -> usize {
        self.batch
    }
}
