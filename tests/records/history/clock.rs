//! Clocks that were wrong: rows are dated anew when the right time is known, nothing goes because of one reading, and what
//! goes is accounted for in the audit.

use crate::history::machine::{Machine, TICK_NS, extra_values};
use crate::history::round_trip::{options, verify};
use adapters::Sample;
use adapters::clock::SECOND_NS;
use gateway::clock::ClockMark;
use gateway::history::{
    Alarm, Audit, Buckets, DAY_NS, Event, Options, Outbox, OutboxReader, OutboxSettings, Part, Query, Reader,
    RecordSpan, Retention, StateChange, Writer, set_clock,
};
use std::path::Path;
use std::time::Duration;

const BOOT: &str = "00000000-0000-0000-0000-000000000001";
const ANCHOR_NS: i64 = 1_700_000_000 * SECOND_NS;

fn mark(trust: &'static str, off_ns: i64) -> ClockMark {
    ClockMark { trust, boot: BOOT.to_owned(), anchor_ns: ANCHOR_NS + off_ns }
}

fn outbox() -> Outbox {
    Outbox::new("lathe", OutboxSettings::default(), ["plant".to_owned()])
}

/// One run of the box whose clock is off by `off_ns`: rows and records of every kind.
fn run(path: &Path, rows: std::ops::Range<i64>, trust: &'static str, off_ns: i64) {
    let machine = Machine::new().with_gaps();
    let options = Options { clock: mark(trust, off_ns), outbox: Some(outbox()), ..options() };
    let writer = Writer::open(path, options).expect("opens");
    let mut sample = Sample::new_empty(0);
    for row in rows.clone() {
        machine.fill(row, &mut sample);
        sample.at_ns += off_ns;
        writer.queue_sample(&sample, &extra_values(row));
        let at_ns = sample.at_ns;
        if row % 100 == 0 {
            let state = if row % 200 == 0 { "cutting" } else { "idle" };
            writer.queue_record(StateChange { at_ns, state: state.into(), ..StateChange::default() });
            writer.queue_record(Event { at_ns, kind: "mark".into(), ..Event::default() });
        }
        if row % 500 == 0 {
            writer.queue_record(Part { began_ns: at_ns - SECOND_NS, ended_ns: at_ns, count: 1, ..Part::default() });
            writer.queue_record(Alarm { at_ns, code: format!("a{row}"), source: "test".into(), ..Alarm::default() });
            writer.queue_record(Audit { at_ns, kind: "write".into(), asked: Some(row as f64), ..Audit::default() });
        }
    }
    writer.flush().expect("durable");
    assert_eq!(writer.close().degraded, None);
}

/// Everything that a reader is told of time, as text.
fn told(path: &Path) -> String {
    let reader = Reader::open(path).expect("opens");
    let all = RecordSpan::newest(100_000);
    let overview = |width_s: i64| {
        let overview = reader
            .read_overview(&Query::default().with_series(["total_power_w"]), width_s * SECOND_NS)
            .expect("answers");
        let Buckets::Numbers(buckets) = &overview.columns[0] else { panic!("a quantity") };
        // Means are sums in another order.
        let rounded: Vec<_> = buckets.iter().map(|it| (it.count, it.min, it.max, (it.mean * 1e6).round())).collect();
        format!("{:?} {rounded:?}", overview.start_ns)
    };
    let hours: Vec<String> = reader
        .state_hours(all)
        .expect("reads")
        .iter()
        .map(|hour| format!("{} {} {:.3}", hour.start_ns, hour.state, hour.seconds))
        .collect();
    let items = OutboxReader::open(path).expect("opens").read(0, u64::MAX, usize::MAX).expect("reads").items;
    // That time decreased was true, and stays told; it has a number of its own.
    let stays = |text: &str| !text.contains("clock_went_back");
    // Gaps and means of a wrong time are not sent.
    let items = items.iter().filter(|item| item.is_live()).map(|item| {
        let mut json = item.to_json();
        // Which life has numbered it, and that it was moved, differ.
        json["sequence"] = 0.into();
        json["epoch"] = 0.into();
        json.as_object_mut().expect("fields").remove("redated_ns");
        (item.at_ns, json.to_string())
    });
    let items: Vec<_> = items.filter(|(_, text)| stays(text)).collect();
    let events = reader.read_events(all).expect("reads").into_iter().filter(|event| stays(&event.kind));
    [
        format!("{:?}", reader.read_span().expect("reads")),
        format!("{:?}", reader.read_states(all).expect("reads")),
        format!("{:?}", events.collect::<Vec<_>>()),
        format!("{:?}", reader.read_parts(all).expect("reads")),
        format!("{:?}", reader.read_alarms(all).expect("reads")),
        format!("{hours:?}"),
        format!("{items:?}"),
        overview(60),
        overview(3600),
        overview(86_400),
    ]
    .join("\n")
}

