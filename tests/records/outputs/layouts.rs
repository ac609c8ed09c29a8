//! Layouts of MQTT: what a subscriber that comes late knows, and when; nothing is left behind at a clean end.

use crate::outputs::plain::Listener;
use serde_json::Value as Json;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use testkit::box_under_test::Sending;
use testkit::broker::{Broker, program};
use testkit::process::{run, stdout, text};

/// What a subscriber must know: texts that change seldom, and a number that changes often.
const WANTED: [&str; 6] = ["program", "tool", "execution", "mode", "part_count", "spindle_power_w"];

/// Seconds until a new subscriber knows everything that is wanted, and what it knows by then.
fn seconds_until_known(port: u16, layout: &str) -> (f64, BTreeMap<String, String>) {
    let client = program("mosquitto_sub").expect("found before");
    let began = Instant::now();
    let mut command = Command::new(client);
    command.args(["-h", "localhost", "-p", &port.to_string(), "-t", "works/#", "-v"]);
    let mut child = command.stdout(Stdio::piped()).spawn().expect("it runs");
    let mut known = BTreeMap::new();
    for line in BufReader::new(child.stdout.take().expect("piped")).lines().map_while(Result::ok) {
        let Some((topic, payload)) = line.split_once(' ') else { continue };
        let name = topic.rsplit('/').next().unwrap_or_default();
        if layout == "topics" && WANTED.contains(&name) {
            known.insert(name.to_owned(), payload.to_owned());
        }
        if let Ok(document) = serde_json::from_str::<Json>(payload) {
            take(&document, name, &mut known);
        }
        if WANTED.iter().all(|wanted| known.contains_key(*wanted)) || began.elapsed() > Duration::from_secs(70) {
            break;
        }
    }
    let seconds = began.elapsed().as_secs_f64();
    child.kill().expect("it runs");
    child.wait().expect("it ends");
    (seconds, known)
}

/// Values of a document of any layout.
fn take(document: &Json, topic: &str, known: &mut BTreeMap<String, String>) {
    let mut put = |name: &str, value: &Json| {
        if WANTED.contains(&name) && !value.is_null() {
            known.insert(name.to_owned(), value.as_str().map_or_else(|| value.to_string(), str::to_owned));
        }
    };
    match (topic, &document["values"]) {
        ("latest", Json::Object(values)) => values.iter().for_each(|(name, value)| put(name, value)),
        (_, Json::Array(values)) => {
            values.iter().for_each(|value| put(value["name"].as_str().unwrap_or_default(), &value["value"]));
        }
        _ => document.as_object().into_iter().flatten().for_each(|(name, value)| put(name, value)),
    }
}

#[test]
fn a_subscriber_that_comes_late_knows_everything_at_once_in_every_layout() {
    let Some(broker) = Broker::start() else { return };
    if program("mosquitto_sub").is_none() {
        return;
    }
    for layout in ["items", "flat", "topics"] {
        let address = format!("mqtt://127.0.0.1:{}/works/{layout}?layout={layout}", broker.port);
        // Everything is repeated once in an hour only: what is known sooner is known by what the broker keeps.
        let mut sending = Sending::at_speed("20", &address, "[outbox]\nrefresh_s = 3600\n");
        sending.wait_spindle();
        sending.wait_sink("live", |sink| sink["delivered"].as_u64() > Some(50));
        std::thread::sleep(Duration::from_secs(3));
        let (seconds, known) = seconds_until_known(broker.port, layout);
        println!("{layout}: {} of {} known after {seconds:.2} s: {known:?}", known.len(), WANTED.len());
        assert!(known.len() == WANTED.len() && seconds < 10.0, "{layout}: {seconds} s, {known:?}");
        sending.stop();
    }
}

#[test]
fn a_flat_document_is_one_object_and_a_part_has_no_text_that_holds_json() {
    let Some(broker) = Broker::start() else { return };
    let Some(listener) = Listener::plain(broker.port) else { return };
    let address = format!("mqtt://127.0.0.1:{}/works/lathe?layout=flat", broker.port);
    let mut sending = Sending::fast(&address);
    sending.wait_spindle();
    testkit::process::wait_for("a part", Duration::from_secs(90), || {
        (!listener.messages("works/lathe/part").is_empty()).then_some(())
    });
    sending.stop();
    let samples = listener.messages("works/lathe/sample");
    let flat = samples.iter().all(|sample| {
        sample.as_object().is_some_and(|fields| fields.values().all(|value| !value.is_object() && !value.is_array()))
    });
    assert!(flat && samples.iter().any(|sample| sample["spindle_power_w"].is_number()), "{:?}", samples.first());
    let part = &listener.messages("works/lathe/part")[0];
    assert!(part["detail"].is_object() && part["energy_j"].is_number() && part["ts"].is_i64(), "{part}");
    println!("{part}");
}

