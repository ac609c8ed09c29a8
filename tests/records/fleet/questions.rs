//! Every question of the handbook and of the dashboard, against what three boxes have recorded.

use crate::fleet::pipeline::{Plant, Recorded};
use adapters::ChannelId;
use gateway::history::{Alarm, AlarmClear, Diagnosis, Part, StateChange};
use serde_json::{Value as Json, json};
use std::collections::BTreeMap;
use std::time::Duration;
use testkit::process::{run, stdout};

const SECOND_NS: i64 = 1_000_000_000;
/// Every tick is a second.
const SPAN_S: i64 = 8 * 3600;
const MACHINES: [&str; 3] = ["Lathe 7", "车床三号", "Mill 2"];

/// What a machine has done, as this test has made it.
#[derive(Debug, Default)]
struct Truth {
    power: f64,
    cutting_power: f64,
    seconds_by_state: BTreeMap<&'static str, f64>,
    parts: i64,
    energy_j: f64,
    part_s: f64,
    operations: i64,
    operation_j: f64,
    alarm_s: f64,
}

/// The second at which everything began: eight hours ago, so that questions about now find it.
fn start_ns() -> i64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).expect("after 1970");
    i64::try_from(since.as_secs()).expect("small") * SECOND_NS - SPAN_S * SECOND_NS - SECOND_NS
}

/// A cycle of ten minutes: standby, idle, cutting; a part at its end. An alarm in every third.
fn record(machine: &str, factor: f64, start_ns: i64, address: &str) -> Truth {
    let recorded = Recorded::start(machine, Duration::from_secs(1), address);
    let power = ChannelId::from_name("spindle_power_w").expect("in the table");
    let mut truth = Truth::default();
    let (mut state, mut sum, mut cutting) = ("", 0.0, 0.0);
    for second in 0..SPAN_S {
        let (at_ns, place) = (start_ns + second * SECOND_NS, second % 600);
        let next = match place {
            0..=59 => "standby",
            60..=119 => "idle",
            _ => "cutting",
        };
        let watts = match next {
            "standby" => 50.0,
            "idle" => 400.0,
            _ => 1000.0 * factor + (second % 7) as f64,
        };
        if next != state {
            state = next;
            let change =
                StateChange { at_ns, state: next.to_owned(), program: "O100".to_owned(), tool: "T1".to_owned() };
            recorded.writer().queue_record(change);
        }
        *truth.seconds_by_state.entry(next).or_default() += 1.0;
        sum += watts;
        cutting += if next == "cutting" { watts } else { 0.0 };
        recorded.tick(at_ns, &[(power, Ok(watts))], next);
        let cycle = second / 600;
        if cycle % 3 == 0 && place == 200 {
            let (code, source, severity) = ("overload".to_owned(), "own.rhai".to_owned(), "warning".to_owned());
            recorded.writer().queue_record(Alarm { at_ns, code, source, severity, ..Alarm::default() });
        }
        if cycle % 3 == 0 && place == 260 {
            let (code, source) = ("overload".to_owned(), "own.rhai".to_owned());
            recorded.writer().queue_record(AlarmClear { at_ns, code, source });
            truth.alarm_s += 60.0;
        }
        if place == 599 {
            let energy_j = 300_000.0 * factor;
            let operations = json!([{"operation": "rough", "seconds": 300.0, "cutting_s": 290.0, "energy_j": 200_000.0 * factor, "mean_power_w": 666.0},
                {"operation": "finish", "seconds": 200.0, "cutting_s": 180.0, "energy_j": 100_000.0 * factor, "mean_power_w": 500.0}]);
            recorded.writer().queue_record(Part {
                began_ns: at_ns - 599 * SECOND_NS,
                ended_ns: at_ns,
                part: format!("{cycle}"),
                program: "O100".to_owned(),
                count: 1,
                cutting_s: Some(470.0),
                energy_j: Some(energy_j),
                detail: json!({"seconds": {"cutting": 480.0}, "operations": operations}).to_string(),
            });
            truth.parts += 1;
            truth.energy_j += energy_j;
            truth.part_s += 599.0;
            truth.operations += 2;
            truth.operation_j += energy_j;
        }
    }
    let diagnosis = json!({"missing": [{"effect": "bearing_friction"}]}).to_string();
    let at_ns = start_ns + 100 * SECOND_NS;
    recorded.writer().queue_record(Diagnosis {
        at_ns,
        verdict: "explained".to_owned(),
        json: diagnosis,
        ..Diagnosis::default()
    });
    truth.power = sum / SPAN_S as f64;
    truth.cutting_power = cutting / truth.seconds_by_state["cutting"];
    recorded.stop();
    truth
}

