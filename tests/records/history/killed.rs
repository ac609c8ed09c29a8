//! Killed, cut off, opened twice: what was acknowledged is there, without a hole, and the next start goes on.

use crate::history::machine::{Machine, START_NS, TICK_NS, extra_values, uniform};
use crate::history::round_trip::{options, verify, write};
use adapters::Sample;
use gateway::history::{Event, Options, Query, Reader, RecordSpan, WhenFull, Writer};
use std::io::{BufRead, BufReader};
use std::ops::ControlFlow;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Tells the child process which history to write.
const CHILD_PATH: &str = "HISTORY_TEST_CHILD_PATH";
/// Tells the child process to write as a live machine does, not as fast as possible.
const CHILD_LIVE: &str = "HISTORY_TEST_CHILD_LIVE";
/// An event accompanies every so many rows.
const EVENT_EVERY: i64 = 50;
const KILLS: i64 = 20;

fn rows_in(path: &Path) -> i64 {
    let span = Reader::open(path).and_then(|reader| reader.read_span()).ok().flatten();
    span.map_or(0, |(_, last_ns)| (last_ns - START_NS) / TICK_NS + 1)
}

/// Not a test of its own: the process that is killed. It goes on where the history ends, and says what is acknowledged.
#[test]
#[ignore = "part of the tests beside it: the process that is killed"]
fn child() {
    let Ok(path) = std::env::var(CHILD_PATH) else { return };
    let live = std::env::var(CHILD_LIVE).is_ok();
    let (path, machine) = (Path::new(&path), Machine::new().with_gaps());
    let when_full = if live { WhenFull::Drop } else { WhenFull::Wait };
    let options = Options { group_commit: Duration::from_millis(20), when_full, ..options() };
    let first = rows_in(path);
    let writer = Writer::open(path, options).expect("opens");
    let mut sample = Sample::new_empty(0);
    for row in first.. {
        machine.fill(row, &mut sample);
        writer.queue_sample(&sample, &extra_values(row));
        if row % EVENT_EVERY == 0 {
            let event = Event { at_ns: Machine::at_ns(row), kind: "mark".into(), ..Event::default() };
            writer.queue_record(event).expect("room");
        }
        if live {
            std::thread::sleep(Duration::from_micros(500));
        }
        if row % 20 == 0 {
            let through = writer.acknowledged_through_ns().map_or(-1, |at_ns| (at_ns - START_NS) / TICK_NS);
            println!("acknowledged {through} {} {first} .", writer.acknowledged_record());
        }
    }
}

/// Starts the child, kills it after `after`, returns the last acknowledged row, events of this run, and its first row.
fn run_and_kill(path: &Path, live: bool, after: Duration) -> Option<(i64, i64, i64)> {
    let mut command = Command::new(std::env::current_exe().expect("this test"));
    command.args(["--exact", "history::killed::child", "--ignored", "--nocapture"]).env(CHILD_PATH, path);
    if live {
        command.env(CHILD_LIVE, "1");
    }
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("starts");
    let lines = BufReader::new(child.stdout.take().expect("piped"));
    let reading = std::thread::spawn(move || {
        let mut last = None;
        for line in lines.lines().map_while(Result::ok) {
            let words: Vec<&str> = line.split(' ').collect();
            // A line cut off by the kill lacks its last word and is not counted.
            if let ["acknowledged", row, events, first, "."] = words[..] {
                let number = |word: &str| word.parse().expect("a number");
                last = Some((number(row), number(events), number(first)));
            }
        }
        last
    });
    std::thread::sleep(after);
    child.kill().expect("SIGKILL");
    child.wait().expect("ends");
    reading.join().expect("read")
}

#[test]
fn twenty_kills_lose_nothing_acknowledged() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    let machine = Machine::new().with_gaps();
    let (mut acknowledged, mut rows, mut killed_running) = (0, 0, 0);
    for round in 0..KILLS {
        let after = Duration::from_millis(60 + (uniform(round, 77) * 500.0) as u64);
        let reported = run_and_kill(&path, round % 2 == 1, after);
        let before = std::mem::replace(&mut rows, verify(&path, &machine, 0));
        // Killed before it said anything: it may have written, but promised nothing.
        let Some((row, events, first)) = reported else { continue };
        killed_running += 1;
        assert_eq!(first, before, "round {round}: it went on where the file ended");
        acknowledged = acknowledged.max(row);
        assert!(rows > acknowledged, "round {round}: {rows} rows, row {acknowledged} was acknowledged");
        let reader = Reader::open(&path).expect("opens");
        assert_eq!(reader.check_integrity().expect("checks"), Vec::<String>::new(), "round {round}");
        let marks = reader.read_events(RecordSpan::between(Machine::at_ns(first), i64::MAX, u32::MAX)).expect("reads");
        let marks = marks.iter().filter(|event| event.kind == "mark").count() as i64;
        assert!(marks >= events, "round {round}: {marks} events, {events} were acknowledged");
    }
    println!("{killed_running} kills, {rows} rows, row {acknowledged} was the last acknowledged");
    assert!(killed_running >= KILLS / 2 && rows > 1_000, "{killed_running} kills hit a writing process, {rows} rows");
}

