//! What scripts can say besides alarms and a feed: records, handlers, stops, offsets, channels of their own; and what they
//! remember.

use super::*;
use adapters::Absence;
use rules::script::{AlarmLevel, Axis, Stop};

fn refused(text: &str) -> String {
    told(&compile_scripts(&[file("x.rhai", text)]).err().expect("refused"))
}

#[test]
fn records_say_value_age_and_reason() {
    let mut host = host(
        "note(`${sample.spindle_load_pct} ${age_s.spindle_load_pct} ${has(missing.spindle_load_pct)}`);\n\
         note(`${has(sample.spindle_power_w)} ${missing.spindle_power_w} ${missing.no_load_power_w}`);\n\
         note(`${estimates.cutting_power_w} ${estimates.cutting_power_sd_w} ${estimates.state}`);",
    );
    let mut sample = sample(1.0, &[]);
    let of = |name| ChannelId::from_name(name).expect("a channel");
    sample.set_slot(of("spindle_load_pct"), Slot { value: Value::from_number(42.0), age_ns: SECOND_NS / 4 });
    sample.set_slot(of("spindle_power_w"), Slot::from_absence(Absence::Stale));
    let decision = host.run_due_scripts(&sample, &cutting(1.0, 100.0));
    let notes: Vec<&str> = decision.notes.iter().map(|note| &*note.text).collect();
    assert_eq!(notes, ["42.0 0.25 false", "false stale not_yet", "100.0 5.0 cutting"]);
}

#[test]
fn a_misspelt_field_is_told_before_the_script_runs() {
    let text = refused("let x = 1;\nif sample.spindel_power_w > 5.0 { note(\"\") }");
    assert!(text.starts_with("x.rhai:2:11: there is no `sample.spindel_power_w`"), "{text}");
    assert!(text.contains("did you mean `sample.spindle_power_w`?"), "{text}");
    assert!(refused("let x = sample.cutting_power_w;").contains("write `estimates.cutting_power_w`"));
    assert!(refused("let x = sample;").contains("used as a whole"));
    assert!(refused("let x = sample[\"tool\"];").contains("used as a whole"));
    assert!(refused("fn f() { sample.tool } f();").contains("hand the value over"));
}

#[test]
fn a_field_without_a_value_makes_the_script_wait() {
    let mut host = host("request_feed_override(2.0 * sample.spindle_load_pct, \"twice\");");
    assert_eq!(request(&mut host, 0.0, &[]), None);
    let ScriptCondition::Waiting(problem) = &host.status().scripts[0].condition.clone() else {
        panic!("{:?}", host.status())
    };
    assert!(problem.what.contains("spindle_load_pct has no value (not_provided)"), "{problem}");
    assert_eq!(request(&mut host, 0.1, &[("spindle_load_pct", 40.0)]), Some(80.0));
}

/// Runs a script over tools and part counts; all notes.
fn notes_of(text: &str, ticks: &[(&str, f64, State)]) -> Vec<String> {
    let mut host = host(text);
    let mut notes = Vec::new();
    for (tick, (tool, count, state)) in ticks.iter().enumerate() {
        let at_s = tick as f64 / 10.0;
        let mut sample = sample(at_s, &[("part_count", *count)]);
        set_text(&mut sample, "tool", tool);
        let estimates = Estimates { state: *state, ..cutting(at_s, 100.0) };
        let decision = host.run_due_scripts(&sample, &estimates);
        assert!(decision.problems.is_empty(), "{}", told(&decision.problems));
        notes.extend(decision.notes.iter().map(|note| format!("{tick} {}", note.text)));
    }
    notes
}

#[test]
fn handlers_see_constants_variables_and_memory() {
    let text = "const LIMIT = 7;\n\
                fn on_tool_change(before, now) { note(`${before} to ${now} after ${memory.runs} limit ${LIMIT} ${state}`); }\n\
                fn on_part_finished(count) { note(`part ${count} ${twice(count)}`); memory.parts = (memory.parts ?? 0) + 1; }\n\
                fn on_state_change() { note(`now ${state}`); }\n\
                fn twice(x) { 2.0 * x }\n\
                memory.runs = (memory.runs ?? 0) + 1;";
    let ticks = [
        ("T1", 1.0, State::Idle),
        ("T1", 1.0, State::Cutting),
        ("T2", 1.0, State::Cutting),
        ("T2", 2.0, State::Cutting),
    ];
    let expected = ["1 now cutting", "2 T1 to T2 after 2 limit 7 cutting", "3 part 2.0 4.0"];
    assert_eq!(notes_of(text, &ticks), expected);
}

