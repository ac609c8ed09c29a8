//! What the gateway knows and `rules` must not: how long a run of a script has lasted.

use gateway_base::convert::duration_to_unsigned_ns;
use rules::script::Deadline;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// A run of a script lasts no longer, whatever the load of the box.
pub const RUN_MAX: Duration = Duration::from_millis(50);

/// Stops runs that last longer than a limit of real time.
#[derive(Debug)]
pub struct RunLimit {
    origin: Instant,
    /// Since the origin, ns.
    began_ns: AtomicU64,
    limit_ns: u64,
}

impl RunLimit {
    /// Stops runs that last longer than `limit` of real time.
    #[must_use]
    pub fn new(limit: Duration) -> Self {
        let limit_ns = duration_to_unsigned_ns(limit);
        Self { origin: Instant::now(), began_ns: AtomicU64::new(0), limit_ns }
    }

    fn since_ns(&self) -> u64 {
        duration_to_unsigned_ns(self.origin.elapsed())
    }
}

impl Deadline for RunLimit {
    fn begin_run(&self) {
        self.began_ns.store(self.since_ns(), Ordering::Relaxed);
    }

    fn is_over(&self) -> bool {
        self.since_ns().saturating_sub(self.began_ns.load(Ordering::Relaxed)) > self.limit_ns
    }
}
