//! Every question in a small plant whose truth is known: shifts east of UTC and over the night in which the clocks go back, standby between
//! parts, a shift without parts, two boxes whose machines have one name.

use crate::fleet::panels::every_panel_of_the_fleet;
use crate::fleet::pipeline::Plant;
use std::time::Instant;
use testkit::process::{run, stdout};

/// The moment at which the plant is asked.
const NOW: &str = "2026-10-25 23:00:00+00";

/// The rows of a question at that moment, numbers with four digits.
fn ask(plant: &Plant, name: &str) -> Vec<String> {
    let question = stdout(&run(&["fleet", "sql", name])).replace("now()", &format!("timestamptz '{NOW}'"));
    let began = Instant::now();
    let rows = plant.postgres.sql(question.trim_end().trim_end_matches(';'));
    println!("{name}: {} rows in {:.3} s", rows.lines().count(), began.elapsed().as_secs_f64());
    let round = |cell: &str| cell.parse::<f64>().map_or_else(|_| cell.to_owned(), |number| format!("{number:.4}"));
    rows.lines().map(|row| row.split('|').map(round).collect::<Vec<_>>().join("|")).collect()
}

#[test]
fn every_shift_of_a_plant_of_known_truth_has_its_value() {
    let Some(plant) = Plant::start() else { return };
    // The tables are made by the first reader.
    plant.ingest();
    plant.postgres.sql(include_str!("shifts.sql"));
    assert_eq!(plant.postgres.sql("SHOW jit"), "off", "compiling the question for OEE took 3 s, running it 2 ms");
    // Machine, shift, day, parts, availability, performance, OEE, hours known; empty where nothing is known.
    let rows = ask(&plant, "oee-per-shift");
    let has = |row: &str| assert!(rows.contains(&row.to_owned()), "{row} is not among {rows:#?}");
    // Nine hours, because the clocks went back; 6 h of them at work; two parts of 2.5 h in 6 h of work, without the standby.
    has("Lathe 7 (A)|night|2026-10-24|2.0000|0.6667|0.8333|0.5556|9.0000|||");
    // No part: performance and OEE are not known, whatever the availability.
    has("Lathe 7 (B)|night|2026-10-24||1.0000|||9.0000|||");
    // In Shanghai it is seven in the morning of the next day, and the early shift runs.
    has("Mill 2|early|2026-10-26|2.0000|1.0000|1.0000|1.0000|1.0000|||");
    // Of the first part of A two thirds lie in the late shift of UTC, which it did not end in.
    has("Lathe 7 (A)|late|2026-10-24||1.0000|0.8333|0.8333|2.0000|||");
    assert!(rows.iter().all(|row| !row.contains("early|2026-10-26|2.0000") || row.starts_with("Mill 2")), "{rows:#?}");
    every_panel_of_the_fleet(&plant);
    // Whatever the time zone of whoever asks: behind UTC, and ahead of it by half an hour beside whole ones.
    for zone in ["America/New_York", "Asia/Kolkata"] {
        plant.postgres.sql(&format!("ALTER DATABASE postgres SET timezone TO '{zone}'"));
        assert_eq!(ask(&plant, "oee-per-shift"), rows, "{zone}");
        every_other_question(&plant, zone);
    }
    told_facts(&plant);
    let labels = plant.postgres.sql("SELECT label FROM labels ORDER BY box_id");
    assert_eq!(labels, "Lathe 7 (A)\nLathe 7 (B)\nMill 2");
}

/// What the plant tells of lathe A changes availability and quality of its shifts, and of no other.
fn told_facts(plant: &Plant) {
    let before = ask(plant, "oee-per-shift");
    plant.postgres.sql(include_str!("facts.sql"));
    let rows = ask(plant, "oee-per-shift");
    let has = |row: &str| assert!(rows.contains(&row.to_owned()), "{row} is not among {rows:#?}");
    // Planned from 22:00 to 03:00; 3 h of these 5 at work. One of two parts is scrap. 0.6 x 0.8333 x 0.5.
    has("Lathe 7 (A)|night|2026-10-24|2.0000|0.6000|0.8333|0.2500|9.0000|0.5000|1.0000|5.0000");
    // Before the first plan everything that is known counts; after it, nothing was planned of a shift without one.
    has("Lathe 7 (A)|late|2026-10-24||1.0000|0.8333|0.8333|2.0000|||");
    has("Lathe 7 (A)|late|2026-10-25||||||||");
    let others =
        |rows: &[String]| rows.iter().filter(|row| !row.starts_with("Lathe 7 (A)")).cloned().collect::<Vec<_>>();
    assert_eq!(others(&rows), others(&before));
    let orders = ask(plant, "energy-per-order").into_iter().map(|row| {
        let cells: Vec<&str> = row.split('|').collect();
        [0, 1, 4, 5, 6, 7, 8].map(|column| cells[column]).join("|")
    });
    assert_eq!(
        orders.collect::<Vec<_>>(),
        ["Lathe 7 (A)|A-1|10.0000|1.0000||1.0000|1000.0000", "Lathe 7 (A)|A-2||1.0000|1.0000|1.0000|"]
    );
    assert_eq!(ask(plant, "stops-by-reason"), ["Lathe 7 (A)|setup|1.0000|2.0000"]);
}

