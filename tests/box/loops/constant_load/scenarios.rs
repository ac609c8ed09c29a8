//! The situations that a constant load is known to fail in, one after the other: a row of figures each, for plain feed, the
//! shipped script by its exponent and by learned curves, and the law of this module.

use super::law::{by_curves, by_exponent, curves, law};
use super::{ALLOWED_W, DEEPEST_MM, FEED_MM_MIN, Outcome, SHIPPED_DECISIONS_PER_MIN, run, settings};
use crate::loops::steps::{SPEED_RPM, air, air_cut, cut, onward};
use adapters::simulated::{ExperimentStep, LaterChange, SimulatedSettings};

/// A situation, and the longest stretch above 1.15 times what is allowed that the shipped script may leave, s.
struct Scenario {
    name: &'static str,
    settings: SimulatedSettings,
    steps: Vec<ExperimentStep>,
    over_max_s: f64,
}

/// With a rest before and after.
fn scenario(name: &'static str, over_max_s: f64, steps: Vec<ExperimentStep>) -> Scenario {
    let steps = [vec![air(15.0)], steps, vec![air(3.0)]].concat();
    Scenario { name, settings: settings(3), steps, over_max_s }
}

fn scenarios() -> Vec<Scenario> {
    let feed = FEED_MM_MIN;
    let usual = settings(3);
    let mut silent = usual;
    (silent.meter.dropouts_per_h, silent.meter.dropout_s) = (240.0, 4.0);
    // From the middle of the second cut on.
    let hard = SimulatedSettings { change: LaterChange { after_s: 70.0, cut: 1.35, ..usual.change }, ..usual };
    let worn = SimulatedSettings { wear_mm: 0.28, ..usual };
    let varying = || vec![cut(14.0, feed, 1.5), cut(14.0, feed, DEEPEST_MM), cut(14.0, feed, 1.8)];
    vec![
        scenario("air cut", 2.0, vec![cut(12.0, feed, 1.4), air_cut(8.0, feed), cut(12.0, feed, DEEPEST_MM)]),
        scenario("entry", 2.0, vec![air_cut(3.0, feed), cut(8.0, feed, DEEPEST_MM), cut(8.0, feed, DEEPEST_MM)]),
        scenario("exit", 2.0, vec![cut(8.0, feed, 2.4), air_cut(3.0, feed), cut(8.0, feed, 1.2), air_cut(3.0, feed)]),
        scenario("corner", 2.0, vec![cut(12.0, feed, 1.4), onward(1.5, feed, DEEPEST_MM), onward(12.0, feed, 1.4)]),
        scenario(
            "depth step",
            2.0,
            vec![cut(14.0, feed, 1.2), onward(14.0, feed, DEEPEST_MM), onward(10.0, feed, 1.2)],
        ),
        Scenario { settings: hard, ..scenario("hard spot", 3.0, varying()) },
        Scenario { settings: worn, ..scenario("worn tool", 3.0, varying()) },
        Scenario { settings: silent, ..scenario("meter dropout", 3.0, [varying(), varying()].concat()) },
    ]
}

fn row(scenario: &str, law: &str, outcome: &Outcome) -> String {
    let [spread, settled] = outcome.spread().map(|share| 100.0 * share);
    format!(
        "| {scenario:13} | {law:17} | {:5.1} | {:4.1} | {:+4.0} | {spread:4.1} | {settled:4.1} | {:3} to {:3} | {:4.0} |",
        outcome.program_s,
        outcome.over_s,
        100.0 * (outcome.greatest() / (1.15 * ALLOWED_W) - 1.0),
        outcome.least_pct,
        outcome.greatest_pct,
        outcome.decisions_per_min()
    )
}

#[test]
fn every_situation_in_which_a_constant_load_is_known_to_fail() {
    let learned = curves();
    let family = learned.build_family(SPEED_RPM).expect("curves that do not cross");
    let target_w = family.interpolate_curve(DEEPEST_MM).expect("between").evaluate_at(FEED_MM_MIN);
    let laws = [
        ("plain feed", law(&learned, target_w), false),
        ("shipped, exponent", by_exponent(ALLOWED_W), true),
        ("shipped, curves", by_curves(&learned, target_w), true),
        ("law of the module", law(&learned, target_w), true),
    ];
    println!(
        "| situation | law | time s | above 1.15 x allowed s | deepest % | spread % | settled % | override % | decisions/min |"
    );
    for scenario in scenarios() {
        for (name, script, armed) in &laws {
            let outcome = run(scenario.settings, &scenario.steps, std::slice::from_ref(script), *armed);
            println!("{}", row(scenario.name, name, &outcome));
            let place = format!("{}, {name}", scenario.name);
            if name.starts_with("shipped") {
                let decisions = outcome.decisions_per_min();
                assert!(decisions <= SHIPPED_DECISIONS_PER_MIN, "{place}: {decisions} decisions a minute");
            }
            if *armed {
                assert!(outcome.over_s <= scenario.over_max_s, "{place}: {} s above", outcome.over_s);
            }
            if scenario.name == "meter dropout" {
                assert!(outcome.silent_s > 1.0, "{place}: the meter was silent");
                assert_eq!(outcome.silent_pct, 0, "{place}: 100 % is held while nothing is measured");
            }
        }
    }
}
