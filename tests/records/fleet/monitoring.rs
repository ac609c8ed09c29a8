//! Dashboard and alert rules ask for what the box tells, and Prometheus takes both.

use std::collections::BTreeSet;
use std::io::Write;
use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Stdio};
use testkit::box_under_test::Sending;
use testkit::process::{get, run, stdout};

/// `promtool` with these arguments in the directory of the rules; `None` where it is not installed.
pub(super) fn promtool(arguments: &[&str], input: &str) -> Option<String> {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("gateway/monitoring");
    let mut command = Command::new("promtool");
    command.args(arguments).current_dir(directory).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let Ok(mut child) = command.spawn() else {
        assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "promtool is not installed");
        eprintln!("SKIPPED: promtool is not installed (Debian: prometheus)");
        return None;
    };
    child.stdin.take().expect("piped").write_all(input.as_bytes()).expect("taken");
    let said = child.wait_with_output().expect("it ends");
    let text = format!("{}{}", String::from_utf8_lossy(&said.stdout), String::from_utf8_lossy(&said.stderr));
    assert!(said.status.success(), "{arguments:?}: {text}");
    Some(text)
}

/// Every name that begins as ours do.
fn names(text: &str) -> BTreeSet<&str> {
    let part = |letter: char| !(letter.is_ascii_alphanumeric() || letter == '_');
    text.split(part).filter(|word| word.starts_with("cncgw_")).collect()
}

#[test]
fn every_alert_fires_when_it_shall_and_the_program_prints_these_rules() {
    let Some(said) = promtool(&["test", "rules", "alerts_test.yml"], "") else { return };
    println!("{said}");
    promtool(&["check", "rules", "alerts.yml"], "");
    let (rules, tests) = (
        include_str!("../../../gateway/monitoring/alerts.yml"),
        include_str!("../../../gateway/monitoring/alerts_test.yml"),
    );
    for name in rules.lines().filter_map(|line| line.trim().strip_prefix("- alert: ")) {
        let tried: Vec<&str> = tests.split(&format!("alertname: {name}\n")).skip(1).collect();
        let quiet = tried.iter().filter(|test| test.trim_start().starts_with("exp_alerts: []")).count();
        assert!(quiet > 0 && tried.len() > quiet, "{name}: {quiet} of {} tests expect nothing", tried.len());
    }
    let printed = stdout(&run(&["metrics", "alerts"]));
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("gateway/monitoring/alerts.yml");
    assert_eq!(printed, std::fs::read_to_string(file).expect("there"));
}

#[test]
fn what_dashboard_and_alerts_ask_for_is_told_by_a_box_with_a_sink() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = listener.local_addr().expect("bound").port();
    drop(listener);
    let mut sending = Sending::at_speed("20", &format!("shdr://127.0.0.1:{port}"), "");
    sending.wait_sink("live data is delivered", |sink| sink["delay_s"].is_number());
    sending.wait_spindle();
    let metrics = get(sending.page(), "/metrics").body;
    promtool(&["check", "metrics"], &metrics);
    for name in [
        "cncgw_tick_lateness_seconds_bucket{le=\"+Inf\"}",
        "cncgw_sink_delay_seconds_bucket{sink=\"plant\",le=\"0.5\"}",
    ] {
        assert!(metrics.contains(name), "{name}: {metrics}");
    }
    let dashboard = stdout(&run(&["metrics", "dashboard"]));
    let document: serde_json::Value = serde_json::from_str(&dashboard).expect("JSON");
    assert!(document["panels"].as_array().is_some_and(|panels| panels.len() >= 12), "{document}");
    let told = names(&metrics);
    // An accelerated machine is not polled by threads: what only those have.
    let of_threads = ["cncgw_source_lag_seconds", "cncgw_source_round_trip_seconds_bucket"];
    // In the first minute it is not known.
    let later = ["cncgw_sink_outage_fits_seconds"];
    let asked = format!("{dashboard}{}", stdout(&run(&["metrics", "alerts"])));
    let known = |name: &&str| told.contains(name) || of_threads.contains(name) || later.contains(name);
    let unknown: Vec<&str> = names(&asked).into_iter().filter(|name| !known(name)).collect();
    assert!(unknown.is_empty(), "{unknown:?}\n{metrics}");
    sending.stop();
    let mut live = Sending::to(&format!("shdr://127.0.0.1:{port}"), "");
    live.wait_sink("it runs", |sink| sink["state"] == "connected");
    std::thread::sleep(std::time::Duration::from_secs(2));
    let metrics = get(live.page(), "/metrics").body;
    promtool(&["check", "metrics"], &metrics);
    for name in of_threads {
        assert!(metrics.contains(name), "{name}: {metrics}");
    }
    live.stop();
}
