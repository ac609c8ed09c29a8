//! What a fit says at a new point, and whether a longer one says more than a shorter.

use super::CONFIDENCE;
use super::distributions::{f_upper_tail, t_quantile};
use super::least_squares::{Intercept, Regression};
use serde::Serialize;

/// The value of a fit at a point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FitPrediction {
    /// What the fit gives there, in the unit of y.
    pub value: f64,
    /// Standard error of the mean at this point: how well the law is known there.
    pub standard_error: f64,
    /// Standard deviation of one new observation there.
    pub observation_sd: f64,
    /// Leverage of the point; greater than that of every row means that the point lies outside what was recorded.
    pub leverage: f64,
    /// Ends of the 95 % interval of the mean.
    pub interval: (f64, f64),
    /// Ends of the 95 % interval of one new observation.
    pub observation_interval: (f64, f64),
}

/// Does a longer law say more than a shorter one that it contains?
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FTest {
    /// Variance explained by the added terms over residual variance.
    pub f: f64,
    /// Number of added terms.
    pub df1: f64,
    /// Degrees of freedom of the longer law.
    pub df2: f64,
    /// Probability of so great an F by chance.
    pub p: f64,
}

impl Regression {
    /// The value at a point: one number per column, without the constant. `None` for a wrong number of them, or one that
    /// is not finite.
    #[must_use]
    pub fn predict_value(&self, point: &[f64]) -> Option<FitPrediction> {
        let ones = (self.intercept == Intercept::Fitted).then_some(1.0);
        let x: Vec<f64> = ones.into_iter().chain(point.iter().copied()).collect();
        if x.len() != self.coefficients.len() || x.iter().any(|x| !x.is_finite()) {
            return None;
        }
        let value = x.iter().zip(&self.coefficients).map(|(x, c)| x * c.value).sum::<f64>();
        let row = |i: usize| x.iter().zip(&self.inverse[i]).map(|(x, entry)| x * entry).sum::<f64>();
        let leverage = (0..x.len()).map(|i| x[i] * row(i)).sum::<f64>().max(0.0);
        let standard_error = self.residual_sd * leverage.sqrt();
        let observation_sd = self.residual_sd * (1.0 + leverage).sqrt();
        let t = t_quantile(0.5 + 0.5 * CONFIDENCE, self.degrees_of_freedom);
        let around = |sd: f64| (value - t * sd, value + t * sd);
        Some(FitPrediction {
            value,
            standard_error,
            observation_sd,
            leverage,
            interval: around(standard_error),
            observation_interval: around(observation_sd),
        })
        .filter(|prediction| prediction.value.is_finite() && prediction.observation_sd.is_finite())
    }

    /// Tests this law against a shorter one of the same rows. `None` where it is no longer.
    #[must_use]
    pub fn test_against(&self, shorter: &Self) -> Option<FTest> {
        let df1 = shorter.degrees_of_freedom - self.degrees_of_freedom;
        if df1 < 1.0 || self.rows != shorter.rows {
            return None;
        }
        let gained = (shorter.rss - self.rss).max(0.0) / df1;
        let noise = self.rss / self.degrees_of_freedom;
        let f = if noise > 0.0 { gained / noise } else { f64::MAX };
        Some(FTest { f, df1, df2: self.degrees_of_freedom, p: f_upper_tail(f, df1, self.degrees_of_freedom) })
    }
}
