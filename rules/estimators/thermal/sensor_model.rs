//! What a temperature should be, from the others.
//!
//! The file of a law holds the covariance of its coefficients, which is the inverse of the sums of squares and products of the rows that
//! it was identified from. Scaled by its first entry that inverse gives the means of the temperatures and how they go together. So the
//! file says what a sensor should read where the others read this (the best linear prediction), and the law with that in the place
//! of the sensor is the law that least squares would have found without the sensor (formula of the omitted variable).

use super::law::ThermalLaw;
use crate::estimate::Estimate;

/// Variance of a reading by itself, K^2: sensors that went together exactly still do not tell each other better than this.
const READING_VARIANCE: f64 = 0.01;

/// Means of the temperatures during identification, and how they went together.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorModel {
    mean_c: Vec<f64>,
    /// K^2, row by row.
    covariance: Vec<Vec<f64>>,
    slope_um_per_k: Vec<f64>,
}

impl SensorModel {
    /// From a law as it was identified, for sensors in this order, each named once. `None` where the covariance of the law is not that
    /// of a regression on temperatures within the ranges that the law states, or where a sensor is none of its.
    #[must_use]
    pub fn from_law(law: &ThermalLaw, sensors: &[&str]) -> Option<Self> {
        let columns = invert_matrix(&law.covariance)?;
        let scale = columns.first()?.first().copied().filter(|scale| *scale > 0.0)?;
        let first_term = |sensor: &&str| law.terms.iter().position(|term| term.sensor == **sensor);
        let terms: Vec<usize> = sensors.iter().map(first_term).collect::<Option<_>>()?;
        let mean_c: Vec<f64> = terms.iter().map(|term| columns[0][term + 1] / scale).collect();
        let product = |a: usize, b: usize| columns[terms[a] + 1][terms[b] + 1] / scale - mean_c[a] * mean_c[b];
        let all = 0..terms.len();
        let covariance: Vec<Vec<f64>> = all.clone().map(|a| all.clone().map(|b| product(a, b)).collect()).collect();
        let possible = |at: usize| {
            let (least, greatest) = law.terms[terms[at]].range_c;
            let variance = covariance[at][at];
            (least..=greatest).contains(&mean_c[at]) && variance > 0.0 && variance.sqrt() <= greatest - least
        };
        if !all.clone().all(possible) {
            return None;
        }
        let of_sensor = |name: &&str| law.terms.iter().filter(|it| it.sensor == **name).map(|it| it.um_per_k).sum();
        let slope_um_per_k = sensors.iter().map(of_sensor).collect();
        Some(Self { mean_c, covariance, slope_um_per_k })
    }

    /// What the law makes of a kelvin of this sensor once everything has warmed through, um/K.
    #[must_use]
    pub fn slope_um_per_k(&self, sensor: usize) -> f64 {
        self.slope_um_per_k[sensor]
    }

    /// How far a temperature lies from the mean of the identification, in deviations there.
    #[must_use]
    pub fn distance_sd(&self, sensor: usize, temperature_c: f64) -> f64 {
        (temperature_c - self.mean_c[sensor]).abs() / self.covariance[sensor][sensor].sqrt()
    }

    /// What this sensor should read in °C, from the others that have a value; its own is not looked at. With none of the others it
    /// is the mean of the identification with the deviation that it had there.
    #[must_use]
    pub fn predict_sensor(&self, sensor: usize, temperatures_c: &[Option<f64>]) -> Estimate {
        let others: Vec<(usize, f64)> = temperatures_c
            .iter()
            .enumerate()
            .filter_map(|(at, value)| Some((at, (*value)?)))
            .filter(|(at, _)| *at != sensor)
            .collect();
        let noise = |a: usize, b: usize| if a == b { READING_VARIANCE } else { 0.0 };
        let row = |a: usize| others.iter().map(|(b, _)| self.covariance[a][*b] + noise(a, *b)).collect::<Vec<f64>>();
        let with: Vec<f64> = others.iter().map(|(at, _)| self.covariance[sensor][*at]).collect();
        let weights =
            solve_symmetric(others.iter().map(|(at, _)| row(*at)).collect(), with.clone()).unwrap_or_default();
        let away = others.iter().zip(&weights).map(|((at, value), weight)| weight * (value - self.mean_c[*at]));
        let explained: f64 = weights.iter().zip(&with).map(|(weight, with)| weight * with).sum();
        let variance = (self.covariance[sensor][sensor] - explained).max(0.0) + READING_VARIANCE;
        Estimate { value: self.mean_c[sensor] + away.sum::<f64>(), sd: variance.sqrt() }
    }
}

/// The inverse of a small symmetric matrix; `None` where there is none.
pub(super) fn invert_matrix(matrix: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let unit = |at: usize| (0..matrix.len()).map(|row| if row == at { 1.0 } else { 0.0 }).collect();
    (0..matrix.len()).map(|at| solve_symmetric(matrix.to_vec(), unit(at))).collect()
}

/// Solves a small symmetric system by elimination with pivots; `None` where it is singular.
fn solve_symmetric(mut matrix: Vec<Vec<f64>>, mut right: Vec<f64>) -> Option<Vec<f64>> {
    let size = right.len();
    for column in 0..size {
        let pivot = (column..size).max_by(|a, b| matrix[*a][column].abs().total_cmp(&matrix[*b][column].abs()))?;
        matrix.swap(column, pivot);
        right.swap(column, pivot);
        let head = matrix[column].clone();
        if head[column].abs() < f64::MIN_POSITIVE {
            return None;
        }
        for row in column + 1..size {
            let factor = matrix[row][column] / head[column];
            matrix[row].iter_mut().zip(&head).for_each(|(entry, above)| *entry -= factor * above);
            right[row] -= factor * right[column];
        }
    }
    for row in (0..size).rev() {
        let known: f64 = (row + 1..size).map(|at| matrix[row][at] * right[at]).sum();
        right[row] = (right[row] - known) / matrix[row][row];
    }
    right.iter().all(|value| value.is_finite()).then_some(right)
}
