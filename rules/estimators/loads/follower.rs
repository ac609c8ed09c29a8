//! From a load to a feed override.
//!
//! What goes in is the share of the load that a cut should have, reckoned at the programmed feed: an override that is in force
//! changes it as little as possible. Two rules, because being wrong costs differently on the two sides:
//!
//! - *Down at once.* A load that is too great for the feed lowers it at this tick where the excess is clear, and after half a second
//!   where it is small; later where a law waits until it is sure. While the feed itself changes, the power lags behind it; so the load is held against the greatest feed of
//!   the last moments, and a feed that is already falling is not lowered twice.
//!   Nothing is asked for where the axes already go slower: at the end of a block the feed falls before the load does.
//! - *Up only from a steady load.* Where the tool enters or leaves the work the load is small, and nothing is to be concluded from
//!   that. The feed rises only after the load has been the same for `steady_s`, in both halves of that time, and is not falling at
//!   this moment.
//!
//! In a ramp the request therefore never rises, whatever its length up to some twenty times `steady_s`.

use adapter_core::clock::{SECOND_NS, TimeNs};
use std::collections::VecDeque;

/// Time constant of the smoothing of the load, s: meters are noisy at every tick.
const SMOOTH_S: f64 = 0.1;
/// The power follows a change of the feed within this time, s: the moving average of the power, and the lag of meter and controller.
const LAG_NS: i64 = 2 * SECOND_NS / 5;
/// Small corrections downwards look at the mean over this time.
const SOON_NS: i64 = SECOND_NS / 2;
/// So many dead bands below the override in force a correction is clear and not noise.
const CLEAR: f64 = 4.0;
/// The halves of a steady stretch differ by no more than this share. A ramp from nothing to the full load in 5 s differs by 17 % in
/// 1.5 s, one in 20 s by 4 %. Wider: ramps pass for steady; narrower: noise of light cuts never does.
const HALVES_SHARE: f64 = 0.04;
/// Greatest less least value of a steady stretch, as a share of its mean.
const RANGE_SHARE: f64 = 0.3;
/// Samples of one stretch; a box that ticks faster keeps fewer of them, so that the stretch stays whole.
const SAMPLES_MAX: i64 = 512;

/// What a law may ask for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OverrideRange {
    pub(super) min_pct: f64,
    pub(super) max_pct: f64,
    /// Smaller corrections are not worth a request.
    pub(super) dead_band_pct: f64,
    /// How long the load has to be steady before the feed rises, s.
    pub(super) steady_s: f64,
    /// How long an excess has to stand before the feed is lowered, s. A meter that is disturbed for a moment shows it for as long as
    /// the power is filtered; where nothing breaks in that time it is waited for, where an edge may break it is not.
    pub(super) sure_s: f64,
}

#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct OverrideFollower {
    smooth: Option<f64>,
    /// Time in ns, and the smoothed share then.
    shares: VecDeque<(TimeNs, f64)>,
    /// Time, feed in force over the programmed one.
    feeds: VecDeque<(TimeNs, f64)>,
    pct: Option<f64>,
}

/// Feeds that are this near to each other are the same, percent of the programmed feed: half a step of a dial of whole percents.
const FEED_STEP_PCT: f64 = 0.5;

/// A share with the feed that it was measured at.
#[derive(Debug, Clone, Copy)]
pub(super) struct FedShare {
    pub(super) at_ns: TimeNs,
    /// Since the sample before, s.
    pub(super) step_s: f64,
    /// Load over what it should be, as it is.
    pub(super) share: f64,
    /// Feed over the one that `share` is reckoned at.
    pub(super) feed: f64,
    /// Feed that the axes have, percent of the programmed feed.
    pub(super) actual_pct: f64,
    /// Power of the feed with which the load grows.
    pub(super) exponent: f64,
}

impl OverrideFollower {
    /// The cut is over.
    pub(super) fn reset_cut(&mut self) {
        (self.smooth, self.pct) = (None, None);
        self.shares.clear();
        self.feeds.clear();
    }

    /// What is asked for, %.
    pub(super) fn requested_pct(&self) -> f64 {
        self.pct.unwrap_or(100.0)
    }

    /// Nothing that would raise the feed is known: what is asked for may stay below the programmed feed, not above it.
    pub(super) fn let_go(&mut self) -> f64 {
        self.shares.clear();
        let pct = self.requested_pct().min(100.0);
        self.pct = Some(pct);
        pct
    }

