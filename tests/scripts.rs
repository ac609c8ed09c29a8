//! The script host: what scripts can do, what they cannot, and what happens when they fail.

use adapters::clock::SECOND_NS;
use adapters::{Absence, ChannelId, Sample, Slot, Value};
use rules::estimators::{Estimate, Estimates, State};
use rules::script::{self, Condition, Host, Problem, ScriptFile, compile, shipped, words};
use std::time::{Duration, Instant};

fn file(name: &str, text: &str) -> ScriptFile {
    ScriptFile { name: name.to_owned(), text: text.to_owned() }
}

/// A host in which one script is in charge.
fn host(text: &str) -> Host {
    let mut host = Host::new();
    host.load(&[file("test.rhai", text)]).unwrap_or_else(|problems| panic!("{}", told(&problems)));
    host
}

fn told(problems: &[Problem]) -> String {
    problems.iter().map(|problem| format!("{problem}\n")).collect()
}

fn sample(at_s: f64, values: &[(&str, f64)]) -> Sample {
    let mut sample = Sample::empty((at_s * SECOND_NS as f64) as i64);
    for (name, value) in values {
        let id = ChannelId::of(name).expect("a channel");
        sample.set(id, Slot { value: Value::number(*value), age_ns: 0 });
    }
    sample
}

fn set_text(sample: &mut Sample, name: &str, text: &str) {
    let id = ChannelId::of(name).expect("a channel");
    sample.set(id, Slot { value: Ok(Value::Text(text.into())), age_ns: 0 });
}

fn cutting(at_s: f64, power_w: f64) -> Estimates {
    let at_ns = (at_s * SECOND_NS as f64) as i64;
    let mut estimates = Estimates::none(at_ns);
    estimates.state = State::Cutting;
    estimates.since_ns = 0;
    estimates.cutting_power_w = Ok(Estimate { value: power_w, sd: 5.0 });
    estimates
}

/// Runs ticks at 10 Hz and returns the names of raised (+) and cleared (-) alarms with their time.
fn alarms(host: &mut Host, channel: &str, values: &[f64]) -> Vec<String> {
    let mut changes = Vec::new();
    for (tick, value) in values.iter().enumerate() {
        let at_s = tick as f64 / 10.0;
        let decision = host.tick(&sample(at_s, &[(channel, *value)]), &cutting(at_s, 100.0));
        assert!(decision.problems.is_empty(), "{}", told(&decision.problems));
        for change in &decision.alarms {
            changes.push(format!("{}{} at {at_s}", if change.raised { '+' } else { '-' }, change.name));
        }
    }
    changes
}

fn request(host: &mut Host, at_s: f64, values: &[(&str, f64)]) -> Option<f64> {
    host.tick(&sample(at_s, values), &cutting(at_s, 100.0)).request.as_ref().map(|request| request.pct)
}

#[test]
fn the_shipped_scripts_compile_and_run_with_and_without_values() {
    let mut host = Host::new();
    host.load(&shipped()).unwrap_or_else(|problems| panic!("{}", told(&problems)));
    assert_eq!(host.settings().get("c1"), Some(0.15));
    let numbers: Vec<(&str, f64)> =
        words().iter().filter(|word| ChannelId::of(word.name).is_some()).map(|word| (word.name, 1.0)).collect();
    let numbers: Vec<_> = numbers
        .into_iter()
        .filter(|(name, _)| ChannelId::of(name).is_some_and(|id| id.channel().kind != adapters::channel::Kind::Text))
        .collect();
    for tick in 0..600 {
        let at_s = f64::from(tick) / 10.0;
        let values: &[(&str, f64)] = if tick % 200 < 100 { &numbers } else { &[] };
        let decision = host.tick(&sample(at_s, values), &cutting(at_s, 100.0));
        assert!(decision.problems.is_empty(), "{}", told(&decision.problems));
    }
    assert!(host.status().well(), "{:?}", host.status());
}

#[test]
fn the_shipped_constant_load_slows_a_heavy_cut_and_lets_go_afterwards() {
    let mut host = Host::new();
    host.load(&shipped()).expect("they compile");
    let heavy: Vec<Option<f64>> =
        (10..110).map(|tick| request(&mut host, f64::from(tick) / 10.0, &[("spindle_load_pct", 95.0)])).collect();
    let last = heavy.last().copied().flatten().expect("a heavy cut is slowed down");
    assert!(last < 90.0, "{last}");
    assert_eq!(request(&mut host, 11.1, &[]), None, "without the load nothing is asked for");
}

