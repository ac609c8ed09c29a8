//! Measurements, printed. Run with
//! `cargo test --release --test records history::figures -- --ignored --nocapture --test-threads 1`.

use crate::history::machine::{Machine, QUANTITIES, START_NS, extra_values};
use crate::history::round_trip::options;
use adapters::Sample;
use adapters::clock::SECOND_NS;
use gateway::history::{DAY_NS, Options, Query, Reader, SqlValue, Writer};
use std::hint::black_box;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

/// Ticks of a day at 10 Hz.
const DAY: i64 = 864_000;
const YEAR_DAYS: f64 = 365.25;

fn gigabytes(bytes: f64) -> f64 {
    bytes / 1e9
}

/// Bytes this process has handed to write calls so far.
fn written() -> Option<f64> {
    let io = std::fs::read_to_string("/proc/self/io").ok()?;
    io.lines().find_map(|line| line.strip_prefix("wchar: ")?.trim().parse().ok())
}

fn file_bytes(path: &Path) -> f64 {
    std::fs::metadata(path).map_or(0.0, |file| file.len() as f64)
}

fn used_bytes(path: &Path) -> f64 {
    let db = rusqlite::Connection::open(path).expect("opens");
    let pragma = |name: &str| db.query_row(&format!("PRAGMA {name}"), [], |row| row.get::<_, f64>(0)).expect("reads");
    (pragma("page_count") - pragma("freelist_count")) * pragma("page_size")
}

/// A row per sample, as one would write it first: 20 REAL columns, WAL, one transaction per `batch` ticks.
fn row_per_sample(path: &Path, machine: &Machine, ticks: i64, batch: i64) {
    let mut db = rusqlite::Connection::open(path).expect("opens");
    db.pragma_update(None, "journal_mode", "WAL").expect("sets");
    db.pragma_update(None, "synchronous", "FULL").expect("sets");
    let columns: Vec<&str> = QUANTITIES.iter().map(|(name, _)| *name).collect();
    db.execute_batch(&format!("CREATE TABLE samples (at_ns INTEGER PRIMARY KEY, {} REAL)", columns.join(" REAL, ")))
        .expect("creates");
    let marks = vec!["?"; columns.len() + 1].join(",");
    for first in (0..ticks).step_by(usize::try_from(batch).expect("positive")) {
        let writing = db.transaction().expect("begins");
        let mut insert = writing.prepare_cached(&format!("INSERT INTO samples VALUES ({marks})")).expect("prepares");
        for row in first..(first + batch).min(ticks) {
            insert.raw_bind_parameter(1, Machine::at_ns(row)).expect("binds");
            for index in 0..QUANTITIES.len() {
                insert.raw_bind_parameter(index + 2, machine.quantity(row, index)).expect("binds");
            }
            insert.raw_execute().expect("inserts");
        }
        drop(insert);
        writing.commit().expect("commits");
    }
}

/// The twenty quantities alone, in blocks, one commit per second of ticks when `live`.
fn blocks(path: &Path, machine: &Machine, ticks: std::ops::Range<i64>, live_ticks: Option<i64>) {
    let options = Options { extras: Vec::new(), ..options() };
    let writer = Writer::open(path, options).expect("opens");
    let mut sample = Sample::new_empty(0);
    for row in ticks {
        machine.fill_quantities(row, &mut sample);
        writer.queue_sample(&sample, &[]);
        if live_ticks.is_some_and(|ticks| row % ticks == ticks - 1) {
            writer.flush().expect("durable");
        }
    }
    drop(writer);
}

#[test]
#[ignore = "2 minutes: size of a day in several layouts"]
fn layouts() {
    let dir = tempfile::tempdir().expect("a directory");
    for (what, machine) in [("quantised", Machine::new()), ("interpolated", Machine::new().interpolated())] {
        let (rows, packed) = (dir.path().join(format!("{what}-r.db")), dir.path().join(format!("{what}-b.db")));
        row_per_sample(&rows, &machine, DAY, 1_000);
        blocks(&packed, &machine, 0..DAY, None);
        let fresh = used_bytes(&packed);
        let raw = raw_bytes(&packed);
        compact(&packed);
        let (wide, after) = (file_bytes(&rows), used_bytes(&packed));
        println!("{what}: one day at 10 Hz, 20 quantities");
        let print = |name: &str, bytes: f64| {
            let year = gigabytes(bytes * YEAR_DAYS);
            println!("  {name:<44} {:7.2} MB {:6.1} B/tick {year:6.2} GB/year", bytes / 1e6, bytes / DAY as f64);
        };
        print("row per sample (REAL columns)", wide);
        print("minute blocks with summaries, whole file", fresh);
        print("  of it compressed samples", raw);
        print("ten-minute blocks with summaries, whole file", after);
        print("  of it compressed samples", raw_bytes(&packed));
    }
}

