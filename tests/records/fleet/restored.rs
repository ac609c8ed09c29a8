//! A box that goes on from an older copy of its history: what it sends is taken, and nothing twice.

use crate::fleet::pipeline::{Plant, Recorded};
use adapters::ChannelId;
use gateway::fleet::parse_cluster;
use gateway::history::{Outbox, OutboxSettings, StateChange};
use gateway::nats::{Connection, Outgoing, StreamSettings};
use std::collections::BTreeSet;
use std::time::Duration;

const SECOND_NS: i64 = 1_000_000_000;
/// Every tick is a second, and the machine's power is another at each.
const TICK: Duration = Duration::from_secs(1);

fn record(recorded: &Recorded, start_ns: i64, ticks: std::ops::Range<i64>) -> BTreeSet<i64> {
    let power = ChannelId::from_name("spindle_power_w").expect("in the table");
    let at = |tick: i64| start_ns + tick * SECOND_NS;
    for tick in ticks.clone() {
        if tick % 10 == 0 {
            let state = if tick % 20 == 0 { "idle" } else { "cutting" };
            recorded.writer().queue_record(StateChange {
                at_ns: at(tick),
                state: state.to_owned(),
                ..StateChange::default()
            });
        }
        recorded.tick(at(tick), &[(power, Ok((100 * tick) as f64))], "cutting");
    }
    ticks.map(at).collect()
}

/// The history as `backup --history` copies it.
fn copy_of(directory: &tempfile::TempDir) -> tempfile::TempDir {
    let copy = tempfile::tempdir().expect("a directory");
    gateway::backup::copy_history(&directory.path().join("history.db"), &copy.path().join("history.db"))
        .expect("copied");
    copy
}

/// `moments` copies, each put back after the original has gone on for a while; every tick of every life is in the database, once.
fn put_back(plant: &Plant, moments: i64) {
    let start_ns = 1_769_767_200 * SECOND_NS;
    let mut expected = BTreeSet::new();
    let mut recorded = Recorded::start("Lathe 7", TICK, &plant.address);
    let mut now = 0;
    for moment in 0..moments {
        expected.extend(record(&recorded, start_ns, now..now + 60 + 7 * moment));
        assert_eq!(recorded.refused(), 0);
        let copy = copy_of(&recorded.directory);
        // The original goes on and sends more; then its hardware dies.
        now += 100 + 7 * moment;
        expected.extend(record(&recorded, start_ns, now..now + 40));
        assert_eq!(recorded.refused(), 0);
        recorded.abandon();
        now += 60;
        recorded = Recorded::again(copy, "Lathe 7", TICK, &plant.address);
    }
    expected.extend(record(&recorded, start_ns, now..now + 90));
    assert_eq!(recorded.refused(), 0);
    recorded.stop();
    println!("{}", plant.ingest().trim());
    let times = plant.postgres.sql("SELECT at_ns FROM items WHERE kind = 'sample' ORDER BY at_ns");
    let found: Vec<i64> = times.lines().map(|line| line.parse().expect("a number")).collect();
    let (lost, count) = (expected.iter().filter(|at_ns| !found.contains(at_ns)).count(), found.len());
    println!("{moments} copies put back: {} ticks, {count} in the database, {lost} lost", expected.len());
    assert_eq!(found, expected.into_iter().collect::<Vec<_>>(), "each once");
    assert_eq!(plant.postgres.number("SELECT count(*) FROM boxes"), 1);
    let twice = "SELECT count(*) FROM (SELECT box_id, since, state FROM state_list WHERE state <> 'no_data' GROUP BY 1, 2, 3 HAVING count(*) > 1) AS more";
    assert_eq!(plant.postgres.number(twice), 0);
}

#[test]
fn a_copy_that_is_put_back_within_the_window_of_the_stream_loses_nothing() {
    let Some(plant) = Plant::start() else { return };
    put_back(&plant, 10);
}

#[test]
fn a_copy_that_is_put_back_after_the_window_of_the_stream_sends_nothing_twice_into_the_database() {
    let Some(plant) = Plant::without_stream() else { return };
    let (target, _) = parse_cluster(&plant.address).expect("an address");
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("threads");
    let settings = StreamSettings {
        name: "CNC".to_owned(),
        subjects: "cnc.>".to_owned(),
        replicas: 1,
        max_age: Duration::from_secs(86_400),
        max_bytes: 1_000_000_000,
        may_shrink: false,
        duplicate_window: Duration::from_millis(100),
    };
    runtime.block_on(async {
        let mut connection = Connection::open(&target, 0, "test").await.expect("connected");
        assert!(connection.create_stream(&settings).await.expect("created").is_some());
    });
    put_back(&plant, 10);
}

#[test]
fn an_item_that_the_stream_has_although_nobody_can_have_sent_it_is_told() {
    let Some(plant) = Plant::start() else { return };
    let recorded = Recorded::start("Lathe 7", TICK, &plant.address);
    let start_ns = 1_769_767_200 * SECOND_NS;
    record(&recorded, start_ns, 0..5);
    assert_eq!(recorded.refused(), 0);
    // Somebody else publishes under the name of the next item.
    let (name, epoch, next) = recorded.identity();
    let (target, _) = parse_cluster(&plant.address).expect("an address");
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("threads");
    let foreign = Outgoing {
        subject: format!("cnc.{name}.sample"),
        id: format!("{name}-{epoch:x}-{next}"),
        payload: b"{}".to_vec(),
    };
    runtime.block_on(async {
        let mut connection = Connection::open(&target, 0, "test").await.expect("connected");
        connection.publish_all(&[foreign]).await.map_err(|(_, failure)| failure).expect("stored");
    });
    record(&recorded, start_ns, 5..15);
    assert_eq!(recorded.refused(), 1, "it is not counted as delivered");
    let told = recorded.refusal().expect("told");
    assert!(told.contains(&format!("item {next}")) && told.contains("never sent it"), "{told}");
    drop(recorded.stop());
    // A history that nobody has opened has no epoch yet.
    assert_eq!(Outbox::new("Lathe 7", OutboxSettings::default(), []).epoch(), 0);
}