#[test]
fn a_handler_runs_at_its_tick_also_when_the_script_has_a_slower_pace() {
    let text = "const EVERY_S = 10.0;\nfn on_tool_change(before, now) { raise_alarm(\"tool\", \"info\", \"new\", \"新\"); note(now) }\n\
                alarm(\"stands\", \"\");";
    let mut host = host(text);
    let mut seen = Vec::new();
    for (tick, tool) in ["T1", "T1", "T2", "T2"].iter().enumerate() {
        let at_s = tick as f64 / 10.0;
        let mut sample = sample(at_s, &[]);
        set_text(&mut sample, "tool", tool);
        let decision = host.run_due_scripts(&sample, &cutting(at_s, 1.0));
        seen.extend(decision.alarms.iter().map(|change| (tick, change.name.to_string(), change.level, change.raised)));
    }
    let expected = [(0, "stands", AlarmLevel::Warning), (2, "tool", AlarmLevel::Info)];
    assert_eq!(seen, expected.map(|(tick, name, level)| (tick, name.to_owned(), level, true)));
    assert_eq!(&*host.alarms()[1].zh, "新");
}

#[test]
fn what_is_wrong_with_a_handler_is_told_at_its_place() {
    let text = refused("let x = 1;\nfn on_tool_change(before, now) {\n    note(`${befor} ${x}`);\n}");
    assert!(text.contains("x.rhai:3:13: there is no variable `befor`") && text.contains("`x`"), "{text}");
    assert!(refused("fn on_tool_chang() {}").contains("did you mean `on_tool_change`?"));
    assert!(refused("fn on_alarm(text) { alarm(\"a\", text) }").contains("raise_alarm and clear_alarm work here"));
}

#[test]
fn an_alarm_raised_stands_until_it_is_cleared() {
    let mut host = host(
        "if spindle_load_pct > 90.0 { raise_alarm(\"over\", \"critical\", \"overload\", \"过载\") }\n\
         if spindle_load_pct < 10.0 { clear_alarm(\"over\") }",
    );
    assert_eq!(alarms(&mut host, "spindle_load_pct", &[50.0, 95.0, 50.0, 95.0, 5.0]), ["+over at 0.1", "-over at 0.4"]);
}

#[test]
fn stops_and_offsets_are_asked_for_as_long_as_the_script_asks() {
    let mut host = host(
        "if spindle_load_pct > 90.0 { request_feed_hold(\"overload\"); request_tool_change(\"worn\"); }\n\
         propose_offset_um(\"Z\", -12.5, \"warm\");",
    );
    let decision = host.run_due_scripts(&sample(0.0, &[("spindle_load_pct", 95.0)]), &cutting(0.0, 1.0));
    let stops: Vec<(Stop, &str)> = decision.stops.iter().map(|it| (it.stop, &*it.reason)).collect();
    assert_eq!(stops, [(Stop::FeedHold, "overload"), (Stop::ToolChange, "worn")]);
    assert_eq!((decision.offsets[0].axis, decision.offsets[0].offset_um), (Axis::Z, -12.5));
    let decision = host.run_due_scripts(&sample(0.1, &[("spindle_load_pct", 5.0)]), &cutting(0.1, 1.0));
    assert!(decision.stops.is_empty() && decision.offsets.len() == 1);
    assert!(refused("publish(\"Bad Name\", 1.0, \"W\");").contains("cannot be the name"));
    assert!(refused("propose_offset_um(\"q\", 1.0, \"\");").contains("there is no axis"));
    let mut wrong = self::host("let axis = \"q\"; propose_offset_um(axis, 1.0, \"\");");
    let decision = wrong.run_due_scripts(&sample(0.0, &[]), &cutting(0.0, 1.0));
    assert!(decision.problems[0].what.contains("there is no axis"), "{}", decision.problems[0]);
}

