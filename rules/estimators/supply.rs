//! How no-load power goes with the supply voltage: `Pu(n, U) = Pu(n, U0) (U / U0)^e`, with an exponent that is learned.
//!
//! A drive that magnetises from the mains takes no-load power with the square of the voltage (e up to 2), one behind a regulated
//! link hardly notices it (e near 0). Source of the law and its range: electrical machines, iron and magnetising losses go with
//! U^2, friction and windage do not depend on it. Nobody knows e beforehand, so it starts at 0 with a doubt of 1, and is learned from
//! idle powers of one speed at different voltages. Until then the doubt goes into the uncertainty of no-load power, so that
//! a change of voltage is not taken for a cut.
//!
//! Without a channel for the voltage nothing here has any effect.

use super::inputs::Input;
use super::no_load::NoLoad;
use super::settings::Settings;
use super::signals::seconds_between;
use adapter_core::clock::TimeNs;
use serde::{Deserialize, Serialize};

/// Doubt of the exponent before anything was learned.
const EXPONENT_SD: f64 = 1.0;
/// The exponents that a drive can have.
const EXPONENTS: (f64, f64) = (-0.5, 2.5);
/// Farther from its reference than this, as a logarithm, a voltage is a fault of the meter: mains stay within 10 %.
const FARTHEST: f64 = 0.2;
/// Idle powers at voltages closer than this, as a logarithm, say nothing about the exponent.
const LEAST_STEP: f64 = 0.003;
/// An idle power older than this is no comparison: the machine has warmed up meanwhile, s.
const OLDEST_S: f64 = 300.0;
/// A single comparison counts at most this many standard deviations: a start that still decays must not decide.
const CLIP_SD: f64 = 2.5;
/// Speeds that are remembered for comparison.
const SPEEDS: usize = 8;
/// Two idle powers of speeds closer than this share compare.
const SAME_SPEED: f64 = 0.004;
/// Weight of a new voltage in the mean that stands in while the meter does not tell it.
const MEAN_WEIGHT: f64 = 0.002;

/// An idle power, as it would be at the reference voltage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Idle {
    at_ns: TimeNs,
    stage: usize,
    speed_rpm: f64,
    power_log: f64,
    supply_log: f64,
    variance: f64,
}

/// An idle power that was just measured.
#[derive(Debug, Clone, Copy)]
pub(super) struct MeasuredIdlePower {
    pub(super) at_ns: TimeNs,
    pub(super) stage: usize,
    pub(super) speed_rpm: f64,
    /// As it would be at the reference voltage by the exponent in force, W.
    pub(super) power_w: f64,
    pub(super) sd_w: f64,
    /// Logarithm of voltage over its reference while it was measured.
    pub(super) supply_log: f64,
}

/// The exponent, and what it is learned from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Supply {
    reference_v: Option<f64>,
    mean_log: f64,
    exponent: f64,
    variance: f64,
    idle: [Option<Idle>; SPEEDS],
    next: usize,
}

impl Default for Supply {
    fn default() -> Self {
        let variance = EXPONENT_SD * EXPONENT_SD;
        Self { reference_v: None, mean_log: 0.0, exponent: 0.0, variance, idle: [None; SPEEDS], next: 0 }
    }
}

impl Supply {
    /// Takes the voltage of a tick and returns its logarithm over the reference; 0 where none was ever seen, the mean while
    /// the meter does not tell it.
    pub(super) fn observe_voltage(&mut self, voltage_v: Input) -> f64 {
        let usable = |voltage_v: &f64| voltage_v.is_finite() && *voltage_v > 1.0;
        let Some(voltage_v) = voltage_v.ok().filter(usable) else { return self.mean_log };
        let log = (voltage_v / *self.reference_v.get_or_insert(voltage_v)).ln();
        if log.abs() > FARTHEST {
            return self.mean_log;
        }
        self.mean_log += MEAN_WEIGHT * (log - self.mean_log);
        log
    }

    /// No-load power at this voltage over that at the reference.
    pub(super) fn power_ratio(&self, supply_log: f64) -> f64 {
        (self.exponent * supply_log).exp()
    }

    /// The same no-load power, with the doubt that the exponent adds at a voltage other than that of its learning.
    pub(super) fn add_exponent_doubt(&self, known: NoLoad, supply_log: f64) -> NoLoad {
        let doubt_w = self.variance.sqrt() * (supply_log - known.supply_log).abs() * known.power_w;
        NoLoad { sd_w: known.sd_w.hypot(doubt_w), ..known }
    }

