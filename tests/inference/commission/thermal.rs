//! A thermal law from `identify` to the box: prediction, residual and pulses in the history, the offset before the gate, and a law
//! that readings correct.

use crate::commission::Person;
use serde_json::Value;
use testkit::thermal_machine::ThermalMachine;

/// The machine has been moved since the identification: its error is off by so much.
const SHIFT_UM: f64 = 12.0;
/// A probe reads the error so often, s.
const PROBE_S: usize = 600;

/// The rows of a recording at 1 Hz with the error where the probe reads it, moved.
fn probed(csv: &str) -> String {
    let mut lines = csv.lines();
    let head = lines.next().expect("a head");
    let at = head.split(',').position(|name| name == "thermal_error_um").expect("a column");
    let mut text = format!("{head}\n");
    for (row, line) in lines.enumerate() {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        let error: f64 = cells[at].parse().expect("a number");
        cells[at] = if row % PROBE_S < 3 { format!("{:.3}", error + SHIFT_UM) } else { String::new() };
        text.push_str(&cells.join(","));
        text.push('\n');
    }
    text
}

fn numbers(person: &Person<'_>, column: &str) -> Vec<f64> {
    let question = format!("SELECT {column} AS x FROM samples WHERE {column} IS NOT NULL ORDER BY at_ns");
    let (out, _) = person.runs(&["history", "query", "--history", "data/history.db", "--sql", &question, "--json"], 0);
    let told: Value = serde_json::from_str(&out).expect("JSON");
    told["rows"].as_array().expect("rows").iter().filter_map(|row| row["x"].as_f64()).collect()
}

#[test]
fn the_box_runs_a_thermal_law_that_readings_correct() {
    let directory = tempfile::tempdir().expect("a directory");
    let person = Person { directory: directory.path(), machine: crate::commission::MACHINES[0], did: Vec::new() };
    let recorded = ThermalMachine::new(5).tests(6, 240);
    let (learned, later) = (recorded.rows_of(0..5 * 240), recorded.rows_of(5 * 240..6 * 240).every_second());
    std::fs::write(directory.path().join("warm.csv"), learned.csv()).expect("written");
    std::fs::write(directory.path().join("later.csv"), probed(&later.csv())).expect("written");
    person.runs(&["identify", "thermal", "--recording", "warm.csv", "--model", "law.json", "--machine", "Mill 3"], 0);
    let configuration = |name: &str| {
        format!(
            "[gateway]\nname = \"{name}\"\ndata_dir = \"data\"\ntick_hz = 1.0\n\n[http]\nenabled = false\n\n[thermal]\nmodel = \"law.json\"\n\
             propose = true\n\n[gate.offset]\nmode = \"shadow\"\naxes = \"z\"\n\n[[source]]\naddress = \"replay:later.csv?speed=max\"\n"
        )
    };
    let elsewhere = configuration("Mill 4").replace("\"data\"", "\"other\"");
    std::fs::write(directory.path().join("box.toml"), elsewhere).expect("written");
    // The law of another machine stops nothing but itself.
    let (said, other) = person.runs(&["run", "--config", "box.toml", "--speed", "max"], 0);
    assert!(format!("{said}{other}").contains("was identified for machine \"Mill 3\""), "{said}{other}");
    std::fs::write(directory.path().join("box.toml"), configuration("Mill 3")).expect("written");
    person.runs(&["check", "--config", "box.toml"], 0);
    person.runs(&["run", "--config", "box.toml", "--speed", "max"], 0);
    let residuals = numbers(&person, "thermal_residual_um");
    let (first, last) = (residuals[0], residuals[residuals.len() - 1]);
    let readings = numbers(&person, "thermal_readings");
    let pulses = numbers(&person, "thermal_pulses");
    let (predicted, offsets) = (numbers(&person, "thermal_predicted_um"), numbers(&person, "thermal_offset_um"));
    println!(
        "residual {first:.1} -> {last:.1} um after {} readings; {} predictions; offset {:.1} um, {} pulses",
        readings[readings.len() - 1],
        predicted.len(),
        offsets[offsets.len() - 1],
        pulses[pulses.len() - 1]
    );
    assert!(first.abs() > 0.5 * SHIFT_UM && last.abs() < 0.5 * first.abs(), "{residuals:?}");
    assert!(predicted.len() > 10_000 && pulses.iter().all(|it| it.fract() == 0.0));
    assert!((pulses[pulses.len() - 1] - offsets[offsets.len() - 1]).abs() < 1.0, "a pulse is a micrometre");
    let question = "SELECT count(*) AS n FROM decisions WHERE script = '[thermal]'";
    let (out, _) = person.runs(&["history", "query", "--history", "data/history.db", "--sql", question, "--json"], 0);
    let told: Value = serde_json::from_str(&out).expect("JSON");
    assert!(told["rows"][0]["n"].as_i64().is_some_and(|n| n > 0), "{out}");
    assert!(directory.path().join("data/thermal.json").exists());
}
