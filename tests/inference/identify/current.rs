//! The spindle current over feed.
//!
//! Twice: on three-phase currents sampled at 1 kHz whose amplitude follows a cubic, through filter and feature, where the
//! coefficients are known; and on the simulated lathe, whose current is no cubic (magnetising current at right angles to
//! that which makes torque), where the curve must hold the true current.

use crate::identify::machine::{cut, lathe, record};
use crate::identify::{Coverage, LONG, SHORT};
use adapters::Recording;
use adapters::recording::{Cells, Numbers};
use adapters::simulated::ExperimentCut;
use gateway::diagnosis::execute;
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use rules::estimators::regression::RefusalKind;
use rules::estimators::spindle_current::{
    FeatureKind, LowPassDesign, PhaseFeature, ThreePhase, WindowSpan, identify_feed_curve,
};
use rules::script::{Host, ScriptFile};
use std::f64::consts::TAU;
use testkit::command::gateway;

/// Coefficients of the amplitude over feed, A, at a depth of 1.2 mm: those of the publication.
const AMPLITUDE: [f64; 4] = [1.4612, 0.872, 0.4277, 0.0944];
const FEEDS: [f64; 8] = [0.4, 0.8, 1.2, 1.6, 2.0, 2.4, 2.8, 3.2];

/// A cut at one feed: 33 Hz with a fifth harmonic, hum of the inverter, an offset of the sensors, and an amplitude that
/// differs from cut to cut and wanders within one. Mean feature of each period, once per row.
fn currents(dice: &mut Pcg64Mcg, amplitude_a: f64, seconds: u32) -> Vec<f64> {
    let design = LowPassDesign::low_pass(350.0, 1000.0).expect("the filter of the source");
    let span = WindowSpan::Crossings { least_a: 0.2 };
    let phase = PhaseFeature::new(FeatureKind::MeanAbsolute, span, 4, 1000.0).expect("a feature");
    let mut three = ThreePhase::new(&design, phase);
    let of_this_cut = 1.0 + 0.004 * dice.sample::<f64, _>(StandardNormal);
    let (mut wander, mut found) = (0.0, Vec::new());
    for n in 0..seconds * 1000 {
        let kick: f64 = dice.sample(StandardNormal);
        wander = 0.998 * wander + 0.0632 * kick;
        let size = amplitude_a * of_this_cut * (1.0 + 0.01 * wander);
        let turn = 33.0 * f64::from(n) / 1000.0;
        let mut sample = |lag: f64| {
            let phase = TAU * (turn - lag);
            let noise: f64 = dice.sample(StandardNormal);
            size * (phase.sin() + 0.05 * (5.0 * phase).sin()) + 0.05 + 0.03 * noise
        };
        let samples = [sample(0.0), sample(1.0 / 3.0), sample(2.0 / 3.0)];
        found.extend(three.push(samples).map(|feature| feature.value));
    }
    found
}

/// Mean absolute value of the filtered wave of amplitude 1, by adding up many points of one period.
fn per_amplitude() -> f64 {
    let design = LowPassDesign::low_pass(350.0, 1000.0).expect("the filter of the source");
    let gain = |hz: f64| 10_f64.powf(design.gain_db(hz) / 20.0);
    let wave = |phase: f64| gain(33.0) * phase.sin() + 0.05 * gain(165.0) * (5.0 * phase).sin();
    (0..10_000).map(|k| wave(TAU * f64::from(k) / 10_000.0).abs()).sum::<f64>() / 10_000.0
}

/// A recording of cuts at every feed, twice, in an order that chance gives.
fn waveforms(seed: u64) -> Recording {
    let mut dice = Pcg64Mcg::seed_from_u64(seed);
    let mut feeds: Vec<f64> = FEEDS.iter().chain(&FEEDS).copied().collect();
    (1..feeds.len()).rev().for_each(|at| feeds.swap(at, dice.random_range(0..=at)));
    let (mut feed, mut feature) = (Vec::new(), Vec::new());
    for wanted in feeds {
        let amplitude_a = AMPLITUDE.iter().rev().fold(0.0, |sum, c| sum * wanted + c);
        let values = currents(&mut dice, amplitude_a, 6);
        feed.extend(std::iter::repeat_n(wanted, values.len()));
        feature.extend(values);
    }
    let rows = feed.len();
    let time_s = (0..rows).map(|row| row as f64 * 2.0 / 33.0).collect();
    let mut recording = Recording::new("currents", time_s, None);
    let constants = [("spindle_speed_rpm", 1000.0), ("depth_of_cut_mm", 1.2)];
    for (name, value) in constants {
        recording.set_column(name, Cells::Numbers(Numbers::from_values(vec![value; rows])));
    }
    recording.set_column("feed_per_rev_mm", Cells::Numbers(Numbers::from_values(feed)));
    recording.set_column("spindle_current_a", Cells::Numbers(Numbers::from_values(feature)));
    recording
}

