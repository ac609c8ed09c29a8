//! Power separation.

use crate::identify::machine::{Recorded, cut, idle, lathe, record};
use crate::identify::{Coverage, LONG, SHORT};
use adapters::Recording;
use adapters::recording::{Cells, Numbers};
use adapters::simulated::{ExperimentCut, ExperimentStep, Truth};
use gateway::diagnosis::execute;
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use rules::estimators::power_separation::{ReferenceChoice, identify_load_loss, identify_no_load};
use rules::estimators::regression::RefusalKind;
use rules::script::{ScriptFile, compile_scripts};
use std::f64::consts::TAU;
use testkit::command::gateway;

#[test]
fn no_load_powers_are_found_and_written_as_a_script_can_say_them() {
    let ladder = [300.0, 600.0, 900.0].map(|rpm| idle(40.0, rpm, 1));
    let recorded = record(lathe(1), &ladder, 5.0);
    let directory = tempfile::tempdir().expect("a directory");
    std::fs::write(directory.path().join("idle.csv"), execute::format_csv(&recorded.recording)).expect("written");
    let arguments = ["identify", "no-load", "--recording", "idle.csv", "--json", "--out", "no_load.rhai"];
    let told = gateway(directory.path(), &arguments);
    assert_eq!(told.status.code(), Some(0), "{}", String::from_utf8_lossy(&told.stderr));
    let json: serde_json::Value = serde_json::from_slice(&told.stdout).expect("JSON");
    let speeds = json["learned"]["speeds"].as_array().expect("speeds");
    assert_eq!(speeds.len(), 3, "{json:#}");
    let text = std::fs::read_to_string(directory.path().join("no_load.rhai")).expect("written");
    let set = compile_scripts(&[ScriptFile { name: "no_load.rhai".to_owned(), text }]).expect("a script of settings");
    assert_eq!(set.len(), 1);
}

#[test]
fn a_recording_without_idling_is_refused() {
    let mut recording = record(lathe(1), &[idle(40.0, 600.0, 1)], 5.0).recording;
    let rows = recording.count_rows();
    recording.set_column("feed_mm_min", Cells::Numbers(Numbers::from_values(vec![120.0; rows])));
    let refusal = identify_no_load(&recording).expect_err("never idle");
    assert!(refusal.to_string().contains("let the spindle turn"), "{refusal}");
}

#[test]
fn a_refusal_is_told_as_one_and_ends_with_1() {
    let recording = record(lathe(1), &[idle(40.0, 600.0, 1)], 5.0).recording;
    let directory = tempfile::tempdir().expect("a directory");
    std::fs::write(directory.path().join("idle.csv"), execute::format_csv(&recording)).expect("written");
    let arguments = ["identify", "load-loss", "--recording", "idle.csv", "--json", "--out", "never.rhai"];
    let told = gateway(directory.path(), &arguments);
    assert_eq!(told.status.code(), Some(1), "{}", String::from_utf8_lossy(&told.stderr));
    let json: serde_json::Value = serde_json::from_slice(&told.stdout).expect("JSON");
    assert_eq!(json["refused"]["kind"], "not_identifiable", "{json:#}");
    assert!(json["learned"].is_null() && !directory.path().join("never.rhai").exists());
    let missing = gateway(directory.path(), &["identify", "no-load", "--recording", "no_such.csv"]);
    assert_eq!(missing.status.code(), Some(2));
}

#[test]
fn power_that_is_none_gives_no_numbers() {
    let whole = record(lathe(1), &[idle(40.0, 600.0, 1)], 5.0).recording;
    for factor in [0.0, -1.0, 1e-3, 1e9] {
        let mut changed = whole.clone();
        let scaled =
            whole.find_numbers("spindle_power_w").expect("there").iter().map(|power| power.map(|it| it * factor));
        changed.set_column("spindle_power_w", Cells::Numbers(scaled.collect::<Numbers>()));
        let refusal = identify_no_load(&changed).expect_err("no power");
        println!("power times {factor}: {refusal}");
        assert!(!refusal.next.is_empty(), "{refusal}");
    }
}

