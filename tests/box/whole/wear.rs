//! The wear model beside a running machine: from the library to the limit, the wear and the alarm.

use gateway::history::store_wear_model;
use rules::estimators::wear::{Cut, CutConditions, WearKey, WearModel, WearRecord, fit_physical};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::time::Duration;
use testkit::process::{Gateway, get, run, stderr, text, wait_for};

/// Roughly what the cuts of the simulated lathe take, W.
fn law(conditions: &CutConditions) -> f64 {
    let [wear, speed, feed, depth] = conditions.to_vector();
    (980.0 * feed.powf(0.75) * (speed / 150.0).powf(-0.08) + 22.0 + 190.0 * wear) * depth * speed / 60.0
}

/// A model of that law over the cuts of the simulated programs; scatter of a few watts.
fn record(criterion_mm: f64) -> WearRecord {
    let mut cuts = Vec::new();
    for (index, wear) in [0.0, 0.2, 0.4, 0.6].into_iter().enumerate() {
        for speed in [120.0, 190.0, 260.0] {
            for (feed, depth) in [(0.09, 0.3), (0.16, 1.0), (0.26, 2.0), (0.26, 0.3), (0.09, 2.0)] {
                let conditions = CutConditions::from_vector([wear, speed, feed, depth]);
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
    let witness = ["probably pass its wear criterion", "more than the limit of the wear model"]
        .iter()
        .any(|it| worn.contains(it));
    assert!(worn.contains("\"tool_worn_T") && witness, "{worn}");
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

/// Three of each condition, all with all, as a table with one row for each cut.
fn table() -> String {
    let mut text =
        "time_s,flank_wear_mm,cutting_speed_m_min,feed_per_rev_mm,depth_of_cut_mm,cutting_power_w\n".to_owned();
    let mut rows = 0;
    for wear in [0.05, 0.2, 0.35] {
        for speed in [120.0, 190.0, 260.0] {
            for feed in [0.09, 0.16, 0.26] {
                for depth in [0.3, 1.0, 2.0] {
                    let scatter = f64::from(rows * 7 % 5 - 2) * 2.0;
                    let power = law(&CutConditions::from_vector([wear, speed, feed, depth])) + scatter;
                    text.push_str(&format!("{rows},{wear},{speed},{feed},{depth},{power}\n"));
                    rows += 1;
                }
            }
        }
    }
    text
}

#[test]
fn identify_tells_the_page_how_the_model_was_found() {
    let directory = tempfile::tempdir().expect("a directory");
    furnish(directory.path(), 0.25);
    let (data, cuts) = (directory.path().join("data"), directory.path().join("cuts.csv"));
    fs::write(&cuts, table()).expect("written");
    let config = directory.path().join("cnc-gateway.toml");
    let mut gateway = Gateway::start(&data, &["--config", text(&config)]);
    let address = gateway.address();
    let asked = || get(&address, "/api/v1/identified/tool-wear").json();
    assert!(asked()["identified"].is_null(), "nothing has been identified yet");
    let learn = ["identify", "tool-wear", "--recording", text(&cuts), "--each-row"];
    let store = ["--store", text(&data.join("history.db"))].map(str::to_owned);
    // Recordings of any machine: nothing is kept where no box is named.
    assert!(run(&learn).status.success());
    assert!(asked()["identified"].is_null(), "kept for nobody");
    let named = learn.iter().map(|it| (*it).to_owned()).chain(store).collect::<Vec<String>>();
    let output = run(&named.iter().map(String::as_str).collect::<Vec<&str>>());
    assert!(output.status.success(), "{}", stderr(&output));
    let kept = data.join("identified").join("tool-wear.json");
    assert!(String::from_utf8_lossy(&output.stdout).contains(text(&kept)), "it says where the answer stands");
    let found = asked();
    let sources = found["identified"]["learned"]["surface"]["anova"]["sources"].as_array().cloned().unwrap_or_default();
    assert!(sources.len() >= 4 && sources[0]["f"].is_number(), "{found:#}");
    // The same with the data directory in words, and refused cuts do not take its place.
    fs::remove_file(&kept).expect("it is there");
    let by_name: Vec<&str> = learn.into_iter().chain(["--data-dir", text(&data)]).collect();
    assert!(run(&by_name).status.success());
    let answer = fs::read(&kept).expect("kept again");
    fs::write(&cuts, table().lines().take(4).collect::<Vec<&str>>().join("\n")).expect("written");
    assert_eq!(run(&by_name).status.code(), Some(1), "three cuts are refused");
    assert_eq!(fs::read(&kept).expect("still there"), answer);
    gateway.stop();
}
