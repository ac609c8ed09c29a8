//! Requests to the gate from the network: refused unless the configuration allows them, judged like a script's where it does,
//! in the audit either way, and never written while the gate is not armed at the box.

use crate::outputs::plain::Listener;
use serde_json::Value as Json;
use std::io::Write;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use testkit::box_under_test::Sending;
use testkit::broker::{Broker, program};
use testkit::host::Host;
use testkit::process::wait_for;

const PATIENCE: Duration = Duration::from_secs(60);
const FEED: &str = "request/feed_override_pct";
/// The alias of `request/answer`; data names metrics by alias alone.
const ANSWER: u64 = 11;
/// That of `request/outcome`.
const OUTCOME: u64 = 12;
/// Asks for nothing; one alarm stands.
const SCRIPT: &str = "alarm(\"door\", \"the door was opened\");";

pub(crate) fn start(address: &str, more: &str) -> Sending {
    let machine = "simulated://lathe?dropouts_per_h=0&begun_s=260";
    let sending = Sending::with_script(machine, "1", address, more, Some(SCRIPT));
    sending.wait_sink("connected", |sink| sink["state"] == "connected");
    wait_for("a decision", PATIENCE, || sending.status()["gate"]["permitted_pct"].is_number().then_some(()));
    sending
}

fn sparkplug(more: &str) -> Option<(Broker, Host, Sending)> {
    let broker = Broker::start()?;
    let host = Host::at(broker.port)?;
    let sending = start(&format!("sparkplug://127.0.0.1:{}/plant/line-1/lathe-7", broker.port), more);
    host.wait_more("the birth", "DBIRTH", 0);
    Some((broker, host, sending))
}

/// The documents that were told under this alias.
fn told(heard: &[Json], alias: u64) -> Vec<Json> {
    let data = heard.iter().filter(|message| message["kind"] == "DDATA");
    let metrics = data.flat_map(|message| message["metrics"].as_array().cloned().unwrap_or_default());
    let of_alias = metrics.filter(|metric| metric["alias"] == alias && metric["null"] == false);
    of_alias.filter_map(|metric| serde_json::from_str(metric["value"].as_str()?).ok()).collect()
}

/// Sends a metric and gives the answer.
fn ask(host: &mut Host, name: &str, kind: &str, value: &str) -> Json {
    let before = told(&host.heard(), ANSWER).len();
    host.command("plant/line-1", name, kind, value);
    let mut found = Json::Null;
    host.wait(&format!("the answer to {name} {value}"), |heard| {
        found = told(heard, ANSWER).get(before).cloned().unwrap_or_default();
        !found.is_null()
    });
    found
}

/// Outcomes of the rows of this kind that name the sink.
fn outcomes(sending: &Sending, kind: &str) -> Vec<String> {
    let of_sink = |row: &Json| row["kind"] == kind && row["script"] == "sink plant";
    let rows = sending.audit();
    rows.iter().filter(|row| of_sink(row)).filter_map(|row| row["outcome"].as_str().map(str::to_owned)).collect()
}

fn gate(sending: &Sending) -> Json {
    sending.status()["gate"].clone()
}

#[test]
fn by_default_a_command_of_the_network_is_refused_told_and_audited() {
    let Some((_broker, mut host, mut sending)) = sparkplug("") else { return };
    let answer = ask(&mut host, FEED, "double", "70");
    assert!(
        answer["done"] == false && answer["text"].as_str().is_some_and(|text| text.contains("allow_requests")),
        "{answer}"
    );
    assert_eq!(gate(&sending)["wanted_pct"], Json::Null);
    let alarm = ask(&mut host, "request/acknowledge_alarm", "string", "door");
    assert_eq!(alarm["done"], false);
    sending.stop();
    assert_eq!(outcomes(&sending, "network_request"), ["refused", "refused"]);
    assert!(outcomes(&sending, "network_outcome").is_empty(), "one row holds a refusal");
    assert!(outcomes(&sending, "request").is_empty(), "the gate has seen nothing");
}

