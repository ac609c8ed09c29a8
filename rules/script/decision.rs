//! What the scripts want after one tick.

use super::problem::ScriptProblem;
use adapter_core::clock::TimeNs;
use std::sync::Arc;

pub use adapter_core::Axis;
pub use adapter_core::request::{OffsetProposal, OverrideRequest, Stop, StopRequest};

/// What the scripts want. Alarms and notes are changes: an unchanged tick has none. Requests and proposals are what is
/// wanted now: they are repeated at every tick for as long as the script asks.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Decision {
    /// Time of the sample that was decided on, ns.
    pub at_ns: TimeNs,
    /// The feed override asked for; `None` means the programmed feed, 100 %.
    pub request: Option<OverrideRequest>,
    /// Feed holds and tool changes asked for, no two the same ([`Stop::is_same_request`]): the first script's that asks.
    pub stops: Vec<StopRequest>,
    /// Thermal offsets proposed, at most one per axis: the first script's that proposes.
    pub offsets: Vec<OffsetProposal>,
    /// Alarms raised or cleared at this tick.
    pub alarms: Vec<AlarmChange>,
    /// Lines for the history.
    pub notes: Vec<Note>,
    /// Scripts that failed at this tick.
    pub problems: Vec<ScriptProblem>,
    /// Programs whose load is to be learned anew.
    pub learn_anew: Vec<Arc<str>>,
}

/// A channel of a script's own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Published<'a> {
    /// Name of the channel, as the script gave it.
    pub name: &'a str,
    /// Unit symbol; `1` for pure numbers.
    pub unit: &'a str,
    /// File name of the script that publishes it.
    pub script: &'a Arc<str>,
    /// The newest value, finite, while the script publishes one.
    pub value: Option<f64>,
}

/// How grave an alarm is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum AlarmLevel {
    /// Something to know; nothing has to be done.
    Info,
    /// Something to look at in time.
    Warning,
    /// To act on at once.
    Critical,
}

impl AlarmLevel {
    /// Every level, the least first.
    pub const ALL: [Self; 3] = [Self::Info, Self::Warning, Self::Critical];

    /// The word in scripts, in the history and in JSON.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::Info => "info",
            Self::Warning => "warning",
            Self::Critical => "critical",
        }
    }

    /// The level of this word.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|level| level.as_word() == word)
    }
}

/// An alarm that began or ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AlarmChange {
    /// Name given by the script; [`SCRIPT_STOPPED`] for the host's own.
    pub name: Arc<str>,
    /// File name of the script that raised it.
    pub script: Arc<str>,
    /// How grave the alarm is.
    pub level: AlarmLevel,
    /// What the operator reads, English.
    pub en: Arc<str>,
    /// What the operator reads, Chinese; the same as `en` where the script gives one text.
    pub zh: Arc<str>,
    /// Did it begin at this tick? Otherwise it ended.
    pub raised: bool,
}

/// The alarm that the host itself raises while a script is suspended or an older version is in charge.
pub const SCRIPT_STOPPED: &str = "script_stopped";

/// An alarm that stands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Alarm {
    /// Name given by the script.
    pub name: Arc<str>,
    /// File name of the script that raised it.
    pub script: Arc<str>,
    /// How grave the alarm is.
    pub level: AlarmLevel,
    /// What the operator reads, English.
    pub en: Arc<str>,
    /// What the operator reads, Chinese.
    pub zh: Arc<str>,
    /// Time of the sample at which it was raised, or raised anew with another text, ns.
    pub since_ns: TimeNs,
}

impl Alarm {
    /// The change that begins it, or ends it.
    #[must_use]
    pub(super) fn to_change(&self, raised: bool) -> AlarmChange {
        let Self { name, script, level, en, zh, .. } = self.clone();
        AlarmChange { name, script, level, en, zh, raised }
    }
}

/// A line for the history.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// File name of the script that wrote it.
    pub script: Arc<str>,
    /// The line, as the script wrote it.
    pub text: Arc<str>,
}
