//! `fleet resend`: a stretch of the history into a database that has lost it, or has never had it; nothing comes twice.

use crate::fleet::pipeline::{Plant, Recorded};
use adapters::ChannelId;
use gateway::history::{Alarm, AlarmClear, Event, Part, StateChange};
use std::path::Path;
use std::time::{Duration, Instant};
use testkit::process::{run, stderr, stdout};

const SECOND_NS: i64 = 1_000_000_000;
const TICK: Duration = Duration::from_secs(1);
/// 2026-01-30 10:00:00 UTC.
const START_NS: i64 = 1_769_767_200 * SECOND_NS;

fn record(recorded: &Recorded, ticks: std::ops::Range<i64>) {
    let power = ChannelId::from_name("spindle_power_w").expect("in the table");
    for tick in ticks {
        let at_ns = START_NS + tick * SECOND_NS;
        if tick % 120 == 0 {
            let state = ["idle", "cutting"][usize::from(tick % 240 == 0)].to_owned();
            recorded.writer().queue_record(StateChange {
                at_ns,
                state,
                program: "O1".into(),
                ..StateChange::default()
            });
        }
        let (code, source) = ("overload".to_owned(), "own.rhai".to_owned());
        match tick % 600 {
            30 => recorded.writer().queue_record(Alarm { at_ns, code, source, ..Alarm::default() }),
            90 => recorded.writer().queue_record(AlarmClear { at_ns, code, source }),
            200 => recorded.writer().queue_record(Event { at_ns, kind: "mark".into(), ..Event::default() }),
            599 => recorded.writer().queue_record(Part {
                began_ns: at_ns - 500 * SECOND_NS,
                ended_ns: at_ns,
                count: 1,
                energy_j: Some(1234.5),
                ..Part::default()
            }),
            _ => None,
        };
        recorded.tick(at_ns, &[(power, Ok((tick % 701) as f64))], "cutting");
    }
}

/// What the views say of the box; the gap at the end of a run is told only by the run itself.
fn told(plant: &Plant) -> String {
    [
        "SELECT at_ns, name, number, text FROM readings ORDER BY at_ns, name",
        "SELECT since, state, program FROM states WHERE state <> 'no_data' ORDER BY since",
        "SELECT began, ended, energy_j FROM parts ORDER BY ended",
        "SELECT raised, cleared, code FROM alarms ORDER BY raised",
        "SELECT at, kind FROM events WHERE kind = 'mark' ORDER BY at",
        "SELECT at, name, mean, least, greatest, seconds FROM minutes ORDER BY at, name",
        "SELECT at, name, mean, seconds FROM hours ORDER BY at, name",
    ]
    .map(|sql| plant.postgres.sql(sql))
    .join("\n--\n")
}

/// Sends a history in this directory, of a box that ticks so often a second, and gives what was said.
pub(crate) fn resend((directory, tick_hz): (&Path, f64), address: &str, more: &[&str]) -> String {
    let config = directory.join("box.toml");
    let (data, history) = (directory.display(), directory.join("history.db"));
    let text = format!(
        "[gateway]\nname = \"Lathe 7\"\ndata_dir = \"{data}\"\ntick_hz = {tick_hz}\n[history]\npath = \"{}\"\n\
         [[source]]\nname = \"lathe\"\naddress = \"simulated://lathe\"\n[[sink]]\nname = \"fleet\"\naddress = \"{address}\"\n",
        history.display()
    );
    std::fs::write(&config, text).expect("writable");
    let config = config.display().to_string();
    let mut arguments = vec!["fleet", "resend", "--config", &config, "--sink", "fleet", "--rate", "1000000"];
    arguments.extend_from_slice(more);
    let done = run(&arguments);
    assert!(done.status.success(), "{}", stderr(&done));
    stdout(&done)
}

#[test]
fn what_is_sent_once_more_fills_an_empty_database_and_nothing_comes_twice() {
    let (Some(first), Some(second)) = (Plant::start(), Plant::start()) else { return };
    let hours: i64 = std::env::var("RESEND_HOURS").ok().and_then(|text| text.parse().ok()).unwrap_or(2);
    let recorded = Recorded::start("Lathe 7", TICK, &first.address);
    record(&recorded, 0..hours * 3600);
    assert_eq!(recorded.refused(), 0);
    let directory = recorded.stop();
    first.ingest();
    let original = told(&first);
    // Into the database that has everything.
    println!("{}", resend((directory.path(), 1.0), &first.address, &[]).trim());
    println!("known already: {}", first.ingest().trim());
    assert_eq!(told(&first), original, "nothing comes twice");
    // Into one that has nothing: first a part, then everything, then everything again.
    let part = ["--from", "2026-01-30T10:20:00Z", "--to", "2026-01-30T10:40:00Z"];
    resend((directory.path(), 1.0), &second.address, &part);
    second.ingest();
    let samples = "SELECT count(*) FROM items WHERE kind = 'sample'";
    assert_eq!(second.postgres.number(samples), 1200);
    for turn in 0..2 {
        let began = Instant::now();
        println!("{turn}: {}", resend((directory.path(), 1.0), &second.address, &[]).trim());
        println!("{} in {:.1} s", second.ingest().trim(), began.elapsed().as_secs_f64());
        assert_eq!(told(&second), original, "{turn}");
        assert_eq!(second.postgres.number(samples), hours.unsigned_abs() * 3600);
    }
}
