//! The clock of the computer: leaps while the box runs, wrong years at its start, summer time.

use crate::kills::{queried, status};
use crate::table::{Row, Scale};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use testkit::process::{Gateway, program, run, stdout, wait_for};

pub(crate) const LIBRARY: &str = "/usr/lib/x86_64-linux-gnu/faketime/libfaketime.so.1";

/// Offsets of a wrong clock, as libfaketime reads them.
pub(crate) const LEAPS: [&str; 5] = ["+34992000s", "+347155200s", "-3600s", "-315576000s", "@1970-01-01 00:00:10"];

/// A box whose clock can be set.
pub(crate) struct Clocked {
    pub(crate) directory: tempfile::TempDir,
    offset: PathBuf,
    zone: &'static str,
    confirm: Duration,
}

impl Clocked {
    /// `None` where libfaketime is not installed. A reading is believed after `confirm_s`; further lines of configuration.
    pub(crate) fn new(confirm_s: f64, more: &str) -> Option<Self> {
        if !Path::new(LIBRARY).exists() {
            assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "no libfaketime: install the package faketime");
            return None;
        }
        let directory = tempfile::tempdir().expect("a directory");
        let offset = directory.path().join("offset");
        let config = format!(
            "[gateway]\ndata_dir = \"data\"\nclock_confirm_s = {confirm_s:.1}\n[http]\nlisten = \"127.0.0.1:0\"\n{more}"
        );
        fs::write(directory.path().join("box.toml"), config).expect("written");
        let clocked = Self { directory, offset, zone: "UTC", confirm: Duration::from_secs_f64(confirm_s) };
        clocked.set("+0s");
        Some(clocked)
    }

    pub(crate) fn config(&self) -> PathBuf {
        self.directory.path().join("box.toml")
    }

    pub(crate) fn set(&self, offset: &str) {
        let beside = self.offset.with_extension("new");
        fs::write(&beside, offset).expect("written");
        fs::rename(&beside, &self.offset).expect("in its place");
    }

    pub(crate) fn start(&self) -> (Gateway, String) {
        let mut command = program();
        command.arg("run").arg("--config").arg(self.config());
        command.env("LD_PRELOAD", LIBRARY).env("FAKETIME_TIMESTAMP_FILE", &self.offset).env("FAKETIME_NO_CACHE", "1");
        command.env("FAKETIME_DONT_FAKE_MONOTONIC", "1").env("DONT_FAKE_MONOTONIC", "1").env("TZ", self.zone);
        let mut gateway = Gateway::spawn(command);
        let address = gateway.address();
        (gateway, address)
    }

    /// The page of the box that has begun again, of its `count`th run. A reading is followed when it has stood for `confirm_s`.
    pub(crate) fn again(&self, gateway: &Gateway, count: usize) -> String {
        wait_for("the page again", self.confirm + Duration::from_secs(60), || page(gateway, count))
    }

    pub(crate) fn query(&self, sql: &str) -> Value {
        queried(&self.directory.path().join("data/history.db"), sql)
    }

    /// Samples that lie outside the times between which the test has run, and those from before that are gone; what the audit
    /// says of itself.
    fn check(&self, row: &mut Row, since_s: i64, stored: u64) {
        let (from, to) = (since_s - 2, now_s() + 2);
        let sql =
            format!("SELECT count(*) AS n, sum(at_ns / 1000000000 NOT BETWEEN {from} AND {to}) AS wrong FROM samples");
        let found = self.query(&sql);
        let (count, wrong) = (found[0]["n"].as_u64().unwrap_or(0), found[0]["wrong"].as_u64().unwrap_or(0));
        row.lost = Some(row.lost.unwrap_or(0) + stored.saturating_sub(count));
        row.wrong = Some(row.wrong.unwrap_or(0) + wrong);
        row.must(count >= stored, format!("{stored} samples became {count}"));
        row.must(wrong == 0, format!("{wrong} of {count} samples are misdated"));
        let events = format!("SELECT count(*) AS n FROM events WHERE at_ns / 1000000000 NOT BETWEEN {from} AND {to}");
        let events = self.query(&events)[0]["n"].as_u64();
        row.must(events == Some(0), format!("{events:?} events are misdated"));
        let dropped = self.query("SELECT count(*) AS n FROM dropped")[0]["n"].as_u64();
        row.must(dropped == Some(0), "something was removed");
        let database = self.directory.path().join("data/history.db");
        let audit = run(&["history", "audit", "--verify", "--history", database.to_str().expect("a path")]);
        row.must(audit.status.success(), stdout(&audit));
    }

    fn samples(&self) -> u64 {
        self.query("SELECT count(*) AS n FROM samples")[0]["n"].as_u64().unwrap_or(0)
    }
}

/// The address that the `count`th run has said, if it has.
fn page(gateway: &Gateway, count: usize) -> Option<String> {
    gateway.list_pages().into_iter().nth(count - 1)
}

/// Does the box at this address trust its clock, and has it the time of the test?
fn is_right(address: &str) -> Option<()> {
    let status = status(address)?;
    let trusted = ["plausible", "confirmed"].iter().any(|word| status["clock"]["trust"] == *word);
    let off_s = status["at_ms"].as_i64()? / 1000 - now_s();
    (trusted && off_s.abs() <= 3).then_some(())
}

