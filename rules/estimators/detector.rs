//! The machine-state detector.
//!
//! The states and their forward conditions are those of the tool-wear patent's state machine; the return transitions,
//! which its text lacks, and the states it forgets:
//!
//! | to | when |
//! |---|---|
//! | off | total power below `off_power_w` with the spindle at rest, or the controller reports the machine off and no meter contradicts |
//! | standby | speed below `spindle_min_rpm`; with the feed on only after `reversal_s` (tapping passes zero) |
//! | spindle_start | from rest to turning, until the power has settled |
//! | speed_change | speed not steady, another gear stage, or slowing down; ends as spindle_start does |
//! | idle | settled; no visible load, or the feed is off |
//! | rapid | settled, feed on, rapid traverse |
//! | cutting | settled, feed on, evidence for load against the no-load power; ends without feed or evidence |
//! | unknown | nothing measures the load and the feed is on, an input is missing for longer than `dropout_hold_s`, inputs contradict each other, or the feed is on and no no-load power is known |
//!
//! A spindle that turns when it is first seen, or is seen again after a control did not answer, has not started: it is idle where nothing is fed,
//! rapid in rapid traverse, and unknown under feed until a no-load power is known.
//!
//! Settled means: the power lies at the known no-load power, or two windows agree and are stationary. A spindle that is
//! already under load when the gateway starts settles only against a table; otherwise cutting is not claimed.

use super::basis::StateBasis;
use super::estimate::NoEstimate;
use super::estimate_words::NoLoadOrigin;
use super::evidence::Evidence;
use super::signals::{Feed, Pace, seconds_between};
use super::situation::{SeenBefore, Situation, Tick};
use super::window::Means;
use adapter_core::clock::TimeNs;
use adapter_core::state::State;
use serde::{Deserialize, Serialize};

/// How long a start or speed change without a known no-load power may stay unsettled under feed before the state is
/// called unknown, s.
const SETTLING_LIMIT_S: f64 = 10.0;

/// Relative difference of speed from one tick to the next seen one that means a change of speed.
const HIDDEN_CHANGE: f64 = 0.1;

/// Without sight of the speed for this long, the spindle may have stopped and started again, s.
const HIDDEN_STOP_S: f64 = 5.0;

/// A heavy cut has ended when less than this share of it is left: the light remainder would need longer to be told from
/// noise.
const CUT_ENDS: f64 = 0.15;

/// Weight of a new sample in the level of the cut.
const CUT_LEVEL_WEIGHT: f64 = 0.2;

/// However doubtful no-load power is, a power further from it, relative, has not settled for that reason alone.
const WIDEST_BAND: f64 = 0.04;

/// Later than every tick: a state begins with the first tick that is seen of it.
const NOT_BEGUN: TimeNs = TimeNs::MAX;

/// How the turning spindle got where it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Phase {
    /// Nothing is known of the past: start of the gateway, or after a gap.
    Fresh,
    Rest,
    /// Started from rest before our eyes.
    Starting,
    Changing,
    /// The power has settled.
    Settled,
}

/// What the tick amounts to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Detected {
    pub(super) state: State,
    pub(super) because: Option<NoEstimate>,
    /// The power settled at this tick: its level, which is no-load power if the feed is off, and an upper bound of it
    /// otherwise.
    pub(super) settled_at_w: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Detector {
    pub(super) state: State,
    /// [`NOT_BEGUN`] until the first tick, and after a gap until the next one.
    pub(super) since_ns: TimeNs,
    phase: Phase,
    phase_since_ns: TimeNs,
    evidence: Evidence,
    missing_since_ns: Option<TimeNs>,
    /// Speed at which the power settled or was last seen settled, and when.
    settled_speed: Option<(TimeNs, f64)>,
    stands_since_ns: Option<TimeNs>,
    /// Did the meter see power at the tick before?
    powered: bool,
    /// Did the spindle turn when its speed was read last?
    #[serde(default)]
    spindle_turned: bool,
    /// Running excess over no-load power during the cut, W.
    cut_level_w: f64,
}

