//! Learning no-load power while the spindle idles.
//!
//! Idle power is cut into blocks of N samples; the mean of a block's middle half is one observation. An observation
//! waits for the guard time and counts only if the feed stayed off: meter and controller may disagree on when a cut
//! began. What lies below the known power is learned at once (warm-up lowers it), what lies visibly above it only after it has lasted:
//! it may be a light cut that nobody reported.

use super::filter::count;
use super::no_load::{NoLoad, NoLoadPoint};
use super::noise::Noise;
use super::settings::Settings;
use super::signals::{length, seconds};
use adapters::clock::TimeNs;
use serde::{Deserialize, Serialize};

/// Variance of the mean of the middle half, relative to that of the plain mean.
const MIDDLE_HALF: f64 = 1.2;

/// Two successive blocks of a settled spindle differ by less than this, relative.
const AGREEMENT: f64 = 0.02;

/// A block's power.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Observation {
    pub(super) point: NoLoadPoint,
    pub(super) sd_w: f64,
    pub(super) at_ns: TimeNs,
    /// Does it agree with the block before it?
    confirmed: bool,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Learner {
    length: usize,
    block: Vec<f64>,
    speed_sum: f64,
    previous_w: Option<f64>,
    before_w: Option<f64>,
    waiting: Option<Observation>,
    above_since_ns: Option<TimeNs>,
}

/// One tick of idle power.
#[derive(Debug, Clone, Copy)]
pub(super) struct IdleTick {
    pub(super) at_ns: TimeNs,
    pub(super) power_w: f64,
    pub(super) speed_rpm: f64,
    pub(super) stage: usize,
}

impl Learner {
    pub(super) fn new(settings: &Settings) -> Self {
        let length = length(settings.window_samples);
        Self {
            length,
            block: Vec::with_capacity(length),
            speed_sum: 0.0,
            previous_w: None,
            before_w: None,
            waiting: None,
            above_since_ns: None,
        }
    }

    /// The spindle no longer idles: what has not been confirmed is dropped.
    pub(super) fn stop(&mut self) {
        self.clear_block();
        self.previous_w = None;
        self.before_w = None;
        self.waiting = None;
        self.above_since_ns = None;
    }

    fn clear_block(&mut self) {
        self.block.clear();
        self.speed_sum = 0.0;
    }

    /// Takes a tick of idle power with the feed off; yields an observation that has been confirmed.
    pub(super) fn step(
        &mut self,
        tick: IdleTick,
        known: Option<NoLoad>,
        noise: &mut Noise,
        settings: &Settings,
    ) -> Option<Observation> {
        let confirmed = self.waiting.filter(|it| seconds(it.at_ns, tick.at_ns) >= settings.learn_guard_s);
        if confirmed.is_some() {
            self.waiting = None;
        }
        self.block.push(tick.power_w);
        self.speed_sum += tick.speed_rpm.abs();
        if self.block.len() >= self.length {
            self.waiting = self.close_block(tick, noise);
        }
        confirmed.filter(|it| self.plausible(it, known, settings))
    }

    fn close_block(&mut self, tick: IdleTick, noise: &mut Noise) -> Option<Observation> {
        let speed_rpm = self.speed_sum / count(self.block.len());
        let power_w = middle_half_mean(&mut self.block);
        let noise_w = noise.sd() * power_w;
        let settling_w = self.previous_w.map(|previous| power_w - previous);
        let variance = MIDDLE_HALF * noise_w * noise_w / count(self.block.len())
            + settling_w.map_or(0.0, |w| w * w / 2.0)
            + 1e-6 * power_w * power_w;
        if let (Some(before), Some(previous)) = (self.before_w, self.previous_w.filter(|previous| *previous > 0.0)) {
            noise.push_blocks([before, previous, power_w], count(self.length));
        }
        self.before_w = self.previous_w.replace(power_w);
        self.clear_block();
        let point = NoLoadPoint { stage: tick.stage, speed_rpm, power_w };
        let confirmed = settling_w.is_some_and(|w| w.abs() <= AGREEMENT * power_w);
        (power_w > 0.0).then(|| Observation { point, sd_w: variance.sqrt(), at_ns: tick.at_ns, confirmed })
    }

    /// Power visibly below the known one must be confirmed by the next block, power above it must last.
    fn plausible(&mut self, seen: &Observation, known: Option<NoLoad>, settings: &Settings) -> bool {
        let Some(known) = known else { return true };
        let limit_w = known.power_w * settings.c2_off + 2.0 * known.sd_w.hypot(seen.sd_w);
        let above_w = seen.point.power_w - known.power_w;
        if above_w <= limit_w {
            self.above_since_ns = None;
            return above_w >= -limit_w || seen.confirmed;
        }
        let since = *self.above_since_ns.get_or_insert(seen.at_ns);
        seconds(since, seen.at_ns) >= settings.relearn_up_s
    }
}

/// Mean of the values between the quartiles; sorts them.
fn middle_half_mean(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let cut = values.len() / 4;
    let middle = &values[cut..values.len() - cut];
    middle.iter().sum::<f64>() / count(middle.len().max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pulses_leave_the_middle_half_alone() {
        assert_eq!(middle_half_mean(&mut [5.0, 1e6, 5.0, 5.0, -1e6, 5.0, 5.0, 1e6]), 5.0);
        assert_eq!(middle_half_mean(&mut [3.0]), 3.0);
    }
}
