//! `rules test` and `rules backtest`, as processes, on what a simulated machine has left in a real history.

use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// Alarms on channels and on the state, each of which comes and goes many times on a working day.
const WATCH: &str = "alarm_above(\"heavy\", spindle_load_pct, 30.0, 25.0, 0.0, \"info\", \"heavy\", \"重\");\n\
    alarm_when(\"turning\", state == \"idle\" && state_s > 2.0, 0.0, \"turns without cutting\");\n\
    alarm_above(\"fast\", spindle_speed_rpm, 100.0, 50.0, 0.0, \"the spindle turns\");\n\
    if state == \"cutting\" { request_feed_override(90.0, \"always\"); }\n";

/// The same, deliberately worse: one alarm is gone, one comes for nothing less than a crash, the request is another.
const WORSE: &str = "alarm_above(\"heavy\", spindle_load_pct, 400.0, 300.0, 0.0, \"info\", \"heavy\", \"重\");\n\
    alarm_above(\"fast\", spindle_speed_rpm, 100.0, 50.0, 0.0, \"the spindle turns\");\n\
    alarm_above(\"new\", spindle_speed_rpm, 100.0, 50.0, 0.0, \"a new alarm\");\n\
    if state == \"cutting\" { request_feed_override(70.0, \"always\"); }\n";

fn program(arguments: &[&str], directory: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cnc-gateway"));
    command.current_dir(directory).args(arguments).output().expect("the program starts")
}

fn said(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// A machine that has run for so long with [`WATCH`]; those that come with the gateway are emptied.
fn machine(directory: &Path, seconds: u32, tick_hz: f64) {
    let config = format!(
        "[gateway]\nname = \"Lathe\"\ndata_dir = \"data\"\ntick_hz = {tick_hz:?}\n[http]\nenabled = false\n\
         [[source]]\naddress = \"simulated://lathe\"\n"
    );
    fs::write(directory.join("cnc-gateway.toml"), config).expect("written");
    fs::create_dir_all(directory.join("data/scripts")).expect("created");
    for file in rules::script::shipped() {
        fs::write(directory.join("data/scripts").join(file.name), "// not here\n").expect("written");
    }
    fs::write(directory.join("data/scripts/watch.rhai"), WATCH).expect("written");
    let seconds = seconds.to_string();
    let output = program(&["run", "--config", "cnc-gateway.toml", "--speed", "max", "--for", &seconds], directory);
    assert!(output.status.success(), "{}", said(&output));
    fs::create_dir_all(directory.join("edited")).expect("created");
    for entry in fs::read_dir(directory.join("data/scripts")).expect("there") {
        let path = entry.expect("readable").path();
        if path.extension().is_some_and(|end| end == "rhai") {
            fs::copy(&path, directory.join("edited").join(path.file_name().expect("a name"))).expect("copied");
        }
    }
    fs::write(directory.join("edited/watch.rhai"), WORSE).expect("written");
}

/// What the box itself recorded while it ran: name and beginning, ms, of the alarms of our script.
fn recorded(directory: &Path) -> Vec<(String, i64)> {
    let arguments =
        ["history", "query", "--history", "data/history.db", "--records", "alarms", "--json", "--limit", "1000000"];
    let output = program(&arguments, directory);
    let document: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{}", said(&output)));
    let rows = document["rows"].as_array().or_else(|| document["alarms"].as_array()).expect("rows").clone();
    let own = rows.iter().filter(|row| row["source"] == "watch.rhai");
    let row =
        |row: &Value| Some((row["code"].as_str()?.to_owned(), row["raised_ms"].as_i64().or(row["from_ms"].as_i64())?));
    own.map(|it| row(it).unwrap_or_else(|| panic!("{it}"))).collect()
}

fn milliseconds(text: &Value) -> i64 {
    let stamp: jiff::Timestamp = text.as_str().expect("a time").parse().expect("RFC 3339");
    stamp.as_millisecond()
}

fn backtest(directory: &Path, more: &[&str]) -> (Value, Option<i32>) {
    let arguments =
        ["rules", "backtest", "--config", "cnc-gateway.toml", "--since", "30d", "--scripts", "edited", "--json"];
    let output = program(&[&arguments[..], more].concat(), directory);
    let report = serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{}", said(&output)));
    (report, output.status.code())
}

/// Every alarm that the box recorded and that the worse scripts do not have is named; nothing else is.
fn every_lost_alarm_is_named(directory: &Path, more: &[&str], near_ms: i64) -> Value {
    let (report, code) = backtest(directory, more);
    assert_eq!(code, Some(1), "an alarm was lost");
    let lost: Vec<(String, i64)> = report["lost"]
        .as_array()
        .expect("a list")
        .iter()
        .map(|it| (it["name"].as_str().expect("a name").to_owned(), milliseconds(&it["from"])))
        .collect();
    let gone: Vec<(String, i64)> = recorded(directory).into_iter().filter(|(name, _)| name != "fast").collect();
    assert!(gone.len() > 5, "{gone:?}");
    for (name, at_ms) in &gone {
        let named = lost.iter().any(|(lost, from_ms)| lost == name && (from_ms - at_ms).abs() <= near_ms);
        assert!(named, "{name} at {at_ms} is not in the list of lost alarms: {lost:?}");
    }
    assert!(
        lost.len() >= gone.len() && lost.len() <= gone.len() + gone.len() / 10 + 2,
        "{} of {}",
        lost.len(),
        gone.len()
    );
    let names: BTreeSet<&str> = lost.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, BTreeSet::from(["heavy", "turning"]));
    report
}