pub(crate) fn now_s() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970");
    i64::try_from(since.as_secs()).expect("small")
}

const SOURCE: &str = "[[source]]\naddress = \"simulated://lathe\"\n";

pub(crate) fn ticks(address: &str, count: u64) {
    let counted = || status(address)?["tick"]["count"].as_u64();
    let before = wait_for("the first tick", Duration::from_secs(120), counted);
    wait_for("ticks", Duration::from_secs(120), || counted().filter(|now| *now >= before + count));
}

/// Each leap for some seconds while the box runs; with a confirmed clock and with one that is not.
pub(crate) fn leaps(scale: &Scale) -> Row {
    let mut row = Row::new(
        "+405 d, +11 y, -1 h, -10 y, 1970 for 3 to 30 s under a running box (libfaketime); times against those of the test",
    );
    for confirm_s in [10.0, 600.0] {
        let Some(clocked) = Clocked::new(confirm_s, SOURCE) else { return Row::skipped(row.how) };
        let since_s = now_s();
        let (mut gateway, address) = clocked.start();
        ticks(&address, 20);
        if confirm_s < 60.0 {
            gateway.wait_said("the clock has been right for long enough");
        }
        for _ in 0..scale.of(3, 1) {
            for (index, leap) in LEAPS.into_iter().enumerate() {
                clocked.set(leap);
                // Shorter than the time of confirmation, which here stands for two hours.
                let lasts = if confirm_s < 60.0 { 3 + index as u64 } else { 5 + 5 * index as u64 };
                std::thread::sleep(Duration::from_secs(lasts));
                let told = status(&address).map(|status| status["clock"]["trust"].clone());
                row.must(told == Some("leapt".into()), format!("{leap}: {told:?}"));
                clocked.set("+0s");
                std::thread::sleep(Duration::from_secs(2));
                row.n += 1;
            }
        }
        let stored = status(&address).and_then(|status| status["history"]["rows"].as_u64()).unwrap_or(0);
        row.must(!gateway.said().contains("begins again"), "a leap was followed");
        gateway.stop();
        clocked.check(&mut row, since_s, stored);
        let told =
            clocked.query("SELECT sum(kind = 'clock_leapt') AS leapt, sum(kind = 'clock_right') AS over FROM events");
        row.note = format!("events: {} leapt, {} over", told[0]["leapt"], told[0]["over"]);
    }
    row
}

/// Boxes that start with each wrong clock, which is set right after some seconds.
pub(crate) fn wrong_at_start(scale: &Scale) -> Row {
    let mut row = Row::new(
        "the same wrong at the start and set right 5 s later, with a history of before; times against those of the test",
    );
    let Some(clocked) = Clocked::new(24.0, SOURCE) else { return Row::skipped(row.how) };
    let since_s = now_s();
    let (mut gateway, address) = clocked.start();
    ticks(&address, 20);
    gateway.wait_said("the clock has been right for long enough");
    ticks(&address, 20);
    gateway.stop();
    for _ in 0..scale.of(4, 1) {
        for leap in LEAPS {
            let stored = clocked.samples();
            clocked.set(leap);
            let (gateway, address) = clocked.start();
            ticks(&address, 20);
            std::thread::sleep(Duration::from_secs(3));
            clocked.set("+0s");
            let began = std::time::Instant::now();
            // A box that was off by less than two seconds is right without beginning again.
            let address = wait_for("a clock that is right", Duration::from_secs(90), || {
                let now = page(&gateway, 2).unwrap_or_else(|| address.clone());
                is_right(&now).map(|()| now)
            });
            row.recovered(began.elapsed());
            ticks(&address, 10);
            gateway.stop();
            clocked.check(&mut row, since_s, stored);
            row.n += 1;
        }
    }
    row.note =
        "recovers: from the clock being right to the rows being right, with 24 s in place of two hours".to_owned();
    row
}

/// Over both changes of summer time, in the zone of a shop.
pub(crate) fn summer_time(_: &Scale) -> Row {
    let mut row = Row::new("30 s over each change of the year in Europe/Berlin (libfaketime); gaps and segments");
    for change in ["@2027-03-28 01:59:50", "@2027-10-31 02:59:50"] {
        let Some(mut clocked) = Clocked::new(600.0, SOURCE) else { return Row::skipped(row.how) };
        clocked.zone = "Europe/Berlin";
        clocked.set(change);
        let (gateway, address) = clocked.start();
        ticks(&address, 10);
        std::thread::sleep(Duration::from_secs(30));
        gateway.stop();
        let gaps = clocked.query(
            "SELECT max(gap_ns) / 1e9 AS gap_s, min(gap_ns) AS least FROM (SELECT at_ns - lag(at_ns) OVER (ORDER BY at_ns) AS gap_ns FROM samples)",
        );
        row.must(gaps[0]["gap_s"].as_f64() < Some(5.0), format!("{gaps}"));
        let segments = clocked.query("SELECT count(*) AS n, sum(clock <> 'plausible') AS other FROM segments");
        row.must(segments[0]["n"] == 1 && segments[0]["other"] == 0, format!("{segments}"));
        row.n += 1;
    }
    (row.lost, row.wrong) = (Some(0), Some(0));
    row
}
