//! The gate of a running gateway: armed at the box, written, read back, disarmed, expired, refused.

use serde_json::Value;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;
use testkit::process::{Gateway, get, program, run, stderr, stdout, text, wait_for};

/// A configuration that may be armed, with one script that always asks for 70 %.
pub(crate) fn prepared(directory: &Path, address: &str) -> PathBuf {
    let scripts = directory.join("data/scripts");
    std::fs::create_dir_all(&scripts).expect("a directory");
    std::fs::write(scripts.join("slow.rhai"), "request_feed_override(70, \"test\");").expect("a script");
    let config = directory.join("cnc-gateway.toml");
    let written = format!(
        "[gateway]\ndata_dir = \"data\"\n[[source]]\naddress = \"{address}\"\nname = \"lathe\"\n\
         [gate]\nmode = \"armed\"\nsource = \"lathe\"\narmed_for_s = 3600.0\n[http]\nlisten = \"127.0.0.1:0\"\n"
    );
    std::fs::write(&config, written).expect("a configuration");
    config
}

pub(crate) fn start(config: &Path, speed: &str) -> (Gateway, String) {
    let mut command = program();
    command.args(["run", "--config", text(config), "--listen", "127.0.0.1:0", "--speed", speed]);
    let mut gateway = Gateway::spawn(command);
    let address = gateway.address();
    (gateway, address)
}

pub(crate) fn order(config: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let told = run(&[arguments, &["--config", text(config)]].concat());
    (told.status.code(), format!("{}{}", stdout(&told), stderr(&told)))
}

pub(crate) fn gate(address: &str) -> Value {
    get(address, "/api/v1/status").json()["gate"].clone()
}

pub(crate) fn audit(directory: &Path) -> Vec<Value> {
    let database = directory.join("data/history.db");
    let told = run(&["history", "audit", "--json", "--history", text(&database)]);
    let document: Value = serde_json::from_str(&stdout(&told)).expect("JSON");
    document["rows"].as_array().expect("rows").clone()
}

pub(crate) fn has(rows: &[Value], kind: &str, outcome: &str) -> bool {
    rows.iter().any(|row| row["kind"] == kind && row["outcome"] == outcome)
}

/// In real time, with sources and hand on threads of their own. A quarter of a minute after the start the spindle turns free
/// for three seconds.
#[test]
fn a_person_arms_the_gate_and_the_machine_follows_until_somebody_disarms_it() {
    let directory = tempfile::tempdir().expect("a directory");
    let config = prepared(directory.path(), "simulated://lathe?dropouts_per_h=0&begun_s=260");
    let (gateway, address) = start(&config, "1");
    wait_for("a decision", Duration::from_secs(60), || gate(&address)["permitted_pct"].is_number().then_some(()));
    assert_eq!(gate(&address)["written_pct"], Value::Null, "disarmed after the start");
    let socket = directory.path().join("data/control.sock");
    let mode = std::fs::metadata(&socket).expect("the socket").permissions().mode();
    assert_eq!(mode & 0o777, 0o600, "nobody else may open it");
    let (code, said) = order(&config, &["arm", "--for", "2h", "--by", "fitter"]);
    assert!(code == Some(1) && said.contains("3600 s"), "longer than the configuration allows: {said}");
    let (code, said) = order(&config, &["arm", "--for", "30m", "--by", "fitter"]);
    assert!(code == Some(0) && said.contains("armed by fitter (user"), "{said}");
    wait_for("70 % in force", Duration::from_secs(100), || {
        let status = get(&address, "/api/v1/status").json();
        let channels = status["channels"].as_array().cloned().unwrap_or_default();
        let shown = channels.iter().find(|row| row["name"] == "feed_override_pct").map(|row| row["value"].clone());
        (status["gate"]["written_pct"] == 70.0 && shown == Some(Value::from(70.0))).then_some(())
    });
    let (code, said) = order(&config, &["disarm", "--by", "foreman"]);
    assert!(code == Some(0) && said.contains("given back"), "{said}");
    wait_for("given back", Duration::from_secs(20), || gate(&address)["written_pct"].is_null().then_some(()));
    let said = gateway.stop();
    assert!(said.contains("has counted"), "{said}");
    let rows = audit(directory.path());
    for (kind, outcome) in [
        ("started", "armed"),
        ("armed", "refused"),
        ("armed", "armed"),
        ("request", "permitted"),
        ("write", "written"),
        ("reaction", "seen"),
        ("disarmed", "person"),
    ] {
        assert!(has(&rows, kind, outcome), "{kind} {outcome}: {rows:#?}");
    }
    let database = directory.path().join("data/history.db");
    let sql = "SELECT count(*) AS n, max(write_to_seen_ms) AS worst_ms FROM reactions";
    let told = stdout(&run(&["history", "query", "--history", text(&database), "--json", "--sql", sql]));
    println!("steps seen in force: {}", told.replace(['\n', ' '], ""));
    assert!(run(&["history", "audit", "--verify", "--history", text(&database)]).status.success());
}

