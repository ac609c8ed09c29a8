//! A clock that was wrong while a box sent: the database follows when the box dates its rows anew.

use crate::fleet::pipeline::{Plant, Recorded};
use adapters::ChannelId;
use gateway::clock::ClockMark;
use gateway::history::{Alarm, AlarmClear, Event, Part, Query, Reader, StateChange, set_clock};
use serde_json::json;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;
use testkit::process::{run, stderr, stdout};

const SECOND_NS: i64 = 1_000_000_000;
const TICK: Duration = Duration::from_secs(1);

fn mark(trust: &'static str, off_ns: i64) -> ClockMark {
    ClockMark { trust, boot: "b".to_owned(), anchor_ns: 1_700_000_000 * SECOND_NS + off_ns }
}

/// These ticks of a machine whose clock is off; states, parts and alarms among them.
fn record(recorded: &Recorded, start_ns: i64, ticks: std::ops::Range<i64>) {
    let power = ChannelId::from_name("spindle_power_w").expect("in the table");
    for tick in ticks {
        let at_ns = start_ns + tick * SECOND_NS;
        if tick % 50 == 0 {
            let state = ["idle", "cutting"][usize::from(tick % 100 == 0)].to_owned();
            recorded.writer().queue_record(StateChange {
                at_ns,
                state,
                program: "O1".into(),
                ..StateChange::default()
            });
        }
        let (code, source) = ("overload".to_owned(), "own.rhai".to_owned());
        match tick % 100 {
            30 => recorded.writer().queue_record(Alarm { at_ns, code, source, ..Alarm::default() }),
            40 => recorded.writer().queue_record(AlarmClear { at_ns, code, source }),
            90 => recorded.writer().queue_record(Part {
                began_ns: at_ns - 80 * SECOND_NS,
                ended_ns: at_ns,
                count: 1,
                detail: json!({"operations": [{"operation": "rough", "seconds": 70.0}]}).to_string(),
                ..Part::default()
            }),
            _ => None,
        };
        recorded.tick(at_ns, &[(power, Ok((tick % 700) as f64))], "cutting");
    }
}

/// Time and power of every tick of the box, as the database has them.
fn ticks_of_box(path: &Path) -> Vec<String> {
    let reader = Reader::open(path).expect("opens");
    let mut rows = Vec::new();
    let query = Query::default().with_series(["spindle_power_w"]);
    reader
        .for_each_chunk(&query, |chunk| {
            for (row, at_ns) in chunk.at_ns.iter().enumerate() {
                rows.push(format!("{at_ns}|{}", chunk.columns[0].number_at(row).expect("a number")));
            }
            ControlFlow::Continue(())
        })
        .expect("reads");
    rows
}

/// The summaries of the box: beginning of the minute, mean and seconds.
fn minutes_of_box(path: &Path) -> Vec<String> {
    let overview = Reader::open(path)
        .expect("opens")
        .read_overview(&Query::default().with_series(["spindle_power_w"]), 60 * SECOND_NS)
        .expect("answers");
    let gateway::history::Buckets::Numbers(buckets) = &overview.columns[0] else { panic!("a quantity") };
    let line = |(index, bucket): (usize, &gateway::history::ValueSummary)| {
        let start_s = overview.start_ns[index] / SECOND_NS;
        (bucket.count > 0).then(|| format!("{start_s}|{:.3}|{}", bucket.mean, bucket.count))
    };
    buckets.iter().enumerate().filter_map(line).collect()
}

fn dump(plant: &Plant) -> String {
    [
        "SELECT at_ns, sequence, epoch, redated_ns FROM items ORDER BY at_ns, epoch, sequence",
        "SELECT since, until, state FROM state_list ORDER BY since, epoch, sequence",
        "SELECT began, ended FROM part_list ORDER BY ended",
        "SELECT since, until, reason FROM gap_list ORDER BY since",
        "SELECT at, name, mean, seconds FROM minutes ORDER BY at, name",
        "SELECT cells, last_at FROM box_latest",
    ]
    .map(|sql| plant.postgres.sql(sql))
    .join("\n")
}

