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
    for file in rules::script::list_shipped_scripts() {
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
    println!("{} of {} lost alarms named", gone.len(), gone.len());
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
    assert_eq!(report["recorded"]["unknown_until"], Value::Null, "the history says which scripts were in charge");
    assert_eq!(report["recorded"]["others"], Value::Array(Vec::new()), "and they are the running ones");

    let unchanged = program(&["rules", "backtest", "--config", "cnc-gateway.toml", "--since", "30d"], directory.path());
    assert_eq!(unchanged.status.code(), Some(0), "{}", said(&unchanged));
    assert!(said(&unchanged).contains("0 lost, 0 gained, 0 at another time"), "{}", said(&unchanged));
}

/// Evidence of the lost alarms, in the order of time.
fn evidence(report: &Value) -> Vec<&str> {
    report["lost"].as_array().expect("a list").iter().filter_map(|it| it["evidence"].as_str()).collect()
}

/// One sample is a hair above the threshold and is stored as exactly the threshold: no set raises that alarm again.
#[test]
fn an_alarm_that_the_rounding_of_storage_hides_is_lost_all_the_same() {
    let directory = tempfile::tempdir().expect("a directory");
    let directory = directory.path();
    let load = |second: u32| match second {
        20..25 => "30.000000000001",
        40..45 => "35",
        _ => "20",
    };
    let rows: String = (0..60).map(|second| format!("{second},{}\n", load(second))).collect();
    fs::write(directory.join("load.csv"), format!("time_s,spindle_load_pct\n{rows}")).expect("written");
    let watch = |name: &str, above: f64| {
        fs::create_dir_all(directory.join(name)).expect("created");
        let text = format!("alarm_above(\"heavy\", spindle_load_pct, {above:?}, 25.0, 0.0, \"heavy\");\n");
        fs::write(directory.join(name).join("watch.rhai"), text).expect("written");
    };
    [("running", 30.0), ("worse", 400.0), ("finer", 29.0)].into_iter().for_each(|(name, above)| watch(name, above));
    let replayed = program(&["replay", "load.csv", "--history", "h.db", "--scripts", "running"], directory);
    assert!(replayed.status.success(), "{}", said(&replayed));
    let compared = |edited: &str| {
        let from = ["--history", "h.db", "--since", "30d", "--running", "running", "--scripts", edited];
        let told = program(&[&["rules", "backtest"][..], &from].concat(), directory);
        let json = program(&[&["rules", "backtest", "--json"][..], &from].concat(), directory);
        let report: Value = serde_json::from_slice(&json.stdout).unwrap_or_else(|_| panic!("{}", said(&json)));
        (report, told.status.code(), said(&told))
    };
    let (report, code, text) = compared("worse");
    assert_eq!((evidence(&report), code), (vec!["history", "both"], Some(1)), "{text}");
    assert!(text.contains("the running scripts do not raise it either"), "{text}");
    assert!(text.contains("the history does not say whose its alarms are"), "a replay does not: {text}");
    for (edited, what) in [("finer", "raises both"), ("running", "no edit, so nothing is lost by it")] {
        let (report, code, text) = compared(edited);
        assert_eq!(code, Some(0), "{what}: {text}");
        assert_eq!(
            (evidence(&report).len(), report["gained"].as_array().map(Vec::len)),
            (0, Some(0)),
            "{what}: {text}"
        );
    }
}

/// The running script was edited on the way: its alarms from before are those of another one.
#[test]
fn alarms_of_another_version_are_not_compared_and_the_report_says_until_when() {
    let directory = tempfile::tempdir().expect("a directory");
    let directory = directory.path();
    machine(directory, 3600, 2.0);
    let before = recorded(directory);
    let running = format!("{WATCH}// edited\n");
    fs::write(directory.join("data/scripts/watch.rhai"), running).expect("written");
    fs::write(directory.join("data/scripts/gone.rhai"), "alarm(\"there\", \"for a while\");\n").expect("written");
    let output = program(&["run", "--config", "cnc-gateway.toml", "--speed", "max", "--for", "3600"], directory);
    assert!(output.status.success(), "{}", said(&output));
    fs::remove_file(directory.join("data/scripts/gone.rhai")).expect("removed");
    let output = program(&["run", "--config", "cnc-gateway.toml", "--speed", "max", "--for", "60"], directory);
    assert!(output.status.success(), "{}", said(&output));
    let (report, code) = backtest(directory, &[]);
    assert_eq!(code, Some(1), "{report}");
    let other = |script: &str| {
        let others = report["recorded"]["others"].as_array().expect("a list").clone();
        others
            .into_iter()
            .find(|it| it["script"] == script)
            .unwrap_or_else(|| panic!("{script}: {}", report["recorded"]))
    };
    assert_eq!(other("watch.rhai")["alarms"], before.len(), "{}", report["recorded"]);
    assert_eq!(other("gone.rhai")["alarms"], 1, "{}", report["recorded"]);
    let until_ms = milliseconds(&other("watch.rhai")["until"]);
    let (mut then, mut since) = (BTreeSet::new(), BTreeSet::new());
    for (lost, evidence) in report["lost"].as_array().expect("a list").iter().zip(evidence(&report)) {
        let set = if milliseconds(&lost["from"]) < until_ms { &mut then } else { &mut since };
        set.insert(evidence);
    }
    assert_eq!((then, since), (BTreeSet::from(["samples"]), BTreeSet::from(["both"])), "{}", report["lost"]);
    let told = program(
        &["rules", "backtest", "--config", "cnc-gateway.toml", "--since", "30d", "--scripts", "edited"],
        directory,
    );
    let text = said(&told);
    assert!(text.contains("watch.rhai was another one or not in charge"), "{text}");
    assert!(text.contains("alarms of another gone.rhai"), "{text}");
}

/// A week at 10 Hz: `cargo test --release --test box a_stored_week -- --ignored --nocapture`
#[test]
#[ignore = "10 minutes: a backtest over a stored day and week at 10 Hz"]
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

/// A week at 1 Hz: `cargo test --release --test box a_coarse_week -- --ignored --nocapture`
#[test]
#[ignore = "5 minutes: a backtest over a week at a sample per 2 s"]
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