#[test]
fn a_gate_that_is_off_sees_the_request_and_writes_nothing() {
    let Some((_broker, mut host, mut sending)) = sparkplug("allow_requests = true\n[gate]\nmode = \"off\"\n") else {
        return;
    };
    let answer = ask(&mut host, FEED, "double", "70");
    assert!(answer["done"] == false && answer["text"].as_str().is_some_and(|text| text.contains("nothing is written")));
    let seen = wait_for("the request at the gate", PATIENCE, || {
        Some(gate(&sending)).filter(|gate| gate["wanted_pct"] == 70.0)
    });
    assert!(seen["reason"].as_str().is_some_and(|reason| reason.contains("sink plant")), "{seen}");
    assert_eq!(
        (&seen["mode"], &seen["permitted_pct"], &seen["written_pct"]),
        (&Json::from("off"), &Json::from(100.0), &Json::Null)
    );
    sending.stop();
    assert_eq!(outcomes(&sending, "network_request"), ["not_written"]);
    assert_eq!(outcomes(&sending, "request")[0], "held");
    assert!(outcomes(&sending, "write").is_empty());
}

#[test]
fn what_the_network_asks_for_is_judged_like_a_script_and_written_only_when_a_person_has_armed() {
    let more = "allow_requests = true\n[gate]\nmode = \"armed\"\nsource = \"lathe\"\n";
    let Some((_broker, mut host, mut sending)) = sparkplug(more) else { return };
    let too_much = ask(&mut host, FEED, "double", "120");
    assert!(
        too_much["done"] == false && too_much["text"].as_str().is_some_and(|text| text.contains("from 0 to 100")),
        "{too_much}"
    );
    assert_eq!(ask(&mut host, FEED, "double", "20")["done"], false, "nobody has armed");
    let unwritable = ask(&mut host, "spindle_speed_rpm", "double", "100");
    assert!(unwritable["text"].as_str().is_some_and(|text| text.contains("cannot be written")), "{unwritable}");
    wait_for("the request at the gate", PATIENCE, || (gate(&sending)["wanted_pct"] == 20.0).then_some(()));
    std::thread::sleep(Duration::from_secs(2));
    assert_eq!(gate(&sending)["written_pct"], Json::Null, "nobody has armed");
    let armed = sending.order(&["arm", "--for", "5m", "--by", "fitter"]);
    assert!(armed.contains("armed by fitter"), "{armed}");
    let forgotten = || gate(&sending)["wanted_pct"].is_null().then_some(());
    wait_for("what was asked for before counts no more", PATIENCE, forgotten);
    assert_eq!(ask(&mut host, FEED, "double", "20")["done"], true);
    // The request stands for a minute; the spindle turns a quarter of a minute after the start.
    wait_for("the least that the gate allows is in force", PATIENCE, || {
        (gate(&sending)["written_pct"] == 50.0).then_some(())
    });
    host.wait("the outcome of the request", |heard| told(heard, OUTCOME).len() >= 4);
    assert_eq!(ask(&mut host, FEED, "null", "-")["done"], true);
    wait_for("given back", PATIENCE, || gate(&sending)["wanted_pct"].is_null().then_some(()));
    host.wait("the outcome of giving back", |heard| {
        told(heard, OUTCOME).last().is_some_and(|it| it["outcome"] == "followed")
    });
    let settled: Vec<Json> = told(&host.heard(), OUTCOME);
    let words: Vec<&str> = settled.iter().filter_map(|it| it["outcome"].as_str()).collect();
    assert_eq!(words, ["refused", "not_written", "refused", "limited", "followed"], "{settled:?}");
    assert_eq!((&settled[3]["asked_pct"], &settled[3]["in_force_pct"]), (&Json::from(20.0), &Json::from(50.0)));
    assert!(settled[3]["id"].as_str().is_some_and(|id| id.starts_with(FEED)), "{:?}", settled[3]);
    sending.stop();
    assert!(outcomes(&sending, "write").contains(&"written".to_owned()), "the write names who asked");
    assert!(
        outcomes(&sending, "network_request").starts_with(&["refused", "not_written", "refused"].map(str::to_owned))
    );
}

