//! Both forms against each other, on cuts that they have not seen.
//!
//! The form is chosen by evidence: Schwarz's criterion (1978), n ln(RSS/n) + k ln n, of both fits on the same cuts. It punishes the
//! many terms of a surface, and the five numbers of a physical form that do not describe the cuts. Errors on cuts that were left out
//! stand beside it:
//!
//! Inside: each cut is predicted by a fit of all the others. Outside: all cuts at the least or the greatest value of a factor
//! are predicted by a fit of the rest, as happens when a machine is run beyond its design of experiments.

use super::coding::Range;
use super::conditions::{Cut, FACTORS};
use super::fit_surface::{Order, SurfaceOptions, fit_surface};
use super::model::WearModel;
use super::physical::fit_physical;
use serde::Serialize;

/// Errors of one form, W, root mean square; `None` where a fit was not possible.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FormErrors {
    /// Which of the two forms: `surface` or `physical`.
    pub form: &'static str,
    /// Schwarz's criterion; the smaller one has the better evidence. `None` where a fit was not possible.
    pub bic: Option<f64>,
    /// Of cuts within the design.
    pub inside_rms_w: Option<f64>,
    /// Of cuts at the edge of the design, from a fit without this edge.
    pub outside_rms_w: Option<f64>,
}

/// Both forms, and which one to take.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FormComparison {
    /// Surface, then physical form.
    pub forms: [FormErrors; 2],
    /// The form with the better evidence.
    pub recommended: &'static str,
}

type FitFunction<'a> = &'a dyn Fn(&[Cut]) -> Option<WearModel>;

/// Compares the two forms by cross-validation.
#[must_use]
pub fn compare_forms(cuts: &[Cut], options: &SurfaceOptions) -> FormComparison {
    let surface = |cuts: &[Cut]| fit_largest_surface(cuts, options);
    let physical = |cuts: &[Cut]| fit_physical(cuts, &options.held).ok().map(|fit| WearModel::Physical(fit.physical));
    let forms = [evaluate_form("surface", cuts, &surface), evaluate_form("physical", cuts, &physical)];
    let recommended = match (forms[0].bic, forms[1].bic) {
        (Some(surface), Some(physical)) if surface < physical => "surface",
        (Some(_), None) => "surface",
        _ => "physical",
    };
    FormComparison { forms, recommended }
}

/// The surface of the highest order that these cuts carry.
fn fit_largest_surface(cuts: &[Cut], options: &SurfaceOptions) -> Option<WearModel> {
    let orders = [Order::Second, Order::Interactions, Order::Linear];
    let mut allowed = orders.into_iter().skip_while(|order| *order != options.order);
    let fitted = allowed.find_map(|order| fit_surface(cuts, &SurfaceOptions { order, ..options.clone() }).ok());
    fitted.map(|fit| WearModel::Surface(fit.surface))
}

fn evaluate_form(form: &'static str, cuts: &[Cut], fit: FitFunction<'_>) -> FormErrors {
    let one_by_one: Vec<Vec<usize>> = (0..cuts.len()).map(|at| vec![at]).collect();
    FormErrors {
        form,
        bic: fit(cuts).map(|model| bic(&model, cuts)),
        inside_rms_w: left_out(cuts, &one_by_one, fit),
        outside_rms_w: left_out(cuts, &group_edge_cuts(cuts), fit),
    }
}

/// Schwarz's criterion of a fitted model, on the cuts that it was fitted on.
fn bic(model: &WearModel, cuts: &[Cut]) -> f64 {
    let count = cuts.len() as f64;
    let (sd, df) = match model {
        WearModel::Surface(it) => (it.residual_sd_w, it.degrees_of_freedom),
        WearModel::Physical(it) => (it.residual_sd_w, it.degrees_of_freedom),
    };
    let mean_square = (sd * sd * df / count).max(f64::MIN_POSITIVE);
    count * mean_square.ln() + (count - df) * count.ln()
}

/// The cuts at each end of each factor that has more than two values.
fn group_edge_cuts(cuts: &[Cut]) -> Vec<Vec<usize>> {
    let range = Range::from_cuts(cuts);
    let at_end = |factor: usize, end: f64| {
        let near = |cut: &Cut| (cut.conditions.to_vector()[factor] - end).abs() <= 0.02 * range.width(factor);
        (0..cuts.len()).filter(|at| near(&cuts[*at])).collect::<Vec<usize>>()
    };
    let between = |factor: &usize| {
        let ends = at_end(*factor, range.least[*factor]).len() + at_end(*factor, range.greatest[*factor]).len();
        range.is_varied(*factor) && ends < cuts.len()
    };
    let varied = (0..FACTORS.len()).filter(between);
    varied.flat_map(|factor| [at_end(factor, range.least[factor]), at_end(factor, range.greatest[factor])]).collect()
}

/// Root mean square error over the groups, each predicted by a fit of the cuts outside it; `None` where no fit was possible
/// for more than a tenth of them.
fn left_out(cuts: &[Cut], groups: &[Vec<usize>], fit: FitFunction<'_>) -> Option<f64> {
    let (mut squares, mut count, mut failed) = (0.0, 0, 0);
    for group in groups {
        let rest: Vec<Cut> = (0..cuts.len()).filter(|at| !group.contains(at)).map(|at| cuts[at]).collect();
        let Some(model) = fit(&rest) else {
            failed += 1;
            continue;
        };
        let error = |at: &usize| model.predict_power(&cuts[*at].conditions).power_w - cuts[*at].cutting_power_w;
        squares += group.iter().map(|at| error(at).powi(2)).sum::<f64>();
        count += group.len();
    }
    (count > 0 && failed * 10 <= groups.len()).then(|| (squares / count as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::super::conditions::CutConditions;
    use super::super::design::{FactorLevels, plan_experiment};
    use super::super::orthogonal_array::Array;
    use super::*;

    /// Kienzle with an edge force and a worn flank: neither form exactly.
    fn cuts() -> Vec<Cut> {
        let levels = [vec![0.065, 0.195, 0.325], vec![90.0, 120.0, 150.0], vec![0.1, 0.15, 0.2], vec![0.75, 1.0, 1.25]];
        let factors: Vec<FactorLevels> =
            FACTORS.iter().zip(levels).map(|(factor, values)| FactorLevels { factor, values }).collect();
        let design = plan_experiment(Array::L27, &factors, 1).expect("a design");
        let cut = |(index, values): (usize, &Vec<f64>)| {
            let [wear, speed, feed, depth] = [values[0], values[1], values[2], values[3]];
            let force_n = (1700.0 * feed.powf(0.74) * (speed / 150.0).powf(-0.08) + 22.0 + 300.0 * wear) * depth;
            let noise = [8.0, -11.0, 3.0, -5.0, 9.0, -4.0, 0.5][index % 7];
            Cut {
                conditions: CutConditions::from_vector([wear, speed, feed, depth]),
                cutting_power_w: force_n * speed / 60.0 + noise,
            }
        };
        design.cuts.iter().map(|it| &it.values).enumerate().map(cut).collect()
    }

    #[test]
    fn the_physical_form_extrapolates_better() {
        let comparison = compare_forms(&cuts(), &SurfaceOptions::default());
        let outside = comparison.forms.clone().map(|form| form.outside_rms_w.expect("fitted"));
        let inside = comparison.forms.clone().map(|form| form.inside_rms_w.expect("fitted"));
        assert!(outside[1] < 0.5 * outside[0], "{comparison:?}");
        assert!(inside[1] < 15.0, "{comparison:?}");
        assert_eq!(comparison.recommended, "physical");
    }
}
