//! How noisy the spindle power is, relative to its level.
//!
//! Two views, the larger counts: second differences of successive samples (blind to a start-up that decays, but also to
//! noise that a meter's averaging has smeared) and of successive blocks of idle power (slow ripple).

use super::settings::Settings;
use serde::{Deserialize, Serialize};

/// Weight of a new difference once many have been seen.
const SLOW: f64 = 0.02;

/// A single difference counts at most this many standard deviations, so that pulses and steps do not count as noise.
const CLIP_SD: f64 = 3.0;

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct RelativeVariances {
    fast: f64,
    seen: f64,
    slow: f64,
    last: [Option<f64>; 2],
    /// Smallest difference that the measurement can show, W, and the level at which it was last seen.
    #[serde(default)]
    resolution_w: f64,
    #[serde(default)]
    level_w: f64,
}

/// Standard deviation of the rounding to whole steps, in steps: that of an even distribution.
const ROUNDING_SD: f64 = 0.289;

impl RelativeVariances {
    pub(super) fn new(settings: &Settings) -> Self {
        Self {
            fast: settings.power_noise * settings.power_noise,
            seen: 4.0,
            slow: 0.0,
            last: [None; 2],
            resolution_w: 0.0,
            level_w: 0.0,
        }
    }

    /// The measurement shows no smaller difference than this, W; 0 where noise is coarser.
    pub(super) fn set_resolution(&mut self, resolution_w: f64) {
        self.resolution_w = resolution_w;
    }

    pub(super) fn resolution_w(&self) -> f64 {
        self.resolution_w
    }

    /// Takes a power measured at a steady speed.
    pub(super) fn push(&mut self, power_w: f64, level_w: f64) {
        if level_w > 0.0 {
            self.level_w = level_w;
        }
        let [second, third] = self.last;
        self.last = [Some(power_w), second];
        if let (Some(second), Some(third), true) = (second, third, level_w > 0.0) {
            let relative = (power_w - 2.0 * second + third) / level_w;
            let limit = CLIP_SD * CLIP_SD * self.fast;
            self.seen += 1.0;
            let weight = (1.0 / self.seen).max(SLOW);
            self.fast += weight * ((relative * relative / 6.0).min(limit) - self.fast);
        }
    }

    /// The next value has no predecessor.
    pub(super) fn forget_last_values(&mut self) {
        self.last = [None; 2];
    }

    /// Takes three successive blocks of idle power, W. Their second difference is blind to a start-up that still decays.
    pub(super) fn push_blocks(&mut self, blocks_w: [f64; 3], block_length: f64) {
        let [first, second, third] = blocks_w;
        let relative = (first - 2.0 * second + third) / second;
        let limit = CLIP_SD * CLIP_SD * (self.fast / block_length + self.slow);
        self.slow += 0.1 * ((relative * relative / 6.0).min(limit) - self.slow);
    }

    /// Standard deviation of one sample, relative.
    pub(super) fn sd(&self) -> f64 {
        self.fast.max(self.slow).sqrt().max(1e-3).max(self.rounding_sd())
    }

    /// A level that is shown in whole steps does not seem to move at all, and is yet known to a part of a step only.
    fn rounding_sd(&self) -> f64 {
        if self.resolution_w > 0.0 {
            ROUNDING_SD * self.resolution_w / self.level_w.max(self.resolution_w)
        } else {
            0.0
        }
    }

    /// Standard deviation of the level from block to block, relative.
    pub(super) fn level_sd(&self) -> f64 {
        self.slow.sqrt()
    }
}
