//! The law of a thermal error: which temperatures, with what weight, late by how much, and how well all that is known.

use crate::regression::{Refusal, RefusalKind};
use serde::{Deserialize, Serialize};

/// Temperature points that a law may use.
pub const POINTS_MAX: usize = 16;
/// Terms of a law: each point directly and through its lag.
pub const TERMS_MAX: usize = 2 * POINTS_MAX;

/// How a temperature enters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Path {
    /// The temperature as it is measured, without delay.
    Direct,
    /// Through a first-order state: the structure warms later than the sensor.
    Lagged,
}

/// One term of a law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThermalTerm {
    /// Channel of the sensor.
    pub sensor: String,
    /// Does the temperature act at once, or through a lag?
    pub path: Path,
    /// Error per kelvin, um/K.
    pub um_per_k: f64,
    /// Ends of the 95 % interval of `um_per_k`.
    pub interval: (f64, f64),
    /// Least and greatest temperature during identification, °C.
    pub range_c: (f64, f64),
}

/// `E = intercept + sum of um_per_k * temperature`; lagged terms see `dw/dt = (T - w) / tau_s` in place of `T`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThermalLaw {
    /// Error at 0 °C everywhere: of no meaning by itself, um.
    pub intercept_um: f64,
    /// Ends of its 95 % interval.
    pub intercept_interval: (f64, f64),
    /// Time constant of the lag, s; absent where no term is lagged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tau_s: Option<f64>,
    /// Ends of its 95 % interval.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tau_interval_s: Option<(f64, f64)>,
    /// Standard deviation of what the law leaves, also of rows that it was not fitted to, um.
    pub residual_sd_um: f64,
    /// Greatest standard deviation of the law itself in the rows of identification, um: more is extrapolation.
    pub law_sd_max_um: f64,
    /// Root mean square of `T - w` during identification, K: how far a state is off whose beginning is not known.
    #[serde(default)]
    pub lag_spread_k: f64,
    /// What is added to the intercept, one term per sensor and path.
    pub terms: Vec<ThermalTerm>,
    /// Covariance of intercept and terms, in their order, row by row.
    pub covariance: Vec<Vec<f64>>,
}

impl ThermalLaw {
    /// Refuses a law that was typed in wrong: no terms, too many, sizes that do not fit, numbers that are none.
    ///
    /// # Errors
    /// What is wrong and where.
    pub fn check_consistency(&self) -> Result<(), Refusal> {
        let wrong = |kind, what: String, place: &str| {
            Err(Refusal::new(kind, what, "identify the law again, or copy it whole").with_place(place))
        };
        let size = self.terms.len() + 1;
        if self.terms.is_empty() || self.terms.len() > TERMS_MAX {
            return wrong(RefusalKind::Mismatch, format!("{} terms; 1 to {TERMS_MAX} can be", size - 1), "terms");
        }
        if self.covariance.len() != size || self.covariance.iter().any(|row| row.len() != size) {
            return wrong(RefusalKind::Mismatch, format!("is not {size} by {size}"), "covariance");
        }
        let own = [self.intercept_um, self.residual_sd_um, self.law_sd_max_um, self.lag_spread_k];
        let terms = self.terms.iter().flat_map(|term| [term.um_per_k, term.range_c.0, term.range_c.1]);
        let tau = self.tau_s.into_iter();
        let all = own.into_iter().chain(terms).chain(tau).chain(self.covariance.iter().flatten().copied());
        if all.into_iter().any(|number| !number.is_finite()) || self.residual_sd_um < 0.0 {
            return wrong(RefusalKind::NotFinite, "a number is none, or a deviation negative".to_owned(), "law");
        }
        if !self.covariance_can_be() {
            let what = "no coefficients can vary together like this".to_owned();
            return wrong(RefusalKind::Mismatch, what, "covariance");
        }
        let lagged = self.terms.iter().any(|term| term.path == Path::Lagged);
        if lagged && self.tau_s.is_none_or(|tau_s| tau_s <= 0.0) {
            return wrong(RefusalKind::Missing, "a term is lagged and there is no time constant".to_owned(), "tau_s");
        }
        Ok(())
    }

    /// Is every variance positive or zero, and no covariance greater than its two variances allow? Rounding of a copied file is let pass.
    fn covariance_can_be(&self) -> bool {
        let of = |row: usize, column: usize| self.covariance[row][column];
        let all = 0..self.covariance.len();
        all.clone().all(|row| {
            let pairs =
                all.clone().all(|column| of(row, column).powi(2) <= of(row, row) * of(column, column) * 1.000_001);
            of(row, row) >= 0.0 && pairs
        })
    }

    /// The standard deviation of the law at a point: one for the intercept, then one temperature or state per term.
    #[must_use]
    pub(super) fn law_sd_um(&self, point: &[f64]) -> f64 {
        let row = |entries: &Vec<f64>| entries.iter().zip(point).map(|(entry, x)| entry * x).sum::<f64>();
        let variance: f64 = point.iter().zip(&self.covariance).map(|(x, entries)| x * row(entries)).sum();
        variance.max(0.0).sqrt()
    }

    /// The error at such a point.
    #[must_use]
    pub(super) fn error_um(&self, point: &[f64]) -> f64 {
        let terms = self.terms.iter().zip(point.iter().skip(1));
        self.intercept_um + terms.map(|(term, x)| term.um_per_k * x).sum::<f64>()
    }
}

/// A first-order state after `dt_s`, exact while the input runs straight from `from` to `to`: `dw/dt = (u - w) / tau`.
#[must_use]
pub fn first_order(state: f64, from: f64, to: f64, dt_s: f64, tau_s: f64) -> f64 {
    if dt_s <= 0.0 || tau_s <= 0.0 {
        return if tau_s <= 0.0 { to } else { state };
    }
    // Behind a ramp the state lags by slope times tau once the beginning is forgotten.
    let behind = (to - from) / dt_s * tau_s;
    to - behind + (state - from + behind) * (-dt_s / tau_s).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_is_exact_for_steps_and_ramps() {
        let step = first_order(0.0, 1.0, 1.0, 600.0, 600.0);
        assert!((step - (1.0 - (-1.0_f64).exp())).abs() < 1e-12);
        // Many small steps of the differential equation.
        let (mut state, pieces) = (5.0, 200_000);
        for piece in 0..pieces {
            let input = 20.0 + 10.0 * (f64::from(piece) + 0.5) / f64::from(pieces);
            state += (input - state) / 300.0 * 900.0 / f64::from(pieces);
        }
        assert!((first_order(5.0, 20.0, 30.0, 900.0, 300.0) - state).abs() < 1e-4);
        assert_eq!(first_order(5.0, 20.0, 30.0, 0.0, 300.0), 5.0);
    }

    #[test]
    fn two_halves_of_a_ramp_are_the_whole() {
        let whole = first_order(3.0, 20.0, 30.0, 100.0, 70.0);
        let halves = first_order(first_order(3.0, 20.0, 25.0, 50.0, 70.0), 25.0, 30.0, 50.0, 70.0);
        assert!((whole - halves).abs() < 1e-12);
    }
}
