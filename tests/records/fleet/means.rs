//! Means of the database against the means of what was recorded, with stretches in which the machine or the box was off.
//!
//! `FLEET_HZ=10 cargo test --test records fleet::means -- --nocapture`

use crate::fleet::pipeline::{Plant, Recorded};
use adapters::{Absence, ChannelId};
use gateway::history::StateChange;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::collections::BTreeMap;
use std::time::Duration;
use testkit::process::{run, stdout, text};

/// Some hours before a full hour of UTC.
const START_NS: i64 = 1_760_000_400 * 1_000_000_000;
const HOURS: i64 = 6;

/// Channels that change often, seldom, and by steps; the value in each.
const CHANNELS: [&str; 12] = [
    "spindle_power_w",
    "total_power_w",
    "spindle_speed_rpm",
    "feed_mm_min",
    "spindle_current_a",
    "spindle_load_pct",
    "x_axis_load_pct",
    "bearing_temperature_c",
    "coolant_temperature_c",
    "ambient_temperature_c",
    "supply_voltage_v",
    "feed_override_pct",
];

/// What happens to a machine: stretches of seconds from the beginning.
struct Story {
    machine: &'static str,
    /// The box has no ticks.
    box_off: &'static [(i64, i64)],
    /// The machine is switched off, and the box says so.
    machine_off: &'static [(i64, i64)],
    seed: u64,
}

const STORIES: [Story; 3] = [
    Story { machine: "Lathe 7", box_off: &[(4000, 7600)], machine_off: &[(10_000, 13_000)], seed: 1 },
    Story { machine: "车床三号", box_off: &[], machine_off: &[(0, 1800), (5000, 5060), (20_000, 21_600)], seed: 2 },
    Story { machine: "Mill 2", box_off: &[(100, 1300), (15_000, 15_007)], machine_off: &[(8000, 8600)], seed: 3 },
];

fn within(stretches: &[(i64, i64)], second: f64) -> bool {
    stretches.iter().any(|(from, to)| second >= *from as f64 && second < *to as f64)
}

/// Mean and seconds of each channel, as they were recorded.
type Truth = BTreeMap<&'static str, (f64, f64)>;

/// Records and sends six hours; a box that was off is opened again.
fn record(story: &Story, hz: i64, address: &str) -> (Truth, tempfile::TempDir) {
    let ids = CHANNELS.map(|name| ChannelId::from_name(name).expect("in the table"));
    let tick = Duration::from_nanos(1_000_000_000 / hz.unsigned_abs());
    let mut rng = Pcg64::seed_from_u64(story.seed);
    let mut recorded = Recorded::start(story.machine, tick, address);
    let mut values: Vec<f64> = vec![500.0; CHANNELS.len()];
    let (mut sums, mut counts) = (vec![0.0; CHANNELS.len()], vec![0_u64; CHANNELS.len()]);
    let (mut cutting, mut was_off) = (false, false);
    for index in 0..HOURS * 3600 * hz {
        let second = index as f64 / hz as f64;
        let at_ns = START_NS + index * (1_000_000_000 / hz);
        if within(story.box_off, second) {
            was_off = true;
            continue;
        }
        if std::mem::take(&mut was_off) {
            let directory = recorded.stop();
            recorded = Recorded::again(directory, story.machine, tick, address);
        }
        if rng.random_bool(1.0 / (60.0 * hz as f64)) {
            cutting = !cutting;
            let state = if cutting { "cutting" } else { "standby" };
            recorded.writer().queue_record(StateChange { at_ns, state: state.to_owned(), ..StateChange::default() });
        }
        let off = within(story.machine_off, second);
        for (place, value) in values.iter_mut().enumerate() {
            // Power and feed change at every tick of a cut and stand still outside; the others now and then.
            *value = match place {
                0..=3 if cutting => 3000.0 + 1000.0 * rng.random::<f64>(),
                0..=3 => 40.0,
                _ if rng.random_bool(0.002) => 10.0 + 90.0 * rng.random::<f64>(),
                _ => *value,
            };
            *value = (*value * 10.0).round() / 10.0;
        }
        let cells: Vec<_> = ids
            .iter()
            .zip(&values)
            .map(|(id, value)| (*id, if off { Err(Absence::MachineOff) } else { Ok(*value) }))
            .collect();
        recorded.tick(
            at_ns,
            &cells,
            if off {
                "off"
            } else if cutting {
                "cutting"
            } else {
                "standby"
            },
        );
        for (place, value) in values.iter().enumerate().filter(|_| !off) {
            sums[place] += value;
            counts[place] += 1;
        }
    }
    let truth = CHANNELS
        .iter()
        .enumerate()
        .map(|(place, name)| (*name, (sums[place] / counts[place] as f64, counts[place] as f64 / hz as f64)));
    (truth.collect(), recorded.stop())
}

