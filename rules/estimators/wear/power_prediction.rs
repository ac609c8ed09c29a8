//! What a model of the cutting power says of a cut.

use crate::regression::{CONFIDENCE, t_quantile};

/// A power with what is known of its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Predicted {
    /// Cutting power that the model expects, W.
    pub power_w: f64,
    /// Standard error of the law there, W; 0 where it is not known.
    pub law_sd_w: f64,
    /// Standard deviation of one cut about the law, W.
    pub residual_sd_w: f64,
    /// Degrees of freedom behind both.
    pub degrees_of_freedom: f64,
}

impl Predicted {
    /// Standard deviation of a new cut, W.
    #[must_use]
    pub fn observation_sd_w(&self) -> f64 {
        self.law_sd_w.hypot(self.residual_sd_w)
    }

    /// Half width of a 95 % interval in standard deviations.
    #[must_use]
    pub fn interval_factor(&self) -> f64 {
        t_quantile(0.5 + 0.5 * CONFIDENCE, self.degrees_of_freedom.max(1.0))
    }
}
