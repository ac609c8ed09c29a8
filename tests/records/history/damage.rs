//! What a disk changes is never taken for a value: bits that flip in every page of the file, pages in the wrong place, wrong headers,
//! and what is saved from them.

use crate::history::machine::{Machine, START_NS, uniform};
use crate::history::round_trip::{options, verify, write};
use flate2::read::GzDecoder;
use gateway::history::{
    Alarm, Audit, Buckets, Command, Decision, Diagnosis, Event, Model, Options, Outbox, OutboxReader, OutboxSettings,
    Part, Query, ReactionTime, Reader, RecordSpan, StateChange, Writer, repair_history,
};
use sha2::{Digest, Sha256};
use std::fs;
use std::io::Read;
use std::path::Path;
use std::time::Duration;

const PAGE: usize = 4_096;

/// A history in which every table has rows.
fn filled(path: &Path) {
    let machine = Machine::new().with_gaps();
    let outbox = Outbox::new("lathe", OutboxSettings::default(), ["plant".to_owned()]);
    let writer = Writer::open(path, Options { outbox: Some(outbox), ..options() }).expect("opens");
    for part in 0..60 {
        write(&writer, &machine, part * 200..(part + 1) * 200);
        let at_ns = Machine::at_ns(part * 200 + 199);
        let word = |what: &str| format!("{what} {part} {}", "x".repeat(60));
        writer.queue_record(StateChange { at_ns, state: word("state"), ..StateChange::default() });
        writer.queue_record(Event { at_ns, kind: "mark".into(), text: word("event"), ..Event::default() });
        writer.queue_record(Part {
            began_ns: at_ns - 5,
            ended_ns: at_ns,
            part: word("part"),
            count: part,
            ..Part::default()
        });
        writer.queue_record(Alarm { at_ns, code: word("alarm"), source: "test".into(), ..Alarm::default() });
        writer.queue_record(Decision {
            at_ns,
            script: word("script"),
            value: Some(part as f64),
            ..Decision::default()
        });
        writer.queue_record(Command {
            at_ns,
            command: word("command"),
            asked: Some(part as f64),
            ..Command::default()
        });
        writer.queue_record(ReactionTime { at_ns, asked_pct: part as f64, ..ReactionTime::default() });
        writer.queue_record(Model { at_ns, name: word("model"), toml: "t".repeat(200), ..Model::default() });
        writer.queue_record(Diagnosis { at_ns, from_ns: 1, to_ns: 2, json: "j".repeat(6_000), ..Diagnosis::default() });
        writer.queue_record(Audit { at_ns, kind: "write".into(), asked: Some(part as f64), ..Audit::default() });
    }
    writer.flush().expect("durable");
    writer.maintain_and_wait(Machine::at_ns(12_000), Duration::from_secs(30)).expect("compacts");
    assert_eq!(writer.close().degraded, None);
}

/// Every answer that can be had of a history, each as its text or as the error.
fn answers(path: &Path) -> Vec<(&'static str, Result<String, String>)> {
    let reader = match Reader::open(path) {
        Ok(reader) => reader,
        Err(error) => return vec![("open", Err(error.to_string()))],
    };
    let all = RecordSpan::newest(100_000);
    let text = |error: gateway::history::HistoryError| error.to_string();
    let overview = |width_s: i64| {
        reader.read_overview(&Query::default(), width_s * 1_000_000_000).map(|overview| {
            let words = overview.columns.iter().map(|column| match column {
                Buckets::Numbers(buckets) => format!("{buckets:?}"),
                Buckets::Words(words) => format!("{words:?}"),
            });
            format!("{:?} {}", overview.start_ns, words.collect::<String>())
        })
    };
    macro_rules! answer {
        ($name:literal, $value:expr) => {
            ($name, $value.map(|value| format!("{value:?}")).map_err(text))
        };
    }
    vec![
        answer!("series", reader.read_series()),
        answer!("span", reader.read_span()),
        answer!("samples", samples(&reader)),
        answer!("minutes", overview(60)),
        answer!("hours", overview(3_600)),
        answer!("days", overview(86_400)),
        answer!("states", reader.read_states(all)),
        answer!("state hours", reader.state_hours(all)),
        answer!("parts", reader.read_parts(all)),
        answer!("events", reader.read_events(all)),
        answer!("events of a kind", reader.events_of("mark", all)),
        answer!("alarms", reader.read_alarms(all)),
        answer!("decisions", reader.read_decisions(all)),
        answer!("commands", reader.read_commands(all)),
        answer!("models", reader.read_models(all)),
        answer!("diagnoses", reader.read_diagnoses(all)),
        answer!("audit", reader.read_audit(i64::MIN, i64::MAX, u32::MAX)),
        answer!("chain", reader.verify_audit().map(|check| (check.rows, check.head, check.broken))),
        answer!("sql", sql(&reader, "SELECT count(*), sum(asked_pct), sum(at_ns % 1000003) FROM reactions")),
        answer!("sql samples", sql(&reader, "SELECT count(*), sum(total_power_w), max(time_utc) FROM samples")),
        answer!("dropped", reader.read_info().map(|info| (info.samples, info.dropped, info.segments))),
        answer!("outbox", OutboxReader::open(path).and_then(|mut outbox| outbox.read(0, u64::MAX, usize::MAX))),
    ]
}

