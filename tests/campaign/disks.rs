//! Disks: full, failing, and files that somebody removes, replaces, damages or reads for ever while the box writes.

use crate::kills::{queried, status, strace};
use crate::table::{Row, Scale};
use gateway::history::Reader;
use serde_json::Value;
use std::fs::{self, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};
use testkit::process::{Gateway, wait_for};
use testkit::small_disk::start_on_tmpfs;

/// A box at sixty times the pace of a machine, so that its file grows.
struct Running {
    _directory: tempfile::TempDir,
    database: PathBuf,
    gateway: Gateway,
    address: String,
}

impl Running {
    fn start() -> Self {
        let directory = tempfile::tempdir().expect("a directory");
        let data = directory.path().join("data");
        let mut gateway = Gateway::start(&data, &["--speed", "60"]);
        let address = gateway.address();
        let running = Self { database: data.join("history.db"), _directory: directory, gateway, address };
        running.wait_rows(600);
        running
    }

    fn history(&self) -> Value {
        status(&self.address).map(|status| status["history"].clone()).unwrap_or_default()
    }

    fn rows(&self) -> u64 {
        self.history()["rows"].as_u64().unwrap_or(0)
    }

    fn wait_rows(&self, count: u64) {
        wait_for(&format!("{count} rows"), Duration::from_secs(120), || (self.rows() >= count).then_some(()));
    }

    /// Something has been done to the file: the box says what, says what was lost, and stores into a file that is in order.
    fn survives(self, row: &mut Row, said: &str, began: Instant) {
        let line = wait_for(said, Duration::from_secs(90), || {
            self.gateway.said().lines().find(|line| line.contains(said)).map(str::to_owned)
        });
        let before = self.rows();
        wait_for("new rows", Duration::from_secs(60), || (self.rows() > before).then_some(()));
        row.recovered(began.elapsed());
        let lost = self.history()["lost"].as_u64().unwrap_or(0);
        row.lost = Some(row.lost.unwrap_or(0) + lost);
        row.note = line;
        let database = self.database.clone();
        self.gateway.stop();
        let reader = Reader::open(&database).expect("a history");
        let findings = reader.check_integrity().unwrap_or_else(|error| vec![error.to_string()]);
        row.must(findings.is_empty(), format!("{findings:?}"));
        row.must(reader.read_info().is_ok_and(|info| info.samples > 0), "nothing in the new file");
        row.n += 1;
    }
}

/// rm history.db*
pub(crate) fn removed(scale: &Scale) -> Row {
    let mut row = Row::new("rm of file and log under a running box; lost: what the status owns up to");
    for _ in 0..scale.of(5, 1) {
        let running = Running::start();
        let began = Instant::now();
        for end in ["", "-wal", "-shm"] {
            let _absent = fs::remove_file(format!("{}{end}", running.database.display()));
        }
        running.survives(&mut row, "somebody has removed it", began);
    }
    row.must(row.lost > Some(0), "rows went with the file, and the status says none did");
    row
}

/// Another history is put in the place of this one.
pub(crate) fn replaced(scale: &Scale) -> Row {
    let mut row = Row::new("another history moved into the place of the file; lost: what the status owns up to");
    for _ in 0..scale.of(5, 1) {
        let other = Running::start();
        let Running { gateway, database, _directory, .. } = other;
        gateway.stop();
        let running = Running::start();
        let began = Instant::now();
        fs::copy(&database, running.database.with_extension("other")).expect("copied");
        for end in ["-wal", "-shm"] {
            let _absent = fs::remove_file(format!("{}{end}", running.database.display()));
        }
        fs::rename(running.database.with_extension("other"), &running.database).expect("moved");
        running.survives(&mut row, "another file lies in its place", began);
    }
    row.must(row.lost > Some(0), "rows went with the file, and the status says none did");
    row
}