fn coefficients(repetitions: u64) {
    let mut coverages: Vec<Coverage> =
        (0..4).map(|power| Coverage::new(format!("feed curve c{power}, three phases at 1 kHz"))).collect();
    let unit = per_amplitude();
    for seed in 1..=repetitions {
        let learned = identify_feed_curve(&waveforms(seed), "feed_per_rev_mm", "spindle_current_a").expect("a curve");
        let curve = &learned.curves[0];
        assert_eq!((curve.degree, curve.feeds), (3, 8), "seed {seed}");
        for (power, coverage) in coverages.iter_mut().enumerate() {
            coverage.add(curve.coefficients[power].interval, AMPLITUDE[power] * unit);
        }
    }
    coverages.iter().for_each(Coverage::assert);
}

#[test]
fn the_coefficients_of_a_cubic_are_inside_their_intervals() {
    coefficients(SHORT);
}

#[test]
#[ignore = "1 minute: coverage of the coefficients of the feed curve, 200 repetitions"]
fn the_coefficients_of_a_cubic_are_inside_their_intervals_200_times() {
    coefficients(LONG);
}

/// The lathe cuts at two depths and seven feeds, each twice.
fn turning(seed: u64) -> crate::identify::machine::Recorded {
    let mut dice = Pcg64Mcg::seed_from_u64(seed);
    let mut steps: Vec<(f64, f64)> = Vec::new();
    for depth_mm in [1.0, 2.0] {
        for feed_mm_min in [80.0, 110.0, 150.0, 200.0, 250.0, 300.0, 340.0] {
            steps.extend([(depth_mm, feed_mm_min); 2]);
        }
    }
    (1..steps.len()).rev().for_each(|at| steps.swap(at, dice.random_range(0..=at)));
    let step = |(depth_mm, feed_mm_min): (f64, f64)| {
        cut(8.0, 900.0, 1, ExperimentCut { feed_mm_min, depth_mm, diameter_mm: 60.0, onward: false })
    };
    let mut settings = lathe(seed);
    settings.wear_mm = 0.1;
    record(settings, &steps.into_iter().map(step).collect::<Vec<_>>(), 5.0)
}

/// Cuts at a feed that was left out of the identification, against the curve: two standard deviations of one cut.
fn left_out(repetitions: u64) {
    let mut coverage = Coverage::new("current of a cut at a feed left out, lathe");
    for seed in 1..=repetitions {
        let whole = turning(seed).recording;
        let is_out = |feed: f64| (feed / 150.0 - 1.0).abs() < 0.05;
        let feeds = whole.find_numbers("feed_mm_min").expect("recorded");
        let depths = whole.find_numbers("depth_of_cut_mm").expect("recorded").iter().zip(feeds.iter());
        let kept = depths.map(|(depth, feed)| depth.filter(|_| !feed.is_some_and(is_out))).collect::<Numbers>();
        let mut rest = whole.clone();
        rest.set_column("depth_of_cut_mm", Cells::Numbers(kept));
        let identify = |recording| identify_feed_curve(recording, "feed_mm_min", "spindle_current_a").expect("curves");
        let (learned, all) = (identify(&rest), identify(&whole));
        assert!(learned.plateaus.iter().all(|cut| !is_out(cut.feed)), "left out");
        for cut in all.plateaus.iter().filter(|cut| is_out(cut.feed)) {
            let curve = learned.curves.iter().find(|it| (it.depth_mm / cut.depth_mm - 1.0).abs() < 0.05).expect("both");
            let (value, half) = (curve.curve.evaluate_at(cut.feed), 2.0 * curve.sd);
            coverage.add((value - half, value + half), cut.level.mean);
        }
    }
    coverage.assert();
}

