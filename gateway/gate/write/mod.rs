//! Writing a verdict to the machine, reading it back, and giving the machine back to its operator.
//!
//! Something is written only while an override is asked for that the operator's dial does not make meaningless: the box says
//! nothing at 100 %, and nothing at or above the dial where the ladder takes the lesser of the two. Then the enable byte is
//! withdrawn and the dial counts, whatever the ladder makes of an override. A withdrawal that the machine refuses is repeated
//! until it is taken, and what an earlier run left enabled is withdrawn at the first contact.
//!
//! An override is written when it has changed, at most once per `min_interval_s`, and again after `heartbeat_s` as the sign
//! of life that the ladder waits for. What is in force is read back until it is what the ladder's rule makes of the dial and
//! of what was written: the time of that is the step's reaction time. What is anything else when the machine has had its time
//! to settle ends the arming.

mod record;
mod withdraw;
mod withdrawal;

pub use record::{Occasion, Reaction, WriteRecord};

use super::fault::{Fault, UnexpectedReading};
use super::verdict::{GateOutcome, Verdict};
use crate::limits::GateConfig;
use adapter_core::clock::{Clock, SECOND_NS, TimeNs};
use adapter_core::integer::saturate_to_ns as ns;
use adapter_core::override_pct::OverridePct;
use adapter_core::{Actuator, LadderRequest, LadderRule, SourceError};
use std::collections::VecDeque;
use std::sync::Arc;
use withdrawal::Owed;

/// A ladder waits for at least so many signs of life (`heartbeat_s` is at most a third of its patience).
const HEARTBEATS_PATIENCE: i64 = 3;

/// Where every write is accounted for. Something is written to the machine only while this is there.
pub trait AuditPath: Send + Sync {
    /// Is what is written now stored? Asked before each write, by the thread that writes.
    fn is_live(&self) -> bool;
}

impl AuditPath for Arc<dyn AuditPath> {
    fn is_live(&self) -> bool {
        (**self).is_live()
    }
}

/// The audit was there a moment ago: what a write needs. Made by [`OverrideWriter::ask_audit`] only.
struct LiveAudit(());

/// How the writer keeps its pace, from `[gate]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct WriteSchedule {
    interval_ns: i64,
    heartbeat_ns: i64,
    rule: LadderRule,
}

/// A change that has not been seen in force yet.
#[derive(Debug, Clone, Copy)]
struct PendingWrite {
    /// `None`: the dial has to be in force again.
    asked: Option<OverridePct>,
    sample_ns: TimeNs,
    issued_ns: TimeNs,
}

/// Holds the only actuator there is. Blocks as long as the machine takes to answer, so it belongs on its own thread.
pub struct OverrideWriter<A> {
    actuator: A,
    audit: Box<dyn AuditPath>,
    schedule: WriteSchedule,
    settle_ns: i64,
    /// What was written while the machine settles, the newest at the end; before the first write, what was in force.
    recent: VecDeque<(TimeNs, OverridePct)>,
    /// Positions of the dial over the same time.
    dials: VecDeque<(TimeNs, OverridePct)>,
    dial_is_known: bool,
    /// An override of ours is enabled.
    holding: bool,
    owed: Option<Owed>,
    /// Something went wrong: nothing is written until a verdict that is not armed has been seen.
    failed: bool,
    /// When the machine was last looked at before anything was enabled.
    looked_ns: Option<TimeNs>,
    changed_ns: Option<TimeNs>,
    pending: Option<PendingWrite>,
}

impl<A: Actuator> OverrideWriter<A> {
    /// Nothing is written until a verdict says so, but what an earlier run has left enabled is withdrawn.
    pub fn new(actuator: A, audit: Box<dyn AuditPath>, limits: &GateConfig) -> Self {
        let rule = if limits.above_dial { LadderRule::Product } else { LadderRule::Least };
        let settle_ns = ns(actuator.settles_within()).max(SECOND_NS / 100);
        Self {
            actuator,
            audit,
            schedule: WriteSchedule { interval_ns: ns(limits.min_interval), heartbeat_ns: ns(limits.heartbeat), rule },
            settle_ns,
            recent: VecDeque::new(),
            dials: VecDeque::new(),
            dial_is_known: false,
            holding: false,
            owed: Some(Owed::from_leftover()),
            failed: false,
            looked_ns: None,
            changed_ns: None,
            pending: None,
        }
    }

