//! Errors that remember: what a law leaves of a thermal error is a slow process with white gauge noise on top.
//!
//! Neighbouring residuals say nearly the same, so ordinary intervals are far too narrow. Here the covariance of the rows
//! is `V = (1 - w) exp(-|t_i - t_k| / memory) + w I` on true time stamps; a Kalman filter of one state turns every column
//! into innovations that are white under it. `memory` and `w` are not guessed: covariances are averaged over a grid of
//! both, weighted by the restricted likelihood, so that not knowing them widens the intervals.
//!
//! The coefficients themselves are the ordinary ones. Weighted by V they would be sharper if V were all that is left; but
//! what a law leaves of a machine is mostly the machine, and weighting by V then fits how fast things change instead of
//! how much (on a simulated machine of other physics the errors of later days grew from 0.9 to 2.4 um).
//! Source: Harville (1977), J. Am. Stat. Assoc. 72:320 (restricted likelihood); Harvey, Forecasting, Structural Time
//! Series Models and the Kalman Filter, 3.4 (regression by filtering the columns); covariance of ordinary coefficients
//! under V: Greene, Econometric Analysis, 9.2.

use super::course::Course;
use crate::regression::{Column, Intercept, Refusal, Regression, fit_unweighted};

/// Memory and share of white noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ThermalNoise {
    /// Time after which the slow process has forgotten, s; 0 for white noise alone.
    pub(super) memory_s: f64,
    /// Share of the variance that is white.
    pub(super) white: f64,
}

impl ThermalNoise {
    pub(super) const WHITE: Self = Self { memory_s: 0.0, white: 1.0 };
}

/// Steps of the memory, and shares of white noise: a posterior narrower than that needs no averaging.
const MEMORY_STEP: f64 = 1.7;
const MEMORIES_MAX: i32 = 24;
const WHITE_SHARES: [f64; 5] = [0.01, 0.1, 0.3, 0.6, 0.85];

/// Every noise that is weighed for these rows: from the spacing of the rows to the length of the longest run.
pub(super) fn list_noise_candidates(course: &Course) -> Vec<ThermalNoise> {
    let (shortest, longest) = (course.period_s(), course.longest_s());
    let memories = (0..MEMORIES_MAX).map(|step| shortest * MEMORY_STEP.powi(step));
    let memories = memories.take_while(|memory_s| *memory_s <= longest);
    let slow = memories.flat_map(|memory_s| WHITE_SHARES.map(|white| ThermalNoise { memory_s, white }));
    std::iter::once(ThermalNoise::WHITE).chain(slow).collect()
}

/// The filter for one noise and one course of times.
pub(super) struct Whitener {
    decay: Vec<f64>,
    gain: Vec<f64>,
    deviation: Vec<f64>,
    /// Logarithm of the determinant of V.
    pub(super) log_determinant: f64,
}

impl Whitener {
    pub(super) fn new(course: &Course, noise: ThermalNoise) -> Self {
        let rows = course.rows();
        let mut filter = Self {
            decay: Vec::with_capacity(rows),
            gain: Vec::with_capacity(rows),
            deviation: Vec::with_capacity(rows),
            log_determinant: 0.0,
        };
        let slow = 1.0 - noise.white;
        let mut variance = slow;
        for row in 0..rows {
            let decay =
                course.since_s(row).map_or(0.0, |dt_s| if slow > 0.0 { (-dt_s / noise.memory_s).exp() } else { 0.0 });
            variance = decay * decay * variance + (1.0 - decay * decay) * slow;
            let innovation = variance + noise.white;
            filter.decay.push(decay);
            filter.gain.push(variance / innovation);
            filter.deviation.push(innovation.sqrt());
            filter.log_determinant += innovation.ln();
            variance -= variance * variance / innovation;
        }
        filter
    }

    pub(super) fn whiten_column(&self, column: &[f64]) -> Vec<f64> {
        let mut state = 0.0;
        let rows = column.iter().zip(&self.decay).zip(self.gain.iter().zip(&self.deviation));
        rows.map(|((value, decay), (gain, deviation))| {
            let expected = decay * state;
            let surprise = value - expected;
            state = expected + gain * surprise;
            surprise / deviation
        })
        .collect()
    }
}

/// One regression under one noise.
pub(super) struct Weighed {
    pub(super) noise: ThermalNoise,
    pub(super) regression: Regression,
    /// Restricted log likelihood; that of the mean is left out where designs are compared.
    pub(super) restricted: f64,
    /// Log likelihood at the best scale.
    pub(super) likelihood: f64,
    /// Rows that would tell as much about a level if they were independent.
    pub(super) effective_rows: f64,
}

