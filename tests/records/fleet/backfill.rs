//! A history that is older than its sink, sent by `fleet resend` through NATS into PostgreSQL and through a broker: every number of the box
//! compared with what arrived, and nothing twice when it is sent once more.
//!
//! `BACKFILL_DAYS=400 cargo test --test records fleet::backfill -- --ignored --nocapture`

use crate::fleet::pipeline::Plant;
use crate::fleet::resent::resend;
use crate::fleet::silent_box::{CHANNELS, DAY_NS, START_NS, TICK_NS, slot_at, write_history};
use gateway::history::{Query, Reader, RecordSpan};
use serde_json::Value as Json;
use std::collections::HashMap;
use std::io::{BufRead, BufReader, Lines};
use std::ops::ControlFlow;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use testkit::broker::{Broker, program};
use testkit::process::{self, Gateway, wait_for};

fn days(usual: i64) -> i64 {
    std::env::var("BACKFILL_DAYS").ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

#[derive(Debug, Clone, PartialEq)]
enum Told {
    Number(f64),
    Text(String),
    Missing(String),
}

/// What has arrived of a day, by time: what each item tells of which series.
type DayOfItems = HashMap<i64, Vec<(String, Told)>>;

/// What a receiver knows after each item, beside what the history holds at that tick.
#[derive(Default)]
struct Comparison {
    known: HashMap<String, Told>,
    numbers: u64,
    ticks: u64,
}

impl Comparison {
    fn compare_tick(&mut self, at_ns: i64, series: &str, held: Told) {
        self.numbers += u64::from(matches!(held, Told::Number(_)));
        match self.known.get(series) {
            // What was never there is told by nobody.
            None => assert_eq!(held, Told::Missing("not_provided".into()), "{series} at {at_ns}"),
            Some(known) => assert_eq!(*known, held, "{series} at {at_ns}"),
        }
    }

    fn compare_day(&mut self, reader: &Reader, from_ns: i64, mut items: DayOfItems) {
        reader
            .for_each_chunk(&Query::between(from_ns, from_ns + DAY_NS), |chunk| {
                for (row, at_ns) in chunk.at_ns.iter().enumerate() {
                    self.known.extend(items.remove(at_ns).into_iter().flatten());
                    self.ticks += 1;
                    for (column, series) in chunk.series.iter().enumerate() {
                        let cells = &chunk.columns[column];
                        let held = match (cells.number_at(row), cells.word_at(row)) {
                            (Some(number), _) => Told::Number(number),
                            (_, Some(word)) => Told::Text(word.to_owned()),
                            _ => Told::Missing(chunk.missing_reason(column, row).unwrap_or("not_provided").to_owned()),
                        };
                        self.compare_tick(*at_ns, &series.name, held);
                    }
                }
                ControlFlow::Continue(())
            })
            .expect("reads");
        assert!(
            items.is_empty(),
            "{} items of ticks that the box has not, such as {:?}",
            items.len(),
            items.iter().next()
        );
    }

    /// Every tick of the history against what arrived of each day.
    fn of_everything(path: &Path, days: i64, mut arrived: impl FnMut(i64) -> DayOfItems) -> Self {
        let reader = Reader::open(path).expect("opens");
        let mut comparison = Self::default();
        for day in 0..days {
            let from_ns = START_NS + day * DAY_NS;
            comparison.compare_day(&reader, from_ns, arrived(from_ns));
        }
        comparison
    }
}

/// The elements of an array as psql prints it; none of them needs a quotation mark.
fn elements(text: &str) -> Vec<&str> {
    text.trim_matches(['{', '}']).split(',').filter(|element| !element.is_empty()).collect()
}

fn read_day_of_fleet(plant: &Plant, series: &HashMap<String, String>, from_ns: i64) -> DayOfItems {
    let rows = plant.postgres.sql(&format!(
        "SELECT at_ns, series, numbers, texts, reasons FROM items WHERE kind = 'sample' AND at >= fleet_time({from_ns}) AND at < fleet_time({})",
        from_ns + DAY_NS
    ));
    let parse = |row: &str| {
        let cells: Vec<&str> = row.split('|').collect();
        let numbers = elements(cells[2]).into_iter().map(|number| Told::Number(number.parse().expect("a number")));
        let texts = elements(cells[3]).into_iter().map(|text| Told::Text(text.to_owned()));
        let reasons = elements(cells[4]).into_iter().map(|reason| Told::Missing(reason.to_owned()));
        let names = elements(cells[1]).into_iter().map(|number| series[number].clone());
        (cells[0].parse().expect("a time"), names.zip(numbers.chain(texts).chain(reasons)).collect())
    };
    rows.lines().map(parse).collect()
}

/// Everything that is in the database of items and of what is made of them, but for when it came.
fn fingerprint(plant: &Plant) -> String {
    let tables = [
        ("items", "(box_id, epoch, sequence, at_ns, kind, series, numbers, texts, reasons, record)"),
        ("state_list", "(since, until, state, program)"),
        ("part_list", "(began, ended, energy_j)"),
        ("alarm_marks", "(at, raised, source, code)"),
        ("event_list", "(at, kind, text)"),
        ("gap_list", "(since, until, reason)"),
        ("minute_means", "(series_id, hour, mean, least, greatest, seconds)"),
        ("hour_means", "(series_id, day, mean, least, greatest, seconds)"),
        ("day_means", "(series_id, month, mean, least, greatest, seconds)"),
    ];
    let of = |(table, columns): (&str, &str)| {
        let sql = format!("SELECT count(*), sum(hashtextextended({columns}::text, 0)) FROM {table}");
        format!("{table}|{}", plant.postgres.sql(&sql))
    };
    tables.map(of).join("\n")
}

/// Records of the box beside those of the database, by time and content.
fn compare_records(plant: &Plant, path: &Path) -> usize {
    let reader = Reader::open(path).expect("opens");
    let all = RecordSpan::between(i64::MIN, i64::MAX, u32::MAX);
    let ask = |sql: &str| plant.postgres.sql(sql).lines().map(str::to_owned).collect::<Vec<_>>();
    let us = |time: &str| format!("(extract(epoch FROM {time}) * 1000000)::bigint");
    let states: Vec<String> = reader
        .read_states(all)
        .expect("reads")
        .into_iter()
        .map(|s| format!("{}|{}|{}", s.since_ns / 1000, s.state, s.program))
        .collect();
    // After the machine was off, the database goes on with the state that it had.
    let told = ask(&format!(
        "SELECT {}, record ->> 'state', record ->> 'program' FROM items WHERE kind = 'state' ORDER BY at",
        us("at")
    ));
    assert_eq!(told, states);
    let parts: Vec<String> = reader
        .read_parts(all)
        .expect("reads")
        .into_iter()
        .map(|p| format!("{}|{}", p.ended_ns / 1000, p.energy_j.expect("told")))
        .collect();
    assert_eq!(ask(&format!("SELECT {}, energy_j FROM part_list ORDER BY ended", us("ended"))), parts);
    let alarms: Vec<String> = reader
        .read_alarms(all)
        .expect("reads")
        .into_iter()
        .map(|a| {
            format!(
                "{}|{}|{}",
                a.raised_ns / 1000,
                a.cleared_ns.map_or(String::new(), |ns| (ns / 1000).to_string()),
                a.code
            )
        })
        .collect();
    assert_eq!(ask(&format!("SELECT {}, {}, code FROM alarms ORDER BY raised", us("raised"), us("cleared"))), alarms);
    let mut events: Vec<String> = reader
        .read_events(all)
        .expect("reads")
        .into_iter()
        .map(|e| format!("{}|{}|{}", e.at_ns / 1000, e.kind, e.text))
        .collect();
    let mut told = ask(&format!("SELECT {}, kind, text FROM event_list", us("at")));
    events.sort();
    told.sort();
    assert_eq!(told, events);
    states.len() + parts.len() + alarms.len() + events.len()
}

/// Means of minutes against those of the two ticks that each holds.
fn compare_minutes(plant: &Plant, days: i64) -> u64 {
    let mut compared = 0;
    for day in 0..days {
        let from_ns = START_NS + day * DAY_NS;
        let rows = plant.postgres.sql(&format!(
            "SELECT name, (extract(epoch FROM at) * 1000000000)::bigint, mean, least, greatest FROM minutes
             WHERE hour >= fleet_time({from_ns}) AND hour < fleet_time({})",
            from_ns + DAY_NS
        ));
        for row in rows.lines() {
            let cells: Vec<&str> = row.split('|').collect();
            let channel = CHANNELS.iter().position(|name| *name == cells[0]).expect("a channel");
            let tick = (cells[1].parse::<i64>().expect("a time") - START_NS) / TICK_NS;
            let number = |tick| slot_at(channel, tick).value.ok().and_then(|value| value.as_number());
            let held: Vec<f64> = [tick, tick + 1].into_iter().filter_map(number).collect();
            let expected = [
                held.iter().sum::<f64>() / held.len() as f64,
                held.iter().copied().fold(f64::INFINITY, f64::min),
                held.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            ];
            for (cell, expected) in cells[2..].iter().zip(expected) {
                let told: f64 = cell.parse().expect("a number");
                assert!((told - expected).abs() <= 1e-6 * expected.abs().max(1.0), "{row}: {expected}");
                compared += 1;
            }
        }
    }
    compared
}

/// How many items the command says that it has sent, in its last line: of a long stretch it tells every minute how far it is.
fn sent(said: &str) -> u64 {
    let told = said.lines().rev().find_map(|line| line.split_once(" items sent in ")?.0.trim().parse().ok());
    told.unwrap_or_else(|| panic!("{said}"))
}

/// How many ticks of the box were compared; `None` where a server is not installed.
fn through_nats(directory: &Path, days: i64) -> Option<u64> {
    let plant = Plant::start()?;
    let path = directory.join("history.db");
    let mut command = program_of_ingest(&plant);
    command.stdout(Stdio::piped());
    let reader = Gateway::spawn(command);
    let mut prints = Vec::new();
    for turn in 0..2 {
        let began = Instant::now();
        let said = resend((directory, 0.1), &plant.address, &[]);
        let sent_s = began.elapsed().as_secs_f64();
        let items = sent(&said);
        let settled = wait_for("everything is written", Duration::from_secs(3600), || {
            std::thread::sleep(Duration::from_millis(200));
            plant.has_read_everything().then(|| began.elapsed().as_secs_f64())
        });
        let rows = plant.postgres.number("SELECT count(*) FROM items");
        println!(
            "NATS, turn {turn}: {} {rows} rows in the database after {settled:.1} s ({sent_s:.1} s until sent): {:.0} rows/s",
            said.trim(),
            items as f64 / settled
        );
        assert_eq!(rows, items);
        assert_eq!(plant.postgres.number("SELECT count(*) FROM refused"), 0);
        prints.push(fingerprint(&plant));
    }
    let peak = testkit::process_status::status_figure(&reader.pid().to_string(), "VmHWM:").unwrap_or(0.0) / 1024.0;
    drop(reader);
    assert_eq!(prints[0], prints[1], "the second time changes nothing");
    let series: HashMap<String, String> = plant
        .postgres
        .sql("SELECT series_id, name FROM series")
        .lines()
        .map(|row| row.split_once('|').expect("two"))
        .map(|(id, name)| (id.to_owned(), name.to_owned()))
        .collect();
    let compared = Comparison::of_everything(&path, days, |from_ns| read_day_of_fleet(&plant, &series, from_ns));
    let records = compare_records(&plant, &path);
    let means = compare_minutes(&plant, days);
    println!(
        "NATS: {} ticks, {} numbers equal, 0 differ; {records} records and {means} figures of minutes equal; the reader took {peak:.0} MB at most\n{}",
        compared.ticks, compared.numbers, prints[1]
    );
    Some(compared.ticks)
}

fn program_of_ingest(plant: &Plant) -> Command {
    let mut command = process::program();
    command.args(["fleet", "ingest", &plant.address, "--max-gb", "4", "--database", &plant.postgres.address()]);
    command
}

/// A sample as `mosquitto_sub` prints it.
fn parse_sample(line: &str) -> Option<(i64, Vec<(String, Told)>)> {
    let document: Json = serde_json::from_str(line).expect("JSON");
    let tell = |value: &Json| {
        let told = match &value["value"] {
            Json::Number(number) => Told::Number(number.as_f64().expect("a number")),
            Json::String(text) => Told::Text(text.clone()),
            _ => Told::Missing(value["missing"].as_str().expect("a reason").to_owned()),
        };
        (value["name"].as_str().expect("a name").to_owned(), told)
    };
    (document["kind"] == "sample").then(|| {
        let values = document["values"].as_array().expect("values").iter().map(tell).collect();
        (document["at_ns"].as_i64().expect("a time"), values)
    })
}

fn read_day_of_lines(lines: &mut std::iter::Peekable<Lines<BufReader<std::fs::File>>>, from_ns: i64) -> DayOfItems {
    let mut items = DayOfItems::new();
    while let Some(Ok(line)) = lines.peek() {
        let sample = parse_sample(line);
        if sample.as_ref().is_some_and(|(at_ns, _)| *at_ns >= from_ns + DAY_NS) {
            break;
        }
        items.extend(sample);
        lines.next();
    }
    items
}

fn through_mqtt(directory: &Path, days: i64) -> Option<u64> {
    let client = program("mosquitto_sub")?;
    let broker = Broker::with("allow_anonymous true\nmax_queued_messages 0\n", |_| {})?;
    let mut texts = Vec::new();
    for turn in 0..2 {
        let file = directory.join(format!("{turn}.lines"));
        let mut listener = Command::new(&client);
        listener.args(["-h", "127.0.0.1", "-p", &broker.port.to_string(), "-t", "works/#", "-q", "1", "-c", "-i"]);
        let mut listener = listener
            .arg(format!("listener-{turn}"))
            .stdout(std::fs::File::create(&file).expect("made"))
            .spawn()
            .expect("it runs");
        std::thread::sleep(Duration::from_secs(1));
        let began = Instant::now();
        let said = resend((directory, 0.1), &format!("mqtt://127.0.0.1:{}/works", broker.port), &[]);
        let (items, took_s) = (sent(&said), began.elapsed().as_secs_f64());
        let count = || BufReader::new(std::fs::File::open(&file).expect("there")).lines().count() as u64;
        wait_for("every message", Duration::from_secs(600), || {
            std::thread::sleep(Duration::from_millis(500));
            (count() >= items).then_some(())
        });
        std::thread::sleep(Duration::from_secs(1));
        assert_eq!(count(), items, "each once");
        println!("MQTT, turn {turn}: {} {:.0} items/s", said.trim(), items as f64 / took_s);
        listener.kill().expect("killed");
        listener.wait().expect("ended");
        texts.push(file);
    }
    let same = Command::new("cmp").args(&texts).status().expect("cmp runs");
    assert!(same.success(), "the second time sends the same bytes");
    let mut lines = BufReader::new(std::fs::File::open(&texts[0]).expect("there")).lines().peekable();
    let compared = Comparison::of_everything(&directory.join("history.db"), days, |from_ns| {
        read_day_of_lines(&mut lines, from_ns)
    });
    println!("MQTT: {} ticks, {} numbers equal, 0 differ; twice the same bytes", compared.ticks, compared.numbers);
    Some(compared.ticks)
}

fn backfill(days: i64) {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("history.db");
    let began = Instant::now();
    let ticks = write_history(&path, days);
    let bytes = std::fs::metadata(&path).map_or(0, |metadata| metadata.len());
    println!(
        "{days} days: {ticks} ticks of {} series, {:.0} MB, written in {:.0} s",
        CHANNELS.len() + 1,
        bytes as f64 / 1e6,
        began.elapsed().as_secs_f64()
    );
    for compared in [through_nats(directory.path(), days), through_mqtt(directory.path(), days)].into_iter().flatten() {
        assert_eq!(compared, ticks, "every tick of the box is compared");
    }
}

#[test]
fn days_that_are_older_than_the_sink_arrive_as_the_box_has_them() {
    backfill(2);
}

#[test]
#[ignore = "20 minutes: 400 days of a box into an empty database and through a broker, twice, with every number compared; in release"]
fn four_hundred_days_arrive_as_the_box_has_them() {
    backfill(days(400));
}
