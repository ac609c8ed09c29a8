//! The recent past of the inputs: filtered power, steadiness of the speed, feed with its debounce.

use super::filter::AntiPulse;
use super::inputs::TickInputs;
use super::noise::RelativeVariances;
use super::settings::Settings;
use super::window::{Means, PowerWindow};
use adapter_core::clock::{SECOND_NS, TimeNs};
use numerics::statistics::count_to_f64;
use serde::{Deserialize, Serialize};

/// Speeds remembered to judge whether a change of speed is over: 0.5 s at 10 Hz.
const SPEEDS: usize = 6;

/// Speeds looked at to notice a change: 0.3 s at 10 Hz.
const LATEST_SPEEDS: usize = 4;

/// A change of speed is over when the remembered speeds differ by less than this, relative: what remains accelerates
/// masses with a few percent of no-load power.
const SETTLED_SPEED: f64 = 0.003;

/// Speed differences below this are the resolution of the display, rpm.
const SPEED_RESOLUTION_RPM: f64 = 3.0;

/// Two levels that are shown in whole steps may be the same although they lie so many steps apart.
const HALF_STEP: f64 = 0.5;

/// What the steadiness of the speed is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Pace {
    /// Before it may count as settled.
    Settling,
    Idling,
    /// While cutting: constant cutting speed (G96) drives it with the diameter.
    Cutting,
}

/// How much faster the speed may change in a cut than while idling.
const CUTTING_RATE: f64 = 3.0;

/// Is the feed on?
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Feed {
    On,
    Off,
    /// The controller does not tell.
    Unknown,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Signals {
    pub(super) filter: AntiPulse,
    pub(super) window: PowerWindow,
    pub(super) noise: RelativeVariances,
    speeds: [(TimeNs, f64); SPEEDS],
    speeds_seen: usize,
    stage: usize,
    /// When the feed was last on, and when it was last on without rapid traverse.
    fed_ns: Option<TimeNs>,
    worked_ns: Option<TimeNs>,
    last_ns: Option<TimeNs>,
    /// Least filtered power since the speed is steady, W.
    least_w: Option<f64>,
}

/// What has to begin anew at this tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Break {
    /// Time jumped, or a sample is missing for too long.
    pub(super) gap: bool,
    pub(super) stage: bool,
}

impl Signals {
    pub(super) fn new(settings: &Settings) -> Self {
        Self {
            filter: AntiPulse::new(to_window_length(settings.filter_samples)),
            window: PowerWindow::new(to_window_length(settings.window_samples)),
            noise: RelativeVariances::new(settings),
            speeds: [(0, 0.0); SPEEDS],
            speeds_seen: 0,
            stage: 0,
            fed_ns: None,
            worked_ns: None,
            last_ns: None,
            least_w: None,
        }
    }

    /// Takes the inputs of a tick.
    pub(super) fn push(&mut self, inputs: &TickInputs, settings: &Settings) -> Break {
        let gap = self.last_ns.is_some_and(|last| {
            let pause_s = seconds_between(last, inputs.at_ns);
            pause_s < 0.0 || pause_s > settings.gap_s
        });
        if gap {
            self.forget_history();
            self.fed_ns = None;
            self.worked_ns = None;
        }
        self.last_ns = Some(inputs.at_ns);
        self.noise.set_resolution(inputs.basis.resolution());
        self.window.set_resolution(inputs.basis.resolution());
        let stage = inputs.stage.unwrap_or(self.stage);
        let changed = std::mem::replace(&mut self.stage, stage) != stage;
        if changed {
            self.forget_history();
        }
        self.push_speed(inputs);
        if inputs.feed.is_ok_and(|feed| feed > settings.feed_min_mm_min) {
            self.fed_ns = Some(inputs.at_ns);
            if !inputs.rapid {
                self.worked_ns = self.fed_ns;
            }
        }
        Break { gap, stage: changed }
    }

    /// Takes the power of a tick and returns the filtered one.
    pub(super) fn push_power(&mut self, power_w: f64, settings: &Settings) -> Option<f64> {
        let filtered_w = self.filter.push(power_w)?;
        self.window.push(filtered_w);
        if self.is_speed_steady(Pace::Settling, settings) == Some(true) {
            self.least_w = Some(self.least_w.map_or(filtered_w, |least| least.min(filtered_w)));
        } else {
            self.least_w = None;
        }
        Some(filtered_w)
    }