#[test]
fn two_levels_at_one_speed_are_told_and_not_averaged() {
    let ladder: Vec<ExperimentStep> =
        [300.0, 600.0, 300.0, 600.0, 300.0, 600.0, 300.0, 900.0, 900.0].iter().map(|rpm| idle(40.0, *rpm, 1)).collect();
    let mut recording = record(lathe(1), &ladder, 5.0).recording;
    // From the middle on the other gear stage, and no column that says so.
    let half_s = 3.5 * 40.0;
    let columns = recording.find_numbers("spindle_power_w").expect("there").iter().zip(recording.time_s.iter());
    let powers = columns.map(|(power, time_s)| power.map(|it| if *time_s > half_s { 1.4 * it } else { it }));
    let powers = powers.collect::<Numbers>();
    recording.set_column("spindle_power_w", Cells::Numbers(powers));
    let learned = identify_no_load(&recording).expect("900 rpm is of one level");
    let speeds: Vec<f64> = learned.speeds.iter().map(|it| it.speed_rpm.round()).collect();
    assert!(!speeds.contains(&300.0) && speeds.contains(&900.0), "{speeds:?}");
    let told = learned.notes.iter().find(|note| note.contains("two levels at one speed")).expect("told");
    assert!(told.contains("300 rpm") && told.contains("gear_stage"), "{told}");
}

/// The level of one visit against the true mean over the same time.
fn levels(repetitions: u64) {
    let mut coverage = Coverage::new("level of one idle visit, W");
    for seed in 1..=repetitions {
        let recorded = record(lathe(seed), &[idle(40.0, 600.0, 1)], 5.0);
        let learned = identify_no_load(&recorded.recording).expect("idle");
        let visit = &learned.stretches[0];
        let truth = recorded.mean(visit.from_s, visit.to_s, |truth| truth.no_load_power_w);
        coverage.add(learned.speeds[0].interval_w, truth);
    }
    coverage.assert();
}

#[test]
fn the_level_of_a_visit_is_inside_its_interval() {
    levels(SHORT);
}

#[test]
#[ignore = "1 minute: coverage of the level of one visit of a speed, 200 repetitions"]
fn the_level_of_a_visit_is_inside_its_interval_200_times() {
    levels(LONG);
}

/// Speeds in an order that chance gives, three rounds of them, the spindle warm.
fn rounds(seed: u64) -> (Vec<ExperimentStep>, [f64; 4]) {
    let mut dice = Pcg64Mcg::seed_from_u64(seed);
    let speeds = [300.0, 500.0, 700.0, 900.0];
    let mut steps = vec![idle(900.0, 700.0, 1)];
    for _ in 0..3 {
        let mut order = speeds;
        (1..order.len()).rev().for_each(|at| order.swap(at, dice.random_range(0..=at)));
        steps.extend(order.map(|rpm| idle(30.0, rpm, 1)));
    }
    (steps, speeds)
}

/// What a visit of a speed takes on the mean of many machines that ran such rounds: the truth that an interval over visits
/// is about.
fn true_means(seeds: std::ops::Range<u64>) -> [f64; 4] {
    let mut sums = [(0.0, 0.0); 4];
    for seed in seeds {
        let (steps, speeds) = rounds(seed);
        let recorded = record(lathe(seed), &steps, 1.0);
        for (time_s, truth) in recorded.recording.time_s.iter().zip(&recorded.truth) {
            let settled = truth.transient_power_w.abs() < 1.0 && *time_s > 900.0;
            for (sum, speed) in sums.iter_mut().zip(speeds).filter(|_| settled) {
                if (truth.spindle_speed_rpm / speed - 1.0).abs() < 0.005 {
                    *sum = (sum.0 + truth.no_load_power_w, sum.1 + 1.0);
                }
            }
        }
    }
    sums.map(|(sum, count)| sum / count)
}

