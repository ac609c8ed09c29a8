//! What the inputs of a tick say before any estimation.

use super::basis::StateBasis;
use super::estimate::NoEstimate;
use super::inputs::TickInputs;
use super::no_load::NoLoad;
use super::settings::Settings;
use super::signals::{Feed, Signals};
use adapter_core::{Absence, ChannelId};

/// Everything the detector looks at in one tick.
pub(super) struct Tick<'a> {
    pub(super) inputs: &'a TickInputs,
    pub(super) signals: &'a Signals,
    pub(super) settings: &'a Settings,
    pub(super) filtered_w: Option<f64>,
    /// Power of the whole machine at rest, W, once it was seen.
    pub(super) standby_w: Option<f64>,
    /// No-load power at this speed, or why there is none.
    pub(super) no_load: Result<NoLoad, NoEstimate>,
}

/// What the inputs say before any estimation.
pub(super) enum Situation {
    Off,
    Rest,
    Turning,
    Missing(NoEstimate),
}

/// What was seen up to this tick.
#[derive(Debug, Clone, Copy)]
pub(super) struct SeenBefore {
    /// The spindle stands for a moment between two directions.
    pub(super) crossing_zero: bool,
    /// The machine had power a tick ago: a single pulse of the meter does not switch it on.
    pub(super) had_power: bool,
    /// The spindle turned when its speed was read last.
    pub(super) turning: bool,
}

impl Tick<'_> {
    pub(super) fn classify_feed(&self) -> Feed {
        self.signals.classify_feed(self.inputs, self.settings)
    }

    pub(super) fn is_powered(&self) -> Option<bool> {
        self.inputs.total.ok().map(|total| total.abs() >= self.settings.off_power_w)
    }

    pub(super) fn determine_situation(&self, before: SeenBefore) -> Situation {
        let no_power = self.is_powered() == Some(false);
        let meter_is_on = self.is_powered() == Some(true) && before.had_power;
        match (self.inputs.speed, self.find_power_above_rest()) {
            // Neither a refused connection nor silence is off while power flows: that contradicts off and standby.
            (Err(Absence::MachineOff), Some(power_w)) if self.standby_w.is_some() || before.turning => {
                Situation::Missing(NoEstimate::ControlSilent { power_w })
            }
            (Err(Absence::Timeout | Absence::Disconnected | Absence::Stale), Some(power_w)) => {
                Situation::Missing(NoEstimate::ControlSilent { power_w })
            }
            (speed, _) => self.judge_speed(speed, before.crossing_zero, no_power, meter_is_on),
        }
    }

    /// Does anything measured say that the spindle stands? A control that does not answer says nothing of its spindle: without a meter at its
    /// standby the spindle may turn on.
    pub(super) fn is_rest_measured(&self) -> bool {
        let at_standby =
            self.standby_w.is_some() && self.inputs.total.is_ok() && self.find_power_above_rest().is_none();
        self.inputs.speed.is_ok() || self.is_powered() == Some(false) || at_standby
    }

    /// Power of the whole machine, W, where it is visibly more than at rest. Before the machine was seen at rest that is whatever is
    /// not off.
    fn find_power_above_rest(&self) -> Option<f64> {
        let rest_w = ABOVE_REST * self.standby_w.unwrap_or(0.0);
        let least_w = rest_w.max(self.settings.off_power_w);
        self.inputs.total.ok().map(f64::abs).filter(|total_w| *total_w > least_w)
    }

    fn judge_speed(
        &self,
        speed: Result<f64, Absence>,
        crossing_zero: bool,
        no_power: bool,
        meter_is_on: bool,
    ) -> Situation {
        match speed {
            Err(Absence::MachineOff) if meter_is_on => Situation::Rest,
            Err(Absence::MachineOff) => Situation::Off,
            Err(_) if no_power => Situation::Off,
            Err(absence) => report_missing_input("spindle_speed_rpm", absence),
            Ok(speed) if speed.abs() < self.settings.spindle_min_rpm && !crossing_zero => {
                if no_power {
                    Situation::Off
                } else {
                    Situation::Rest
                }
            }
            Ok(_) if no_power => Situation::Missing(NoEstimate::Contradiction),
            Ok(_) => match (self.inputs.power, self.inputs.stage) {
                (Err(_), Ok(_)) if self.inputs.basis == StateBasis::Motion => Situation::Turning,
                (Err(absence), _) => {
                    report_missing_input(self.inputs.basis.stand_in().map_or("spindle_power_w", |it| it.0), absence)
                }
                (_, Err(absence)) => report_missing_input("gear_stage", absence),
                _ => Situation::Turning,
            },
        }
    }

    /// Excess over no-load power above which a load counts as visible, W.
    pub(super) fn visible_excess_w(&self) -> Option<f64> {
        self.no_load.ok().map(|no_load| visible_excess_w(no_load, self.signals, self.settings))
    }

    /// Excess over no-load power below which a load has ended, W.
    pub(super) fn ending_excess_w(&self) -> Option<f64> {
        let share = (self.settings.c2_off / self.settings.c2_on).min(1.0);
        self.visible_excess_w().map(|excess_w| share * excess_w)
    }
}

/// Excess over no-load power above which a load counts as visible, W: c2_on, or what noise and doubt demand.
pub(super) fn visible_excess_w(no_load: NoLoad, signals: &Signals, settings: &Settings) -> f64 {
    let relative = settings.c2_on.max(signals.noise.sd()).max(3.0 * signals.noise.level_sd());
    (relative * no_load.power_w).max(no_load.sd_w).max(VISIBLE_STEPS * signals.noise.resolution_w())
}

/// Power at rest times this is more than rest: lamps, fans and a pump that starts are below it. Too low and a pump counts as a
/// machine at work that does not answer; too high and a spindle that idles slowly is not noticed.
const ABOVE_REST: f64 = 1.2;

/// No-load value and load are both rounded to whole steps, each by half a step at most: what is less than this many steps apart
/// may be the same.
const VISIBLE_STEPS: f64 = 1.2;

fn report_missing_input(channel: &str, absence: Absence) -> Situation {
    let reason = |channel| NoEstimate::Input { channel, absence };
    Situation::Missing(ChannelId::from_name(channel).map_or(NoEstimate::NotYet, reason))
}
