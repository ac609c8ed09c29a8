//! Published and recomputed numbers of the sources.

use rand::SeedableRng;
use rand_distr::{Distribution, Exp1, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rules::estimators::{
    AntiPulse, NoEstimate, NoLoadOrigin, NoLoadTable, Settings, is_stationary, lagrange_weights, noise_gain,
    select_adjacent_speeds, solve_power_balance,
};
use testkit::weights::WEIGHTS;

const SPEEDS: [f64; 7] = [100.0, 200.0, 300.0, 500.0, 600.0, 700.0, 900.0];

#[test]
fn lagrange_weights_and_their_noise_gain_are_those_of_the_table() {
    for (speed, expected_speeds, expected, gain) in WEIGHTS {
        let first = select_adjacent_speeds(&SPEEDS, speed);
        let speeds = [SPEEDS[first], SPEEDS[first + 1], SPEEDS[first + 2]];
        // At a known speed every triple that holds it gives the same.
        if !SPEEDS.contains(&speed) {
            assert_eq!(speeds, expected_speeds, "{speed} rpm");
        }
        let weights = lagrange_weights(expected_speeds, speed);
        assert!(weights.iter().zip(expected).all(|(is, should)| (is - should).abs() < 1e-6), "{speed}: {weights:?}");
        assert!((noise_gain(&weights) - gain).abs() < 1e-4, "{speed} rpm");
    }
}

/// The one fact that is left of the measured table: Pu(700) + (Pu(900) - Pu(600)) / 3 = 500 W at 800 rpm.
fn machine() -> (NoLoadTable, Settings) {
    let mut settings = Settings::default();
    let powers = [90.0, 150.0, 205.0, 310.0, 365.0, 440.0, 545.0];
    let table: Vec<(f64, f64)> = SPEEDS.into_iter().zip(powers).collect();
    settings.set_no_load_table(0, &table).expect("a table");
    (NoLoadTable::new(&settings), settings)
}

#[test]
fn no_load_power_between_the_known_speeds_is_the_published_one() {
    let (table, settings) = machine();
    let known = table.get(0, 800.0, 0, &settings).expect("known");
    assert!((known.power_w - 500.0).abs() < 1e-9, "{known:?}");
    assert!((known.noise_gain - 1.106).abs() < 1e-3);
    assert_eq!(known.origin, NoLoadOrigin::Interpolated);
    assert!((known.power_w / 505.0 - 1.0).abs() < 0.01, "measured: 505 W");
    assert_eq!(table.get(0, -800.0, 0, &settings), Ok(known), "either direction");
    assert_eq!(table.get(1, 800.0, 0, &settings), Err(NoEstimate::NotLearned), "never across a gear stage");
}

#[test]
fn extrapolation_is_flagged_up_to_a_noise_gain_of_three_and_refused_beyond() {
    let (table, settings) = machine();
    let known = table.get(0, 1000.0, 0, &settings).expect("flagged");
    assert_eq!(known.origin, NoLoadOrigin::Extrapolated);
    assert!((known.noise_gain - 3.0).abs() < 1e-9 && known.sd_w > 3.0 * 0.03 * 300.0);
    for (speed, gain) in [(1200.0, 11.4455), (1500.0, 33.6006)] {
        match table.get(0, speed, 0, &settings) {
            Err(NoEstimate::Extrapolated { noise_gain }) => assert!((noise_gain - gain).abs() < 1e-3),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn a_slope_break_errs_by_three_percent_and_says_so() {
    let mut settings = Settings::default();
    // Slope 0.5 W/rpm up to 700 rpm, 0.1 W/rpm beyond: the truth at 800 rpm is 420 W.
    let table = [(500.0, 310.0), (600.0, 360.0), (700.0, 410.0), (900.0, 430.0)];
    settings.set_no_load_table(0, &table).expect("a table");
    let known = NoLoadTable::new(&settings).get(0, 800.0, 0, &settings).expect("known");
    assert!((known.power_w - 433.3).abs() < 0.1, "{known:?}");
    assert!((known.power_w - 420.0).abs() < 2.0 * known.sd_w);
}

#[test]
fn the_published_cut_has_the_published_shares() {
    let split = solve_power_balance(1460.0 - 500.0, 0.1807, 4e-5).expect("a real root");
    let share = |power: f64| (1000.0 * power / 1460.0).round() / 10.0;
    assert_eq!((share(500.0), share(795.0), share(165.0)), (34.2, 54.5, 11.3));
    assert!((split.cutting_power_w - 791.84).abs() < 0.01 && (split.load_loss_w - 168.16).abs() < 0.01);
}

#[test]
fn the_least_visible_cut_of_the_source_is_21_to_42_watts() {
    let least = |c2: f64| solve_power_balance(c2 * 500.0, 0.18, 0.0).expect("a real root").cutting_power_w;
    assert_eq!((least(0.05).round(), least(0.10).round()), (21.0, 42.0));
}

#[test]
fn the_anti_pulse_mean_of_noise_is_as_computed() {
    let mut dice = Pcg64Mcg::seed_from_u64(4);
    let mut statistics = |draw: &mut dyn FnMut(&mut Pcg64Mcg) -> f64| {
        let means: Vec<f64> = (0..40_000)
            .map(|_| {
                let mut filter = AntiPulse::new(10);
                (0..10).filter_map(|_| filter.push(draw(&mut dice))).last().expect("full")
            })
            .collect();
        let mean = means.iter().sum::<f64>() / means.len() as f64;
        let variance = means.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / means.len() as f64;
        (mean, variance.sqrt())
    };
    let (_, sd) = statistics(&mut |dice| StandardNormal.sample(dice));
    assert!((sd - 0.322).abs() < 0.005, "{sd}");
    assert!((sd - AntiPulse::new(10).noise_gain()).abs() < 0.005);
    let (mean, _) = statistics(&mut |dice| Exp1.sample(dice));
    assert!((mean - 1.0 + 0.13).abs() < 0.01, "skewed noise: {mean}");
}

fn reading(reading: f64, c1: f64) -> Settings {
    let mut settings = Settings::default();
    settings.set_value("stationarity_reading", reading).expect("in range");
    settings.set_value("c1", c1).expect("in range");
    settings
}

const READINGS: [(f64, f64); 4] = [(1.0, 0.15), (1.0, 0.25), (2.0, 0.15), (2.0, 0.25)];

/// Bias of the window's mean when one window of 20 first passes, at 10 Hz, 500 W, a surge of 3000 W.
fn bias(tau_s: f64, settings: &Settings) -> f64 {
    let power = |i: usize| 500.0 + 3000.0 * (-0.1 * i as f64 / tau_s).exp();
    (20..400)
        .find_map(|end| {
            let window = (end - 20..end).map(power);
            let mean = window.clone().sum::<f64>() / 20.0;
            is_stationary(window, mean, settings).then_some(mean / 500.0 - 1.0)
        })
        .expect("it passes some time")
}

#[test]
fn one_window_is_biased_as_measured_in_both_readings() {
    for (tau_s, low, high) in [(0.3, 0.027, 0.053), (0.6, 0.048, 0.11), (1.0, 0.08, 0.25), (2.0, 0.18, 0.83)] {
        let biases = READINGS.map(|(way, c1)| bias(tau_s, &reading(way, c1)));
        let least = biases.into_iter().fold(f64::INFINITY, f64::min);
        let greatest = biases.into_iter().fold(0.0, f64::max);
        println!("tau {tau_s} s: {least:.3} to {greatest:.3}");
        assert!((least / low - 1.0).abs() < 0.15 && (greatest / high - 1.0).abs() < 0.15, "{tau_s}: {biases:?}");
    }
}

#[test]
fn noise_passes_one_window_up_to_the_computed_levels() {
    let mut dice = Pcg64Mcg::seed_from_u64(5);
    for ((way, c1), sd) in READINGS.into_iter().zip([0.03, 0.05, 0.05, 0.08]) {
        let settings = reading(way, c1);
        let passed = (0..4000)
            .filter(|_| {
                let normal = |_| -> f64 { StandardNormal.sample(&mut dice) };
                let window: Vec<f64> = (0..20).map(normal).map(|noise| 500.0 * (1.0 + sd * noise)).collect();
                let mean = window.iter().sum::<f64>() / 20.0;
                is_stationary(window.into_iter(), mean, &settings)
            })
            .count();
        let share = passed as f64 / 4000.0;
        assert!((share - 0.95).abs() < 0.035, "reading {way}, c1 {c1}: {share}");
    }
}

#[test]
fn a_light_cut_that_begins_inside_the_window_is_absorbed_by_one_window() {
    let window = || (0..20).map(|i| if i < 10 { 500.0 } else { 600.0 });
    let mean = window().sum::<f64>() / 20.0;
    assert!((100.0_f64 / mean - 0.18).abs() < 0.005, "a step of 0.20 is a range of 0.18");
    assert!(is_stationary(window(), mean, &reading(1.0, 0.25)));
    assert!((mean / 500.0 - 1.1).abs() < 1e-12, "bias: half the step");
}
