//! A wear model: either form, and what both can be asked.

use super::coding::Range;
use super::conditions::{ConditionFactor, CutConditions};
use super::physical::Physical;
use super::power_prediction::Predicted;
use super::surface::Surface;
use serde::{Deserialize, Serialize};

/// A model of the cutting power over wear, speed, feed and depth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "form", rename_all = "snake_case")]
pub enum WearModel {
    /// A second-order response surface over the four conditions.
    Surface(Surface),
    /// The form that mechanics suggests, see [`Physical`].
    Physical(Physical),
}

impl WearModel {
    /// The word for the form: `surface` or `physical`.
    #[must_use]
    pub fn form(&self) -> &'static str {
        match self {
            Self::Surface(_) => "surface",
            Self::Physical(_) => "physical",
        }
    }

    /// Power and its uncertainty.
    #[must_use]
    pub fn predict_power(&self, conditions: &CutConditions) -> Predicted {
        match self {
            Self::Surface(surface) => surface.predict_power(conditions),
            Self::Physical(physical) => physical.predict_power(conditions),
        }
    }

    /// Change of power per millimetre of flank wear, W/mm.
    #[must_use]
    pub fn wear_slope_w_per_mm(&self, conditions: &CutConditions) -> f64 {
        match self {
            Self::Surface(surface) => surface.wear_slope_w_per_mm(conditions),
            Self::Physical(physical) => physical.wear_slope_w_per_mm(conditions),
        }
    }

    /// What the model was fitted on.
    #[must_use]
    pub fn range(&self) -> &Range {
        match self {
            Self::Surface(surface) => &surface.range,
            Self::Physical(physical) => &physical.range,
        }
    }

    /// The factors in which these conditions lie outside what the model was fitted on.
    #[must_use]
    pub fn find_factors_outside(&self, conditions: &CutConditions) -> Vec<&'static ConditionFactor> {
        self.range().find_factors_outside(conditions)
    }

    /// Are all numbers finite and as many as belong together? A file or a database may have been edited.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let (numbers, square, count): (Vec<f64>, &Vec<Vec<f64>>, usize) = match self {
            Self::Surface(it) => {
                let of_terms =
                    it.terms.len() == it.coefficients_w.len() && it.terms.iter().all(|t| t.powers().len() == 4);
                if !of_terms || it.terms.is_empty() {
                    return false;
                }
                let coding = it.coding.centre.iter().chain(&it.coding.half);
                (it.coefficients_w.iter().chain(coding).copied().collect(), &it.covariance_w2, it.terms.len())
            }
            Self::Physical(it) => {
                let middle = it.reference.iter().chain(&it.exponents).copied();
                if it.reference.iter().any(|value| *value <= 0.0) {
                    return false;
                }
                (middle.chain([it.cutting_power_w, it.wear_w_min_m_mm2]).collect(), &it.covariance, 5)
            }
        };
        let shape = square.is_empty() || square.len() == count && square.iter().all(|row| row.len() == count);
        let predicted = self.predict_settings();
        shape && numbers.iter().chain(square.iter().flatten()).chain(&predicted).all(|number| number.is_finite())
    }

    fn predict_settings(&self) -> Vec<f64> {
        let (sd, df) = match self {
            Self::Surface(it) => (it.residual_sd_w, it.degrees_of_freedom),
            Self::Physical(it) => (it.residual_sd_w, it.degrees_of_freedom),
        };
        let range = self.range();
        range.least.iter().chain(&range.greatest).copied().chain([sd, df]).collect()
    }
}
