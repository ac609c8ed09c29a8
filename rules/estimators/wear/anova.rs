//! Analysis of variance of a fitted surface.
//!
//! Source: Montgomery, Design and Analysis of Experiments, 8th edition, 10.4 (significance) and 11.2.1 (lack of fit).

use super::conditions::Cut;
use crate::regression::{Regression, f_upper_tail};
use numerics::statistics::count_to_f64;
use serde::Serialize;

/// One row of the table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AnovaRow {
    /// What explains: `model`, a term, `residual`, `lack of fit`, `pure error`, `total`.
    pub source: String,
    /// Sum of squares, W^2.
    pub sum_of_squares: f64,
    /// Degrees of freedom of this source.
    pub degrees_of_freedom: f64,
    /// Sum over degrees of freedom, W^2.
    pub mean_square: f64,
    /// Against the residual (lack of fit: against the pure error).
    pub f: Option<f64>,
    /// Probability of so great an F by chance.
    pub p: Option<f64>,
}

/// The table, and how much of the variance is explained.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Anova {
    /// Rows: the model, each term as if it came last, residual, lack of fit where cuts were repeated, total.
    pub sources: Vec<AnovaRow>,
    /// Share of the variance of the power that the model explains, at most 1.
    pub r2: f64,
    /// The same, for the number of terms.
    pub adjusted_r2: f64,
    /// Share explained of cuts that were left out one at a time; `None` where a cut alone determines a coefficient.
    pub predicted_r2: Option<f64>,
}

/// The table of a regression with a constant.
#[must_use]
pub(super) fn build_anova(cuts: &[Cut], regression: &Regression) -> Anova {
    let residual = (regression.rss, regression.degrees_of_freedom);
    let terms = regression.coefficients.len() - 1;
    let mut sources = vec![build_tested_row("model", regression.explained, count_to_f64(terms), residual)];
    for coefficient in regression.coefficients.iter().skip(1) {
        let t = coefficient.value / coefficient.standard_error.max(f64::MIN_POSITIVE);
        let squares = t * t * regression.residual_sd.powi(2);
        sources.push(build_tested_row(&coefficient.name, squares, 1.0, residual));
    }
    sources.push(build_untested_row("residual", residual));
    sources.extend(lack_of_fit(cuts, regression));
    sources
        .push(build_untested_row("total", (regression.explained + regression.rss, count_to_f64(regression.rows - 1))));
    let Regression { r2, adjusted_r2, predicted_r2, .. } = *regression;
    Anova { sources, r2, adjusted_r2, predicted_r2 }
}

fn build_untested_row(source: &str, (sum_of_squares, degrees_of_freedom): (f64, f64)) -> AnovaRow {
    let mean_square = sum_of_squares / degrees_of_freedom;
    AnovaRow { source: source.to_owned(), sum_of_squares, degrees_of_freedom, mean_square, f: None, p: None }
}

fn build_tested_row(source: &str, squares: f64, df: f64, (rest, rest_df): (f64, f64)) -> AnovaRow {
    let row = build_untested_row(source, (squares, df));
    // A perfect fit leaves nothing to compare with.
    let f = (rest > 0.0).then(|| row.mean_square / (rest / rest_df)).filter(|f| f.is_finite());
    AnovaRow { f, p: f.map(|f| f_upper_tail(f, df, rest_df)), ..row }
}

/// The residual split by repeated cuts: what repeats vary among themselves, and what the surface misses.
fn lack_of_fit(cuts: &[Cut], regression: &Regression) -> Vec<AnovaRow> {
    let (mut pure, mut repeats) = (0.0, 0.0);
    let mut seen = vec![false; cuts.len()];
    for at in 0..cuts.len() {
        if seen[at] {
            continue;
        }
        let same: Vec<usize> = (at..cuts.len()).filter(|it| cuts[*it].conditions == cuts[at].conditions).collect();
        same.iter().for_each(|it| seen[*it] = true);
        let mean = same.iter().map(|it| cuts[*it].cutting_power_w).sum::<f64>() / count_to_f64(same.len());
        pure += same.iter().map(|it| (cuts[*it].cutting_power_w - mean).powi(2)).sum::<f64>();
        repeats += count_to_f64(same.len() - 1);
    }
    let missed_df = regression.degrees_of_freedom - repeats;
    if repeats < 1.0 || missed_df < 1.0 {
        return Vec::new();
    }
    let missed = (regression.rss - pure).max(0.0);
    vec![
        build_tested_row("lack of fit", missed, missed_df, (pure, repeats)),
        build_untested_row("pure error", (pure, repeats)),
    ]
}