#[test]
fn a_channel_of_its_own_is_known_before_it_has_a_value() {
    let mut host = host("if has(spindle_load_pct) { publish(\"heavy_share\", spindle_load_pct / 100.0, \"1\") }");
    let seen = |host: &Host| {
        host.published_channels().map(|it| (it.name.to_owned(), it.unit.to_owned(), it.value)).collect::<Vec<_>>()
    };
    assert_eq!(seen(&host), [("heavy_share".to_owned(), "1".to_owned(), None)]);
    host.run_due_scripts(&sample(0.0, &[("spindle_load_pct", 50.0)]), &cutting(0.0, 1.0));
    assert_eq!(seen(&host)[0].2, Some(0.5));
    assert!(refused("publish(\"tool\", 1.0, \"1\");").contains("a channel or an estimate already"));
    assert!(refused("let n = \"a\"; publish(n, 1.0, \"1\");").contains("are written as texts"));
    let both = [file("a.rhai", "publish(\"x_w\", 1.0, \"W\");"), file("b.rhai", "publish(\"x_w\", 1.0, \"W\");")];
    assert!(told(&compile_scripts(&both).err().expect("refused")).contains("also published in a.rhai"));
}

const COUNTING: &str = "memory.runs = (memory.runs ?? 0) + 1;\n\
                        remember(\"parts/O1\", (recall(\"parts/O1\") ?? 0.0) + 1.0);\n\
                        if changed(\"tool\", tool) { note(\"changed\") }\n\
                        note(`${memory.runs} ${recall(\"parts/O1\")}`);";

fn run_with_tool(host: &mut Host, at_s: f64, tool: &str) -> Vec<String> {
    let mut sample = sample(at_s, &[]);
    set_text(&mut sample, "tool", tool);
    host.run_due_scripts(&sample, &cutting(at_s, 1.0)).notes.iter().map(|note| note.text.to_string()).collect()
}

#[test]
fn memory_survives_a_changed_text_and_a_new_process() {
    let mut host = host(COUNTING);
    assert_eq!(run_with_tool(&mut host, 0.0, "T1"), ["1 1.0"]);
    host.load_scripts(&[file("test.rhai", &format!("// edited\n{COUNTING}"))]).expect("it compiles");
    assert_eq!(run_with_tool(&mut host, 0.1, "T1"), ["2 2.0"], "the edited script goes on");
    let snapshot = serde_json::from_str(&host.take_snapshot().to_string()).expect("JSON");

    let mut later = Host::new();
    later.restore_snapshot(&snapshot);
    later.load_scripts(&[file("other.rhai", "note(\"other\");")]).expect("it compiles");
    assert!(later.take_snapshot().to_string().contains("parts/O1"), "what an absent script remembered is kept for it");
    later.load_scripts(&[file("test.rhai", COUNTING)]).expect("it compiles");
    assert_eq!(run_with_tool(&mut later, 900.0, "T2"), ["changed", "3 3.0"], "a tool changed meanwhile is noticed");
}

#[test]
fn a_version_that_fails_hands_back_what_was_remembered_before_it() {
    let mut host = host(COUNTING);
    run_with_tool(&mut host, 0.0, "T1");
    let bad = "memory.runs = 1000; remember(\"parts/O1\", 1000.0); if now_s > 0.15 { throw \"no\" }";
    host.load_scripts(&[file("test.rhai", bad)]).expect("it compiles");
    run_with_tool(&mut host, 0.1, "T1");
    run_with_tool(&mut host, 0.2, "T1");
    assert_eq!(run_with_tool(&mut host, 0.3, "T1"), ["2 2.0"]);
}

#[test]
fn a_snapshot_of_anything_is_taken_without_harm() {
    for text in
        ["null", "[]", "{\"scripts\":5}", "{\"scripts\":{\"test.rhai\":{\"memory\":[1],\"last\":{\"tool\":{}}}}}"]
    {
        let mut host = Host::new();
        host.restore_snapshot(&serde_json::from_str(text).expect("JSON"));
        host.load_scripts(&[file("test.rhai", COUNTING)]).expect("it compiles");
        assert_eq!(run_with_tool(&mut host, 0.0, "T1").last().map(String::as_str), Some("1 1.0"), "{text}");
    }
}
