//! The response surface: `P = b0 + sum bi xi + sum bij xi xj + sum bii xi^2` over coded variables.

use super::coding::{Coding, Range};
use super::conditions::{CutConditions, FACTORS, WEAR};
use super::power_prediction::Predicted;
use super::term::WearTerm;
use serde::{Deserialize, Serialize};

/// A fitted or published surface. One coefficient per term.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Surface {
    /// From conditions to coded variables.
    pub coding: Coding,
    /// The terms, the constant first.
    pub terms: Vec<WearTerm>,
    /// One coefficient per term, W.
    pub coefficients_w: Vec<f64>,
    /// Covariance of the coefficients, W^2; empty where none is known.
    pub covariance_w2: Vec<Vec<f64>>,
    /// Standard deviation of one cut about the surface, W.
    pub residual_sd_w: f64,
    /// Cuts less coefficients of the fit.
    pub degrees_of_freedom: f64,
    /// What the surface was fitted on.
    pub range: Range,
}

impl Surface {
    /// Power at coded variables, W.
    #[must_use]
    pub fn power_at(&self, coded: &[f64; 4]) -> f64 {
        self.terms.iter().zip(&self.coefficients_w).map(|(term, b)| b * term.evaluate_at(coded)).sum()
    }

    /// Power and its uncertainty.
    #[must_use]
    pub fn predict_power(&self, conditions: &CutConditions) -> Predicted {
        let coded = self.coding.encode_conditions(conditions);
        let values: Vec<f64> = self.terms.iter().map(|term| term.evaluate_at(&coded)).collect();
        let row = |i: usize| self.covariance_w2[i].iter().zip(&values).map(|(entry, x)| entry * x).sum::<f64>();
        let variance: f64 = (0..self.covariance_w2.len()).map(|i| values[i] * row(i)).sum();
        Predicted {
            power_w: self.power_at(&coded),
            law_sd_w: variance.max(0.0).sqrt(),
            residual_sd_w: self.residual_sd_w,
            degrees_of_freedom: self.degrees_of_freedom,
        }
    }

    /// Change of power per millimetre of flank wear, W/mm.
    #[must_use]
    pub fn wear_slope_w_per_mm(&self, conditions: &CutConditions) -> f64 {
        let coded = self.coding.encode_conditions(conditions);
        let slope: f64 =
            self.terms.iter().zip(&self.coefficients_w).map(|(term, b)| b * term.slope(WEAR, &coded)).sum();
        if self.coding.half[WEAR] > 0.0 { slope / self.coding.half[WEAR] } else { 0.0 }
    }

    /// The formula over the coded variables a (VB), b (vc), c (f), d (ap).
    #[must_use]
    pub fn format_formula(&self) -> String {
        let letters: Vec<String> = FACTORS.iter().map(|factor| factor.letter.to_string()).collect();
        let symbols: Vec<&str> = letters.iter().map(String::as_str).collect();
        let part = |(index, (term, b)): (usize, (&WearTerm, &f64))| {
            let sign = match (index, *b < 0.0) {
                (0, false) => "",
                (0, true) => "-",
                (_, false) => " + ",
                (_, true) => " - ",
            };
            let name = if term.order() == 0 { String::new() } else { format!(" {}", term.format_name(&symbols)) };
            format!("{sign}{:.2}{name}", b.abs())
        };
        let parts: String = self.terms.iter().zip(&self.coefficients_w).enumerate().map(part).collect();
        format!("P = {parts}")
    }
}

/// The surface of the patent over its coded variables, as printed: VB coded by (VB - 0.195)/0.13, the codings of vc, f and
/// ap are not in the text and are taken as they are. Residual standard deviation from the printed R2 = 99.29 % of 27 runs
/// and the sum of squares of the design's columns 1, 2, 5 and 9 (37.6 W, computed); no covariance is printed.
#[must_use]
pub fn build_published_surface() -> Surface {
    published_over(Coding { centre: [0.195, 0.0, 0.0, 0.0], half: [0.13, 1.0, 1.0, 1.0] })
}

/// The same over a coding of one's own; the cube from -1 to 1 is the range.
#[must_use]
pub fn published_over(coding: Coding) -> Surface {
    let term = |powers: [u8; 4]| WearTerm::new(powers.to_vec());
    let printed: [([u8; 4], f64); 9] = [
        ([0, 0, 0, 0], 1035.63),
        ([1, 0, 0, 0], 83.5),
        ([0, 1, 0, 0], 235.03),
        ([0, 0, 1, 0], 246.36),
        ([0, 0, 0, 1], 262.54),
        ([1, 1, 0, 0], 37.02),
        ([1, 0, 1, 0], -34.87),
        ([0, 1, 0, 1], 62.14),
        ([0, 0, 1, 1], 47.28),
    ];
    let cube = |side: f64| coding.decode_conditions([side; 4]).to_vector();
    Surface {
        terms: printed.iter().map(|(powers, _)| term(*powers)).collect(),
        coefficients_w: printed.iter().map(|(_, b)| *b).collect(),
        covariance_w2: Vec::new(),
        residual_sd_w: 37.6,
        degrees_of_freedom: 18.0,
        range: Range { least: cube(-1.0), greatest: cube(1.0) },
        coding,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_sensitivities() {
        let surface = build_published_surface();
        let slope = |b: f64, c: f64| surface.wear_slope_w_per_mm(&surface.coding.decode_conditions([0.0, b, c, 0.0]));
        for (b, c, expected) in
            [(0.0, 0.0, 642.0), (1.0, 1.0, 659.0), (1.0, 0.0, 927.0), (1.0, -1.0, 1195.0), (-1.0, 1.0, 89.0)]
        {
            assert!((slope(b, c) - expected).abs() < 0.6, "b = {b}, c = {c}: {}", slope(b, c));
        }
    }

    #[test]
    fn the_formula_reads_as_printed() {
        assert_eq!(
            build_published_surface().format_formula(),
            "P = 1035.63 + 83.50 a + 235.03 b + 246.36 c + 262.54 d + 37.02 a*b - 34.87 a*c + 62.14 b*d + 47.28 c*d"
        );
    }
}
