//! How long a question may take.

use std::time::{Duration, Instant};

/// Longest time for a whole document, however slowly it comes: below the ten seconds after which a poll is shown as stuck.
pub const REQUEST_MAX: Duration = Duration::from_secs(8);

/// A question is answered by then, and the agent is never silent for longer than `silence`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Deadline {
    pub(crate) silence: Duration,
    began: Instant,
}

impl Deadline {
    pub(crate) fn begin(silence: Duration) -> Self {
        Self { silence, began: Instant::now() }
    }

    /// How long to wait for the next bytes; `None` when the time is over.
    pub(crate) fn find_wait(&self) -> Option<Duration> {
        let left = REQUEST_MAX.checked_sub(self.began.elapsed()).filter(|left| !left.is_zero())?;
        Some(left.min(self.silence))
    }
}