/// The answer of a question that the program prints, as rows of cells.
fn asked(plant: &Plant, name: &str) -> Vec<Vec<String>> {
    let text = stdout(&run(&["fleet", "sql", name]));
    let rows = plant.postgres.sql(text.trim_end().trim_end_matches(';'));
    rows.lines().map(|row| row.split('|').map(str::to_owned).collect()).collect()
}

fn number(cell: &str) -> f64 {
    cell.parse().unwrap_or_else(|_| panic!("{cell:?} is no number"))
}

fn near(found: f64, expected: f64, what: &str) {
    assert!((found / expected - 1.0).abs() < 1e-3, "{what}: {found}, expected {expected}");
}

#[test]
fn every_question_is_answered_as_the_boxes_know() {
    let Some(plant) = Plant::start() else { return };
    let start_ns = start_ns();
    let truths: Vec<(&str, Truth)> = MACHINES
        .iter()
        .zip([1.0, 2.0, 0.5])
        .map(|(machine, factor)| (*machine, record(machine, factor, start_ns, &plant.address)))
        .collect();
    println!("{}", plant.ingest().trim());
    let of =
        |rows: &[Vec<String>], machine: &str| rows.iter().filter(|row| row[0] == machine).cloned().collect::<Vec<_>>();
    let means = asked(&plant, "mean-by-machine");
    let cutting = asked(&plant, "power-while-cutting");
    let hours = asked(&plant, "series-over-machines");
    let states = asked(&plant, "states-by-machine");
    let energy = asked(&plant, "energy-per-part");
    let oee = asked(&plant, "oee-per-shift");
    let now = asked(&plant, "machines-now");
    for (machine, truth) in &truths {
        // The last six of eight hours: all but the cycle at its beginning are whole.
        let mean = number(&of(&means, machine)[0][3]);
        assert!((mean / truth.power - 1.0).abs() < 0.01, "{mean}, expected {}", truth.power);
        let cut = &of(&cutting, machine)[0];
        near(number(&cut[1]), truth.cutting_power, "power while cutting");
        assert!((number(&cut[2]) / (6.0 * 0.8) - 1.0).abs() < 0.01, "eight minutes of ten, six hours: {cut:?}");
        let weighted: (f64, f64) = of(&hours, machine)
            .iter()
            .map(|row| (number(&row[2]) * number(&row[5]), number(&row[5])))
            .fold((0.0, 0.0), |sum, row| (sum.0 + row.0, sum.1 + row.1));
        near(weighted.0 / weighted.1, truth.power, "mean of the hours");
        near(weighted.1, SPAN_S as f64, "seconds of the hours");
        for row in of(&states, machine).iter().filter(|row| row[1] != "no_data") {
            near(number(&row[2]) * 3600.0, truth.seconds_by_state[row[1].as_str()], &row[1]);
        }
        let part = &of(&energy, machine)[0];
        near(number(&part[2]), truth.parts as f64, "parts");
        near(number(&part[3]) * 3.6e6, truth.energy_j, "energy");
        near(number(&part[5]), truth.part_s / truth.parts as f64, "seconds per part");
        assert_eq!(of(&now, machine)[0][1], "no_data", "each was stopped");
        let shifts = of(&oee, machine);
        let made: f64 = shifts.iter().map(|row| row[3].parse().unwrap_or(0.0)).sum();
        near(made, truth.parts as f64, "parts of the shifts");
        let known_h: f64 = shifts.iter().map(|row| row[7].parse().unwrap_or(0.0)).sum();
        near(known_h * 3600.0, SPAN_S as f64, "hours known");
        let at_work: f64 = shifts.iter().map(|row| row[4].parse().unwrap_or(0.0) * row[7].parse().unwrap_or(0.0)).sum();
        near(at_work * 3600.0, truth.seconds_by_state["idle"] + truth.seconds_by_state["cutting"], "time at work");
    }
    let by_day = asked(&plant, "energy-by-day");
    for (machine, truth) in &truths {
        let kwh: f64 = of(&by_day, machine).iter().map(|row| number(&row[2])).sum();
        near(kwh * 3.6e6, truth.power * SPAN_S as f64, "all energy, also between parts");
    }
    let operations = asked(&plant, "energy-per-operation");
    let total: f64 = operations.iter().map(|row| number(&row[5])).sum();
    near(total * 3.6e6, truths.iter().map(|(_, truth)| truth.operation_j).sum(), "energy of the operations");
    let times: f64 = operations.iter().map(|row| number(&row[2])).sum();
    near(times, truths.iter().map(|(_, truth)| truth.operations as f64).sum(), "operations");
    let alarms = asked(&plant, "alarms-by-code");
    near(number(&alarms[0][4]) * 60.0, truths.iter().map(|(_, truth)| truth.alarm_s).sum(), "minutes of alarms");
    assert_eq!(alarms[0][3], "3", "{alarms:?}");
    let finding = asked(&plant, "same-finding");
    assert_eq!(finding[0][..3], ["bearing_friction", "3", "3"]);
    views_of_the_handbook(&plant);
    the_dashboard(&plant);
}

