//! Trials in script files: what passes, what fails, and where it is said.

use super::*;
use rules::script::{TrialResult, prove_scripts, run_trials};

fn results(text: &str) -> Vec<TrialResult> {
    let set = compile_scripts(&[file("x.rhai", text)]).unwrap_or_else(|problems| panic!("{}", told(&problems)));
    run_trials(&set)
}

const SLOWING: &str = "const LIMIT_PCT = 90.0;\n\
    fn on_tool_change(before, now) { note(`from ${before} to ${now}`); }\n\
    if spindle_load_pct > LIMIT_PCT { request_feed_override(80.0, \"heavy\"); request_feed_hold(\"heavy\"); }\n\
    alarm_above(\"over\", spindle_load_pct, LIMIT_PCT, 80.0, 2.0, \"over\");\n\
    propose_offset_um(\"z\", -5.0, \"warm\"); publish(\"twice_pct\", 2.0 * spindle_load_pct, \"%\");\n";

#[test]
fn a_trial_gives_lets_time_pass_and_expects() {
    let text = format!(
        "{SLOWING}fn trial_a_heavy_cut() {{\n    given(#{{ spindle_load_pct: LIMIT_PCT + 5.0, tool: \"T1\", state: \"cutting\" }});\n    after_s(1.0);\n    \
         expect_override(70, 85); expect_no_alarm(\"over\"); expect_feed_hold(); expect_no_tool_change();\n    after_s(2.0);\n    \
         expect_alarm(\"over\"); expect_offset_um(\"z\", -6, -4); expect_no_offset(\"x\"); expect_published(\"twice_pct\", 189, 191);\n    \
         given(#{{ tool: \"T2\" }}); after_s(0.1); expect_note(\"T1 to T2\");\n    \
         given(#{{ spindle_load_pct: () }}); after_s(0.1); expect_no_override();\n}}\n\
         fn trial_a_light_cut() {{ given(#{{ spindle_load_pct: 5 }}); after_s(100); expect_no_override(); expect_no_alarms(); }}\n"
    );
    let results = results(&text);
    assert!(results.iter().all(|result| result.problem.is_none()), "{results:?}");
    assert_eq!((results[0].name.as_str(), results[0].met), ("a heavy cut", 10));
    assert!(results[0].line == 6 && (results[1].passed_s - 100.0).abs() < 1e-9, "{results:?}");
}

/// What the only trial of a script says, its body given.
fn failing(body: &str) -> String {
    let results = results(&format!("{SLOWING}fn trial_it() {{\n    {body}\n}}\n"));
    results[0].problem.as_ref().expect("it fails").to_string()
}

#[test]
fn a_failing_trial_says_where_and_what_came_instead() {
    let heavy = "given(#{ spindle_load_pct: 95 }); after_s(1);";
    let text = failing(&format!("{heavy}\n    expect_override(10.0, 20.0);"));
    assert!(
        text.starts_with(
            "x.rhai:8:5: trial \"it\": after 1.0 s: expected an override of 10 to 20 %; 80.0 % is asked for (heavy)"
        ),
        "{text}"
    );
    assert!(failing(&format!("{heavy} expect_no_override();")).contains("expected no override; 80.0 % is asked for"));
    assert!(failing(&format!("{heavy} expect_no_feed_hold();")).contains("feed_hold was asked for"));
    assert!(failing(&format!("{heavy} expect_alarm(\"over\");")).contains("standing: none"));
    assert!(
        failing("after_s(1); expect_override(1, 2);")
            .contains("the script waits: spindle_load_pct has no value (not_provided)")
    );
    assert!(failing(&format!("{heavy} expect_published(\"twice\", 1, 2);")).contains("it publishes: twice_pct"));
    assert!(failing("after_s(1);").contains("it expects nothing"));
    assert!(failing("given(#{ spindel_load_pct: 1 });").contains("did you mean `spindle_load_pct`?"));
    // A word in a variable can only be judged when the trial runs; a plain one is refused when the file is read.
    assert!(failing("let word = \"cuting\"; given(#{ state: word });").contains("did you mean \"cutting\"?"));
    assert!(failing("given(#{ spindle_load_pct: 1e9 });").contains("is outside -500 to 500 %"));
    assert!(failing("pace_s(0.001); after_s(1000);").contains("more than 100000 ticks"));
    assert!(failing("loop {}").contains("did not come to an end"));
}

#[test]
fn a_script_that_fails_in_a_trial_is_told_at_its_own_line() {
    let results = results(
        "let a = [1];\nif spindle_load_pct > 50.0 { a[7] = 1; }\nfn trial_it() { given(#{ spindle_load_pct: 60 }); after_s(1); expect_no_alarms(); }",
    );
    let text = results[0].problem.as_ref().expect("it fails").to_string();
    assert!(text.starts_with("x.rhai:2:") && text.contains("trial \"it\""), "{text}");
}

#[test]
fn what_is_wrong_with_a_trial_is_told_when_the_file_is_loaded() {
    let refused = |text: &str| told(&compile_scripts(&[file("x.rhai", text)]).err().expect("refused"));
    assert!(refused("fn trial_it() { expect_alrm(\"a\"); }").contains("did you mean `expect_alarm`?"));
    assert!(refused("fn trial_it() { expect_alarm(); }").contains("write expect_alarm(name)"));
    assert!(refused("fn trial_it() { if state == \"idle\" { after_s(1) } }").contains("a trial does not see `state`"));
    assert!(refused("after_s(1.0);").contains("only a trial can call `after_s`"));
    assert!(refused("fn trial_it(x) { after_s(1.0); }").contains("has parameters"));
}

#[test]
fn only_scripts_whose_trials_pass_may_come_into_charge() {
    let good =
        compile_scripts(&[file("x.rhai", "fn trial_it() { after_s(1); expect_no_alarms(); }")]).expect("it compiles");
    assert!(prove_scripts(good).is_ok());
    let bad =
        compile_scripts(&[file("x.rhai", "alarm(\"a\", \"\");\nfn trial_it() { after_s(1); expect_no_alarms(); }")]);
    let problems = prove_scripts(bad.expect("it compiles")).err().expect("refused");
    assert!(
        told(&problems).contains("x.rhai:2:29: trial \"it\": after 1.0 s: expected no alarm; standing: a"),
        "{}",
        told(&problems)
    );
}

#[test]
fn trials_leave_no_trace_in_the_script_that_runs() {
    let text =
        "memory.n = (memory.n ?? 0) + 1; note(`${memory.n}`);\nfn trial_it() { after_s(1); expect_note(\"10\"); }";
    let set = prove_scripts(compile_scripts(&[file("x.rhai", text)]).expect("it compiles")).expect("the trial passes");
    let mut host = Host::new();
    host.install_set(set);
    assert_eq!(&*host.run_due_scripts(&sample(0.0, &[]), &Estimates::without_samples(0)).notes[0].text, "1");
}