    /// Takes a moment of the cut; `wanted` gives the override for a share at the programmed feed. Gives what is asked for, %.
    pub(super) fn step_override(&mut self, now: FedShare, range: &OverrideRange, wanted: impl Fn(f64) -> f64) -> f64 {
        push(&mut self.feeds, (now.at_ns, now.feed), LAG_NS);
        let greatest = self.feeds.iter().map(|(_, feed)| *feed).fold(now.feed, f64::max).max(1e-3);
        let share = now.share / now.feed.max(1e-3).powf(now.exponent);
        let smooth = self.smooth.unwrap_or(share);
        let smooth = smooth + now.step_s / (now.step_s + SMOOTH_S) * (share - smooth);
        self.smooth = Some(smooth);
        push(&mut self.shares, (now.at_ns, smooth), span_ns(range.steady_s));
        let Some(sure) = self.find_sustained_share(range) else { return self.requested_pct() };
        let least = sure.min(smooth) * (now.feed.max(1e-3) / greatest).powf(now.exponent);
        let pct = self.requested_pct();
        let target = |share: f64| wanted(share).clamp(range.min_pct, range.max_pct.max(range.min_pct));
        let pct = self
            .compute_lower_override(pct, least, range, &target)
            // Axes that already go slower than what would be asked for (a block ends, a corner, the dial) are not slowed down.
            .filter(|lower| *lower <= now.actual_pct + FEED_STEP_PCT)
            .or_else(|| self.compute_raised_override(pct, range, &target))
            .unwrap_or(pct);
        self.pct = Some(pct);
        pct
    }

    /// The least share of the time for which an excess has to stand; `None` before that time is over.
    fn find_sustained_share(&self, range: &OverrideRange) -> Option<f64> {
        let (first_ns, newest_ns) = (self.shares.front()?.0, self.shares.back()?.0);
        let span_ns = span_ns(range.sure_s.min(range.steady_s));
        let within = self.shares.iter().rev().take_while(|(at_ns, _)| newest_ns - at_ns <= span_ns);
        let least = within.map(|(_, share)| *share).fold(f64::INFINITY, f64::min);
        (newest_ns - first_ns >= span_ns - span_ns / 20).then_some(least)
    }

    fn compute_lower_override(
        &self,
        pct: f64,
        least: f64,
        range: &OverrideRange,
        target: &impl Fn(f64) -> f64,
    ) -> Option<f64> {
        let now = target(least);
        let to_the_end = now <= range.min_pct && pct > range.min_pct;
        if to_the_end || now < pct - CLEAR * range.dead_band_pct.max(1.0) {
            return Some(now);
        }
        let newest_ns = self.shares.back()?.0;
        let soon = self.shares.iter().filter(|(at_ns, _)| newest_ns - at_ns <= SOON_NS).map(|(_, share)| *share);
        let whole = self.shares.front().is_some_and(|(at_ns, _)| newest_ns - at_ns >= SOON_NS);
        let least_of = target(mean(soon)?.min(least));
        (whole && least_of < pct - range.dead_band_pct).then_some(least_of)
    }

    fn compute_raised_override(
        &mut self,
        pct: f64,
        range: &OverrideRange,
        target: &impl Fn(f64) -> f64,
    ) -> Option<f64> {
        // Whoever is at the top has nothing to find out.
        if pct >= range.max_pct || target(self.smooth?) <= pct {
            return None;
        }
        let up = target(self.find_steady_load(span_ns(range.steady_s))?);
        let worth = up > pct + range.dead_band_pct || (up > pct && (up >= range.max_pct || up == 100.0));
        if !worth {
            return None;
        }
        // What comes of it has to be steady again.
        self.shares.clear();
        Some(up)
    }

    /// The load of a steady stretch: the greater one of the means of its halves.
    fn find_steady_load(&self, span_ns: i64) -> Option<f64> {
        let (first_ns, newest_ns) = (self.shares.front()?.0, self.shares.back()?.0);
        // A tick may come a little early.
        if newest_ns - first_ns < span_ns - span_ns / 20 {
            return None;
        }
        let half = self.shares.len() / 2;
        let of = |from: usize, to: usize| mean(self.shares.range(from..to).map(|(_, share)| *share));
        let (older, newer) = (of(0, half)?, of(half, self.shares.len())?);
        let last = of(self.shares.len().saturating_sub(2), self.shares.len())?;
        let whole = 0.5 * (older + newer);
        let (least, most) = self.shares.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), (_, share)| {
            (least.min(*share), most.max(*share))
        });
        let steady = (older - newer).abs() <= HALVES_SHARE * whole
            && most - least <= RANGE_SHARE * whole
            && last >= whole * (1.0 - HALVES_SHARE);
        steady.then(|| older.max(newer))
    }
}

#[expect(clippy::cast_possible_truncation, reason = "some seconds in nanoseconds")]
fn span_ns(span_s: f64) -> i64 {
    (span_s * SECOND_NS as f64) as i64
}

/// Keeps one sample beyond the span, so that a whole span is seen as one.
fn push(samples: &mut VecDeque<(TimeNs, f64)>, sample: (TimeNs, f64), span_ns: i64) {
    if samples.back().is_some_and(|(at_ns, _)| sample.0 - at_ns < span_ns / SAMPLES_MAX) {
        return;
    }
    samples.push_back(sample);
    while samples.get(1).is_some_and(|(at_ns, _)| sample.0 - at_ns >= span_ns) {
        samples.pop_front();
    }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    (count > 0.0).then(|| sum / count)
}