fn raw_bytes(path: &Path) -> f64 {
    Reader::open(path).and_then(|reader| reader.read_info()).expect("reads").sample_bytes as f64
}

fn compact(path: &Path) {
    let writer = Writer::open(path, options()).expect("opens");
    writer.maintain_and_wait(START_NS, Duration::from_secs(300)).expect("compacts");
}

#[test]
#[ignore = "1 minute: bytes handed to the disk per day, by commit interval"]
fn write_amplification() {
    let Some(start) = written() else {
        println!("SKIPPED write_amplification: /proc/self/io is not there");
        return;
    };
    let dir = tempfile::tempdir().expect("a directory");
    let (machine, hour) = (Machine::new(), 36_000);
    let mut mark = start;
    let mut report = |name: &str, days: f64| {
        let now = written().expect("reads");
        println!("{name:<44} {:7.1} MB/day handed to write", (now - mark) / days / 1e6);
        mark = now;
    };
    let hours = 1.0 / 24.0;
    row_per_sample(&dir.path().join("1.db"), &machine, hour / 10, 1);
    report("row per sample, a commit per sample", hours / 10.0);
    row_per_sample(&dir.path().join("2.db"), &machine, hour, 10);
    report("row per sample, a commit per second", hours);
    blocks(&dir.path().join("3.db"), &machine, 0..hour, Some(10));
    report("blocks, a commit per second", hours);
    blocks(&dir.path().join("4.db"), &machine, 0..hour, Some(50));
    report("blocks, a commit per 5 seconds", hours);
}

#[test]
#[ignore = "1 minute: how fast samples are written and read"]
fn speed() {
    let dir = tempfile::tempdir().expect("a directory");
    for (what, machine) in [("quantised", Machine::new()), ("interpolated", Machine::new().interpolated())] {
        let samples: Vec<Sample> = (0..20_000)
            .map(|row| {
                let mut sample = Sample::new_empty(0);
                machine.fill(row, &mut sample);
                sample
            })
            .collect();
        let extras: Vec<_> = (0..20_000).map(extra_values).collect();
        let writer = Writer::open(&dir.path().join(format!("{what}.db")), options()).expect("opens");
        let ticks = 1_000_000usize;
        let mut sample = samples[0].clone();
        let mut pass = |writer: Option<&Writer>| {
            let (began, own, all) = (Instant::now(), cpu_s("thread-self"), cpu_s("self"));
            for tick in 0..ticks {
                let index = tick % samples.len();
                sample.clone_from(&samples[index]);
                sample.at_ns = Machine::at_ns(tick as i64);
                if let Some(writer) = writer {
                    writer.queue_sample(black_box(&sample), &extras[index]);
                }
            }
            if let Some(writer) = writer {
                writer.flush().expect("durable");
            }
            let us = |seconds: f64| seconds * 1e6 / ticks as f64;
            (began.elapsed(), us(cpu_s("thread-self") - own), us(cpu_s("self") - all))
        };
        let (_, empty_us, _) = pass(None);
        let (wall, own_us, all_us) = pass(Some(&writer));
        println!(
            "{what}: {ticks} ticks (24 channels, 4 estimates) durable in {:.2} s = {:.0} ticks/s; processor time per tick: \
             {:.2} us handing in, {:.2} us in the history thread",
            wall.as_secs_f64(),
            ticks as f64 / wall.as_secs_f64(),
            own_us - empty_us,
            all_us - own_us
        );
    }
}

/// Processor seconds used so far by `self`, the process, or `thread-self`.
fn cpu_s(whose: &str) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{whose}/stat")).expect("Linux tells");
    let fields: Vec<f64> =
        stat.rsplit(')').next().unwrap_or("").split_whitespace().map(|word| word.parse().unwrap_or(0.0)).collect();
    (fields[11] + fields[12]) / 100.0
}

fn timed<T>(name: &str, times: u32, mut work: impl FnMut() -> T) -> T {
    let mut best = Duration::MAX;
    let mut last = None;
    for _ in 0..times {
        let began = Instant::now();
        last = Some(work());
        best = best.min(began.elapsed());
    }
    println!("  {name:<64} {:9.2} ms", best.as_secs_f64() * 1e3);
    last.expect("at least once")
}

