//! Power cuts, as what they leave on the disk: the log up to where it had been written, pages of it that had not been, and pages of
//! the file that were copied in any order.

use crate::kills::random;
use crate::table::{Row, Scale};
use adapters::{ChannelId, Sample, Slot, Value};
use gateway::history::{Event, Options, Query, Reader, RecordSpan, WhenFull, Writer};
use rand::Rng;
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

const TICK_NS: i64 = 100_000_000;
const START_NS: i64 = 1_767_571_200_000_000_000;
const PAGE: usize = 4_096;
/// A frame of the log: its head and a page.
const FRAME: usize = 24 + PAGE;

fn value(row: i64) -> f64 {
    (row * 7 % 10_007) as f64 / 10.0
}

fn options() -> Options {
    // A short log, so that it is copied into the file often.
    let reserve_bytes = 400_000;
    Options { group_commit: Duration::from_secs(3600), when_full: WhenFull::Wait, reserve_bytes, ..Options::default() }
}

/// A state of the disk: file and log, after so many durable rows.
struct DiskState {
    rows: i64,
    file: Vec<u8>,
    log: Vec<u8>,
}

/// Writes `parts` parts of a few rows, each made durable, and keeps what lies on the disk after each.
fn written(directory: &Path, parts: i64, rows_per_part: i64) -> Vec<DiskState> {
    let path = directory.join("h.db");
    let writer = Writer::open(&path, options()).expect("opens");
    let power = ChannelId::from_name("spindle_power_w").expect("in the table");
    let read = |end: &str| fs::read(format!("{}{end}", path.display())).unwrap_or_default();
    let mut states = Vec::new();
    for part in 0..parts {
        for row in part * rows_per_part..(part + 1) * rows_per_part {
            let mut sample = Sample::new_empty(START_NS + row * TICK_NS);
            sample.set_slot(power, Slot { value: Ok(Value::Number(value(row))), age_ns: 0 });
            writer.queue_sample(&sample, &[]);
        }
        let at_ns = START_NS + ((part + 1) * rows_per_part - 1) * TICK_NS;
        writer.queue_record(Event { at_ns, kind: "mark".into(), text: format!("{part}"), ..Event::default() });
        writer.flush().expect("durable");
        states.push(DiskState { rows: (part + 1) * rows_per_part, file: read(""), log: read("-wal") });
    }
    states
}

/// Opens what a power cut left as the next start does. Gives how many rows there are, how many are wrong or out of their place, and
/// how many events have no row or rows no event.
fn opened(directory: &Path, file: &[u8], log: &[u8], rows_per_part: i64) -> Result<(i64, u64), String> {
    let cut = directory.join("cut");
    fs::create_dir_all(&cut).expect("a directory");
    let path = cut.join("h.db");
    fs::write(&path, file).expect("writes");
    fs::write(cut.join("h.db-wal"), log).expect("writes");
    let found = (|| {
        drop(Writer::open(&path, options()).map_err(|error| error.to_string())?);
        let reader = Reader::open(&path).map_err(|error| error.to_string())?;
        let findings = reader.check_integrity().map_err(|error| error.to_string())?;
        if !findings.is_empty() {
            return Err(format!("{findings:?}"));
        }
        let (mut rows, mut wrong) = (0, 0);
        let walked = reader.for_each_chunk(&Query::default().with_series(["spindle_power_w"]), |chunk| {
            for row in 0..chunk.at_ns.len() {
                let right = chunk.at_ns[row] == START_NS + rows * TICK_NS
                    && chunk.columns[0].number_at(row) == Some(value(rows));
                wrong += u64::from(!right);
                rows += 1;
            }
            ControlFlow::Continue(())
        });
        walked.map_err(|error| error.to_string())?;
        let events = reader.read_events(RecordSpan::newest(100_000)).map_err(|error| error.to_string())?;
        let marks = events.iter().filter(|event| event.kind == "mark").count() as i64;
        wrong += marks.abs_diff(rows / rows_per_part);
        Ok((rows, wrong))
    })();
    fs::remove_dir_all(&cut).expect("removes");
    found
}

