//! Learning no-load power while the spindle idles.
//!
//! Idle power is cut into blocks of N samples; the mean of a block's middle part is one observation. Rapid traverse cannot
//! cut, so its samples count at once; samples at rest count after the guard time, if the feed stayed off: meter and
//! controller may disagree on when a cut began. A block may be collected from several short pauses at one speed.
//!
//! Power below the known one is believed once the next block confirms it (warm-up lowers no-load power). Power visibly
//! above it may be a light cut that nobody reported, and is believed only in rapid traverse or after it has lasted.
//! Under feed nothing is learned, except that no-load power cannot be above what is measured (see `bound`).

use super::bound::{self, Normal};
use super::estimate_words::NoLoadOrigin;
use super::no_load::{NoLoad, NoLoadPoint};
use super::noise::RelativeVariances;
use super::settings::Settings;
use super::signals::{seconds_between, to_window_length};
use adapter_core::clock::TimeNs;
use numerics::statistics::count_to_f64;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Idle power: pulses of either sign, each smeared over two ticks, must leave no trace.
const MIDDLE: (f64, f64) = (0.2, 0.8);

/// Power under feed bounds no-load power from above: rather a little high than drawn down by a dip.
const UPPER: (f64, f64) = (0.4, 0.9);

/// Variance of the mean of the middle half, relative to that of the plain mean.
const MIDDLE_HALF: f64 = 1.2;

/// Two successive blocks of a settled spindle differ by less than this, relative.
const AGREEMENT: f64 = 0.02;

/// Standard deviation of a level that is rounded to whole steps, in steps.
const ROUNDED: f64 = 0.289;

/// Power under feed further below a measured no-load power than this, relative, says nothing about it.
const FAR_BELOW: f64 = 0.15;

/// Within a block the speed may vary by this much, relative; more, and masses are accelerated.
const SAME_SPEED: f64 = 0.004;

/// A block is collected within this time, s.
const BLOCK_LASTS_S: f64 = 120.0;

/// A longer pause between two samples of a block, s, and slow changes no longer count as noise.
const PAUSE_S: f64 = 0.5;

/// At most this many samples wait for the guard time.
const WAITING: usize = 512;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Observation {
    pub(super) point: NoLoadPoint,
    pub(super) sd_w: f64,
    pub(super) at_ns: TimeNs,
    /// Does it agree with the block before it?
    confirmed: bool,
    /// Are all samples from rapid traverse?
    rapid: bool,
    /// Logarithm of supply voltage over its reference, on the mean.
    pub(super) supply_log: f64,
}

impl Observation {
    /// Settled for certain: it agrees with the block before it, or comes from rapid traverse alone.
    pub(super) fn is_settled(&self) -> bool {
        self.confirmed || self.rapid
    }
}

/// One tick of idle power.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct IdleTick {
    pub(super) at_ns: TimeNs,
    pub(super) power_w: f64,
    pub(super) speed_rpm: f64,
    pub(super) stage: usize,
    pub(super) rapid: bool,
    /// Logarithm of supply voltage over its reference.
    #[serde(default)]
    pub(super) supply_log: f64,
}

/// Powers at one speed of one gear stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct IdleBlock {
    length: usize,
    /// The mean is that of the values between these quantiles.
    quantiles: (f64, f64),
    powers_w: Vec<f64>,
    #[serde(default)]
    supply_logs: f64,
    first: Option<IdleTick>,
    rapid: bool,
    /// Means of the blocks before, the latest first, and how many of the latest came without a pause.
    means_w: [f64; 3],
    blocks: usize,
    unbroken: usize,
    broken: bool,
    last_ns: TimeNs,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Learner {
    idle: IdleBlock,
    fed: IdleBlock,
    waiting: VecDeque<IdleTick>,
    above_since_ns: Option<TimeNs>,
}

impl IdleBlock {
    fn new(length: usize, quantiles: (f64, f64)) -> Self {
        let powers_w = Vec::with_capacity(length);
        Self {
            length,
            quantiles,
            powers_w,
            supply_logs: 0.0,
            first: None,
            rapid: true,
            means_w: [0.0; 3],
            blocks: 0,
            unbroken: 0,
            broken: true,
            last_ns: 0,
        }
    }

    fn clear(&mut self) {
        self.powers_w.clear();
        self.supply_logs = 0.0;
        self.first = None;
        self.rapid = true;
    }