    /// The level a start has settled at, or a lower one that it passed before: power at a steady speed is never below
    /// no-load power, so both are upper bounds.
    pub(super) fn least_level_w(&self, means: Means, settings: &Settings) -> f64 {
        let level_w = means.lower_w();
        let noise = self.noise.sd() * self.filter.noise_gain();
        let passed_w = self.least_w.map_or(level_w, |least| least * (1.0 + noise));
        if passed_w < level_w * (1.0 - settings.c2_on.max(2.0 * self.noise.sd())) { passed_w } else { level_w }
    }

    /// Forgets the recent power and speed.
    pub(super) fn forget_history(&mut self) {
        self.forget_power();
        self.speeds_seen = 0;
    }

    /// Forgets the recent power.
    pub(super) fn forget_power(&mut self) {
        self.filter.clear();
        self.window.clear();
        self.noise.forget_last_values();
        self.least_w = None;
    }

    fn push_speed(&mut self, inputs: &TickInputs) {
        match inputs.speed {
            Ok(speed) => {
                self.speeds.rotate_left(1);
                self.speeds[SPEEDS - 1] = (inputs.at_ns, speed);
                self.speeds_seen = (self.speeds_seen + 1).min(SPEEDS);
            }
            Err(_) => self.speeds_seen = 0,
        }
    }

    /// Does the spindle hold its speed? `None` until enough samples are in.
    pub(super) fn is_speed_steady(&self, pace: Pace, settings: &Settings) -> Option<bool> {
        let wanted = if pace == Pace::Settling { SPEEDS } else { LATEST_SPEEDS };
        let known = &self.speeds[SPEEDS - self.speeds_seen.min(wanted)..];
        let (least, greatest) =
            known.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, greatest), (_, speed)| {
                (least.min(*speed), greatest.max(*speed))
            });
        let span_s = seconds_between(known.first()?.0, known.last()?.0);
        let allowed = match pace {
            Pace::Settling => SETTLED_SPEED,
            Pace::Idling => settings.speed_rate_per_s * span_s,
            Pace::Cutting => CUTTING_RATE * settings.speed_rate_per_s * span_s,
        };
        let allowed_rpm = (allowed * greatest.abs().max(least.abs())).max(SPEED_RESOLUTION_RPM);
        let unsteady = greatest - least > allowed_rpm;
        if unsteady { Some(false) } else { (known.len() == wanted).then_some(true) }
    }

    /// Gear stage in force.
    pub(super) fn stage(&self) -> usize {
        self.stage
    }

    /// How long ago the feed was on other than in rapid traverse, s; infinite where it never was.
    pub(super) fn worked_ago_s(&self, now_ns: TimeNs) -> f64 {
        self.worked_ns.map_or(f64::INFINITY, |worked| seconds_between(worked, now_ns))
    }

    fn fed_ago_s(&self, now_ns: TimeNs) -> f64 {
        self.fed_ns.map_or(f64::INFINITY, |fed| seconds_between(fed, now_ns))
    }

    pub(super) fn classify_feed(&self, inputs: &TickInputs, settings: &Settings) -> Feed {
        match inputs.feed {
            Ok(feed) if feed > settings.feed_min_mm_min => Feed::On,
            Ok(_) if self.fed_ago_s(inputs.at_ns) > settings.feed_debounce_s => Feed::Off,
            Ok(_) => Feed::On,
            Err(_) => Feed::Unknown,
        }
    }

    /// How far the means of the two windows may lie apart, W: a third of what begins a cut, or the noise of the means.
    pub(super) fn agreement_w(&self, level_w: f64, settings: &Settings) -> f64 {
        let noise = 2.0 * self.noise.sd() * (2.0 / settings.window_samples).sqrt();
        // What is shown in whole steps agrees within half a step.
        ((settings.c2_on / 3.0).max(noise) * level_w.abs()).max(HALF_STEP * self.noise.resolution_w())
    }
}

/// Seconds from `from_ns` to `to_ns`, negative when time runs backwards.
#[expect(clippy::cast_precision_loss, reason = "a duration in nanoseconds; microseconds suffice beyond 104 days")]
pub(super) fn seconds_between(from_ns: TimeNs, to_ns: TimeNs) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 / SECOND_NS as f64
}

/// A setting that is a count, as a count.
pub(super) fn to_window_length(setting: f64) -> usize {
    (1..=100).take_while(|n| count_to_f64(*n) <= setting).last().unwrap_or(1)
}
