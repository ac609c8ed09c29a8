//! Thermal offsets: what a script proposes becomes a shift of an axis, or it does not, with the reason.
//!
//! Off unless `[gate.offset]` says otherwise, and decided like an override: in `shadow` everything is recorded and nothing
//! written; `armed` needs the same arming on the box. A shift is written
//!
//! - for axes that the configuration names, never more than `total_um` from what the operator has set, by at most `step_um`
//!   at a time and at most once per `min_interval_s`;
//! - between two programs only: automatic, nothing running, no alarm, fresh values, a known state. The driver looks once
//!   more at the control before it writes, and refuses a control that measures in inches.
//!
//! Without a proposal the shift goes back to what the operator has set, by the same steps. A number that is none moves
//! nothing. A control that shows something else than was written ends the arming and raises an alarm.
//!
//! A work offset has no sign of life: nothing takes it back when the gateway dies. Therefore what is to be written is kept in
//! a file beside the history before it is written ([`OffsetJournal`]); after a failed line and after a start the control is looked at
//! before anything else is written to it; and `on_disarm = "restore"`, which is the default, gives it back in one step as soon
//! as no program runs: after disarming, at the end of the gateway, and after a start that finds something left. One large
//! step between two programs is better than an offset that nobody follows up while the machine cools. `"keep"` is for shops
//! that arm anew in the middle of a batch and would rather have no step in it.

mod account;
mod audit;
mod journal;
mod order;

pub use account::OffsetAccount;
pub use audit::OffsetTrail;
pub use journal::OffsetJournal;
pub use order::{Moved, OffsetOrder, Shifted};

use super::hold::Hold;
use crate::limits::{GateMode, OffsetConfig};
use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::integer::saturate_to_ns;
use adapter_core::offset::Axis;
use adapter_core::request::OffsetProposal;

/// What became of a proposal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum OffsetOutcome {
    /// As proposed, now or at the next time that something may be written.
    Permitted,
    /// Only so far, because of this.
    Limited(OffsetBound),
    /// Nothing is moved now, because of this.
    Held(Hold),
    /// The configuration does not name this axis.
    NotAllowed,
    /// Not a number of micrometres.
    Refused,
}

/// What keeps a shift smaller than proposed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OffsetBound {
    /// The greatest change at a time; the rest follows.
    Step,
    /// The greatest shift from what the operator has set.
    Total,
}

/// The decision about one axis at one tick.
#[derive(Debug, Clone, PartialEq)]
pub struct OffsetVerdict {
    /// Time of the tick, ns since 1970.
    pub at_ns: TimeNs,
    /// The axis that the decision is about.
    pub axis: Axis,
    /// What is proposed, as it was; may be no number.
    pub wanted_um: Option<f64>,
    /// The shift in force, by the gateway's account.
    pub shift_um: f64,
    /// The shift that would be written now.
    pub permitted_um: f64,
    /// How the one became the other.
    pub outcome: OffsetOutcome,
    /// May it be written?
    pub armed: bool,
    /// What is to be written now.
    pub order: Option<OffsetOrder>,
}

/// One axis that may be shifted.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Slide {
    axis: Axis,
    /// The configuration no longer names it: it is only given back.
    retired: bool,
    shift_um: f64,
    /// Something was ordered and has not been answered.
    waiting: bool,
    /// What is in force is not known for sure: nothing is written before somebody has looked.
    unsettled: bool,
    /// When it was last looked for.
    looked_ns: Option<TimeNs>,
    /// When it was last proposed for.
    proposed_ns: Option<TimeNs>,
}

/// A proposal may be missing for this long before the shift goes back: a value may be absent for a moment.
const MISSING_NS: i64 = 10 * SECOND_NS;
/// Time between two looks at what is in force.
const LOOK_EVERY_NS: i64 = SECOND_NS;

/// What is known at a tick besides the proposals.
#[derive(Debug, Clone, Copy)]
pub(super) struct Circumstances {
    pub(super) at_ns: TimeNs,
    pub(super) hold: Option<Hold>,
    pub(super) armed: bool,
}

/// Decides about offsets. One per machine.
#[derive(Debug)]
pub struct Offsets {
    limits: OffsetConfig,
    slides: Vec<Slide>,
    ordered_ns: Option<TimeNs>,
}

