//! The gate: what a script asks for becomes a command, or it does not, with the reason.
//!
//! Compiled, because no script may widen it. [`Gate::decide_override`] looks at the request, the sample, the estimates and the
//! limits of the configuration, and at nothing else; given the same it decides the same. It never writes: in `shadow`,
//! which is the default, a [`Verdict`] is recorded and that is all. Only a [`OverrideWriter`] writes, and only verdicts that say
//! so, which needs `mode = "armed"` in the configuration *and* arming on the box, for a limited time, after every start.
//!
//! What holds 100 % whatever is asked for is the list of [`Hold`]: the contract that machine builders know from the
//! adaptive controls of the last decades (second feed override behind the operator's dial, 100 % in threading and
//! tapping, off after start-up).
//!
//! | file | what |
//! |---|---|
//! | `hold` | the reasons that hold 100 % |
//! | `thread_cycle` | threading and tapping from the text of NC blocks |
//! | `limit` | band and slew |
//! | `verdict` | what was decided, as words |
//! | `ask` | feed hold and stop: once, and then not before somebody has seen to it |
//! | `arming` | who let it write, and until when |
//! | `write` | writing, reading back, restoring |
//! | `fault` | what ends an arming on the way to the machine |
//! | `offset` | thermal offsets: the same for shifts of an axis, between programs |
//! | `audit` | what of it goes into the audit |

mod arming;
mod ask;
pub mod audit;
mod fault;
mod hold;
mod limit;
pub mod limits;
pub mod offset;
mod thread_cycle;
mod verdict;
mod write;

pub use arming::{ArmError, Armed, Disarmed};
pub use ask::{AskOutcome, ScriptRequest};
pub use fault::{Fault, UnexpectedReading};
pub use hold::{EVIDENCE, Hold};
pub use limit::Bound;
pub use offset::{OffsetVerdict, Offsets};
pub use verdict::{GateOutcome, Verdict};
pub use write::{AuditPath, Occasion, OverrideWriter, Reaction, WriteRecord};

use crate::limits::{GateConfig, GateMode};
use adapter_core::clock::TimeNs;
use adapter_core::integer::saturate_to_ns;
use adapter_core::override_pct::OverridePct;
use adapter_core::request::{OffsetProposal, OverrideRequest};
use adapter_core::state::State;
use adapter_core::{ChannelId, Sample};
use arming::Arming;
use ask::Asks;
use hold::Interlocks;
use limit::{Aim, Slew};
use offset::Circumstances;
use std::time::Duration;

/// Decides about feed overrides. One per machine; remembers the last decision, for the slew limit, and the arming.
#[derive(Debug)]
pub struct Gate {
    limits: GateConfig,
    interlocks: Interlocks,
    aim: Aim,
    slew: Slew,
    arming: Arming,
    /// Does the last verdict stand between what was let through before and what will be?
    ramping: bool,
    /// Was the last verdict one that may be written?
    wrote: bool,
    /// An arming has ended since the last verdict.
    ended: bool,
    asks: Asks,
    offsets: Offsets,
}

impl Gate {
    /// A gate with these limits. It is disarmed, whatever the configuration says.
    #[must_use]
    pub fn new(limits: GateConfig) -> Self {
        let stale_ns = saturate_to_ns(limits.stale);
        Self {
            interlocks: Interlocks::new(stale_ns),
            aim: Aim::new(limits.dead_band_pct),
            slew: Slew::new(limits.slew_up_pct_per_s, limits.slew_down_pct_per_s),
            arming: Arming::new(limits.greatest_mode(), limits.armed_for),
            ramping: false,
            wrote: false,
            ended: false,
            asks: Asks::new(),
            offsets: Offsets::new(limits.offset.clone()),
            limits,
        }
    }

    /// The limits in force.
    #[must_use]
    pub fn limits(&self) -> &GateConfig {
        &self.limits
    }

