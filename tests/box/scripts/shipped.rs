//! The scripts that come with the gateway.

use super::*;
use gateway::pipeline::{Channels, CycleFollower};
use rules::estimators::wear::WearEstimator;
use rules::script::{list_shipped_scripts, list_words};

#[test]
fn the_shipped_scripts_compile_and_run_with_and_without_values() {
    let mut host = Host::new();
    host.load_scripts(&list_shipped_scripts()).unwrap_or_else(|problems| panic!("{}", told(&problems)));
    assert_eq!(host.settings().get("c1"), Some(0.15));
    let numbers: Vec<(&str, f64)> = list_words()
        .iter()
        .filter(|word| ChannelId::from_name(word.name).is_some())
        .map(|word| (word.name, 1.0))
        .collect();
    let numbers: Vec<_> = numbers
        .into_iter()
        .filter(|(name, _)| {
            ChannelId::from_name(name).is_some_and(|id| id.channel().kind != adapters::channel::Kind::Text)
        })
        .collect();
    for tick in 0..600 {
        let at_s = f64::from(tick) / 10.0;
        let values: &[(&str, f64)] = if tick % 200 < 100 { &numbers } else { &[] };
        let decision = host.run_due_scripts(&sample(at_s, values), &cutting(at_s, 100.0));
        assert!(decision.problems.is_empty(), "{}", told(&decision.problems));
    }
    assert!(host.status().is_healthy(), "{:?}", host.status());
}

#[test]
fn the_shipped_constant_load_slows_a_heavy_cut_and_lets_go_afterwards() {
    let (mut host, mut loads) = (Host::new(), LoadEstimator::default());
    host.load_scripts(&list_shipped_scripts()).expect("they compile");
    let cut = [("spindle_load_pct", 95.0), ("feed_mm_min", 200.0), ("feed_programmed_mm_min", 200.0)];
    let at = |tick: i32| f64::from(tick) / 10.0;
    let heavy: Vec<Option<f64>> =
        (10..110).map(|tick| request_with_loads((&mut host, &mut loads), at(tick), &cut)).collect();
    let last = heavy.last().copied().flatten().expect("a heavy cut is slowed down");
    assert!(last < 90.0, "{last}");
    let without = request_with_loads((&mut host, &mut loads), 11.1, &cut[1..]);
    assert_eq!(without, None, "without the load nothing is asked for, at this very tick");
}

/// Parts of 100 s: a light cut, a heavy one, and a second tool. From the fifth part on the first tool takes as much more as the
/// argument says. Gives the alarms of tool wear with the part in which each changed.
fn parts(count: u32, worn: f64) -> Vec<String> {
    let mut host = Host::new();
    host.load_scripts(&list_shipped_scripts()).expect("they compile");
    let mut wear = WearEstimator::default();
    let mut changes = Vec::new();
    for tick in 0..count * 1000 {
        let (at_s, part, in_part) = (f64::from(tick) / 10.0, tick / 1000, tick % 1000);
        let (tool, power_w) = match in_part {
            0..400 => ("T1", 300.0),
            400..700 => ("T1", 2200.0),
            _ => ("T2", 900.0),
        };
        let factor = if part >= 5 && tool == "T1" { worn } else { 1.0 };
        let mut sample = sample(at_s, &[("feed_mm_min", 120.0), ("part_count", f64::from(part))]);
        set_text(&mut sample, "tool", tool);
        set_text(&mut sample, "program", "O1001");
        let mut estimates = cutting(at_s, factor * power_w);
        wear.update_estimates(&sample, &mut estimates);
        for change in &host.run_due_scripts(&sample, &estimates).alarms {
            if change.name.starts_with("tool_w") {
                changes.push(format!("{}{} in part {part}", if change.raised { '+' } else { '-' }, change.name));
            }
        }
    }
    changes
}

#[test]
fn the_shipped_tool_wear_takes_no_heavy_cut_for_a_worn_edge() {
    assert_eq!(parts(12, 1.0), Vec::<String>::new());
    assert_eq!(parts(12, 1.15), Vec::<String>::new(), "a harder lot of material");
}

#[test]
fn the_shipped_tool_wear_tells_a_worn_edge() {
    // Parts 5, 6 and 7 are worn; it is told when the third of them is over, and stands.
    assert_eq!(parts(12, 1.8), ["+tool_worn_T1 in part 8"]);
}

#[test]
fn the_shipped_energy_counts_what_it_should() {
    let (mut host, mut parts, channels) = (Host::new(), CycleFollower::default(), Channels::new());
    host.load_scripts(&list_shipped_scripts()).expect("they compile");
    let mut notes = Vec::new();
    for tick in 0..=36_000_u32 {
        let at_s = f64::from(tick) / 10.0;
        let part = f64::from(tick / 36_000);
        let (sample, mut estimates) =
            (sample(at_s, &[("total_power_w", 2000.0), ("part_count", part)]), cutting(at_s, 500.0));
        let _finished = parts.follow_tick(&channels, &sample, &estimates);
        estimates.part = parts.last_figures();
        let decision = host.run_due_scripts(&sample, &estimates);
        notes.extend(
            decision.notes.iter().filter(|note| &*note.script == "energy.rhai").map(|note| note.text.to_string()),
        );
    }
    assert_eq!(notes, ["part 1.0: 2.0 kWh, 25.0 % of it cutting, 0.0 s idle"]);
}

#[test]
fn every_word_can_be_read() {
    for word in list_words() {
        let text = format!("let x = {};", word.name);
        compile_scripts(&[file("word.rhai", &text)]).unwrap_or_else(|problems| panic!("{}", told(&problems)));
    }
}

#[test]
fn the_same_samples_give_the_same_decisions() {
    let run = || {
        let (mut host, mut loads) = (Host::new(), LoadEstimator::default());
        host.load_scripts(&list_shipped_scripts()).expect("they compile");
        let mut text = String::new();
        let mut seed = 1_u64;
        for tick in 0..5000 {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let random = (seed >> 40) as f64 / 16_777_216.0;
            let slow = f64::from(tick % 400) / 400.0;
            let at_s = f64::from(tick) / 10.0;
            let values = [
                ("spindle_load_pct", 150.0 * slow + 10.0 * random),
                ("total_power_w", 3000.0 * random),
                ("part_count", f64::from(tick / 500)),
                ("feed_mm_min", 200.0),
                ("feed_programmed_mm_min", 200.0),
            ];
            let provided = if seed.is_multiple_of(7) { &values[1..] } else { &values[..] };
            let (sample, mut estimates) = (sample(at_s, provided), cutting(at_s, 900.0 * random));
            loads.step(&sample, &mut estimates, host.settings());
            text += &format!("{:?}\n", host.run_due_scripts(&sample, &estimates));
        }
        text
    };
    let first = run();
    assert!(first.contains("raised: true") && first.contains("constant load"));
    assert!(first == run(), "two runs differ");
}
