//! The first recipe of the cookbook on the simulated machine at work: teach learns three parts, later the material is harder.

use super::bench::{Bench, limits, script};
use adapters::simulated::{DaySettings, LaterChange, SimulatedSettings, TrueState};
use rules::script::{find_recipe, list_shipped_scripts};

/// For so long nothing is changed; from then on every cut takes so many times the power.
const CHANGE_S: f64 = 2400.0;
const HARDER: f64 = 1.4;

/// The recipe's own setting: for so long it is too much.
const HOLD_S: f64 = 2.0;
/// Until a true excess is seen in the estimate: the beginning of a cut is told from the noise, and the filtered power has risen over the
/// limit.
const SEEN_S: f64 = 1.5;
/// A cut that is too short for the hold is none to ask in.
const LONG_S: f64 = HOLD_S + SEEN_S;

/// What a run shows: requests begun before the change; ticks in which the ladder held 90 %, before it and after it; alarms raised
/// after it; for every true cut that began after the change and lasted long enough, after how long the recipe asked.
#[derive(Default)]
struct Run {
    false_requests: u32,
    in_force: [u32; 2],
    alarms: u32,
    delays_s: Vec<Option<f64>>,
}

/// A true cut that is too heavy from its beginning on.
struct HeavyCut {
    began_s: f64,
    asked_s: Option<f64>,
}

impl Run {
    fn ended(&mut self, cut: &HeavyCut, now_s: f64) {
        if cut.asked_s.is_some() || now_s - cut.began_s >= LONG_S {
            self.delays_s.push(cut.asked_s);
        }
    }
}

fn bench(settings: SimulatedSettings) -> Bench {
    let text = find_recipe("above_learned").expect("a recipe").text;
    let every = text
        .replace("\"program\", \"O1234\"", "\"program\", \"\"")
        .replace("\"tool_name\", \"T3\"", "\"tool_name\", \"\"");
    let teach = list_shipped_scripts().into_iter().find(|file| file.name == "teach.rhai").expect("shipped");
    let teach = script("teach.rhai", teach.text.replace("setting(\"ask\", 1,", "setting(\"ask\", 0,"));
    Bench::at_work(settings, &[script("above_learned.rhai", every), teach], &limits(50.0, 110.0))
}

/// A machine with this seed for so long; `change_s`: when the material becomes harder.
fn run(seed: u64, day: DaySettings, change_s: f64, until_s: f64) -> Run {
    let mut settings = SimulatedSettings { seed, wear_mm: 0.05, day, ..SimulatedSettings::default() };
    settings.meter.dropouts_per_h = 0.0;
    settings.change = LaterChange { after_s: change_s, cut: HARDER, ..settings.change };
    let mut bench = bench(settings);
    let (mut found, mut armed, mut asked) = (Run::default(), false, false);
    let (mut heavy, mut cut_before) = (None::<HeavyCut>, false);
    while bench.now_s() < until_s {
        bench.tick();
        if !armed && bench.now_s() > 30.0 {
            bench.arm();
            armed = true;
        }
        let now_s = bench.now_s();
        let moment = bench.machine.moment((now_s * 1e9) as i64);
        let decision = bench.pipeline.scripts().decision();
        let asks = decision.request.as_ref().is_some_and(|request| request.pct == 90.0);
        let begins = asks && !asked;
        asked = asks;
        let cuts = moment.truth.state == TrueState::Cutting;
        let cut_begins = !std::mem::replace(&mut cut_before, cuts) && cuts;
        let late = now_s >= change_s;
        found.in_force[usize::from(late)] += u32::from(moment.panel.feed_override_pct == 90);
        if !late {
            found.false_requests += u32::from(begins);
            continue;
        }
        let raised = decision.alarms.iter().filter(|alarm| alarm.raised && &*alarm.name == "above_learned").count();
        found.alarms += u32::try_from(raised).expect("few");
        match &mut heavy {
            // The cut during which the material changes does not count: it was not heavy from its beginning on.
            None if cut_begins => heavy = Some(HeavyCut { began_s: now_s, asked_s: None }),
            Some(cut) if cuts && begins => cut.asked_s = Some(now_s - cut.began_s),
            Some(cut) if !cuts => {
                found.ended(cut, now_s);
                heavy = None;
            }
            _ => {}
        }
    }
    found
}

/// The same program all day, so that every place is learned before the change.
fn one_program() -> DaySettings {
    DaySettings { parts_per_lot: u32::MAX, ..DaySettings::default() }
}

#[test]
fn unchanged_material_lowers_nothing() {
    for (name, day) in [("one program", one_program()), ("three programs in lots", DaySettings::default())] {
        for seed in 1..=4 {
            let found = run(seed, day, CHANGE_S, CHANGE_S);
            println!("{name}, seed {seed}, 40 minutes unchanged: {} requests", found.false_requests);
            assert_eq!((found.false_requests, found.in_force[0]), (0, 0), "{name}, seed {seed}");
        }
    }
}

#[test]
fn more_power_than_was_learned_lowers_the_feed_of_the_simulated_machine_and_is_told() {
    let (mut cuts, mut seen, mut least_s, mut greatest_s) = (0, 0, f64::INFINITY, 0.0_f64);
    for seed in 1..=3 {
        let found = run(seed, one_program(), CHANGE_S, 1.5 * CHANGE_S);
        assert_eq!((found.false_requests, found.in_force[0]), (0, 0), "seed {seed}: unchanged");
        assert!(found.in_force[1] > 50 && found.alarms > 0, "seed {seed}: it is lowered and told");
        cuts += found.delays_s.len();
        for delay_s in found.delays_s.iter().flatten() {
            seen += 1;
            (least_s, greatest_s) = (least_s.min(*delay_s), greatest_s.max(*delay_s));
        }
    }
    println!(
        "{HARDER} times the power: asked for in {seen} of {cuts} cuts, {least_s:.1} to {greatest_s:.1} s after the cut began"
    );
    assert!(cuts >= 100 && seen == cuts, "in every one of them");
    assert!(least_s > HOLD_S - 0.05 && greatest_s <= HOLD_S + SEEN_S, "as soon as the time is over");
}