/// Each question that stands in `fleet sql` for PostgreSQL, without its columns of time.
fn every_other_question(plant: &Plant, zone: &str) {
    let answers: [(&str, &[usize], &[&str]); 10] = [
        ("machines-now", &[0, 1, 3, 4], &["Lathe 7 (A)|no_data||", "Lathe 7 (B)|no_data||", "Mill 2|cutting||"]),
        (
            "mean-by-machine",
            &[0, 1, 2, 3, 4],
            &["Lathe 7 (B)|spindle_power_w|W|200.0000|3.0000", "Mill 2|spindle_power_w|W|991.8033|1.0167"],
        ),
        ("power-while-cutting", &[0, 1, 2], &["Mill 2|1000.0000|1.0000"]),
        (
            "energy-by-day",
            &[0, 1, 2],
            &["Lathe 7 (A)|2026-10-24|0.5000", "Lathe 7 (A)|2026-10-25|2.0000", "Lathe 7 (B)|2026-10-25|0.6000"],
        ),
        ("energy-per-part", &[0, 1, 2, 3, 4, 5], &["Lathe 7 (A)|O1|2.0000|2.0000|1000.0000|14400.0000"]),
        ("energy-per-operation", &[0, 1, 2, 3, 4, 5, 6], &["O1|rough|2.0000|10800.0000|10500.0000|1.0000|333.3333"]),
        ("alarms-by-code", &[0, 1, 2, 3, 4], &["overload|own.rhai|2.0000|2.0000|30.0000"]),
        (
            "same-finding",
            &[0, 1, 2, 5],
            &["bearing_friction|2.0000|2.0000|Lathe 7 (A), Mill 2", "coolant_drag|1.0000|1.0000|Mill 2"],
        ),
        (
            "states-by-machine",
            &[0, 1, 2],
            &[
                "Lathe 7 (A)|no_data|18.0000",
                "Lathe 7 (A)|cutting|6.0000",
                "Lathe 7 (A)|standby|3.0000",
                "Lathe 7 (B)|no_data|18.0000",
                "Lathe 7 (B)|idle|9.0000",
                "Mill 2|cutting|1.0000",
            ],
        ),
        (
            "series-over-machines",
            &[0, 2, 5],
            &[
                "Lathe 7 (A)|500.0000|3600.0000",
                "Lathe 7 (A)|700.0000|3600.0000",
                "Lathe 7 (A)|700.0000|3600.0000",
                "Lathe 7 (B)|200.0000|3600.0000",
                "Lathe 7 (B)|200.0000|3600.0000",
                "Lathe 7 (B)|200.0000|3600.0000",
            ],
        ),
    ];
    for (name, columns, expected) in answers {
        let keep = |row: String| {
            let cells: Vec<&str> = row.split('|').collect();
            columns.iter().map(|column| cells[*column]).collect::<Vec<_>>().join("|")
        };
        let rows: Vec<String> = ask(plant, name).into_iter().map(keep).collect();
        assert_eq!(rows, expected, "{name} in {zone}");
    }
    let listed = stdout(&run(&["fleet", "sql"]));
    let elsewhere = ["tables", "oee-per-shift", "energy-per-order", "stops-by-reason"];
    let of_lake = |name: &&str| name.ends_with("-parquet") || name.ends_with("-clickhouse");
    let asked = |name: &&str| elsewhere.contains(name) || answers.iter().any(|(of, _, _)| of == name);
    let names = listed.trim().split(", ").filter(|name| !of_lake(name));
    assert_eq!(names.filter(|name| !asked(name)).collect::<Vec<_>>(), Vec::<&str>::new(), "questions without a test");
}
