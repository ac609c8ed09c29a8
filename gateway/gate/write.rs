//! Writing a verdict to the machine, reading it back, and giving the machine back to its operator.
//!
//! An override is written when it has changed, at most once per `min_interval_s`, and again after `heartbeat_s` as the sign
//! of life that the ladder waits for. What is in force is read back until it is what the ladder's rule makes of the dial and
//! of what was written: the time of that is the step's reaction time. What is anything else when the machine has had its time
//! to settle ends the arming.

use super::fault::Fault;
use super::verdict::{Outcome, Verdict};
use crate::config;
use adapters::clock::{Clock, SECOND_NS, TimeNs};
use adapters::units::OverridePct;
use adapters::{Actuator, LadderRequest, LadderRule, SourceError};
use std::collections::VecDeque;

/// Why the writer wrote.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Occasion {
    /// Another override than before.
    Change,
    /// The same again.
    SignOfLife,
    /// The machine is given back to its dial.
    Release,
}

impl Occasion {
    /// In the words of the history.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Change => "the override was changed",
            Self::SignOfLife => "the sign of life",
            Self::Release => "the machine was given back to its dial",
        }
    }
}

/// One write, for the history.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// When it was issued.
    pub at_ns: TimeNs,
    /// The sample that led to it.
    pub sample_ns: TimeNs,
    /// Why.
    pub occasion: Occasion,
    /// The override in force before, as read, where it could be read.
    pub before: Option<OverridePct>,
    /// What was written.
    pub asked: OverridePct,
    /// What was read back right after, where it could be read; a ladder needs a few scans.
    pub after: Option<OverridePct>,
    /// What went wrong.
    pub fault: Option<Fault>,
}

/// A step of the override that the machine has been seen to take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reaction {
    /// What was written.
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

/// A ladder waits for at least so many signs of life (`heartbeat_s` is at most a third of its patience).
const HEARTBEATS_PATIENCE: i64 = 3;

/// How the writer keeps its pace, from `[gate]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Pace {
    interval_ns: i64,
    heartbeat_ns: i64,
    rule: LadderRule,
}

/// A change that has not been seen in force yet.
#[derive(Debug, Clone, Copy)]
struct Pending {
    asked: OverridePct,
    sample_ns: TimeNs,
    issued_ns: TimeNs,
}

/// Holds the only actuator there is. Blocks as long as the machine takes to answer, so it belongs on its own thread.
pub struct Writer<A> {
    actuator: A,
    pace: Pace,
    settle_ns: i64,
    /// What was written while the machine settles, the newest at the end; before the first write, what was in force.
    recent: VecDeque<(TimeNs, OverridePct)>,
    /// Positions of the dial over the same time.
    dials: VecDeque<(TimeNs, OverridePct)>,
    dial_is_known: bool,
    holding: bool,
    /// Something went wrong: nothing is written until a verdict that is not armed has been seen.
    failed: bool,
    changed_ns: Option<TimeNs>,
    pending: Option<Pending>,
}

impl<A: Actuator> Writer<A> {
    /// Nothing is written until a verdict says so.
    pub fn new(actuator: A, limits: &config::Gate) -> Self {
        let ns = |duration: std::time::Duration| i64::try_from(duration.as_nanos()).unwrap_or(i64::MAX);
        let rule = if limits.above_dial { LadderRule::Product } else { LadderRule::Least };
        let settle_ns = ns(actuator.settles_within()).max(SECOND_NS / 100);
        Self {
            actuator,
            pace: Pace { interval_ns: ns(limits.min_interval), heartbeat_ns: ns(limits.heartbeat), rule },
            settle_ns,
            recent: VecDeque::new(),
            dials: VecDeque::new(),
            dial_is_known: false,
            holding: false,
            failed: false,
            changed_ns: None,
            pending: None,
        }
    }

    /// The actuator, for its name.
    pub fn actuator(&self) -> &A {
        &self.actuator
    }

