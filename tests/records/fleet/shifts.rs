//! OEE by shift in a small plant whose truth is known: shifts east of UTC and over the night in which the clocks go back, standby between
//! parts, a shift without parts, two boxes whose machines have one name.

use crate::fleet::pipeline::Plant;
use std::time::Instant;
use testkit::process::{run, stdout};

/// Machine, shift, day, parts, availability, performance, OEE, hours known; empty where nothing is known.
fn ask(plant: &Plant, now: &str) -> Vec<String> {
    let question = stdout(&run(&["fleet", "sql", "oee-per-shift"])).replace("now()", &format!("timestamptz '{now}'"));
    let began = Instant::now();
    let rows = plant.postgres.sql(question.trim_end().trim_end_matches(';'));
    println!("{now}: {} rows in {:.3} s", rows.lines().count(), began.elapsed().as_secs_f64());
    let round = |cell: &str| cell.parse::<f64>().map_or_else(|_| cell.to_owned(), |number| format!("{number:.4}"));
    rows.lines().map(|row| row.split('|').map(round).collect::<Vec<_>>().join("|")).collect()
}

#[test]
fn every_shift_of_a_plant_of_known_truth_has_its_value() {
    let Some(plant) = Plant::start() else { return };
    // The tables are made by the first reader.
    plant.ingest();
    plant.postgres.sql(include_str!("shifts.sql"));
    let rows = ask(&plant, "2026-10-25 23:00:00+00");
    let has = |row: &str| assert!(rows.contains(&row.to_owned()), "{row} is not among {rows:#?}");
    // Nine hours, because the clocks went back; 6 h of them at work; two parts of 2.5 h in 6 h of work, without the standby.
    has("Lathe 7 (A)|night|2026-10-24|2.0000|0.6667|0.8333|0.5556|9.0000");
    // No part: performance and OEE are not known, whatever the availability.
    has("Lathe 7 (B)|night|2026-10-24||1.0000|||9.0000");
    // In Shanghai it is seven in the morning of the next day, and the early shift runs.
    has("Mill 2|early|2026-10-26|2.0000|1.0000|1.0000|1.0000|1.0000");
    // Of the first part of A two thirds lie in the late shift of UTC, which it did not end in.
    has("Lathe 7 (A)|late|2026-10-24||1.0000|0.8333|0.8333|2.0000");
    assert!(rows.iter().all(|row| !row.contains("early|2026-10-26|2.0000") || row.starts_with("Mill 2")), "{rows:#?}");
    let labels = plant.postgres.sql("SELECT label FROM labels ORDER BY box_id");
    assert_eq!(labels, "Lathe 7 (A)\nLathe 7 (B)\nMill 2");
}