    /// The actuator, for its name.
    pub fn actuator(&self) -> &A {
        &self.actuator
    }

    /// Writes what an armed verdict asks for, when it has changed or the sign of life is due. The first verdict that is not
    /// armed any more, or asks for nothing, gives the machine back to its dial. Anything else writes nothing; neither does an
    /// armed verdict after a fault, until one that is not armed has been seen. Without a live audit every verdict counts as one that is
    /// not armed.
    pub fn write_verdict(&mut self, verdict: &Verdict, clock: &dyn Clock) -> Option<WriteRecord> {
        let audit = self.ask_audit().filter(|_| verdict.armed);
        let Some(audit) = audit else {
            self.failed &= verdict.armed;
            return self.release_machine(clock);
        };
        if self.failed {
            return None;
        }
        let idle = !verdict.has_request() || self.dial_is_below(verdict.permitted);
        if idle || self.owed.is_some() {
            let written = self.track_failure(|writer| writer.release_machine(clock));
            if idle || written.is_some() || self.owed.is_some() {
                return written;
            }
        }
        let at_ns = clock.now_ns();
        let occasion = self.find_due_occasion(verdict, at_ns)?;
        let failed = |fault| {
            let (asked, sample_ns) = (verdict.permitted, verdict.at_ns);
            WriteRecord { at_ns, sample_ns, occasion, before: None, asked, after: None, fault: Some(fault) }
        };
        let begins = if self.holding { Ok(true) } else { self.may_begin(verdict.permitted, clock) };
        match (begins, self.find_interruption(at_ns, clock)) {
            (Ok(false), _) => None,
            (Err(fault), _) | (Ok(true), Some(fault)) => self.track_failure(|_| Some(failed(fault))),
            (Ok(true), None) => {
                self.track_failure(|it| it.write((occasion, audit), verdict.permitted, verdict.at_ns, clock))
            }
        }
    }

    fn ask_audit(&self) -> Option<LiveAudit> {
        self.audit.is_live().then_some(LiveAudit(()))
    }

    /// Nothing more is written after a fault.
    fn track_failure(&mut self, act: impl FnOnce(&mut Self) -> Option<WriteRecord>) -> Option<WriteRecord> {
        let written = act(self)?;
        self.failed = written.fault.is_some();
        Some(written)
    }

    /// The ladder takes the lesser one, and that is the dial: there is nothing to ask for. On a ladder that lets the override
    /// replace the dial it would raise the feed above what the operator wants.
    fn dial_is_below(&self, asked: OverridePct) -> bool {
        let dial = self.dials.back().filter(|_| self.holding && self.dial_is_known);
        self.schedule.rule == LadderRule::Least && dial.is_some_and(|(_, dial)| *dial <= asked)
    }

    /// Looks at the machine before anything is enabled: while nothing is, the override in force is the dial.
    fn may_begin(&mut self, asked: OverridePct, clock: &dyn Clock) -> Result<bool, Fault> {
        let now_ns = clock.now_ns();
        let soon = self.looked_ns.is_some_and(|at_ns| (0..self.schedule.heartbeat_ns).contains(&(now_ns - at_ns)));
        if soon {
            return Ok(false);
        }
        self.looked_ns = Some(now_ns);
        self.recent.clear();
        self.dials.clear();
        let found = match self.read(clock) {
            Ok(found) => found,
            Err(SourceError::Off { .. }) => return Ok(false),
            Err(error) => return Err(Fault::Line(error)),
        };
        let dial = self.dials.back().map_or(found, |(_, dial)| if self.dial_is_known { *dial } else { found });
        if self.schedule.rule == LadderRule::Least && dial <= asked {
            return Ok(false);
        }
        // What may be seen until the ladder has taken the first override: what it makes of the dial alone.
        let neutral = match (self.dial_is_known, self.schedule.rule) {
            (true, LadderRule::Least) => OverridePct::GREATEST,
            (true, _) => OverridePct::FULL,
            (false, _) => found,
        };
        self.recent.push_back((now_ns, neutral));
        self.looked_ns = None;
        Ok(true)
    }