    /// Writes what an armed verdict permits, when it has changed or the sign of life is due. The first verdict that is
    /// not armed any more gives the machine back to its dial. Anything else writes nothing; neither does an armed verdict
    /// after a fault, until one that is not armed has been seen.
    pub fn step(&mut self, verdict: &Verdict, clock: &dyn Clock) -> Option<Written> {
        if !verdict.armed {
            self.failed = false;
            return self.release(clock);
        }
        if self.failed {
            return None;
        }
        let at_ns = clock.now_ns();
        let occasion = self.due(verdict, at_ns)?;
        let written = match self.interrupted(at_ns, clock) {
            None => self.write(occasion, verdict.permitted, verdict.at_ns, clock)?,
            fault => {
                let (asked, sample_ns) = (verdict.permitted, verdict.at_ns);
                Written { at_ns, sample_ns, occasion, before: None, asked, after: None, fault }
            }
        };
        self.failed = written.fault.is_some();
        Some(written)
    }

    /// Signs of life have failed for longer than the ladder waits, and it has taken the dial back: going on from there
    /// would be a leap.
    fn interrupted(&mut self, now_ns: TimeNs, clock: &dyn Clock) -> Option<Fault> {
        let (at_ns, asked) = *self.recent.back().filter(|_| self.holding)?;
        let silent = self.late(at_ns, now_ns)?;
        let fallen_back = match self.read(clock) {
            Ok(found) => self.mismatch(asked, found, now_ns).is_some(),
            // Writing meets it too, and knows what it means.
            Err(SourceError::Off { .. }) => false,
            Err(_) => true,
        };
        fallen_back.then_some(silent)
    }

    /// More time than the ladder has patience for has passed.
    fn late(&self, from_ns: TimeNs, to_ns: TimeNs) -> Option<Fault> {
        let silent_ns = to_ns - from_ns;
        let patience_ns = self.pace.heartbeat_ns.saturating_mul(HEARTBEATS_PATIENCE);
        (silent_ns > patience_ns).then_some(Fault::Late { silent_ms: silent_ns / 1_000_000 })
    }

    /// Gives the machine back to its dial, if it was being written to.
    pub fn release(&mut self, clock: &dyn Clock) -> Option<Written> {
        let was_holding = std::mem::take(&mut self.holding);
        let now_ns = clock.now_ns();
        let written = was_holding.then(|| self.write(Occasion::Release, OverridePct::FULL, now_ns, clock)).flatten();
        self.holding = false;
        if was_holding {
            self.begin_anew();
        }
        written
    }

    fn begin_anew(&mut self) {
        (self.pending, self.changed_ns, self.holding) = (None, None, false);
        self.recent.clear();
        self.dials.clear();
    }

    /// Asks the ladder for a feed hold or a stop.
    ///
    /// # Errors
    /// What the driver says.
    pub fn ask(&mut self, request: LadderRequest, clock: &dyn Clock) -> Result<(), SourceError> {
        self.actuator.ask(clock, request)
    }

    /// Is a change still to be seen in force?
    #[must_use]
    pub fn is_waiting(&self) -> bool {
        self.pending.is_some()
    }

    /// Reads back whether the last change is in force. `None` while the machine may still need its time.
    pub fn look(&mut self, clock: &dyn Clock) -> Option<Result<Reaction, Fault>> {
        let pending = self.pending?;
        let found = match self.read(clock) {
            Ok(found) => found,
            Err(SourceError::Off { .. }) => {
                self.begin_anew();
                return None;
            }
            Err(error) => return self.give_up(Fault::Line(error)),
        };
        let now_ns = clock.now_ns();
        if self.dials.iter().any(|(_, dial)| self.pace.rule.combine(*dial, pending.asked) == found) {
            self.pending = None;
            let Pending { asked, sample_ns, issued_ns } = pending;
            return Some(Ok(Reaction { asked, found, sample_ns, issued_ns, seen_ns: now_ns }));
        }
        let over = now_ns - pending.issued_ns >= self.settle_ns;
        let fault = if over {
            Some(Fault::ReadBack { asked: pending.asked, found })
        } else {
            self.mismatch(pending.asked, found, now_ns)
        };
        fault.and_then(|fault| self.give_up(fault))
    }

    fn give_up(&mut self, fault: Fault) -> Option<Result<Reaction, Fault>> {
        (self.pending, self.failed) = (None, true);
        Some(Err(fault))
    }

