//! The first recipe of the cookbook on the simulated machine at work: teach learns three parts, later the material is harder.

use super::bench::{Bench, limits, script};
use adapters::simulated::{LaterChange, SimulatedSettings};
use rules::script::{recipe, shipped};

/// From here on every cut takes so many times the power.
const CHANGE_S: f64 = 2400.0;
const HARDER: f64 = 1.4;

/// Ticks in which the recipe asks for 90 %, in which the ladder holds 90 %, and alarms raised: before the change and after it.
fn run(seed: u64) -> ([u32; 3], [u32; 3]) {
    let mut settings = SimulatedSettings { seed, wear_mm: 0.05, ..SimulatedSettings::default() };
    settings.meter.dropouts_per_h = 0.0;
    settings.change = LaterChange { after_s: CHANGE_S, cut: HARDER, ..settings.change };
    let text = recipe("above_learned").expect("a recipe").text;
    let every = text
        .replace("\"program\", \"O1234\"", "\"program\", \"\"")
        .replace("\"tool_name\", \"T3\"", "\"tool_name\", \"\"");
    let teach = shipped().into_iter().find(|file| file.name == "teach.rhai").expect("shipped");
    let teach = script("teach.rhai", teach.text.replace("setting(\"ask\", 1,", "setting(\"ask\", 0,"));
    let mut bench = Bench::at_work(settings, &[script("above_learned.rhai", every), teach], &limits(50.0, 110.0));
    let (mut before, mut after, mut armed) = ([0; 3], [0; 3], false);
    while bench.now_s() < 2.0 * CHANGE_S {
        bench.tick();
        if !armed && bench.now_s() > 30.0 {
            bench.arm();
            armed = true;
        }
        let now_s = bench.now_s();
        let counts = if now_s < CHANGE_S { &mut before } else { &mut after };
        let decision = bench.pipeline.scripts().decision();
        counts[0] += u32::from(decision.request.as_ref().is_some_and(|request| request.pct == 90.0));
        counts[1] += u32::from(bench.machine.moment((now_s * 1e9) as i64).panel.feed_override_pct == 90);
        let raised = decision.alarms.iter().filter(|alarm| alarm.raised && &*alarm.name == "above_learned").count();
        counts[2] += u32::try_from(raised).expect("few");
    }
    (before, after)
}

#[test]
fn more_power_than_was_learned_lowers_the_feed_of_the_simulated_machine_and_is_told() {
    for seed in 1..=3 {
        let (before, after) = run(seed);
        println!(
            "seed {seed}: ticks asked for, ticks in force, alarms: {before:?} before the change, {after:?} after it"
        );
        assert!(after[0] > 50 && after[1] > 50 && after[2] > 0, "it is lowered and told: {after:?}");
        assert!(after[0] > 5 * before[0], "and hardly before: {before:?}");
    }
}
