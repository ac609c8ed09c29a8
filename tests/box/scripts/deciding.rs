//! Alarms, requests, memory, time: what a script can do.

use super::*;
use adapters::Absence;

#[test]
fn an_alarm_has_hysteresis_and_a_minimum_duration() {
    let mut host = host("alarm_above(\"hot\", spindle_load_pct, 100.0, 90.0, 0.5, \"hot\");");
    let mut load = vec![80.0; 5];
    load.extend([105.0; 3]); // too short
    load.extend([95.0; 3]);
    load.extend([105.0; 7]); // from 1.1 s on
    load.extend([95.0; 20]); // not below 90
    load.extend([85.0; 3]); // too short
    load.extend([95.0; 5]);
    load.extend([85.0; 10]); // from 4.6 s on
    assert_eq!(alarms(&mut host, "spindle_load_pct", &load), ["+hot at 1.6", "-hot at 5.1"]);
}

#[test]
fn an_alarm_without_a_value_stays_as_it_is() {
    let mut host = host("alarm_above(\"hot\", spindle_load_pct, 100.0, 90.0, 0.0, \"hot\");");
    assert_eq!(host.run_due_scripts(&sample(0.0, &[("spindle_load_pct", 120.0)]), &cutting(0.0, 1.0)).alarms.len(), 1);
    assert!(host.run_due_scripts(&sample(0.1, &[]), &cutting(0.1, 1.0)).alarms.is_empty());
    assert_eq!(host.alarms().len(), 1);
    let cleared = &host.run_due_scripts(&sample(0.2, &[("spindle_load_pct", 10.0)]), &cutting(0.2, 1.0)).alarms;
    assert!(cleared.len() == 1 && !cleared[0].raised);
}

#[test]
fn a_plain_alarm_stands_while_its_line_is_reached() {
    let mut host = host("if spindle_load_pct > 50.0 { alarm(\"a\", \"text\") }");
    assert_eq!(alarms(&mut host, "spindle_load_pct", &[10.0, 60.0, 70.0, 10.0]), ["+a at 0.1", "-a at 0.3"]);
}

#[test]
fn another_text_of_a_standing_alarm_is_told_and_each_edge_has_its_request() {
    let mut host = host(
        "if part_count >= 1.0 { raise_alarm(\"worn\", \"warning\", `Edge T${part_count.to_int()} worn`, \"T\"); }\n\
         for edge in 1..=part_count.to_int() { request_tool_change(`edge T${edge} is worn`); }\n\
         if part_count >= 4.0 { clear_alarm(\"worn\"); }",
    );
    let mut told = Vec::new();
    for tick in 0..40_u32 {
        let (at_s, part) = (f64::from(tick), f64::from(tick / 10 + 1));
        let decision = host.run_due_scripts(&sample(at_s, &[("part_count", part)]), &cutting(at_s, 1.0));
        let sign = |raised| if raised { '+' } else { '-' };
        told.extend(decision.alarms.iter().map(|change| format!("{}{} at {at_s}", sign(change.raised), change.en)));
        assert_eq!(decision.stops.len() as f64, part, "one request for each edge");
        let standing: Vec<_> = host.alarms().iter().map(|alarm| alarm.en.to_string()).collect();
        assert_eq!(standing, if part < 4.0 { vec![format!("Edge T{part} worn")] } else { Vec::new() });
    }
    let right = ["+Edge T1 worn at 0", "-Edge T1 worn at 10", "+Edge T2 worn at 10", "-Edge T2 worn at 20"];
    assert_eq!(told[..4], right);
    assert_eq!(told[4..], ["+Edge T3 worn at 20", "-Edge T3 worn at 30"]);
}

/// A text with a measured number in it does not make a row of the history at every run.
#[test]
fn a_text_that_changes_all_the_time_is_told_now_and_then() {
    let mut host = host("raise_alarm(\"load\", `load ${spindle_load_pct}`);");
    let mut raised = 0;
    for tick in 0..600 {
        let at_s = 0.1 * f64::from(tick);
        let decision =
            host.run_due_scripts(&sample(at_s, &[("spindle_load_pct", f64::from(tick % 97))]), &cutting(at_s, 1.0));
        raised += decision.alarms.iter().filter(|change| change.raised).count();
    }
    assert_eq!(raised, 12, "every 5 s of 60");
}

