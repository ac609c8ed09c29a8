//! Documents that no database takes, among those of healthy boxes: the healthy ones are not held up, and the others are kept to be
//! looked at.

use crate::fleet::pipeline::Plant;
use gateway::fleet::parse_cluster;
use gateway::nats::{Backlog, Connection, JetStreamFailure, Outgoing};
use serde_json::{Value as Json, json};
use std::time::{Duration, Instant};
use testkit::nats_cluster::has_version;
use testkit::process::{run, wait_for};

/// The first version known here whose streams take no message beyond 32 MB.
const REFUSES_LARGE_MESSAGES: (u32, u32) = (2, 12);

fn now_ns() -> i64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).expect("after 1970");
    i64::try_from(since.as_nanos()).expect("before 2262")
}

/// The document of an item of this box.
fn document(name: &str, sequence: u64) -> Json {
    json!({"schema": "item/1", "sequence": sequence, "at_ns": now_ns(), "kind": "sample", "machine": format!("Machine {name}"), "box": name,
        "historical": false, "values": [{"name": "spindle_power_w", "value": sequence, "unit": "W"}]})
}

fn message(name: &str, kind: &str, id: &str, payload: Vec<u8>) -> Outgoing {
    Outgoing { subject: format!("cnc.{name}.{kind}"), id: id.to_owned(), payload }
}

/// What must not stop anything: a name, a word of the reason where it is refused, and the message.
type Poison = (&'static str, Option<&'static str>, Outgoing);

fn poison() -> Vec<Poison> {
    let all = [names(), bytes(), records()].concat();
    let own = |(index, (what, reason, message)): (usize, Poison)| {
        (what, reason, Outgoing { id: index.to_string(), ..message })
    };
    all.into_iter().enumerate().map(own).collect()
}

fn changed(change: impl FnOnce(&mut Json)) -> Outgoing {
    let mut document = document("bad", 7);
    change(&mut document);
    message("bad", "sample", "", document.to_string().into_bytes())
}

/// Documents of which one field is wrong.
fn names() -> Vec<Poison> {
    let long = || json!("n".repeat(9000));
    vec![
        ("NUL in the name of the machine", Some("control character"), changed(|d| d["machine"] = json!("a\0b"))),
        ("NUL in the name of a series", Some("control character"), changed(|d| d["values"][0]["name"] = json!("p\0w"))),
        ("9,000 letters in the machine's name", Some("9000 letters"), changed(|d| d["machine"] = long())),
        ("9,000 letters in a series' name", Some("9000 letters"), changed(|d| d["values"][0]["name"] = long())),
        ("the year 2255", Some("years 1990 to 2100"), changed(|d| d["at_ns"] = json!(9_000_000_000_000_000_000_i64))),
        ("the year 1970", Some("years 1990 to 2100"), changed(|d| d["at_ns"] = json!(1))),
        ("a number beyond 64 bits with sign", Some("out of range"), changed(|d| d["sequence"] = json!(u64::MAX))),
        ("another box than its subject", Some("another box"), changed(|d| d["box"] = json!("good-1"))),
        ("30 MB", Some("is no item"), changed(|d| d["machine"] = json!("x".repeat(30_000_000)))),
        ("NUL in a text", None, changed(|d| d["values"] = json!([{"name": "program", "value": "O1\0\\u0000"}]))),
    ]
}