impl Offsets {
    /// Nothing is shifted, as far as is known.
    pub(super) fn new(limits: OffsetConfig) -> Self {
        let slides = limits.axes.iter().map(|axis| Slide::new(*axis)).collect();
        Self { limits, slides, ordered_ns: None }
    }

    /// An earlier run has left this shift. One of an axis that the configuration no longer names is given back.
    pub fn resume_shift(&mut self, axis: Axis, shift_um: f64) {
        if !self.slides.iter().any(|slide| slide.axis == axis) {
            self.slides.push(Slide { retired: true, ..Slide::new(axis) });
        }
        self.change_slide(axis, |slide| slide.shift_um = shift_um);
    }

    /// What is in force is not known for sure: it is looked at before anything is written.
    pub fn mark_unsettled(&mut self, axis: Axis) {
        self.change_slide(axis, |slide| slide.unsettled = true);
    }

    fn change_slide(&mut self, axis: Axis, change: impl FnMut(&mut Slide)) {
        self.slides.iter_mut().filter(|slide| slide.axis == axis).for_each(change);
    }

    /// Is there anything to look at?
    pub(super) fn is_unsettled(&self) -> bool {
        self.limits.mode == GateMode::Armed && self.slides.iter().any(|slide| slide.unsettled)
    }

    /// What is to be looked at now, while nothing stands in the way.
    pub(super) fn collect_look_orders(&mut self, at_ns: TimeNs) -> Vec<OffsetOrder> {
        self.slides.iter_mut().filter_map(|slide| slide.next_look_order(at_ns)).collect()
    }

    /// Is there anything to decide about?
    pub(super) fn is_concerned(&self, proposals: &[OffsetProposal]) -> bool {
        self.limits.mode != GateMode::Off && (!proposals.is_empty() || self.is_shifted())
    }

    /// Is any axis shifted?
    #[must_use]
    pub fn is_shifted(&self) -> bool {
        self.slides.iter().any(|slide| slide.shift_um != 0.0)
    }

    /// Each axis with the shift in force.
    pub fn shifts(&self) -> impl Iterator<Item = (Axis, f64)> {
        self.slides.iter().map(|slide| (slide.axis, slide.shift_um))
    }

    /// Decides about every axis that is proposed for or shifted.
    pub(super) fn decide_offsets(&mut self, proposals: &[OffsetProposal], now: Circumstances) -> Vec<OffsetVerdict> {
        let strange = proposals.iter().filter(|it| !self.slides.iter().any(|slide| slide.axis == it.axis));
        let mut verdicts: Vec<OffsetVerdict> = strange.map(|it| not_allowed(it, now)).collect();
        let rested = self.ordered_ns.is_none_or(|ordered_ns| {
            !(0..saturate_to_ns(self.limits.min_interval)).contains(&(now.at_ns - ordered_ns))
        });
        for slide in &mut self.slides {
            let of_slide = |it: &&OffsetProposal| it.axis == slide.axis && !slide.retired;
            let wanted_um = proposals.iter().find(of_slide).map(|it| it.offset_um);
            if slide.update_rest(wanted_um.is_some(), now.at_ns) {
                continue;
            }
            let mut verdict = slide.judge_shift(wanted_um, &self.limits, now);
            if rested && now.hold.is_none() && slide.may_order() && self.limits.mode == GateMode::Armed {
                verdict.order = slide.plan_order(&verdict, &self.limits);
                slide.waiting = verdict.order.is_some();
            }
            if verdict.order.is_some() {
                self.ordered_ns = Some(now.at_ns);
            }
            verdicts.push(verdict);
        }
        verdicts
    }

    /// The answer to an order: what is in force now, where that is known.
    pub fn accept_answer(&mut self, moved: &Moved) {
        self.change_slide(moved.order.axis(), |slide| {
            slide.waiting = false;
            slide.unsettled = moved.is_open() || (slide.unsettled && moved.result.is_err());
            if let Ok(shifted) = &moved.result {
                slide.shift_um = shifted.map_or(0.0, |shifted| shifted.shift_um());
            }
        });
    }

