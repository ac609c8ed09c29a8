//! Methods called from scripts: their numbers, and what becomes of a script whose method has no answer.

use super::{file, host, sample, told};
use rules::estimators::Estimates;
use rules::script::{Host, ScriptCondition, compile_scripts};

/// The notes of one run of a script.
fn notes(text: &str, values: &[(&str, f64)]) -> Vec<String> {
    let mut host = host(text);
    let sample = sample(1.0, values);
    let decision = host.run_due_scripts(&sample, &Estimates::without_samples(sample.at_ns));
    decision.notes.iter().map(|note| note.text.to_string()).collect()
}

const CURVES: &str = "const CURVES = [[0.4, 0.2, 3.0, 1.45, 0.29, 0.14, 0.03, 0.01], [1.2, 0.2, 3.0, 1.5, 0.872, 0.4277, 0.0944, 0.01]];";

#[test]
fn methods_give_their_numbers() {
    let script = r#"
        const TABLE = [[600, 365.0], [700.0, 440.0], [900.0, 545.0]];
        note("Pc " + separated_cutting_power_w(spindle_power_w, 500, 0.1807, 0.00004));
        note("Pad " + separated_load_loss_w(1460.0, 500.0, 0.1807, 0.00004));
        note("a1 " + load_loss_quadratic_at_per_w(0.0001, 800.0, 400.0));
        note("Pu " + interpolated_no_load_power_w(TABLE, 800.0) + " " + no_load_noise_gain(TABLE, 700));
    "#;
    let notes = notes(script, &[("spindle_power_w", 1460.0)]);
    assert!(notes[0].starts_with("Pc 791.83") && notes[1].starts_with("Pad 168.16"), "{notes:?}");
    assert_eq!(notes[2], "a1 0.0004");
    assert!(notes[3].starts_with("Pu 500") && notes[3].ends_with(" 1.0"), "{notes:?}");
}

#[test]
fn curves_give_depth_and_feed() {
    let script = format!(
        r#"{CURVES}
        let depth_mm = feed_curve_depth_mm(CURVES, 1.0, feed_curve_feature(CURVES, 0.8, 1.0));
        note("depth " + depth_mm);
        note("feed " + feed_curve_feed(CURVES, 1.2, 5.0));
        note("sd " + (feed_curve_depth_sd_mm(CURVES, 1.0, 2.4, 0.05) < 0.1));"#
    );
    let notes = notes(&script, &[]);
    assert!(notes[0].starts_with("depth 0.8") || notes[0].starts_with("depth 0.79999"), "{notes:?}");
    assert!(notes[1].starts_with("feed 1.79"), "{notes:?}");
    assert_eq!(notes[2], "sd true");
}

#[test]
fn without_an_answer_there_is_no_value_and_a_reason() {
    let script = format!(
        r#"{CURVES}
        let feed = feed_curve_feed(CURVES, 1.2, 1.0);
        note(has(feed) + ": " + why("feed_curve_feed"));
        let missing = separated_cutting_power_w(spindle_power_w, 500.0, 0.18, 0.0);
        note(has(missing) + ": " + why("separated_cutting_power_w"));
        note("fine: " + has(why("feed_curve_feature")));"#
    );
    let notes = notes(&script, &[]);
    assert!(notes[0].starts_with("false: depth 1.20 mm: 1.0000 lies below"), "{notes:?}");
    assert!(notes[1].starts_with("false: spindle_power_w has no value"), "{notes:?}");
    assert_eq!(notes[2], "fine: false");
}

#[test]
fn a_script_that_computes_with_the_missing_number_waits_and_says_why() {
    let mut host: Host =
        host("note(\"\" + 2.0 * interpolated_no_load_power_w([[600, 365], [700, 440], [900, 545]], 1500));");
    let sample = sample(1.0, &[]);
    host.run_due_scripts(&sample, &Estimates::without_samples(sample.at_ns));
    let status = host.status();
    match &status.scripts[0].condition {
        ScriptCondition::Waiting(problem) => assert!(problem.what.contains("noise gain 33.6"), "{problem}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_mistake_in_a_call_is_told_before_the_script_runs_or_stops_it() {
    let problems =
        compile_scripts(&[file("wrong.rhai", "let x = separated_cutting_power_w(1.0, 2.0);")]).err().expect("refused");
    assert!(
        told(&problems).contains("write separated_cutting_power_w(spindle_power_w, no_load_power_w"),
        "{}",
        told(&problems)
    );
    let mut host = host("let x = feed_curve_feed(7, 1.0, 2.0);");
    let sample = sample(1.0, &[]);
    host.run_due_scripts(&sample, &Estimates::without_samples(sample.at_ns));
    assert!(matches!(host.status().scripts[0].condition, ScriptCondition::Suspended(Some(_))));
}
