//! What the writer tells of its writes.

use crate::fault::Fault;
use adapter_core::clock::TimeNs;
use adapter_core::override_pct::OverridePct;

/// Why the writer wrote.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Occasion {
    /// Another override than before.
    Change,
    /// The same override again, so that the ladder keeps it.
    SignOfLife,
    /// The machine is given back to its dial.
    Release,
    /// What an earlier run had left enabled is withdrawn.
    Leftover,
}

impl Occasion {
    /// In the words of the history.
    #[must_use]
    pub fn as_words(self) -> &'static str {
        match self {
            Self::Change => "the override was changed",
            Self::SignOfLife => "the sign of life",
            Self::Release => "the machine was given back to its dial",
            Self::Leftover => "an override that an earlier run had left enabled was withdrawn",
        }
    }
}

/// One write, for the history.
#[derive(Debug, Clone, PartialEq)]
pub struct WriteRecord {
    /// When it was issued.
    pub at_ns: TimeNs,
    /// The sample that led to it.
    pub sample_ns: TimeNs,
    /// What made the writer write.
    pub occasion: Occasion,
    /// The override in force before, as read, where it could be read.
    pub before: Option<OverridePct>,
    /// The override that was written.
    pub asked: OverridePct,
    /// What was read back right after, where it could be read; a ladder needs a few scans.
    pub after: Option<OverridePct>,
    /// What went wrong; `None`: nothing did.
    pub fault: Option<Fault>,
}

/// A step of the override that the machine has been seen to take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reaction {
    /// The override that was written.
    pub asked: OverridePct,
    /// What is in force.
    pub found: OverridePct,
    /// The sample that led to it.
    pub sample_ns: TimeNs,
    /// When it was written.
    pub issued_ns: TimeNs,
    /// When it was seen to be in force.
    pub seen_ns: TimeNs,
}