    /// An order that was not carried out.
    pub fn withdraw_order(&mut self, order: OffsetOrder) {
        self.change_slide(order.axis(), |slide| slide.waiting = false);
    }

    /// What is to be given back at the end.
    #[must_use]
    pub fn list_restore_orders(&self) -> Vec<OffsetOrder> {
        let restore = self.limits.restore && self.limits.mode == GateMode::Armed;
        let shifted = self.slides.iter().filter(|slide| restore && slide.shift_um != 0.0);
        shifted.map(|slide| OffsetOrder::Restore(slide.axis)).collect()
    }
}

fn not_allowed(proposal: &OffsetProposal, now: Circumstances) -> OffsetVerdict {
    OffsetVerdict {
        at_ns: now.at_ns,
        axis: proposal.axis,
        wanted_um: Some(proposal.offset_um),
        shift_um: 0.0,
        permitted_um: 0.0,
        outcome: OffsetOutcome::NotAllowed,
        armed: now.armed,
        order: None,
    }
}

impl Slide {
    fn new(axis: Axis) -> Self {
        Self {
            axis,
            retired: false,
            shift_um: 0.0,
            waiting: false,
            unsettled: false,
            looked_ns: None,
            proposed_ns: None,
        }
    }

    /// Nothing is under way, and what is in force is known.
    fn may_order(&self) -> bool {
        !self.waiting && !self.unsettled
    }

    fn next_look_order(&mut self, at_ns: TimeNs) -> Option<OffsetOrder> {
        let since_ns = |looked_ns: TimeNs| at_ns - looked_ns;
        let rested = self.looked_ns.is_none_or(|looked_ns| !(0..LOOK_EVERY_NS).contains(&since_ns(looked_ns)));
        let looks = self.unsettled && !self.waiting && rested;
        looks.then(|| {
            (self.waiting, self.looked_ns) = (true, Some(at_ns));
            OffsetOrder::Look(self.axis)
        })
    }

    /// Nothing is proposed, and nothing to be given back yet.
    fn update_rest(&mut self, proposed: bool, at_ns: TimeNs) -> bool {
        if proposed {
            self.proposed_ns = Some(at_ns);
            return false;
        }
        let since_ns = at_ns - *self.proposed_ns.get_or_insert(at_ns);
        self.shift_um == 0.0 || (0..MISSING_NS).contains(&since_ns)
    }

    fn judge_shift(&self, wanted_um: Option<f64>, limits: &OffsetConfig, now: Circumstances) -> OffsetVerdict {
        let finite = wanted_um.is_none_or(f64::is_finite);
        // Controls count in whole micrometres.
        let target_um =
            wanted_um.filter(|um| um.is_finite()).map_or(if finite { 0.0 } else { self.shift_um }, f64::round);
        let within_um = target_um.clamp(-limits.total_um.floor(), limits.total_um.floor());
        let step_um = limits.step_um.floor().max(1.0);
        let permitted_um = self.shift_um + (within_um - self.shift_um).clamp(-step_um, step_um);
        let outcome = match now.hold {
            Some(hold) => OffsetOutcome::Held(hold),
            None if !finite => OffsetOutcome::Refused,
            None if within_um != target_um => OffsetOutcome::Limited(OffsetBound::Total),
            None if permitted_um != within_um => OffsetOutcome::Limited(OffsetBound::Step),
            None => OffsetOutcome::Permitted,
        };
        let (at_ns, axis, shift_um, armed) = (now.at_ns, self.axis, self.shift_um, now.armed);
        OffsetVerdict { at_ns, axis, wanted_um, shift_um, permitted_um, outcome, armed, order: None }
    }

    /// What is to be written: a step while armed; afterwards everything back, where that is configured.
    fn plan_order(&self, verdict: &OffsetVerdict, limits: &OffsetConfig) -> Option<OffsetOrder> {
        if verdict.armed && !self.retired {
            let (axis, from_um, wanted_um) = (self.axis, self.shift_um, verdict.permitted_um);
            let step = OffsetOrder::Shift { axis, from_um, wanted_um };
            return (verdict.permitted_um != self.shift_um).then_some(step);
        }
        (limits.restore && self.shift_um != 0.0).then_some(OffsetOrder::Restore(self.axis))
    }
}
