//! The whole box as a real process: starts, stops, goes on, and what it does when the world is against it.

use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::net::TcpListener;
use std::path::Path;
use std::process::Command;
use std::time::Duration;
use testkit::process::{Gateway, get, program, run, stderr, stdout, wait_for};

fn query(database: &Path, more: &[&str]) -> Value {
    let path = database.to_str().expect("a path");
    let output = run(&[&["history", "query", "--history", path, "--json"], more].concat());
    serde_json::from_str(&stdout(&output)).unwrap_or_else(|error| panic!("{error}: {}", stderr(&output)))
}

fn rows(database: &Path) -> u64 {
    let output = run(&["history", "info", "--json", "--history", database.to_str().expect("a path")]);
    let info: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|error| panic!("{error}: {}", stderr(&output)));
    info["samples"].as_u64().expect("a number")
}

/// The state of a controller whose spindle already turns is unknown at first, and no state is older than the first sample.
#[test]
fn the_first_state_begins_with_the_first_sample() {
    let directory = tempfile::tempdir().expect("a directory");
    let config = directory.path().join("cnc-gateway.toml");
    let source = "[[source]]\naddress = \"simulated://lathe?device=controller&begun_s=300\"\n";
    fs::write(&config, format!("[gateway]\ndata_dir = \"data\"\n{source}[http]\nenabled = false\n")).expect("written");
    let told = run(&["run", "--config", config.to_str().expect("a path"), "--speed", "max", "--for", "30"]);
    assert!(told.status.success(), "{}", stderr(&told));
    let sql =
        "SELECT count(*) AS n, min(since_ns) / 1e9 AS first_s, (SELECT count(*) FROM state_hours) AS hours FROM states";
    let found = query(&directory.path().join("data/history.db"), &["--sql", sql]);
    let row = &found["rows"][0];
    let (first_s, hours) = (row["first_s"].as_f64().expect("a number"), row["hours"].as_u64().expect("a number"));
    assert!(first_s > 1.7e9 && hours <= 16, "{found}");
}

#[test]
fn an_hour_of_the_simulated_lathe_has_every_state() {
    let directory = tempfile::tempdir().expect("a directory");
    let data = directory.path().join("data");
    let mut gateway = Gateway::start(&data, &["--speed", "max", "--for", "3600"]);
    assert!(gateway.wait().success(), "{}", gateway.said());
    let database = data.join("history.db");
    assert!((35_900..=36_001).contains(&rows(&database)), "{}", rows(&database));
    let states = query(&database, &["--records", "states"]);
    let words: BTreeSet<&str> =
        states["rows"].as_array().expect("rows").iter().filter_map(|row| row["state"].as_str()).collect();
    for word in ["off", "standby", "spindle_start", "idle", "cutting"] {
        assert!(words.contains(word), "{word} is missing: {words:?}");
    }
    let filtered = query(&database, &["--state", "cutting", "--channels", "machine_state", "--from", "-10m"]);
    let points = filtered["series"][0]["points"].as_array().expect("points");
    assert!(!points.is_empty() && points.iter().all(|point| point[1] == "cutting"), "{}", points.len());
    assert!(
        !query(&database, &["--records", "parts"])["rows"].as_array().expect("rows").is_empty(),
        "no part in an hour"
    );
}

#[test]
fn a_signal_stops_it_cleanly_and_the_next_start_goes_on() {
    let directory = tempfile::tempdir().expect("a directory");
    let data = directory.path().join("data");
    for (signal, starts) in [("TERM", 1), ("INT", 2)] {
        let mut gateway = Gateway::start(&data, &[]);
        let address = gateway.address();
        let status = wait_for("twenty ticks", Duration::from_secs(20), || {
            let status = get(&address, "/api/v1/status").json();
            (status["tick"]["count"].as_u64() >= Some(20)).then_some(status)
        });
        assert_eq!(status["schema"], "status/1");
        gateway.signal(signal);
        assert!(gateway.wait().success(), "{}", gateway.said());
        let database = data.join("history.db");
        let states = query(&database, &["--records", "states"]);
        let open = states["rows"].as_array().expect("rows").iter().filter(|row| row["to_ms"].is_null()).count();
        assert_eq!(open, 0, "a state was left open: {states}");
        let events = query(&database, &["--records", "events"]);
        let kinds = events["rows"].as_array().expect("rows").iter().filter_map(|row| row["kind"].as_str());
        assert_eq!(kinds.filter(|kind| *kind == "started").count(), starts);
        assert!(data.join("estimators.json").exists());
    }
}

