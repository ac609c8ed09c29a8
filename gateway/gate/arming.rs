//! Who let the gate write, and until when. Off after every start.

use crate::limits::GateMode;
use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::integer::saturate_to_ns;
use std::fmt;
use std::time::Duration;
use thiserror::Error;

/// Somebody armed the gate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Armed {
    /// Name of the person, for status and audit.
    pub by: String,
    /// When it was armed, ns since 1970.
    pub since_ns: TimeNs,
    /// Until when, by itself.
    pub until_ns: TimeNs,
}

/// Why the gate is not armed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Disarmed {
    /// Nobody has armed it since the start.
    Start,
    /// A person has disarmed it.
    Person,
    /// The time was over.
    Expired,
    /// What was read back was not what had been written.
    ReadBack,
    /// The control shows another offset than the one that was written.
    Offset,
    /// The machine could not be written to or read back.
    Line,
    /// The clock of the box was set.
    Clock,
    /// The machine has given no fresh values for ten seconds.
    Silent,
    /// Nothing is being stored: what cannot be accounted for is not written.
    NoAudit,
    /// A thread of the gateway broke off.
    Thread,
    /// The configuration lets no override be written.
    Mode,
}

impl Disarmed {
    /// The word in the audit.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Person => "person",
            Self::Expired => "expired",
            Self::ReadBack => "read_back",
            Self::Offset => "offset",
            Self::Line => "line",
            Self::Clock => "clock",
            Self::Silent => "silent",
            Self::NoAudit => "no_audit",
            Self::Thread => "thread",
            Self::Mode => "mode",
        }
    }
}

impl fmt::Display for Disarmed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Start => "not armed since the start",
            Self::Person => "disarmed by a person",
            Self::Expired => "the time of arming is over",
            Self::ReadBack => "the machine did not take the override that was written",
            Self::Offset => "the control did not take the offset that was written",
            Self::Line => "the machine could not be reached",
            Self::Clock => "the clock of the box was set",
            Self::NoAudit => "the history takes nothing, so nothing can be accounted for",
            Self::Thread => "a thread of the gateway broke off",
            Self::Mode => "`mode` under [gate] is not \"armed\"",
            Self::Silent => "no fresh values from the machine for ten seconds",
        })
    }
}

/// Why the gate cannot be armed.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ArmError {
    /// The configuration does not allow it.
    #[error(
        "the gate cannot be armed: `mode` under [gate] is {0:?}; write mode = \"armed\" and source = \"...\" and start again"
    )]
    Mode(&'static str),
    /// A person has to answer for it.
    #[error("the gate cannot be armed: say who arms it")]
    Nobody,
    /// Longer than the configuration allows, or no time at all.
    #[error(
        "the gate cannot be armed for that long: give more than nothing and at most {0} s (`armed_for_s` under [gate])"
    )]
    Lasts(u64),
    /// What is written could not be accounted for.
    #[error("the gate cannot be armed: the history takes nothing at the moment; `cnc-gateway history info` says more")]
    NoAudit,
    /// A thread that is needed broke off and is not started again.
    #[error(
        "the gate cannot be armed: the thread {0:?} of the gateway broke off; start the gateway again, and report it with the log"
    )]
    ThreadGone(String),
}

#[derive(Debug)]
pub(super) struct Arming {
    mode: GateMode,
    lasts_ns: i64,
    state: Result<Armed, Disarmed>,
    /// When there were fresh values last, or the gate was armed.
    fresh_ns: TimeNs,
    /// The thread whose end forbids arming.
    gone: Option<String>,
}

/// Without fresh values for this long, somebody has to look before the gate writes again.
const SILENT_NS: i64 = 10 * SECOND_NS;

impl Arming {
    pub(super) fn new(mode: GateMode, lasts: Duration) -> Self {
        let lasts_ns = saturate_to_ns(lasts);
        Self { mode, lasts_ns, state: Err(Disarmed::Start), fresh_ns: TimeNs::MIN, gone: None }
    }

    pub(super) fn arm(&mut self, by: &str, lasts: Option<Duration>, at_ns: TimeNs) -> Result<&Armed, ArmError> {
        if self.mode != GateMode::Armed {
            return Err(ArmError::Mode(self.mode.as_word()));
        }
        if let Some(thread) = &self.gone {
            return Err(ArmError::ThreadGone(thread.clone()));
        }
        if by.trim().is_empty() {
            return Err(ArmError::Nobody);
        }
        let lasts_ns = lasts.map_or(self.lasts_ns, saturate_to_ns);
        if !(1..=self.lasts_ns).contains(&lasts_ns) {
            return Err(ArmError::Lasts(self.lasts_ns.unsigned_abs() / 1_000_000_000));
        }
        let until_ns = at_ns.saturating_add(lasts_ns);
        self.fresh_ns = at_ns;
        self.state = Ok(Armed { by: by.trim().to_owned(), since_ns: at_ns, until_ns });
        self.state.as_ref().map_err(|_| ArmError::Nobody)
    }

    pub(super) fn forbid_arming(&mut self, thread: &str) {
        self.gone.get_or_insert_with(|| thread.to_owned());
    }

    pub(super) fn disarm(&mut self, why: Disarmed) {
        if self.state.is_ok() {
            self.state = Err(why);
        }
    }

    /// Ends an arming whose time is over.
    pub(super) fn end_if_expired(&mut self, at_ns: TimeNs) {
        match &self.state {
            Ok(armed) if at_ns >= armed.until_ns => self.disarm(Disarmed::Expired),
            Ok(armed) if at_ns < armed.since_ns => self.disarm(Disarmed::Clock),
            _ => {}
        }
    }

    /// Told at every tick whether fresh values are missing. A tick that comes late counts like values that come late: a process
    /// that stood still has seen nothing meanwhile, whatever it sees now.
    pub(super) fn end_if_silent(&mut self, missing: bool, at_ns: TimeNs) {
        if at_ns.saturating_sub(self.fresh_ns) >= SILENT_NS {
            self.disarm(Disarmed::Silent);
        }
        if !missing {
            self.fresh_ns = at_ns;
        }
    }

    pub(super) fn state(&self) -> Result<&Armed, Disarmed> {
        self.state.as_ref().map_err(|why| *why)
    }
}
