//! Power separation.

use crate::command::gateway;
use crate::machine::{idle, lathe, record};
use crate::{Coverage, LONG, SHORT};
use adapters::recording::{Cells, Numbers};
use gateway::twin::execute;
use rules::estimators::power_separation::identify_no_load;
use rules::script::{ScriptFile, compile};

#[test]
fn no_load_powers_are_found_and_written_as_a_script_can_say_them() {
    let ladder = [300.0, 600.0, 900.0].map(|rpm| idle(40.0, rpm, 1));
    let recorded = record(lathe(1), &ladder, 5.0);
    let directory = tempfile::tempdir().expect("a directory");
    std::fs::write(directory.path().join("idle.csv"), execute::csv(&recorded.recording)).expect("written");
    let arguments = ["identify", "no-load", "--recording", "idle.csv", "--json", "--out", "no_load.rhai"];
    let told = gateway(directory.path(), &arguments);
    assert_eq!(told.status.code(), Some(0), "{}", String::from_utf8_lossy(&told.stderr));
    let json: serde_json::Value = serde_json::from_slice(&told.stdout).expect("JSON");
    let speeds = json["learned"]["speeds"].as_array().expect("speeds");
    assert_eq!(speeds.len(), 3, "{json:#}");
    let text = std::fs::read_to_string(directory.path().join("no_load.rhai")).expect("written");
    let set = compile(&[ScriptFile { name: "no_load.rhai".to_owned(), text }]).expect("a script of settings");
    assert_eq!(set.len(), 1);
}

#[test]
fn a_recording_without_idling_is_refused() {
    let mut recording = record(lathe(1), &[idle(40.0, 600.0, 1)], 5.0).recording;
    let rows = recording.rows();
    recording.set_column("feed_mm_min", Cells::Numbers(Numbers::full(vec![120.0; rows])));
    let refusal = identify_no_load(&recording).expect_err("never idle");
    assert!(refusal.to_string().contains("let the spindle turn"), "{refusal}");
}

/// The level of one visit against the true mean over the same time.
fn levels(repetitions: u64) {
    let mut coverage = Coverage::new("level of one idle visit, W");
    for seed in 1..=repetitions {
        let mut settings = lathe(seed);
        settings.meter.zero_drift_w = 0.0;
        let recorded = record(settings, &[idle(40.0, 600.0, 1)], 5.0);
        let learned = identify_no_load(&recorded.recording).expect("idle");
        let visit = &learned.stretches[0];
        let truth = recorded.mean(visit.from_s, visit.to_s, |truth| truth.no_load_power_w);
        coverage.add(learned.speeds[0].interval_w, truth);
    }
    coverage.assert();
}

#[test]
fn the_level_of_a_visit_is_inside_its_interval() {
    levels(SHORT);
}

#[test]
#[ignore = "200 repetitions"]
fn the_level_of_a_visit_is_inside_its_interval_200_times() {
    levels(LONG);
}