pub(crate) fn publish(port: u16, topic: &str, lines: &str, more: &[&str]) {
    let mut command = Command::new(program("mosquitto_pub").expect("looked for before"));
    command.args(["-h", "localhost", "-p", &port.to_string(), "-t", topic, "-q", "1", "-l"]).args(more);
    let mut child = command.stdin(Stdio::piped()).spawn().expect("mosquitto_pub runs");
    child.stdin.take().expect("piped").write_all(lines.as_bytes()).expect("it reads");
    assert!(child.wait().expect("it ends").success());
}

#[test]
fn a_plain_topic_asks_too_and_whatever_else_comes_there_is_refused() {
    let Some(broker) = Broker::start() else { return };
    let Some(listener) = Listener::plain(broker.port) else { return };
    let address = format!("mqtt://127.0.0.1:{}/works/lathe", broker.port);
    // What the broker has kept from before is there at every connection.
    publish(broker.port, "works/lathe/request", "{\"request\":\"feed_override\",\"pct\":50}\n", &["-r"]);
    let mut sending = start(&address, "allow_requests = true\n");
    let answers = || listener.messages("works/lathe/request/answer");
    let told = |count: usize| wait_for("an answer", PATIENCE, || answers().get(count - 1).cloned());
    assert!(told(1)["text"].as_str().is_some_and(|text| text.contains("retained")), "{:?}", answers());
    let asks = [
        ("{\"request\":\"feed_override\",\"pct\":70,\"reason\":\"night\"}", false, "70 %"),
        ("{\"request\":\"feed_override\",\"pct\":1e999}", false, "no request"),
        ("{\"request\":\"arm\",\"by\":\"me\"}", false, "no request"),
        ("hello", false, "no request"),
        ("{\"request\":\"acknowledge_alarm\",\"code\":\"nothing\"}", false, "no alarm"),
        ("{\"request\":\"acknowledge_alarm\",\"code\":\"door (own.rhai)\"}", true, "was seen"),
    ];
    for (index, (line, done, says)) in asks.iter().enumerate() {
        publish(broker.port, "works/lathe/request", &stamp_request(line, &format!("a{index}"), 0), &[]);
        let answer = told(index + 2);
        assert_eq!(answer["done"], *done, "{line}: {answer}");
        assert!(answer["text"].as_str().is_some_and(|text| text.contains(says)), "{line}: {answer}");
    }
    assert_eq!(answers()[1]["id"], "a0");
    late_and_repeated(broker.port, &told, asks.len() + 2);
    wait_for("the request at the gate", PATIENCE, || (gate(&sending)["wanted_pct"] == 70.0).then_some(()));
    let acknowledged = || (sending.status()["acknowledged"][0]["by"] == "sink plant").then_some(());
    wait_for("the acknowledged alarm in the status", PATIENCE, acknowledged);
    flood(broker.port, &sending, &answers);
    sending.stop();
    let rows = outcomes(&sending, "network_request");
    assert!(rows.contains(&"done".to_owned()) && rows.contains(&"not_written".to_owned()), "{rows:?}");
    assert!(rows.len() < 70, "{} rows", rows.len());
    let names = |row: &Json| row["reason"].as_str().is_some_and(|why| why.contains("asked by \"mes\", id \"late\""));
    assert!(sending.audit().iter().any(names), "the audit names who asked");
}

/// The line with this id, asked by `mes` so many seconds ago.
fn stamp_request(line: &str, id: &str, ago_s: i64) -> String {
    stamp_request_of("mes", line, id, ago_s)
}