/// What the handbook says of each view, on the same rows.
fn views_of_the_handbook(plant: &Plant) {
    let postgres = &plant.postgres;
    assert_eq!(
        postgres.sql("SELECT machine, connected FROM last_seen ORDER BY machine"),
        "Lathe 7|t\nMill 2|t\n车床三号|t"
    );
    let latest =
        "SELECT missing_reason IS NULL, number > 0 FROM latest WHERE name = 'spindle_power_w' AND machine = 'Mill 2'";
    assert_eq!(postgres.sql(latest), "t|t");
    assert_eq!(postgres.sql("SELECT text FROM latest WHERE name = 'machine_state' AND machine = 'Mill 2'"), "cutting");
    assert_eq!(
        postgres.number("SELECT count(*) FROM minutes WHERE machine = 'Mill 2' AND name = 'spindle_power_w'") / 10,
        48
    );
    assert_eq!(postgres.number("SELECT count(*) FROM items WHERE arrived < at - interval '1 minute'"), 0);
    let silent = "UPDATE box_latest SET last_arrival = now() - interval '1 hour'";
    postgres.sql(silent);
    assert_eq!(postgres.sql("SELECT DISTINCT state, connected FROM machines_now"), "no_data|f", "a box that has gone");
}

/// Every query of the dashboard for PostgreSQL, with the macros of Grafana replaced.
fn the_dashboard(plant: &Plant) {
    let printed = stdout(&run(&["metrics", "dashboard-fleet"]));
    let dashboard: Json = serde_json::from_str(&printed).expect("JSON");
    let filled = |sql: &str| {
        let mut sql = sql.to_owned();
        while let Some(start) = sql.find("$__timeFilter(") {
            let end = start + sql[start..].find(')').expect("closed");
            let column = sql[start + "$__timeFilter(".len()..end].to_owned();
            sql.replace_range(start..=end, &format!("{column} BETWEEN now() - interval '7 days' AND now()"));
        }
        sql.replace("$__timeFrom()", "(now() - interval '7 days')")
            .replace("$__timeTo()", "now()")
            .replace("$machine", "'Lathe 7', 'Mill 2'")
            .replace("$series", "spindle_power_w")
    };
    let (mut queries, mut rows) = (0, Vec::new());
    let mut look = |sql: &str, what: &str| {
        let answer = plant.postgres.sql(&filled(sql));
        queries += 1;
        rows.push((what.to_owned(), answer.lines().count()));
    };
    for variable in dashboard["templating"]["list"].as_array().expect("a list") {
        if let Some(sql) = variable["query"].as_str().filter(|_| variable["type"] == "query") {
            look(sql, variable["name"].as_str().expect("named"));
        }
    }
    for panel in dashboard["panels"].as_array().expect("a list") {
        for target in panel["targets"].as_array().into_iter().flatten() {
            look(target["rawSql"].as_str().expect("SQL"), panel["title"].as_str().expect("titled"));
        }
    }
    println!("{queries} queries of the dashboard: {rows:?}");
    assert!(queries >= 10 && rows.iter().filter(|(_, count)| *count > 0).count() >= queries - 2, "{rows:?}");
}