fn no_load(repetitions: u64) {
    let means = true_means(10_000..10_040);
    let mut coverages = [300, 500, 700, 900].map(|rpm| Coverage::new(format!("Pu({rpm}), W, over visits")));
    let mut widths = 0.0;
    for seed in 1..=repetitions {
        let (steps, speeds) = rounds(seed);
        let recorded = record(lathe(seed), &steps, 5.0);
        let learned = identify_no_load(&recorded.recording).expect("idle");
        for ((speed, truth), coverage) in speeds.into_iter().zip(means).zip(&mut coverages) {
            let found = learned.speeds.iter().find(|it| (it.speed_rpm / speed - 1.0).abs() < 0.01).expect("visited");
            coverage.add(found.interval_w, truth);
            widths += (found.interval_w.1 - found.interval_w.0) / found.power_w / 4.0;
        }
    }
    println!("mean width of the intervals {:.2} %", 100.0 * widths / repetitions as f64);
    coverages.iter().for_each(Coverage::assert);
}

#[test]
fn no_load_powers_are_inside_their_intervals() {
    no_load(SHORT);
}

#[test]
#[ignore = "1 minute: coverage of no-load powers, 200 repetitions"]
fn no_load_powers_are_inside_their_intervals_200_times() {
    no_load(LONG);
}

/// Cuts at five depths, twice each, in an order that chance gives, with idling between; what a torque sensor would show.
fn cuts(seed: u64, stage: u8, rpm: f64, depths_mm: [f64; 5]) -> Recorded {
    sensed(seed, stage, rpm, depths_mm, Sensor { offset_nm: 0.4, noise_nm: 0.05, sign: 1.0 })
}

/// A torque sensor: zero error, noise of mean zero about it, and whether it counts with the drive.
#[derive(Clone, Copy)]
pub(crate) struct Sensor {
    pub(crate) offset_nm: f64,
    pub(crate) noise_nm: f64,
    pub(crate) sign: f64,
}

fn sensed(seed: u64, stage: u8, rpm: f64, depths_mm: [f64; 5], sensor: Sensor) -> Recorded {
    let mut dice = Pcg64Mcg::seed_from_u64(seed);
    let mut depths: Vec<f64> = depths_mm.iter().chain(&depths_mm).copied().collect();
    (1..depths.len()).rev().for_each(|at| depths.swap(at, dice.random_range(0..=at)));
    let feed_mm_min = 0.2 * rpm;
    let pass = |depth_mm: f64| {
        let cut = cut(10.0, rpm, stage, ExperimentCut { feed_mm_min, depth_mm, diameter_mm: 60.0, onward: false });
        [idle(12.0, rpm, stage), cut]
    };
    let steps: Vec<ExperimentStep> = depths.into_iter().flat_map(pass).collect();
    with_torque(&mut dice, seed, &steps, sensor)
}

/// The steps on the lathe of this seed, with what the sensor shows.
pub(crate) fn with_torque(dice: &mut Pcg64Mcg, seed: u64, steps: &[ExperimentStep], sensor: Sensor) -> Recorded {
    let mut recorded = record(lathe(seed), steps, 5.0);
    let torque = |truth: &Truth| {
        let rad_s = truth.spindle_speed_rpm.abs() * TAU / 60.0;
        let noise: f64 = dice.sample(StandardNormal);
        let shown = |shape: f64| truth.cutting_power_w / rad_s * shape + sensor.offset_nm + sensor.noise_nm * noise;
        (rad_s > 1.0).then(|| sensor.sign * shown(1.0 + 0.01 * noise))
    };
    let torque = recorded.truth.iter().map(torque).collect::<Numbers>();
    recorded.recording.set_column("torque_nm", Cells::Numbers(torque));
    recorded
}

const DEPTHS: [f64; 5] = [0.5, 1.0, 1.6, 2.3, 3.0];

/// a0 and a1 that the simulated machine truly has at a speed: by its own loss in two cuts.
fn true_loss(recorded: &Recorded) -> (f64, f64) {
    let cuts = recorded.truth.iter().filter(|truth| truth.engaged > 0.99 && truth.cutting_power_w > 50.0);
    let shares: Vec<(f64, f64)> =
        cuts.map(|truth| (truth.cutting_power_w, truth.load_loss_w / truth.cutting_power_w)).collect();
    let light = shares.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0)).expect("cuts");
    let heavy = shares.iter().copied().max_by(|a, b| a.0.total_cmp(&b.0)).expect("cuts");
    let a1 = (heavy.1 - light.1) / (heavy.0 - light.0);
    (light.1 - a1 * light.0, a1)
}