/// Regresses y on the columns (the constant is one of them) under one noise.
pub(super) fn fit_under_noise(
    course: &Course,
    columns: &[Column],
    y: &[f64],
    noise: ThermalNoise,
) -> Result<Weighed, Refusal> {
    let filter = Whitener::new(course, noise);
    let white: Vec<Column> =
        columns.iter().map(|c| Column::new(c.name.as_str(), filter.whiten_column(&c.values))).collect();
    let target = Column::new(super::quantities::THERMAL_ERROR, filter.whiten_column(y));
    let regression = fit_unweighted(&target, &white, Intercept::None)?;
    let rows = course.rows() as f64;
    let free = regression.degrees_of_freedom;
    let scale = |divisor: f64| (regression.rss / divisor).max(f64::MIN_POSITIVE).ln();
    let ones = filter.whiten_column(&vec![1.0; course.rows()]);
    Ok(Weighed {
        noise,
        restricted: -0.5 * (free * scale(free) + filter.log_determinant - log_determinant(&regression.inverse)),
        likelihood: -0.5 * (rows * scale(rows) + filter.log_determinant),
        effective_rows: ones.iter().map(|x| x * x).sum(),
        regression,
    })
}

/// Logarithm of the determinant of a positive definite matrix, by Cholesky; its rows are scaled first.
fn log_determinant(matrix: &[Vec<f64>]) -> f64 {
    let size = matrix.len();
    let scale: Vec<f64> = (0..size).map(|i| matrix[i][i].max(f64::MIN_POSITIVE).sqrt()).collect();
    let mut lower = vec![vec![0.0; size]; size];
    let mut sum = 0.0;
    for i in 0..size {
        for j in 0..=i {
            let rest: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
            let left = matrix[i][j] / (scale[i] * scale[j]) - rest;
            lower[i][j] = if i == j { left.max(1e-300).sqrt() } else { left / lower[j][j] };
        }
        sum += 2.0 * (lower[i][i] * scale[i]).ln();
    }
    sum
}

/// Ordinary coefficients with a covariance that is averaged over what the noise may be.
pub(super) struct Averaged {
    pub(super) values: Vec<f64>,
    pub(super) covariance: Vec<Vec<f64>>,
    pub(super) degrees_of_freedom: f64,
    pub(super) memory_s: f64,
    pub(super) white: f64,
    pub(super) effective_rows: f64,
    /// The best log likelihood of all noises.
    pub(super) likelihood: f64,
}

/// Ordinary coefficients, and their covariance `(X'X)^-1 X'VX (X'X)^-1` averaged over all noises by restricted likelihood.
///
/// # Errors
/// As the regression.
pub(super) fn average_over_noises(course: &Course, columns: &[Column], y: &[f64]) -> Result<Averaged, Refusal> {
    let ordinary =
        fit_unweighted(&Column::new(super::quantities::THERMAL_ERROR, y.to_vec()), columns, Intercept::None)?;
    let all = list_noise_candidates(course).into_iter().map(|noise| fit_under_noise(course, columns, y, noise));
    let all = all.collect::<Result<Vec<Weighed>, Refusal>>()?;
    let best = all.iter().map(|it| it.restricted).fold(f64::MIN, f64::max);
    let weights: Vec<f64> = all.iter().map(|it| (it.restricted - best).exp()).collect();
    let total: f64 = weights.iter().sum();
    let mean = |of: &dyn Fn(&Weighed) -> f64| all.iter().zip(&weights).map(|(it, w)| w * of(it)).sum::<f64>() / total;
    let size = columns.len();
    let mut middle = vec![vec![0.0; size]; size];
    for (it, weight) in all.iter().zip(&weights).filter(|(_, weight)| **weight > NEGLIGIBLE) {
        let scale = it.regression.residual_sd.powi(2) * weight / total;
        add_spread(&mut middle, course, columns, it.noise, scale);
    }
    Ok(Averaged {
        values: ordinary.values(),
        covariance: sandwich_product(&ordinary.inverse, &middle),
        degrees_of_freedom: ordinary.degrees_of_freedom,
        memory_s: mean(&|it| it.noise.memory_s),
        white: mean(&|it| it.noise.white),
        effective_rows: mean(&|it| it.effective_rows),
        likelihood: all.iter().map(|it| it.likelihood).fold(f64::MIN, f64::max),
    })
}