#[test]
fn a_comparison_with_a_missing_value_is_false_and_arithmetic_waits() {
    let mut quiet = host("if spindle_load_pct > 50.0 || spindle_load_pct < 50.0 { alarm(\"a\", \"\") }");
    assert!(quiet.run_due_scripts(&sample(0.0, &[]), &Estimates::without_samples(0)).alarms.is_empty());

    let mut host = host("request_feed_override(150.0 - spindle_load_pct, \"load\");");
    assert_eq!(request(&mut host, 0.0, &[("spindle_load_pct", 70.0)]), Some(80.0));
    assert_eq!(request(&mut host, 0.1, &[]), None, "a request does not outlive its reason");
    let status = host.status();
    let ScriptCondition::Waiting(problem) = &status.scripts[0].condition else { panic!("{status:?}") };
    assert_eq!(
        problem.to_string(),
        "test.rhai:1:29: spindle_load_pct has no value (not_provided)\n    \
         ask has(x) first, or write (x ?? 0.0) to use another number where x has no value"
    );
    assert_eq!(request(&mut host, 0.2, &[("spindle_load_pct", 60.0)]), Some(90.0), "it goes on by itself");
    assert!(host.status().is_healthy());
}

#[test]
fn the_reason_of_absence_reaches_the_operator() {
    let mut host = host("note(`power ${spindle_power_w + 1.0}`);");
    let mut sample = sample(0.0, &[]);
    sample.set_slot(ChannelId::from_name("spindle_power_w").expect("a channel"), Slot::from_absence(Absence::Timeout));
    host.run_due_scripts(&sample, &Estimates::without_samples(0));
    assert!(format!("{:?}", host.status()).contains("spindle_power_w has no value (timeout)"));
}

#[test]
fn the_least_request_counts_and_no_number_goes_first() {
    let mut host = Host::new();
    let ask = |name: &str, pct: &str| file(name, &format!("request_feed_override({pct}, \"{name}\");"));
    host.load_scripts(&[ask("a.rhai", "90"), ask("b.rhai", "80.5"), ask("c.rhai", "95")]).expect("they compile");
    assert_eq!(request(&mut host, 0.0, &[]), Some(80.5));
    host.load_scripts(&[ask("a.rhai", "90"), ask("b.rhai", "0.0/0.0")]).expect("they compile");
    assert!(request(&mut host, 0.1, &[]).is_some_and(f64::is_nan), "the gate must see and refuse it");
}

#[test]
fn memory_timers_and_pace() {
    let mut host = host(
        "const EVERY_S = 1.0;\n\
         memory.runs = (memory.runs ?? 0) + 1;\n\
         if held_s(\"on\", spindle_load_pct > 50.0) >= 3.0 { alarm(\"long\", \"\") }\n\
         note(`run ${memory.runs} dt ${dt_s}`);",
    );
    let mut notes = Vec::new();
    let mut raised = Vec::new();
    for tick in 0..60 {
        let at_s = f64::from(tick) / 10.0;
        let decision = host.run_due_scripts(&sample(at_s, &[("spindle_load_pct", 60.0)]), &cutting(at_s, 1.0));
        notes.extend(decision.notes.iter().map(|note| note.text.to_string()));
        raised.extend(decision.alarms.iter().map(|_| at_s));
    }
    assert_eq!(notes[0], "run 1 dt 0.0");
    assert_eq!(notes[5], "run 6 dt 1.0");
    assert_eq!(notes.len(), 6);
    assert_eq!(raised, [3.0]);
}

#[test]
fn a_pause_is_not_bridged() {
    let mut host = host("if held_s(\"on\", true) > 5.0 { alarm(\"long\", \"\") } note(`dt ${dt_s}`);");
    host.run_due_scripts(&sample(0.0, &[]), &Estimates::without_samples(0));
    let decision = host.run_due_scripts(&sample(3600.0, &[]), &Estimates::without_samples(0)).clone();
    assert_eq!(&*decision.notes[0].text, "dt 0.0");
    assert!(decision.alarms.is_empty(), "an hour without ticks is not an hour in which the condition held");
    let back = host.run_due_scripts(&sample(10.0, &[]), &Estimates::without_samples(0));
    assert!(back.problems.is_empty() && back.alarms.is_empty());
}