#[test]
fn arming_ends_by_itself_and_does_not_survive_a_restart() {
    let directory = tempfile::tempdir().expect("a directory");
    let config = prepared(directory.path(), "simulated://lathe?dropouts_per_h=0&begun_s=90");
    let (gateway, address) = start(&config, "20");
    wait_for("a decision", Duration::from_secs(60), || gate(&address)["permitted_pct"].is_number().then_some(()));
    assert_eq!(order(&config, &["arm", "--for", "60s", "--by", "fitter"]).0, Some(0));
    wait_for("the end of the minute", Duration::from_secs(60), || {
        let disarmed = gate(&address)["disarmed"].clone();
        // The status is a little behind.
        let not_yet = disarmed.is_null() || disarmed == "not armed since the start";
        assert!(not_yet || disarmed == "the time of arming is over", "{disarmed}");
        (!not_yet).then_some(())
    });
    wait_for("the end in the audit", Duration::from_secs(20), || {
        has(&audit(directory.path()), "disarmed", "expired").then_some(())
    });
    assert_eq!(order(&config, &["arm", "--by", "fitter"]).0, Some(0));
    gateway.kill();
    let (gateway, address) = start(&config, "20");
    wait_for("a decision", Duration::from_secs(60), || gate(&address)["permitted_pct"].is_number().then_some(()));
    assert_eq!(gate(&address)["disarmed"], "not armed since the start");
    gateway.stop();
}

#[test]
fn without_a_gateway_or_without_permission_the_order_says_what_to_do() {
    let directory = tempfile::tempdir().expect("a directory");
    let told = run(&["arm", "--by", "fitter", "--data-dir", text(directory.path())]);
    assert_eq!(told.status.code(), Some(2));
    assert!(stderr(&told).contains("start the gateway"));
    let data = directory.path().join("data");
    let mut gateway = Gateway::start(&data, &["--speed", "20"]);
    gateway.address();
    let told = run(&["arm", "--by", "fitter", "--data-dir", text(&data)]);
    assert_eq!(told.status.code(), Some(1), "the default configuration cannot be armed");
    assert!(stdout(&told).contains("`mode` under [gate] is \"shadow\""), "{}", stdout(&told));
    let acknowledged = run(&["acknowledge", "--by", "fitter", "--json", "--data-dir", text(&data)]);
    assert!(stdout(&acknowledged).contains("\"done\": true"), "{}", stdout(&acknowledged));
    for line in ["", "{}", "arm", "{\"order\":\"arm\"}", "{\"order\":\"fire\",\"by\":\"x\"}"] {
        let reply = say(&data.join("control.sock"), line);
        assert!(reply.contains("\"done\":false"), "{line:?}: {reply}");
    }
    gateway.stop();
    assert!(!data.join("control.sock").exists(), "the socket goes with the gateway");
}

/// A line to the socket as it is.
fn say(socket: &Path, line: &str) -> String {
    use std::io::{BufRead, BufReader, Write};
    let mut stream = std::os::unix::net::UnixStream::connect(socket).expect("it listens");
    writeln!(stream, "{line}").expect("sent");
    let mut reply = String::new();
    BufReader::new(stream).read_line(&mut reply).expect("answered");
    reply
}

#[test]
fn a_script_that_is_refused_or_stopped_is_told_in_the_log_too() {
    let directory = tempfile::tempdir().expect("a directory");
    let config = prepared(directory.path(), "simulated://lathe?begun_s=90");
    let (mut gateway, address) = start(&config, "20");
    let script = directory.path().join("data/scripts/mad.rhai");
    std::fs::write(&script, "if spindel_power_w > 100.0 { note(\"x\"); }").expect("written");
    let said = gateway.wait_said("mad.rhai:1:4");
    assert!(said.contains("there is no variable `spindel_power_w`"), "{said}");
    gateway.wait_said("did you mean `spindle_power_w`?");
    // Its trial passes; it fails when the spindle turns.
    let failing = "if (spindle_speed_rpm ?? 0.0) > 1.0 { let a = [1]; a[5] = 1; }\n\
                   fn trial_a_standing_spindle() { given(#{ spindle_speed_rpm: 0.0 }); after_s(1.0); expect_no_alarms(); }";
    std::fs::write(&script, failing).expect("written");
    gateway.wait_said("a script was stopped: mad.rhai:1:");
    wait_for("the alarm in the status", Duration::from_secs(20), || {
        let status = get(&address, "/api/v1/status").json();
        let alarms = status["alarms"].as_array().expect("alarms").clone();
        alarms.iter().any(|alarm| alarm["code"] == "script_stopped (mad.rhai)").then_some(())
    });
    let said = gateway.stop();
    assert_eq!(said.matches("a script was stopped").count(), 1, "once: {said}");
}
