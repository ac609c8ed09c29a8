//! Least squares with everything that a coefficient needs to be believed, and refusals where it cannot be.
//!
//! | file | what |
//! |---|---|
//! | `least_squares` | [`fit_unweighted`]: coefficients with intervals, and how good the fit is |
//! | `prediction` | what a fit says at a new point, and tests between fits |
//! | `distributions` | Student's t and Fisher's F |
//! | `series` | level and trend of noise that remembers |
//! | `refusal` | why there is no number: what, where, and what to record instead |
//! | `plausible` | units that were mistaken, recognised by the range |

mod distributions;
mod least_squares;
mod plausible;
mod prediction;
mod refusal;
mod series;
mod unequal;

pub use distributions::{f_upper_tail, t_quantile, t_two_sided};
pub use least_squares::{Coefficient, Column, Intercept, Regression, fit_unweighted, fit_weighted};
pub use plausible::{Mistake, Plausible};
pub use prediction::{FTest, FitPrediction};
pub use refusal::{Refusal, RefusalKind};
pub use series::{SteadyLevel, estimate_level, integrated_autocorrelation, without_pulses};
pub use unequal::UnequalScatter;

/// The probability that every stated interval covers.
pub const CONFIDENCE: f64 = 0.95;
