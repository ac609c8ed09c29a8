//! SIGKILL and SIGTERM at random moments of a running box.

use crate::table::{Row, Scale};
use gateway::history::Reader;
use rand::{Rng, SeedableRng};
use serde_json::Value;
use std::path::Path;
use std::time::{Duration, Instant};
use testkit::process::{Gateway, program, run, stderr, stdout, text, try_get, wait_for};

pub(crate) fn random() -> rand_pcg::Pcg64Mcg {
    let seed = std::env::var("CNC_GATEWAY_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(20_261_126);
    rand_pcg::Pcg64Mcg::seed_from_u64(seed)
}

/// What the box says of itself, while it does.
pub(crate) fn status(address: &str) -> Option<Value> {
    let answer = try_get(address, "/api/v1/status").ok()?;
    (answer.status == 200).then(|| serde_json::from_str(&answer.body).ok()).flatten()
}

/// The rows of an answer of `history query --sql`.
pub(crate) fn queried(database: &Path, sql: &str) -> Value {
    let output = run(&["history", "query", "--history", text(database), "--json", "--sql", sql]);
    let document: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|error| panic!("{error}: {}", stderr(&output)));
    document["rows"].clone()
}

/// Samples in the file, and everything that is wrong with it.
fn checked(database: &Path, row: &mut Row) -> u64 {
    let Ok(reader) = Reader::open(database) else { return 0 };
    let findings = reader.check_integrity().unwrap_or_else(|error| vec![error.to_string()]);
    row.must(findings.is_empty(), format!("{findings:?}"));
    let audit = reader.verify_audit().map(|check| check.broken);
    row.must(matches!(audit, Ok(None)), format!("{audit:?}"));
    reader.read_info().map_or(0, |info| info.samples.unsigned_abs())
}

fn kill_often(mut row: Row, count: usize, start: impl Fn(&Path) -> Gateway) -> Row {
    let directory = tempfile::tempdir().expect("a directory");
    let data = directory.path().join("data");
    let database = data.join("history.db");
    let (mut random, mut most, mut lost) = (random(), 0, 0);
    for _ in 0..count {
        let began = Instant::now();
        let mut gateway = start(&data);
        let address = gateway.address();
        let first = wait_for("the first tick", Duration::from_secs(120), || {
            status(&address).and_then(|status| status["tick"]["count"].as_u64()).filter(|count| *count > 0)
        });
        row.must(first > 0, "no tick");
        row.recovered(began.elapsed());
        let until = Instant::now() + Duration::from_millis(random.random_range(50..1200));
        let mut acknowledged = 0;
        while Instant::now() < until || acknowledged == 0 {
            let rows = status(&address).and_then(|status| status["history"]["rows"].as_u64());
            acknowledged = rows.unwrap_or(acknowledged).max(acknowledged);
        }
        gateway.kill();
        let there = checked(&database, &mut row);
        lost += acknowledged.max(most).saturating_sub(there);
        most = most.max(there);
    }
    (row.n, row.lost) = (count, Some(lost));
    row.must(lost == 0, format!("{lost} acknowledged rows are gone"));
    row.note = format!("{most} rows; chain of the audit and file in order after each");
    row
}

pub(crate) fn at_random(scale: &Scale) -> Row {
    let row = Row::new("SIGKILL 0.05 to 1.2 s after the first tick; rows that the status had acknowledged");
    kill_often(row, scale.of(200, 4), |data| Gateway::start(data, &["--speed", "60"]))
}

/// Each fsync takes 50 ms: kills hit commits that are under way.
pub(crate) fn with_slow_disk(scale: &Scale) -> Row {
    let row = Row::new("the same while strace makes each fdatasync 50 ms longer");
    if !strace() {
        return Row::skipped(row.how);
    }
    kill_often(row, scale.of(40, 3), |data| {
        let mut command = std::process::Command::new("strace");
        command.args([
            "-f",
            "-q",
            "-o",
            "/dev/null",
            "-e",
            "trace=fdatasync",
            "-e",
            "inject=fdatasync:delay_enter=50000",
        ]);
        // The tracer is a grandchild: what is killed is the gateway itself.
        command.arg("-D").arg(env!("CARGO_BIN_EXE_cnc-gateway"));
        command.args(["run", "--listen", "127.0.0.1:0", "--speed", "60", "--data-dir"]).arg(data);
        Gateway::spawn(command)
    })
}

/// Is there an strace that may trace?
pub(crate) fn strace() -> bool {
    let output = std::process::Command::new("strace").args(["-D", "-o", "/dev/null", "true"]).output();
    output.is_ok_and(|output| output.status.success())
}

/// SIGTERM in the first moments: the box ends by itself and leaves everything in order, or had opened nothing yet.
pub(crate) fn early_term(scale: &Scale) -> Row {
    let mut row = Row::new("SIGTERM 0 to 400 ms after the start; how the process ends");
    let directory = tempfile::tempdir().expect("a directory");
    let data = directory.path().join("data");
    let count = scale.of(200, 10);
    let mut by_default = 0;
    for step in 0..count {
        let mut command = program();
        command.arg("run").arg("--data-dir").arg(&data).args(["--listen", "127.0.0.1:0"]);
        let mut gateway = Gateway::spawn(command);
        std::thread::sleep(Duration::from_micros(400_000 * step as u64 / count as u64));
        gateway.signal("TERM");
        let ended = gateway.wait();
        // Before it listens to signals it has opened nothing.
        by_default += usize::from(ended.code().is_none() && gateway.said().contains("is being polled"));
        checked(&data.join("history.db"), &mut row);
    }
    row.n = count;
    row.must(by_default == 0, format!("{by_default} ended by the default action after the start"));
    row
}