/// Says where two long texts differ first.
fn assert_same(found: &str, expected: &str, leap_ns: i64) {
    let at = found.bytes().zip(expected.bytes()).position(|(a, b)| a != b);
    let part = |text: &str, at: usize| text[at.saturating_sub(80)..].chars().take(160).collect::<String>();
    if let Some(at) = at {
        panic!("{leap_ns}: at {at}\n{}\n{}", part(found, at), part(expected, at));
    }
    assert_eq!(found.len(), expected.len(), "{leap_ns}");
}

#[test]
fn rows_of_a_wrong_clock_are_dated_anew_as_if_it_had_been_right() {
    let leaps =
        [405 * DAY_NS, 4018 * DAY_NS, -3600 * SECOND_NS, -3653 * DAY_NS, 31_400_000_000, -Machine::at_ns(3_000)];
    for leap_ns in leaps {
        let dir = tempfile::tempdir().expect("a directory");
        let (wrong, right) = (dir.path().join("wrong.db"), dir.path().join("right.db"));
        for (path, off_ns) in [(&wrong, leap_ns), (&right, 0)] {
            run(path, 0..3_000, "confirmed", 0);
            run(path, 3_000..9_777, "unset", off_ns);
        }
        let span = |path: &Path| Reader::open(path).and_then(|reader| reader.read_span()).expect("reads");
        assert_ne!(span(&wrong), span(&right));
        let redated = set_clock(&wrong, &mark("plausible", 0), None).expect("done").expect("some");
        assert_eq!((redated.segments, redated.samples, redated.by_ns), (1, 6_777, (-leap_ns, -leap_ns)));
        assert_eq!(verify(&wrong, &Machine::new().with_gaps(), 0), 9_777, "{leap_ns}: every row");
        set_clock(&right, &mark("plausible", 0), None).expect("done");
        assert_same(&told(&wrong), &told(&right), leap_ns);
        let reader = Reader::open(&wrong).expect("opens");
        let check = reader.verify_audit().expect("checks");
        assert_eq!((check.broken, check.rows), (None, 20 + 1), "the chain is never changed, but goes on");
        let note = reader.read_audit(i64::MIN, i64::MAX, 1).expect("reads").remove(0).audit;
        assert!(note.kind == "clock" && note.reason.contains("rows 7 to 20"), "{note:?}");
        assert_eq!(reader.check_integrity().expect("checks"), Vec::<String>::new());
        assert_eq!(set_clock(&wrong, &mark("plausible", 0), None).expect("done"), None, "once");
        run(&wrong, 9_777..10_000, "plausible", 0);
        assert_eq!(verify(&wrong, &Machine::new().with_gaps(), 0), 10_000);
    }
}

#[test]
fn what_a_run_records_before_its_first_row_is_dated_as_its_rows() {
    for (rows_before, rows) in [(0, 0), (0, 300), (300, 0), (300, 300)] {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("h.db");
        run(&path, 0..rows_before, "confirmed", 0);
        let leap_ns = -3653 * DAY_NS;
        let writer = Writer::open(&path, Options { clock: mark("unset", leap_ns), ..options() }).expect("opens");
        let right_ns = Machine::at_ns(1_000);
        writer.queue_record(Event { at_ns: right_ns + leap_ns, kind: "early".into(), ..Event::default() });
        writer.flush().expect("durable");
        let mut sample = Sample::new_empty(0);
        for row in 1_001..1_001 + rows {
            Machine::new().fill(row, &mut sample);
            sample.at_ns += leap_ns;
            writer.queue_sample(&sample, &extra_values(row));
        }
        writer.queue_record(Event { at_ns: right_ns + leap_ns, kind: "late".into(), ..Event::default() });
        writer.flush().expect("durable");
        drop(writer);
        let redated = set_clock(&path, &mark("plausible", 0), None).expect("done").expect("some");
        assert_eq!((redated.samples, redated.by_ns), (rows, (-leap_ns, -leap_ns)), "{rows_before} {rows}");
        let events = Reader::open(&path).and_then(|it| it.read_events(RecordSpan::newest(100))).expect("reads");
        let at_ns = |kind: &str| events.iter().find(|it| it.kind == kind).expect("kept").at_ns;
        assert_eq!((at_ns("early"), at_ns("late")), (right_ns, right_ns), "{rows_before} {rows}");
        assert_eq!(set_clock(&path, &mark("plausible", 0), None).expect("done"), None, "once");
    }
}

