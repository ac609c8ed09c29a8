//! Does the interval of the cutting power, from settings as they are written, hold the truth?

use super::cuts::SteadyPoint;
use super::load_loss::of_stage;
use super::reference::PowerReference;
use crate::regression::SteadyLevel;
use crate::{LoadLossDoubt, LoadLossLaw};
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

const TRUTH: LoadLossLaw = LoadLossLaw { linear: 0.11, quadratic_per_w: 6e-5, speed_rpm: Some(800.0) };
const CUTS_W: [f64; 10] = [450.0, 800.0, 1200.0, 1700.0, 2300.0, 450.0, 800.0, 1200.0, 1700.0, 2300.0];
const NO_LOAD_W: f64 = 430.0;

fn point(at_s: f64, speed_rpm: f64, power_w: f64, cutting_power_w: f64, cut: bool) -> SteadyPoint {
    let level = SteadyLevel {
        mean: power_w,
        standard_error: 1.0,
        sd: 5.0,
        independent: 25.0,
        slope_per_s: 0.0,
        slope_standard_error: 0.1,
    };
    SteadyPoint { stage: 1, speed_rpm, at_s, power: level, cutting_power_w, cut }
}

/// Ten cuts with idling before each, by a torque sensor that scatters by 0.5 % and a meter that scatters by 2 W and 0.4 %.
fn commission(seed: u64, speeds_rpm: &[f64]) -> (LoadLossLaw, LoadLossDoubt) {
    let mut dice = Pcg64Mcg::seed_from_u64(seed);
    let mut normal = || dice.sample::<f64, _>(StandardNormal);
    let mut points = Vec::new();
    for speed_rpm in speeds_rpm {
        for (at, cut_w) in CUTS_W.into_iter().enumerate() {
            let loss_w = (TRUTH.linear + TRUTH.quadratic_at(*speed_rpm) * cut_w) * cut_w;
            let power_w = NO_LOAD_W + (cut_w + loss_w) * (1.0 + 0.004 * normal()) + 2.0 * normal();
            points.push(point(20.0 * at as f64, *speed_rpm, NO_LOAD_W + 2.0 * normal(), 0.0, false));
            points.push(point(20.0 * at as f64 + 10.0, *speed_rpm, power_w, cut_w * (1.0 + 0.005 * normal()), true));
        }
    }
    let learned = of_stage(&points.iter().collect::<Vec<_>>(), PowerReference::Torque).expect("coefficients");
    (learned.load_loss(), learned.doubt)
}

/// Share of commissionings in whose 95 % interval a cut lies, by cutting power: not by a0 alone.
fn cover(commissionings: u64, speeds_rpm: &[f64]) {
    let learned: Vec<_> = (1..=commissionings).map(|seed| commission(seed, speeds_rpm)).collect();
    for cut_w in [300.0, 1000.0, 2000.0, 5000.0] {
        let speed_rpm = speeds_rpm[0];
        let excess_w = (1.0 + TRUTH.linear + TRUTH.quadratic_at(speed_rpm) * cut_w) * cut_w;
        let inside = |of: &(f64, bool)| of.1;
        let told: Vec<(f64, bool)> = learned
            .iter()
            .filter_map(|(law, doubt)| {
                let split = law.split_excess_power(excess_w, speed_rpm)?;
                let half_w = 1.96 * doubt.cutting_sd_w(law, &split, speed_rpm);
                Some((half_w, (split.cutting_power_w - cut_w).abs() <= half_w))
            })
            .collect();
        let share = told.iter().filter(|it| inside(it)).count() as f64 / commissionings as f64;
        let width_w = told.iter().map(|it| it.0).sum::<f64>() / commissionings as f64;
        println!(
            "{cut_w} W, {} speeds: {:.1} % of {commissionings} inside +-{width_w:.1} W",
            speeds_rpm.len(),
            100.0 * share
        );
        // Heavier cuts than those that were made are told, not promised.
        let made = cut_w <= CUTS_W[4];
        assert!(!made || (0.90..=0.995).contains(&share), "{cut_w} W: {share}");
    }
}

#[test]
fn the_interval_of_a_commissioned_drive_holds_the_truth_at_every_cutting_power() {
    cover(300, &[800.0]);
}

#[test]
#[ignore = "1 minute: coverage of the cutting power after commissioning, 2 x 2000 repetitions"]
fn the_interval_of_a_commissioned_drive_holds_the_truth_2000_times() {
    cover(2000, &[800.0]);
    cover(2000, &[500.0, 800.0, 1200.0]);
}