/// The file is noise but for its header, after what stood in the log has been copied into it: found at the next start.
pub(crate) fn damaged(scale: &Scale) -> Row {
    let mut row = Row::new(
        "SIGKILL, every page of the file but the first overwritten with noise, and a start; the damaged file is kept, a new one is begun",
    );
    for _ in 0..scale.of(5, 1) {
        let Running { _directory, database, gateway, .. } = Running::start();
        gateway.kill();
        let log = rusqlite::Connection::open(&database).expect("opens");
        log.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |_| Ok(())).expect("copied");
        drop(log);
        let mut file = OpenOptions::new().write(true).open(&database).expect("opens");
        let length = file.metadata().expect("there").len();
        file.seek(SeekFrom::Start(4096)).expect("seeks");
        file.write_all(&vec![0x5a; usize::try_from(length).unwrap_or(0).saturating_sub(4096)]).expect("written");
        drop(file);
        let began = Instant::now();
        let mut gateway = Gateway::start(database.parent().expect("a directory"), &["--speed", "60"]);
        let address = gateway.address();
        let running = Running { _directory, database, gateway, address };
        running.survives(&mut row, "the history was damaged and is kept as", began);
    }
    row
}

/// Somebody begins to read and never ends: the log grows, which is told, and is short again afterwards.
pub(crate) fn endless_reader(_: &Scale) -> Row {
    let mut row = Row::new("BEGIN; SELECT by another connection until the log is told; its length afterwards");
    let running = Running::start();
    let reader = rusqlite::Connection::open(&running.database).expect("opens");
    reader.execute_batch("BEGIN").expect("begins");
    let _one: i64 = reader.query_row("SELECT count(*) FROM events", [], |row| row.get(0)).expect("reads");
    let log = || fs::metadata(format!("{}-wal", running.database.display())).map_or(0, |file| file.len());
    let began = Instant::now();
    wait_for("the long log to be told", Duration::from_secs(900), || {
        running.gateway.said().contains("somebody reads the history and does not end").then_some(())
    });
    let (told_at, longest) = (began.elapsed(), log());
    reader.execute_batch("ROLLBACK").expect("ends");
    let began = Instant::now();
    wait_for("a short log", Duration::from_secs(120), || (log() < 9_000_000).then_some(()));
    row.recovered(began.elapsed());
    row.n = 1;
    row.note = format!(
        "told at {:.1} MB after {:.0} s; afterwards {:.1} MB",
        longest as f64 / 1e6,
        told_at.as_secs_f64(),
        log() as f64 / 1e6
    );
    running.gateway.stop();
    row
}

/// Fills a disk to its last byte.
pub(crate) fn fill(disk: &Path) -> PathBuf {
    let path = disk.join("hog");
    let mut file = fs::File::create(&path).expect("created");
    while file.write_all(&[1; 4096]).is_ok() {}
    path
}

