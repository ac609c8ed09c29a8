//! The engine from end to end, on a slide whose simulation knows mass and viscous friction only.

use super::diagnose_recording;
use crate::diagnosis::Verdict;
use crate::text_report::format_report;
use crate::{Diagnosis, parse_model};
use physics::explain::Language;
use recording::read_csv;
use std::fmt::Write;

const MODEL: &str = "schema = \"model/1\"\noutput = \"force_n\"\n[[effect]]\nkind = \"linear\"\n\
                     columns = { acceleration_m_s2 = 90.0, velocity_m_s = 200.0, one = 0.0 }\n\
                     [roles]\nvelocity = \"velocity_m_s\"\nacceleration = \"acceleration_m_s2\"\n";
const RUNS: u32 = 8;
const ROWS: u32 = 250;

/// Eight runs of a slide that goes to and fro at changing speeds, with dry friction of this level and a noise of 2 N.
fn recorded(level_n: f64) -> String {
    record_motion(&[(0.1, 1.3), (0.04, 4.1)], level_n, 0.0)
}

/// The same with quicker movements, and a meter that is late by so much.
fn record_late(level_n: f64, late_s: f64) -> String {
    record_motion(&[(0.1, 1.3), (0.04, 4.1), (0.02, 9.7), (0.008, 17.3)], level_n, late_s)
}

/// Movements as sines of these amplitudes (m/s) and angular frequencies (rad/s).
fn record_motion(sines: &[(f64, f64)], level_n: f64, late_s: f64) -> String {
    let mut text = String::from("time_s,run,velocity_m_s,acceleration_m_s2,force_n\n");
    let mut state = 12_345_u64;
    let mut noise = || {
        let mut sum = 0.0;
        for _ in 0..12 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum += f64::from(u32::try_from(state >> 33).unwrap_or(0)) / f64::from(1_u32 << 31);
        }
        2.0 * (sum - 6.0)
    };
    let velocity_m_s = |t: f64| sines.iter().map(|(size, w)| size * (w * t).sin()).sum::<f64>();
    let acceleration_m_s2 = |t: f64| sines.iter().map(|(size, w)| size * w * (w * t).cos()).sum::<f64>();
    for row in 0..RUNS * ROWS {
        let t = f64::from(row) * 0.01;
        let (then, was) = (velocity_m_s(t - late_s), acceleration_m_s2(t - late_s));
        let force = 95.0 * was + 215.0 * then + level_n * (then / 0.001).tanh() + noise();
        writeln!(text, "{t},{},{},{},{force}", row / ROWS, velocity_m_s(t), acceleration_m_s2(t))
            .expect("a string takes it");
    }
    text
}

fn diagnosed(level_n: f64) -> Diagnosis {
    let recording = read_csv(recorded(level_n).as_bytes(), "t.csv").expect("readable").recording;
    diagnose_recording(&recording, &parse_model(MODEL).expect("fine"), 1).expect("usable")
}

#[test]
fn dry_friction_is_named_with_its_level_and_the_held_out_error_falls() {
    let found = diagnosed(20.0);
    assert_eq!(found.verdict, Verdict::Explained, "{}", found.debug);
    assert_eq!(found.missing[0].effect, "dry_friction");
    let level = found.missing[0].parameters.iter().find(|parameter| parameter.name == "level").expect("its level");
    assert!((level.value - 20.0).abs() < 1.0, "{level:?}");
    let share = found.fit.expect("fitted").held_out_share().expect("held out");
    assert!(share < 0.3, "{share}");
}

#[test]
fn nothing_is_reported_where_nothing_is_missing() {
    let found = diagnosed(0.0);
    assert_eq!(found.verdict, Verdict::NoMismatch, "{}", found.debug);
    assert!(found.missing.is_empty());
}

#[test]
fn the_same_recording_gives_the_same_answer() {
    let (one, other) = (diagnosed(3.0), diagnosed(3.0));
    assert_eq!((one.rows, one.missing, one.summary), (other.rows, other.missing, other.summary));
}