/// The power goes while a commit is written: the log ends anywhere behind what had been synced, and what follows its end is
/// nothing, zeros, noise, or what lay there before. (What has been synced stays: no page is copied into the file before that.)
pub(crate) fn cuts(scale: &Scale) -> Row {
    let mut row = Row::new(
        "the log of a commit cut at sectors, frames and random bytes, with nothing, zeros, noise or old frames behind; rows made durable before",
    );
    let directory = tempfile::tempdir().expect("a directory");
    let states = written(directory.path(), 60, 50);
    let pairs: Vec<(&DiskState, &DiskState)> =
        states.windows(2).filter(|pair| pair[0].file == pair[1].file).map(|pair| (&pair[0], &pair[1])).collect();
    row.must(pairs.len() > 20, format!("{} commits that only wrote the log", pairs.len()));
    let (mut random, mut lost, mut wrong, count) = (random(), 0, 0, scale.of(200, 12));
    for step in 0..count {
        let Some((before, after)) = pairs.get(random.random_range(0..pairs.len().max(1))) else { break };
        // Frames of before that are there after it have been synced. A log that was begun anew has none: what it held is in the file.
        // Behind its end lie frames of an earlier round, which a commit writes over.
        let synced = before.log.iter().zip(&after.log).take_while(|(before, after)| before == after).count();
        let unit = [512, 1, FRAME][step % 3];
        let cut = (synced + unit * random.random_range(0..=(after.log.len() - synced) / unit)).min(after.log.len());
        let mut log = after.log[..cut].to_vec();
        match step % 4 {
            0 => {}
            1 => log.resize(after.log.len(), 0),
            2 => log.resize(after.log.len(), 0xa5),
            _ => log.extend_from_slice(before.log.get(cut..).unwrap_or_default()),
        }
        match opened(directory.path(), &before.file, &log, 50) {
            Ok((rows, bad)) => {
                lost += u64::try_from(before.rows - rows).unwrap_or(0);
                wrong += bad;
                row.must(rows <= after.rows, format!("{rows} rows of {} written", after.rows));
            }
            Err(error) => row.must(false, error),
        }
    }
    finish(row, count, lost, wrong)
}

/// The power goes while pages are copied from the log into the file: any of them may be there, or half of one.
pub(crate) fn reordered(scale: &Scale) -> Row {
    let mut row = Row::new(
        "some pages of the file as after, others as before their copying, one half written; the log whole; all rows",
    );
    let directory = tempfile::tempdir().expect("a directory");
    let states = written(directory.path(), 60, 50);
    // Before and after a copying of the log, which changes the file.
    let pairs: Vec<(&DiskState, &DiskState)> =
        states.windows(2).filter(|pair| pair[0].file != pair[1].file).map(|pair| (&pair[0], &pair[1])).collect();
    row.must(!pairs.is_empty(), "the log was never copied: more rows are needed");
    let (mut random, mut lost, mut wrong, count) = (random(), 0, 0, scale.of(200, 12));
    for _ in 0..count {
        let Some((before, after)) = pairs.get(random.random_range(0..pairs.len().max(1))) else { break };
        let mut file = before.file.clone();
        file.resize(after.file.len().max(before.file.len()), 0);
        for page in 0..after.file.len() / PAGE {
            let place = page * PAGE..(page + 1) * PAGE;
            match random.random_range(0..4) {
                0 | 1 => file[place.clone()].copy_from_slice(&after.file[place]),
                2 if random.random_range(0..20) == 0 => {
                    let half = place.start..place.start + 512 * random.random_range(1..8);
                    file[half.clone()].copy_from_slice(&after.file[half]);
                }
                _ => {}
            }
        }
        // The log from which they were copied is whole: it is begun anew only when the file has been synced.
        match opened(directory.path(), &file, &after.log, 50) {
            Ok((rows, bad)) => {
                lost += u64::try_from(after.rows - rows).unwrap_or(0);
                wrong += bad;
            }
            Err(error) => row.must(false, error),
        }
    }
    finish(row, count, lost, wrong)
}

fn finish(mut row: Row, count: usize, lost: u64, wrong: u64) -> Row {
    (row.n, row.lost, row.wrong) = (count, Some(lost), Some(wrong));
    row.must(lost == 0, format!("{lost} durable rows are gone"));
    row.must(wrong == 0, format!("{wrong} rows are wrong or out of their place"));
    row
}
