//! A wave that wanders in phase and size, as a state: a vector that turns by `2 pi f` per row, shrinks by `rho` and is
//! renewed by noise (Harvey, Forecasting, structural time series models and the Kalman filter, 1989, section 2.3.3),
//! beside ARMA(1,1) noise. The Kalman filter gives the likelihood and foretells the next row; its smoother reads the wave.

use super::linear::dot;
use super::noise::Arma;
use crate::statistics::count;
use std::f64::consts::TAU;
use std::ops::Range;

/// A wandering wave on top of ARMA(1,1) noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wave {
    /// Turns per row.
    pub frequency: f64,
    /// Share of the state that remains from row to row.
    pub rho: f64,
    /// Stationary variance of the wave over the variance of an innovation of the noise.
    pub size: f64,
    /// The noise beside it.
    pub noise: Arma,
}

/// Logarithm of the likelihood, up to a constant, the variance profiled.
#[must_use]
pub fn likelihood(residual: &[f64], stretches: &[Range<usize>], wave: &Wave) -> f64 {
    let (sum, logs) = errors(residual, stretches, wave);
    let rows = count(stretches.iter().map(ExactSizeIterator::len).sum());
    -0.5 * (rows * (sum / rows).max(f64::MIN_POSITIVE).ln() + logs)
}

/// Sum of the squares of what was not expected, over its variance, and of the logarithms of that variance.
fn errors(residual: &[f64], stretches: &[Range<usize>], wave: &Wave) -> (f64, f64) {
    let longest = stretches.iter().map(ExactSizeIterator::len).max().unwrap_or(0);
    let gains = Gains::new(wave, longest);
    let (mut sum, mut logs) = (0.0, 0.0);
    for rows in stretches {
        let mut state = [0.0; 4];
        for (index, x) in residual[rows.clone()].iter().enumerate() {
            let gain = gains.at(index);
            let error = gains.update(&mut state, *x, gain);
            sum += error * error / gain.variance;
            logs += gain.ln_variance;
        }
    }
    (sum, logs)
}

/// Variance of an innovation of the noise.
#[must_use]
pub fn variance(residual: &[f64], stretches: &[Range<usize>], wave: &Wave) -> f64 {
    errors(residual, stretches, wave).0 / count(residual.len())
}

/// The wave expected in each row, from earlier rows of the stretch only.
#[must_use]
pub fn follow(residual: &[f64], wave: &Wave) -> Vec<f64> {
    let gains = Gains::new(wave, residual.len());
    let mut state = [0.0; 4];
    let step = |(index, x): (usize, &f64)| {
        let expected = state[0];
        gains.update(&mut state, *x, gains.at(index));
        expected
    };
    residual.iter().enumerate().map(step).collect()
}

/// The wave given all rows of each stretch (backward recursion of de Jong, Biometrika 76, 1989).
#[must_use]
pub fn smoothed(residual: &[f64], stretches: &[Range<usize>], wave: &Wave) -> Vec<f64> {
    let longest = stretches.iter().map(ExactSizeIterator::len).max().unwrap_or(0);
    let gains = Gains::new(wave, longest);
    let turned_back = transposed(&gains.turn);
    let mut values = vec![0.0; residual.len()];
    for rows in stretches {
        let mut state = [0.0; 4];
        let mut steps = Vec::with_capacity(rows.len());
        for (index, x) in residual[rows.clone()].iter().enumerate() {
            let before = state;
            let error = gains.update(&mut state, *x, gains.at(index));
            steps.push((before, error, gains.at(index)));
        }
        let mut back: Vector = [0.0; 4];
        for (row, (state, error, gain)) in rows.clone().zip(steps).rev() {
            let turned = apply(&turned_back, &back);
            let observed = error / gain.variance - dot(&gain.along, &turned);
            back = turned;
            back[0] += observed;
            back[2] += observed;
            values[row] = state[0] + dot(&gain.covariance, &back);
        }
    }
    values
}

type Vector = [f64; 4];
type Matrix = [[f64; 4]; 4];

/// Change of the variance from row to row below which the filter has settled.
const SETTLED: f64 = 1e-9;

/// Kalman filter over wave (two numbers) and ARMA(1,1) noise (two numbers); what is observed is the sum of the first of
/// each, without further noise. Its gains do not depend on the data: they are computed once, until they settle.
struct Gains {
    turn: Matrix,
    gains: Vec<KalmanGain>,
}

/// The gain of one row.
struct KalmanGain {
    /// How far the state moves per unit of what was not expected.
    along: Vector,
    /// Variance of what was not expected.
    variance: f64,
    /// Its logarithm.
    ln_variance: f64,
    /// Covariance of the wave with the whole state before the row.
    covariance: Vector,
}

impl Gains {
    fn new(wave: &Wave, rows: usize) -> Self {
        let (turn, renewal, mut covariance) = system(wave);
        let back = transposed(&turn);
        let mut gains: Vec<KalmanGain> = Vec::new();
        for _ in 0..rows {
            let sum_along: Vector = std::array::from_fn(|i| covariance[i][0] + covariance[i][2]);
            let variance = (sum_along[0] + sum_along[2]).max(1e-12);
            let along = sum_along.map(|x| x / variance);
            let settled = gains.last().is_some_and(|last| (last.variance - variance).abs() < SETTLED * variance);
            gains.push(KalmanGain { along, variance, ln_variance: variance.ln(), covariance: covariance[0] });
            if settled {
                break;
            }
            let left: Matrix =
                std::array::from_fn(|i| std::array::from_fn(|j| covariance[i][j] - along[i] * sum_along[j]));
            covariance = sum(&product(&product(&turn, &left), &back), &renewal);
        }
        Self { turn, gains }
    }

    fn at(&self, row: usize) -> &KalmanGain {
        &self.gains[row.min(self.gains.len() - 1)]
    }

    /// Takes a row into the state; returns what was not expected.
    fn update(&self, state: &mut Vector, x: f64, gain: &KalmanGain) -> f64 {
        let error = x - state[0] - state[2];
        let moved: Vector = std::array::from_fn(|i| state[i] + gain.along[i] * error);
        *state = apply(&self.turn, &moved);
        error
    }
}

/// Transition, covariance of the renewal and of the start.
fn system(wave: &Wave) -> (Matrix, Matrix, Matrix) {
    let Arma { phi, theta } = wave.noise;
    let (sine, cosine) = (TAU * wave.frequency).sin_cos();
    let mut turn = [[0.0; 4]; 4];
    turn[0] = [wave.rho * cosine, wave.rho * sine, 0.0, 0.0];
    turn[1] = [-wave.rho * sine, wave.rho * cosine, 0.0, 0.0];
    turn[2] = [0.0, 0.0, phi, 1.0];
    let mut renewal = [[0.0; 4]; 4];
    let renewed = wave.size * (1.0 - wave.rho * wave.rho);
    (renewal[0][0], renewal[1][1]) = (renewed, renewed);
    (renewal[2][2], renewal[2][3], renewal[3][2], renewal[3][3]) = (1.0, theta, theta, theta * theta);
    let mut start = renewal;
    (start[0][0], start[1][1]) = (wave.size, wave.size);
    start[2][2] = 1.0 + (phi + theta).powi(2) / (1.0 - phi * phi);
    (turn, renewal, start)
}

fn apply(matrix: &Matrix, vector: &Vector) -> Vector {
    std::array::from_fn(|i| dot(&matrix[i], vector))
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}

fn transposed(a: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

fn sum(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + b[i][j]))
}
