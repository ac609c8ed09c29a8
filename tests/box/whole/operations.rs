//! The operations recipe in a running box: what it fills in, how it is edited, and what the history keeps of it.

use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::time::Duration;
use testkit::process::{Gateway, get, run, stdout, text, wait_for};

fn recipe(depth: &str) -> String {
    let entry = |program: &str, diameter: f64| {
        format!(
            "[[operation]]\nprogram = \"{program}\"\nname = \"turning {program}\"\ndepth_of_cut_mm = {depth}\n\
             diameter_mm = {diameter}\nwork_material = \"45# steel\"\n"
        )
    };
    format!("schema = \"operations/1\"\n{}{}{}", entry("O1001", 79.0), entry("O1002", 120.0), entry("O1003", 60.0))
}

fn furnish(directory: &Path) {
    let config = "[gateway]\nname = \"Lathe\"\n[[source]]\naddress = \"simulated://lathe?annotations=no\"\n\
                  [operations]\npath = \"operations.toml\"\n";
    fs::write(directory.join("cnc-gateway.toml"), config).expect("written");
    fs::write(directory.join("operations.toml"), recipe("1.5")).expect("written");
}

/// The whole file in one step, as an editor that renames does.
fn write(path: &Path, text: &str) {
    let beside = path.with_extension("new");
    fs::write(&beside, text).expect("written");
    fs::rename(&beside, path).expect("renamed");
}

/// Every text or number that a channel had.
fn seen(database: &Path, channel: &str) -> BTreeSet<String> {
    let arguments = ["history", "query", "--history", text(database), "--json", "--channels", channel];
    let answer: Value = serde_json::from_str(&stdout(&run(&arguments))).expect("JSON");
    let points = answer["series"][0]["points"].as_array().expect("points").clone();
    points.iter().filter(|point| !point[1].is_null()).map(|point| point[1].to_string()).collect()
}

#[test]
fn a_recipe_fills_in_what_no_controller_says_and_is_edited_while_the_box_runs() {
    let directory = tempfile::tempdir().expect("a directory");
    furnish(directory.path());
    let (data, table) = (directory.path().join("data"), directory.path().join("operations.toml"));
    let config = directory.path().join("cnc-gateway.toml");
    let mut gateway = Gateway::start(&data, &["--config", text(&config), "--speed", "20"]);
    let address = gateway.address();
    let status = || get(&address, "/api/v1/status").json();
    let number = |status: &Value, name: &str| {
        // There are none before the first tick.
        let channels = status["channels"].as_array()?.clone();
        channels.iter().find(|channel| channel["name"] == name).and_then(|channel| channel["value"].as_f64())
    };
    let wait = |what: &str, depth: f64| {
        wait_for(what, Duration::from_secs(60), || {
            Some(status()).filter(|it| number(it, "depth_of_cut_mm") == Some(depth))
        })
    };
    let first = wait("the recipe's depth", 1.5);
    let version = first["operations"]["version"].as_str().expect("a version").to_owned();
    assert!(
        first["operations"]["in_force"].as_str().is_some_and(|it| it.contains(&version)),
        "{}",
        first["operations"]
    );

    write(&table, &recipe("1500"));
    let refused = wait_for("the refusal", Duration::from_secs(60), || {
        Some(status()).filter(|it| it["operations"]["error"].is_string())
    });
    assert_eq!(refused["operations"]["version"], version.as_str(), "the one before stays");
    assert!(refused["operations"]["error"].as_str().is_some_and(|it| it.contains("operations.toml:5:19")));
    assert!(refused["problems"].to_string().contains("stays in force"), "{}", refused["problems"]);

    write(&table, &recipe("2.5"));
    wait_for("the new version", Duration::from_secs(60), || {
        Some(status()).filter(|it| it["operations"]["version"] != version.as_str())
    });
    let second = wait("the new depth", 2.5);
    assert!(second["operations"]["error"].is_null());
    gateway.signal("TERM");
    assert!(gateway.wait().success(), "{}", gateway.said());

    let database = data.join("history.db");
    assert_eq!(seen(&database, "depth_of_cut_mm"), BTreeSet::from(["1.5".to_owned(), "2.5".to_owned()]));
    assert_eq!(seen(&database, "work_material"), BTreeSet::from(["\"45# steel\"".to_owned()]));
    let marks = seen(&database, "recipe");
    assert!(seen(&database, "program").contains("\"O0\""), "a program without an entry");
    assert!(marks.iter().any(|mark| mark.contains(&version)) && marks.len() >= 2, "{marks:?}");
    let arguments = ["history", "query", "--history", text(&database), "--json", "--records", "events"];
    let events = stdout(&run(&arguments));
    assert!(events.contains("recipe_in_force") && events.contains("recipe_refused"), "{events}");
    assert!(events.contains("depth_of_cut_mm = 2.5"), "the text of every version is kept: {events}");
}