/// What is no document.
fn bytes() -> Vec<Poison> {
    let of = |bytes: &[u8]| message("bad", "sample", "", bytes.to_vec());
    let deep = ["[".repeat(100_000), "]".repeat(100_000)].concat();
    vec![
        ("no UTF-8", Some("no document"), of(b"{\"schema\":\"item/1\",\"box\":\"\xff\xfe\"}")),
        ("half a surrogate", Some("no document"), of(br#"{"schema":"item/1","box":"\ud800"}"#)),
        ("100,000 brackets", Some("no document"), of(deep.as_bytes())),
        ("nothing", Some("no document"), of(b"")),
        ("a number that is none", Some("no document"), of(br#"{"schema":"item/1","sequence":1e999}"#)),
    ]
}

/// Records with fields that no table takes, or nearly.
fn records() -> Vec<Poison> {
    let of = |sequence: u64, kind: &str, record: Json| {
        let mut document = document("bad", sequence);
        (document["kind"], document["values"], document["record"]) = (json!(kind), json!([]), record);
        message("bad", kind, "", document.to_string().into_bytes())
    };
    let numbers = json!({"operations": [1, "x", null]});
    vec![
        ("energy that is a word", Some("22P02"), of(8, "part", json!({"began_ns": 1, "energy_j": "much"}))),
        ("a time beyond all times", Some("22"), of(9, "part", json!({"began_ns": "9999999999999999999999"}))),
        ("operations that are numbers", None, of(10, "part", json!({"began_ns": 1, "detail": numbers}))),
        ("a kind that nobody knows", None, of(11, "future", json!({"a": "\0"}))),
    ]
}

/// Publishes documents of three healthy boxes and, between them, everything that is poisoned.
async fn publish(address: &str, rounds: u64, poison: &[Poison]) {
    let (target, _) = parse_cluster(address).expect("an address");
    let mut connection = Connection::open(&target, 0, "test").await.expect("connected");
    let mut bad = poison.iter();
    for sequence in 1..=rounds {
        let good = (1..=3).map(|number| {
            let name = format!("good-{number}");
            message(&name, "sample", &format!("{name}-{sequence}"), document(&name, sequence).to_string().into_bytes())
        });
        let messages: Vec<Outgoing> = good.chain(bad.next().map(|(_, _, message)| message.clone())).collect();
        connection.publish_all(&messages).await.map_err(|(_, failure)| failure).expect("stored");
    }
    for (_, _, message) in bad {
        connection.publish_all(std::slice::from_ref(message)).await.map_err(|(_, failure)| failure).expect("stored");
    }
}

/// A stream of JetStream takes no message beyond 32 MB, whatever the server is set to: the sender is told so, and goes on.
#[test]
fn fifty_megabytes_are_refused_by_the_stream_itself_and_left_out() {
    if !has_version(REFUSES_LARGE_MESSAGES, "a stream of an older server takes messages of 50 MB") {
        return;
    }
    let Some(plant) = Plant::with("max_payload: 64MB\nmax_pending: 256MB\n") else { return };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("threads");
    let (target, _) = parse_cluster(&plant.address).expect("an address");
    runtime.block_on(async {
        let mut connection = Connection::open(&target, 0, "test").await.expect("connected");
        let messages = [
            message("good-1", "sample", "1", document("good-1", 1).to_string().into_bytes()),
            message("good-1", "sample", "2", vec![b'x'; 50_000_000]),
        ];
        let failed = connection.publish_all(&messages).await.expect_err("refused");
        println!("{failed:?}");
        assert!(matches!(failed, (1, JetStreamFailure::Message(_))), "{failed:?}");
    });
    assert!(plant.ingest().contains("1 rows written"));
}

#[test]
fn what_the_database_does_not_take_holds_up_nobody_and_lies_in_refused() {
    let Some(plant) = Plant::with("max_payload: 64MB\nmax_pending: 256MB\n") else { return };
    let reader = ingest_one(&plant);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("threads");
    let poison = poison();
    let rounds = 200;
    let began = Instant::now();
    runtime.block_on(publish(&plant.address, rounds, &poison));
    let published = began.elapsed();
    let good = "SELECT count(*) FROM items JOIN boxes USING (box_id) WHERE box LIKE 'good-%'";
    wait_for("the healthy boxes", Duration::from_secs(120), || {
        (plant.postgres.number(good) == 3 * rounds).then_some(())
    });
    let taken = poison.iter().filter(|(_, reason, _)| reason.is_none()).count() as u64;
    let refused = poison.len() as u64 - taken;
    wait_for("the refused", Duration::from_secs(120), || {
        (plant.postgres.number("SELECT count(*) FROM refused") == refused).then_some(())
    });
    let delay = plant.postgres.sql("SELECT round(max(extract(epoch FROM arrived - at))::numeric, 2) FROM items JOIN boxes USING (box_id) WHERE box LIKE 'good-%'");
    println!(
        "{} published in {:.1} s, all written {:.1} s after the first; from the clock of the box to the stream at most {delay} s",
        3 * rounds + poison.len() as u64,
        published.as_secs_f64(),
        began.elapsed().as_secs_f64()
    );
    for (what, reason, message) in &poison {
        let Some(reason) = reason else { continue };
        let found = plant.postgres.number(&format!(
            "SELECT count(*) FROM refused WHERE subject = '{}' AND position('{reason}' IN reason) > 0 AND length(payload) <= 4000", message.subject
        ));
        println!("{what}: refused ({reason})");
        assert!(found > 0, "{what}: {}", plant.postgres.sql("SELECT reason FROM refused"));
    }
    assert_eq!(plant.postgres.number("SELECT count(*) FROM items JOIN boxes USING (box_id) WHERE box = 'bad'"), taken);
    assert_eq!(plant.postgres.sql("SELECT text FROM readings WHERE name = 'program'"), "O1\\u0000");
    // Nothing is given out again: what is refused is done, and acknowledged. A reader that is killed before it has acknowledged leaves
    // it to the next one, which finds it known.
    wait_for("everything is acknowledged", Duration::from_secs(60), || {
        runtime.block_on(backlog(&plant.address)).filter(|left| left.pending == 0 && left.under_way == 0).map(drop)
    });
    drop(reader);
    let again = plant.ingest();
    assert!(again.contains("0 rows written, 0 known already, 0 refused"), "{again}");
}

/// What the stream has still to give to its reader.
async fn backlog(address: &str) -> Option<Backlog> {
    let (target, _) = parse_cluster(address).expect("an address");
    let mut connection = Connection::open(&target, 0, "test").await.ok()?;
    connection.read_backlog("CNC", "fleet").await.ok()
}

fn ingest_one(plant: &Plant) -> testkit::process::Gateway {
    let mut command = testkit::process::program();
    command.args(["fleet", "ingest", &plant.address, "--database", &plant.postgres.address(), "--max-gb", "4"]);
    let reader = testkit::process::Gateway::spawn(command);
    wait_for("the tables", Duration::from_secs(60), || {
        (plant.postgres.number("SELECT count(*) FROM pg_class WHERE relname = 'box_latest'") == 1).then_some(())
    });
    reader
}

/// A box that was renamed is the same box; items that come late do not bring the old name back.
#[test]
fn a_machine_that_is_renamed_stays_one_box() {
    let Some(plant) = Plant::start() else { return };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("threads");
    let named = |sequence: u64, name: &str, at_ns: i64| {
        let mut document = document("box-1", sequence);
        (document["machine"], document["at_ns"]) = (json!(name), json!(at_ns));
        message("box-1", "sample", &format!("box-1-{sequence}"), document.to_string().into_bytes())
    };
    let start_ns = now_ns() - 3_600_000_000_000;
    let (target, _) = parse_cluster(&plant.address).expect("an address");
    let names = ["Lathe 7", "Lathe 7", "车床七号", "车床七号", "Lathe 7"];
    let times = [0, 10, 20, 30, 5];
    runtime.block_on(async {
        let mut connection = Connection::open(&target, 0, "test").await.expect("connected");
        for ((sequence, name), second) in (1..).zip(names).zip(times) {
            let messages = [named(sequence, name, start_ns + second * 1_000_000_000)];
            connection.publish_all(&messages).await.map_err(|(_, failure)| failure).expect("stored");
        }
    });
    plant.ingest();
    assert_eq!(plant.postgres.sql("SELECT box, machine FROM boxes"), "box-1|车床七号");
    assert_eq!(plant.postgres.sql("SELECT machine FROM box_names ORDER BY since"), "Lathe 7\n车床七号");
    assert_eq!(plant.postgres.number("SELECT count(*) FROM readings WHERE machine = '车床七号'"), 5);
    let nanoseconds = format!("SELECT count(*) FROM items WHERE at_ns = {start_ns}");
    assert_eq!(plant.postgres.number(&nanoseconds), 1, "to the nanosecond");
}

#[test]
fn passwords_do_not_stand_in_addresses() {
    for (arguments, secret) in [
        (["fleet", "ingest", "nats://u:s3cret@127.0.0.1:4222", "--database", "postgres://a@b/c"], "s3cret"),
        (["fleet", "ingest", "nats://127.0.0.1:4222", "--database", "postgres://a:s3cret@b/c"], "s3cret"),
        (["fleet", "ingest", "nats://127.0.0.1:4222", "--database", "host=b password=s3cret"], "s3cret"),
    ] {
        let said = run(&[&arguments[..], &["--once"]].concat());
        let text = testkit::process::stderr(&said);
        assert!(said.status.code() == Some(2) && !text.contains(secret) && text.contains("file"), "{text}");
    }
}