    /// Signs of life have failed for longer than the ladder waits, and it has taken the dial back: going on from there
    /// would be a leap.
    fn find_interruption(&mut self, now_ns: TimeNs, clock: &dyn Clock) -> Option<Fault> {
        let (at_ns, asked) = *self.recent.back().filter(|_| self.holding)?;
        let silent = self.find_delay(at_ns, now_ns)?;
        let fallen_back = match self.read(clock) {
            Ok(found) => self.find_mismatch(asked, found, now_ns).is_some(),
            // Writing meets it too, and knows what it means.
            Err(SourceError::Off { .. }) => false,
            Err(_) => true,
        };
        fallen_back.then_some(silent)
    }

    /// More time than the ladder has patience for has passed.
    fn find_delay(&self, from_ns: TimeNs, to_ns: TimeNs) -> Option<Fault> {
        let silent_ns = to_ns - from_ns;
        let patience_ns = self.schedule.heartbeat_ns.saturating_mul(HEARTBEATS_PATIENCE);
        (silent_ns > patience_ns).then_some(Fault::Late { silent_ms: silent_ns / 1_000_000 })
    }

    fn begin_anew(&mut self) {
        (self.pending, self.changed_ns, self.looked_ns, self.holding) = (None, None, None, false);
        self.recent.clear();
        self.dials.clear();
    }

    /// Asks the ladder for a feed hold or a stop.
    ///
    /// # Errors
    /// What the driver says.
    pub fn send_request(&mut self, request: LadderRequest, clock: &dyn Clock) -> Result<(), SourceError> {
        self.ask_audit().ok_or_else(|| SourceError::Refused {
            source_name: self.actuator.name().to_owned(),
            request: request.as_word().to_owned(),
            what: "it was not sent: the history takes nothing, so it could not be accounted for".to_owned(),
            next: "`cnc-gateway history info` says more".to_owned(),
        })?;
        self.actuator.ask_ladder(clock, request)
    }

    /// Is a change still to be seen in force?
    #[must_use]
    pub fn is_waiting(&self) -> bool {
        self.pending.is_some()
    }

    /// Reads back whether the last change is in force. `None` while the machine may still need its time.
    pub fn read_reaction(&mut self, clock: &dyn Clock) -> Option<Result<Reaction, Fault>> {
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
        let makes = |dial| pending.asked.map_or(dial, |asked| self.schedule.rule.combine_overrides(dial, asked));
        if self.dials.iter().any(|(_, dial)| makes(*dial) == found) {
            self.pending = None;
            let PendingWrite { asked, sample_ns, issued_ns } = pending;
            let seen = |asked| Ok(Reaction { asked, found, sample_ns, issued_ns, seen_ns: now_ns });
            return asked.map(seen);
        }
        let over = now_ns - pending.issued_ns >= self.settle_ns;
        let fault = match (pending.asked, over) {
            (Some(asked), true) => Some(self.read_back(asked, found)),
            (Some(asked), false) => self.find_mismatch(asked, found, now_ns),
            (None, true) => Some(Fault::StillInForce(self.to_unexpected_reading(found))),
            (None, false) => None,
        };
        fault.and_then(|fault| self.give_up(fault))
    }

    fn give_up(&mut self, fault: Fault) -> Option<Result<Reaction, Fault>> {
        (self.pending, self.failed) = (None, true);
        Some(Err(fault))
    }