    /// Takes an idle power and compares it with the last one of this speed. Returns the change of the exponent.
    pub(super) fn learn_exponent(&mut self, measured: MeasuredIdlePower, settings: &Settings) -> f64 {
        if self.reference_v.is_none() || measured.power_w <= 0.0 {
            return 0.0;
        }
        let relative = measured.sd_w / measured.power_w;
        let now = Idle {
            at_ns: measured.at_ns,
            stage: measured.stage,
            speed_rpm: measured.speed_rpm,
            power_log: measured.power_w.ln(),
            supply_log: measured.supply_log,
            variance: relative * relative,
        };
        let near = |it: &Idle| it.stage == now.stage && (it.speed_rpm / now.speed_rpm - 1.0).abs() <= SAME_SPEED;
        let slot = self.idle.iter().position(|it| it.as_ref().is_some_and(near));
        let Some(slot) = slot else {
            self.idle[self.next] = Some(now);
            self.next = (self.next + 1) % SPEEDS;
            return 0.0;
        };
        let Some(before) = self.idle[slot] else { return 0.0 };
        let age_s = seconds_between(before.at_ns, now.at_ns);
        let step = now.supply_log - before.supply_log;
        if !(0.0..=OLDEST_S).contains(&age_s) {
            self.idle[slot] = Some(now);
            return 0.0;
        }
        if step.abs() < LEAST_STEP {
            return 0.0;
        }
        self.idle[slot] = Some(now);
        let drift = settings.no_load_drift;
        let drifted = 2.0 * drift * drift * -(-age_s / settings.no_load_drift_time_s).exp_m1();
        self.update_exponent(now.power_log - before.power_log, step, now.variance + before.variance + drifted)
    }

    /// Kalman update of the exponent by `change = (e - exponent) step`.
    fn update_exponent(&mut self, change: f64, step: f64, noise: f64) -> f64 {
        let expected = step * step * self.variance + noise;
        let gain = self.variance * step / expected;
        let limit = CLIP_SD * expected.sqrt();
        let before = self.exponent;
        self.exponent = (before + gain * change.clamp(-limit, limit)).clamp(EXPONENTS.0, EXPONENTS.1);
        self.variance *= 1.0 - gain * step;
        let corrected = self.exponent - before;
        for idle in self.idle.iter_mut().flatten() {
            idle.power_log -= corrected * idle.supply_log;
        }
        corrected
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapter_core::Absence;
    use adapter_core::clock::SECOND_NS;

    /// Idles of one speed every 5 s while the voltage swings by 4 %.
    fn learned(exponent: f64) -> Supply {
        let (mut supply, settings) = (Supply::default(), Settings::default());
        for k in 0..60 {
            let voltage_v = 400.0 * (1.0 + 0.04 * (f64::from(k) / 3.0).sin());
            let supply_log = supply.observe_voltage(Ok(voltage_v));
            let power_w = 500.0 * (exponent * supply_log).exp() / supply.power_ratio(supply_log);
            let at_ns = 5 * i64::from(k) * SECOND_NS;
            supply.learn_exponent(
                MeasuredIdlePower { at_ns, stage: 1, speed_rpm: 800.0, power_w, sd_w: 5.0, supply_log },
                &settings,
            );
        }
        supply
    }

    #[test]
    fn the_exponent_is_found_whatever_it_is() {
        for exponent in [0.0, 0.7, 2.0] {
            let supply = learned(exponent);
            assert!((supply.exponent - exponent).abs() < 0.15, "{exponent}: {}", supply.exponent);
            assert!(supply.variance < 0.1);
        }
    }

    #[test]
    fn without_a_voltage_nothing_changes_and_a_faulty_one_is_no_voltage() {
        let mut supply = Supply::default();
        assert_eq!(supply.observe_voltage(Err(Absence::NotProvided)), 0.0);
        assert_eq!(supply.power_ratio(0.0), 1.0);
        assert_eq!(supply.observe_voltage(Ok(400.0)), 0.0);
        for faulty in [0.0, f64::NAN, 12.0, 1000.0] {
            assert_eq!(supply.observe_voltage(Ok(faulty)), 0.0, "{faulty}");
        }
    }
}
