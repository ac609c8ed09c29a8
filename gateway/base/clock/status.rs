//! The clock of the box, for the status.

use super::Trust;
use serde::Serialize;

/// The clock of the box.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ClockStatus {
    /// What is thought of the wall clock: `unset`, `plausible`, `confirmed` or `leapt`. In all but the last two times may
    /// be corrected later.
    pub trust: Trust,
    /// Wall clock minus the time of the box, s; 0 while they agree.
    pub wall_ahead_s: f64,
}
