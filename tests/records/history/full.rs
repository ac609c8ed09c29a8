//! A full disk, a read-only one, and the limits of age and size.
//!
//! Full and read-only disks are real: a small file system in a mount namespace of its own, entered with `unshare`.

use crate::history::machine::Machine;
use crate::history::round_trip::{options, write};
use adapters::clock::SECOND_NS;
use gateway::history::{
    Alarm, DAY_NS, Event, HistoryFigures, Options, Query, Reader, RecordSpan, Retention, WhenFull, Writer,
};
use std::io::Write;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// Tells the process inside the namespace where the small disk is.
const DISK: &str = "HISTORY_TEST_DISK";

/// Runs `test` of this program on a file system of `size`; `remount` is run between mounting and testing. False, with a
/// word about it, where the system does not let users make mount namespaces.
fn on_a_disk_of(size: &str, test: &str, remount: &str) -> bool {
    let dir = tempfile::tempdir().expect("a directory");
    let script = format!(
        "mount -t tmpfs -o size={size} tmpfs \"$0\" && {remount} exec \"$1\" --exact \"$2\" --ignored --nocapture"
    );
    let allowed = Command::new("unshare").args(["-r", "-m", "true"]).status().is_ok_and(|status| status.success());
    if !allowed {
        println!("SKIPPED {test}: `unshare -r -m` is not permitted here, so there is no small disk to fill");
        return false;
    }
    let program = std::env::current_exe().expect("this test");
    let output = Command::new("unshare")
        .args(["-r", "-m", "sh", "-c", &script])
        .args([dir.path(), &program, Path::new(test)])
        .env(DISK, dir.path())
        .output()
        .expect("starts");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}\n{}", String::from_utf8_lossy(&output.stderr));
    assert!(text.contains("1 passed"), "{text}");
    true
}

fn disk() -> Option<PathBuf> {
    std::env::var_os(DISK).map(PathBuf::from)
}

/// Writes zeros to `path` until the disk takes no more.
fn fill_up(path: &Path) {
    let mut file = std::fs::File::create(path).expect("creates");
    while file.write_all(&[0; 4096]).is_ok() {}
}

fn alarm(number: i64) -> Alarm {
    let at_ns = Machine::at_ns(number * 600);
    Alarm { at_ns, code: format!("a{number}"), source: "test".into(), ..Alarm::default() }
}

/// The status once nothing retires any more: what is written about the retired rows may itself retire some.
fn at_rest(writer: &Writer) -> HistoryFigures {
    let began = Instant::now();
    let mut before = writer.status();
    loop {
        std::thread::sleep(Duration::from_millis(300));
        let now = writer.status();
        let rests = (now.retired_samples, now.queued_records) == (before.retired_samples, before.queued_records);
        if rests || began.elapsed() > Duration::from_secs(5) {
            return now;
        }
        before = now;
    }
}

#[test]
fn a_full_disk_stops_nothing() {
    on_a_disk_of("4m", "history::full::full_disk", "");
}

#[test]
#[ignore = "part of a_full_disk_stops_nothing: runs on a small disk of its own"]
fn full_disk() {
    let Some(disk) = disk() else { return };
    let (path, machine) = (disk.join("h.db"), Machine::new());
    let group_commit = Duration::from_millis(50);
    let writer = Writer::open(&path, Options { group_commit, when_full: WhenFull::Drop, ..options() }).expect("opens");
    for minute in 0..50 {
        write(&writer, &machine, minute * 600..(minute + 1) * 600);
        writer.flush().expect("durable");
    }
    let others = disk.join("somebody else's");
    fill_up(&others);
    let mut slowest = Duration::ZERO;
    for minute in 50..250 {
        let began = Instant::now();
        write(&writer, &machine, minute * 600..(minute + 1) * 600);
        writer.queue_record(alarm(minute)).expect("room");
        slowest = slowest.max(began.elapsed());
        std::thread::sleep(Duration::from_millis(10));
    }
    writer.flush().expect("durable although the disk is full");
    let status = at_rest(&writer);
    println!("while full: slowest minute handed in within {slowest:?}, {status:?}");
    assert!(status.retired_samples > 0, "the oldest raw samples went");
    assert_eq!((status.dropped_samples, status.lost_samples, status.dropped_records), (0, 0, 0));
    assert!(slowest < Duration::from_millis(500), "{slowest:?} for 600 samples");
    check_full_disk(&path, 150_000);

    std::fs::remove_file(&others).expect("removes");
    let began = Instant::now();
    let reserve = disk.join("h.db.reserve");
    let mut minute = 250;
    while !reserve.exists() && began.elapsed() < Duration::from_secs(10) {
        write(&writer, &machine, minute * 600..(minute + 1) * 600);
        std::thread::sleep(Duration::from_millis(100));
        minute += 1;
    }
    println!("recovered within {:?}", began.elapsed());
    assert!(reserve.exists(), "room is reserved again within ten seconds");
    let status = writer.close();
    assert_eq!(status.degraded, None);
    check_full_disk(&path, minute * 600);
}

