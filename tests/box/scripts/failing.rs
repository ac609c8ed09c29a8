//! Scripts that fail, and who is in charge then.

use super::*;
use rules::script::SCRIPT_STOPPED;

#[test]
fn a_script_that_fails_is_replaced_by_its_last_good_version_and_this_is_said() {
    let mut host = host("request_feed_override(90, \"good\");\nalarm(\"stands\", \"\");");
    assert_eq!(request(&mut host, 0.0, &[]), Some(90.0));
    let bad = "request_feed_override(80, \"bad\");\nlet a = [1];\nif now_s > 0.25 { a[7] = 1; }";
    host.load_scripts(&[file("test.rhai", bad)]).expect("it compiles");
    assert_eq!(request(&mut host, 0.1, &[]), Some(80.0), "the new version runs");
    let failed = host.run_due_scripts(&sample(0.3, &[]), &Estimates::without_samples(0)).clone();
    assert_eq!(failed.request, None, "at the failure the request ends");
    assert!(failed.problems[0].to_string().starts_with("test.rhai:3:"), "{}", failed.problems[0]);
    assert!(failed.alarms.iter().any(|alarm| &*alarm.name == SCRIPT_STOPPED && alarm.raised));
    assert_eq!(request(&mut host, 0.4, &[]), Some(90.0), "the version before it is in charge");
    assert_eq!(host.status().scripts[0].condition.as_word(), "reverted");
    assert!(!host.status().is_healthy());

    host.load_scripts(&[file("test.rhai", "request_feed_override(85, \"mended\");")]).expect("it compiles");
    let mended = host.run_due_scripts(&sample(0.5, &[]), &Estimates::without_samples(0)).clone();
    assert_eq!(mended.request.map(|request| request.pct), Some(85.0));
    assert!(mended.alarms.iter().any(|alarm| &*alarm.name == SCRIPT_STOPPED && !alarm.raised));
    assert!(host.status().is_healthy() && host.alarms().is_empty(), "{:?}", host.alarms());
}

#[test]
fn a_script_without_a_good_version_is_suspended_and_the_others_go_on() {
    let mut host = Host::new();
    host.load_scripts(&[file("bad.rhai", "throw \"no\";"), file("good.rhai", "request_feed_override(90, \"good\");")])
        .expect("they compile");
    assert_eq!(request(&mut host, 0.0, &[]), Some(90.0));
    let words: Vec<&str> = host.status().scripts.iter().map(|script| script.condition.as_word()).collect();
    assert_eq!(words, ["suspended", "running"]);
    assert!(
        host.run_due_scripts(&sample(0.1, &[]), &Estimates::without_samples(0)).problems.is_empty(),
        "it is told once"
    );
    assert_eq!(host.alarms().len(), 1);
}

#[test]
fn a_set_with_one_broken_script_changes_nothing() {
    let mut host = host("request_feed_override(90, \"good\"); memory.n = (memory.n ?? 0) + 1; note(`${memory.n}`);");
    request(&mut host, 0.0, &[]);
    let two = [file("test.rhai", "request_feed_override(70, \"new\");"), file("x.rhai", "alarm(")];
    assert!(host.load_scripts(&two).is_err());
    assert_eq!(request(&mut host, 0.1, &[]), Some(90.0));
    assert!(!host.status().is_healthy());
    assert_eq!(host.status().refused[0].file, "x.rhai");
    let same = "request_feed_override(90, \"good\"); memory.n = (memory.n ?? 0) + 1; note(`${memory.n}`);";
    host.load_scripts(&[file("test.rhai", same)]).expect("it compiles");
    let decision = host.run_due_scripts(&sample(0.2, &[]), &Estimates::without_samples(0));
    assert_eq!(&*decision.notes[0].text, "3", "an unchanged script keeps its memory");
    assert!(host.status().is_healthy());
}

#[test]
fn settings_reach_the_estimators_and_are_checked_together() {
    let host = host("fn settings() { #{ c1: 0.2, window_samples: 20, no_load_stage_1: [[500, 300.0], [1000, 400]] } }");
    assert_eq!(host.settings().get("c1"), Some(0.2));
    assert_eq!(host.settings().get("window_samples"), Some(20.0));
    let two = [
        file("a.rhai", "fn settings() { #{ c1: 0.2 } }"),
        file("b.rhai", "fn settings() {\n    #{ c1: 0.3, c2_onn: 1, c2_off: 7.0, dwell_s: \"x\" }\n}"),
        file("c.rhai", "fn settings() { 5 }"),
    ];
    let Err(problems) = compile_scripts(&two) else { panic!("it compiles") };
    let text = told(&problems);
    for part in ["b.rhai:2:17", "did you mean c2_on", "outside 0.002", "dwell_s needs a number", "c.rhai"] {
        assert!(text.contains(part), "{part}:\n{text}");
    }
    let Err(problems) = compile_scripts(
        &two[..1].iter().cloned().chain([file("b.rhai", "fn settings() { #{ c1: 0.3 } }")]).collect::<Vec<_>>(),
    ) else {
        panic!("it compiles")
    };
    assert!(told(&problems).contains("the setting c1 is also given in a.rhai"), "{}", told(&problems));
}