/// Mean and seconds by machine and channel.
fn asked(plant: &Plant, question: &str) -> BTreeMap<(String, String), (f64, f64)> {
    let row = |line: &str| {
        let cells: Vec<&str> = line.split('|').collect();
        let number = |index: usize| cells[index].parse::<f64>().expect("a number");
        ((cells[0].to_owned(), cells[1].to_owned()), (number(2), number(3)))
    };
    plant.postgres.sql(question).lines().map(row).collect()
}

/// The greatest difference of a mean, and of the time for which something is known.
fn compare(what: &str, found: &BTreeMap<(String, String), (f64, f64)>, truths: &[(&str, Truth)]) -> (f64, f64) {
    let (mut worst, mut time) = (0.0_f64, 0.0_f64);
    for (machine, truth) in truths {
        for (channel, (mean, seconds)) in truth {
            let (found_mean, found_s) = found[&((*machine).to_owned(), (*channel).to_owned())];
            worst = worst.max((found_mean / mean - 1.0).abs());
            time = time.max((found_s / seconds - 1.0).abs());
        }
    }
    println!("{what}: greatest difference of 36 means {:.4} %, of the time known {:.4} %", 100.0 * worst, 100.0 * time);
    (worst, time)
}

#[test]
fn means_of_twelve_channels_over_six_hours_with_gaps_are_those_of_the_history() {
    let Some(plant) = Plant::start() else { return };
    let hz = std::env::var("FLEET_HZ").ok().and_then(|text| text.parse().ok()).unwrap_or(1);
    let recorded: Vec<(&str, Truth, tempfile::TempDir)> = STORIES
        .iter()
        .map(|story| {
            let (truth, directory) = record(story, hz, &plant.address);
            (story.machine, truth, directory)
        })
        .collect();
    println!("{}", plant.ingest().trim());
    let truths: Vec<(&str, Truth)> = recorded.iter().map(|(machine, truth, _)| (*machine, truth.clone())).collect();
    let weighted = "SELECT machine, name, sum(number * seconds) / sum(seconds), sum(seconds) FROM readings WHERE number IS NOT NULL AND seconds > 0 GROUP BY machine, name";
    let of = |table: &str| {
        format!(
            "SELECT machine, name, sum(mean * seconds) / sum(seconds), sum(seconds) FROM {table} GROUP BY machine, name"
        )
    };
    let plain = "SELECT machine, name, avg(number), 1 FROM readings WHERE number IS NOT NULL GROUP BY machine, name";
    let naive = compare("avg(number) over changes, as it should not be asked", &asked(&plant, plain), &truths);
    assert!(naive.0 > 0.05, "this test would not notice");
    for (what, question) in
        [("readings", weighted.to_owned()), ("minutes", of("minutes")), ("hours", of("hours")), ("days", of("days"))]
    {
        let (mean, time) = compare(what, &asked(&plant, &question), &truths);
        assert!(mean < 0.001 && time < 0.001, "{what}: {mean} {time}");
    }
    history_says_the_same(&recorded);
    // A box that was off is a stretch of its own, and its machine keeps its state no longer than it was heard.
    let gaps = plant.postgres.sql(
        "SELECT machine, round(extract(epoch FROM until - since)) FROM gaps WHERE until IS NOT NULL ORDER BY 1, 2",
    );
    assert_eq!(gaps, "Lathe 7|3600\nMill 2|7\nMill 2|1200");
    let known = "SELECT machine, round(sum(extract(epoch FROM coalesce(until, last_at) - since))) FROM state_list JOIN last_seen USING (box_id)
                 WHERE state <> 'no_data' GROUP BY machine ORDER BY machine";
    println!("seconds of known states: {}", plant.postgres.sql(known).replace('\n', ", "));
    let silent = plant.postgres.sql("SELECT machine, connected, state FROM machines_now ORDER BY machine");
    assert_eq!(silent, "Lathe 7|t|no_data\nMill 2|t|no_data\n车床三号|t|no_data", "each was stopped cleanly");
    assert_eq!(plant.postgres.sql("SELECT count(*) FROM (SELECT box FROM boxes GROUP BY box) AS each"), "3");
}

/// `history query` over the same six hours, from the summaries of the box.
fn history_says_the_same(recorded: &[(&str, Truth, tempfile::TempDir)]) {
    let mut worst = 0.0_f64;
    for (_, truth, directory) in recorded {
        let statement = "SELECT name, sum(mean * count) / sum(count) AS mean FROM hours JOIN series ON series.id = hours.series GROUP BY name";
        let file = directory.path().join("history.db");
        let said = run(&["history", "query", "--history", text(&file), "--sql", statement, "--json"]);
        let answer: serde_json::Value = serde_json::from_str(&stdout(&said)).expect("JSON");
        let rows = answer["rows"].as_array().expect("rows");
        for (channel, (mean, _)) in truth {
            let row = rows.iter().find(|row| row["name"] == *channel).expect(channel);
            worst = worst.max((row["mean"].as_f64().expect("a number") / mean - 1.0).abs());
        }
    }
    println!("the history itself: greatest difference {:.4} %", 100.0 * worst);
    assert!(worst < 0.001);
}