/// The box after an update that changed the tables and was taken back.
#[test]
fn a_history_of_a_newer_version_is_kept_and_the_copy_of_before_goes_on() {
    let directory = tempfile::tempdir().expect("a directory");
    let data = directory.path().to_owned();
    let database = data.join("history.db");
    let live =
        |more: &[&str]| run(&[&["run", "--data-dir", data.to_str().expect("a path"), "--for", "30"], more].concat());
    let quick = ["--speed", "max", "--listen", "127.0.0.1:0"];
    assert!(live(&quick).status.success());
    let before = rows(&database);
    fs::copy(&database, data.join("kept")).expect("copied");
    crate::sealed::connect(&database).pragma_update(None, "user_version", 99).expect("changed");
    let refused = live(&quick);
    assert!(!refused.status.success() && stderr(&refused).contains("schema 99"), "{}", stderr(&refused));
    fs::rename(data.join("kept"), data.join("history.db.schema-6")).expect("the copy of before");
    let told = live(&quick);
    assert!(told.status.success(), "{}", stderr(&told));
    assert!(stdout(&told).contains("goes on with the copy of before"), "{}", stdout(&told));
    assert!(rows(&database) > before, "nothing was stored");
    let events = query(&database, &["--sql", "SELECT count(*) AS n FROM events WHERE kind = 'history_went_back'"]);
    assert_eq!(events["rows"][0]["n"], 1);
    let kept = fs::read_dir(&data).expect("there").flatten();
    assert!(kept.into_iter().any(|file| file.file_name().to_string_lossy().starts_with("history.db.newer-")));
}

#[test]
fn a_named_port_in_use_is_refused_with_a_hint() {
    let taken = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = taken.local_addr().expect("bound").to_string();
    let directory = tempfile::tempdir().expect("a directory");
    let output = run(&["run", "--data-dir", directory.path().to_str().expect("a path"), "--listen", &address]);
    assert_eq!(output.status.code(), Some(2));
    let said = stderr(&output);
    assert!(said.contains("in use by another program") && said.contains("--listen"), "{said}");
}

#[test]
fn without_its_port_the_box_goes_on_and_takes_it_later() {
    // Somebody may hold the usual port already; then only the first half can be seen.
    let taken = TcpListener::bind("127.0.0.1:8080");
    let directory = tempfile::tempdir().expect("a directory");
    let mut command = program();
    command.arg("run").arg("--data-dir").arg(directory.path()).args(["--speed", "10"]);
    let mut gateway = Gateway::spawn(command);
    gateway.wait_said("is in use by another program: no page for now. Polling goes on");
    let database = directory.path().join("history.db");
    wait_for("samples without a page", Duration::from_secs(20), || (rows(&database) > 20).then_some(()));
    if taken.is_ok() {
        drop(taken);
        gateway.wait_said("live page: http://127.0.0.1:8080/");
        assert_eq!(get("127.0.0.1:8080", "/healthz").status, 200);
    }
    gateway.stop();
}