/// Noises of less weight than this change nothing.
const NEGLIGIBLE: f64 = 1e-6;

/// Adds `scale X'VX` to `middle`, X the columns and V the covariance of the noise.
fn add_spread(middle: &mut [Vec<f64>], course: &Course, columns: &[Column], noise: ThermalNoise, scale: f64) {
    for (j, column) in columns.iter().enumerate() {
        let spread = apply_covariance(course, &column.values, noise);
        for (i, other) in columns.iter().enumerate() {
            middle[i][j] += scale * other.values.iter().zip(&spread).map(|(x, v)| x * v).sum::<f64>();
        }
    }
}

/// `V x`, by one pass forwards and one backwards.
fn apply_covariance(course: &Course, x: &[f64], noise: ThermalNoise) -> Vec<f64> {
    let slow = 1.0 - noise.white;
    let decay = |row: usize| course.since_s(row).filter(|_| slow > 0.0).map_or(0.0, |s| (-s / noise.memory_s).exp());
    let mut sum: Vec<f64> = x.iter().map(|x| noise.white * x).collect();
    let mut before = 0.0;
    for row in 0..x.len() {
        before = decay(row) * before + slow * x[row];
        sum[row] += before;
    }
    let mut after = 0.0;
    for row in (0..x.len().saturating_sub(1)).rev() {
        after = decay(row + 1) * (after + slow * x[row + 1]);
        sum[row] += after;
    }
    sum
}

/// `A M A` of symmetric matrices.
fn sandwich_product(outer: &[Vec<f64>], middle: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let times = |a: &[Vec<f64>], b: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let entry = |i: usize, j: usize| (0..a.len()).map(|k| a[i][k] * b[k][j]).sum();
        (0..a.len()).map(|i| (0..a.len()).map(|j| entry(i, j)).collect()).collect()
    };
    times(&times(outer, middle), outer)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn course(rows: usize) -> Course {
        let clock_s: Vec<f64> = (0..rows).map(|row| 60.0 * row as f64 + if row > 10 { 300.0 } else { 0.0 }).collect();
        Course::new(clock_s, std::iter::once(0..rows).collect(), true, vec![0.0; rows], Vec::new())
    }

    #[test]
    fn the_filter_is_the_inverse_root_of_the_covariance() {
        // x' V^-1 x by the filter against the dense matrix, and the determinant.
        let course = course(25);
        let noise = ThermalNoise { memory_s: 240.0, white: 0.2 };
        let filter = Whitener::new(&course, noise);
        let entry = |i: usize, k: usize| {
            let dt = (course.clock_s()[i] - course.clock_s()[k]).abs();
            0.8 * (-dt / 240.0_f64).exp() + if i == k { 0.2 } else { 0.0 }
        };
        let v: Vec<Vec<f64>> = (0..25).map(|i| (0..25).map(|k| entry(i, k)).collect()).collect();
        assert!((log_determinant(&v) - filter.log_determinant).abs() < 1e-9);
        // Whitening the columns of V and taking products gives V back: W V W' = I means W V = W'^-1.
        let whitened: Vec<Vec<f64>> = v.iter().map(|column| filter.whiten_column(column)).collect();
        for i in 0..25 {
            for k in 0..25 {
                let product: f64 = whitened[i].iter().zip(&whitened[k]).map(|(a, b)| a * b).sum();
                assert!((product - v[i][k]).abs() < 1e-9, "{i} {k}: {product} {}", v[i][k]);
            }
        }
    }

    #[test]
    fn the_spread_is_the_covariance_times_the_column() {
        let course = course(25);
        let noise = ThermalNoise { memory_s: 240.0, white: 0.2 };
        let x: Vec<f64> = (0..25).map(|row| f64::from(row % 7)).collect();
        for (i, got) in apply_covariance(&course, &x, noise).into_iter().enumerate() {
            let dt = |k: usize| (course.clock_s()[i] - course.clock_s()[k]).abs();
            let dense: f64 = (0..25).map(|k| 0.8 * (-dt(k) / 240.0_f64).exp() * x[k]).sum::<f64>() + 0.2 * x[i];
            assert!((got - dense).abs() < 1e-9, "{i}: {got} {dense}");
        }
    }

    #[test]
    fn white_noise_changes_nothing() {
        let course = course(12);
        let column: Vec<f64> = (0..12).map(f64::from).collect();
        assert_eq!(Whitener::new(&course, ThermalNoise::WHITE).whiten_column(&column), column);
    }
}