#[test]
fn a_cut_at_a_feed_left_out_lies_about_the_curve() {
    left_out(SHORT / 4);
}

#[test]
#[ignore = "1 minute: a feed that was left out lies about the feed curve, 200 repetitions"]
fn a_cut_at_a_feed_left_out_lies_about_the_curve_200_times() {
    left_out(LONG);
}

#[test]
fn the_lathe_gives_a_family_and_a_script_that_runs() {
    let recorded = turning(1);
    let directory = tempfile::tempdir().expect("a directory");
    std::fs::write(directory.path().join("cuts.csv"), execute::format_csv(&recorded.recording)).expect("written");
    let arguments = ["identify", "feed-curve", "--recording", "cuts.csv", "--json", "--out", "load.rhai"];
    let told = gateway(directory.path(), &arguments);
    assert_eq!(told.status.code(), Some(0), "{}", String::from_utf8_lossy(&told.stderr));
    let json: serde_json::Value = serde_json::from_slice(&told.stdout).expect("JSON");
    assert_eq!(json["learned"]["curves"].as_array().map(Vec::len), Some(2), "{json:#}");
    let text = std::fs::read_to_string(directory.path().join("load.rhai")).expect("written");
    Host::new().load_scripts(&[ScriptFile { name: "load.rhai".to_owned(), text }]).expect("a script that compiles");
    // What the script holds is said with the one who chose it.
    let told = |more: &[&str]| {
        let told = gateway(directory.path(), &[&["identify", "feed-curve", "--recording", "cuts.csv"], more].concat());
        String::from_utf8_lossy(&told.stdout).into_owned()
    };
    assert!(told(&[]).contains("the mean of these cuts"), "{}", told(&[]));
    let given = told(&["--target", "7.5", "--out", "given.rhai"]);
    assert!(given.contains("7.5 A, as given"), "{given}");
    let text = std::fs::read_to_string(directory.path().join("given.rhai")).expect("written");
    assert!(text.contains("setting(\"target_a\", 7.5,"), "{text}");
    let learned = identify_feed_curve(&recorded.recording, "feed_mm_min", "spindle_current_a").expect("curves");
    let family = learned.build_family(900.0).expect("two curves that do not cross");
    let truth = |at_s: f64| recorded.mean(at_s - 1.0, at_s + 1.0, |truth| truth.spindle_power_w);
    let cut = &learned.plateaus[0];
    let depth = family.infer_depth(cut.feed, cut.level.mean, cut.level.standard_error).expect("in the family");
    assert!(truth(0.5 * (cut.from_s + cut.to_s)) > 500.0, "in the cut");
    assert!((depth.depth_mm - cut.depth_mm).abs() < 3.0 * depth.sd_mm && depth.sd_mm < 0.1, "{depth:?} {cut:?}");
}

#[test]
fn what_makes_no_curve_is_refused() {
    let told = |recording: &Recording| {
        identify_feed_curve(recording, "feed_per_rev_mm", "spindle_current_a").expect_err("no curve")
    };
    let whole = waveforms(1);
    let with = |name: &str, of: &dyn Fn(f64) -> f64| {
        let mut changed = whole.clone();
        let numbers = whole.find_numbers(name).expect("there").iter().map(|value| value.map(of)).collect::<Numbers>();
        changed.set_column(name, Cells::Numbers(numbers));
        changed
    };
    let few = told(&with("feed_per_rev_mm", &|feed| if feed > 1.7 { 3.0 } else { 0.4 }));
    assert!(few.kind == RefusalKind::TooFew && few.what.contains("different feeds"), "{few}");
    let none = told(&with("depth_of_cut_mm", &|_| 0.0));
    assert_eq!(none.kind, RefusalKind::TooFew);
    let milliamperes = told(&with("spindle_current_a", &|current| current * 1e3 + 2000.0));
    assert!(milliamperes.what.contains("looks like mA"), "{milliamperes}");
    let mut without = Recording::new("empty", whole.time_s.clone(), None);
    without.set_column("spindle_speed_rpm", Cells::Numbers(Numbers::from_values(vec![1000.0; whole.count_rows()])));
    assert_eq!(told(&without).kind, RefusalKind::Missing);
}
