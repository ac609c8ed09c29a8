//! What the scripts want after one tick.

use super::problem::Problem;
use adapters::clock::TimeNs;
use std::sync::Arc;

/// What the scripts want. Alarms and notes are changes: an unchanged tick has none.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Decision {
    /// The tick.
    pub at_ns: TimeNs,
    /// The feed override asked for; `None` means the programmed feed, 100 %.
    pub request: Option<OverrideRequest>,
    /// Alarms raised or cleared at this tick.
    pub alarms: Vec<AlarmChange>,
    /// Lines for the history.
    pub notes: Vec<Note>,
    /// Scripts that failed at this tick.
    pub problems: Vec<Problem>,
}

/// A request to the gate. Nothing has been checked: the number may be anything, NaN included.
#[derive(Debug, Clone, PartialEq)]
pub struct OverrideRequest {
    /// Percent of the programmed feed.
    pub pct: f64,
    /// Why, in the script's words.
    pub reason: Arc<str>,
    /// Which script.
    pub script: Arc<str>,
    /// Which version of it.
    pub version: u64,
}

/// An alarm that began or ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AlarmChange {
    /// Name given by the script; [`SCRIPT_STOPPED`] for the host's own.
    pub name: Arc<str>,
    /// Which script.
    pub script: Arc<str>,
    /// What the operator reads.
    pub text: Arc<str>,
    /// Began, or ended.
    pub raised: bool,
}

/// The alarm that the host itself raises while a script is suspended or an older version is in charge.
pub const SCRIPT_STOPPED: &str = "script_stopped";

/// An alarm that stands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Alarm {
    /// Name given by the script.
    pub name: Arc<str>,
    /// Which script.
    pub script: Arc<str>,
    /// What the operator reads.
    pub text: Arc<str>,
    /// Since when.
    pub since_ns: TimeNs,
}

/// A line for the history.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// Which script.
    pub script: Arc<str>,
    /// What it says.
    pub text: Arc<str>,
}