#[test]
fn a_confirmed_clock_and_another_start_of_the_computer_are_left_alone() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    run(&path, 0..1_000, "confirmed", 0);
    run(&path, 1_000..2_000, "plausible", 0);
    let before = told(&path);
    let other = ClockMark { boot: "another".to_owned(), ..mark("plausible", 5_000 * SECOND_NS) };
    assert_eq!(set_clock(&path, &other, None).expect("done"), None);
    assert_eq!(set_clock(&path, &mark("unset", 5_000 * SECOND_NS), None).expect("done"), None, "no better one");
    assert_same(&told(&path), &before, 0);
    let redated = set_clock(&path, &mark("plausible", 5_000 * SECOND_NS), None).expect("done").expect("some");
    assert_eq!(redated.samples, 1_000, "not those of the confirmed one");
}

#[test]
fn what_is_certain_is_the_newest_row_under_a_confirmed_clock() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    let certain = || Reader::open(&path).and_then(|reader| reader.certain_ns()).expect("reads");
    run(&path, 0..700, "plausible", 0);
    assert_eq!(certain(), None);
    run(&path, 700..1_500, "confirmed", 0);
    run(&path, 1_500..2_000, "plausible", 4018 * DAY_NS);
    assert_eq!(certain(), Some(Machine::at_ns(1_499)));
    let now_ns = Machine::at_ns(1_000);
    set_clock(&path, &mark("plausible", 0), Some(now_ns)).expect("done");
    assert_eq!(certain(), Some(now_ns), "it was decided that it is earlier than the rows say");
    let writer = Writer::open(&path, Options { clock: mark("plausible", 0), ..options() }).expect("opens");
    writer.queue_sample(&Sample::new_empty(now_ns + TICK_NS), &extra_values(0));
    writer.flush().expect("durable");
    writer.confirm_clock();
    writer.queue_sample(&Sample::new_empty(now_ns + 2 * TICK_NS), &extra_values(0));
    writer.flush().expect("durable");
    assert_eq!(certain(), Some(now_ns + 2 * TICK_NS));
}

/// Rows on so many days, a minute each, and a record of each kind per day.
fn write_days(path: &Path, days: i64, retention: Retention) -> Writer {
    let writer = Writer::open(path, Options { retention, ..options() }).expect("opens");
    let (machine, mut sample) = (Machine::new(), Sample::new_empty(0));
    for day in 0..days {
        for row in 0..600 {
            machine.fill(row, &mut sample);
            sample.at_ns += day * DAY_NS;
            writer.queue_sample(&sample, &extra_values(row));
        }
        let at_ns = sample.at_ns;
        writer.queue_record(Audit { at_ns, kind: "write".into(), ..Audit::default() });
        writer.queue_record(Part { began_ns: at_ns - SECOND_NS, ended_ns: at_ns, count: 1, ..Part::default() });
        let (code, source) = (format!("d{day}"), "test".to_owned());
        writer.queue_record(Alarm { at_ns, code: code.clone(), source: source.clone(), ..Alarm::default() });
        writer.queue_record(gateway::history::AlarmClear { at_ns, code, source });
    }
    writer.flush().expect("durable");
    writer
}

/// Samples, parts, alarms and rows of the audit.
fn counts(path: &Path) -> (i64, usize, usize, u64) {
    let reader = Reader::open(path).expect("opens");
    let all = RecordSpan::newest(100_000);
    let (parts, alarms) = (reader.read_parts(all).expect("reads").len(), reader.read_alarms(all).expect("reads").len());
    (reader.read_info().expect("reads").samples, parts, alarms, reader.verify_audit().expect("checks").rows)
}

