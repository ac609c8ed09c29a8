//! Facts that the plant adds, through every door of a running box into history, fleet and figures: each once, whatever is sent twice.

use crate::fleet::pipeline::{Plant, Recorded};
use adapters::ChannelId;
use gateway::history::{Part, StateChange};
use gateway::machine_path::NamedMachine;
use serde_json::{Value as Json, json};
use std::collections::BTreeMap;
use std::process::{Command, Stdio};
use std::time::Duration;
use testkit::broker::{Broker, program};
use testkit::process::{Answer, Gateway, get, request, run, stderr, stdout, text, wait_for};

const SECOND_NS: i64 = 1_000_000_000;
const PATH: &str = "shanghai/line-2/lathe-7";

/// An hour at work before now with a part in each quarter, in a history that a box goes on with; gives its directory and beginning.
fn worked_hour(plant: &Plant) -> (tempfile::TempDir, i64) {
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).expect("after 1970");
    let first_s = i64::try_from(now.as_secs()).expect("small") - 3900;
    let machine = NamedMachine { name: "Lathe 7".to_owned(), path: Some(PATH.parse().expect("a path")) };
    let recorded = Recorded::start(machine, Duration::from_secs(1), &plant.address);
    let power = ChannelId::from_name("spindle_power_w").expect("in the table");
    let (state, program) = ("cutting".to_owned(), "O1".to_owned());
    let at_ns = first_s * SECOND_NS;
    recorded.writer().queue_record(StateChange { at_ns, state, program: program.clone(), tool: String::new() });
    for second in 0..3600 {
        let at_ns = (first_s + second) * SECOND_NS;
        recorded.tick(at_ns, &[(power, Ok(1000.0))], "cutting");
        if second % 900 == 899 {
            let (began_ns, program) = (at_ns - 899 * SECOND_NS, program.clone());
            let part = Part { began_ns, ended_ns: at_ns, program, count: 1, energy_j: Some(9e5), ..Part::default() };
            recorded.writer().queue_record(part);
        }
    }
    (recorded.stop(), first_s)
}

fn utc(second: i64) -> String {
    gateway::moment::format_utc(second * SECOND_NS)
}

/// A running box with its doors.
struct Doors {
    page: String,
    tokens: BTreeMap<&'static str, String>,
    broker: u16,
}

impl Doors {
    fn post(&self, who: &str, kind: &str, more: &str, body: &str) -> Answer {
        let authorization = self.tokens.get(who).map(|token| format!("Authorization: Bearer {who}:{token}\r\n"));
        let (page, length) = (&self.page, body.len());
        request(
            page,
            &format!(
                "POST /api/v1/facts HTTP/1.0\r\nHost: {page}\r\n{}Content-Type: {kind}\r\n{more}Content-Length: {length}\r\n\r\n{body}",
                authorization.unwrap_or_default()
            ),
        )
    }

    /// Publishes a fact, and gives what the box answers.
    fn publish(&self, prefix: &str, body: &str) -> Option<Json> {
        let port = self.broker.to_string();
        let (publish, subscribe) = (program("mosquitto_pub")?, program("mosquitto_sub")?);
        let answers = format!("{prefix}/fact/answer");
        let listening = Command::new(subscribe)
            .args(["-h", "localhost", "-p", &port, "-t", &answers, "-C", "1", "-W", "5"])
            .stdout(Stdio::piped())
            .spawn()
            .expect("it runs");
        std::thread::sleep(Duration::from_millis(500));
        let topic = format!("{prefix}/fact/add");
        let sent =
            Command::new(publish).args(["-h", "localhost", "-p", &port, "-q", "1", "-t", &topic, "-m", body]).status();
        assert!(sent.expect("it runs").success());
        serde_json::from_slice(&listening.wait_with_output().expect("it ends").stdout).ok()
    }
}

