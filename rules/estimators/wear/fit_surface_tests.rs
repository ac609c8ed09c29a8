//! Surfaces come back from their own values, and what cannot be fitted is refused.

use super::super::conditions::CutConditions;
use super::super::design::{FactorLevels, plan_experiment};
use super::super::orthogonal_array::Array;
use super::super::surface::published_over;
use super::*;

const NOISE: [f64; 9] = [21.0, -33.0, 12.0, 40.0, -27.0, -8.0, 15.0, -36.0, 16.0];

fn build_coding() -> Coding {
    Coding { centre: [0.195, 120.0, 0.15, 1.0], half: [0.13, 30.0, 0.05, 0.25] }
}

/// The published surface at the 27 points of the design, with noise of this size.
pub(super) fn simulate_cuts(noise: f64) -> Vec<Cut> {
    let levels = [vec![0.065, 0.195, 0.325], vec![90.0, 120.0, 150.0], vec![0.1, 0.15, 0.2], vec![0.75, 1.0, 1.25]];
    let factors: Vec<FactorLevels> =
        FACTORS.iter().zip(levels).map(|(factor, values)| FactorLevels { factor, values }).collect();
    let surface = published_over(build_coding());
    let cut = |(index, values): (usize, &Vec<f64>)| {
        let conditions = CutConditions::from_vector([values[0], values[1], values[2], values[3]]);
        let cutting_power_w = surface.predict_power(&conditions).power_w + noise * NOISE[index % NOISE.len()];
        Cut { conditions, cutting_power_w }
    };
    let design = plan_experiment(Array::L27, &factors, 1).expect("a design");
    design.cuts.iter().map(|it| &it.values).enumerate().map(cut).collect()
}

#[test]
fn the_published_surface_comes_back_with_its_eight_terms() {
    let found = fit_surface(&simulate_cuts(1e-6), &SurfaceOptions::default()).expect("a fit");
    let names: Vec<&str> = found.regression.coefficients.iter().skip(1).map(|it| it.name.as_str()).collect();
    assert_eq!(names, ["VB", "vc", "f", "ap", "VB*vc", "VB*f", "vc*ap", "f*ap"]);
    let values = [1035.63, 83.5, 235.03, 246.36, 262.54, 37.02, -34.87, 62.14, 47.28];
    for (found, expected) in found.surface.coefficients_w.iter().zip(values) {
        assert!((found - expected).abs() < 1e-3, "{found} {expected}");
    }
    assert_eq!(found.dropped.len(), 6);
}

#[test]
fn the_table_adds_up() {
    let found = fit_surface(&simulate_cuts(1.0), &SurfaceOptions::default()).expect("a fit");
    let row = |name: &str| found.anova.sources.iter().find(|it| it.source == name).expect("a row");
    let (model, residual, total) = (row("model"), row("residual"), row("total"));
    assert!(
        (model.sum_of_squares + residual.sum_of_squares - total.sum_of_squares).abs() < 1e-6 * total.sum_of_squares
    );
    assert_eq!(total.degrees_of_freedom, 26.0);
    assert!((found.anova.r2 - model.sum_of_squares / total.sum_of_squares).abs() < 1e-9);
    assert!(
        found.anova.adjusted_r2 < found.anova.r2 && found.anova.predicted_r2.expect("known") < found.anova.adjusted_r2
    );
    assert!(model.f.is_some_and(|f| f > 100.0) && model.p.is_some_and(|p| p < 1e-6));
}

#[test]
fn hierarchy_keeps_the_parents_of_a_product() {
    let mut cuts = simulate_cuts(1.0);
    // Without the wear alone, only with it in products.
    for cut in &mut cuts {
        let [a, ..] = build_coding().encode_conditions(&cut.conditions);
        cut.cutting_power_w -= 83.5 * a;
    }
    let keeps = |hierarchical| {
        let options = SurfaceOptions { hierarchical, ..SurfaceOptions::default() };
        let found = fit_surface(&cuts, &options).expect("a fit");
        found.regression.coefficients.iter().any(|it| it.name == "VB")
    };
    assert!(keeps(true) && !keeps(false));
}

#[test]
fn repeated_cuts_show_what_the_surface_misses() {
    let mut cuts = simulate_cuts(0.3);
    let again: Vec<Cut> =
        cuts[..6].iter().map(|cut| Cut { cutting_power_w: cut.cutting_power_w + 4.0, ..*cut }).collect();
    cuts.extend(again);
    let found =
        fit_surface(&cuts, &SurfaceOptions { order: Order::Linear, ..SurfaceOptions::default() }).expect("a fit");
    let lack = found.anova.sources.iter().find(|it| it.source == "lack of fit").expect("repeats");
    assert!(lack.p.is_some_and(|p| p < 1e-6), "{lack:?}");
}

#[test]
fn what_cannot_be_fitted_is_refused_with_what_is_needed() {
    let told = |cuts: &[Cut]| fit_surface(cuts, &SurfaceOptions::default()).expect_err("refused").to_string();
    let all = simulate_cuts(1.0);
    let changed = |change: fn(&mut Cut)| {
        let mut cuts = all.clone();
        cuts.iter_mut().for_each(change);
        told(&cuts)
    };
    for (told, part) in [
        (told(&all[..9]), "needs more cuts"),
        (told(&[]), "is the same in every cut"),
        (changed(|cut| cut.conditions.depth_of_cut_mm = 1.0), "depth_of_cut_mm is the same in every cut"),
        (changed(|cut| cut.cutting_power_w /= 1000.0), "kW"),
        (changed(|cut| cut.conditions.flank_wear_mm *= 1000.0), "is it in um?"),
        (changed(|cut| cut.cutting_power_w = f64::NAN), "no power that removes material"),
        (changed(|cut| cut.cutting_power_w = 0.0), "no power that removes material"),
        (changed(|cut| cut.conditions.feed_per_rev_mm = f64::INFINITY), "is outside"),
        (
            changed(|cut| cut.conditions.depth_of_cut_mm = cut.conditions.feed_per_rev_mm * 6.0),
            "cannot tell them apart",
        ),
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
}
