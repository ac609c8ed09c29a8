//! From a sample to estimates.

mod reconfigure;
mod split;
mod stand_in;
mod stored_state;
mod voltage;

use super::detector::{Detected, Detector};
use super::estimate::{Estimate, Estimates, NoEstimate};
use super::estimate_words::{NoLoadOrigin, Visibility};
use super::inputs::{InputChannels, TickInputs};
use super::learning::{IdleTick, Learner};
use super::loads::LoadEstimator;
use super::no_load::{NoLoad, NoLoadPoint, NoLoadTable};
use super::settings::Settings;
use super::signals::{Feed, Pace, Signals};
use super::situation::Tick;
use super::supply::Supply;
use adapter_core::state::State;
use adapter_core::{ChannelId, Sample};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Weight of a new sample in the standby power.
const STANDBY_WEIGHT: f64 = 0.1;

/// Why a snapshot cannot be used; start anew then.
#[derive(Debug, Error)]
#[error("the stored state of the estimators cannot be used ({0}); they start anew and learn again")]
pub struct RestoreError(#[from] serde_json::Error);

/// Everything the estimators remember between ticks. No allocation per tick, except when a new speed is learned.
#[derive(Debug, Clone)]
pub struct Inference {
    settings: Settings,
    channels: InputChannels,
    state: InferenceState,
    estimates: Estimates,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct InferenceState {
    signals: Signals,
    no_load: NoLoadTable,
    learner: Learner,
    detector: Detector,
    /// The level right after a start with the axes already moving.
    upper_bound: Option<NoLoadPoint>,
    standby_w: Option<f64>,
    /// What the no-load powers were learned from, as the word of a [`StateBasis`](super::StateBasis); empty before the first sample.
    #[serde(default)]
    basis: String,
    /// How no-load power goes with the supply voltage.
    #[serde(default)]
    supply: Supply,
    /// The load of each place, learned from the first parts.
    #[serde(default)]
    loads: LoadEstimator,
}

impl InferenceState {
    fn new(settings: &Settings) -> Self {
        Self {
            basis: String::new(),
            supply: Supply::default(),
            loads: LoadEstimator::default(),
            signals: Signals::new(settings),
            no_load: NoLoadTable::new(settings),
            learner: Learner::new(settings),
            detector: Detector::new(),
            upper_bound: None,
            standby_w: None,
        }
    }
}

impl Inference {
    /// A pipeline that knows nothing but its settings. Where settings contradict each other (see
    /// [`Settings::find_contradictions`]) the stricter one holds.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        let memory = InferenceState::new(&settings);
        Self { settings, channels: InputChannels::new(), state: memory, estimates: Estimates::without_samples(0) }
    }

    /// Takes one sample; samples come in the order of time.
    pub fn update_with_sample(&mut self, sample: &Sample) -> &Estimates {
        let mut inputs = self.channels.read(sample, self.state.standby_w, &self.settings);
        self.follow_basis(inputs.basis);
        let broken = self.state.signals.push(&inputs, &self.settings);
        if broken.gap {
            self.state.detector.forget_past();
        }
        if broken.stage {
            self.state.detector.mark_speed_change(inputs.at_ns);
        }
        if broken.gap || broken.stage {
            self.state.learner.discard_collected();
        }
        self.take_to_reference_voltage(&mut inputs);
        let filtered_w = inputs.power.ok().and_then(|power| self.state.signals.push_power(power, &self.settings));
        let mut no_load = self.select_no_load_reference(&inputs);
        let tick = Tick {
            inputs: &inputs,
            signals: &self.state.signals,
            settings: &self.settings,
            filtered_w,
            standby_w: self.state.standby_w,
            no_load,
        };
        let feed = self.state.signals.classify_feed(&inputs, &self.settings);
        let verdict = self.state.detector.update_state(&tick);
        if let Some(power_w) = verdict.settled_at_w {
            self.settled_at(power_w, feed, &inputs);
            no_load = self.select_no_load_reference(&inputs);
        }
        self.update_memory(&inputs, filtered_w, no_load, &verdict);
        self.estimates = self.build_estimates(&inputs, filtered_w, no_load, &verdict);
        self.state.loads.step(sample, &mut self.estimates, &self.settings);
        &self.estimates
    }

    /// No-load power at the speed of this tick: learned; or else an upper bound at this very speed; or else a rough idea,
    /// which serves the detector alone.
    fn select_no_load_reference(&self, inputs: &TickInputs) -> Result<NoLoad, NoEstimate> {
        let speed_rpm = inputs.speed.map_err(|absence| self.explain_missing_input(self.channels.speed, absence))?.abs();
        if speed_rpm < self.settings.spindle_min_rpm {
            return Err(NoEstimate::SpindleStopped);
        }
        let (memory, settings) = (&self.state, &self.settings);
        let stage = memory.signals.stage();
        let learned = memory.no_load.get(stage, speed_rpm, inputs.at_ns, settings);
        let rough = || memory.no_load.rough_power(stage, speed_rpm, inputs.at_ns, settings);
        let known = learned.or_else(|reason| self.find_upper_bound(stage, speed_rpm).or_else(rough).ok_or(reason));
        known.map(|known| memory.supply.add_exponent_doubt(known, inputs.supply_log))
    }

    fn find_upper_bound(&self, stage: usize, speed_rpm: f64) -> Option<NoLoad> {
        let bound = self.state.upper_bound.filter(|bound| {
            let near = (bound.speed_rpm - speed_rpm).abs() <= self.settings.speed_tolerance * speed_rpm;
            near && bound.stage == stage
        })?;
        let sd_w = 0.5 * self.settings.c2_on * bound.power_w;
        Some(NoLoad {
            power_w: bound.power_w,
            sd_w,
            noise_gain: 1.0,
            origin: NoLoadOrigin::UpperBound,
            supply_log: 0.0,
        })
    }

    fn explain_missing_input(&self, channel: Option<ChannelId>, absence: adapter_core::Absence) -> NoEstimate {
        channel.map_or(NoEstimate::NotYet, |channel| NoEstimate::Input { channel, absence })
    }

    /// The power has settled at a speed without a known no-load power.
    fn settled_at(&mut self, power_w: f64, feed: Feed, inputs: &TickInputs) {
        let Ok(speed) = inputs.speed else { return };
        let point = NoLoadPoint { stage: self.state.signals.stage(), speed_rpm: speed.abs(), power_w };
        if feed == Feed::Off {
            let sd_w = power_w * self.settings.c2_on.hypot(self.state.signals.noise.sd()) / 2.0;
            self.state.no_load.learn_power(point, sd_w, inputs.supply_log, inputs.at_ns, &self.settings);
        } else if power_w > 0.0 {
            self.state.upper_bound = Some(point);
        }
    }

    /// Noise, standby power, upper bound and learning follow the state.
    fn update_memory(
        &mut self,
        inputs: &TickInputs,
        filtered_w: Option<f64>,
        no_load: Result<NoLoad, NoEstimate>,
        verdict: &Detected,
    ) {
        let memory = &mut self.state;
        // Of a control that says nothing it is not known whether its machine is at rest.
        if let (State::Standby, Ok(total), Ok(_)) = (verdict.state, inputs.total, inputs.speed) {
            let standby = memory.standby_w.get_or_insert(total);
            *standby += STANDBY_WEIGHT * (total - *standby);
        }
        let absent =
            matches!(verdict.because, Some(NoEstimate::Input { .. } | NoEstimate::Contradiction | NoEstimate::NotYet));
        let turning = verdict.state.spindle_on() != Some(false) && !absent;
        let steady = memory.signals.is_speed_steady(Pace::Settling, &self.settings) == Some(true);
        match (inputs.power, filtered_w) {
            (Ok(power_w), Some(level_w)) if turning && steady && verdict.state != State::Cutting => {
                memory.signals.noise.push(power_w, level_w);
            }
            _ => memory.signals.noise.forget_last_values(),
        }
        if !turning {
            memory.signals.forget_power();
        }
        if no_load.is_ok_and(|known| known.origin == NoLoadOrigin::UpperBound) {
            self.lower_bound(filtered_w);
        }
        self.learn_idle_power(inputs, no_load, verdict);
    }

    /// A stationary level visibly below the upper bound is a better one.
    fn lower_bound(&mut self, filtered_w: Option<f64>) {
        let (signals, settings) = (&self.state.signals, &self.settings);
        let (Some(bound), Some(level_w)) = (&mut self.state.upper_bound, filtered_w) else { return };
        let agreement_w = signals.agreement_w(level_w, settings);
        if let Some(means) = signals.window.find_stationary_means(agreement_w, settings) {
            let level_w = means.older_w.max(means.newer_w);
            if level_w > 0.0 && level_w < bound.power_w * (1.0 - settings.c2_off) {
                bound.power_w = level_w;
            }
        }
    }

    fn learn_idle_power(&mut self, inputs: &TickInputs, no_load: Result<NoLoad, NoEstimate>, verdict: &Detected) {
        let memory = &mut self.state;
        let rested = memory.signals.worked_ago_s(inputs.at_ns) >= self.settings.learn_guard_s && inputs.feed.is_ok();
        let running = memory.detector.runs_settled();
        let (Ok(power_w), Ok(speed_rpm), true) = (inputs.power, inputs.speed, running) else {
            memory.learner.discard_unconfirmed();
            return;
        };
        let rapid = verdict.state == State::Rapid;
        let tick = IdleTick {
            at_ns: inputs.at_ns,
            power_w,
            speed_rpm,
            stage: memory.signals.stage(),
            rapid,
            supply_log: inputs.supply_log,
        };
        let known = no_load.ok().filter(|known| known.origin != NoLoadOrigin::UpperBound);
        let noise = &mut memory.signals.noise;
        let seen = if verdict.state == State::Cutting {
            memory.learner.discard_feed_block();
            None
        } else if rested {
            memory.learner.observe_idle_power(tick, known, noise, &self.settings)
        } else {
            memory.learner.discard_unconfirmed();
            known.and_then(|known| memory.learner.observe_power_under_feed(tick, known, noise))
        };
        if let Some(seen) = seen {
            memory.no_load.learn_power(seen.point, seen.sd_w, seen.supply_log, seen.at_ns, &self.settings);
            if rested && verdict.state != State::Cutting {
                memory.follow_voltage(&seen, &self.settings);
            }
        }
    }

    fn build_estimates(
        &self,
        inputs: &TickInputs,
        filtered_w: Option<f64>,
        no_load: Result<NoLoad, NoEstimate>,
        verdict: &Detected,
    ) -> Estimates {
        let detector = &self.state.detector;
        let steady = self.check_steadiness(inputs, verdict);
        let power = inputs.power.map_err(|absence| self.explain_missing_input(self.channels.power, absence));
        let filtered = power.and(filtered_w.ok_or(NoEstimate::NotSettled)).map(|value| Estimate {
            value: value + inputs.by_voltage_w,
            sd: self.state.signals.filter.noise_gain() * self.state.signals.noise.sd() * value.abs(),
        });
        let reference = match (steady, no_load) {
            (Err(NoEstimate::MachineOff), _) => Err(NoEstimate::MachineOff),
            (_, Ok(rough)) if !rough.is_estimate() => Err(self.explain_refusal(inputs)),
            (_, known) => known,
        }
        .map(|known| self.at_voltage(known, inputs));
        // Where a no-load power is known, a speed is.
        let speed_rpm = inputs.speed.unwrap_or(0.0);
        let parts = self.split_power(filtered, steady.and(reference), speed_rpm);
        let estimates = Estimates {
            at_ns: inputs.at_ns,
            state: verdict.state,
            basis: inputs.basis,
            since_ns: detector.since_ns,
            spindle_turns: inputs.speed.ok().map(|speed| speed.abs() >= self.settings.spindle_min_rpm),
            unknown_because: verdict.because,
            filtered_power_w: filtered,
            no_load_power_w: reference.map(|known| Estimate { value: known.power_w, sd: known.sd_w }),
            cutting_power_w: parts.map(|it| it.cutting_power_w),
            load_loss_w: parts.map(|it| it.load_loss_w),
            cutting_power_common_sd_w: parts.map_or(0.0, |it| it.common_sd_w),
            load_loss_origin: self.load_loss_origin(),
            visible_cutting_power_w: self.least_visible(reference.and(no_load), speed_rpm),
            no_load_origin: reference.map_or(NoLoadOrigin::None, |known| known.origin),
            noise_gain: reference.map_or(0.0, |known| known.noise_gain),
            visibility: self.classify_visibility(inputs, no_load, verdict),
            // A stage is less than STAGES: the conversion never fails.
            gear_stage: u8::try_from(self.state.signals.stage()).unwrap_or(0),
            ..Estimates::without_samples(inputs.at_ns)
        };
        if inputs.basis.in_watts() { estimates } else { self.without_watts(estimates) }
    }

    /// Why the table gives no estimate at this speed.
    fn explain_refusal(&self, inputs: &TickInputs) -> NoEstimate {
        let speed_rpm = inputs.speed.unwrap_or(0.0);
        let table = &self.state.no_load;
        let refused = table.get(self.state.signals.stage(), speed_rpm, inputs.at_ns, &self.settings);
        refused.err().unwrap_or(NoEstimate::NotLearned)
    }

    /// Does the balance of a steady spindle hold at this tick?
    fn check_steadiness(&self, inputs: &TickInputs, verdict: &Detected) -> Result<(), NoEstimate> {
        match verdict.state {
            State::Off => Err(NoEstimate::MachineOff),
            State::Standby => Err(NoEstimate::SpindleStopped),
            State::SpindleStart | State::SpeedChange => Err(NoEstimate::SpeedChanging),
            State::Unknown => Err(verdict.because.unwrap_or(NoEstimate::NotSettled)),
            State::Idle | State::Cutting | State::Rapid => {
                inputs.power.map(|_| ()).map_err(|absence| self.explain_missing_input(self.channels.power, absence))
            }
        }
    }

    fn classify_visibility(
        &self,
        inputs: &TickInputs,
        no_load: Result<NoLoad, NoEstimate>,
        verdict: &Detected,
    ) -> Visibility {
        let fed = self.state.signals.classify_feed(inputs, &self.settings) == Feed::On;
        match verdict.state {
            State::Cutting => Visibility::Visible,
            State::Idle if fed && no_load.is_ok() => Visibility::BelowVisibility,
            State::Idle | State::Unknown
                if fed && inputs.speed.is_ok_and(|n| n.abs() >= self.settings.spindle_min_rpm) =>
            {
                Visibility::NoReference
            }
            _ => Visibility::NotAsked,
        }
    }

    /// The estimates of the last sample.
    #[must_use]
    pub fn estimates(&self) -> &Estimates {
        &self.estimates
    }

    /// No-load powers known by now.
    #[must_use]
    pub fn no_load(&self) -> &NoLoadTable {
        &self.state.no_load
    }

    /// The settings in force.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }
}