fn start(data: &std::path::Path, plant: &Plant, broker: &Broker) -> (Gateway, Doors) {
    let config = data.join("gateway.toml");
    let port = broker.port;
    let written = format!(
        "[gateway]\nname = \"Lathe 7\"\npath = \"shanghai/line-2\"\nmachine = \"lathe-7\"\n[[source]]\naddress = \"simulated://lathe?seed=3\"\n\
         [[sink]]\nname = \"fleet\"\naddress = \"{}\"\n\
         [[sink]]\nname = \"plant\"\naddress = \"mqtt://127.0.0.1:{port}/open\"\nallow_facts = true\n\
         [[sink]]\nname = \"deaf\"\naddress = \"mqtt://127.0.0.1:{port}/deaf\"\n",
        plant.address
    );
    std::fs::write(&config, written).expect("writable");
    let token = |name: &str, role: &str| {
        let made = run(&["person", "add", name, "--role", role, "--json", "--data-dir", text(data)]);
        let told: Json = serde_json::from_str(&stdout(&made)).unwrap_or_else(|_| panic!("{}", stderr(&made)));
        told["token"].as_str().expect("a token").to_owned()
    };
    let tokens = BTreeMap::from([("li", token("li", "setter")), ("wang", token("wang", "viewer"))]);
    let mut gateway = Gateway::start(data, &["--config", text(&config)]);
    let page = gateway.address();
    wait_for("every sink is connected", Duration::from_secs(60), || {
        let status = get(&page, "/api/v1/status").json();
        status["sinks"].as_array()?.iter().all(|sink| sink["state"] == "connected").then_some(())
    });
    (gateway, Doors { page, tokens, broker: port })
}