impl Detector {
    pub(super) fn new() -> Self {
        Self {
            state: State::Unknown,
            since_ns: NOT_BEGUN,
            phase: Phase::Fresh,
            phase_since_ns: 0,
            evidence: Evidence::default(),
            missing_since_ns: None,
            settled_speed: None,
            stands_since_ns: None,
            powered: false,
            spindle_turned: false,
            cut_level_w: 0.0,
        }
    }

    /// Nothing is known of the past any more; what is learned elsewhere stays.
    pub(super) fn forget_past(&mut self) {
        self.phase = Phase::Fresh;
        self.spindle_turned = false;
        self.evidence.clear();
        self.missing_since_ns = None;
        self.since_ns = NOT_BEGUN;
    }

    /// The speed or the gear stage changed.
    pub(super) fn mark_speed_change(&mut self, now_ns: TimeNs) {
        if self.phase == Phase::Settled {
            self.enter_phase(Phase::Changing, now_ns);
        }
        self.evidence.clear();
    }

    /// Takes a tick and tells the state.
    pub(super) fn update_state(&mut self, tick: &Tick<'_>) -> Detected {
        // The first tick, or time has been set back.
        self.since_ns = self.since_ns.min(tick.inputs.at_ns);
        let verdict = self.determine_state(tick);
        if verdict.state != self.state {
            self.state = verdict.state;
            self.since_ns = tick.inputs.at_ns;
        }
        verdict
    }

    fn determine_state(&mut self, tick: &Tick<'_>) -> Detected {
        self.notice_hidden_change(tick);
        let powered_before = self.powered;
        self.powered = tick.is_powered().unwrap_or(powered_before);
        if let Ok(speed) = tick.inputs.speed {
            self.spindle_turned = speed.abs() >= tick.settings.spindle_min_rpm;
        }
        let crossing_zero = self.crossing_zero(tick);
        let before = SeenBefore { crossing_zero, had_power: powered_before, turning: self.spindle_turned };
        let situation = tick.determine_situation(before);
        if let Situation::Missing(reason) = situation {
            return self.without_input(tick, reason);
        }
        self.missing_since_ns = None;
        match situation {
            Situation::Off => self.at_rest(State::Off, tick),
            Situation::Rest => self.at_rest(State::Standby, tick),
            _ => self.judge_turning_spindle(tick),
        }
    }

    /// A spindle that turned a moment ago and stands now, with the feed on, may be reversing.
    fn crossing_zero(&mut self, tick: &Tick<'_>) -> bool {
        let now_ns = tick.inputs.at_ns;
        let stands = tick.inputs.speed.is_ok_and(|speed| speed.abs() < tick.settings.spindle_min_rpm);
        if !stands {
            self.stands_since_ns = None;
            return false;
        }
        let since = *self.stands_since_ns.get_or_insert(now_ns);
        let turned = !matches!(self.phase, Phase::Rest | Phase::Fresh);
        let fed = tick.inputs.feed.is_ok() && tick.classify_feed() == Feed::On;
        turned && fed && seconds_between(since, now_ns) < tick.settings.reversal_s
    }

    fn without_input(&mut self, tick: &Tick<'_>, reason: NoEstimate) -> Detected {
        let since = *self.missing_since_ns.get_or_insert(tick.inputs.at_ns);
        if seconds_between(since, tick.inputs.at_ns) < tick.settings.dropout_hold_s && self.state != State::Unknown {
            return report_state(self.state);
        }
        report_unknown(reason)
    }

    fn at_rest(&mut self, state: State, tick: &Tick<'_>) -> Detected {
        let phase = if tick.is_rest_measured() { Phase::Rest } else { Phase::Fresh };
        self.enter_phase(phase, tick.inputs.at_ns);
        self.evidence.clear();
        report_state(state)
    }

    fn enter_phase(&mut self, phase: Phase, now_ns: TimeNs) {
        if self.phase != phase {
            self.phase = phase;
            self.phase_since_ns = now_ns;
        }
    }