#[test]
fn the_shipped_tool_wear_tells_a_worn_edge_and_begins_anew_with_the_next() {
    let mut host = Host::new();
    host.load(&shipped()).expect("they compile");
    let mut raised = Vec::new();
    for tick in 0..3600 {
        let at_s = f64::from(tick) / 10.0;
        let power_w = if tick < 1200 { 1000.0 } else { 1000.0 + f64::from(tick - 1200) };
        let mut sample = sample(at_s, &[]);
        set_text(&mut sample, "tool", if tick < 3000 { "T1" } else { "T2" });
        for change in &host.tick(&sample, &cutting(at_s, power_w)).alarms {
            raised.push(format!("{}{}", if change.raised { '+' } else { '-' }, change.name));
        }
    }
    assert_eq!(raised, ["+tool_wear", "+tool_worn", "-tool_wear", "-tool_worn"]);
}

#[test]
fn the_shipped_energy_counts_what_it_should() {
    let mut host = Host::new();
    host.load(&shipped()).expect("they compile");
    let mut notes = Vec::new();
    for tick in 0..=36_000_u32 {
        let at_s = f64::from(tick) / 10.0;
        let part = f64::from(tick / 36_000);
        let values = [("total_power_w", 2000.0), ("part_count", part)];
        let decision = host.tick(&sample(at_s, &values), &cutting(at_s, 500.0));
        notes.extend(
            decision.notes.iter().filter(|note| &*note.script == "energy.rhai").map(|note| note.text.to_string()),
        );
    }
    assert_eq!(notes, ["part 1.0: 2.0 kWh, 25.0 % of it cutting, 0.0 s idle"]);
}

#[test]
fn every_word_can_be_read() {
    for word in words() {
        let text = format!("let x = {};", word.name);
        compile(&[file("word.rhai", &text)]).unwrap_or_else(|problems| panic!("{}", told(&problems)));
    }
}

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
    assert_eq!(host.tick(&sample(0.0, &[("spindle_load_pct", 120.0)]), &cutting(0.0, 1.0)).alarms.len(), 1);
    assert!(host.tick(&sample(0.1, &[]), &cutting(0.1, 1.0)).alarms.is_empty());
    assert_eq!(host.alarms().len(), 1);
    let cleared = &host.tick(&sample(0.2, &[("spindle_load_pct", 10.0)]), &cutting(0.2, 1.0)).alarms;
    assert!(cleared.len() == 1 && !cleared[0].raised);
}

#[test]
fn a_plain_alarm_stands_while_its_line_is_reached() {
    let mut host = host("if spindle_load_pct > 50.0 { alarm(\"a\", \"text\") }");
    assert_eq!(alarms(&mut host, "spindle_load_pct", &[10.0, 60.0, 70.0, 10.0]), ["+a at 0.1", "-a at 0.3"]);
}

#[test]
fn a_comparison_with_a_missing_value_is_false_and_arithmetic_waits() {
    let mut quiet = host("if spindle_load_pct > 50.0 || spindle_load_pct < 50.0 { alarm(\"a\", \"\") }");
    assert!(quiet.tick(&sample(0.0, &[]), &Estimates::none(0)).alarms.is_empty());

    let mut host = host("request_feed_override(150.0 - spindle_load_pct, \"load\");");
    assert_eq!(request(&mut host, 0.0, &[("spindle_load_pct", 70.0)]), Some(80.0));
    assert_eq!(request(&mut host, 0.1, &[]), None, "a request does not outlive its reason");
    let status = host.status();
    let Condition::Waiting(problem) = &status.scripts[0].condition else { panic!("{status:?}") };
    assert_eq!(
        problem.to_string(),
        "test.rhai:1:29: spindle_load_pct has no value (not_provided)\n    \
         ask has(x) first, or write (x ?? 0.0) to use another number where x has no value"
    );
    assert_eq!(request(&mut host, 0.2, &[("spindle_load_pct", 60.0)]), Some(90.0), "it goes on by itself");
    assert!(host.status().well());
}

#[test]
fn the_reason_of_absence_reaches_the_operator() {
    let mut host = host("note(`power ${spindle_power_w + 1.0}`);");
    let mut sample = sample(0.0, &[]);
    sample.set(ChannelId::of("spindle_power_w").expect("a channel"), Slot::absent(Absence::Timeout));
    host.tick(&sample, &Estimates::none(0));
    assert!(format!("{:?}", host.status()).contains("spindle_power_w has no value (timeout)"));
}

#[test]
fn the_least_request_counts_and_no_number_goes_first() {
    let mut host = Host::new();
    let ask = |name: &str, pct: &str| file(name, &format!("request_feed_override({pct}, \"{name}\");"));
    host.load(&[ask("a.rhai", "90"), ask("b.rhai", "80.5"), ask("c.rhai", "95")]).expect("they compile");
    assert_eq!(request(&mut host, 0.0, &[]), Some(80.5));
    host.load(&[ask("a.rhai", "90"), ask("b.rhai", "0.0/0.0")]).expect("they compile");
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
        let decision = host.tick(&sample(at_s, &[("spindle_load_pct", 60.0)]), &cutting(at_s, 1.0));
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
    host.tick(&sample(0.0, &[]), &Estimates::none(0));
    let decision = host.tick(&sample(3600.0, &[]), &Estimates::none(0)).clone();
    assert_eq!(&*decision.notes[0].text, "dt 0.0");
    assert!(decision.alarms.is_empty(), "an hour without ticks is not an hour in which the condition held");
    let back = host.tick(&sample(10.0, &[]), &Estimates::none(0));
    assert!(back.problems.is_empty() && back.alarms.is_empty());
}

