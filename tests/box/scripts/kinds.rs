//! Values that a channel never has, and values of the wrong kind: told when the file is read, with the right word. A rule that can
//! never fire is worse than none, because somebody relies on it.

use super::*;

/// Mistakes, and what of the message tells what to write.
const MISTAKES: [(&str, &str); 36] = [
    ("if state == \"cuting\" { note(\"x\"); }", "did you mean \"cutting\"?"),
    ("if state != \"Idle\" { note(\"x\"); }", "did you mean \"idle\"?"),
    ("if \"spindle_strat\" == state { note(\"x\"); }", "did you mean \"spindle_start\"?"),
    ("if mode == \"automatic\" { note(\"x\"); }", "did you mean \"AUTOMATIC\"?"),
    ("if execution == \"RUNNING\" { note(\"x\"); }", "it is one of READY, ACTIVE, INTERRUPTED"),
    ("if visibility == \"visable\" { note(\"x\"); }", "did you mean \"visible\"?"),
    ("if no_load_origin == \"mesured\" { note(\"x\"); }", "did you mean \"measured\"?"),
    ("if missing.spindle_power_w == \"time_out\" { note(\"x\"); }", "did you mean \"timeout\"?"),
    ("if missing.cutting_power_w == \"not_lerned\" { note(\"x\"); }", "did you mean \"not_learned\"?"),
    ("if sample.execution == \"ACITVE\" { note(\"x\"); }", "did you mean \"ACTIVE\"?"),
    ("if state in [\"cutting\", \"iddle\"] { note(\"x\"); }", "did you mean \"idle\"?"),
    ("switch state { \"cutting\" => note(\"x\"), \"rapit\" => note(\"y\"), _ => () }", "did you mean \"rapid\"?"),
    ("fn on_state_change(before, now) { if now == \"standbye\" { note(\"x\"); } }", "did you mean \"standby\"?"),
    ("fn on_part_finished(count) { if count == \"7\" { note(\"x\"); } }", "write the number without quotes"),
    ("if coolant_on == false { note(\"x\"); }", "write `coolant_on > 0` for on and `coolant_on == 0` for off"),
    ("if coolant_on { note(\"x\"); }", "write `coolant_on > 0` for on"),
    ("if !rapid { note(\"x\"); }", "write `rapid > 0` for on"),
    ("if state == \"cutting\" && drive_on { note(\"x\"); }", "write `drive_on > 0` for on"),
    ("if spindle_speed_rpm { note(\"x\"); }", "compare it: `spindle_speed_rpm > 0`"),
    ("if tool { note(\"x\"); }", "whether it has a value is has(tool)"),
    ("if program == 1234 { note(\"x\"); }", "write it in quotes: \"1234\""),
    ("if tool == 3 { note(\"x\"); }", "write it in quotes: \"3\""),
    ("if alarm > 0 { note(\"x\"); }", "is a text, and no text equals the number 0"),
    ("if feed_mm_min > \"200\" { note(\"x\"); }", "write the number without quotes and without its unit"),
    ("if part_count == program { note(\"x\"); }", "`program` is a text and `part_count` a number"),
    ("if feed_override_pct > 300 { note(\"x\"); }", "lies between 0 and 254 in %, never at 300"),
    ("request_feed_override(0.8, \"x\");", "write 80"),
    ("request_feed_override(300, \"x\");", "it is a number from 0 to 254"),
    ("request_feed_override(\"90 %\", \"x\");", "needs a number here, not the text \"90 %\""),
    ("follow_feed_override(\"load_overide_pct\", \"x\");", "did you mean \"load_override_pct\"?"),
    ("alarm_above(\"hot\", state, 70.0, 60.0, 1.0, \"x\");", "needs a number here, and `state` is a text"),
    ("alarm_when(\"a\", coolant_on, 1.0, \"x\");", "write `coolant_on > 0` for on"),
    ("alarm_when(\"a\", coolant_on > 0, 1.0, \"critcal\", \"x\", \"y\");", "did you mean \"critical\"?"),
    ("propose_offset_um(\"w\", 1.0, \"x\");", "write one of x, y, z"),
    (
        "raise_alarm(\"overload\", \"x\"); if state == \"idle\" { clear_alarm(\"ovrload\"); }",
        "did you mean \"overload\"?",
    ),
    (
        "alarm(\"hot\", \"x\"); fn trial_a() { given(#{ execution: \"ACTIV\" }); after_s(1.0); expect_alarm(\"hot\"); }",
        "did you mean \"ACTIVE\"?",
    ),
];

/// What looks like a mistake and is none.
const RIGHT: [&str; 16] = [
    "if state == \"cutting\" || state in [\"idle\", \"rapid\"] { note(\"x\"); }",
    "if mode == \"AUTOMATIC\" && execution != \"ACTIVE\" { note(\"x\"); }",
    "if coolant_on == 1 || coolant_on > 0.5 || (coolant_on ?? 0.0) == 0.0 { note(\"x\"); }",
    "if program == \"1234\" || tool == \"T3\" || (operation ?? \"\") == \"\" { note(\"x\"); }",
    "if has(tool) && !has(alarm) { note(\"x\"); }",
    "let state_before = memory.state ?? \"\"; if state_before == \"cuting\" { note(\"x\"); }",
    "switch state { \"cutting\" => note(\"cuting\"), _ => () }",
    "switch program { \"O1\" | \"O2\" => note(\"x\"), _ => () }",
    "request_feed_override(80, \"x\");",
    "request_feed_override(0, \"x\");",
    "let pct = 0.8; request_feed_override(100.0 * pct, \"x\");",
    "alarm_above(\"hot\", bearing_temperature_c, 70.0, 60.0, 1.0, \"warning\", \"x\", \"y\");",
    "alarm_when(\"a\", coolant_on > 0 && state == \"cutting\", 1.0, \"x\");",
    "let name = \"a\" + tool; alarm(name, \"x\"); clear_alarm(\"b\");",
    "fn on_state_change(before, now) { if before == \"cutting\" && now != \"cutting\" { note(\"x\"); } }",
    "if missing.spindle_power_w == () || missing.spindle_power_w == \"timeout\" { note(\"x\"); }",
];

#[test]
fn what_can_never_be_is_told_with_the_right_word() {
    let mut refused = 0;
    for (text, wanted) in MISTAKES {
        let problems = compile_scripts(&[file("test.rhai", text)]).err().unwrap_or_default();
        let told = told(&problems);
        assert!(told.contains(wanted) && told.contains("test.rhai:1:"), "{text}\n{told}");
        assert_eq!(problems.len(), 1, "one mistake, one message: {text}\n{told}");
        refused += 1;
    }
    println!("{refused} of {} mistakes are refused with the right word", MISTAKES.len());
}

#[test]
fn what_can_be_is_not_refused() {
    for text in RIGHT {
        compile_scripts(&[file("test.rhai", text)]).unwrap_or_else(|problems| panic!("{text}\n{}", told(&problems)));
    }
}