#[test]
fn home_assistant_is_told_every_sensor() {
    let Some(broker) = Broker::start() else { return };
    let address = format!("mqtt://127.0.0.1:{}/works/lathe?layout=topics&discovery=homeassistant", broker.port);
    let mut sending = Sending::fast(&address);
    sending.wait_spindle();
    sending.wait_sink("live", |sink| sink["delivered"].as_u64() > Some(50));
    let Some(client) = program("mosquitto_sub") else { return };
    let said = Command::new(client)
        .args(["-h", "localhost", "-p", &broker.port.to_string(), "-t", "homeassistant/#", "-W", "2"])
        .output()
        .expect("it runs");
    sending.stop();
    let documents: Vec<Json> =
        String::from_utf8_lossy(&said.stdout).lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let power =
        documents.iter().find(|document| document["state_topic"] == "works/lathe/spindle_power_w").expect("told");
    assert_eq!((&power["unit_of_measurement"], &power["device_class"]), (&"W".into(), &"power".into()), "{power}");
    assert_eq!(power["device"]["name"], "Lathe 7");
    println!("{} sensors", documents.len());
}

/// The greatest number of an item that the history has made.
fn last_made(database: &std::path::Path) -> u64 {
    let statement = "SELECT max(first_sequence + items) - 1 AS last FROM outbox";
    let said = run(&["history", "query", "--history", text(database), "--sql", statement, "--json"]);
    let answer: Json = serde_json::from_str(&stdout(&said)).expect("JSON");
    answer["rows"][0]["last"].as_u64().expect("a number")
}

#[test]
fn a_clean_end_leaves_nothing_undelivered() {
    let Some(broker) = Broker::start() else { return };
    let Some(listener) = Listener::plain(broker.port) else { return };
    let received = |prefix: &str| {
        let kinds =
            ["sample", "state", "part", "event", "gap", "minute", "hour", "day", "alarm", "alarm_clear", "decision"];
        let mut numbers: Vec<u64> = kinds
            .iter()
            .flat_map(|kind| listener.messages(&format!("works/{prefix}/{kind}")))
            .filter_map(|item| item["sequence"].as_u64())
            .collect();
        numbers.sort_unstable();
        numbers.dedup();
        numbers
    };
    // SIGTERM in the middle of live data.
    let mut sending = Sending::fast(&format!("mqtt://127.0.0.1:{}/works/live", broker.port));
    sending.wait_sink("live", |sink| sink["delivered"].as_u64() > Some(200));
    sending.stop();
    std::thread::sleep(Duration::from_millis(500));
    let (live, made) = (received("live"), last_made(&sending.database()));
    println!("SIGTERM: {} of {made} delivered", live.len());
    assert_eq!(live, (1..=made).collect::<Vec<u64>>());
    assert!(listener.messages("works/live/gap").iter().any(|gap| gap["record"]["reason"] == "stopped"));
    // As fast as possible, and over by itself.
    let directory = tempfile::tempdir().expect("a directory");
    let config = directory.path().join("gateway.toml");
    let lines = format!(
        "[gateway]\nname = \"Lathe 7\"\ndata_dir = \"{0}/data\"\n[http]\nenabled = false\n[[source]]\naddress = \"simulated://lathe?seed=3\"\n\
         [[sink]]\nname = \"plant\"\naddress = \"mqtt://127.0.0.1:{1}/works/fast\"\n[sinks]\ndrain_s = 60\n",
        text(directory.path()),
        broker.port
    );
    std::fs::write(&config, lines).expect("writable");
    let ended = run(&["--config", text(&config), "--speed", "max", "--for", "300"]);
    assert!(ended.status.success(), "{}", testkit::process::stderr(&ended));
    std::thread::sleep(Duration::from_secs(1));
    let (fast, made) = (received("fast"), last_made(&directory.path().join("data/history.db")));
    println!("--speed max --for 300: {} of {made} delivered", fast.len());
    assert_eq!(fast, (1..=made).collect::<Vec<u64>>());
}
