//! The wear model beside a running machine: from the library to the limit, the wear and the alarm.

use super::process::{Gateway, get, run, stderr, text, wait_for};
use gateway::history::store_wear_model;
use rules::estimators::wear::{Cut, CutConditions, WearKey, WearModel, WearRecord, fit_physical};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::time::Duration;

/// Roughly what the cuts of the simulated lathe take, W.
fn law(conditions: &CutConditions) -> f64 {
    let [wear, speed, feed, depth] = conditions.vector();
    (980.0 * feed.powf(0.75) * (speed / 150.0).powf(-0.08) + 22.0 + 190.0 * wear) * depth * speed / 60.0
}

/// A model of that law over the cuts of the simulated programs; scatter of a few watts.
fn record(criterion_mm: f64) -> WearRecord {
    let mut cuts = Vec::new();
    for (index, wear) in [0.0, 0.2, 0.4, 0.6].into_iter().enumerate() {
        for speed in [120.0, 190.0, 260.0] {
            for (feed, depth) in [(0.09, 0.3), (0.16, 1.0), (0.26, 2.0), (0.26, 0.3), (0.09, 2.0)] {
                let conditions = CutConditions::of([wear, speed, feed, depth]);
                let scatter = if (cuts.len() + index).is_multiple_of(2) { 4.0 } else { -4.0 };
                cuts.push(Cut { conditions, cutting_power_w: law(&conditions) + scatter });
            }
        }
    }
    let found = fit_physical(&cuts, &[]).expect("a fit");
    let key = WearKey { machine: "Lathe".to_owned(), ..WearKey::default() };
    WearRecord::new(key, criterion_mm, ("test".to_owned(), cuts.len(), found.r2), WearModel::Physical(found.physical))
}

fn furnish(directory: &Path, wear_mm: f64) {
    let config =
        format!("[gateway]\nname = \"Lathe\"\n[[source]]\naddress = \"simulated://lathe?wear_mm={wear_mm}\"\n");
    fs::write(directory.join("cnc-gateway.toml"), config).expect("written");
}

/// Runs the machine for so long; the alarms of the history.
fn alarms(criterion_mm: f64, seconds: &str) -> String {
    let directory = tempfile::tempdir().expect("a directory");
    furnish(directory.path(), 0.005);
    let data = directory.path().join("data");
    fs::create_dir_all(&data).expect("created");
    let database = data.join("history.db");
    store_wear_model(&database, 1, &record(criterion_mm)).expect("stored");
    let config = directory.path().join("cnc-gateway.toml");
    // So slow that the library has been read long before the first cut.
    let mut gateway = Gateway::start(&data, &["--config", text(&config), "--speed", "300", "--for", seconds]);
    assert!(gateway.wait_at_most(Duration::from_secs(240)).success(), "{}", gateway.said());
    let output = run(&["history", "query", "--history", text(&database), "--json", "--records", "alarms"]);
    assert!(output.status.success(), "{}", stderr(&output));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn a_worn_edge_is_told_and_a_sharp_one_is_not() {
    let worn = alarms(0.15, "14400");
    assert!(worn.contains("\"tool_worn\"") && worn.contains("probably pass its wear criterion"), "{worn}");
    let sharp = alarms(0.5, "1800");
    assert!(!sharp.contains("tool_worn"), "{sharp}");
}

#[test]
fn the_limit_and_the_wear_are_shown_and_a_model_stored_meanwhile_is_taken() {
    let directory = tempfile::tempdir().expect("a directory");
    furnish(directory.path(), 0.25);
    let data = directory.path().join("data");
    let config = directory.path().join("cnc-gateway.toml");
    let mut gateway = Gateway::start(&data, &["--config", text(&config), "--speed", "20"]);
    let address = gateway.address();
    assert!(get(&address, "/api/v1/status").json()["wear"].is_null(), "no model, no wear");
    store_wear_model(&data.join("history.db"), 1, &record(0.4)).expect("stored while the box writes");
    let shown = wait_for("a wear", Duration::from_secs(90), || {
        let status: Value = get(&address, "/api/v1/status").json();
        status["wear"]["flank_wear_mm"].is_number().then(|| status["wear"].clone())
    });
    assert_eq!(shown["criterion_mm"], 0.4);
    assert!(shown["limit_w"].as_f64().is_some_and(|limit_w| limit_w > 100.0), "{shown}");
    assert!(shown["flank_wear_uncertainty_mm"].as_f64().is_some_and(|half_mm| half_mm > 0.0), "{shown}");
    assert!(
        ["observable", "observable_over_parts", "not_observable_here"]
            .contains(&shown["observability"].as_str().unwrap_or_default())
    );
    gateway.signal("TERM");
    assert!(gateway.wait().success(), "{}", gateway.said());
}