/// Each fact through its door, and once more; nobody may who has no right to.
fn tell_everything(doors: &Doors, first_s: i64) {
    let at = |second: i64| utc(first_s + second);
    let scrap = json!({"fact": "scrap", "parts": 1, "value": "chatter", "at": at(1000)}).to_string();
    assert_eq!(doors.post("nobody", "application/json", "", &scrap).status, 401);
    assert_eq!(doors.post("wang", "application/json", "", &scrap).status, 403, "a viewer changes nothing");
    let on_page = json!({"fact": "operator", "value": "Li Wei", "at": at(10)}).to_string();
    let table = format!(
        "fact,at,until,value,parts,id\nplanned_time,{},{},,,plan-1\nstop_reason,{},{},no material,,\norder,{},,,,\nscrap,{},,dropped,1,\n",
        at(0),
        at(1800),
        at(3600),
        at(3700),
        at(3600),
        at(2000)
    );
    let order = json!({"facts": [{"fact": "order", "value": "A-4711", "parts": 10, "at": at(-5), "id": "mes-1"}, {"fact": "shift", "value": "early", "at": at(0)}]}).to_string();
    for (stored, known) in [(true, false), (false, true)] {
        let count = |answer: Answer, facts: u64| {
            assert_eq!(answer.status, 200, "{}", answer.body);
            let told = answer.json();
            let expected = (if stored { facts } else { 0 }, if known { facts } else { 0 });
            assert_eq!(
                (told["stored"].as_u64(), told["known"].as_u64()),
                (Some(expected.0), Some(expected.1)),
                "{told}"
            );
        };
        count(doors.post("li", "application/json", "", &scrap), 1);
        count(doors.post("li", "application/json", "X-Door: page\r\n", &on_page), 1);
        count(doors.post("li", "text/csv; charset=utf-8", "", &table), 4);
        let answer = doors.publish("open", &order).expect("answered");
        let expected = if stored { "2 stored, 0 known already" } else { "0 stored, 2 known already" };
        assert_eq!((&answer["done"], &answer["text"]), (&json!(true), &json!(expected)));
    }
    let wrong = doors.publish("open", r#"{"fact":"scrab","parts":1}"#).expect("answered");
    assert!(
        wrong["done"] == false && wrong["text"].as_str().is_some_and(|text| text.contains("did you mean scrap?")),
        "{wrong}"
    );
    assert_eq!(doors.publish("deaf", &order), None, "nobody listens where nothing is allowed");
    let refused = doors.post("li", "text/csv", "", "fact,parts\nscrap,1\nscrap,many\n");
    assert!(refused.status == 400 && refused.body.contains("line 3"), "{}", refused.body);
}

fn ask(plant: &Plant, name: &str) -> Vec<Vec<String>> {
    let question = stdout(&run(&["fleet", "sql", name]));
    let rows = plant.postgres.sql(question.trim_end().trim_end_matches(';'));
    rows.lines().map(|row| row.split('|').map(str::to_owned).collect()).collect()
}

fn number(cell: &str) -> f64 {
    cell.parse().unwrap_or(0.0)
}

#[test]
fn each_fact_is_once_in_history_fleet_and_figures_whatever_its_door() {
    let (Some(plant), Some(broker)) = (Plant::start(), Broker::start()) else { return };
    let (directory, first_s) = worked_hour(&plant);
    let (gateway, doors) = start(directory.path(), &plant, &broker);
    tell_everything(&doors, first_s);
    wait_for("the facts are stored and sent", Duration::from_secs(30), || {
        let status = get(&doors.page, "/api/v1/status").json();
        let rows = get(&doors.page, "/api/v1/facts?from=-2h&to=now").json()["rows"].as_array()?.len();
        (rows == 8 && status["sinks"][0]["behind_items"].as_u64() < Some(30)).then_some(())
    });
    gateway.stop();

    let database = directory.path().join("history.db");
    let said = run(&[
        "history",
        "query",
        "--history",
        text(&database),
        "--records",
        "facts",
        "--from",
        "2020-01-01",
        "--json",
    ]);
    let stored: Json = serde_json::from_str(&stdout(&said)).unwrap_or_else(|_| panic!("{}", stderr(&said)));
    let mut told: Vec<String> = stored["rows"]
        .as_array()
        .expect("rows")
        .iter()
        .map(|row| {
            let word = |name: &str| row[name].as_str().unwrap_or("-").to_owned();
            format!("{} {} {} {}", word("way"), word("fact"), word("value"), row["parts"])
        })
        .collect();
    told.sort();
    let expected = [
        "csv order - null",
        "csv planned_time - null",
        "csv scrap dropped 1",
        "csv stop_reason no material null",
        "http scrap chatter 1",
        "page operator Li Wei null",
        "plant order A-4711 10",
        "plant shift early null",
    ];
    assert_eq!(told, expected, "each once");
    let audit = run(&["history", "audit", "--json", "--history", text(&database)]);
    let audit: Json = serde_json::from_str(&stdout(&audit)).expect("JSON");
    let rows = audit["rows"].as_array().expect("rows");
    assert_eq!(rows.iter().filter(|row| row["kind"] == "fact" && row["outcome"] == "stored").count(), 8);
    assert!(run(&["history", "audit", "--verify", "--history", text(&database)]).status.success());

    plant.ingest();
    figures_of_the_plant(&plant);
}

/// Each fact once in the database, and the figures that they make.
fn figures_of_the_plant(plant: &Plant) {
    let sql = |statement: &str| plant.postgres.sql(statement);
    assert_eq!(sql("SELECT count(*), count(DISTINCT mark) FROM fact_list"), "8|8");
    assert_eq!(sql("SELECT DISTINCT path FROM facts"), PATH);
    assert_eq!(sql("SELECT count(*) FROM refused"), "0");
    // An hour may lie in two shifts: their sums are those of the hour.
    let shifts: Vec<_> = ask(plant, "oee-per-shift").into_iter().filter(|row| row[0] == PATH).collect();
    let sum = |column: usize| shifts.iter().map(|row| number(&row[column])).sum::<f64>();
    let (parts, scrap, planned_h) = (sum(3), sum(9), sum(10));
    assert!((parts - 4.0).abs() < 1.5 && scrap == 2.0 && (planned_h - 0.5).abs() < 1e-9, "{shifts:?}");
    let planned_work_h: f64 = shifts.iter().map(|row| number(&row[4]) * number(&row[10])).sum();
    assert!((planned_work_h - 0.5).abs() < 1e-3, "at work the whole planned time: {shifts:?}");
    for row in shifts.iter().filter(|row| !row[9].is_empty() && number(&row[3]) > 0.0) {
        assert!((number(&row[8]) - (1.0 - number(&row[9]) / number(&row[3]))).abs() < 1e-9, "{row:?}");
        let oee = number(&row[4]) * number(&row[5]) * number(&row[8]);
        assert!((number(&row[6]) - oee).abs() < 1e-9, "{row:?}");
    }
    let orders = ask(plant, "energy-per-order");
    assert_eq!(orders.len(), 1, "{orders:?}");
    assert_eq!(
        (&*orders[0][0], &*orders[0][1], &*orders[0][4], &*orders[0][5], &*orders[0][6]),
        (PATH, "A-4711", "10", "4", "2")
    );
    assert_eq!((number(&orders[0][7]), number(&orders[0][8])), (1.0, 500.0), "4 parts of 250 Wh, 2 of them good");
    let stops = ask(plant, "stops-by-reason");
    assert_eq!((&*stops[0][1], &*stops[0][2]), ("no material", "1"));
    assert!((number(&stops[0][3]) * 3600.0 - 100.0).abs() < 1e-6, "{stops:?}");
}