    /// Lets the gate write from now on, for so long, or for the time that the configuration gives and does not let exceed.
    ///
    /// # Errors
    /// The configuration does not allow it, or nobody is named.
    pub fn arm(&mut self, by: &str, lasts: Option<Duration>, at_ns: TimeNs) -> Result<&Armed, ArmError> {
        self.arming.arm(by, lasts, at_ns)
    }

    /// From now on nobody can arm: a thread of this name is gone, and somebody has to start the gateway again.
    pub fn forbid_arming(&mut self, thread: &str) {
        self.arming.forbid_arming(thread);
        self.disarm(Disarmed::Thread);
    }

    /// Ends the permission to write. The writer restores 100 % at the next verdict, which is not armed even when somebody
    /// arms the gate again before it.
    pub fn disarm(&mut self, why: Disarmed) {
        self.ended |= self.arming.state().is_ok();
        self.arming.disarm(why);
    }

    /// Who armed the gate, while it is armed, or why it is not.
    ///
    /// # Errors
    /// Why it is not.
    pub fn current_arming(&self) -> Result<&Armed, Disarmed> {
        self.arming.state()
    }

    /// Decides about this tick's request; without one, the programmed feed is what is wanted.
    pub fn decide_override(&mut self, request: Option<&OverrideRequest>, sample: &Sample, state: State) -> Verdict {
        let at_ns = sample.at_ns;
        self.arming.end_if_expired(at_ns);
        let hold = match self.limits.mode {
            GateMode::Off => Some(Hold::Off),
            GateMode::Shadow | GateMode::Armed => self.interlocks.find_hold(sample, state),
        };
        self.arming.end_if_silent(matches!(hold, Some(Hold::Missing(..))), at_ns);
        let armed = self.writes_override() && !std::mem::take(&mut self.ended);
        if armed && !std::mem::replace(&mut self.wrote, armed) {
            // The machine is at its dial; what was decided before nobody wrote is no place to begin from.
            self.aim.reset_target();
            self.slew.restart_ramp();
        }
        self.wrote = armed;
        let wanted_pct = request.map(|request| request.pct);
        let (target_pct, bound) = limit::clamp_to_band(wanted_pct, self.limits.min_pct, self.limits.max_pct);
        let ceiling_pct = self.ceiling_pct(sample);
        let (target_pct, bound) = limit::clamp_to_ceiling(ceiling_pct, target_pct, bound);
        let dial_pct = self.lesser_dial_pct(sample);
        let outcome = match (hold, bound) {
            (Some(hold), _) => GateOutcome::Held(hold),
            (None, Some(Bound::NotPossible)) => GateOutcome::Refused,
            (None, Some(bound)) => GateOutcome::Limited(bound),
            (None, None) => GateOutcome::Permitted,
        };
        let (target_pct, permitted, outcome) = if hold.is_some() {
            self.aim.reset_target();
            (target_pct, self.slew.jump_to_full(at_ns), outcome)
        } else {
            let aim_pct = self.aim.update_target(target_pct, ceiling_pct);
            match dial_pct.filter(|dial_pct| wanted_pct.is_some() && aim_pct < 100.0 && *dial_pct <= aim_pct) {
                Some(dial_pct) => (
                    100.0,
                    self.slew.jump_to_full(at_ns),
                    GateOutcome::DialCounts(OverridePct::from_nearest_percent(dial_pct).unwrap_or(OverridePct::FULL)),
                ),
                None => (aim_pct, self.slew.step_towards(aim_pct, at_ns), outcome),
            }
        };
        let moves = hold.is_none() && bound.is_none() && !matches!(outcome, GateOutcome::DialCounts(_));
        self.ramping = hold.is_none() && (self.slew.exact_pct() - target_pct).abs() >= 0.5;
        let slewing = moves && (self.slew.exact_pct() - target_pct).abs() >= 1.0;
        let outcome = if slewing { GateOutcome::Limited(Bound::Slew) } else { outcome };
        // The wall between scripts and machine: whatever was asked for, what passes lies between 100 % and the band.
        let passed_pct = f64::from(permitted.percent());
        debug_assert!(
            passed_pct >= self.limits.min_pct.min(100.0) && passed_pct <= self.limits.max_pct.max(100.0),
            "no request passes the limits of the gate: {passed_pct} %"
        );
        Verdict { at_ns, wanted_pct, permitted, outcome, armed }
    }