/// The disk fills up, stays full, and is free again.
pub(crate) fn full(scale: &Scale) -> Row {
    let mut row =
        Row::new("a tmpfs of 24 MB filled for 15 s and freed, again and again; rows the status had acknowledged");
    let Some((_directory, mut gateway, disk)) = start_on_tmpfs(24, &["--speed", "10"]) else {
        return Row::skipped(row.how);
    };
    let address = gateway.address();
    let history = || status(&address).map(|status| status["history"].clone()).unwrap_or_default();
    let rows = || history()["rows"].as_u64().unwrap_or(0);
    let mut told = 0;
    for _ in 0..scale.of(10, 1) {
        wait_for("rows", Duration::from_secs(120), || (rows() > 300).then_some(()));
        let hog = fill(&disk);
        let ticks = || status(&address).and_then(|status| status["tick"]["count"].as_u64()).unwrap_or(0);
        let (began, before) = (Instant::now(), ticks());
        while began.elapsed() < Duration::from_secs(15) {
            told += usize::from(history()["error"].is_string());
            std::thread::sleep(Duration::from_millis(250));
        }
        row.must(ticks() > before + 100, "polling stood still");
        let acknowledged = rows();
        fs::remove_file(hog).expect("removed");
        let began = Instant::now();
        wait_for("new rows", Duration::from_secs(60), || {
            (rows() > acknowledged && history()["error"].is_null()).then_some(())
        });
        row.recovered(began.elapsed());
        row.n += 1;
    }
    row.must(told > 0, "nothing was told of a full disk");
    let (acknowledged, refused) = (rows(), history()["lost"].as_u64().unwrap_or(0));
    // The disk ends with the process: what a SIGKILL leaves is copied while it stands still.
    gateway.signal("STOP");
    let copy = tempfile::tempdir().expect("a directory");
    fs::copy(disk.join("history.db"), copy.path().join("history.db")).expect("copied");
    let _no_log = fs::copy(disk.join("history.db-wal"), copy.path().join("history.db-wal"));
    gateway.signal("KILL");
    gateway.wait();
    let reader = Reader::open(&copy.path().join("history.db")).expect("a history");
    let findings = reader.check_integrity().unwrap_or_else(|error| vec![error.to_string()]);
    row.must(findings.is_empty(), format!("{findings:?}"));
    let removed = queried(
        &copy.path().join("history.db"),
        "SELECT coalesce(sum(rows), 0) AS n FROM dropped WHERE kind = 'raw samples'",
    );
    let removed = removed[0]["n"].as_u64().unwrap_or(0);
    let there = reader.read_info().map_or(0, |info| info.samples.unsigned_abs());
    let lost = acknowledged.saturating_sub(there + removed);
    row.must(lost == 0, format!("{lost} acknowledged rows are gone and not accounted for"));
    row.lost = Some(lost);
    row.note = format!(
        "{acknowledged} rows, of which {removed} of the oldest made room, which is told; {refused} were not taken, which is told"
    );
    row
}

/// Every fsync fails for a while: nothing is acknowledged, and afterwards all that was acknowledged is there.
pub(crate) fn fsync_fails(scale: &Scale) -> Row {
    let mut row =
        Row::new("strace answers fdatasync with EIO from the 2nd, 4th... call on; acknowledged rows after SIGKILL");
    if !strace() {
        return Row::skipped(row.how);
    }
    let mut lost = 0;
    for step in 1..=scale.of(10, 1) {
        let directory = tempfile::tempdir().expect("a directory");
        let data = directory.path().join("data");
        let mut command = Command::new("strace");
        let calls = directory.path().join("calls");
        command.args(["-f", "-q", "-o"]).arg(&calls).args(["-e", "trace=fdatasync,fsync", "-D", "-e"]);
        command.arg(format!("inject=fdatasync,fsync:error=EIO:when={}+", step * 2));
        command
            .arg(env!("CARGO_BIN_EXE_cnc-gateway"))
            .args(["run", "--listen", "127.0.0.1:0", "--speed", "60", "--data-dir"])
            .arg(&data);
        let mut gateway = Gateway::spawn(command);
        let address = gateway.address();
        let history = || status(&address).map(|status| status["history"].clone()).unwrap_or_default();
        let mut acknowledged = 0;
        // A thread that writes every two seconds comes to its twentieth call after 40 s.
        let until = Instant::now() + Duration::from_secs(80);
        while Instant::now() < until && !history()["error"].is_string() {
            acknowledged = history()["rows"].as_u64().unwrap_or(0).max(acknowledged);
            std::thread::sleep(Duration::from_millis(20));
        }
        let failed = std::fs::read_to_string(&calls).is_ok_and(|calls| calls.contains("INJECTED"));
        row.must(failed, "no call failed");
        row.must(history()["error"].is_string(), "nothing was told of a disk that fails");
        row.must(!gateway.has_ended(), "the box ended");
        gateway.kill();
        let there = Reader::open(&data.join("history.db"))
            .and_then(|reader| reader.read_info())
            .map_or(0, |info| info.samples.unsigned_abs());
        lost += acknowledged.saturating_sub(there);
        row.n += 1;
    }
    row.lost = Some(lost);
    row.must(lost == 0, format!("{lost} acknowledged rows are gone"));
    row
}
