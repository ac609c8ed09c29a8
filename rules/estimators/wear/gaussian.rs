//! A joint normal distribution over numbered states, and what a Kalman filter does to it. States are few (some tens), so the
//! covariance is kept whole.

use serde::{Deserialize, Serialize};

/// Mean and covariance of numbered states.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Gaussian {
    mean: Vec<f64>,
    /// The covariance matrix, row by row.
    covariance: Vec<Vec<f64>>,
}

impl Gaussian {
    /// Is the shape whole and every number finite? A file may have been edited.
    pub(super) fn is_sound(&self) -> bool {
        let count = self.mean.len();
        let shape = self.covariance.len() == count && self.covariance.iter().all(|row| row.len() == count);
        shape && self.mean.iter().chain(self.covariance.iter().flatten()).all(|number| number.is_finite())
    }

    pub(super) fn len(&self) -> usize {
        self.mean.len()
    }

    pub(super) fn mean(&self, at: usize) -> f64 {
        self.mean.get(at).copied().unwrap_or(0.0)
    }

    pub(super) fn covariance(&self, a: usize, b: usize) -> f64 {
        self.covariance.get(a).and_then(|row| row.get(b)).copied().unwrap_or(0.0)
    }

    /// A further state, independent of the others; gives its number.
    pub(super) fn add(&mut self, mean: f64, variance: f64) -> usize {
        let at = self.mean.len();
        self.mean.push(mean);
        self.covariance.iter_mut().for_each(|row| row.push(0.0));
        self.covariance.push(vec![0.0; at + 1]);
        self.covariance[at][at] = variance;
        at
    }

    /// The state becomes another one, of which only this is known. What was known of the others stays.
    pub(super) fn reset_state(&mut self, at: usize, mean: f64, variance: f64) {
        if at >= self.mean.len() {
            return;
        }
        self.mean[at] = mean;
        self.covariance[at].fill(0.0);
        self.covariance.iter_mut().for_each(|row| row[at] = 0.0);
        self.covariance[at][at] = variance;
    }

    /// The state has moved by something of mean 0 and this variance.
    pub(super) fn add_variance(&mut self, at: usize, variance: f64) {
        if let Some(own) = self.covariance.get_mut(at).and_then(|row| row.get_mut(at)) {
            *own += variance;
        }
    }

    /// `to` grows by `factor` times `from`.
    pub(super) fn add_scaled_state(&mut self, to: usize, from: usize, factor: f64) {
        if to.max(from) >= self.mean.len() {
            return;
        }
        self.mean[to] += factor * self.mean[from];
        let of_from = self.covariance[from].clone();
        for (cell, other) in self.covariance[to].iter_mut().zip(&of_from) {
            *cell += factor * other;
        }
        for row in &mut self.covariance {
            row[to] += factor * row[from];
        }
    }

    /// The state becomes `factor` times what it was.
    pub(super) fn scale_state(&mut self, at: usize, factor: f64) {
        self.add_scaled_state(at, at, factor - 1.0);
    }

    /// Becomes the mixture of itself and another one of the same states, which has this weight: its mean and covariance.
    pub(super) fn mix_with(&mut self, other: &Self, weight: f64) {
        if other.mean.len() != self.mean.len() || !(0.0..=1.0).contains(&weight) {
            return;
        }
        let apart: Vec<f64> = other.mean.iter().zip(&self.mean).map(|(theirs, own)| theirs - own).collect();
        for (at, row) in self.covariance.iter_mut().enumerate() {
            for (to, cell) in row.iter_mut().enumerate() {
                let theirs = other.covariance(at, to);
                *cell += weight * (theirs - *cell) + weight * (1.0 - weight) * apart[at] * apart[to];
            }
        }
        self.mean.iter_mut().zip(&apart).for_each(|(mean, apart)| *mean += weight * apart);
    }

    /// No less than this: a wear or a rate is not negative.
    pub(super) fn at_least(&mut self, at: usize, least: f64) {
        if let Some(mean) = self.mean.get_mut(at) {
            *mean = mean.max(least);
        }
    }

    /// Takes a measurement: its gradient over states, how far it lies above what was expected, its variance.
    pub(super) fn update_with_measurement(&mut self, gradient: &[(usize, f64)], above: f64, variance: f64) {
        let along: Vec<f64> = (0..self.len()).map(|at| self.covariance_along(at, gradient)).collect();
        let total = self.variance_of(gradient, variance);
        if !(total > 0.0 && total.is_finite() && above.is_finite()) {
            return;
        }
        for (at, share) in along.iter().enumerate() {
            self.mean[at] += share / total * above;
            for (cell, other) in self.covariance[at].iter_mut().zip(&along) {
                *cell -= share * other / total;
            }
        }
    }

    /// Logarithm of how likely such a measurement was.
    pub(super) fn log_likelihood(&self, gradient: &[(usize, f64)], above: f64, variance: f64) -> f64 {
        let total = self.variance_of(gradient, variance).max(f64::MIN_POSITIVE);
        -0.5 * (above * above / total + total.ln())
    }

    /// Variance of a measurement with this gradient.
    pub(super) fn variance_of(&self, gradient: &[(usize, f64)], variance: f64) -> f64 {
        gradient.iter().map(|(at, slope)| slope * self.covariance_along(*at, gradient)).sum::<f64>() + variance
    }

    fn covariance_along(&self, at: usize, gradient: &[(usize, f64)]) -> f64 {
        gradient.iter().map(|(other, slope)| self.covariance(at, *other) * slope).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_measured_sum_ties_its_parts_together() {
        let mut joint = Gaussian::default();
        let (a, b) = (joint.add(0.0, 1.0), joint.add(0.0, 1.0));
        joint.update_with_measurement(&[(a, 1.0), (b, 1.0)], 2.0, 0.0);
        assert!((joint.mean(a) - 1.0).abs() < 1e-12 && (joint.covariance(a, b) + 0.5).abs() < 1e-12, "{joint:?}");
        joint.update_with_measurement(&[(a, 1.0)], -1.0, 1e-9);
        assert!((joint.mean(b) - 2.0).abs() < 1e-6, "what one has less the other has more: {joint:?}");
    }

    #[test]
    fn a_mixture_has_the_mean_and_the_spread_of_both() {
        let (mut one, mut other) = (Gaussian::default(), Gaussian::default());
        one.add(0.0, 1.0);
        other.add(4.0, 3.0);
        one.mix_with(&other, 0.25);
        assert!((one.mean(0) - 1.0).abs() < 1e-12 && (one.covariance(0, 0) - (1.5 + 3.0)).abs() < 1e-12, "{one:?}");
    }

    #[test]
    fn growth_moves_mean_and_covariance_and_a_reset_forgets() {
        let mut joint = Gaussian::default();
        let (wear, rate) = (joint.add(0.1, 0.01), joint.add(0.02, 0.0001));
        joint.add_scaled_state(wear, rate, 10.0);
        assert!((joint.mean(wear) - 0.3).abs() < 1e-12);
        assert!(
            (joint.covariance(wear, wear) - 0.02).abs() < 1e-12 && (joint.covariance(wear, rate) - 0.001).abs() < 1e-12
        );
        joint.reset_state(wear, 0.0, 0.5);
        assert_eq!((joint.covariance(wear, rate), joint.covariance(wear, wear)), (0.0, 0.5));
        assert!(joint.is_sound());
    }
}
