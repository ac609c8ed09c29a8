//! Load loss over the spindle speed: which form of a1, and its coefficients, from cuts at three speeds.

use crate::identify::machine::{Recorded, cut, idle};
use crate::identify::power::{Sensor, with_torque};
use crate::identify::{Coverage, LONG, SHORT};
use adapters::recording::{Cells, Numbers};
use adapters::simulated::{ExperimentCut, ExperimentStep};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rules::estimators::power_separation::{ReferenceChoice, StageLearned, identify_load_loss};
use rules::script::{ScriptFile, compile_scripts};
use std::f64::consts::TAU;

const SPEEDS_RPM: [f64; 3] = [480.0, 640.0, 800.0];
const DEPTHS_MM: [f64; 5] = [0.5, 1.0, 1.4, 1.9, 2.3];

/// a0 and a1 of the low stage of the simulated lathe; its windings lose 0.86 W per (N m)^2, with the square of the torque.
const TRUE_LINEAR: f64 = 0.11;
fn true_quadratic_per_w(rpm: f64) -> f64 {
    0.86 / (rpm * TAU / 60.0).powi(2)
}

/// Five depths at each of three speeds, in an order that chance gives, with idling between; before them a warm-up at one of the speeds,
/// over which the no-load power falls by more than the cuts need to be told apart.
fn cuts(seed: u64) -> Recorded {
    let mut dice = Pcg64Mcg::seed_from_u64(seed);
    let mut passes: Vec<(f64, f64)> =
        SPEEDS_RPM.iter().flat_map(|rpm| DEPTHS_MM.iter().map(move |depth| (*rpm, *depth))).collect();
    (1..passes.len()).rev().for_each(|at| passes.swap(at, dice.random_range(0..=at)));
    let pass = |(rpm, depth_mm): (f64, f64)| {
        let work = ExperimentCut { feed_mm_min: 0.2 * rpm, depth_mm, diameter_mm: 80.0, onward: false };
        [idle(15.0, rpm, 1), cut(12.0, rpm, 1, work)]
    };
    let steps: Vec<ExperimentStep> =
        std::iter::once(idle(1200.0, 640.0, 1)).chain(passes.into_iter().flat_map(pass)).collect();
    with_torque(&mut dice, seed, &steps, Sensor { offset_nm: 0.4, noise_nm: 0.05, sign: 1.0 })
}

/// The same machine as if its drive lost `0.11 Pc + 1.5e-4 Pc^2` at every speed.
fn same_at_every_speed(mut recorded: Recorded) -> Recorded {
    let power = recorded.recording.find_numbers("spindle_power_w").expect("a meter");
    let other = power.iter().zip(&recorded.truth).map(|(power, truth)| {
        let cutting_w = truth.cutting_power_w;
        Some(power? - truth.load_loss_w + TRUE_LINEAR * cutting_w + 1.5e-4 * cutting_w * cutting_w)
    });
    let other = other.collect::<Numbers>();
    recorded.recording.set_column("spindle_power_w", Cells::Numbers(other));
    recorded
}

fn learned(recorded: &Recorded) -> StageLearned {
    let learned = identify_load_loss(&recorded.recording, &ReferenceChoice::default()).expect("coefficients");
    learned.stages.into_iter().next().expect("a stage")
}

fn over_speed(repetitions: u64) {
    let mut with_torque = ["a0, loss with the torque", "a1, loss with the torque"].map(Coverage::new);
    let mut same = ["a0, same at every speed", "a1, same at every speed"].map(Coverage::new);
    let mut wants_own = 0;
    for seed in 1..=repetitions {
        let recorded = cuts(seed);
        let found = learned(&recorded);
        let rpm = found.speed_rpm.unwrap_or_else(|| panic!("seed {seed}: {found:?}"));
        assert!((rpm / 640.0 - 1.0).abs() < 0.01, "the mean of the speeds: {rpm}");
        with_torque[0].add(found.linear.interval, TRUE_LINEAR);
        with_torque[1].add(found.quadratic_per_w.interval, true_quadratic_per_w(rpm));
        let accuracy = found.accuracy.as_ref().expect("enough cuts");
        assert!(accuracy.mean < 0.02 && accuracy.groups.len() >= 14, "seed {seed}: {accuracy:?}");
        wants_own += u64::from(found.by_speed.is_some_and(|test| test.p < 0.05));
        let found = learned(&same_at_every_speed(recorded));
        assert_eq!(found.speed_rpm, None, "seed {seed}: {found:?}");
        same[0].add(found.linear.interval, TRUE_LINEAR);
        same[1].add(found.quadratic_per_w.interval, 1.5e-4);
    }
    println!("the speeds want coefficients of their own in {wants_own} of {repetitions} (5 % by chance)");
    with_torque.iter().chain(&same).for_each(Coverage::assert);
}

#[test]
fn the_form_of_the_load_loss_over_speed_is_found_with_its_coefficients() {
    over_speed(SHORT);
}

#[test]
#[ignore = "3 minutes: coverage of load loss over three speeds under both laws, 200 repetitions"]
fn the_form_of_the_load_loss_over_speed_is_found_200_times() {
    over_speed(LONG);
}

#[test]
fn what_is_learned_over_speeds_is_said_and_separates_at_every_one_of_them() {
    let recorded = cuts(3);
    let told = identify_load_loss(&recorded.recording, &ReferenceChoice::default()).expect("coefficients");
    let (text, stage) = (told.to_string(), &told.stages[0]);
    assert!(text.contains("a1 over speed: (64") && text.contains("the same at every speed would leave"), "{text}");
    let left = stage.form_residuals.expect("three speeds");
    assert!(3.0 * left.with_torque_squared_w < left.same_at_every_speed_w, "{left:?}");
    let set = compile_scripts(&[ScriptFile { name: "load_loss.rhai".to_owned(), text: told.format_script() }])
        .expect("settings");
    let loss = set.settings().load_loss(1);
    for rpm in SPEEDS_RPM {
        let a1 = true_quadratic_per_w(rpm);
        let split =
            loss.split_excess_power(1200.0 * (1.0 + TRUE_LINEAR) + a1 * 1200.0 * 1200.0, rpm).expect("a real root");
        assert!((split.cutting_power_w / 1200.0 - 1.0).abs() < 0.015, "{rpm} rpm: {split:?}");
    }
}
