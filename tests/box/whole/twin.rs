//! The model beside the running machine: a healthy lathe for days, a lathe whose cutting forces grow, a model that is
//! replaced while the box runs.

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::time::Duration;
use testkit::process::{Gateway, get, program, run, stderr, stdout, wait_for};

/// What the simulated lathe does, as a patient integrator would write it down: its laws are other ones.
pub(crate) const MODEL: &str = r#"schema = "model/1"
name = "small lathe"
output = "spindle_power_w"

[[effect]]
kind = "no_load_power"
parameters = { speeds_rpm = [0.0, 300.0, 600.0, 900.0, 1200.0, 1600.0], power_w = [0.0, 181.0, 383.0, 657.0, 700.0, 1058.0] }

[[effect]]
kind = "cutting_power"
parameters = { kc11_n_per_mm2 = 1060.0, mc = 0.25 }

[[effect]]
kind = "load_loss"
parameters = { linear = 0.11, quadratic_per_w = 0.0 }

[[effect]]
kind = "copper_loss"
parameters = { per_load2 = 8.0e-5 }

[[effect]]
kind = "flank_wear"
parameters = { k = 0.022, p = 0.9 }
"#;

const HOUR_S: u32 = 3600;

pub(super) fn configure(directory: &Path, lathe: &str, model: &str) {
    fs::write(directory.join("model.toml"), model).expect("writable");
    let text = format!(
        "[gateway]\ndata_dir = \"data\"\n[twin]\nmodel = \"model.toml\"\n[[source]]\naddress = \"simulated://lathe{lathe}\"\n"
    );
    fs::write(directory.join("box.toml"), text).expect("writable");
}

pub(super) fn start(directory: &Path, more: &[&str]) -> Gateway {
    let mut command = program();
    command.current_dir(directory).args(["run", "--config", "box.toml", "--listen", "127.0.0.1:0"]).args(more);
    Gateway::spawn(command)
}

/// So many hours of machine time, as fast as possible.
pub(super) fn hours(directory: &Path, hours: u32) {
    let mut gateway = start(directory, &["--speed", "max", "--for", &(hours * HOUR_S).to_string()]);
    wait_for("the end of the run", Duration::from_secs(400), || gateway.has_ended().then_some(()));
    assert!(gateway.said().contains("history closed"), "{}", gateway.said());
}

fn records(directory: &Path, kind: &str) -> Vec<Value> {
    let database = directory.join("data/history.db");
    let path = database.to_str().expect("a path");
    let arguments =
        ["history", "query", "--history", path, "--json", "--from", "-30d", "--limit", "10000", "--records", kind];
    let output = run(&arguments);
    let document: Value = serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    document["rows"].as_array().expect("rows").clone()
}

fn of_twin(records: Vec<Value>, kind: &str) -> Vec<Value> {
    records.into_iter().filter(|row| row["source"] == "twin" && (kind.is_empty() || row["kind"] == kind)).collect()
}

#[test]
fn a_healthy_lathe_is_learned_and_raises_no_alarm_in_two_days() {
    let directory = tempfile::tempdir().expect("a directory");
    configure(directory.path(), "?seed=4", MODEL);
    hours(directory.path(), 48);
    let learned = of_twin(records(directory.path(), "events"), "twin_learned");
    assert!(learned.iter().any(|event| event["text"].to_string().contains("while cutting")), "{learned:?}");
    let alarms = of_twin(records(directory.path(), "alarms"), "");
    assert!(alarms.is_empty(), "{alarms:?}");
    assert!(of_twin(records(directory.path(), "events"), "diagnosis_begun").is_empty());
}