/// Every named answer tells what its file does over the same rows, and the file is a model again.
fn check_told_is_written(text: &str, model: &str) -> Diagnosis {
    let recording = read_csv(text.as_bytes(), "t.csv").expect("readable").recording;
    let found = diagnose_recording(&recording, &parse_model(model).expect("fine"), 1).expect("usable");
    let file = parse_model(&crate::write_model(&found.model)).expect("a model again");
    let rows = crate::simulate::simulate_recording(&recording, &file, false).expect("simulated");
    assert!(!found.missing.is_empty() && found.missing.iter().all(|m| m.effect != "unknown"), "{}", found.debug);
    for (told, written) in found.rows.simulated_after.iter().zip(&rows.total) {
        let (told, written) = (told.expect("told"), written.expect("written"));
        assert!((told - written).abs() <= 1e-9 * written.abs().max(1.0), "{told} {written}");
    }
    let fit = found.fit.as_ref().expect("fitted");
    let (before, after) = (fit.before.held_out_rmse.expect("held out"), fit.after.held_out_rmse.expect("held out"));
    let ceiling = fit.ceiling.and_then(|ceiling| ceiling.held_out_rmse).expect("held out");
    assert!(after < before, "{before} {after}");
    if found.verdict == Verdict::Explained {
        assert!(before - after >= 0.8 * (before - ceiling), "{before} {after} {ceiling}");
    }
    found
}

#[test]
fn what_is_told_of_a_friction_is_what_its_file_does() {
    let found = check_told_is_written(&recorded(20.0), MODEL);
    let missing = &found.missing[0];
    assert!(missing.delta_ic.expect("fitted") > 0.0 && missing.probability.expect("named") > 0.5, "{missing:?}");
}

/// A delay between two values of the grid is made of two laws in the search; the file needs one.
#[test]
fn a_delay_between_two_values_of_the_grid_is_told_by_one_name() {
    for late_s in [0.117, 0.186] {
        let recording = read_csv(record_late(8.0, late_s).as_bytes(), "t.csv").expect("readable").recording;
        let found = diagnose_recording(&recording, &parse_model(MODEL).expect("fine"), 1).expect("usable");
        let names: Vec<&str> = found.missing.iter().map(|missing| missing.effect.as_str()).collect();
        assert_eq!(names, ["clock_lag"], "{late_s} s: {}", found.debug);
        let delay = found.missing[0].parameters.iter().find(|parameter| parameter.name == "delay_s").expect("a delay");
        assert!((delay.value - late_s).abs() < 0.01, "{late_s} s: {delay:?}");
        let alone = found.missing[0].delta_ic.expect("written");
        assert!(alone > 0.0, "a name that is told is needed: {alone}");
    }
}

/// Numbers with a lone 1 behind them, which is the unit of what has none: "1.3 1".
fn numbers_before_a_one(text: &str) -> Vec<&str> {
    let parts: Vec<&str> = text.split([' ', '\u{a0}']).collect();
    let is_one =
        |part: &str| part.trim_matches(|c: char| !c.is_ascii_digit() && c != '.') == "1" && part.starts_with('1');
    let is_number = |part: &str| part.parse::<f64>().is_ok();
    parts.windows(2).filter(|pair| is_number(pair[0]) && is_one(pair[1])).map(|pair| pair[0]).collect()
}

#[test]
fn no_sentence_of_a_quantity_without_a_unit_carries_a_one() {
    assert_eq!(numbers_before_a_one("p0 1 → 1.3 1, noise 2 1; 1 1.5"), ["1.3", "2"], "what is looked for is found");
    // Named so, the output has no unit.
    for level in [0.0, 3.0, 20.0] {
        let text = recorded(level).replace("force_n", "pull");
        let recording = read_csv(text.as_bytes(), "t.csv").expect("readable").recording;
        let model = parse_model(&MODEL.replace("force_n", "pull")).expect("fine");
        let found = diagnose_recording(&recording, &model, 1).expect("usable");
        assert_eq!(found.unit, "1");
        for language in [Language::En, Language::Zh] {
            let said = format_report(&found, language);
            assert_eq!(numbers_before_a_one(&said), Vec::<&str>::new(), "{said}");
        }
        let summary = format!("{}\n{}", found.summary.en, found.summary.zh);
        assert_eq!(numbers_before_a_one(&summary), Vec::<&str>::new(), "{summary}");
    }
}
