//! The noise: ARMA(1,1) within runs, the sum of a slow process and a white meter.
//!
//! `x_t = phi x_{t-1} + e_t + theta e_{t-1}`; the innovations `e` are white when `phi` and `theta` are right. The first
//! row of a stretch is weighted by the stationary variance. Every hypothesis profiles its own `phi` and `theta`.

use numerics::linear::columns::dot;
use numerics::statistics::count_to_f64;
use std::ops::Range;

/// Parameters of the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arma {
    /// Memory of the slow process, 0 to below 1.
    pub phi: f64,
    /// Moving average term; negative when white noise lies on top of the slow process.
    pub theta: f64,
}

impl Arma {
    /// Noise without memory: every row counts as one.
    pub const WHITE: Self = Self { phi: 0.0, theta: 0.0 };

    /// The nearest noise that is a slow process with white noise on top. What is smoother than a slow process is no noise
    /// but what a model lacks, and in such noise a fit would forget every level.
    #[must_use]
    pub fn from_clamped(phi: f64, theta: f64) -> Self {
        let phi = phi.clamp(0.0, PHI_MAX);
        Self { phi, theta: theta.clamp(-phi, 0.0) }
    }

    /// Standard deviation of an innovation over that of the process: the weight of a first row.
    #[must_use]
    pub fn first_weight(self) -> f64 {
        ((1.0 - self.phi * self.phi) / (1.0 + 2.0 * self.phi * self.theta + self.theta * self.theta)).sqrt()
    }

    /// The innovation of a row with value `x` after a row with value `last_x` and innovation `last_e`.
    #[must_use]
    pub fn compute_innovation(self, x: f64, last_x: f64, last_e: f64) -> f64 {
        x - self.phi * last_x - self.theta * last_e
    }

    /// Long-run variance over variance of a row: how many rows count as one.
    #[must_use]
    pub fn variance_inflation(self) -> f64 {
        let gain = (1.0 + self.theta) / (1.0 - self.phi);
        (gain * gain * self.first_weight() * self.first_weight()).max(1.0)
    }
}

/// Greatest memory: beyond it the noise would explain anything that changes slowly.
pub const PHI_MAX: f64 = 0.985;

/// The grid on which hypotheses are compared.
pub const GRID: [Arma; 16] = [
    new_arma(0.0, 0.0),
    new_arma(0.3, 0.0),
    new_arma(0.5, 0.0),
    new_arma(0.7, 0.0),
    new_arma(0.7, -0.4),
    new_arma(0.85, 0.0),
    new_arma(0.85, -0.35),
    new_arma(0.85, -0.6),
    new_arma(0.93, -0.2),
    new_arma(0.93, -0.5),
    new_arma(0.93, -0.75),
    new_arma(0.97, -0.3),
    new_arma(0.97, -0.65),
    new_arma(0.97, -0.85),
    new_arma(0.985, -0.75),
    new_arma(0.985, -0.93),
];

const fn new_arma(phi: f64, theta: f64) -> Arma {
    Arma { phi, theta }
}

/// Innovations of `column` within each stretch.
#[must_use]
pub fn whiten_column(column: &[f64], stretches: &[Range<usize>], noise: Arma) -> Vec<f64> {
    let mut out = vec![0.0; column.len()];
    let first = noise.first_weight();
    for rows in stretches {
        let (mut last_x, mut last_e) = (0.0, 0.0);
        for row in rows.clone() {
            let x = column[row];
            let e = if row == rows.start { x * first } else { noise.compute_innovation(x, last_x, last_e) };
            out[row] = e;
            last_x = x;
            // The stationary start carries its full size into the recursion only through x.
            last_e = if row == rows.start { 0.0 } else { e };
        }
    }
    out
}

/// Logarithm of the likelihood, up to a constant, of innovations with this sum of squares.
#[must_use]
pub fn compute_ln_likelihood(rss: f64, rows: usize, stretches: usize, noise: Arma) -> f64 {
    let rows_f = count_to_f64(rows);
    -0.5 * rows_f * (rss / rows_f).max(f64::MIN_POSITIVE).ln() + count_to_f64(stretches) * noise.first_weight().ln()
}

/// The noise of residuals by maximum likelihood: best of the grid, then refined by a pattern search.
#[must_use]
pub fn fit_arma(residual: &[f64], stretches: &[Range<usize>]) -> Arma {
    let score = |noise: Arma| {
        let e = whiten_column(residual, stretches, noise);
        compute_ln_likelihood(dot(&e, &e), residual.len(), stretches.len(), noise)
    };
    let mut best = (f64::NEG_INFINITY, Arma::WHITE);
    for noise in GRID {
        let score = score(noise);
        if score > best.0 {
            best = (score, noise);
        }
    }
    refine_arma(best, score).1
}

/// Pattern search with shrinking steps around a start.
fn refine_arma(mut best: (f64, Arma), score: impl Fn(Arma) -> f64) -> (f64, Arma) {
    let mut step = 0.1;
    while step > 0.01 {
        let Arma { phi, theta } = best.1;
        // Memory close to one needs steps in proportion to what is left.
        let d_phi = step * (1.0 - phi).max(0.02);
        let tries = [(phi + d_phi, theta), (phi - d_phi, theta), (phi, theta + step), (phi, theta - step)];
        let mut moved = false;
        for (phi, theta) in tries {
            let noise = Arma::from_clamped(phi, theta);
            let got = score(noise);
            if got > best.0 + 1e-9 {
                best = (got, noise);
                moved = true;
            }
        }
        if !moved {
            step *= 0.5;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const ALL: [Range<usize>; 1] = [Range { start: 0, end: 4000 }];

    #[test]
    fn slow_plus_white_noise_is_recognised() {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(7);
        let mut slow = 0.0;
        let noise: Vec<f64> = (0..4000)
            .map(|_| {
                let (a, b): (f64, f64) = (StandardNormal.sample(&mut rng), StandardNormal.sample(&mut rng));
                slow = 0.95 * slow + 0.3 * a;
                slow + b
            })
            .collect();
        let got = fit_arma(&noise, &ALL);
        assert!(got.phi > 0.88 && got.phi < 0.99 && got.theta < -0.4, "{got:?}");
    }

    #[test]
    fn white_noise_is_recognised() {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(8);
        let noise: Vec<f64> = (0..4000).map(|_| StandardNormal.sample(&mut rng)).collect();
        let e = whiten_column(&noise, &ALL, fit_arma(&noise, &ALL));
        assert!((dot(&e, &e) / dot(&noise, &noise) - 1.0).abs() < 0.02);
    }
}