/// The line with this id, who asks, and when: so many seconds ago.
pub(crate) fn stamp_request_of(asker: &str, line: &str, id: &str, ago_s: i64) -> String {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).expect("after 1970");
    let at_ns = i64::try_from(since.as_nanos()).expect("before 2262") - ago_s * 1_000_000_000;
    let at = gateway::moment::format_utc(at_ns);
    match line.strip_suffix('}') {
        Some(open) => format!("{open},\"id\":\"{id}\",\"from\":\"{asker}\",\"issued_at\":\"{at}\"}}\n"),
        None => format!("{line}\n"),
    }
}

/// What is old, comes again, or does not say when it was asked for is not obeyed; each is told under its own id.
fn late_and_repeated(port: u16, told: &dyn Fn(usize) -> Json, first: usize) {
    let withdraw = "{\"request\":\"withdraw\"}";
    let malformed = stamp_request("{\"request\":\"feed_override\",\"pct\":\"much\"}", "m1", 0);
    let asks = [
        (stamp_request(withdraw, "late", 40), "late", "at most 30 s"),
        (stamp_request(withdraw, "ahead", -20), "ahead", "at most 30 s"),
        (stamp_request(withdraw, "a0", 0), "a0", "has come before"),
        (format!("{withdraw}\n"), "", "issued_at"),
        (malformed, "m1", "no request"),
    ];
    for (index, (line, id, says)) in asks.iter().enumerate() {
        // No more than one a second passes on average.
        std::thread::sleep(Duration::from_secs(1));
        publish(port, "works/lathe/request", line, &[]);
        let answer = told(first + index);
        assert!(
            answer["done"] == false && answer["text"].as_str().is_some_and(|text| text.contains(says)),
            "{line}: {answer}"
        );
        assert_eq!(answer["id"].as_str().unwrap_or_default(), *id, "{answer}");
    }
}

/// Two thousand requests at once: a few are answered, the rest is counted, and data goes on.
fn flood(port: u16, sending: &Sending, answers: &dyn Fn() -> Vec<Json>) {
    let before = answers().len();
    publish(port, "works/lathe/request", &"{\"request\":\"withdraw\"}\n".repeat(2000), &[]);
    let delivered = || sending.sink()["delivered"].as_u64().unwrap_or(0);
    let (began, had) = (Instant::now(), delivered());
    wait_for("data goes on", PATIENCE, || (delivered() > had + 30).then_some(()));
    std::thread::sleep(Duration::from_secs(2));
    let answered = answers().len() - before;
    println!("2000 requests at once: {answered} answered; 30 items later after {:.1} s", began.elapsed().as_secs_f64());
    assert!((1..60).contains(&answered), "{answered}");
    publish(port, "works/lathe/request", "{\"request\":\"withdraw\"}\n", &[]);
    wait_for("the row that counts them", PATIENCE, || {
        let rows = sending.audit();
        rows.iter().any(|row| row["reason"].as_str().is_some_and(|why| why.contains("came too fast"))).then_some(())
    });
}

#[test]
fn a_plain_topic_is_not_even_subscribed_by_default() {
    let Some(broker) = Broker::start() else { return };
    let Some(listener) = Listener::plain(broker.port) else { return };
    let mut sending = start(&format!("mqtt://127.0.0.1:{}/works/lathe", broker.port), "");
    publish(broker.port, "works/lathe/request", "{\"request\":\"feed_override\",\"pct\":70}\n", &[]);
    wait_for("the listener has it", PATIENCE, || (!listener.messages("works/lathe/request").is_empty()).then_some(()));
    std::thread::sleep(Duration::from_secs(2));
    assert_eq!(gate(&sending)["wanted_pct"], Json::Null);
    sending.stop();
    assert!(listener.messages("works/lathe/request/answer").is_empty());
    assert!(outcomes(&sending, "network_request").is_empty());
}
