//! Writing a verdict to the machine, reading it back, and giving the machine back to its operator.

use super::arming::Disarmed;
use super::verdict::Verdict;
use adapters::clock::{Clock, SECOND_NS, TimeNs};
use adapters::units::OverridePct;
use adapters::{Actuator, SourceError};
use std::collections::VecDeque;
use std::fmt;

/// An unchanged override is written again after this time: the sign of life that the machine's ladder waits for.
const HEARTBEAT_NS: i64 = SECOND_NS / 2;
/// The machine may show an older override for this long: a ladder needs a few scans.
const SETTLE_NS: i64 = SECOND_NS;

/// One write, for the history.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// When.
    pub at_ns: TimeNs,
    /// The override before, as read, where it could be read.
    pub before: Option<OverridePct>,
    /// What was written.
    pub asked: OverridePct,
    /// What was read back, where it could be read.
    pub after: Option<OverridePct>,
    /// What went wrong.
    pub fault: Option<Fault>,
}

/// Why the machine is not written to any more. The gate is to be disarmed with [`Fault::disarmed`], and an alarm raised.
#[derive(Debug, Clone, PartialEq)]
pub enum Fault {
    /// The machine shows another override than any that was written in the last second.
    ReadBack {
        /// Written last.
        asked: OverridePct,
        /// Read back.
        found: OverridePct,
    },
    /// Writing or reading back failed.
    Line(SourceError),
}

impl Fault {
    /// The reason the gate is disarmed with.
    #[must_use]
    pub fn disarmed(&self) -> Disarmed {
        match self {
            Self::ReadBack { .. } => Disarmed::ReadBack,
            Self::Line(_) => Disarmed::Line,
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ReadBack { asked, found } => write!(
                f,
                "feed override {asked} was written and {found} is in force: the machine does not take it; the gate is disarmed. \
                 Look whether the ladder passes the gateway's override on, and whether the dial limits it"
            ),
            Self::Line(error) => write!(f, "the feed override could not be written; the gate is disarmed. {error}"),
        }
    }
}

/// Holds the only actuator there is. Blocks as long as the machine takes to answer, so it belongs on its own thread.
pub struct Writer<A> {
    actuator: A,
    /// What was written in the last second, the newest at the end; before the first write, what was found.
    recent: VecDeque<(TimeNs, OverridePct)>,
    holding: bool,
}

impl<A: Actuator> Writer<A> {
    /// Nothing is written until a verdict says so.
    pub fn new(actuator: A) -> Self {
        Self { actuator, recent: VecDeque::new(), holding: false }
    }

    /// The actuator, for its name.
    pub fn actuator(&self) -> &A {
        &self.actuator
    }

    /// Writes what an armed verdict permits, when it has changed or the sign of life is due. The first verdict that is
    /// not armed any more gives the machine back at 100 %. Anything else writes nothing.
    pub fn step(&mut self, verdict: &Verdict, clock: &dyn Clock) -> Option<Written> {
        if verdict.armed {
            return self.due(verdict).then(|| self.write(verdict.permitted, clock));
        }
        self.release(clock)
    }

    /// Gives the machine back at 100 %, if it was being written to.
    pub fn release(&mut self, clock: &dyn Clock) -> Option<Written> {
        let was_holding = std::mem::take(&mut self.holding);
        let written = was_holding.then(|| self.write(OverridePct::FULL, clock));
        self.holding = false;
        if was_holding {
            self.recent.clear();
        }
        written
    }

    fn due(&self, verdict: &Verdict) -> bool {
        let last = self.recent.back().filter(|_| self.holding);
        last.is_none_or(|(at_ns, pct)| *pct != verdict.permitted || verdict.at_ns - at_ns >= HEARTBEAT_NS)
    }

    fn write(&mut self, asked: OverridePct, clock: &dyn Clock) -> Written {
        let at_ns = clock.now_ns();
        let before = match self.recent.back() {
            Some((_, pct)) => Some(*pct),
            None => self.actuator.read_feed_override(clock).ok(),
        };
        if let Some(found) = before.filter(|_| self.recent.is_empty()) {
            self.recent.push_back((at_ns, found));
        }
        self.holding = true;
        self.recent.push_back((at_ns, asked));
        let outcome = self.actuator.write_feed_override(clock, asked);
        let (after, fault) = match outcome.and_then(|()| self.actuator.read_feed_override(clock)) {
            Ok(found) => (Some(found), self.mismatch(asked, found, at_ns)),
            Err(error) => (None, Some(Fault::Line(error))),
        };
        Written { at_ns, before, asked, after, fault }
    }

    fn mismatch(&mut self, asked: OverridePct, found: OverridePct, at_ns: TimeNs) -> Option<Fault> {
        // The newest write that is older than the settling time is still allowed: it was in force when that time began.
        while self.recent.get(1).is_some_and(|(next_ns, _)| at_ns - next_ns >= SETTLE_NS) {
            self.recent.pop_front();
        }
        let known = self.recent.iter().any(|(_, pct)| *pct == found);
        (!known).then_some(Fault::ReadBack { asked, found })
    }
}
