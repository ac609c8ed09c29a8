//! `replay`: real and made-up recordings through the same pipeline, and what a broken one is told.

use serde_json::Value;
use std::fs;
use std::path::Path;
use testkit::process::{run, shared, stderr, stdout, text};

fn replayed(arguments: &[&str]) -> Value {
    let output = run(&[&["replay", "--json"], arguments].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    serde_json::from_str(&stdout(&output)).expect("JSON")
}

fn exported(database: &Path) -> String {
    let output = run(&["history", "query", "--history", text(database)]);
    assert!(output.status.success(), "{}", stderr(&output));
    stdout(&output)
}

#[test]
fn a_real_mill_row_by_row() {
    let Some(recording) = shared("milling/recording.csv.gz") else { return };
    let directory = tempfile::tempdir().expect("a directory");
    let database = directory.path().join("H.db");
    let summary = replayed(&[text(&recording), "--history", text(&database)]);
    println!("{summary:#}");
    assert_eq!((&summary["rows"], &summary["refused_rows"]), (&Value::from(13_757), &Value::from(0)));
    assert_eq!(summary["history"]["stored_rows"], 13_757);
    assert_eq!(summary["spindle_edges"]["all"], summary["spindle_edges"]["right"]);
    assert!(summary["spindle_edges"]["all"].as_u64() > Some(300));
    assert_eq!(summary["visibility"]["verdict"], "below_visibility");
    let again = replayed(&[text(&recording), "--history", text(&database)]);
    assert_eq!(again["history"]["stored_rows"], 0, "the same recording was stored twice");
    assert_eq!(exported(&database).lines().count(), 13_758);
    for key in ["seconds_per_state", "state_changes", "parts", "alarms", "decisions", "visibility", "motion"] {
        assert_eq!(summary[key], again[key], "{key}");
    }
}

/// Half a minute of a spindle that starts, idles, cuts and stops, 10 Hz.
fn made_up() -> String {
    let mut text = String::from("time_s,spindle_speed_rpm,feed_mm_min,spindle_power_w,total_power_w,part_count\n");
    for row in 0..600 {
        let at_s = f64::from(row) / 10.0;
        let (speed, feed, power) = match row {
            0..=49 => (0.0, 0.0, 0.0),
            50..=249 => (1000.0, 0.0, 500.0 + f64::from(row % 3)),
            250..=449 => (1000.0, 200.0, 1500.0 + f64::from(row % 5)),
            450..=549 => (1000.0, 0.0, 500.0 + f64::from(row % 3)),
            _ => (0.0, 0.0, 0.0),
        };
        let parts = if row < 560 { 4 } else { 5 };
        text += &format!("{at_s},{speed},{feed},{power},{},{parts}\n", power + 800.0);
    }
    text
}

#[test]
fn the_same_recording_twice_gives_the_same_history() {
    let directory = tempfile::tempdir().expect("a directory");
    let recording = directory.path().join("made-up.csv");
    fs::write(&recording, made_up()).expect("written");
    let databases = ["a.db", "b.db"].map(|name| directory.path().join(name));
    let summaries = databases.clone().map(|database| replayed(&[text(&recording), "--history", text(&database)]));
    assert_eq!(exported(&databases[0]), exported(&databases[1]));
    let seconds = &summaries[0]["seconds_per_state"];
    assert!((seconds["cutting"].as_f64().expect("a number") - 20.0).abs() < 1.5, "{seconds}");
    assert!((seconds["standby"].as_f64().expect("a number") - 10.0).abs() < 1.5, "{seconds}");
    assert_eq!(
        (&summaries[0]["parts"], &summaries[0]["visibility"]["verdict"]),
        (&Value::from(1), &Value::from("visible"))
    );
    assert_eq!(summaries[0]["state_changes"], summaries[1]["state_changes"]);
}

#[test]
fn bad_rows_are_told_with_file_line_column_and_reason() {
    let directory = tempfile::tempdir().expect("a directory");
    let recording = directory.path().join("bad.csv");
    fs::write(&recording, "time_s,spindle_speed_rpm\n0,1\n1,fast\n2,3\n1.5,3\n3,4,5\n4,5\n").expect("written");
    let summary = replayed(&[text(&recording)]);
    assert_eq!((&summary["rows"], &summary["refused_rows"]), (&Value::from(3), &Value::from(3)));
    let problems = summary["files"][0]["problems"].to_string();
    for part in
        ["bad.csv, line 3, column spindle_speed_rpm", "line 5, column time_s", "line 6: 3 cells where the header has 2"]
    {
        assert!(problems.contains(part), "{part}: {problems}");
    }
}

#[test]
fn what_is_no_recording_cannot_run() {
    let directory = tempfile::tempdir().expect("a directory");
    let file = |name: &str, text: &str| {
        let path = directory.path().join(name);
        fs::write(&path, text).expect("written");
        path
    };
    let (empty, headless) = (file("empty.csv", ""), file("headless.csv", "a,b\n1,2\n"));
    let cases = [(text(&empty), "time_s"), (text(&headless), "line 1"), ("/no/such.csv", "Check the path")];
    for (path, part) in cases {
        let output = run(&["replay", path]);
        assert_eq!(output.status.code(), Some(2), "{path}");
        assert!(stderr(&output).contains(part), "{path}: {}", stderr(&output));
    }
    let recording = file("fine.csv", &made_up());
    let foreign = file("foreign.db", "this is no database at all, but it is somebody's file");
    let output = run(&["replay", text(&recording), "--history", text(&foreign)]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("not a cnc-gateway history"), "{}", stderr(&output));
}
