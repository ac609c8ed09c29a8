//! Noise: a white share and a share with a memory (AR(1)), whose innovations form is ARMA(1,1) within blocks.
//!
//! The memory is bounded by a quarter of the median block and by two minutes, so that no noise can stand for a level:
//! levels belong to laws, or to the random level that every run may have (`gram.rs`).

use numerics::statistics::count_to_f64;
use std::ops::Range;

/// Shares of the variance that have a memory.
const SHARES: [f64; 5] = [0.15, 0.4, 0.7, 0.95, 1.0];
/// Correlation times, in samples.
const MEMORIES: [f64; 8] = [1.5, 4.0, 10.0, 25.0, 60.0, 150.0, 400.0, 1200.0];
/// Longest memory, s, where samples come faster than one a second; in samples where they do not.
const MEMORY_MAX: f64 = 120.0;

/// One setting of the noise, of unit variance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct NoiseModel {
    /// Share of the variance that has a memory.
    pub(super) share: f64,
    /// Correlation of the share with a memory from one row to the next.
    pub(super) phi: f64,
    theta: f64,
    /// Variance of an innovation.
    variance: f64,
}

impl NoiseModel {
    pub(super) const WHITE: Self = Self { share: 0.0, phi: 0.0, theta: 0.0, variance: 1.0 };

    /// The innovations form of this share with this correlation from row to row.
    pub(super) fn from_share_and_phi(share: f64, phi: f64) -> Self {
        if share <= 0.0 || phi <= 0.0 {
            return Self::WHITE;
        }
        // Autocovariances of x[t] - phi x[t-1], which is a moving average of the first order.
        let at_0 = share * (1.0 - phi * phi) + (1.0 - share) * (1.0 + phi * phi);
        let at_1 = -phi * (1.0 - share);
        if at_1.abs() < 1e-12 {
            return Self { share, phi, theta: 0.0, variance: at_0 };
        }
        let ratio = at_1 / at_0;
        let theta = (1.0 - (1.0 - 4.0 * ratio * ratio).max(0.0).sqrt()) / (2.0 * ratio);
        Self { share, phi, theta, variance: at_1 / theta }
    }

    /// How many samples it remembers: the correlation time of the share with a memory.
    pub(super) fn correlation_rows(&self) -> f64 {
        if self.phi > 0.0 { -1.0 / self.phi.ln() } else { 0.0 }
    }

    /// By how much its memory makes the variance of a mean larger than that of as many independent rows.
    pub(super) fn variance_inflation(&self) -> f64 {
        1.0 + 2.0 * self.share * self.phi / (1.0 - self.phi).max(1e-6)
    }

    /// Every setting worth trying for blocks of this median length; of endless ones every memory.
    pub(super) fn build_grid(median_block: f64, period_s: f64) -> Vec<Self> {
        let longest = (median_block / 4.0).max(3.0);
        let bound = if longest.is_infinite() {
            f64::INFINITY
        } else if period_s < 1.0 {
            MEMORY_MAX / period_s
        } else {
            MEMORY_MAX
        };
        let memories = MEMORIES.into_iter().filter(|memory| *memory <= longest.min(bound));
        let settings =
            memories.flat_map(|memory| SHARES.map(|share| Self::from_share_and_phi(share, (-1.0 / memory).exp())));
        std::iter::once(Self::WHITE).chain(settings).collect()
    }

    /// Innovations of a column, each of unit variance for noise of unit variance; the first of a block in full.
    pub(super) fn whiten_column(&self, column: &mut [f64], blocks: &[Range<usize>]) {
        if self.phi == 0.0 {
            return;
        }
        let deviation = self.variance.sqrt();
        for block in blocks {
            let rows = &mut column[block.clone()];
            let Some(first) = rows.first().copied() else { continue };
            let (mut before, mut innovation) = (first, first * deviation);
            for x in &mut rows[1..] {
                let here = *x;
                innovation = here - self.phi * before - self.theta * innovation;
                before = here;
                *x = innovation / deviation;
            }
        }
    }

    /// Logarithm of the determinant of the covariance over so many rows in so many blocks.
    pub(super) fn ln_determinant(&self, rows: usize, blocks: usize) -> f64 {
        count_to_f64(rows.saturating_sub(blocks)) * self.variance.ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_innovations_of_an_impulse_follow_the_recursion() {
        let noise = NoiseModel::from_share_and_phi(0.7, 0.8);
        let mut column = vec![0.0, 1.0, 0.0];
        noise.whiten_column(&mut column, std::slice::from_ref(&(0..3)));
        let deviation = noise.variance.sqrt();
        assert!((column[1] - 1.0 / deviation).abs() < 1e-12);
        assert!((column[2] - (-0.8 - noise.theta) / deviation).abs() < 1e-12);
    }

    #[test]
    fn no_memory_is_longer_than_a_quarter_of_a_block() {
        let grid = NoiseModel::build_grid(60.0, 1.0);
        assert!(grid.iter().all(|noise| noise.phi <= (-1.0_f64 / 15.0).exp()));
        assert!(grid.len() > 8);
    }
}
