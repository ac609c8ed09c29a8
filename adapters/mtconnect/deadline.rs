//! How long a question may take.

use std::time::{Duration, Instant};

/// Longest time for all that is asked at one poll, however slowly it comes: below the ten seconds after which a poll is shown as stuck.
pub const REQUEST_MAX: Duration = Duration::from_secs(8);
/// And no longer than so many times the longest silence: a poll asks three questions at most.
const SILENCES_MAX: u32 = 4;

/// The questions of one poll are answered by then, and the agent is never silent for longer than `silence`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Deadline {
    pub(crate) silence: Duration,
    most: Duration,
    began: Instant,
}

impl Deadline {
    pub(crate) fn begin(silence: Duration) -> Self {
        Self { silence, most: REQUEST_MAX.min(silence.saturating_mul(SILENCES_MAX)), began: Instant::now() }
    }

    /// How long to wait for the next bytes; `None` when the time is over.
    pub(crate) fn find_wait(&self) -> Option<Duration> {
        let left = self.most.checked_sub(self.began.elapsed()).filter(|left| !left.is_zero())?;
        Some(left.min(self.silence))
    }
}
