//! Questions: overviews, filters, SQL, exports, records.

use crate::history::machine::{Machine, START_NS, extra_values};
use crate::history::round_trip::{options, write};
use adapters::clock::SECOND_NS;
use gateway::history::{
    Alarm, AlarmClear, Buckets, Command, Decision, Diagnosis, Event, Model, Part, Query, Reader, RecordSpan, SqlValue,
    StateChange, Writer,
};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

const LIMIT: Duration = Duration::from_secs(60);

/// Two and a half hours, the last seconds in the crash tail.
fn history(path: &Path) -> (Writer, Machine) {
    let machine = Machine::new().with_gaps();
    let writer = Writer::open(path, options()).expect("opens");
    write(&writer, &machine, 0..90_123);
    writer.flush().expect("durable");
    (writer, machine)
}

/// Mean of quantity `index` over rows, the slow way.
fn plain(machine: &Machine, index: usize, rows: std::ops::Range<i64>) -> (u64, f64, f64, f64) {
    let values: Vec<f64> =
        rows.filter(|row| machine.missing(*row, index).is_none()).map(|row| machine.quantity(row, index)).collect();
    let min = values.iter().copied().fold(f64::INFINITY, f64::min);
    let max = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (values.len() as u64, min, max, values.iter().sum::<f64>() / values.len() as f64)
}

#[test]
fn overviews_agree_with_the_samples_at_every_width() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    let (_writer, machine) = history(&path);
    let reader = Reader::open(&path).expect("opens");
    for width_s in [1, 12, 60, 300, 3_600, 86_400] {
        let query = Query::default().with_series(["spindle_power_w", "spindle_speed_rpm"]);
        let overview = reader.read_overview(&query, width_s * SECOND_NS).expect("answers");
        let per_bucket = width_s * 10;
        assert_eq!(overview.start_ns.len() as i64, (90_123 + per_bucket - 1) / per_bucket, "{width_s} s");
        for (column, index) in [(0, 10), (1, 2)] {
            let Buckets::Numbers(buckets) = &overview.columns[column] else { panic!("numbers") };
            for (bucket, got) in buckets.iter().enumerate().step_by(97) {
                let from = bucket as i64 * per_bucket;
                let (count, min, max, mean) = plain(&machine, index, from..(from + per_bucket).min(90_123));
                assert_eq!((got.count, got.min, got.max), (count, min, max), "{width_s} s, bucket {bucket}");
                assert!((got.mean - mean).abs() <= 1e-9 * mean.abs(), "{width_s} s: {} and {mean}", got.mean);
            }
        }
    }
    let error =
        reader.read_overview(&Query::default().with_series(["spindel_power_w"]), SECOND_NS).expect_err("refused");
    assert!(error.to_string().contains("did you mean spindle_power_w"), "{error}");
    let all = reader.read_overview(&Query::default(), 3_600 * SECOND_NS).expect("answers");
    assert_eq!(all.series.len(), 23, "twenty quantities and three estimates");
}

#[test]
fn filters_choose_rows() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    let (_writer, machine) = history(&path);
    let reader = Reader::open(&path).expect("opens");
    let query = Query {
        state: Some("cutting".to_owned()),
        program: Some("O1234".to_owned()),
        ..Query::between(Machine::at_ns(700), Machine::at_ns(88_000)).with_series(["spindle_power_w"])
    };
    let right = |row: &i64| row.rem_euclid(600) < 420 && machine.word(*row, 0).is_some_and(|word| &**word == "O1234");
    let expected: Vec<i64> = (700..88_000).filter(right).map(Machine::at_ns).collect();
    let mut got = Vec::new();
    reader
        .for_each_chunk(&query, |chunk| {
            got.extend_from_slice(&chunk.at_ns);
            ControlFlow::Continue(())
        })
        .expect("reads");
    assert!(got == expected, "{} rows, {} expected", got.len(), expected.len());
    let coarse = reader.read_overview(&query, 3_600 * SECOND_NS).expect("answers");
    let Buckets::Numbers(buckets) = &coarse.columns[0] else { panic!("numbers") };
    let missing = expected.iter().filter(|at_ns| machine.missing((*at_ns - START_NS) / 100_000_000, 10).is_some());
    let count: u64 = buckets.iter().map(|bucket| bucket.count).sum();
    assert_eq!(count as usize, expected.len() - missing.count());
}

