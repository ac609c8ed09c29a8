//! Every panel of both dashboards shows what is true of a plant whose truth is known.

use crate::fleet::pipeline::Plant;
use serde_json::Value as Json;
use std::collections::BTreeMap;
use testkit::process::{run, stdout};

/// What Grafana has chosen: both machines, one series, the time of the plant.
const FROM: &str = "timestamptz '2026-10-24 12:00:00+00'";
const TO: &str = "timestamptz '2026-10-25 23:00:00+00'";

/// The questions of a dashboard, each with the title of its panel.
fn questions(dashboard: &str, key: &str) -> Vec<(String, String)> {
    let document: Json = serde_json::from_str(&stdout(&run(&["metrics", dashboard]))).expect("JSON");
    let mut found = Vec::new();
    for panel in document["panels"].as_array().expect("panels") {
        for target in panel["targets"].as_array().expect("targets") {
            let text = |of: &Json| of.as_str().expect("a text").to_owned();
            found.push((text(&panel["title"]), text(&target[key])));
        }
    }
    found
}

/// The panels that ask Prometheus; `panels_test.yml` holds the truth, and promtool compares.
#[test]
fn every_panel_of_a_box_shows_its_value() {
    let file = include_str!("../../../gateway/monitoring/panels_test.yml");
    let tests: BTreeMap<&str, &str> =
        file.split("      - expr: '").skip(1).filter_map(|test| test.split_once("'\n")).collect();
    for (title, asked) in questions("dashboard", "expr") {
        let asked = asked.replace("$instance", ".*").replace("$__rate_interval", "5m");
        let expected = tests.get(asked.as_str());
        assert!(
            expected.is_some_and(|samples| samples.contains("value: ")),
            "no value in panels_test.yml: {title}: {asked}"
        );
    }
    if let Some(said) = super::monitoring::promtool(&["test", "rules", "panels_test.yml"], "") {
        assert!(said.contains("SUCCESS"), "{said}");
    }
}

/// What a panel of the fleet asks, as Grafana sends it.
fn as_sent(question: &str) -> String {
    let mut sent = question.replace("$machine", "'Lathe 7', 'Mill 2'").replace("$series", "spindle_power_w");
    while let Some((before, rest)) = sent.split_once("$__timeFilter(") {
        let (column, after) = rest.split_once(')').expect("a column");
        sent = format!("{before}{column} BETWEEN {FROM} AND {TO}{after}");
    }
    sent.replace("$__timeFrom()", FROM).replace("$__timeTo()", TO)
}

/// A panel: its title, the columns without times, and the rows.
type Panel = (&'static str, &'static [usize], &'static [&'static str]);

const PANELS: [Panel; 12] = [
    ("Machines now", &[0, 1, 5], &["Lathe 7 (A)|no_data|f", "Lathe 7 (B)|no_data|t", "Mill 2|cutting|t"]),
    ("Machines by state", &[0, 1], &["cutting|1", "no_data|2"]),
    ("Boxes that are silent", &[0], &["Lathe 7 (A)"]),
    (
        "States of each machine",
        &[1, 2],
        &[
            "Lathe 7 (A)|cutting",
            "Lathe 7 (A)|cutting",
            "Lathe 7 (A)|no_data",
            "Lathe 7 (A)|standby",
            "Lathe 7 (A)|standby",
            "Lathe 7 (B)|idle",
            "Lathe 7 (B)|no_data",
            "Mill 2|cutting",
        ],
    ),
    (
        "$series, mean of the hour",
        &[1, 2],
        &[
            "Lathe 7 (A)|500",
            "Lathe 7 (A)|700",
            "Lathe 7 (A)|700",
            "Lathe 7 (B)|200",
            "Lathe 7 (B)|200",
            "Lathe 7 (B)|200",
        ],
    ),
    ("$series, mean of the minute", &[1, 2], &["Lathe 7 (A)|400", "Lathe 7 (A)|600"]),
    ("Energy by machine and day", &[1, 2], &["Lathe 7 (A)|0.5", "Lathe 7 (A)|2", "Lathe 7 (B)|0.6"]),
    ("Energy for a part", &[0, 1, 2, 3, 4, 5], &["Lathe 7 (A)|O1|2|2|1000|14400", "Mill 2|O2|2|||1800"]),
    ("Mean power of each operation", &[1, 2], &["Lathe 7 (A) rough|333", "Lathe 7 (A) rough|333"]),
    ("Wear of the tool in use", &[1, 2], &["Lathe 7 (A)|0.125", "Lathe 7 (A)|0.25"]),
    ("Alarms", &[2, 3, 4, 5], &["Lathe 7 (A)|overload|own.rhai|warning", "Lathe 7 (B)|overload|own.rhai|warning"]),
    ("Refused messages", &[1, 2], &["cnc.A.sample|no JSON"]),
];

/// The panels that ask the database, in the plant of `shifts.sql`; A has been silent for an hour.
pub(super) fn every_panel_of_the_fleet(plant: &Plant) {
    plant.postgres.sql(include_str!("panels.sql"));
    let asked = questions("dashboard-fleet", "rawSql");
    assert_eq!(asked.len(), PANELS.len(), "a panel without a test");
    for ((title, question), (of, columns, expected)) in asked.iter().zip(PANELS) {
        assert_eq!(title, of);
        let keep = |row: &str| {
            let cells: Vec<&str> = row.split('|').collect();
            columns.iter().map(|column| cells[*column]).collect::<Vec<_>>().join("|")
        };
        let mut rows: Vec<String> = plant.postgres.sql(&as_sent(question)).lines().map(keep).collect();
        rows.sort();
        assert_eq!(rows, expected, "{title}");
    }
}
