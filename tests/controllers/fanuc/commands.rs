//! The commands as a user calls them: `serve fanuc` and `doctor`, as processes.

use crate::fanuc::support::{controller, serve};
use crate::fanuc::vendor::library;
use adapters::fanuc_server::ServerSettings;
use serde_json::Value;
use std::process::Output;
use std::time::{Duration, Instant};
use testkit::process::program;
use testkit::served::Serving;

pub(crate) fn doctor(arguments: &[&str]) -> (Output, Value) {
    let output = program().arg("doctor").args(arguments).arg("--json").output().expect("runs");
    let value = serde_json::from_slice(&output.stdout).unwrap_or(Value::Null);
    (output, value)
}

/// The examination without `--json`: exit code and text.
fn for_people(arguments: &[&str]) -> (Option<i32>, String) {
    let output = program().arg("doctor").args(arguments).output().expect("runs");
    (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned())
}

/// The examination of a machine that may still be starting.
fn once_on(address: &str) -> Value {
    let until = Instant::now() + Duration::from_secs(60);
    loop {
        let (output, report) = doctor(&[address]);
        if report["reachable"] == true {
            assert_eq!(output.status.code(), Some(0), "{report:#}");
            return report;
        }
        assert!(Instant::now() < until, "the control never came up: {report:#}");
        std::thread::sleep(Duration::from_millis(200));
    }
}

#[test]
fn doctor_names_a_served_machine_of_every_generation() {
    for (generation, version) in [("30i", "4"), ("0i-f", "3"), ("16i", "2")] {
        let serving = Serving::start(&["--generation", generation, "--machine", "simulated://mill?speed=50"]);
        let report = once_on(&serving.address);
        assert_eq!(
            (report["identity"]["make"].as_str(), report["identity"]["generation"].as_str()),
            (Some("FANUC"), Some(version))
        );
        assert_eq!(report["identity"]["axes"], "X Y Z");
        let readings = report["readings"].as_array().expect("a list");
        let of = |channel: &str| readings.iter().find(|reading| reading["channel"] == channel).expect("listed");
        assert_eq!(of("feed_override_pct")["value"], 100.0);
        assert_eq!(
            (of("spindle_speed_rpm")["unit"].as_str(), of("part_count")["missing"].as_str()),
            (Some("rpm"), None)
        );
        assert!(report["timing"]["open_ms"].as_f64().is_some_and(|ms| ms > 0.0));
        assert_eq!(report["problems"], Value::Array(Vec::new()));
    }
}

#[test]
fn doctor_says_what_is_wrong_and_what_to_do() {
    let (output, report) = doctor(&["fanuc://127.0.0.1:9"]);
    assert_eq!((output.status.code(), report["reachable"].as_bool()), (Some(1), Some(false)));
    assert!(report["problems"][0]["next"].as_str().is_some_and(|next| next.contains("8193")), "{report:#}");
    let output = program().args(["doctor", "fanuk://x"]).output().expect("runs");
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("did you mean fanuc"));
    let (output, report) = doctor(&["simulated://lathe?device=meter"]);
    assert!(matches!(output.status.code(), Some(0 | 1)) && report["address"] == "simulated://lathe?device=meter");
}

#[test]
fn doctor_for_people_shows_values_with_units() {
    let server = serve(controller(4), ServerSettings::default());
    let (code, text) = for_people(&[&format!("fanuc://{}", server.address())]);
    assert_eq!(code, Some(0), "{text}");
    for part in ["answers", "series: G421", "spindle_speed_rpm", "1200 rpm", "not_supported"] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

#[test]
fn doctor_compares_our_own_words_with_the_librarys() {
    let library = library(&[]);
    let server = serve(controller(4), ServerSettings::default());
    let address = format!("fanuc://{}", server.address());
    let compare = |label: &str| {
        let (output, report) = doctor(&[&address, "--compare", &library.file.display().to_string()]);
        assert!(report["differences"].is_array(), "{label}: {report:#} {}", String::from_utf8_lossy(&output.stderr));
        (output.status.code(), report["differences"].clone())
    };
    let (code, differences) = compare("as it is");
    assert_eq!(
        (code, differences),
        (Some(0), Value::Array(Vec::new())),
        "nothing differs, a load has no sign on either way"
    );
    server.with(|control| control.expect("on").sequence = 130);
    let (code, differences) = compare("another block");
    assert_eq!(code, Some(1));
    let block =
        differences.as_array().and_then(|all| all.iter().find(|one| one["channel"] == "block")).expect("differs");
    assert_eq!((block["native"].as_str(), block["vendor"].as_str()), (Some("N130"), Some("N120")));
}

#[test]
fn doctor_compares_for_people_and_says_when_there_is_nothing_to_compare() {
    let library = library(&[]);
    let server = serve(controller(4), ServerSettings::default());
    let address = format!("fanuc://{}?backend=native", server.address());
    let shown = |file: &str| for_people(&[&address, "--compare", file]);
    let (code, text) = shown(&library.file.display().to_string());
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("channels compared in 3 rounds, 0 differ"), "{text}");
    assert!(text.contains("only native has: ") && text.contains("x_axis_current_a"), "{text}");
    let (code, text) = shown("/does/not/exist.so");
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("nothing could be compared") && text.contains("/does/not/exist.so"), "{text}");
}