fn one_value(reader: &Reader, statement: &str) -> SqlValue {
    let mut found = None;
    reader
        .run_sql(statement, LIMIT, |_, row| {
            found = row.first().cloned();
            ControlFlow::Break(())
        })
        .expect("runs");
    found.expect("a row")
}

#[test]
fn sql_sees_every_sample() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    let (_writer, machine) = history(&path);
    let reader = Reader::open(&path).expect("opens");
    assert_eq!(one_value(&reader, "SELECT count(*) FROM samples"), SqlValue::Integer(90_123));
    let (from, to) = (Machine::at_ns(36_000), Machine::at_ns(72_000));
    let statement = format!("SELECT max(total_power_w) FROM samples WHERE at_ns >= {from} AND at_ns < {to}");
    let (_, _, max, _) = plain(&machine, 11, 36_000..72_000);
    assert_eq!(one_value(&reader, &statement), SqlValue::Real(max));
    let statement = "SELECT count(*) FROM samples WHERE time_utc >= '2026-01-05T01' AND time_utc < '2026-01-05T01:30'
        AND spindle_power_w IS NULL AND spindle_power_w_missing = 'timeout'";
    let expected = (36_000..54_000).filter(|row| machine.missing(*row, 10).is_some()).count();
    assert_eq!(one_value(&reader, statement), SqlValue::Integer(expected as i64));
    let statement = "SELECT tool FROM samples WHERE at_ns = 1767571260000000000";
    assert_eq!(one_value(&reader, statement), SqlValue::Text(machine.word(600, 1).expect("there").to_string()));
    let statement = "SELECT count(*) FROM samples a JOIN samples b USING (at_ns) WHERE a.at_ns < 1767571201000000000";
    assert_eq!(one_value(&reader, statement), SqlValue::Integer(10));
    for bad in ["DELETE FROM blocks", "SELEC 1", "SELECT * FROM nothing", "ATTACH 'x.db' AS x"] {
        assert!(reader.run_sql(bad, LIMIT, |_, _| ControlFlow::Continue(())).is_err(), "{bad}");
    }
    let endless = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT count(*) FROM c";
    let began = Instant::now();
    let error =
        reader.run_sql(endless, Duration::from_secs(1), |_, _| ControlFlow::Continue(())).expect_err("given up");
    assert!(error.to_string().contains("not ended within 1 s"), "{error}");
    assert!(began.elapsed() < Duration::from_secs(5), "{:?}", began.elapsed());
}

#[test]
fn any_client_reads_tables_and_views() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    let (_writer, machine) = history(&path);
    let db = rusqlite::Connection::open(&path).expect("opens");
    let recent = |select: &str| -> f64 {
        let text = format!("SELECT {select} FROM recent_samples WHERE at_ns = {}", Machine::at_ns(90_122));
        db.query_row(&text, [], |row| row.get(0)).expect("reads")
    };
    assert_eq!(recent("max(value) FILTER (WHERE name = 'total_power_w')"), machine.quantity(90_122, 11));
    assert_eq!(recent("count(*) FILTER (WHERE name = 'program' AND text IS NOT NULL)"), 1.0);
    let minute: (String, f64) = db
        .query_row(
            "SELECT time_utc, mean FROM minute_summaries WHERE name = 'total_power_w' ORDER BY at_ns LIMIT 1",
            [],
            |row| Ok((row.get(0)?, row.get(1)?)),
        )
        .expect("reads");
    assert_eq!(minute.0, "2026-01-05T00:00:00Z");
    assert!((minute.1 - plain(&machine, 11, 0..600).3).abs() < 1e-9);
    let hours: i64 = db
        .query_row("SELECT count(*) FROM hour_summaries WHERE name = 'total_power_w'", [], |row| row.get(0))
        .expect("reads");
    assert_eq!(hours, 3);
}