    /// Is the override that was let through last on its way to another, step by step?
    #[must_use]
    pub fn is_ramping(&self) -> bool {
        self.ramping
    }

    /// Judges what scripts ask of the ladder at this tick, after [`Gate::decide_override`]: each request passes once, and then not
    /// before it has been withdrawn and the operator has seen to the last one. Gives those that are new.
    pub fn judge_requests(&mut self, asks: &[ScriptRequest], sample: &Sample) -> Vec<(ScriptRequest, AskOutcome)> {
        let armed = self.wrote && self.writes_override();
        self.asks.judge_requests(asks, sample, armed)
    }

    /// Who armed the gate, while it writes overrides: an arming may be there for offsets only.
    ///
    /// # Errors
    /// Why none is written.
    pub fn override_arming(&self) -> Result<&Armed, Disarmed> {
        if self.limits.mode == GateMode::Armed { self.arming.state() } else { Err(Disarmed::Mode) }
    }

    fn writes_override(&self) -> bool {
        self.override_arming().is_ok()
    }

    /// Judges the offsets that are proposed at this tick, after [`Gate::decide_override`]. Nothing while `[gate.offset]` is off.
    pub fn judge_offsets(&mut self, proposals: &[OffsetProposal], sample: &Sample, state: State) -> Vec<OffsetVerdict> {
        if !self.offsets.is_concerned(proposals) {
            return Vec::new();
        }
        let now = Circumstances {
            at_ns: sample.at_ns,
            hold: self.interlocks.between_programs(sample, state),
            armed: self.writes_offsets(),
        };
        self.offsets.decide_offsets(proposals, now)
    }

    /// What is to be looked at in the control, because nobody knows for sure what is in force there. Call it after
    /// [`Gate::decide_override`].
    pub fn collect_look_orders(&mut self, sample: &Sample, state: State) -> Vec<offset::OffsetOrder> {
        let may = self.offsets.is_unsettled() && self.interlocks.between_programs(sample, state).is_none();
        if may { self.offsets.collect_look_orders(sample.at_ns) } else { Vec::new() }
    }

    /// May offsets be written?
    #[must_use]
    pub fn writes_offsets(&self) -> bool {
        self.limits.offset.mode == GateMode::Armed && self.arming.state().is_ok()
    }

    /// The offsets, for what is in force.
    #[must_use]
    pub fn offsets(&self) -> &Offsets {
        &self.offsets
    }

    /// The offsets, for what the control answers.
    pub fn offsets_mut(&mut self) -> &mut Offsets {
        &mut self.offsets
    }

    /// Somebody has seen to what the ladder was asked for.
    pub fn acknowledge_requests(&mut self) {
        self.asks.acknowledge_requests();
    }

    /// The dial, where it is known and the ladder takes the lesser one of dial and override: at and below it there is nothing
    /// to ask for.
    fn lesser_dial_pct(&self, sample: &Sample) -> Option<f64> {
        if self.limits.above_dial {
            return None;
        }
        self.interlocks.fresh_number(sample, DIAL)
    }

    /// What the ladder's rule and the operator's dial leave: a ladder that takes the lesser one of dial and override makes
    /// anything above the dial meaningless, and without a known dial nothing above 100 % is asked for.
    fn ceiling_pct(&self, sample: &Sample) -> f64 {
        if self.limits.above_dial {
            return self.limits.max_pct;
        }
        let dial_pct = self.interlocks.fresh_number(sample, DIAL);
        dial_pct.unwrap_or(100.0).clamp(100.0, 254.0)
    }
}

const DIAL: ChannelId = ChannelId::find_constant("feed_override_dial_pct");
