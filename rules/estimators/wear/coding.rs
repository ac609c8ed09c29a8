//! Coded variables: each factor from -1 to 1 over the recorded range, so that coefficients compare and columns are
//! nearly orthogonal. The patent codes `a = (VB - 0.195) / 0.13` in the same way.

use super::conditions::{ConditionFactor, Cut, CutConditions, FACTORS};
use crate::regression::{Refusal, RefusalKind};
use serde::{Deserialize, Serialize};

/// Share of the recorded range by which a condition may lie outside before it counts as extrapolated.
const MARGIN: f64 = 0.05;

/// Least and greatest value of each factor that a model was fitted on, in the order and units of [`FACTORS`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Range {
    /// Least value of each factor.
    pub least: [f64; 4],
    /// Greatest value of each factor.
    pub greatest: [f64; 4],
}

impl Range {
    /// The range of some cuts.
    #[must_use]
    pub fn from_cuts(cuts: &[Cut]) -> Self {
        let fold = |start: f64, pick: fn(f64, f64) -> f64| {
            cuts.iter().fold([start; 4], |best, cut| {
                let values = cut.conditions.to_vector();
                std::array::from_fn(|at| pick(best[at], values[at]))
            })
        };
        Self { least: fold(f64::INFINITY, f64::min), greatest: fold(f64::NEG_INFINITY, f64::max) }
    }

    /// Width of a factor's range.
    #[must_use]
    pub fn width(&self, factor: usize) -> f64 {
        self.greatest[factor] - self.least[factor]
    }

    /// Was the factor changed at all?
    #[must_use]
    pub fn is_varied(&self, factor: usize) -> bool {
        self.width(factor) > 1e-9 * self.greatest[factor].abs()
    }

    /// The factors whose value lies outside what was recorded.
    #[must_use]
    pub fn find_factors_outside(&self, conditions: &CutConditions) -> Vec<&'static ConditionFactor> {
        let beyond = |at: &usize| {
            let value = conditions.to_vector()[*at];
            let margin = MARGIN * self.width(*at).max(MARGIN * self.greatest[*at].abs());
            value < self.least[*at] - margin || value > self.greatest[*at] + margin
        };
        (0..FACTORS.len()).filter(beyond).map(|at| &FACTORS[at]).collect()
    }
}

/// Centre and half range of each factor; the half range of a factor that was held is 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Coding {
    /// The value of each factor that is coded 0, in its unit.
    pub centre: [f64; 4],
    /// Distance from 0 to 1.
    pub half: [f64; 4],
}

impl Coding {
    /// The coding of a range.
    #[must_use]
    pub fn from_range(range: &Range) -> Self {
        Self {
            centre: std::array::from_fn(|at| 0.5 * (range.least[at] + range.greatest[at])),
            half: std::array::from_fn(|at| if range.is_varied(at) { 0.5 * range.width(at) } else { 0.0 }),
        }
    }

    /// The coded variables; 0 where the factor was held.
    #[must_use]
    pub fn encode_conditions(&self, conditions: &CutConditions) -> [f64; 4] {
        let values = conditions.to_vector();
        let coded = |at: usize| (values[at] - self.centre[at]) / self.half[at];
        std::array::from_fn(|at| if self.half[at] > 0.0 { coded(at) } else { 0.0 })
    }

    /// The conditions of coded variables.
    #[must_use]
    pub fn decode_conditions(&self, coded: [f64; 4]) -> CutConditions {
        CutConditions::from_vector(std::array::from_fn(|at| self.centre[at] + coded[at] * self.half[at]))
    }
}

/// Every factor was changed, except those that are `held` on purpose; the wear always has to change.
///
/// # Errors
/// The factors that are constant.
pub(super) fn check_varied(range: &Range, held: &[&str]) -> Result<(), Refusal> {
    let constant = |at: &usize| !range.is_varied(*at) && !held.contains(&FACTORS[*at].name);
    let still: Vec<&ConditionFactor> = (0..FACTORS.len()).filter(constant).map(|at| &FACTORS[at]).collect();
    if still.is_empty() {
        return Ok(());
    }
    let each = |it: &&ConditionFactor| format!("{} is the same in every cut", it.name);
    let what = still.iter().map(each).collect::<Vec<_>>().join(", ");
    let names: Vec<&str> = still.iter().map(|it| it.name).collect();
    let next = format!(
        "cut with at least three values of it (`identify tool-wear --design L27` prints a work list), or say that the \
         model is for this value alone: --held {}",
        names.join(",")
    );
    Err(Refusal::new(RefusalKind::Constant, what, next))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cuts() -> Vec<Cut> {
        [[0.065, 90.0, 0.1, 0.5], [0.325, 150.0, 0.2, 1.5]]
            .map(|it| Cut { conditions: CutConditions::from_vector(it), cutting_power_w: 1.0 })
            .to_vec()
    }

    #[test]
    fn the_published_coding_of_the_wear() {
        let coding = Coding::from_range(&Range::from_cuts(&cuts()));
        assert!((coding.centre[0] - 0.195).abs() < 1e-12 && (coding.half[0] - 0.13).abs() < 1e-12);
        let coded = coding.encode_conditions(&CutConditions::from_vector([0.3, 120.0, 0.1, 1.5]));
        assert!((coded[0] - 0.807_692).abs() < 1e-6 && coded[1].abs() < 1e-12);
        assert!((coding.decode_conditions(coded).flank_wear_mm - 0.3).abs() < 1e-12);
    }

    #[test]
    fn what_lies_outside_is_named() {
        let range = Range::from_cuts(&cuts());
        let outside = range.find_factors_outside(&CutConditions::from_vector([0.3, 170.0, 0.15, 0.2]));
        assert_eq!(outside.iter().map(|it| it.symbol).collect::<Vec<_>>(), ["vc", "ap"]);
        assert!(
            range.find_factors_outside(&CutConditions::from_vector([0.33, 90.0, 0.1, 0.5])).is_empty(),
            "a margin of 5 %"
        );
    }

    #[test]
    fn a_held_factor_must_be_named() {
        let mut held = cuts();
        held[1].conditions.cutting_speed_m_min = 90.0;
        let range = Range::from_cuts(&held);
        let refusal = check_varied(&range, &[]).expect_err("constant").to_string();
        assert!(refusal.contains("cutting_speed_m_min is the same") && refusal.contains("--held"), "{refusal}");
        assert_eq!(check_varied(&range, &["cutting_speed_m_min"]), Ok(()));
    }
}