    /// Another speed or stage, or too long ago.
    fn clear_if_other(&mut self, tick: &IdleTick) {
        let other = self.first.is_some_and(|first| {
            let moved = (tick.speed_rpm.abs() - first.speed_rpm.abs()).abs() > SAME_SPEED * first.speed_rpm.abs();
            let pause_s = seconds_between(first.at_ns, tick.at_ns);
            moved || tick.stage != first.stage || !(0.0..=BLOCK_LASTS_S).contains(&pause_s)
        });
        if other {
            self.clear();
            (self.blocks, self.unbroken) = (0, 0);
        }
    }

    /// The last three blocks, if no pause lies in between.
    fn last_three_w(&self) -> Option<[f64; 3]> {
        (self.unbroken >= 3 && self.means_w[1] > 0.0).then_some(self.means_w)
    }

    /// Takes a tick and yields the observation of a full block.
    fn push(&mut self, tick: IdleTick, noise: &RelativeVariances) -> Option<Observation> {
        self.clear_if_other(&tick);
        self.broken |= seconds_between(self.last_ns, tick.at_ns) > PAUSE_S;
        self.last_ns = tick.at_ns;
        let first = *self.first.get_or_insert(tick);
        self.powers_w.push(tick.power_w);
        self.supply_logs += tick.supply_log;
        self.rapid &= tick.rapid;
        if self.powers_w.len() < self.length {
            return None;
        }
        let power_w = mean_between(&mut self.powers_w, self.quantiles);
        let seen = self.build_observation(power_w, first, tick.at_ns, noise);
        self.clear();
        self.first = Some(IdleTick { at_ns: tick.at_ns, ..first });
        seen
    }

    fn build_observation(
        &mut self,
        power_w: f64,
        first: IdleTick,
        at_ns: TimeNs,
        noise: &RelativeVariances,
    ) -> Option<Observation> {
        let noise_w = noise.sd() * power_w;
        let settling_w = (self.blocks > 0).then(|| power_w - self.means_w[0]);
        // Rounding does not average out of a level that stands still.
        let rounding_w = ROUNDED * noise.resolution_w();
        let variance = MIDDLE_HALF * noise_w * noise_w / count_to_f64(self.length)
            + rounding_w * rounding_w
            + settling_w.map_or(0.0, |w| w * w / 2.0)
            + 1e-6 * power_w * power_w;
        self.means_w = [power_w, self.means_w[0], self.means_w[1]];
        self.blocks += 1;
        self.unbroken = if std::mem::take(&mut self.broken) { 0 } else { self.unbroken + 1 };
        let point = NoLoadPoint { stage: first.stage, speed_rpm: first.speed_rpm.abs(), power_w };
        let agreement_w = (AGREEMENT * power_w).max(0.5 * noise.resolution_w());
        let supply_log = self.supply_logs / count_to_f64(self.length);
        let confirmed = settling_w.is_some_and(|w| w.abs() <= agreement_w);
        let seen = Observation { point, sd_w: variance.sqrt(), at_ns, confirmed, rapid: self.rapid, supply_log };
        (power_w > 0.0).then_some(seen)
    }
}

impl Learner {
    pub(super) fn new(settings: &Settings) -> Self {
        let length = to_window_length(settings.window_samples);
        let (idle, fed) = (IdleBlock::new(length, MIDDLE), IdleBlock::new((3 * length / 4).max(5), UPPER));
        Self { idle, fed, waiting: VecDeque::with_capacity(WAITING), above_since_ns: None }
    }

    /// The spindle no longer idles: what has not been confirmed is dropped.
    pub(super) fn discard_unconfirmed(&mut self) {
        self.waiting.clear();
        self.above_since_ns = None;
    }

    /// A cut: what is being collected under feed is spoilt.
    pub(super) fn discard_feed_block(&mut self) {
        self.discard_unconfirmed();
        self.fed.clear();
    }

    /// Nothing collected so far can be relied upon.
    pub(super) fn discard_collected(&mut self) {
        self.discard_unconfirmed();
        self.idle.clear();
        self.fed.clear();
    }