fn put_right(plant: &Plant, off_ns: i64) {
    let start_ns = 1_769_767_210 * SECOND_NS;
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("history.db");
    let wrong = Recorded::with_clock(directory, "Lathe 7", TICK, &plant.address, mark("plausible", off_ns));
    record(&wrong, start_ns + off_ns, 0..400);
    assert_eq!(wrong.refused(), 0);
    plant.ingest();
    let directory = wrong.stop();
    let right = mark("confirmed", 0);
    let redated = set_clock(&path, &right, None).expect("writes").expect("rows are dated anew");
    let again = Recorded::with_clock(directory, "Lathe 7", TICK, &plant.address, right);
    let detail = json!({"by_ns": [redated.by_ns.0, redated.by_ns.1], "moves": redated.moves}).to_string();
    let at_ns = start_ns + 420 * SECOND_NS;
    let kind = "clock_redated".to_owned();
    again.writer().queue_record(Event { at_ns, kind, source: "gateway".into(), text: "dated anew".into(), detail });
    record(&again, start_ns, 420..600);
    assert_eq!(again.refused(), 0);
    let directory = again.stop();
    println!("{off_ns} ns: {}", plant.ingest().trim());
    let sql = |text: &str| plant.postgres.sql(text).lines().map(str::to_owned).collect::<Vec<_>>();
    let power =
        "SELECT at_ns, number FROM readings WHERE name = 'spindle_power_w' AND number IS NOT NULL ORDER BY at_ns";
    let expected = ticks_of_box(&path);
    assert_eq!(expected.len(), 580);
    assert_eq!(sql(power), expected, "{off_ns}: to the nanosecond");
    let minutes = "SELECT extract(epoch FROM at)::bigint, round(mean::numeric, 3), seconds FROM minutes WHERE name = 'spindle_power_w' ORDER BY at";
    let rounded = |lines: Vec<String>| -> Vec<(i64, f64, f64)> {
        let number = |cell: Option<&str>| cell.and_then(|cell| cell.parse::<f64>().ok()).expect("a number");
        let parse = |line: &String| {
            let mut cells = line.split('|');
            let start_s = cells.next().and_then(|cell| cell.parse().ok()).expect("a number");
            (start_s, (number(cells.next()) * 100.0).round(), number(cells.next()))
        };
        lines.iter().map(parse).collect()
    };
    assert_eq!(rounded(sql(minutes)), rounded(minutes_of_box(&path)), "{off_ns}: means of the minutes");
    assert_states(plant, &path, start_ns, off_ns);
    assert_eq!(plant.postgres.number("SELECT count(*) FROM parts WHERE ended - began = interval '80 seconds'"), 6);
    assert_eq!(plant.postgres.number("SELECT count(*) FROM operations"), 6);
    assert_eq!(plant.postgres.number("SELECT count(*) FROM alarms WHERE cleared - raised = interval '10 seconds'"), 6);
    // Everything comes once more, through another consumer.
    let before = dump(plant);
    let once_more = run(&[
        "fleet",
        "ingest",
        &plant.address,
        "--max-gb",
        "4",
        "--once",
        "--consumer",
        "again",
        "--database",
        &plant.postgres.address(),
    ]);
    assert!(once_more.status.success(), "{}", stderr(&once_more));
    assert!(stdout(&once_more).contains("0 rows written"), "{}", stdout(&once_more));
    assert_eq!(dump(plant), before, "{off_ns}: nothing changes");
    drop(directory);
}

/// The stretches of the states are those of the box, and where it did not run there is one without data.
fn assert_states(plant: &Plant, path: &Path, start_ns: i64, off_ns: i64) {
    let known =
        Reader::open(path).expect("opens").read_states(gateway::history::RecordSpan::newest(1000)).expect("reads");
    let found = plant.postgres.sql(
        "SELECT (extract(epoch FROM since) * 1e9)::bigint, state FROM states WHERE state <> 'no_data' ORDER BY since",
    );
    let expected: Vec<String> = known.iter().map(|state| format!("{}|{}", state.since_ns, state.state)).collect();
    let mut expected = expected;
    expected.sort();
    assert_eq!(found.lines().collect::<Vec<_>>(), expected, "{off_ns}");
    let gap = plant.postgres.sql("SELECT (extract(epoch FROM since) * 1e9)::bigint, (extract(epoch FROM until) * 1e9)::bigint, reason FROM gaps ORDER BY since");
    let at = |tick: i64| start_ns + tick * SECOND_NS;
    assert_eq!(gap.lines().next(), Some(format!("{}|{}|not_running", at(400), at(420)).as_str()), "{off_ns}: {gap}");
    assert_eq!(gap.lines().count(), 2, "{off_ns}: the stop at the end is the other one: {gap}");
    let open = "SELECT count(*) FROM state_list WHERE until IS NULL";
    assert_eq!(plant.postgres.number(open), 1, "{off_ns}: only the newest stretch has no end");
    let none = "SELECT count(*) FROM state_list WHERE until < since OR until - since > interval '1 hour'";
    assert_eq!(plant.postgres.number(none), 0, "{off_ns}");
    let latest = plant
        .postgres
        .sql("SELECT (extract(epoch FROM at) * 1e9)::bigint, number FROM latest WHERE name = 'spindle_power_w'");
    assert_eq!(latest, format!("{}|599", at(599)), "{off_ns}");
}

#[test]
fn items_of_a_clock_that_was_ahead_move_with_everything_made_of_them() {
    let Some(plant) = Plant::start() else { return };
    put_right(&plant, 26 * 3600 * SECOND_NS);
}

#[test]
fn items_of_a_clock_that_was_behind_move_with_everything_made_of_them() {
    let Some(plant) = Plant::start() else { return };
    put_right(&plant, -397_440 * SECOND_NS + 123_456_789);
}

#[test]
fn a_clock_that_was_off_by_two_seconds_leaves_no_gap_without_an_end() {
    let Some(plant) = Plant::start() else { return };
    put_right(&plant, 2 * SECOND_NS + 80);
}
