//! Constant-load feed control on the spindle current (DM4600): filter, feature window, cubic and its inverse.

use crate::published::Row;
use rules::estimators::spindle_current::{Cubic, FeatureKind, LowPassDesign, PhaseFeature, WindowSpan};
use std::f64::consts::TAU;

const B: [f64; 5] = [0.27541329, 1.10165315, 1.65247973, 1.10165315, 0.27541329];
const A: [f64; 5] = [1.0, 1.57039885, 1.27561332, 0.48440337, 0.07619706];
const SECTIONS: [[f64; 6]; 2] =
    [[0.27541329, 0.55082658, 0.27541329, 1.0, 0.67274091, 0.1445352], [1.0, 2.0, 1.0, 1.0, 0.89765794, 0.5271869]];
const NAMES: [&str; 6] = ["b0", "b1", "b2", "a0", "a1", "a2"];

/// Feature, feed, slope of the feature over feed, and of feed over the feature.
const INVERSE: [(f64, f64, f64, f64); 17] = [
    (1.4612, 0.0, 0.872, 1.14679),
    (1.5, 0.043556, 0.9098, 1.09915),
    (1.75, 0.287942, 1.14179, 0.87582),
    (2.0, 0.488324, 1.35724, 0.73679),
    (2.5, 0.81097, 1.75196, 0.57079),
    (2.8553, 1.0, 2.0106, 0.49736),
    (3.0, 1.070209, 2.11182, 0.47353),
    (3.5, 1.289811, 2.44644, 0.40876),
    (4.0, 1.48195, 2.76162, 0.36211),
    (4.5, 1.653771, 3.06118, 0.32667),
    (5.0, 1.809858, 3.3478, 0.2987),
    (5.6725, 2.00035, 3.7163, 0.26909),
    (6.0, 2.086475, 3.88965, 0.25709),
    (7.0, 2.327955, 4.3981, 0.22737),
    (8.0, 2.543616, 4.88011, 0.20491),
    (10.0, 2.919228, 5.78251, 0.17294),
    (12.0, 3.241955, 6.62168, 0.15102),
];

pub(crate) fn rows() -> Vec<Row> {
    let mut rows = filter();
    rows.extend(window());
    rows.extend(cubic());
    rows
}

fn filter() -> Vec<Row> {
    let design = LowPassDesign::low_pass(350.0, 1000.0).expect("the filter of the source");
    let source = "001, Butterworth 350 Hz, 1 kHz";
    let (b, a) = design.polynomials();
    let mut rows = Vec::new();
    for (name, published, ours) in [("b", B, b), ("a", A, a)] {
        for (at, (published, ours)) in published.into_iter().zip(ours).enumerate() {
            rows.push(Row::new(format!("filter {name}{at}"), published, ours, 1e-6, source));
        }
    }
    for (at, (published, ours)) in SECTIONS.into_iter().zip(design.sections()).enumerate() {
        for ((name, published), ours) in NAMES.into_iter().zip(published).zip(ours) {
            rows.push(Row::new(format!("filter section {} {name}", at + 1), published, ours, 1e-6, source));
        }
    }
    for (hz, db, tolerance) in [(350.0, -3.01, 0.005), (400.0, -15.7, 0.05), (450.0, -40.6, 0.05)] {
        rows.push(Row::new(format!("filter gain at {hz} Hz, dB"), db, design.gain_db(hz), tolerance, source));
    }
    rows.push(Row::new("filter delay of slow changes, ms", 0.67, 1000.0 * design.delay_s(), 0.005, source));
    rows
}

/// Greatest less least mean of `|i|` over windows of so many samples at 33 1/3 Hz and 1 kHz, % of the mean.
fn ripple(samples: usize) -> f64 {
    let current: Vec<f64> = (0..3000_i32).map(|n| (TAU * f64::from(n) / 30.0).sin().abs()).collect();
    let means: Vec<f64> = current.windows(samples).map(|window| window.iter().sum::<f64>() / samples as f64).collect();
    100.0 * spread(&means)
}

fn spread(values: &[f64]) -> f64 {
    let (least, greatest) = values.iter().fold((f64::MAX, f64::MIN), |(l, g), v| (l.min(*v), g.max(*v)));
    (greatest - least) / (values.iter().sum::<f64>() / values.len() as f64)
}

/// The same of the feature as it is built here.
fn ripple_of_feature(span: WindowSpan) -> f64 {
    let mut feature = PhaseFeature::new(FeatureKind::MeanAbsolute, span, 2, 1000.0).expect("a feature");
    let current = |n: i32| 10.0 * (TAU * f64::from(n) / 30.0 + 0.3).sin();
    let values: Vec<f64> = (0..3000).filter_map(|n| feature.push(current(n))).map(|found| found.value).collect();
    assert!(values.len() > 90, "a window per period");
    100.0 * spread(&values)
}

fn window() -> Vec<Row> {
    let source = "001, 33.3 Hz at 1 kHz";
    let fixed = [(40, 13.9), (50, 11.1), (100, 5.6), (500, 1.1)];
    let mut rows: Vec<Row> = fixed
        .into_iter()
        .map(|(samples, published)| {
            Row::new(format!("ripple of mean |i|, {samples} samples, %"), published, ripple(samples), 0.05, source)
        })
        .collect();
    rows.push(Row::new("ripple of mean |i|, 30 samples, %", 0.01, ripple(30), 0.01, source));
    let crossings = ripple_of_feature(WindowSpan::Crossings { least_a: 0.1 });
    rows.push(Row::new("ripple of our feature, zero crossings, %", 0.01, crossings, 0.01, source));
    let known = ripple_of_feature(WindowSpan::Known { hz: 2.0 * 1000.0 / 60.0 });
    rows.push(Row::new("ripple of our feature, from 1000 rpm, 2 pole pairs, %", 0.01, known, 0.01, source));
    rows
}

fn cubic() -> Vec<Row> {
    let cubic = Cubic { coefficients: [1.4612, 0.872, 0.4277, 0.0944], feed_min: 0.0, feed_max: 3.5 };
    let source = "001, n = 1000, h = 1.2 mm";
    let rises = f64::from(u8::from(cubic.is_rising()));
    let mut rows = vec![
        Row::new("discriminant of the derivative", -0.256, cubic.discriminant(), 5e-4, source),
        Row::new("rises throughout (1 = yes)", 1.0, rises, 0.0, source),
    ];
    for (feature, feed, slope, inverse) in INVERSE {
        let found = cubic.feed_for(feature).expect("a feed");
        rows.push(Row::new(format!("feed for a feature of {feature}"), feed, found.feed, 6e-7, source));
        rows.push(Row::new(format!("slope at a feature of {feature}"), slope, cubic.slope(found.feed), 6e-6, source));
        let quantity = format!("feed per feature at {feature}");
        rows.push(Row::new(quantity, inverse, found.feed_per_feature, 6e-6, source));
    }
    rows
}