fn load_loss(repetitions: u64) {
    let stages = [(1, 800.0), (2, 1500.0)];
    let mut coverages: Vec<Coverage> = Vec::new();
    for (stage, rpm) in stages {
        let mut of_stage = ["a0", "a1"].map(|name| Coverage::new(format!("{name}, stage {stage}, {rpm} rpm")));
        for seed in 1..=repetitions {
            let recorded = cuts(seed, stage, rpm, DEPTHS);
            let learned = identify_load_loss(&recorded.recording, &ReferenceChoice::default()).expect("coefficients");
            let found = &learned.stages[0];
            let (a0, a1) = true_loss(&recorded);
            assert!(found.stage == usize::from(stage) && (8..=12).contains(&found.cuts), "seed {seed}: {found:?}");
            of_stage[0].add(found.linear.interval, a0);
            of_stage[1].add(found.quadratic_per_w.interval, a1);
        }
        coverages.extend(of_stage);
    }
    coverages.iter().for_each(Coverage::assert);
}

#[test]
fn load_loss_is_inside_its_intervals() {
    load_loss(SHORT);
}

#[test]
#[ignore = "1 minute: coverage of load loss, 200 repetitions"]
fn load_loss_is_inside_its_intervals_200_times() {
    load_loss(LONG);
}

/// Noise of mean zero with and without an offset of the sensor: rectified row by row, it would pass for cutting power.
fn zero_mean_noise(repetitions: u64) {
    let sensors = [0.0, 0.6].into_iter().flat_map(|offset| [0.01, 0.05, 0.2, 0.5].map(|noise| (offset, noise)));
    let mut coverages = Vec::new();
    for (offset_nm, noise_nm) in sensors {
        let name = |what: &str| Coverage::new(format!("{what}, torque noise {noise_nm} N m, offset {offset_nm} N m"));
        let mut own = ["a0", "a1"].map(name);
        for seed in 1..=repetitions {
            let sign = if seed % 2 == 0 { 1.0 } else { -1.0 };
            let recorded = sensed(seed, 1, 800.0, DEPTHS, Sensor { offset_nm, noise_nm, sign });
            let learned = identify_load_loss(&recorded.recording, &ReferenceChoice::default()).expect("coefficients");
            let (a0, a1) = true_loss(&recorded);
            own[0].add(learned.stages[0].linear.interval, a0);
            own[1].add(learned.stages[0].quadratic_per_w.interval, a1);
        }
        coverages.extend(own);
    }
    coverages.iter().for_each(Coverage::assert_neither_narrow_nor_wide);
}

#[test]
fn noise_of_mean_zero_is_no_cutting_power() {
    let sensor = Sensor { offset_nm: 0.0, noise_nm: 0.5, sign: -1.0 };
    let learned = identify_load_loss(&sensed(1, 1, 800.0, DEPTHS, sensor).recording, &ReferenceChoice::default());
    let learned = learned.expect("coefficients");
    let idle = learned.points.iter().filter(|point| !point.cut);
    let mean = idle.clone().map(|point| point.cutting_power_w).sum::<f64>() / idle.count() as f64;
    assert!(mean.abs() < 1e-9, "rectified noise would show {} W: {mean}", 0.5 * 0.8 * 800.0 * TAU / 60.0);
    let accuracy = learned.stages[0].accuracy.as_ref().expect("enough cuts");
    println!("error of the cutting power per group: {accuracy:?}");
    assert!(
        accuracy.mean < 0.02 && accuracy.mean_fixed.iter().all(|fixed| *fixed > 2.0 * accuracy.mean),
        "{accuracy:?}"
    );
}