#[test]
fn records_come_back() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    let writer = Writer::open(&path, options()).expect("opens");
    let state = |at_s: i64, state: &str| StateChange {
        at_ns: START_NS + at_s * SECOND_NS,
        state: state.to_owned(),
        program: "O1234".to_owned(),
        ..StateChange::default()
    };
    writer.queue_record(state(0, "standby"));
    writer.queue_record(state(3_000, "cutting"));
    writer.queue_record(state(4_200, "idle"));
    let alarm = Alarm { at_ns: START_NS, code: "wear".into(), source: "tool.rhai".into(), ..Alarm::default() };
    writer.queue_record(alarm.clone());
    writer.queue_record(alarm);
    let clear = AlarmClear { at_ns: START_NS + SECOND_NS, code: "wear".into(), source: "tool.rhai".into() };
    writer.queue_record(clear);
    let event = Event { at_ns: START_NS + 5, kind: "started".into(), text: "开始".into(), ..Event::default() };
    let decision =
        Decision { at_ns: START_NS + 6, value: Some(90.0), wanted: "feed_override_pct".into(), ..Decision::default() };
    let command = Command { at_ns: START_NS + 7, before: Some(100.0), asked: Some(90.0), ..Command::default() };
    let part = Part { began_ns: START_NS, ended_ns: START_NS + 8, count: 1, energy_j: Some(1.5), ..Part::default() };
    let model = Model { at_ns: START_NS + 9, name: "lathe".into(), toml: "a = 1".into(), ..Model::default() };
    let diagnosis = Diagnosis { at_ns: START_NS + 10, verdict: "explained".into(), ..Diagnosis::default() };
    writer.queue_record(event.clone());
    writer.queue_record(decision.clone());
    writer.queue_record(command.clone());
    writer.queue_record(part.clone());
    writer.queue_record(model.clone());
    let ticket = writer.queue_record(diagnosis.clone()).expect("room");
    writer.flush().expect("durable");
    assert_eq!((ticket, writer.acknowledged_record()), (12, 12));

    let reader = Reader::open(&path).expect("opens");
    let all = RecordSpan::newest(100);
    let states = reader.read_states(all).expect("reads");
    let words: Vec<&str> = states.iter().map(|state| state.state.as_str()).collect();
    assert_eq!(words, ["standby", "cutting", "idle"]);
    assert_eq!((states[0].until_ns, states[2].until_ns), (Some(START_NS + 3_000 * SECOND_NS), None));
    let hours = reader.state_hours(all).expect("reads");
    let seconds: Vec<(String, f64)> = hours.into_iter().map(|hour| (hour.state, hour.seconds)).collect();
    let expected = [("cutting", 600.0), ("standby", 3_000.0), ("cutting", 600.0)];
    assert_eq!(seconds, expected.map(|(state, seconds)| (state.to_owned(), seconds)));
    let alarms = reader.read_alarms(all).expect("reads");
    assert_eq!((alarms.len(), alarms[0].count, alarms[0].cleared_ns), (1, 2, Some(START_NS + SECOND_NS)));
    assert_eq!(reader.read_events(all).expect("reads"), [event]);
    assert_eq!(reader.read_decisions(all).expect("reads"), [decision]);
    assert_eq!(reader.read_commands(all).expect("reads"), [command]);
    assert_eq!(reader.read_parts(all).expect("reads"), [part]);
    assert_eq!(reader.read_models(all).expect("reads"), [model]);
    assert_eq!(reader.read_diagnoses(all).expect("reads"), [diagnosis]);
    assert_eq!(reader.read_events(RecordSpan::between(0, START_NS, 9)).expect("reads"), []);
}