    fn judge_turning_spindle(&mut self, tick: &Tick<'_>) -> Detected {
        let now_ns = tick.inputs.at_ns;
        if self.phase == Phase::Rest {
            self.enter_phase(Phase::Starting, now_ns);
        }
        match tick.signals.is_speed_steady(self.select_pace(tick), tick.settings) {
            Some(true) => {}
            Some(false) => {
                if self.phase != Phase::Starting {
                    self.enter_phase(Phase::Changing, now_ns);
                }
                self.evidence.clear();
                return self.judge_unsettled_spindle(tick);
            }
            None if self.phase == Phase::Settled => {}
            None => return self.judge_unsettled_spindle(tick),
        }
        match (tick.inputs.basis, self.phase) {
            (StateBasis::Motion, _) => self.judge_unmeasured_load(tick),
            (_, Phase::Settled) => self.judge_settled_load(tick),
            _ => self.attempt_settling(tick),
        }
    }

    /// A steady spindle whose load nobody measures.
    fn judge_unmeasured_load(&mut self, tick: &Tick<'_>) -> Detected {
        if self.phase != Phase::Settled {
            self.enter_phase(Phase::Settled, tick.inputs.at_ns);
            self.settled_speed = None;
        }
        match tick.classify_feed() {
            Feed::Off => report_state(State::Idle),
            _ if tick.inputs.rapid => report_state(State::Rapid),
            _ => report_unknown(NoEstimate::NoLoadMeasured),
        }
    }

    fn select_pace(&self, tick: &Tick<'_>) -> Pace {
        match self.phase {
            Phase::Settled if self.state == State::Cutting && tick.classify_feed() != Feed::Off => Pace::Cutting,
            Phase::Settled => Pace::Idling,
            _ => Pace::Settling,
        }
    }

    /// While the speed was not to be seen it may have changed.
    fn notice_hidden_change(&mut self, tick: &Tick<'_>) {
        let (now_ns, Ok(speed)) = (tick.inputs.at_ns, tick.inputs.speed) else { return };
        if self.phase != Phase::Settled {
            return;
        }
        if let Some((then_ns, before)) = self.settled_speed.replace((now_ns, speed)) {
            let pause_s = seconds_between(then_ns, now_ns);
            let allowed_rpm = HIDDEN_CHANGE * speed.abs().max(before.abs());
            if (speed - before).abs() > allowed_rpm {
                self.enter_phase(Phase::Changing, now_ns);
                self.evidence.clear();
            } else if pause_s > HIDDEN_STOP_S {
                // Neither a change nor a start was seen: nothing is known of what happened meanwhile.
                self.enter_phase(Phase::Fresh, now_ns);
                self.evidence.clear();
            }
        }
    }

    fn judge_unsettled_spindle(&self, tick: &Tick<'_>) -> Detected {
        let overdue =
            tick.no_load.is_err() && seconds_between(self.phase_since_ns, tick.inputs.at_ns) > SETTLING_LIMIT_S;
        match self.phase {
            Phase::Starting if !overdue || tick.classify_feed() == Feed::Off => report_state(State::SpindleStart),
            Phase::Changing if !overdue || tick.classify_feed() == Feed::Off => report_state(State::SpeedChange),
            _ => self.judge_fresh_spindle(tick),
        }
    }

    /// A spindle that turned already when it was first seen, without a no-load power to compare with. At a steady speed it idles where
    /// nothing is fed, and in rapid traverse it does not cut; what it does under feed is not known.
    fn judge_fresh_spindle(&self, tick: &Tick<'_>) -> Detected {
        let reason = tick.no_load.err().unwrap_or(NoEstimate::NotSettled);
        let steady = tick.signals.is_speed_steady(Pace::Settling, tick.settings) == Some(true);
        match (self.phase, tick.classify_feed()) {
            (Phase::Fresh, Feed::Off) if steady && tick.no_load.is_err() => report_state(State::Idle),
            (Phase::Fresh, Feed::On) if steady && tick.no_load.is_err() && tick.inputs.rapid => {
                report_state(State::Rapid)
            }
            _ => report_unknown(reason),
        }
    }

    /// Idle, rapid or cutting with a power that has settled: before that, idling says nothing of no-load power.
    pub(super) fn runs_settled(&self) -> bool {
        self.phase == Phase::Settled && matches!(self.state, State::Idle | State::Rapid | State::Cutting)
    }