#[test]
fn a_second_gateway_on_one_history_refuses() {
    let directory = tempfile::tempdir().expect("a directory");
    let mut first = Gateway::start(directory.path(), &[]);
    first.address();
    let output = run(&["run", "--data-dir", directory.path().to_str().expect("a path"), "--listen", "127.0.0.1:0"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("another cnc-gateway"), "{}", stderr(&output));
    first.stop();
}

#[test]
fn where_nothing_can_be_written_it_polls_and_serves_and_says_so() {
    // Nobody can create files here, not even root.
    let mut gateway = Gateway::start(Path::new("/proc/cnc-gateway"), &[]);
    gateway.wait_said("nothing is being stored");
    let address = gateway.address();
    let status = wait_for("ticks", Duration::from_secs(20), || {
        let status = get(&address, "/api/v1/status").json();
        (status["tick"]["count"].as_u64() >= Some(20)).then_some(status)
    });
    assert!(
        status["history"]["error"].is_string() && !status["problems"].as_array().expect("a list").is_empty(),
        "{status}"
    );
    let answer = get(&address, "/api/v1/states");
    assert_eq!((answer.status, answer.json()["hint"].is_string()), (503, true));
    gateway.stop();
}

#[test]
fn a_full_disk_is_told_polling_goes_on_and_storing_too_when_there_is_room() {
    let possible = Command::new("unshare").args(["-rm", "sh", "-c", "mount -t tmpfs tmpfs /mnt"]).status();
    if !possible.is_ok_and(|status| status.success()) {
        eprintln!("SKIPPED: this system lets nobody mount a small disk");
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let disk = directory.path().join("disk");
    fs::create_dir(&disk).expect("created");
    let script = "mount -t tmpfs -o size=24m tmpfs \"$1\" && exec \"$2\" run --data-dir \"$1\" --listen 127.0.0.1:0 --speed 1000";
    let mut command = Command::new("unshare");
    command.args(["-rm", "sh", "-c", script, "sh"]).arg(&disk).arg(env!("CARGO_BIN_EXE_cnc-gateway"));
    let mut gateway = Gateway::spawn(command);
    let address = gateway.address();
    let rows = |address: &str| get(address, "/api/v1/status").json()["history"]["rows"].as_u64();
    wait_for("the first samples", Duration::from_secs(30), || rows(&address).filter(|rows| *rows > 0));
    // The disk is in a name space of its own; this is the way to it.
    let hog = Path::new("/proc")
        .join(gateway.pid().to_string())
        .join("root")
        .join(disk.strip_prefix("/").expect("absolute"))
        .join("hog");
    let mut file = fs::File::create(&hog).expect("created");
    let filled = std::iter::repeat_with(|| file.write_all(&[1; 1 << 16])).take(1000).find_map(Result::err);
    assert_eq!(filled.map(|error| error.kind()), Some(std::io::ErrorKind::StorageFull));
    let full = wait_for("a full disk", Duration::from_secs(180), || {
        let status = get(&address, "/api/v1/status").json();
        status["history"]["error"].is_string().then_some(status)
    });
    let count = full["tick"]["count"].as_u64();
    wait_for("ticks on a full disk", Duration::from_secs(60), || {
        let status = get(&address, "/api/v1/status").json();
        (status["tick"]["count"].as_u64() > count.map(|count| count + 100)).then_some(())
    });
    assert_eq!(get(&address, "/healthz").status, 200);
    let stored = rows(&address);
    drop(file);
    fs::remove_file(&hog).expect("removed");
    gateway.wait_said("the history is being written as usual");
    wait_for("samples again", Duration::from_secs(30), || (rows(&address) > stored).then_some(()));
    gateway.signal("TERM");
    assert!(gateway.wait().success(), "{}", gateway.said());
}

#[test]
fn a_broken_script_leaves_the_last_good_one_in_charge_and_says_so_everywhere() {
    let directory = tempfile::tempdir().expect("a directory");
    let mut gateway = Gateway::start(directory.path(), &[]);
    let address = gateway.address();
    let script = directory.path().join("scripts/energy.rhai");
    let good = fs::read_to_string(&script).expect("delivered at the first start");
    fs::write(&script, "let broken = ;").expect("written");
    gateway.signal("HUP");
    let line = gateway.wait_said("scripts refused, the ones before stay in charge");
    assert!(!line.is_empty());
    let condition = |address: &str| {
        let status = get(address, "/api/v1/status").json();
        let scripts = status["scripts"].as_array().expect("a list").clone();
        scripts.into_iter().find(|script| script["file"] == "energy.rhai").expect("listed")
    };
    let broken = wait_for("the status", Duration::from_secs(5), || {
        Some(condition(&address)).filter(|it| it["error"].is_string())
    });
    assert!(broken["error"].as_str().expect("text").contains("energy.rhai:1:"), "{broken}");
    let metrics = get(&address, "/metrics").body;
    assert!(metrics.contains("cncgw_script_current{script=\"energy.rhai\"} 0"), "{metrics}");
    fs::write(&script, good).expect("written");
    gateway.wait_said("scripts are in charge as they are on disk");
    wait_for("the status", Duration::from_secs(5), || condition(&address)["error"].is_null().then_some(()));
    gateway.stop();
    let events = query(&directory.path().join("history.db"), &["--records", "events"]);
    assert!(events.to_string().contains("scripts_refused"), "{events}");
}

#[test]
fn language_and_log_are_those_of_the_configuration() {
    let directory = tempfile::tempdir().expect("a directory");
    let config = directory.path().join("cnc-gateway.toml");
    let text = "[gateway]\nlanguage = \"zh\"\n[log]\nformat = \"json\"\n[http]\nlisten = \"127.0.0.1:0\"\n\
                [[source]]\naddress = \"simulated://lathe\"\n";
    fs::write(&config, text).expect("written");
    let mut command = program();
    command.args(["run", "--config"]).arg(&config);
    let mut gateway = Gateway::spawn(command);
    let line = gateway.wait_said("\"code\":\"serving\"");
    let event: Value = serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line}"));
    assert_eq!(event["level"], "INFO");
    let address =
        event["message"].as_str().expect("text").trim_start_matches("live page: http://").trim_end_matches('/');
    let page = get(address, "/").body;
    assert!(page.contains("<html lang=\"zh-CN\" data-opens=\"zh\">"), "{page}");
    gateway.stop();
}
