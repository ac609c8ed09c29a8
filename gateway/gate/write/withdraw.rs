//! The enable is withdrawn: when nothing is asked for any more, at the end, and once after every start in case an earlier run
//! could not. A withdrawal that the machine refuses is repeated until it is taken.

use super::withdrawal::{Owed, UNREACHED_AGAIN_NS};
use super::{Occasion, OverrideWriter, PendingWrite, WriteRecord};
use crate::fault::Fault;
use adapter_core::clock::{Clock, SECOND_NS, TimeNs};
use adapter_core::override_pct::OverridePct;
use adapter_core::{Actuator, LadderRule, SourceError};

/// A withdrawal that the machine refused is tried again after this time.
const WITHDRAW_AGAIN_NS: i64 = SECOND_NS / 2;

impl<A: Actuator> OverrideWriter<A> {
    /// Gives the machine back to its dial, if an override of ours is enabled or its withdrawal has failed before.
    pub fn release_machine(&mut self, clock: &dyn Clock) -> Option<WriteRecord> {
        if std::mem::take(&mut self.holding) {
            self.owed = Some(Owed::at_once());
        }
        let owed = self.owed.filter(|owed| owed.next_ns <= clock.now_ns())?;
        self.withdraw_override(owed, clock)
    }

    /// An override of this run is enabled and could not be withdrawn yet.
    #[must_use]
    pub fn owes_withdrawal(&self) -> bool {
        self.holding || self.owed.is_some_and(|owed| !owed.leftover)
    }

    fn withdraw_override(&mut self, owed: Owed, clock: &dyn Clock) -> Option<WriteRecord> {
        let at_ns = clock.now_ns();
        let before = self.recent.back().map(|(_, pct)| *pct);
        let occasion = if owed.leftover { Occasion::Leftover } else { Occasion::Release };
        let sent = match owed.leftover {
            true => self.actuator.withdraw_leftover(clock),
            false => self.actuator.release_override(clock).map(|()| true),
        };
        let written = |after, fault| {
            let asked = OverridePct::FULL;
            Some(WriteRecord { at_ns, sample_ns: at_ns, occasion, before, asked, after, fault })
        };
        match sent {
            Ok(false) => {
                self.owed = None;
                None
            }
            Ok(true) => {
                self.owed = None;
                let (after, fault) = self.back_at_dial(at_ns, clock);
                written(after, fault)
            }
            Err(error) => {
                let refused = matches!(error, SourceError::Refused { .. });
                let pause_ns = if refused { WITHDRAW_AGAIN_NS } else { UNREACHED_AGAIN_NS };
                // A machine that is off has forgotten it, if its maker's ladder clears it; it is looked at when it is on again.
                let quiet = owed.told || matches!(error, SourceError::Off { .. }) || (owed.leftover && !refused);
                let next_ns = clock.now_ns().saturating_add(pause_ns);
                self.owed = Some(Owed { next_ns, told: owed.told || !quiet, ..owed });
                self.begin_anew();
                if quiet { None } else { written(None, Some(Fault::NotWithdrawn(error))) }
            }
        }
    }

    /// What is in force right after a withdrawal. It is looked at again until it is the dial.
    fn back_at_dial(&mut self, at_ns: TimeNs, clock: &dyn Clock) -> (Option<OverridePct>, Option<Fault>) {
        let neutral = if self.schedule.rule == LadderRule::Least { OverridePct::GREATEST } else { OverridePct::FULL };
        self.recent.push_back((at_ns, neutral));
        let found = self.read(clock);
        let told = match found {
            // Where the dial is not known, nobody can say what has to be in force.
            Ok(found) if !self.dial_is_known => (Some(found), None),
            Ok(found) => (Some(found), self.find_mismatch(OverridePct::FULL, found, at_ns)),
            Err(SourceError::Off { .. }) => (None, None),
            Err(error) => (None, Some(Fault::Line(error))),
        };
        let dial = self.dials.back().copied();
        self.begin_anew();
        if self.dial_is_known && told.1.is_none() {
            self.dials.extend(dial);
            self.pending = Some(PendingWrite { asked: None, sample_ns: at_ns, issued_ns: at_ns });
        }
        told
    }
}
