//! The physical form comes back from its own values, and covers them.

use super::super::coding::Coding;
use super::super::surface::published_over;
use super::*;
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;

fn true_power_w(conditions: &CutConditions) -> f64 {
    let [wear, speed, feed, depth] = conditions.to_vector();
    16.0 * speed.powf(0.85) * feed.powf(0.75) * depth + 5.2 * wear * speed * depth
}

/// The 27 points of the design.
fn list_design_points() -> Vec<CutConditions> {
    let levels = [[0.0, 0.15, 0.3], [90.0, 120.0, 150.0], [0.1, 0.15, 0.2], [0.75, 1.0, 1.25]];
    let runs = super::super::orthogonal_array::Array::L27.list_runs();
    let at = |run: &Vec<u8>| [run[0], run[1], run[4], run[8]].map(usize::from);
    runs.iter()
        .map(|run| CutConditions::from_vector(std::array::from_fn(|factor| levels[factor][at(run)[factor]])))
        .collect()
}

fn simulate_cuts(sd_w: f64, seed: u64) -> Vec<Cut> {
    let (mut rng, noise) = (Pcg64Mcg::seed_from_u64(seed), Normal::new(0.0, sd_w.max(1e-12)).expect("a distribution"));
    let cut = |conditions: CutConditions| Cut {
        conditions,
        cutting_power_w: true_power_w(&conditions) + noise.sample(&mut rng),
    };
    list_design_points().into_iter().map(cut).collect()
}

#[test]
fn the_five_numbers_come_back() {
    let found = fit_physical(&simulate_cuts(0.0, 1), &[]).expect("a fit").physical;
    for (exponent, expected) in found.exponents.iter().zip([0.85, 0.75, 1.0]) {
        assert!((exponent - expected).abs() < 1e-6, "{found:?}");
    }
    assert!((found.wear_w_min_m_mm2 - 5.2).abs() < 1e-6);
    let reference = CutConditions::from_vector([0.0, found.reference[0], found.reference[1], found.reference[2]]);
    assert!((found.cutting_power_w - true_power_w(&reference)).abs() < 1e-5);
}

#[test]
fn intervals_cover_the_truth_about_as_often_as_they_say() {
    let truths = [f64::NAN, 0.85, 0.75, 1.0, 5.2];
    let mut covered = [0; 5];
    for seed in 0..200 {
        let found = fit_physical(&simulate_cuts(25.0, seed), &[]).expect("a fit");
        for (at, one) in found.coefficients.iter().enumerate() {
            covered[at] += usize::from(one.interval.0 <= truths[at] && truths[at] <= one.interval.1);
        }
    }
    assert!(covered[1..].iter().all(|count| (182..=200).contains(count)), "{covered:?} of 200");
}

#[test]
fn far_outside_it_stays_sensible_where_the_surface_does_not() {
    let physical = fit_physical(&simulate_cuts(10.0, 3), &[]).expect("a fit").physical;
    let surface =
        super::super::fit_surface::fit_surface(&simulate_cuts(10.0, 3), &Default::default()).expect("a fit").surface;
    let far = [[0.3, 60.0, 0.05, 0.4], [0.3, 220.0, 0.3, 2.0], [0.1, 60.0, 0.3, 2.0], [0.1, 220.0, 0.05, 0.4]]
        .map(CutConditions::from_vector);
    let rms = |power_w: &dyn Fn(&CutConditions) -> f64| {
        (far.iter().map(|it| (power_w(it) / true_power_w(it) - 1.0).powi(2)).sum::<f64>() / far.len() as f64).sqrt()
    };
    let (physical, surface) = (rms(&|it| physical.power_w(it)), rms(&|it| surface.predict_power(it).power_w));
    assert!(physical < 0.1 && surface > 3.0 * physical, "{physical} {surface}");
}

#[test]
fn the_published_surface_fits_within_its_own_scatter_and_half() {
    let surface = published_over(Coding { centre: [0.195, 120.0, 0.15, 1.0], half: [0.13, 30.0, 0.05, 0.25] });
    let cuts: Vec<Cut> = super::super::orthogonal_array::Array::L27
        .list_runs()
        .iter()
        .map(|run| [run[0], run[1], run[4], run[8]].map(|level| f64::from(level) - 1.0))
        .map(|coded| {
            let conditions = surface.coding.decode_conditions(coded);
            Cut { conditions, cutting_power_w: surface.power_at(&coded) }
        })
        .collect();
    let found = fit_physical(&cuts, &[]).expect("a fit").physical;
    assert!((35.0..60.0).contains(&found.residual_sd_w), "{found:?}");
    let slope = found.wear_slope_w_per_mm(&surface.coding.decode_conditions([0.0; 4]));
    assert!((500.0..700.0).contains(&slope), "{slope}");
}

#[test]
fn a_held_factor_keeps_the_exponent_one_and_what_cannot_be_fitted_is_refused() {
    let mut same = simulate_cuts(5.0, 4);
    same.iter_mut().for_each(|cut| {
        cut.conditions.cutting_speed_m_min = 120.0;
        cut.cutting_power_w = true_power_w(&cut.conditions);
    });
    let told = fit_physical(&same, &[]).expect_err("constant").to_string();
    assert!(told.contains("cutting_speed_m_min is the same") && told.contains("--held"), "{told}");
    let found = fit_physical(&same, &["cutting_speed_m_min".to_owned()]).expect("a fit");
    assert_eq!((found.physical.exponents[0], found.coefficients.len()), (1.0, 4));
    assert!((found.physical.exponents[1] - 0.75).abs() < 1e-6);
    let mut sharp = simulate_cuts(5.0, 5);
    sharp.iter_mut().for_each(|cut| cut.conditions.flank_wear_mm = 0.1);
    assert!(fit_physical(&sharp, &["flank_wear_mm".to_owned()]).is_err());
    assert!(fit_physical(&simulate_cuts(5.0, 6)[..4], &[]).is_err());
}
