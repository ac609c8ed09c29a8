//! Recordings too long to be fitted row by row: named from an excerpt, told over every row.

use serde_json::Value as Json;
use std::time::Instant;
use testkit::axis::{MODEL, Noise, recording};
use testkit::command::gateway;

/// Diagnoses `runs` runs of 200 rows with a dry friction of 20 N that the model lacks: the answer, the lines of
/// `--rows` and the seconds taken.
fn diagnosed(runs: usize) -> (Json, String, f64) {
    let bench = tempfile::tempdir().expect("a directory");
    let path = |name: &str| bench.path().join(name);
    std::fs::write(path("m.toml"), MODEL).expect("writable");
    std::fs::write(path("r.csv"), recording(runs, 20.0, &mut Noise::new(11))).expect("writable");
    let begun = Instant::now();
    let files = ["--model", "m.toml", "--recording", "r.csv", "--json", "d.json", "--rows", "d.csv"];
    let output = gateway(bench.path(), &[&["diagnose"], &files[..]].concat());
    let seconds = begun.elapsed().as_secs_f64();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |name: &str| std::fs::read_to_string(path(name)).expect("written");
    (serde_json::from_str(&read("d.json")).expect("JSON"), read("d.csv"), seconds)
}

#[test]
fn a_long_recording_is_named_from_pieces_and_told_over_every_row() {
    let (diagnosis, rows, _) = diagnosed(140);
    assert_eq!(diagnosis["missing"][0]["effect"], "dry_friction", "{:#}", diagnosis["missing"]);
    let level = &diagnosis["missing"][0]["parameters"][0];
    let bound = |name: &str| level[name].as_f64().expect("a number");
    assert!(bound("low") < 20.0 && 20.0 < bound("high"), "{level}");
    assert_eq!(diagnosis["fit"]["rows"], 28_000);
    assert_eq!(diagnosis["fit"]["runs"], 140);
    assert_eq!(diagnosis["fit"]["held_out_runs"].as_array().map(Vec::len), Some(35));
    let spans = diagnosis["mismatch"][0]["spans"].as_array().expect("spans");
    let last = spans.iter().filter(|span| span["run"] == "140").count();
    assert!(spans.len() >= 140 && last > 0, "spans are complete: {} of them", spans.len());
    assert_eq!(rows.lines().count(), 28_001);
    let header: Vec<&str> = rows.lines().next().expect("a header").split(',').collect();
    let effect = header.iter().position(|name| *name == "effect_dry_friction").expect("a column");
    let every: Vec<f64> = rows
        .lines()
        .skip(1)
        .map(|row| row.split(',').nth(effect).and_then(|x| x.parse().ok()).expect("a number"))
        .collect();
    let moving = every.iter().filter(|x| (x.abs() - 20.0).abs() < 1.0).count();
    assert!(moving > 21_000, "the friction acts in every moving row, of any run: {moving}");
}

/// Of more than 30,000 rows one in so many is compared.
#[test]
fn of_a_longer_recording_every_second_row_is_compared_and_every_row_has_a_line() {
    let (diagnosis, rows, _) = diagnosed(200);
    assert_eq!(diagnosis["missing"][0]["effect"], "dry_friction", "{:#}", diagnosis["missing"]);
    assert_eq!(diagnosis["fit"]["rows"], 20_000);
    assert_eq!(rows.lines().count(), 40_001);
}

#[test]
#[ignore = "1 minute: time and name for 100,000 and a million rows"]
fn a_million_rows() {
    let (diagnosis, rows, seconds) = diagnosed(5000);
    assert_eq!(rows.lines().count(), 1_000_001);
    println!("{seconds:.1} s for 1,000,000 rows with --rows: {}", diagnosis["missing"][0]["effect"]);
}
