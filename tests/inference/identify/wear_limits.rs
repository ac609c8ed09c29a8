//! Limits on the published surface: which form is taken for cuts made from it, and at how many of the nine reference cuts there is a
//! limit, of one part and pooled over parts.

use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;
use rules::estimators::wear::{
    Array, Coding, Cut, CutConditions, FACTORS, FactorLevels, WearOptions, identify_tool_wear, plan_experiment,
    published_over,
};

/// Scatter of single cuts about the published surface, W.
const RESIDUAL_W: f64 = 37.6;
const FITS: u64 = 20;

fn cuts(seed: u64) -> Vec<Cut> {
    let surface = published_over(Coding { centre: [0.195, 120.0, 0.15, 1.0], half: [0.13, 30.0, 0.05, 0.25] });
    let levels = [vec![0.065, 0.195, 0.325], vec![90.0, 120.0, 150.0], vec![0.1, 0.15, 0.2], vec![0.75, 1.0, 1.25]];
    let factors: Vec<FactorLevels> =
        FACTORS.iter().zip(levels).map(|(factor, values)| FactorLevels { factor, values }).collect();
    let design = plan_experiment(Array::L27, &factors, 1).expect("a design");
    let noise = Normal::new(0.0, RESIDUAL_W).expect("a deviation");
    let mut dice = Pcg64Mcg::seed_from_u64(seed);
    let mut cut = |values: &Vec<f64>| {
        let conditions = CutConditions::from_vector([values[0], values[1], values[2], values[3]]);
        Cut { conditions, cutting_power_w: surface.predict_power(&conditions).power_w + noise.sample(&mut dice) }
    };
    design.cuts.iter().map(|planned| cut(&planned.values)).collect()
}

#[test]
fn pooling_parts_gives_limits_where_one_part_gives_none() {
    let (mut surfaces, mut single, mut pooled) = (0, Vec::new(), Vec::new());
    for seed in 1..=FITS {
        let learned = identify_tool_wear(cuts(seed), &WearOptions::default()).expect("learned");
        surfaces += u32::from(learned.model.form() == "surface");
        let count = |of: &dyn Fn(u32) -> bool| {
            learned.places.iter().filter(|place| place.threshold.parts_to_observe.is_some_and(of)).count()
        };
        single.push(count(&|parts| parts == 1));
        pooled.push(count(&|_| true));
    }
    single.sort_unstable();
    pooled.sort_unstable();
    println!(
        "{FITS} fits of 27 cuts made from the published surface: the surface is taken {surfaces} times; of 9 reference cuts {} \
         (median) have a limit from one part, {} ({} to {}) over parts",
        single[single.len() / 2],
        pooled[pooled.len() / 2],
        pooled[0],
        pooled[pooled.len() - 1]
    );
    assert!(surfaces >= 15, "{surfaces}");
    assert!(pooled[pooled.len() / 2] > single[single.len() / 2]);
}
