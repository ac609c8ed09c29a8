//! `cargo bench --bench methods`: nanoseconds (criterion: 95 % interval of the mean) and allocations of the methods that
//! run at every sample or tick. An allocation in any of them ends the run with a failure. `cargo test` runs each once.

mod ffi;

use adapters::clock::SECOND_NS;
use adapters::{ChannelId, Sample, Slot, Value};
use criterion::{Criterion, criterion_group, criterion_main};
use rules::estimators::spindle_current::{
    Cubic, CurveAtDepth, CurveFamily, FeatureKind, LowPassDesign, PhaseFeature, ThreePhase, WindowSpan,
};
use rules::estimators::thermal::{Path, Predictor, ThermalLaw, ThermalTerm};
use rules::estimators::{Inference, Settings, solve_power_balance};
use std::f64::consts::TAU;
use std::hint::black_box;

#[global_allocator]
static COUNTING: ffi::Counting = ffi::Counting;

/// Steps over which allocations are counted.
const COUNTED: u64 = 20_000;

/// Counts the allocations of one step of a method, which must be none, and times it.
fn measure(criterion: &mut Criterion, name: &str, mut step: impl FnMut(u64)) {
    (0..COUNTED).for_each(&mut step);
    let before = ffi::allocations();
    (COUNTED..2 * COUNTED).for_each(&mut step);
    let allocations = ffi::allocations() - before;
    println!("{name}: {allocations} allocations in {COUNTED} steps");
    assert_eq!(allocations, 0, "{name} allocates");
    let mut at = 2 * COUNTED;
    criterion.bench_function(name, |bencher| {
        bencher.iter(|| {
            step(at);
            at += 1;
        });
    });
}

criterion_group!(methods, three_phases, constant_load, thermal, estimators, separation);
criterion_main!(methods);

/// 1 kHz, 33 Hz: filter of 4th order and feature of each of three phases.
fn three_phases(criterion: &mut Criterion) {
    let design = LowPassDesign::low_pass(350.0, 1000.0).expect("a filter");
    let spans =
        [("zero crossings", WindowSpan::Crossings { least_a: 0.2 }), ("from speed", WindowSpan::Known { hz: 33.0 })];
    let waves: Vec<[f64; 3]> = (0..1000_u32)
        .map(|n| [0.0, 1.0, 2.0].map(|lag| 8.0 * (TAU * (33.0 * f64::from(n) / 1000.0 - lag / 3.0)).sin()))
        .collect();
    for (name, span) in spans {
        let phase = PhaseFeature::new(FeatureKind::Rms, span, 4, 1000.0).expect("a feature");
        let mut three = ThreePhase::new(&design, phase);
        measure(criterion, &format!("three phases at 1 kHz, filter and feature, {name}"), |step| {
            black_box(three.push(black_box(waves[(step % 1000) as usize])));
        });
    }
}

/// Depth from feed and feature, then the feed for a wanted feature.
fn constant_load(criterion: &mut Criterion) {
    let curve = |h: f64| CurveAtDepth {
        depth_mm: h,
        curve: Cubic { coefficients: [1.4 + 0.05 * h, 0.7 * h, 0.35 * h, 0.08 * h], feed_min: 0.2, feed_max: 3.0 },
        sd: 0.02,
    };
    let family = CurveFamily::new([0.4, 0.8, 1.2, 1.6].map(curve).to_vec()).expect("a family");
    measure(criterion, "depth from feed and feature, feed for a wanted feature", |step| {
        let feature = 2.0 + 0.25 * (step % 7) as f64;
        let feed = family.infer_depth(1.1, feature, 0.02).and_then(|depth| family.find_feed(depth.depth_mm, 2.5));
        black_box(feed.expect("in the family"));
    });
}

/// A law of 13 points, all of them through a lag.
fn thermal(criterion: &mut Criterion) {
    let names: Vec<String> = (1..=13).map(|point| format!("temperature_{point}_c")).collect();
    let term = |name: &String| ThermalTerm {
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
    measure(criterion, "thermal error from 13 points, lagged", |step| {
        temperatures[(step % 13) as usize] = Ok(20.0 + (step % 100) as f64 / 10.0);
        let at_ns = step as i64 * SECOND_NS;
        black_box(predictor.predict_error(at_ns, black_box(&temperatures)).expect("every sensor answers"));
    });
}

/// The whole pipeline of estimators on one sample: state, no-load power, cutting power, load loss, visibility.
fn estimators(criterion: &mut Criterion) {
    let mut pipeline = Inference::new(Settings::default());
    let channels = ["spindle_speed_rpm", "spindle_power_w", "total_power_w", "feed_mm_min"]
        .map(|name| ChannelId::from_name(name).expect("in the table"));
    let mut sample = Sample::new_empty(0);
    measure(criterion, "full set of estimators, one tick", |step| {
        // 40 s of idling, 20 s of cutting, over and over.
        let cutting = step % 600 >= 400;
        let noise = [3.0, -4.0, 1.0, 5.0, -5.0][(step % 5) as usize];
        let power_w = 500.0 + noise + if cutting { 900.0 } else { 0.0 };
        let values = [800.0, power_w, power_w + 700.0, if cutting { 120.0 } else { 0.0 }];
        sample.at_ns = step as i64 * SECOND_NS / 10;
        for (channel, value) in channels.into_iter().zip(values) {
            sample.set_slot(channel, Slot { value: Ok(Value::Number(value)), age_ns: 0 });
        }
        black_box(pipeline.update_with_sample(black_box(&sample)));
    });
}

/// The split of one power.
fn separation(criterion: &mut Criterion) {
    measure(criterion, "cutting power and load loss of one power", |step| {
        black_box(solve_power_balance(black_box(960.0 + (step % 100) as f64), 0.1807, 4e-5));
    });
}