#[test]
fn greater_cutting_forces_are_noticed_dated_diagnosed_and_shown() {
    let directory = tempfile::tempdir().expect("a directory");
    let place = directory.path();
    configure(place, "?change_h=26&change_cut_pct=125", MODEL);
    hours(place, 29);
    let alarms = of_twin(records(place, "alarms"), "");
    assert_eq!(alarms.len(), 1, "{alarms:?}");
    let (english, chinese) = (alarms[0]["en"].to_string(), alarms[0]["zh"].to_string());
    assert!(english.contains("while cutting") && english.contains("more than the simulation says"), "{english}");
    assert!(chinese.contains("切削时主轴驱动功率"), "{chinese}");

    // The diagnosis goes on after a restart, at a pace that leaves it a processor.
    let mut gateway = start(place, &["--speed", "2"]);
    let address = gateway.address();
    let twin = wait_for("a diagnosis", Duration::from_secs(600), || {
        let twin = get(&address, "/api/v1/twin").json();
        twin["diagnoses"].as_array().is_some_and(|diagnoses| !diagnoses.is_empty()).then_some(twin)
    });
    let regimes = twin["twin"]["regimes"].as_array().expect("a list");
    let cutting = regimes.iter().find(|regime| regime["regime"] == "cutting").expect("it cuts");
    assert_eq!(cutting["stage"], "differing");
    let began_ms = records(place, "events").first().expect("started")["at_ms"].as_i64().expect("a time");
    let changed_ms = began_ms + 26 * 3_600_000;
    let since: Vec<i64> = serde_json::from_value(cutting["since_ms"].clone()).expect("three times");
    assert!((since[1] - 60_000..=since[2] + 60_000).contains(&changed_ms), "{since:?} for {changed_ms}");
    assert!(since[2] - since[1] < 1_800_000, "{since:?}");
    let percent = cutting["difference_pct"].as_f64().expect("a number");
    assert!((10.0..30.0).contains(&percent), "{percent}");
    let diagnosis = &twin["diagnoses"][0];
    assert_eq!(diagnosis["diagnosis"]["schema"], "diagnosis/1");
    assert!(!diagnosis["summary"].as_str().expect("words").is_empty());
    assert!(diagnosis["from_ms"].as_i64() < Some(changed_ms) && diagnosis["to_ms"].as_i64() > Some(changed_ms));
    // It is shown a moment before it is said.
    wait_for("the line of the diagnosis", Duration::from_secs(10), || {
        gateway.said().contains("diagnosis:").then_some(())
    });
    gateway.stop();
    let finished = of_twin(records(place, "events"), "diagnosis_finished");
    assert_eq!(finished.len(), 1, "{finished:?}");
}

#[test]
fn another_model_takes_over_while_the_box_runs_and_a_broken_one_does_not() {
    let directory = tempfile::tempdir().expect("a directory");
    configure(directory.path(), "", MODEL);
    let mut gateway = start(directory.path(), &["--speed", "100"]);
    let address = gateway.address();
    let twin = || get(&address, "/api/v1/twin").json()["twin"].clone();
    let running = wait_for("a residual", Duration::from_secs(30), || {
        let twin = twin();
        twin["twin_residual"].is_number().then_some(twin)
    });
    assert_eq!((&running["model"], &running["unit"]), (&"small lathe".into(), &"W".into()));
    let file = directory.path().join("model.toml");
    fs::write(&file, MODEL.replace("kc11_n_per_mm2", "kc11_n_per_mm")).expect("writable");
    gateway.wait_said("the model cannot be used, the one before stays in charge");
    wait_for("the problem in the status", Duration::from_secs(10), || {
        twin()["problem"].to_string().contains("kc11_n_per_mm2").then_some(())
    });
    fs::write(&file, MODEL.replace("small lathe", "better lathe")).expect("writable");
    gateway.wait_said("better lathe is compared with the machine");
    wait_for("the better model in the status", Duration::from_secs(10), || {
        let twin = twin();
        (twin["model"] == "better lathe" && twin["problem"].is_null()).then_some(())
    });
    let status = get(&address, "/api/v1/status").json();
    assert_eq!(status["twin"]["output"], "spindle_power_w");
    gateway.stop();
    let database = directory.path().join("data/history.db");
    let sql = ["--sql", "SELECT name FROM models ORDER BY id"];
    let output = run(&[&["history", "query", "--history", database.to_str().expect("a path")], &sql[..]].concat());
    assert_eq!(stdout(&output).lines().collect::<Vec<_>>(), ["name", "small lathe", "better lathe"]);
}

#[test]
fn without_a_model_there_is_no_twin() {
    let directory = tempfile::tempdir().expect("a directory");
    let config = directory.path().join("box.toml");
    fs::write(&config, "[[source]]\naddress = \"simulated://lathe\"\n").expect("writable");
    let data = directory.path().join("data");
    let mut gateway = Gateway::start(&data, &["--config", config.to_str().expect("a path")]);
    let address = gateway.address();
    let document = wait_for("the page", Duration::from_secs(20), || {
        let answer = get(&address, "/api/v1/twin");
        (answer.status == 200).then(|| answer.json())
    });
    assert!(document["twin"].is_null() && document["diagnoses"] == Value::Array(Vec::new()), "{document}");
    assert!(get(&address, "/api/v1/status").json()["twin"].is_null());
    gateway.stop();
}