#[test]
#[ignore = "5 minutes: time of typical questions to 30 days of history"]
fn queries() {
    let dir = tempfile::tempdir().expect("a directory");
    let (path, rows) = (dir.path().join("b.db"), dir.path().join("r.db"));
    let machine = Machine::new();
    blocks(&path, &machine, 0..30 * DAY, None);
    compact(&path);
    row_per_sample(&rows, &machine, DAY, 1_000);
    let reader = Reader::open(&path).expect("opens");
    println!("30 days at 10 Hz, 20 quantities, {:.0} MB:", used_bytes(&path) / 1e6);
    let one = Query::default().with_series(["spindle_power_w"]);
    let hour_ns = 3_600 * SECOND_NS;
    timed("overview, all 20 quantities by day", 5, || {
        reader.read_overview(&Query::default(), DAY_NS).expect("answers")
    });
    timed("overview, all 20 quantities by hour (720 points)", 5, || {
        reader.read_overview(&Query::default(), hour_ns).expect("answers")
    });
    timed("overview, one quantity by hour", 5, || reader.read_overview(&one, hour_ns).expect("answers"));
    timed("overview, one quantity by minute (43 200 points)", 3, || {
        reader.read_overview(&one, 60 * SECOND_NS).expect("answers")
    });
    let day = Query::between(START_NS + 10 * DAY_NS, START_NS + 11 * DAY_NS).with_series(["spindle_power_w"]);
    timed("one quantity of one day, raw (864 000 rows)", 3, || count(&reader, &day));
    timed("the same by 10 s from the samples", 3, || reader.read_overview(&day, 10 * SECOND_NS).expect("answers"));
    timed("one quantity of 30 days, raw (25 920 000 rows)", 1, || count(&reader, &one));
    let hour = Query::between(START_NS + 10 * DAY_NS, START_NS + 10 * DAY_NS + hour_ns);
    timed("all quantities of one hour, raw (36 000 rows)", 3, || count(&reader, &hour));
    let select = format!(
        "SELECT avg(spindle_power_w), count(*) FROM samples WHERE at_ns >= {} AND at_ns < {}",
        START_NS + 10 * DAY_NS,
        START_NS + 11 * DAY_NS
    );
    timed("SQL over samples: mean of one quantity over one day", 1, || first_row(&reader, &select));
    timed("info", 3, || reader.read_info().expect("reads"));
    let db = rusqlite::Connection::open(&rows).expect("opens");
    println!("row per sample, one day:");
    timed("GROUP BY hour, one quantity", 3, || grouped(&db, 3_600_000_000_000));
    timed("GROUP BY minute, one quantity", 3, || grouped(&db, 60_000_000_000));
}

/// A year of summaries, from one tick every ten seconds: as many minutes, hours and days as at 10 Hz.
#[test]
#[ignore = "30 seconds: time to draw a year from summaries"]
fn a_year() {
    let dir = tempfile::tempdir().expect("a directory");
    let (path, machine) = (dir.path().join("y.db"), Machine::new());
    let writer = Writer::open(&path, Options { extras: Vec::new(), ..options() }).expect("opens");
    let mut sample = Sample::new_empty(0);
    for tick in 0..365 * 8_640 {
        machine.fill_quantities(tick, &mut sample);
        sample.at_ns = START_NS + tick * 10 * SECOND_NS;
        writer.queue_sample(&sample, &[]);
    }
    drop(writer);
    let reader = Reader::open(&path).expect("opens");
    println!("365 days of summaries of 20 quantities, {:.0} MB:", used_bytes(&path) / 1e6);
    let one = Query::default().with_series(["spindle_power_w"]);
    let hour_ns = 3_600 * SECOND_NS;
    timed("the year by day, all 20 quantities", 5, || {
        reader.read_overview(&Query::default(), DAY_NS).expect("answers")
    });
    timed("the year by hour, one quantity (8 760 points)", 5, || reader.read_overview(&one, hour_ns).expect("answers"));
    timed("the year by hour, all 20 quantities", 5, || {
        reader.read_overview(&Query::default(), hour_ns).expect("answers")
    });
    timed("the year by minute, one quantity (525 600 points)", 1, || {
        reader.read_overview(&one, 60 * SECOND_NS).expect("answers")
    });
    timed("the year by day in plain SQL (view day_summaries)", 3, || {
        first_row(&reader, "SELECT count(mean) FROM day_summaries WHERE name = 'spindle_power_w'")
    });
}

fn grouped(db: &rusqlite::Connection, width_ns: i64) -> usize {
    let text = format!(
        "SELECT at_ns / {width_ns}, count(*), min(spindle_power_w), max(spindle_power_w), avg(spindle_power_w)
         FROM samples GROUP BY 1"
    );
    let mut statement = db.prepare(&text).expect("prepares");
    statement.query_map([], |row| row.get::<_, f64>(4)).expect("runs").count()
}

fn count(reader: &Reader, query: &Query) -> usize {
    let mut rows = 0;
    reader
        .for_each_chunk(query, |chunk| {
            rows += black_box(chunk).at_ns.len();
            ControlFlow::Continue(())
        })
        .expect("reads");
    rows
}

fn first_row(reader: &Reader, select: &str) -> Vec<SqlValue> {
    let mut found = Vec::new();
    reader
        .run_sql(select, std::time::Duration::from_secs(600), |_, row| {
            found = row.to_vec();
            ControlFlow::Break(())
        })
        .expect("runs");
    found
}
