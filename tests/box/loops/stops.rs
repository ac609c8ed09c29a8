//! Feed hold and stop: asked of the ladder once, seen to by the operator, asked again only for a new reason.

use super::bench::{Bench, limits, script};
use adapters::simulated::{LaterChange, SimulatedSettings};
use adapters::words::execution;
use rules::script::list_shipped_scripts;

fn settings() -> SimulatedSettings {
    let mut settings = SimulatedSettings { seed: 5, ..SimulatedSettings::default() };
    settings.meter.dropouts_per_h = 0.0;
    settings
}

/// The shipped `teach` watches three parts. Then the material is nearly three times as hard: the feed goes to its least, the
/// load stays above the learned peak, and after a second of that the feed hold is asked for, once.
#[test]
fn an_overload_at_the_least_feed_holds_the_feed_once() {
    let teach = list_shipped_scripts().into_iter().filter(|file| file.name == "teach.rhai").collect::<Vec<_>>();
    assert_eq!(teach.len(), 1, "it is shipped");
    let mut settings = settings();
    settings.change = LaterChange { after_s: 900.0, cut: 2.9, ..settings.change };
    let mut bench = Bench::at_work(settings, &teach, &limits(60.0, 110.0));
    let (mut held_s, mut least_before) = (None, 100);
    while bench.now_s() < 1400.0 && held_s.is_none_or(|held_s| bench.now_s() < held_s + 40.0) {
        bench.tick();
        if (bench.now_s() - 90.0).abs() < 0.05 {
            bench.arm();
        }
        let counts = bench.machine.written();
        let panel = bench.machine.moment((bench.now_s() * 1e9) as i64).panel;
        if counts.feed_holds == 0 {
            least_before = least_before.min(panel.feed_override_pct);
        } else if held_s.is_none() {
            held_s = Some(bench.now_s());
        }
    }
    let held_s = held_s.expect("the feed hold was asked for");
    println!(
        "overload: the material is hard from 900 s on, feed hold asked for at {held_s:.1} s, feed at {least_before} %"
    );
    assert!(held_s > 900.0 && least_before <= 61, "not before the feed was at its least: {least_before} %");
    let counts = bench.machine.written();
    assert_eq!(counts.feed_holds, 1, "forty seconds later still once");
    let panel = bench.machine.moment((bench.now_s() * 1e9) as i64).panel;
    assert_eq!(panel.execution, execution::FEED_HOLD, "the operator has not come yet");
    assert!(bench.faults.is_empty(), "{:?}", bench.faults);
}

/// A script that asks for a tool change in every cut: the machine stands after the part, the operator changes the edge, and
/// only then the next one passes.
#[test]
fn a_tool_change_is_asked_for_once_per_edge() {
    let worn = [script("worn.rhai", "if state == \"cutting\" && state_s > 4.0 { request_tool_change(\"worn\"); }")];
    let mut bench = Bench::at_work(settings(), &worn, &limits(50.0, 120.0));
    let (mut stands, mut standing) = (0, false);
    while bench.now_s() < 1200.0 {
        bench.tick();
        if (bench.now_s() - 90.0).abs() < 0.05 {
            bench.arm();
        }
        let panel = bench.machine.moment((bench.now_s() * 1e9) as i64).panel;
        let stands_now = panel.execution == execution::STOPPED && panel.alarm.is_empty();
        stands += u64::from(stands_now && !std::mem::replace(&mut standing, stands_now));
        standing = stands_now;
    }
    let counts = bench.machine.written();
    println!("stop: {} asked for, the machine stood {stands} times in 1200 s", counts.stops);
    assert!(counts.stops >= 2 && counts.stops <= stands + 1, "{counts:?}, stood {stands} times");
    assert!(bench.faults.is_empty(), "{:?}", bench.faults);
}
