//! What one place of a program took in the first parts: a straight line of the cutting power over the path that has been cut there,
//! the spread about it, and the peak. Facing at one speed takes three times as much at the rim as at the centre, so that a mean
//! would call every rim too heavy.

use super::part_at_place::PartAtPlace;
use serde::{Deserialize, Serialize};

/// Moments within this time share their noise, because the power is filtered, s.
const ALIKE_S: f64 = 0.5;
/// Half of the band is no less than this share: meters do not tell less.
const BAND_SHARE: f64 = 0.05;
/// The line does not go on beyond so many standard deviations of the path that was learned.
const PATH_SD: f64 = 1.8;
/// The line never falls below this share of its mean.
const LEAST_SHARE: f64 = 0.1;
/// A place that was seen for a shorter time is not known, s.
const KNOWN_S: f64 = 2.0;

/// Sums over the time that was learned from; squares and products are about the means.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Place {
    /// Part in which it was first seen.
    pub(super) first_part: f64,
    /// When it was last in use: a number that grows with every change of place.
    pub(super) used: u64,
    /// Seconds that were learned from.
    seconds: f64,
    path_mm: f64,
    power_w: f64,
    path_square: f64,
    both: f64,
    power_square: f64,
    pub(super) peak_w: f64,
    /// Mean override that was in force, as a share of the programmed feed.
    feed: f64,
    /// What parts do there besides taking power.
    #[serde(default)]
    pub(super) parts: PartAtPlace,
}

/// What a place should take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Expected {
    pub(super) power_w: f64,
    /// Half of the band in which a moment of an unchanged part lies: two standard deviations.
    pub(super) band_w: f64,
}

impl Place {
    pub(super) fn new(first_part: f64, used: u64) -> Self {
        Self {
            first_part,
            used,
            seconds: 0.0,
            path_mm: 0.0,
            power_w: 0.0,
            path_square: 0.0,
            both: 0.0,
            power_square: 0.0,
            peak_w: 0.0,
            feed: 0.0,
            parts: PartAtPlace::default(),
        }
    }

    /// The mean power of the place, W, at the feed that it was learned at.
    pub(super) fn mean_power_w(&self) -> f64 {
        self.power_w
    }

    /// Was it seen for long enough?
    pub(super) fn is_known(&self) -> bool {
        self.seconds >= KNOWN_S && self.power_w > 0.0
    }

    /// Is it known, and are the parts over from which it is learned?
    pub(super) fn is_learned(&self, part: f64, parts: f64) -> bool {
        part - self.first_part >= parts && self.is_known()
    }

    /// One more moment, weighted by its time; `feed` is the override in force, as a share.
    pub(super) fn learn_moment(&mut self, path_mm: f64, power_w: f64, feed: f64, step_s: f64) {
        let (off_path, off_power) = (path_mm - self.path_mm, power_w - self.power_w);
        self.seconds += step_s;
        let share = step_s / self.seconds;
        self.path_mm += off_path * share;
        self.power_w += off_power * share;
        self.feed += (feed - self.feed) * share;
        self.path_square += off_path * (path_mm - self.path_mm) * step_s;
        self.both += off_path * (power_w - self.power_w) * step_s;
        self.power_square += off_power * (power_w - self.power_w) * step_s;
        self.peak_w = self.peak_w.max(power_w);
    }

    /// What it takes at this path, at the feed that it was learned at.
    pub(super) fn predict_power(&self, path_mm: f64) -> Expected {
        let (mut slope, mut off, mut left, mut doubt) = (0.0, 0.0, self.power_square, ALIKE_S / self.seconds);
        if self.path_square > 0.0 {
            let half = PATH_SD * (self.path_square / self.seconds).sqrt();
            slope = self.both / self.path_square;
            off = (path_mm - self.path_mm).clamp(-half, half);
            left = (left - slope * self.both).max(0.0);
            doubt += ALIKE_S * off * off / self.path_square;
        }
        let power_w = (self.power_w + slope * off).max(LEAST_SHARE * self.power_w);
        let band_w = (2.0 * (left / self.seconds * (1.0 + doubt)).sqrt()).max(BAND_SHARE * power_w);
        Expected { power_w, band_w }
    }

    /// This override, as a share of the one that it was learned at.
    pub(super) fn to_relative_feed(&self, feed: f64) -> f64 {
        feed.max(1e-3) / self.feed.max(1e-3)
    }

    /// The override that it was learned at, %.
    pub(super) fn feed_pct(&self) -> f64 {
        100.0 * self.feed
    }
}
