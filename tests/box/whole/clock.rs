//! The clock of the computer, as libfaketime sets it under a running box: told, not followed until it has stood, rows dated anew.

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;
use testkit::process::{Gateway, get, program, run, stderr, stdout, wait_for};

/// A box whose clock can be set.
struct Clocked {
    directory: tempfile::TempDir,
    offset: PathBuf,
}

const LIBRARY: &str = "/usr/lib/x86_64-linux-gnu/faketime/libfaketime.so.1";

impl Clocked {
    /// `None`, with a word about it, where the clock cannot be set. A reading is believed after `confirm_s`.
    fn new(confirm_s: f64) -> Option<Self> {
        if !Path::new(LIBRARY).exists() {
            assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "no libfaketime: install the package faketime");
            eprintln!("SKIPPED: no libfaketime here; install the package faketime");
            return None;
        }
        let directory = tempfile::tempdir().expect("a directory");
        let offset = directory.path().join("offset");
        let config = format!(
            "[gateway]\ndata_dir = \"data\"\nclock_confirm_s = {confirm_s:.1}\n[http]\nlisten = \"127.0.0.1:0\"\n\
             [[source]]\naddress = \"simulated://lathe\"\n"
        );
        fs::write(directory.path().join("box.toml"), config).expect("written");
        Some(Self { directory, offset })
    }

    /// `+3600s`, or a time: `@1970-01-01 00:00:10`.
    fn set(&self, offset: &str) {
        let beside = self.offset.with_extension("new");
        fs::write(&beside, offset).expect("written");
        fs::rename(&beside, &self.offset).expect("in its place");
    }

    fn start(&self) -> (Gateway, String) {
        let mut command = program();
        command.arg("run").arg("--config").arg(self.directory.path().join("box.toml"));
        command.env("LD_PRELOAD", LIBRARY).env("FAKETIME_TIMESTAMP_FILE", &self.offset).env("FAKETIME_NO_CACHE", "1");
        command.env("FAKETIME_DONT_FAKE_MONOTONIC", "1").env("DONT_FAKE_MONOTONIC", "1").env("TZ", "UTC");
        let mut gateway = Gateway::spawn(command);
        let address = gateway.address();
        (gateway, address)
    }

    fn database(&self) -> PathBuf {
        self.directory.path().join("data/history.db")
    }

    fn query(&self, sql: &str) -> Value {
        let database = self.database();
        let path = database.to_str().expect("a path");
        let output = run(&["history", "query", "--history", path, "--json", "--sql", sql]);
        let document: Value =
            serde_json::from_str(&stdout(&output)).unwrap_or_else(|error| panic!("{error}: {}", stderr(&output)));
        document["rows"].clone()
    }
}

fn status(address: &str) -> Value {
    get(address, "/api/v1/status").json()
}

fn at_s(address: &str) -> i64 {
    status(address)["at_ms"].as_i64().expect("a time") / 1000
}

fn now_s() -> i64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).expect("after 1970");
    i64::try_from(since.as_secs()).expect("small")
}

fn ticks(address: &str, count: u64) {
    let counted = || get(address, "/api/v1/status").json()["tick"]["count"].as_u64();
    let before = wait_for("the first tick", Duration::from_secs(60), counted);
    wait_for("ticks", Duration::from_secs(60), || counted().filter(|now| *now >= before + count));
}

#[test]
fn a_leap_is_told_and_the_box_keeps_its_own_time() {
    let Some(clocked) = Clocked::new(60.0) else { return };
    clocked.set("+0s");
    let (mut gateway, address) = clocked.start();
    ticks(&address, 10);
    assert_eq!(status(&address)["clock"]["trust"], "plausible");
    for (leap, words) in [
        ("+34992000s", "405 days ahead of"),
        ("+347155200s", "11 years ahead of"),
        ("-3600s", "60 min behind"),
        ("-315576000s", "10 years behind"),
        ("@1970-01-01 00:00:10", "56 years behind"),
    ] {
        clocked.set(leap);
        gateway.wait_said(&format!("the wall clock is {words} the box now"));
        let told = wait_for("the problem", Duration::from_secs(10), || {
            let status = status(&address);
            (status["clock"]["trust"] == "leapt").then_some(status)
        });
        assert!(told["problems"].to_string().contains("the wall clock is"), "{}", told["problems"]);
        assert!((at_s(&address) - now_s()).abs() < 5, "{leap}");
        clocked.set("+0s");
        wait_for("the end of it", Duration::from_secs(10), || {
            (status(&address)["clock"]["trust"] == "plausible").then_some(())
        });
    }
    ticks(&address, 10);
    assert!(!gateway.said().contains("begins again"), "{}", gateway.said());
    gateway.stop();
    let rows = clocked.query("SELECT count(*) AS segments FROM segments");
    assert_eq!(rows[0]["segments"], 1, "one stretch of time");
    let rows = clocked.query(
        "SELECT max(gap_ns) AS gap_ns FROM (SELECT at_ns - lag(at_ns) OVER (ORDER BY at_ns) AS gap_ns FROM samples)",
    );
    assert!(rows[0]["gap_ns"].as_i64() < Some(5_000_000_000), "{rows}");
    let rows =
        clocked.query("SELECT kind, count(*) AS n FROM events WHERE source = 'clock' GROUP BY kind ORDER BY kind");
    assert_eq!(rows[0]["kind"], "clock_leapt", "{rows}");
    assert_eq!((&rows[0]["n"], &rows[1]["n"]), (&5.into(), &5.into()), "{rows}");
}