#[test]
#[ignore = "5 minutes: coverage of load loss under torque noise of mean zero, 8 sensors, 200 repetitions each"]
fn load_loss_is_inside_its_intervals_under_zero_mean_noise() {
    zero_mean_noise(LONG);
}

#[test]
fn load_loss_is_written_as_a_script_can_say_it_and_separates_what_it_was_learned_from() {
    let recorded = cuts(1, 1, 800.0, DEPTHS);
    let directory = tempfile::tempdir().expect("a directory");
    std::fs::write(directory.path().join("cuts.csv"), execute::format_csv(&recorded.recording)).expect("written");
    let arguments = ["identify", "load-loss", "--recording", "cuts.csv", "--out", "load_loss.rhai"];
    let told = gateway(directory.path(), &arguments);
    assert_eq!(told.status.code(), Some(0), "{}", String::from_utf8_lossy(&told.stderr));
    let said = String::from_utf8_lossy(&told.stdout);
    assert!(
        said.contains("a0 = ") && said.contains("known at 800 rpm only") && said.contains("two more speeds"),
        "{said}"
    );
    let text = std::fs::read_to_string(directory.path().join("load_loss.rhai")).expect("written");
    let set = compile_scripts(&[ScriptFile { name: "load_loss.rhai".to_owned(), text }]).expect("a script of settings");
    let loss = set.settings().load_loss(1);
    let learned = identify_load_loss(&recorded.recording, &ReferenceChoice::default()).expect("coefficients");
    assert!((loss.linear - learned.stages[0].linear.value).abs() < 1e-5);
    assert!((loss.quadratic_per_w - learned.stages[0].quadratic_per_w.value).abs() < 1e-9);
    assert_eq!(loss.speed_rpm, None, "nothing tells how it goes with the speed");
}

#[test]
fn load_loss_that_cannot_be_told_is_refused_and_the_reason_given() {
    let told = |recording: &Recording, choice: &ReferenceChoice| {
        identify_load_loss(recording, choice).expect_err("cannot be told")
    };
    let plain = ReferenceChoice::default();
    let narrow = told(&cuts(1, 1, 800.0, [1.9, 1.95, 2.0, 2.05, 2.1]).recording, &plain);
    assert!(narrow.kind == RefusalKind::Collinear && narrow.what.contains("a0 + a1 Pc"), "{narrow}");
    let whole = cuts(1, 1, 800.0, DEPTHS).recording;
    let elsewhere = ReferenceChoice { torque_column: "no_such_column".to_owned(), ..plain.clone() };
    let alone = told(&whole, &elsewhere);
    assert!(alone.kind == RefusalKind::NotIdentifiable && alone.what.contains("from power alone"), "{alone}");
    let with = |name: &str, factor: f64| {
        let mut changed = whole.clone();
        let scaled = whole.find_numbers(name).expect("there").iter().map(|value| value.map(|value| value * factor));
        changed.set_column(name, Cells::Numbers(scaled.collect::<Numbers>()));
        changed
    };
    assert_eq!(told(&with("spindle_power_w", 1e-3), &plain).kind, RefusalKind::Unit, "kW");
    assert_eq!(told(&with("torque_nm", 1e3), &plain).kind, RefusalKind::Unit, "N mm");
    assert!(told(&with("torque_nm", 3.0), &plain).what.contains("of the power above no-load power"));
    let nothing = told(&with("feed_mm_min", 0.0), &plain);
    assert_eq!(nothing.kind, RefusalKind::TooFew, "{nothing}");
}

#[test]
fn a_known_cutting_energy_serves_as_far_as_it_is_known() {
    let recording = cuts(1, 1, 800.0, DEPTHS).recording;
    let told = |sd: f64| {
        let choice = ReferenceChoice { torque_column: String::new(), specific_energy_j_mm3: Some((1.75, sd)) };
        identify_load_loss(&recording, &choice).map(|learned| learned.stages[0].linear.interval)
    };
    let (exact, rough) = (told(0.0).expect("coefficients"), told(0.2).expect("coefficients"));
    assert!(rough.1 - rough.0 > exact.1 - exact.0 + 0.3, "{exact:?} {rough:?}");
}
