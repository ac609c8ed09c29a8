//! Hidden states of rows that took no part in a fit: how worn this edge is, how hard this lot.
//!
//! A column that never acts in the fitted rows has no coefficient; all that is known is how large its prior lets it be. In
//! rows that are predicted it is learned from the earlier ones alone, by recursive least squares on innovations (Kalman
//! filter of a constant state), so that a state may be followed and nothing comes from later.

use ndarray::{Array1, Array2};

/// Deviations of an innovation beyond which it teaches no more.
const FARTHEST: f64 = 4.5;

/// Coefficients that are learned row by row; variances are told in those of an innovation.
pub(super) struct Follower {
    mean: Array1<f64>,
    covariance: Array2<f64>,
}

impl Follower {
    /// Nothing learned yet, with these prior variances.
    pub(super) fn new(variances: &[f64]) -> Self {
        let size = variances.len();
        let mut covariance = Array2::zeros((size, size));
        variances.iter().enumerate().for_each(|(at, variance)| covariance[[at, at]] = *variance);
        Self { mean: Array1::zeros(size), covariance }
    }

    /// The coefficients as learned from the rows so far.
    pub(super) fn coefficients(&self) -> &Array1<f64> {
        &self.mean
    }

    /// What the columns of a row add, as learned so far.
    pub(super) fn predict_row(&self, columns: &Array1<f64>) -> f64 {
        self.mean.dot(columns)
    }

    /// Learns from a row: its whitened columns, and what everything else leaves of it, in deviations of an innovation.
    pub(super) fn update_with_row(&mut self, columns: &Array1<f64>, left: f64) {
        let along = self.covariance.dot(columns);
        let variance = 1.0 + along.dot(columns);
        let limit = FARTHEST * variance.sqrt();
        let surprise = (left - self.predict_row(columns)).clamp(-limit, limit);
        self.mean.scaled_add(surprise / variance, &along);
        for i in 0..along.len() {
            for j in 0..along.len() {
                self.covariance[[i, j]] -= along[i] * along[j] / variance;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_is_learned_from_earlier_rows_only() {
        let mut follower = Follower::new(&[4.0]);
        let column = Array1::from(vec![1.0]);
        assert_eq!(follower.predict_row(&column), 0.0, "nothing is known before the first row");
        (0..100).for_each(|_| follower.update_with_row(&column, 2.0));
        assert!((follower.predict_row(&column) - 2.0 * 400.0 / 401.0).abs() < 1e-9);
    }
}
