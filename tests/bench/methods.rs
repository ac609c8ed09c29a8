//! `cargo bench --bench methods`: nanoseconds and allocations of the methods that run at every sample or tick. An
//! allocation in any of them ends the run with a failure.

mod ffi;

use adapters::clock::SECOND_NS;
use adapters::{ChannelId, Sample, Slot, Value};
use rules::estimators::spindle_current::{
    Cubic, CurveAtDepth, Design, Family, FeatureKind, PhaseFeature, Span, ThreePhase,
};
use rules::estimators::thermal::{Path, Predictor, Term, ThermalLaw};
use rules::estimators::{Pipeline, Settings, balance};
use std::f64::consts::TAU;
use std::hint::black_box;
use std::time::Instant;

#[global_allocator]
static COUNTING: ffi::Counting = ffi::Counting;

/// Runs of a method; the median counts.
const RUNS: usize = 15;

/// Times one step of a method over so many steps, after as many to warm up, and prints a line.
fn measure(name: &str, steps: u64, mut step: impl FnMut(u64)) {
    (0..steps).for_each(&mut step);
    let mut nanoseconds = [0.0; RUNS];
    let before = ffi::allocations();
    for (run, slot) in nanoseconds.iter_mut().enumerate() {
        let first = steps * (run as u64 + 1);
        let begun = Instant::now();
        (first..first + steps).for_each(&mut step);
        *slot = begun.elapsed().as_secs_f64() * 1e9 / steps as f64;
    }
    let allocations = ffi::allocations() - before;
    nanoseconds.sort_by(f64::total_cmp);
    println!(
        "{name:<58} {:>9.1} ns {:>9.1} to {:>9.1} ns   {allocations} allocations in {} steps",
        nanoseconds[RUNS / 2],
        nanoseconds[0],
        nanoseconds[RUNS - 1],
        steps * RUNS as u64
    );
    assert_eq!(allocations, 0, "{name} allocates");
}

fn main() {
    // `cargo test` runs benchmarks too, without this argument: then only that it runs, and allocates nothing, counts.
    let steps = if std::env::args().any(|argument| argument == "--bench") { 200_000 } else { 2_000 };
    println!("{:<58} {:>12} {:>25}", "method, one step", "median", "least to greatest");
    three_phases(steps);
    constant_load(steps);
    thermal(steps);
    estimators(steps);
    separation(steps);
}

/// 1 kHz, 33 Hz: filter of 4th order and feature of each of three phases.
fn three_phases(steps: u64) {
    let design = Design::low_pass(350.0, 1000.0).expect("a filter");
    let spans = [("zero crossings", Span::Crossings { least_a: 0.2 }), ("from speed", Span::Known { hz: 33.0 })];
    let waves: Vec<[f64; 3]> = (0..1000_u32)
        .map(|n| [0.0, 1.0, 2.0].map(|lag| 8.0 * (TAU * (33.0 * f64::from(n) / 1000.0 - lag / 3.0)).sin()))
        .collect();
    for (name, span) in spans {
        let phase = PhaseFeature::new(FeatureKind::Rms, span, 4, 1000.0).expect("a feature");
        let mut three = ThreePhase::new(&design, phase);
        measure(&format!("three phases at 1 kHz, filter and feature, {name}"), steps, |step| {
            black_box(three.push(black_box(waves[(step % 1000) as usize])));
        });
    }
}

/// Depth from feed and feature, then the feed for a wanted feature.
fn constant_load(steps: u64) {
    let curve = |h: f64| CurveAtDepth {
        depth_mm: h,
        curve: Cubic { coefficients: [1.4 + 0.05 * h, 0.7 * h, 0.35 * h, 0.08 * h], feed_min: 0.2, feed_max: 3.0 },
        sd: 0.02,
    };
    let family = Family::new([0.4, 0.8, 1.2, 1.6].map(curve).to_vec()).expect("a family");
    measure("depth from feed and feature, feed for a wanted feature", steps, |step| {
        let feature = 2.0 + 0.25 * (step % 7) as f64;
        let feed = family.depth(1.1, feature, 0.02).and_then(|depth| family.feed(depth.depth_mm, 2.5));
        black_box(feed.expect("in the family"));
    });
}

/// A law of 13 points, all of them through a lag.
fn thermal(steps: u64) {
    let names: Vec<String> = (1..=13).map(|point| format!("temperature_{point}_c")).collect();
    let term = |name: &String| Term {
        sensor: name.clone(),
        path: Path::Lagged,
        um_per_k: 0.7,
        interval: (0.6, 0.8),
        range_c: (15.0, 45.0),
    };
    let diagonal = |row: usize| (0..14).map(|column| if row == column { 1e-4 } else { 0.0 }).collect::<Vec<f64>>();
    let law = ThermalLaw {
        intercept_um: -100.0,
        intercept_interval: (-110.0, -90.0),
        tau_s: Some(2400.0),
        tau_interval_s: None,
        residual_sd_um: 0.8,
        law_sd_max_um: 0.5,
        lag_spread_k: 2.0,
        terms: names.iter().map(term).collect(),
        covariance: (0..14).map(diagonal).collect(),
    };
    let sensors: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut predictor = Predictor::new(law, &sensors).expect("a law");
    let mut temperatures = [Ok(20.0); 13];
    measure("thermal error from 13 points, lagged", steps, |step| {
        temperatures[(step % 13) as usize] = Ok(20.0 + (step % 100) as f64 / 10.0);
        let at_ns = step as i64 * SECOND_NS;
        black_box(predictor.predict(at_ns, black_box(&temperatures)).expect("every sensor answers"));
    });
}

/// The whole pipeline of estimators on one sample: state, no-load power, cutting power, load loss, visibility.
fn estimators(steps: u64) {
    let mut pipeline = Pipeline::new(Settings::default());
    let channels = ["spindle_speed_rpm", "spindle_power_w", "total_power_w", "feed_mm_min"]
        .map(|name| ChannelId::of(name).expect("in the table"));
    let mut sample = Sample::empty(0);
    measure("full set of estimators, one tick", steps, |step| {
        // 40 s of idling, 20 s of cutting, over and over.
        let cutting = step % 600 >= 400;
        let noise = [3.0, -4.0, 1.0, 5.0, -5.0][(step % 5) as usize];
        let power_w = 500.0 + noise + if cutting { 900.0 } else { 0.0 };
        let values = [800.0, power_w, power_w + 700.0, if cutting { 120.0 } else { 0.0 }];
        sample.at_ns = step as i64 * SECOND_NS / 10;
        for (channel, value) in channels.into_iter().zip(values) {
            sample.set(channel, Slot { value: Ok(Value::Number(value)), age_ns: 0 });
        }
        black_box(pipeline.infer(black_box(&sample)));
    });
}

/// The split of one power.
fn separation(steps: u64) {
    measure("cutting power and load loss of one power", steps, |step| {
        black_box(balance(black_box(960.0 + (step % 100) as f64), 0.1807, 4e-5));
    });
}