#[test]
fn a_script_that_fails_is_replaced_by_its_last_good_version_and_this_is_said() {
    let mut host = host("request_feed_override(90, \"good\");\nalarm(\"stands\", \"\");");
    assert_eq!(request(&mut host, 0.0, &[]), Some(90.0));
    let bad = "request_feed_override(80, \"bad\");\nlet a = [1];\nif now_s > 0.25 { a[7] = 1; }";
    host.load(&[file("test.rhai", bad)]).expect("it compiles");
    assert_eq!(request(&mut host, 0.1, &[]), Some(80.0), "the new version runs");
    let failed = host.tick(&sample(0.3, &[]), &Estimates::none(0)).clone();
    assert_eq!(failed.request, None, "at the failure the request ends");
    assert!(failed.problems[0].to_string().starts_with("test.rhai:3:"), "{}", failed.problems[0]);
    assert!(failed.alarms.iter().any(|alarm| &*alarm.name == script::SCRIPT_STOPPED && alarm.raised));
    assert_eq!(request(&mut host, 0.4, &[]), Some(90.0), "the version before it is in charge");
    assert_eq!(host.status().scripts[0].condition.word(), "reverted");
    assert!(!host.status().well());

    host.load(&[file("test.rhai", "request_feed_override(85, \"mended\");")]).expect("it compiles");
    let mended = host.tick(&sample(0.5, &[]), &Estimates::none(0)).clone();
    assert_eq!(mended.request.map(|request| request.pct), Some(85.0));
    assert!(mended.alarms.iter().any(|alarm| &*alarm.name == script::SCRIPT_STOPPED && !alarm.raised));
    assert!(host.status().well() && host.alarms().is_empty(), "{:?}", host.alarms());
}

#[test]
fn a_script_without_a_good_version_is_suspended_and_the_others_go_on() {
    let mut host = Host::new();
    host.load(&[file("bad.rhai", "throw \"no\";"), file("good.rhai", "request_feed_override(90, \"good\");")])
        .expect("they compile");
    assert_eq!(request(&mut host, 0.0, &[]), Some(90.0));
    let words: Vec<&str> = host.status().scripts.iter().map(|script| script.condition.word()).collect();
    assert_eq!(words, ["suspended", "running"]);
    assert!(host.tick(&sample(0.1, &[]), &Estimates::none(0)).problems.is_empty(), "it is told once");
    assert_eq!(host.alarms().len(), 1);
}

#[test]
fn a_set_with_one_broken_script_changes_nothing() {
    let mut host = host("request_feed_override(90, \"good\"); memory.n = (memory.n ?? 0) + 1; note(`${memory.n}`);");
    request(&mut host, 0.0, &[]);
    let two = [file("test.rhai", "request_feed_override(70, \"new\");"), file("x.rhai", "alarm(")];
    assert!(host.load(&two).is_err());
    assert_eq!(request(&mut host, 0.1, &[]), Some(90.0));
    assert!(!host.status().well());
    assert_eq!(host.status().refused[0].file, "x.rhai");
    let same = "request_feed_override(90, \"good\"); memory.n = (memory.n ?? 0) + 1; note(`${memory.n}`);";
    host.load(&[file("test.rhai", same)]).expect("it compiles");
    let decision = host.tick(&sample(0.2, &[]), &Estimates::none(0));
    assert_eq!(&*decision.notes[0].text, "3", "an unchanged script keeps its memory");
    assert!(host.status().well());
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
    let Err(problems) = compile(&two) else { panic!("it compiles") };
    let text = told(&problems);
    for part in ["b.rhai:2:17", "did you mean c2_on", "outside 0.002", "dwell_s needs a number", "c.rhai"] {
        assert!(text.contains(part), "{part}:\n{text}");
    }
    let Err(problems) = compile(
        &two[..1].iter().cloned().chain([file("b.rhai", "fn settings() { #{ c1: 0.3 } }")]).collect::<Vec<_>>(),
    ) else {
        panic!("it compiles")
    };
    assert!(told(&problems).contains("the setting c1 is also given in a.rhai"), "{}", told(&problems));
}