    /// Going back to 100 % does not wait for the least interval between two changes.
    fn due(&self, verdict: &Verdict, now_ns: TimeNs) -> Option<Occasion> {
        let Some((at_ns, pct)) = self.recent.back().filter(|_| self.holding) else { return Some(Occasion::Change) };
        let back = matches!(verdict.outcome, Outcome::Held(_) | Outcome::Refused);
        let rested = self.changed_ns.is_none_or(|changed_ns| now_ns - changed_ns >= self.pace.interval_ns);
        if *pct != verdict.permitted && (rested || back) {
            return Some(Occasion::Change);
        }
        (now_ns - at_ns >= self.pace.heartbeat_ns).then_some(Occasion::SignOfLife)
    }

    /// A machine that is switched off is written nothing, which is no fault.
    fn write(
        &mut self,
        occasion: Occasion,
        wanted: OverridePct,
        sample_ns: TimeNs,
        clock: &dyn Clock,
    ) -> Option<Written> {
        let at_ns = clock.now_ns();
        let before = self.before(at_ns, clock);
        // The sign of life repeats what is written, also while another override waits for its interval.
        let asked = match self.recent.back() {
            Some((_, last)) if occasion == Occasion::SignOfLife => *last,
            _ => wanted,
        };
        self.holding = true;
        self.recent.push_back((at_ns, asked));
        let sent = match occasion {
            Occasion::Release => self.actuator.release(clock),
            _ => self.actuator.write_feed_override(clock, asked),
        };
        if occasion == Occasion::Change {
            self.changed_ns = Some(at_ns);
            self.pending = Some(Pending { asked, sample_ns, issued_ns: at_ns });
        }
        let late = self.late(at_ns, clock.now_ns()).filter(|_| occasion != Occasion::Release);
        let (after, fault) = match sent.and_then(|()| self.read(clock)) {
            Ok(found) => (Some(found), self.mismatch(asked, found, at_ns).or(late)),
            Err(SourceError::Off { .. }) => {
                self.begin_anew();
                return None;
            }
            Err(error) => (None, Some(Fault::Line(error))),
        };
        Some(Written { at_ns, sample_ns, occasion, before, asked, after, fault })
    }

    /// What is in force before the first write; later, what was written last.
    fn before(&mut self, at_ns: TimeNs, clock: &dyn Clock) -> Option<OverridePct> {
        if let Some((_, pct)) = self.recent.back() {
            return Some(*pct);
        }
        let found = self.read(clock).ok()?;
        // 100 % is what a ladder with a dial makes its dial of; without a known dial the override found is what may be seen.
        let neutral = if self.dial_is_known { OverridePct::FULL } else { found };
        self.recent.push_back((at_ns, neutral));
        Some(found)
    }

    /// The override in force; notes the dial beside it.
    fn read(&mut self, clock: &dyn Clock) -> Result<OverridePct, SourceError> {
        let found = self.actuator.read_feed_override(clock)?;
        let dial = self.actuator.read_dial(clock)?;
        self.dial_is_known = dial.is_some();
        // A dial that nobody knows does not limit: what is written is what has to be in force.
        let dial = dial.unwrap_or(match self.pace.rule {
            LadderRule::Least => OverridePct::GREATEST,
            LadderRule::Product => OverridePct::FULL,
        });
        let now_ns = clock.now_ns();
        if self.dials.back().is_none_or(|(_, last)| *last != dial) {
            self.dials.push_back((now_ns, dial));
        }
        self.forget(now_ns);
        Ok(found)
    }

    /// The newest of what is older than the settling time is still allowed: it was in force when that time began.
    fn forget(&mut self, now_ns: TimeNs) {
        let old = |line: &VecDeque<(TimeNs, OverridePct)>| {
            line.get(1).is_some_and(|(next_ns, _)| now_ns - next_ns >= self.settle_ns)
        };
        while old(&self.recent) {
            self.recent.pop_front();
        }
        while old(&self.dials) {
            self.dials.pop_front();
        }
    }

    fn mismatch(&mut self, asked: OverridePct, found: OverridePct, now_ns: TimeNs) -> Option<Fault> {
        self.forget(now_ns);
        let rule = self.pace.rule;
        let known =
            self.recent.iter().any(|(_, pct)| self.dials.iter().any(|(_, dial)| rule.combine(*dial, *pct) == found));
        (!known).then_some(Fault::ReadBack { asked, found })
    }
}
