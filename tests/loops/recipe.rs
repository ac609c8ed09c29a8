//! The first recipe of the cookbook on the simulated machine at work: teach learns three parts, later the material is harder.

use super::bench::{Bench, limits, script};
use adapters::simulated::{LaterChange, SimulatedSettings};
use rules::estimators::State;
use rules::script::{recipe, shipped};

/// From here on every cut takes so many times the power.
const CHANGE_S: f64 = 2400.0;
const HARDER: f64 = 1.4;

/// The recipe's own settings: so many times the learned power, for so long.
const LIMIT_SHARE: f64 = 1.1;
const HOLD_S: f64 = 2.0;

/// What a run shows. Ticks in which the recipe asks for 90 %, in which the ladder holds 90 %, and alarms raised: before the change
/// and after it; and how long the power had been too much when each request began, s.
struct Run {
    before: [u32; 3],
    after: [u32; 3],
    delays_s: Vec<f64>,
}

/// Since when the cutting power has been too much for what was learned, s; `None` while it is not.
fn exceeded_since(bench: &Bench, since_s: Option<f64>) -> Option<f64> {
    let scripts = bench.pipeline.scripts();
    let learned_w = scripts.published().find(|it| *it.name == *"learned_power_w").and_then(|it| it.value)?;
    let estimates = bench.pipeline.estimates();
    let power_w = estimates.cutting_power_w.ok().filter(|_| estimates.state == State::Cutting)?.value;
    (power_w > LIMIT_SHARE * learned_w).then(|| since_s.unwrap_or(bench.now_s()))
}

fn run(seed: u64) -> Run {
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
    let (mut delays_s, mut since_s, mut asked) = (Vec::new(), None, false);
    while bench.now_s() < 2.0 * CHANGE_S {
        bench.tick();
        if !armed && bench.now_s() > 30.0 {
            bench.arm();
            armed = true;
        }
        let now_s = bench.now_s();
        let counts = if now_s < CHANGE_S { &mut before } else { &mut after };
        let decision = bench.pipeline.scripts().decision();
        let asks = decision.request.as_ref().is_some_and(|request| request.pct == 90.0);
        counts[0] += u32::from(asks);
        since_s = exceeded_since(&bench, since_s);
        if asks && !asked {
            delays_s.push(since_s.map_or(f64::INFINITY, |since_s| now_s - since_s));
        }
        asked = asks;
        counts[1] += u32::from(bench.machine.moment((now_s * 1e9) as i64).panel.feed_override_pct == 90);
        let raised = decision.alarms.iter().filter(|alarm| alarm.raised && &*alarm.name == "above_learned").count();
        counts[2] += u32::try_from(raised).expect("few");
    }
    Run { before, after, delays_s }
}

#[test]
fn more_power_than_was_learned_lowers_the_feed_of_the_simulated_machine_and_is_told() {
    for seed in 1..=3 {
        let Run { before, after, delays_s } = run(seed);
        let (least_s, greatest_s) =
            delays_s.iter().fold((f64::INFINITY, 0.0_f64), |(least, most), it| (least.min(*it), most.max(*it)));
        println!(
            "seed {seed}: ticks asked for, ticks in force, alarms: {before:?} before the change, {after:?} after it; asked for {} \
             times, {least_s:.1} to {greatest_s:.1} s after the power became too much",
            delays_s.len()
        );
        assert!(after[0] > 50 && after[1] > 50 && after[2] > 0, "it is lowered and told: {after:?}");
        assert!(after[0] > 5 * before[0], "and hardly before: {before:?}");
        assert!(least_s > HOLD_S - 0.05 && greatest_s <= HOLD_S + 0.25, "as soon as the time is over: {delays_s:?}");
    }
}
