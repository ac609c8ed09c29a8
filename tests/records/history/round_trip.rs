//! Exactly what went in comes out: through the running minute, through blocks, after compaction, after opening again.

use crate::history::machine::{Machine, QUANTITIES, extra_values, extras};
use adapters::Sample;
use gateway::history::{Chunk, Fidelity, Options, Query, Reader, WhenFull, Writer, as_stored};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

/// Options of a test: nothing is dropped.
pub(crate) fn options() -> Options {
    Options { extras: extras(), when_full: WhenFull::Wait, ..Options::default() }
}

/// Writes rows `from..to` of `machine`.
pub(crate) fn write(writer: &Writer, machine: &Machine, rows: std::ops::Range<i64>) {
    let mut sample = Sample::new_empty(0);
    for row in rows {
        machine.fill(row, &mut sample);
        writer.queue_sample(&sample, &extra_values(row));
    }
}

/// Every row in the file is one of `machine`, they follow each other without a hole from `first`; how many there are.
pub(crate) fn verify(path: &Path, machine: &Machine, first: i64) -> i64 {
    let reader = Reader::open(path).expect("opens");
    let names: Vec<&str> = QUANTITIES.iter().map(|(name, _)| *name).collect();
    let query =
        Query::default().with_series(names.into_iter().chain(["program", "tool", "machine_state", "cutting_power_w"]));
    let mut next = first;
    reader
        .for_each_chunk(&query, |chunk| {
            for row in 0..chunk.at_ns.len() {
                verify_row(machine, chunk, row, next);
                next += 1;
            }
            ControlFlow::Continue(())
        })
        .expect("reads");
    next - first
}

fn verify_row(machine: &Machine, chunk: &Chunk<'_>, row: usize, expected: i64) {
    assert_eq!(chunk.at_ns[row], Machine::at_ns(expected), "time of row {expected}");
    for (index, (name, _)) in QUANTITIES.iter().enumerate() {
        let missing = machine.missing(expected, index);
        assert_eq!(
            chunk.missing_reason(index, row),
            missing.map(|absence| absence.as_word()),
            "{name} in row {expected}"
        );
        let number = missing.is_none().then(|| machine.quantity(expected, index));
        assert_eq!(chunk.columns[index].number_at(row), number, "{name} in row {expected}");
    }
    for index in 0..2 {
        let word = machine.word(expected, index).map(|word| &**word);
        assert_eq!(chunk.columns[20 + index].word_at(row), word, "row {expected}");
    }
    let expect_state = if expected.rem_euclid(600) < 420 { "cutting" } else { "idle" };
    assert_eq!(chunk.columns[22].word_at(row), Some(expect_state));
    let learned = expected.rem_euclid(3000) >= 100;
    assert_eq!(chunk.missing_reason(23, row), if learned { None } else { Some("not_learned") });
}

#[test]
fn what_goes_in_comes_out() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("deep/er/h.db");
    let machine = Machine::new().with_gaps();
    let writer = Writer::open(&path, options()).expect("opens");
    write(&writer, &machine, 0..250);
    writer.flush().expect("durable");
    assert_eq!(verify(&path, &machine, 0), 250, "all in the crash tail");
    write(&writer, &machine, 250..12_345);
    writer.flush().expect("durable");
    assert_eq!(writer.acknowledged_through_ns(), Some(Machine::at_ns(12_344)));
    assert_eq!(verify(&path, &machine, 0), 12_345, "blocks and tail");
    let status = writer.close();
    assert_eq!((status.rows, status.dropped_samples, status.degraded), (12_345, 0, None));

    let writer = Writer::open(&path, options()).expect("opens again");
    assert_eq!(verify(&path, &machine, 0), 12_345, "after opening again");
    write(&writer, &machine, 12_345..20_000);
    writer.flush().expect("durable");
    writer.maintain_and_wait(Machine::at_ns(20_000), Duration::from_secs(20)).expect("compacts");
    drop(writer);
    assert_eq!(verify(&path, &machine, 0), 20_000, "compacted");
    let blocks: i64 = rusqlite::Connection::open(&path)
        .and_then(|db| db.query_row("SELECT count(*) FROM blocks", [], |row| row.get(0)))
        .expect("counts");
    assert!(blocks < 12, "{blocks} blocks instead of 36");
    assert_eq!(Reader::open(&path).and_then(|reader| reader.check_integrity()).expect("checks"), Vec::<String>::new());
}

/// Every number of `series` in the file.
fn numbers(path: &Path, series: &str) -> Vec<f64> {
    let reader = Reader::open(path).expect("opens");
    let recording = reader.read_recording(&Query::default().with_series([series])).expect("reads");
    recording.find_numbers(series).expect("a quantity").present_values().collect()
}

#[test]
fn long_fractions_are_rounded_once_or_kept_to_the_bit() {
    let dir = tempfile::tempdir().expect("a directory");
    let machine = Machine::new().interpolated();
    let channel = adapters::ChannelId::from_name("spindle_power_w").expect("in the table");
    for (fidelity, name) in [(Fidelity::Resolution, "r.db"), (Fidelity::Exact, "e.db")] {
        let path = dir.path().join(name);
        let writer = Writer::open(&path, Options { fidelity, ..options() }).expect("opens");
        write(&writer, &machine, 0..1_000);
        writer.flush().expect("durable");
        let expected: Vec<f64> = (0..1_000)
            .map(|row| machine.quantity(row, 10))
            .map(|watts| if fidelity == Fidelity::Exact { watts } else { as_stored(channel, watts) })
            .collect();
        assert!(numbers(&path, "spindle_power_w") == expected, "{fidelity:?}, one block and the tail");
        write(&writer, &machine, 1_000..1_200);
        writer.flush().expect("durable");
        assert!(numbers(&path, "spindle_power_w")[..1_000] == expected, "{fidelity:?}, sealed");
    }
}

#[test]
fn a_program_that_holds_the_file_costs_nothing() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    let machine = Machine::new();
    let writer = Writer::open(&path, options()).expect("opens");
    write(&writer, &machine, 0..500);
    writer.flush().expect("durable");
    let other = rusqlite::Connection::open(&path).expect("opens");
    other.execute_batch("BEGIN IMMEDIATE").expect("holds the file");
    write(&writer, &machine, 500..3_000);
    while writer.status().degraded.is_none() {
        std::thread::sleep(Duration::from_millis(20));
    }
    let status = writer.status();
    assert!(status.degraded.is_some_and(|text| text.contains("Another program")));
    assert_eq!(status.acknowledged_through_ns, Some(Machine::at_ns(499)), "nothing is promised meanwhile");
    other.execute_batch("ROLLBACK").expect("lets go");
    writer.flush().expect("durable");
    assert_eq!(writer.status().degraded, None);
    assert_eq!(verify(&path, &machine, 0), 3_000);
}