#[test]
fn exports_are_recordings() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    let (_writer, machine) = history(&path);
    let reader = Reader::open(&path).expect("opens");
    let query = Query::between(Machine::at_ns(1_000), Machine::at_ns(5_000));
    let whole = reader.read_recording(&query).expect("reads");
    assert_eq!((whole.count_rows(), whole.start_ns), (4_000, Some(Machine::at_ns(1_000))));
    for name in ["r.csv", "r.csv.gz"] {
        let file = dir.path().join(name);
        assert_eq!(reader.export_to_file(&query, &file).expect("writes"), 4_000);
        let back = adapters::recording::read_path(&file).expect("reads");
        assert_eq!((back.refused, back.recording.count_rows()), (0, 4_000));
        assert_eq!(back.recording.start_ns, whole.start_ns);
        assert_eq!(back.recording.time_s, whole.time_s);
        for column in whole.columns() {
            assert_eq!(back.recording.find_numbers(&column.name), whole.find_numbers(&column.name), "{}", column.name);
            let words = |recording: &adapters::Recording| {
                recording
                    .find_words(&column.name)
                    .map(|words| (0..4_000).map(|row| words.get(row).map(str::to_owned)).collect::<Vec<_>>())
            };
            assert_eq!(words(&back.recording), words(&whole), "{}", column.name);
        }
    }
    let power = whole.find_numbers("spindle_power_w").expect("there");
    let expected = |row: i64| machine.missing(row, 10).is_none().then(|| machine.quantity(row, 10));
    assert!((0..4_000).all(|row| power.get(row) == expected(1_000 + row as i64)));
    let reasons = whole.find_words("spindle_power_w_missing").expect("there");
    assert!((0..4_000).all(|row| reasons.get(row).is_some() == power.get(row).is_none()));
    let none = reader.export_to_file(&Query::between(0, 5), &dir.path().join("n.csv")).expect_err("no rows");
    assert!(none.to_string().contains("history info"), "{none}");
    assert!(reader.export_to_file(&query, &dir.path().join("r.xls")).is_err());
}

#[test]
fn parquet_holds_the_same() {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    let (_writer, machine) = history(&path);
    let reader = Reader::open(&path).expect("opens");
    let file = dir.path().join("r.parquet");
    let query = Query::default().with_series(["total_power_w", "program"]);
    assert_eq!(reader.export_to_file(&query, &file).expect("writes"), 90_123);
    let parquet = SerializedFileReader::new(std::fs::File::open(&file).expect("opens")).expect("is Parquet");
    assert_eq!((parquet.metadata().file_metadata().num_rows(), parquet.num_row_groups()), (90_123, 2));
    for (row, record) in parquet.get_row_iter(None).expect("reads").enumerate() {
        let (record, row) = (record.expect("reads"), row as i64);
        assert_eq!(record.get_double(1).expect("a number"), machine.quantity(row, 11));
        assert_eq!(record.get_string(2).expect("text").as_str(), &**machine.word(row, 0).expect("there"));
    }
}

#[test]
fn info_tells_how_long_the_disk_lasts() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    let (_writer, _) = history(&path);
    let info = Reader::open(&path).and_then(|reader| reader.read_info()).expect("reads");
    assert_eq!((info.samples, info.segments), (90_123, 1));
    let lasts = info.disk_lasts_days.zip(info.limit_reached_days).expect("known");
    assert!(lasts.0 > 1.0 && lasts.1 > 1.0, "{lasts:?}");
    let text = info.to_string();
    assert!(text.contains("at this rate the disk lasts") && text.contains("2026-01-05T00:00:00Z"), "{text}");
}

#[test]
fn estimates_go_out_as_they_came_in() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("h.db");
    let (_writer, _) = history(&path);
    let reader = Reader::open(&path).expect("opens");
    let series = reader.read_series().expect("reads");
    let cutting = series.iter().find(|series| &*series.name == "cutting_power_w").expect("registered");
    assert!(cutting.estimated && &*cutting.unit == "W" && &*cutting.zh == "切削功率");
    let recording = reader.read_recording(&Query::default().with_series(["cutting_power_w"])).expect("reads");
    let numbers = recording.find_numbers("cutting_power_w").expect("there");
    for row in (0..90_123).step_by(331) {
        let expected = match extra_values(row)[2] {
            gateway::history::ExtraValue::Number(watts) => Some(watts),
            _ => None,
        };
        assert_eq!(numbers.get(row as usize), expected);
    }
}