#[test]
fn a_worse_script_loses_alarms_and_each_of_them_is_named() {
    let directory = tempfile::tempdir().expect("a directory");
    machine(directory.path(), 5400, 2.0);
    let report = every_lost_alarm_is_named(directory.path(), &[], 2000);
    let gained: BTreeSet<&str> =
        report["gained"].as_array().expect("a list").iter().filter_map(|it| it["name"].as_str()).collect();
    assert_eq!(gained, BTreeSet::from(["new"]));
    assert!(report["shifted"].as_array().is_some_and(Vec::is_empty), "{}", report["shifted"]);
    assert_eq!(
        (&report["running"]["override"]["least_pct"], &report["edited"]["override"]["least_pct"]),
        (&90.0.into(), &70.0.into())
    );
    assert!(report["override_differs_s"].as_f64().is_some_and(|s| s > 60.0), "{report}");
    let cutting =
        report["seconds_per_state"].as_array().expect("a list").iter().find(|row| row["state"] == "cutting").cloned();
    assert!(cutting.is_some_and(|row| row["running_s"] == row["edited_s"] && row["running_s"].as_f64() > Some(60.0)));

    // Other settings of the estimators: nothing is common to both sets any more, and each runs by itself.
    fs::write(directory.path().join("edited/apart.rhai"), "fn settings() { #{ c1: 0.21 } }\n").expect("written");
    let apart = every_lost_alarm_is_named(directory.path(), &[], 2000);
    for what in ["lost", "gained", "shifted", "override_differs_s"] {
        assert_eq!(apart[what], report[what], "{what}");
    }
    assert_eq!(apart["running"], report["running"]);

    let unchanged = program(&["rules", "backtest", "--config", "cnc-gateway.toml", "--since", "30d"], directory.path());
    assert_eq!(unchanged.status.code(), Some(0), "{}", said(&unchanged));
    assert!(said(&unchanged).contains("0 lost, 0 gained, 0 at another time"), "{}", said(&unchanged));
}

/// A week at 10 Hz: `cargo test --release --test scripts a_stored_week -- --ignored --nocapture`
#[test]
#[ignore = "ten minutes"]
fn a_stored_week_at_ten_hertz() {
    let directory = tempfile::tempdir().expect("a directory");
    let began = std::time::Instant::now();
    machine(directory.path(), 604_800, 10.0);
    println!("recorded in {:.0} s", began.elapsed().as_secs_f64());
    let report = every_lost_alarm_is_named(directory.path(), &[], 1000);
    println!(
        "{} samples, {} lost alarms named, {} s",
        report["rows"],
        report["lost"].as_array().map_or(0, Vec::len),
        report["took_s"]
    );
    println!("{} samples/s with both sets", report["rows_per_s"]);
}

/// A week at 1 Hz: `cargo test --release --test scripts a_coarse_week -- --ignored --nocapture`
#[test]
#[ignore = "minutes"]
fn a_coarse_week_at_one_hertz() {
    let directory = tempfile::tempdir().expect("a directory");
    machine(directory.path(), 604_800, 1.0);
    let report = every_lost_alarm_is_named(directory.path(), &[], 3000);
    println!(
        "{} samples, {} lost alarms named, {} s",
        report["rows"],
        report["lost"].as_array().map_or(0, Vec::len),
        report["took_s"]
    );
}

#[test]
fn what_cannot_be_compared_is_told() {
    let directory = tempfile::tempdir().expect("a directory");
    let told = |arguments: &[&str]| {
        let output = program(arguments, directory.path());
        (output.status.code(), said(&output))
    };
    let (code, text) = told(&["rules", "backtest", "--history", "nowhere.db"]);
    assert!(code == Some(2) && text.contains("nowhere.db"), "{text}");
    fs::write(
        directory.path().join("bad.rhai"),
        "alarm(\"a\", \"b\");\nfn trial_none() { after_s(1.0); expect_no_alarms(); }\n",
    )
    .expect("written");
    let (code, text) = told(&["rules", "test", "bad.rhai"]);
    assert!(code == Some(1) && text.contains("FAILED  bad.rhai:2:") && text.contains("standing: a"), "{text}");
    let (code, text) = told(&["rules", "test", "bad.rhai", "--json"]);
    let json: Value = serde_json::from_str(&text).expect("JSON");
    assert!(code == Some(1) && json["trials"][0]["problem"]["line"] == 2 && json["fine"] == false, "{text}");
}

#[test]
fn the_shipped_scripts_pass_their_trials() {
    let directory = tempfile::tempdir().expect("a directory");
    let output = program(&["rules", "test"], directory.path());
    let text = said(&output);
    assert_eq!(output.status.code(), Some(0), "{text}");
    assert!(text.contains("0 failed, 0 other problems") && text.matches("ok  ").count() >= 15, "{text}");
}