#[test]
fn a_box_without_a_battery_dates_its_rows_when_the_clock_is_set() {
    let Some(clocked) = Clocked::new(240.0) else { return };
    clocked.set("@1970-01-01 00:00:10");
    let (mut gateway, address) = clocked.start();
    gateway.wait_said("the clock of the computer says what cannot be");
    ticks(&address, 20);
    let before = status(&address);
    assert_eq!(before["clock"]["trust"], "unset");
    assert!(before["problems"].to_string().contains("not set"), "{}", before["problems"]);
    clocked.set("+0s");
    gateway.wait_said("the box begins again with it");
    gateway.wait_said("are dated");
    // The page is there again, on another port.
    let address = wait_for("the page again", Duration::from_secs(30), || {
        let pages = gateway.list_pages();
        (pages.len() == 2).then(|| pages[1].clone())
    });
    ticks(&address, 20);
    assert!((at_s(&address) - now_s()).abs() < 5);
    assert_eq!(status(&address)["clock"]["trust"], "plausible");
    gateway.stop();
    let rows = clocked.query("SELECT min(at_ns) / 1000000000 AS first_s, count(*) AS n FROM samples");
    let first_s = rows[0]["first_s"].as_i64().expect("a number");
    assert!((now_s() - first_s) < 120, "no row from 1970 or from the last certain time: {rows}, now {}", now_s());
    let rows = clocked.query("SELECT group_concat(DISTINCT clock) AS clocks FROM segments");
    assert_eq!(rows[0]["clocks"], "plausible", "{rows}");
    let rows = clocked.query("SELECT count(*) AS n FROM events WHERE at_ns < 1767225600000000000 + 86400000000000");
    assert_eq!(rows[0]["n"], 0, "events too");
}

#[test]
fn nothing_is_erased_by_a_clock_that_was_believed_for_years_in_a_moment() {
    let Some(clocked) = Clocked::new(10.0) else { return };
    clocked.set("+0s");
    let (gateway, address) = clocked.start();
    ticks(&address, 150);
    let samples = |clocked: &Clocked| clocked.query("SELECT count(*) AS n FROM samples")[0]["n"].as_u64();
    gateway.stop();
    let before = samples(&clocked);
    // Years ahead for long enough to be confirmed, so that it is followed and housekeeping is done by it.
    clocked.set("+347155200s");
    let (mut gateway, address) = clocked.start();
    gateway.wait_said("the clock has been right for long enough");
    ticks(&address, 30);
    clocked.set("+0s");
    gateway.wait_said("the box begins again with it");
    gateway.wait_said("dated after now");
    gateway.stop();
    assert!(samples(&clocked) > before, "{before:?}");
    let rows = clocked.query("SELECT count(*) AS n FROM dropped");
    assert_eq!(rows[0]["n"], 0, "nothing was removed");
    let database = clocked.database();
    let path = database.to_str().expect("a path");
    let check = run(&["history", "audit", "--verify", "--history", path]);
    assert!(check.status.success(), "{}", stdout(&check));
    // `-10m` counts from now, and what says it comes from the future can be set apart.
    let now = run(&["history", "query", "--history", path, "--from", "-10m", "--channels", "machine_state"]);
    assert!(stdout(&now).lines().count() > 100, "{}", stdout(&now).lines().count());
    let apart = clocked.directory.path().join("apart.db");
    let moved = run(&["history", "set-apart", apart.to_str().expect("a path"), "--history", path]);
    assert!(moved.status.success() && stdout(&moved).contains("samples and"), "{}{}", stdout(&moved), stderr(&moved));
    let left = clocked.query("SELECT max(at_ns) / 1000000000 AS last_s FROM samples");
    assert!(left[0]["last_s"].as_i64() <= Some(now_s()), "{left}");
    let info = run(&["history", "info", "--history", apart.to_str().expect("a path")]);
    assert!(info.status.success(), "{}", stderr(&info));
}