/// All samples as a digest; with what was left out, which is an answer that says so.
fn samples(reader: &Reader) -> Result<String, gateway::history::HistoryError> {
    let mut text = Vec::new();
    let exported = reader.export_csv(&Query::default(), &mut text, Path::new("out"));
    let damaged = reader.damaged_rows();
    if !damaged.is_empty() {
        return Err(gateway::history::HistoryError::Question(format!("left out: {damaged:?}")));
    }
    exported.map(|rows| format!("{rows} {:x?}", Sha256::digest(&text)))
}

fn sql(reader: &Reader, statement: &str) -> Result<String, gateway::history::HistoryError> {
    let mut text = String::new();
    reader.run_sql(statement, Duration::from_secs(60), |_, values| {
        text += &format!("{values:?}");
        std::ops::ControlFlow::Continue(())
    })?;
    Ok(text)
}

/// What bits and pages did to the answers.
#[derive(Debug, Default)]
struct Tally {
    flips: usize,
    /// Answers that were right, and those that told an error.
    right: usize,
    told: usize,
    /// Answers that were neither.
    wrong: Vec<String>,
}

impl Tally {
    fn compare(&mut self, what: &str, expected: &[(&'static str, Result<String, String>)], path: &Path) {
        self.flips += 1;
        for (name, found) in answers(path) {
            match expected.iter().find(|(known, _)| *known == name) {
                Some((_, truth)) if *truth == found => self.right += 1,
                _ if found.is_err() => self.told += 1,
                // A check whose answer is that something is wrong tells it.
                _ if name == "chain" && found.as_ref().is_ok_and(|text| text.contains("Some(Break")) => self.told += 1,
                _ => self.wrong.push(format!("{what}: {name}")),
            }
        }
    }
}

/// Flips one bit in each of so many pages, spread over the whole file.
fn flip(count: usize, seed: i64) -> Tally {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    filled(&path);
    let whole = fs::read(&path).expect("reads");
    let expected = answers(&path);
    assert!(expected.iter().all(|(_, answer)| answer.is_ok()), "{:?}", expected.iter().find(|it| it.1.is_err()));
    let pages = whole.len() / PAGE;
    let mut tally = Tally::default();
    for flip in 0..count {
        let page = if count >= pages { flip % pages } else { flip * pages / count };
        let random = |channel: u64, below: usize| (uniform(flip as i64 + seed, channel) * below as f64) as usize;
        let (byte, bit) = (page * PAGE + random(1, PAGE), random(2, 8));
        let mut bytes = whole.clone();
        bytes[byte] ^= 1 << bit;
        fs::write(&path, &bytes).expect("writes");
        tally.compare(&format!("page {} of {pages}, byte {}, bit {bit}", page + 1, byte % PAGE), &expected, &path);
    }
    // The header decides how everything is read: each of its bits.
    let header = if count >= 500 { 800 } else { 50 };
    for bit in 0..header {
        let bit = if header == 800 { bit } else { bit * 16 + 3 };
        let mut bytes = whole.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        fs::write(&path, &bytes).expect("writes");
        tally.compare(&format!("header, bit {bit}"), &expected, &path);
    }
    tally
}

#[test]
fn a_bit_that_flips_is_told_or_changes_nothing() {
    let tally = flip(30, 0);
    println!("{} flips: {} answers right, {} told, {} wrong", tally.flips, tally.right, tally.told, tally.wrong.len());
    assert!(tally.wrong.is_empty(), "{:?}", tally.wrong);
    assert!(tally.told > 0 && tally.right > 0);
}

#[test]
#[ignore = "5 minutes: bits that flip in every page and in the whole header, answers compared with the truth"]
fn every_page_and_the_whole_header() {
    let tally = flip(2_000, 7);
    println!("{} flips: {} answers right, {} told, {} wrong", tally.flips, tally.right, tally.told, tally.wrong.len());
    assert!(tally.wrong.is_empty(), "{:?}", tally.wrong);
}

#[test]
fn pages_that_changed_places_are_told() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    filled(&path);
    let whole = fs::read(&path).expect("reads");
    let expected = answers(&path);
    let pages = whole.len() / PAGE;
    let mut tally = Tally::default();
    for step in 0..20 {
        let (a, b) = (step * pages / 20, (step * pages / 20 + 7) % pages);
        let mut bytes = whole.clone();
        bytes[a * PAGE..(a + 1) * PAGE].copy_from_slice(&whole[b * PAGE..(b + 1) * PAGE]);
        bytes[b * PAGE..(b + 1) * PAGE].copy_from_slice(&whole[a * PAGE..(a + 1) * PAGE]);
        fs::write(&path, &bytes).expect("writes");
        tally.compare(&format!("pages {a} and {b}"), &expected, &path);
    }
    assert!(tally.wrong.is_empty(), "{:?}", tally.wrong);
    assert!(tally.told > 0, "no page that changed places was told");
}

#[test]
fn what_is_whole_is_saved_and_what_is_lost_is_named() {
    let dir = tempfile::tempdir().expect("a directory");
    let (path, new) = (dir.path().join("h.db"), dir.path().join("new.db"));
    filled(&path);
    let expected = answers(&path);
    let whole = fs::read(&path).expect("reads");
    assert!(repair_history(&path, &new).expect("copies").is_whole());
    for ((name, found), (_, truth)) in answers(&new).iter().zip(&expected) {
        assert!(found == truth, "{name} of a file that is whole: {:.300?}", found);
    }
    let pages = whole.len() / PAGE;
    let (mut rows, mut reported) = (Vec::new(), 0);
    for page in (1..pages).step_by(pages / 24) {
        let mut bytes = whole.clone();
        bytes[page * PAGE + 100] ^= 4;
        fs::write(&path, &bytes).expect("writes");
        fs::remove_file(&new).expect("removes");
        let repaired = repair_history(&path, &new).expect("saves what is whole");
        let reader = Reader::open(&new).expect("opens");
        assert_eq!(reader.check_integrity().expect("checks"), Vec::<String>::new(), "page {page}");
        let info = reader.read_info().expect("reads");
        let lost: i64 = repaired.damaged.iter().map(|damaged| damaged.rows).sum();
        assert!(info.samples + lost >= 11_400 && info.samples <= 12_000, "page {page}: {info:?} {repaired:?}");
        rows.push(info.samples);
        reported += usize::from(!repaired.is_whole());
        drop(reader);
        drop(Writer::open(&new, options()).expect("a gateway goes on with it"));
    }
    println!("samples saved: {rows:?}; {reported} of {} said what is lost", rows.len());
    assert!(rows.iter().filter(|rows| **rows == 12_000).count() > rows.len() / 3);
}

#[test]
fn a_wrong_header_is_put_right_by_a_repair() {
    let dir = tempfile::tempdir().expect("a directory");
    let (path, new) = (dir.path().join("h.db"), dir.path().join("new.db"));
    let machine = Machine::new().with_gaps();
    let writer = Writer::open(&path, options()).expect("opens");
    write(&writer, &machine, 0..3_000);
    writer.flush().expect("durable");
    drop(writer);
    let mut bytes = fs::read(&path).expect("reads");
    bytes[..100].fill(0x55);
    fs::write(&path, &bytes).expect("writes");
    let error = Reader::open(&path).expect_err("refused");
    assert!(error.is_damage() && error.to_string().contains("history repair"), "{error}");
    assert!(Writer::open(&path, options()).expect_err("refused").is_damage());
    repair_history(&path, &new).expect("saves");
    assert_eq!(verify(&new, &machine, 0), 3_000);
    assert_eq!(
        fs::read_dir(dir.path())
            .expect("there")
            .flatten()
            .filter(|file| { file.file_name().to_string_lossy().contains(".source") })
            .count(),
        0,
        "the copy is gone"
    );
}

/// Written by a version whose blocks and pages had no checksums.
pub(crate) fn older(path: &Path) {
    let packed =
        fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/history/schema_4.db.gz")).expect("there");
    let mut bytes = Vec::new();
    GzDecoder::new(&packed[..]).read_to_end(&mut bytes).expect("unpacks");
    fs::write(path, &bytes).expect("writes");
}

/// Digest of what the version that wrote it exported.
pub(crate) const OLDER_EXPORT: &str = "36a66393bc6e8a07c4081e65003b0f0b47415d804576fee7fc144e0631d5b344";

pub(crate) fn export(path: &Path) -> String {
    let mut text = Vec::new();
    Reader::open(path).and_then(|reader| reader.export_csv(&Query::default(), &mut text, path)).expect("reads");
    Sha256::digest(&text).iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn a_file_of_an_older_version_stays_readable_and_gets_its_checksums() {
    let dir = tempfile::tempdir().expect("a directory");
    let (path, new) = (dir.path().join("h.db"), dir.path().join("new.db"));
    older(&path);
    assert_eq!(export(&path), OLDER_EXPORT, "as it is");
    let check = Reader::open(&path).and_then(|reader| reader.verify_audit()).expect("reads");
    assert_eq!((check.broken, check.rows), (None, 19));
    let writer = Writer::open(&path, Options::default()).expect("gets the newer schema");
    writer.maintain_and_wait(START_NS, Duration::from_secs(30)).expect("seals blocks");
    drop(writer);
    assert_eq!(export(&path), OLDER_EXPORT, "sealed");
    // From now on a changed bit in a block is told, although its pages have no sums.
    let db = rusqlite::Connection::open(&path).expect("opens");
    db.execute("UPDATE blocks SET columns = zeroblob(100) || substr(columns, 101) WHERE first_row = 0", [])
        .expect("changes");
    drop(db);
    let reader = Reader::open(&path).expect("opens");
    reader.export_csv(&Query::default(), Vec::new(), &path).expect("the rest");
    assert_eq!(reader.damaged_rows().len(), 1, "{:?}", reader.damaged_rows());
    older(&path);
    assert!(repair_history(&path, &new).expect("copies").is_whole());
    assert_eq!(export(&new), OLDER_EXPORT, "with sums on its pages");
    let header = fs::read(&new).expect("reads");
    assert_eq!((header[20], &header[68..72]), (8, &b"cncs"[..]));
}

/// A reader of another program may copy the log into the file after a crash, which is its right.
#[test]
fn another_program_that_only_reads_damages_nothing() {
    let dir = tempfile::tempdir().expect("a directory");
    let (path, copy) = (dir.path().join("h.db"), dir.path().join("copy.db"));
    let machine = Machine::new();
    let writer = Writer::open(&path, options()).expect("opens");
    write(&writer, &machine, 0..1_500);
    writer.flush().expect("durable");
    for end in ["", "-wal"] {
        fs::copy(format!("{}{end}", path.display()), format!("{}{end}", copy.display())).expect("copies");
    }
    drop(writer);
    let other = rusqlite::Connection::open(&copy).expect("opens");
    let count: i64 = other.query_row("SELECT count(*) FROM series", [], |row| row.get(0)).expect("reads");
    other.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |_| Ok(())).expect("copies the log");
    drop(other);
    assert!(count > 0);
    assert_eq!(verify(&copy, &machine, 0), 1_500);
    let writer = Writer::open(&copy, options()).expect("opens");
    write(&writer, &machine, 1_500..2_000);
    writer.flush().expect("durable");
    drop(writer);
    assert_eq!(verify(&copy, &machine, 0), 2_000);
}