#[test]
fn a_wrong_time_that_was_believed_takes_days_and_not_the_history() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    let writer = write_days(&path, 50, Retention { raw_days: 400.0, ..Retention::default() });
    let before = counts(&path);
    let now_ns = Machine::at_ns(600) + 50 * DAY_NS;
    let limit = Duration::from_secs(60);
    for leap_days in [405, 4018] {
        writer.maintain_and_wait(now_ns + leap_days * DAY_NS, limit).expect("done");
        let after = counts(&path);
        assert_eq!((after.1, after.2, after.3), (before.1, before.2, before.3), "no part, alarm or row of the audit");
        // 40 of the 50 days were stored after the oldest ten, so that their age may count: three of them go in one run.
        assert!(before.0 - after.0 <= 2 * 4 * 600, "{leap_days}: {before:?} became {after:?}");
    }
    for _ in 0..20 {
        writer.maintain_and_wait(now_ns + 4018 * DAY_NS, limit).expect("done");
    }
    // The minute of the last day is not over, and counts for no day yet.
    assert_eq!(
        counts(&path).0,
        41 * 600,
        "what fewer than 40 days of samples have followed stays, whatever the clock says"
    );
    writer.request_maintenance(None);
    writer.flush().expect("durable");
    assert_eq!(counts(&path).0, 41 * 600);
}

#[test]
fn what_goes_of_the_audit_is_a_row_of_the_audit() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    let retention = Retention { audit_days: 5.0, ..Retention::default() };
    let writer = write_days(&path, 10, retention);
    let now_ns = Machine::at_ns(600) + 10 * DAY_NS;
    for _ in 0..4 {
        writer.maintain_and_wait(now_ns, Duration::from_secs(60)).expect("done");
    }
    drop(writer);
    let reader = Reader::open(&path).expect("opens");
    let check = reader.verify_audit().expect("checks");
    let removed = check.removed.clone().expect("told");
    assert_eq!((check.broken, check.first, removed.through, removed.because.as_str()), (None, 7, 6, "age"));
    let at_days = (removed.at_ns - Machine::at_ns(0)).div_euclid(DAY_NS);
    assert_eq!(at_days, 10, "when it was removed");
    // The same without a word, as somebody with the file in his hands would do it.
    let db = crate::sealed::connect(&path);
    db.execute_batch("UPDATE meta SET value = 9 WHERE key = 'audit_released'; DELETE FROM audit WHERE number <= 9;")
        .expect("the trigger is told that retention has done it");
    let broken = reader.verify_audit().expect("checks").broken.expect("told");
    assert!(broken.what.contains("1 to 9 are gone, and no row says"), "{broken:?}");
    db.execute_batch("UPDATE meta SET value = 99 WHERE key = 'audit_released'; DELETE FROM audit;").expect("all of it");
    let broken = reader.verify_audit().expect("checks").broken.expect("an audit without a row is not intact");
    assert!(broken.what.contains("the chain ends before it"), "{broken:?}");
}

#[test]
fn ten_minutes_ago_is_not_counted_from_the_future() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    run(&path, 0..1_000, "confirmed", 0);
    let ahead_ns = gateway::clock::now_ns() + 3653 * DAY_NS - Machine::at_ns(1_000);
    run(&path, 1_000..1_500, "plausible", ahead_ns);
    run(&path, 1_500..2_000, "confirmed", 0);
    let reader = Reader::open(&path).expect("opens");
    assert_eq!(reader.read_present_span().expect("reads"), Some((Machine::at_ns(0), Machine::at_ns(1_999))));
    let future = reader.find_future_rows(gateway::clock::now_ns()).expect("reads").expect("some");
    assert_eq!((future.samples, future.first_ns), (500, Machine::at_ns(1_000) + ahead_ns));
    let brought = dir.path().join("brought.db");
    let writer = Writer::open(&brought, options()).expect("opens");
    writer.queue_sample(&Sample::new_empty(ahead_ns + Machine::at_ns(0)), &extra_values(0));
    writer.flush().expect("durable");
    let reader = Reader::open(&brought).expect("opens");
    assert_eq!(
        reader.find_future_rows(gateway::clock::now_ns()).expect("reads"),
        None,
        "the machine brought its own time"
    );
    assert_eq!(
        reader.read_present_span().expect("reads").map(|(_, present_ns)| present_ns),
        Some(ahead_ns + Machine::at_ns(0))
    );
}