    /// Takes a tick of idle power with the feed off or in rapid traverse; yields an observation to learn.
    pub(super) fn observe_idle_power(
        &mut self,
        tick: IdleTick,
        known: Option<NoLoad>,
        noise: &mut RelativeVariances,
        settings: &Settings,
    ) -> Option<Observation> {
        let tick = if tick.rapid { Some(tick) } else { self.delay_tick(tick, settings) };
        self.fed.clear();
        let seen = self.idle.push(tick?, noise)?;
        if let Some(blocks_w) = self.idle.last_three_w() {
            noise.push_blocks(blocks_w, count_to_f64(self.idle.length));
        }
        self.is_plausible(&seen, known, settings).then_some(seen)
    }

    /// Through the queue: a tick comes out when it is as old as the guard time.
    fn delay_tick(&mut self, tick: IdleTick, settings: &Settings) -> Option<IdleTick> {
        if self.waiting.len() == WAITING {
            self.waiting.pop_front();
        }
        self.waiting.push_back(tick);
        let ripe = |oldest: &&IdleTick| seconds_between(oldest.at_ns, tick.at_ns) >= settings.learn_guard_s;
        self.waiting.front().filter(ripe)?;
        self.waiting.pop_front()
    }

    /// Takes a tick of power under feed: no-load power cannot be above it. Yields an observation where it lies clearly
    /// below what is known. A block begins with the feed, so that the first holds the approach alone.
    pub(super) fn observe_power_under_feed(
        &mut self,
        tick: IdleTick,
        known: NoLoad,
        noise: &RelativeVariances,
    ) -> Option<Observation> {
        let seen = self.fed.push(tick, noise)?;
        let noise_w = noise.sd() * seen.point.power_w * (MIDDLE_HALF / count_to_f64(self.fed.length)).sqrt();
        let below_w = known.power_w - seen.point.power_w;
        // Far below is no drift: a spindle that brakes, or a meter that fails.
        let near = known.origin != NoLoadOrigin::Measured || below_w < FAR_BELOW * known.power_w;
        if !near || below_w <= 2.0 * noise_w {
            return None;
        }
        let before = Normal { mean: known.power_w, sd: known.sd_w };
        let after = bound::condition_on_upper_bound(before, seen.point.power_w, noise_w);
        // A speed that is known already is updated, any other is taken over as it is.
        let Normal { mean, sd } =
            if known.origin == NoLoadOrigin::Measured { bound::as_measurement(before, after) } else { after };
        let point = NoLoadPoint { power_w: mean, ..seen.point };
        (mean > 0.0).then_some(Observation { point, sd_w: sd, ..seen })
    }

    fn is_plausible(&mut self, seen: &Observation, known: Option<NoLoad>, settings: &Settings) -> bool {
        // What is known of other speeds says too little to contradict a settled power at this one. Rapid traverse is short,
        // so one block of it is enough: a start-up that still decayed is corrected from above.
        let Some(known) = known.filter(|known| known.origin == NoLoadOrigin::Measured) else {
            return seen.confirmed || seen.rapid;
        };
        let limit_w = known.power_w * settings.c2_off + 2.0 * known.sd_w.hypot(seen.sd_w);
        let above_w = seen.point.power_w - known.power_w;
        if above_w <= limit_w {
            self.above_since_ns = None;
            return above_w >= -limit_w || seen.confirmed;
        }
        let since = *self.above_since_ns.get_or_insert(seen.at_ns);
        seen.rapid && seen.confirmed || seconds_between(since, seen.at_ns) >= settings.relearn_up_s
    }
}

/// Mean of the values between two quantiles; sorts them.
fn mean_between(values: &mut [f64], (low, high): (f64, f64)) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let n = values.len();
    let at = |quantile: f64| to_window_length(quantile * count_to_f64(n) + 0.5).min(n);
    let kept = values.get(at(low)..at(high)).filter(|kept| !kept.is_empty()).unwrap_or(values);
    kept.iter().sum::<f64>() / count_to_f64(kept.len().max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pulses_leave_the_middle_half_alone() {
        assert_eq!(mean_between(&mut [5.0, 1e6, 5.0, 5.0, -1e6, 5.0, 5.0, 1e6], MIDDLE), 5.0);
        assert_eq!(mean_between(&mut [5.0, 5.0, -1e6, -1e5, 5.0, 5.0, 5.0], UPPER), 5.0);
        assert_eq!(mean_between(&mut [3.0], MIDDLE), 3.0);
    }
}