/// A power cut leaves the log as far as it had reached the disk: every prefix of it must open, with the first rows of
/// what was written and nothing else.
#[test]
fn every_prefix_of_the_log_opens_without_a_hole() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    let machine = Machine::new().with_gaps();
    let writer = Writer::open(&path, options()).expect("opens");
    for part in 0..25 {
        write(&writer, &machine, part * 70..(part + 1) * 70);
        writer.flush().expect("durable");
    }
    let database = std::fs::read(&path).expect("reads");
    let log = std::fs::read(dir.path().join("h.db-wal")).expect("reads");
    let all = writer.status().rows as i64;
    let cut = dir.path().join("cut");
    let mut counts = Vec::new();
    for step in 0..=120 {
        std::fs::create_dir_all(&cut).expect("a directory");
        let path = cut.join("h.db");
        std::fs::write(&path, &database).expect("writes");
        std::fs::write(cut.join("h.db-wal"), &log[..log.len() * step / 120]).expect("writes");
        counts.push(reopened(&path, &machine));
        std::fs::remove_dir_all(&cut).expect("removes");
    }
    assert!(counts.is_sorted(), "a longer log never holds less: {counts:?}");
    assert_eq!(counts.last(), Some(&all));
    assert!(counts.iter().filter(|rows| **rows > 0 && **rows < all).count() > 10, "{counts:?}");
}

/// Opens a history as the next start would; how many rows it has, all of them the first ones.
fn reopened(path: &Path, machine: &Machine) -> i64 {
    drop(Writer::open(path, options()).expect("opens"));
    assert_eq!(Reader::open(path).and_then(|reader| reader.check_integrity()).expect("checks"), Vec::<String>::new());
    verify(path, machine, 0)
}

#[test]
fn the_second_gateway_is_refused() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    let first = Writer::open(&path, options()).expect("opens");
    let error = Writer::open(&path, options()).expect_err("refused").to_string();
    let process = format!("process {}", std::process::id());
    assert!(error.contains("another cnc-gateway") && error.contains(&process), "{error}");
    drop(first);
    drop(Writer::open(&path, options()).expect("free again"));
}

#[test]
fn a_newer_or_foreign_file_is_left_alone() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    drop(Writer::open(&path, options()).expect("opens"));
    crate::sealed::connect(&path).pragma_update(None, "user_version", 99).expect("changes");
    let before = std::fs::read(&path).expect("reads");
    for error in [
        Writer::open(&path, options()).expect_err("refused").to_string(),
        Reader::open(&path).expect_err("refused").to_string(),
    ] {
        assert!(error.contains("schema 99") && error.contains("Update the gateway"), "{error}");
    }
    assert_eq!(std::fs::read(&path).expect("reads"), before, "nothing was changed");

    let foreign = dir.path().join("other.db");
    rusqlite::Connection::open(&foreign).and_then(|db| db.execute_batch("CREATE TABLE t (a)")).expect("creates");
    let text = dir.path().join("text.db");
    std::fs::write(&text, "time_s,spindle_power_w\n".repeat(100)).expect("writes");
    for (path, what) in [(&foreign, "another SQLite database"), (&text, "not a SQLite database")] {
        let error = Writer::open(path, options()).expect_err("refused").to_string();
        assert!(error.contains(what), "{error}");
        assert!(Reader::open(path).expect_err("refused").to_string().contains(what));
    }
    let missing = Reader::open(&dir.path().join("none.db")).expect_err("refused").to_string();
    assert!(missing.contains("no history there"), "{missing}");
}

#[test]
fn a_clock_that_goes_back_begins_a_segment() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    let machine = Machine::new();
    let writer = Writer::open(&path, options()).expect("opens");
    write(&writer, &machine, 5_000..5_700);
    write(&writer, &machine, 4_000..6_000);
    writer.flush().expect("durable");
    let reader = Reader::open(&path).expect("opens");
    let mut order = Vec::new();
    reader
        .for_each_chunk(&Query::default().with_series(["total_power_w"]), |chunk| {
            assert!(chunk.at_ns.is_sorted());
            order.extend(chunk.at_ns.iter().map(|at_ns| (chunk.segment, (at_ns - START_NS) / TICK_NS)));
            ControlFlow::Continue(())
        })
        .expect("reads");
    let expected: Vec<(i64, i64)> =
        (5_000..5_700).map(|row| (1, row)).chain((4_000..6_000).map(|row| (2, row))).collect();
    assert!(order == expected);
    let events = reader.read_events(RecordSpan::newest(10)).expect("reads");
    assert_eq!(events.len(), 1);
    assert!(events[0].kind == "clock_went_back" && events[0].text.contains("169.9"), "{events:?}");

    let recording = reader.read_recording(&Query::default()).expect("reads");
    let runs: Vec<String> = recording.list_runs().into_iter().map(|run| run.name).collect();
    assert_eq!((runs, recording.start_ns), (vec!["1".to_owned(), "2".to_owned()], None));
    let file = dir.path().join("r.csv");
    reader.export_to_file(&Query::default(), &file).expect("writes");
    let back = adapters::recording::read_path(&file).expect("reads");
    assert_eq!((back.refused, back.recording.count_rows()), (0, 2_700));
    assert_eq!(reader.export_to_file(&Query::default(), &dir.path().join("r.parquet")).expect("writes"), 2_700);
}