    /// Going back to 100 % does not wait for the least interval between two changes.
    fn find_due_occasion(&self, verdict: &Verdict, now_ns: TimeNs) -> Option<Occasion> {
        let Some((at_ns, pct)) = self.recent.back().filter(|_| self.holding) else { return Some(Occasion::Change) };
        let back = matches!(verdict.outcome, GateOutcome::Held(_) | GateOutcome::Refused);
        let rested = self.changed_ns.is_none_or(|changed_ns| now_ns - changed_ns >= self.schedule.interval_ns);
        if *pct != verdict.permitted && (rested || back) {
            return Some(Occasion::Change);
        }
        (now_ns - at_ns >= self.schedule.heartbeat_ns).then_some(Occasion::SignOfLife)
    }

    /// A machine that is switched off is written nothing, which is no fault.
    fn write(
        &mut self,
        (occasion, _audit): (Occasion, LiveAudit),
        wanted: OverridePct,
        sample_ns: TimeNs,
        clock: &dyn Clock,
    ) -> Option<WriteRecord> {
        let at_ns = clock.now_ns();
        let first = !std::mem::replace(&mut self.holding, true);
        let before = match (first, self.dials.back()) {
            (true, Some((_, dial))) if self.dial_is_known => Some(*dial),
            _ => self.recent.back().map(|(_, pct)| *pct),
        };
        // The sign of life repeats what is written, also while another override waits for its interval.
        let asked = match self.recent.back() {
            Some((_, last)) if occasion == Occasion::SignOfLife => *last,
            _ => wanted,
        };
        debug_assert!(!self.failed, "nothing reaches the machine after a fault, until somebody arms the gate again");
        self.recent.push_back((at_ns, asked));
        let sent = self.actuator.write_feed_override(clock, asked);
        if occasion == Occasion::Change {
            self.changed_ns = Some(at_ns);
            self.pending = Some(PendingWrite { asked: Some(asked), sample_ns, issued_ns: at_ns });
        }
        let late = self.find_delay(at_ns, clock.now_ns());
        let (after, fault) = match sent.and_then(|()| self.read(clock)) {
            Ok(found) => (Some(found), self.find_mismatch(asked, found, at_ns).or(late)),
            Err(SourceError::Off { .. }) => {
                self.begin_anew();
                self.owed = Some(Owed::from_unreached(at_ns));
                return None;
            }
            Err(error) => (None, Some(Fault::Line(error))),
        };
        Some(WriteRecord { at_ns, sample_ns, occasion, before, asked, after, fault })
    }

    /// The override in force; notes the dial beside it.
    fn read(&mut self, clock: &dyn Clock) -> Result<OverridePct, SourceError> {
        let found = self.actuator.read_feed_override(clock)?;
        let dial = self.actuator.read_dial(clock)?;
        self.dial_is_known = dial.is_some();
        // A dial that nobody knows does not limit: what is written is what has to be in force.
        let dial = dial.unwrap_or(match self.schedule.rule {
            LadderRule::Least | LadderRule::Replace => OverridePct::GREATEST,
            LadderRule::Product => OverridePct::FULL,
        });
        let now_ns = clock.now_ns();
        if self.dials.back().is_none_or(|(_, last)| *last != dial) {
            self.dials.push_back((now_ns, dial));
        }
        self.remove_settled(now_ns);
        Ok(found)
    }

    /// The newest of what is older than the settling time is still allowed: it was in force when that time began.
    fn remove_settled(&mut self, now_ns: TimeNs) {
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

    fn find_mismatch(&mut self, asked: OverridePct, found: OverridePct, now_ns: TimeNs) -> Option<Fault> {
        self.remove_settled(now_ns);
        let rule = self.schedule.rule;
        let makes = |pct: OverridePct| self.dials.iter().any(|(_, dial)| rule.combine_overrides(*dial, pct) == found);
        let known = self.recent.iter().any(|(_, pct)| makes(*pct));
        (!known).then(|| self.read_back(asked, found))
    }

    fn read_back(&self, asked: OverridePct, found: OverridePct) -> Fault {
        Fault::ReadBack { asked, shown: self.to_unexpected_reading(found) }
    }

    fn to_unexpected_reading(&self, found: OverridePct) -> UnexpectedReading {
        let dial = self.dials.back().map(|(_, dial)| *dial).filter(|_| self.dial_is_known);
        UnexpectedReading { found, dial, rule: self.schedule.rule }
    }
}