    fn attempt_settling(&mut self, tick: &Tick<'_>) -> Detected {
        let Some(filtered_w) = tick.filtered_w else { return self.judge_unsettled_spindle(tick) };
        let agreement_w = tick.signals.agreement_w(filtered_w, tick.settings);
        let means = tick.signals.window.find_stationary_means(agreement_w, tick.settings);
        let fed = tick.classify_feed() != Feed::Off;
        let settled_at_w = match tick.no_load {
            Ok(known) => {
                let widest_w = (WIDEST_BAND * known.power_w).max(tick.signals.noise.resolution_w());
                let band_w = tick.ending_excess_w().unwrap_or(0.0).min(widest_w);
                let at_known = known.is_estimate() && (filtered_w - known.power_w).abs() <= band_w;
                // A cut can be too rough to be stationary: under feed it is enough that the start-up no longer decays.
                let above = filtered_w > known.power_w;
                let under_load = fed && above && tick.signals.window.is_falling(agreement_w) == Some(false);
                if !(at_known || means.is_some() || under_load) {
                    return self.judge_unsettled_spindle(tick);
                }
                let unmeasured = !fed && known.origin != NoLoadOrigin::Measured && !at_known;
                means.filter(|_| unmeasured).map(Means::lower_w)
            }
            Err(_) => match means {
                Some(means) if !fed => Some(means.lower_w()),
                Some(means) if self.phase == Phase::Starting => Some(tick.signals.least_level_w(means, tick.settings)),
                _ => return self.judge_unsettled_spindle(tick),
            },
        };
        self.enter_phase(Phase::Settled, tick.inputs.at_ns);
        self.settled_speed = None;
        self.evidence.clear();
        Detected { settled_at_w, ..self.judge_settled_load(tick) }
    }

    fn judge_settled_load(&mut self, tick: &Tick<'_>) -> Detected {
        self.accumulate_evidence(tick);
        let full = tick.settings.cutting_evidence;
        let rested = seconds_between(self.since_ns, tick.inputs.at_ns) >= tick.settings.dwell_s;
        match tick.classify_feed() {
            Feed::Off => report_state(State::Idle),
            _ if tick.inputs.rapid => report_state(State::Rapid),
            _ => match (tick.no_load, self.state) {
                (Err(_), _) if self.just_settled(tick) => report_state(State::Idle),
                (Err(reason), _) => report_unknown(reason),
                (Ok(_), State::Cutting) if !(rested && self.evidence.is_exhausted()) => report_state(State::Cutting),
                (Ok(_), State::Cutting) => report_state(State::Idle),
                (Ok(_), before) if self.evidence.is_sufficient(full) && (rested || before != State::Idle) => {
                    report_state(State::Cutting)
                }
                _ => report_state(State::Idle),
            },
        }
    }

    fn just_settled(&self, tick: &Tick<'_>) -> bool {
        self.phase_since_ns == tick.inputs.at_ns
    }

    fn accumulate_evidence(&mut self, tick: &Tick<'_>) {
        let (Ok(power_w), Ok(no_load), Some(on_w)) = (tick.inputs.power, tick.no_load, tick.visible_excess_w()) else {
            self.evidence.clear();
            return;
        };
        let excess_w = power_w - no_load.power_w;
        let reference_w = if self.state == State::Cutting {
            tick.ending_excess_w().unwrap_or(on_w).max(CUT_ENDS * self.cut_level_w)
        } else {
            self.cut_level_w = 0.0;
            on_w
        };
        let filtered_excess_w = tick.filtered_w.unwrap_or(power_w) - no_load.power_w;
        if filtered_excess_w > reference_w {
            self.cut_level_w += CUT_LEVEL_WEIGHT * (filtered_excess_w - self.cut_level_w);
        }
        let sd_w = tick.signals.noise.sd() * no_load.power_w;
        self.evidence.add(excess_w, reference_w, sd_w, tick.settings.cutting_evidence);
    }
}

fn report_state(state: State) -> Detected {
    Detected { state, because: None, settled_at_w: None }
}

fn report_unknown(reason: NoEstimate) -> Detected {
    Detected { state: State::Unknown, because: Some(reason), settled_at_w: None }
}