/// Scripts that want everything: time, memory, depth.
const MAD: [(&str, &str); 18] = [
    ("endless loop", "loop {}"),
    ("endless while", "while true { let x = 1; }"),
    ("recursion", "fn f(x) { f(x + 1) } f(0);"),
    ("string growth", "let s = \"x\"; loop { s += s; }"),
    ("array growth", "let a = []; loop { a.push(a.len()); }"),
    ("array in array", "let a = [1]; loop { a = [a, a]; }"),
    ("map growth", "let i = 0; loop { memory[`k${i}`] = i; i += 1; }"),
    ("nested map growth", "memory.a = #{}; let i = 0; while i < 2000 { memory.a[`k${i}`] = i; i += 1; }"),
    ("long keys", "let s = \"\"; s.pad(2000, 'x'); let m = #{}; let i = 0; loop { m[s + i] = i; i += 1; }"),
    ("a long range", "for i in 0..1000000000 { let x = i; }"),
    ("a long range by steps", "for i in range(0, 9000000000000, 1) { let x = i; }"),
    ("padding", "let s = \"\"; s.pad(1000000000, 'x');"),
    ("array padding", "let a = []; a.pad(1000000000, 1);"),
    ("sorting for ever", "let a = []; for i in 0..250 { a.push(250 - i); } loop { let b = a; b.sort(); }"),
    ("searching for ever", "let s = \"\"; s.pad(2000, 'x'); loop { s.index_of(\"y\"); }"),
    ("copying for ever", "let a = []; a.pad(250, 1.5); loop { let b = a; }"),
    ("alarms without end", "let i = 0; loop { alarm(`a${i}`, \"\"); i += 1; }"),
    ("timers without end", "let i = 0; loop { held_s(`a${i}`, true); i += 1; }"),
];

#[test]
fn a_mad_script_is_stopped_and_told_and_the_next_tick_runs() {
    for (what, text) in MAD {
        let mut host = Host::new();
        let good = file("good.rhai", "request_feed_override(90, \"good\");");
        host.load(&[file("mad.rhai", &format!("request_feed_override(10, \"mad\");\n{text}")), good]).expect(what);
        let began = Instant::now();
        let decision = host.tick(&sample(0.0, &[]), &Estimates::none(0)).clone();
        let took = began.elapsed();
        println!(
            "{what:24} {:8.3} ms  {}",
            took.as_secs_f64() * 1e3,
            told(&decision.problems).lines().next().unwrap_or_default()
        );
        assert_eq!(decision.problems.len(), 1, "{what} was not stopped");
        assert_eq!(decision.request.map(|request| request.pct), Some(90.0), "{what}: its request ends");
        assert!(took < Duration::from_millis(500), "{what} took {took:?}");
        assert_eq!(request(&mut host, 0.1, &[]), Some(90.0));
    }
}

#[test]
fn nothing_outside_is_in_reach() {
    for text in [
        "eval(\"1\")",
        "import \"x\" as y;",
        "print(1)",
        "debug(1)",
        "sleep(10)",
        "timestamp()",
        "rand()",
        "let f = Fn(\"sleep\"); f.call(1)",
        "open(\"/etc/passwd\")",
    ] {
        assert!(compile(&[file("x.rhai", text)]).is_err(), "{text} compiles");
    }
    let mut by_name = host("[10].map(\"sleep\");");
    assert_eq!(by_name.tick(&sample(0.0, &[]), &Estimates::none(0)).problems.len(), 1);
    let deep = format!("let x = {}1{};", "(".repeat(5000), ")".repeat(5000));
    assert!(compile(&[file("x.rhai", &deep)]).is_err());
    assert!(compile(&[file("x.rhai", &"x".repeat(script::TEXT_MAX + 1))]).is_err());
}

#[test]
fn the_same_samples_give_the_same_decisions() {
    let run = || {
        let mut host = Host::new();
        host.load(&shipped()).expect("they compile");
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
            ];
            let provided = if seed.is_multiple_of(7) { &values[1..] } else { &values[..] };
            text += &format!("{:?}\n", host.tick(&sample(at_s, provided), &cutting(at_s, 900.0 * random)));
        }
        text
    };
    let first = run();
    assert!(first.contains("raised: true") && first.contains("constant load"));
    assert!(first == run(), "two runs differ");
}

proptest::proptest! {
    #[test]
    fn no_text_makes_the_compiler_panic(
        text in "(let |if |fn |settings|alarm|memory|state|\\(|\\)|\\{|\\}|#\\{|\\[|\\]|;|=|\"|`|\\$\\{|//|[a-z]{1,3}|[0-9.]{1,4}|\\+|\\||\n|\\PC){0,40}"
    ) {
        if let Ok(set) = compile(&[file("x.rhai", &text)]) {
            let mut host = Host::new();
            host.install(set);
            host.tick(&sample(0.0, &[]), &Estimates::none(0));
        }
    }
}