/// All alarms are there, and the newest rows without a hole up to `end`.
fn check_full_disk(path: &Path, end: i64) {
    let reader = Reader::open(path).expect("opens");
    assert_eq!(reader.read_alarms(RecordSpan::newest(1_000)).expect("reads").len(), 200);
    let mut rows = Vec::new();
    reader
        .for_each_chunk(&Query::default().with_series(["total_power_w"]), |chunk| {
            rows.extend_from_slice(&chunk.at_ns);
            ControlFlow::Continue(())
        })
        .expect("reads");
    assert_eq!(rows.last(), Some(&Machine::at_ns(end - 1)));
    assert!(rows.windows(2).all(|pair| pair[1] - pair[0] == SECOND_NS / 10), "only the oldest went");
    let info = reader.read_info().expect("reads");
    let raw = info.dropped.iter().find(|dropped| dropped.kind == "raw samples").expect("counted");
    assert_eq!((raw.rows + rows.len() as i64, raw.because.as_str()), (end, "the disk is full"));
    assert_eq!(reader.check_integrity().expect("checks"), Vec::<String>::new());
}

#[test]
fn a_read_only_disk_is_said_and_readable() {
    on_a_disk_of(
        "4m",
        "history::full::read_only_disk",
        "\"$1\" --exact history::full::fill_a_little --ignored && mount -o remount,ro \"$0\" &&",
    );
}

#[test]
#[ignore = "part of the tests on a small disk: runs on a small disk of its own"]
fn fill_a_little() {
    let Some(disk) = disk() else { return };
    let writer = Writer::open(&disk.join("h.db"), options()).expect("opens");
    write(&writer, &Machine::new(), 0..1_000);
    writer.flush().expect("durable");
    // As after a crash: the database and its log, copied while it is open.
    let copied = disk.join("copied");
    std::fs::create_dir(&copied).expect("creates");
    for name in ["h.db", "h.db-wal"] {
        std::fs::copy(disk.join(name), copied.join(name)).expect("copies");
    }
}

#[test]
#[ignore = "part of the tests on a small disk: runs on a disk of its own that is read-only"]
fn read_only_disk() {
    let Some(disk) = disk() else { return };
    let path = disk.join("h.db");
    for path in [path.clone(), disk.join("new.db")] {
        let error = Writer::open(&path, options()).expect_err("refused").to_string();
        assert!(error.contains("cannot be written") && error.contains("write permission"), "{error}");
    }
    let info = Reader::open(&path).and_then(|reader| reader.read_info()).expect("readable");
    assert_eq!(info.samples, 1_000);
    let error = Reader::open(&disk.join("copied/h.db")).expect_err("refused").to_string();
    assert!(error.contains("-wal to a writable directory"), "{error}");
}

#[test]
fn the_size_limit_takes_the_oldest_raw_first() {
    let dir = tempfile::tempdir().expect("a directory");
    let (path, machine) = (dir.path().join("h.db"), Machine::new());
    let retention = Retention { max_bytes: 1_500_000, ..Retention::default() };
    let writer = Writer::open(&path, Options { retention, ..options() }).expect("opens");
    for hour in 0..6 {
        write(&writer, &machine, hour * 36_000..(hour + 1) * 36_000);
        writer.queue_record(alarm(hour));
        writer.flush().expect("durable");
    }
    let status = writer.close();
    assert!(status.bytes <= 1_500_000 && status.retired_samples > 0, "{status:?}");
    let reader = Reader::open(&path).expect("opens");
    let (first_ns, last_ns) = reader.read_span().expect("reads").expect("rows");
    assert!(first_ns > Machine::at_ns(0) && last_ns == Machine::at_ns(6 * 36_000 - 1));
    assert_eq!(reader.read_alarms(RecordSpan::newest(100)).expect("reads").len(), 6);
    let overview =
        reader.read_overview(&Query::default().with_series(["total_power_w"]), 60 * SECOND_NS).expect("answers");
    assert_eq!(overview.start_ns.len(), 360, "every minute is still in the overview");
}

#[test]
fn ages_take_each_kind_at_its_time() {
    let dir = tempfile::tempdir().expect("a directory");
    let (path, machine) = (dir.path().join("h.db"), Machine::new());
    let day = |days: f64| days / 24.0;
    let retention =
        Retention { raw_days: day(1.0), minutes_days: day(2.0), records_days: day(3.0), ..Retention::default() };
    let writer = Writer::open(&path, Options { retention, ..options() }).expect("opens");
    write(&writer, &machine, 0..4 * 36_000);
    for hour in 0..4 {
        let at_ns = Machine::at_ns(hour * 36_000 + 18_000);
        writer.queue_record(Event { at_ns, kind: "mark".into(), ..Event::default() });
        writer.queue_record(Alarm { at_ns, ..alarm(hour) });
    }
    writer.flush().expect("durable");
    writer.maintain_and_wait(Machine::at_ns(4 * 36_000), Duration::from_secs(30)).expect("done");
    let reader = Reader::open(&path).expect("opens");
    let minutes = |name: &str| -> i64 {
        let db = rusqlite::Connection::open(&path).expect("opens");
        db.query_row(&format!("SELECT count(*) FROM minute_summaries WHERE name = '{name}'"), [], |row| row.get(0))
            .expect("counts")
    };
    let (first_ns, _) = reader.read_span().expect("reads").expect("rows");
    assert!((Machine::at_ns(3 * 36_000 - 6_000)..=Machine::at_ns(3 * 36_000)).contains(&first_ns));
    assert!((119..=121).contains(&minutes("total_power_w")), "{}", minutes("total_power_w"));
    assert_eq!(reader.read_events(RecordSpan::newest(100)).expect("reads").len(), 3);
    assert_eq!(reader.read_alarms(RecordSpan::newest(100)).expect("reads").len(), 4);
    assert!(reader.read_info().expect("reads").dropped.len() >= 3);
    assert_eq!(DAY_NS, 86_400 * SECOND_NS);
}
