//! A hundred boxes into one three-node stream and one database: what it costs here.
//!
//! `FLEET_BOXES=100 FLEET_S=60 cargo test --release --test records fleet::boxes -- --ignored --nocapture`

use crate::fleet::killed::ingest;
use crate::fleet::postgres::Postgres;
use std::time::{Duration, Instant};
use testkit::box_under_test::Sending;
use testkit::nats_cluster::Cluster;
use testkit::process::{run, wait_for};

fn setting(name: &str, usual: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

/// Processor time of a process and its ended children, s.
fn cpu_s(pid: u32) -> f64 {
    let text = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    let rest = text.rsplit(')').next().unwrap_or_default();
    let fields: Vec<f64> = rest.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    // Field 14 and 15 of proc(5), in hundredths of a second; the state before them is no number.
    (fields[10] + fields[11]) / 100.0
}

#[test]
#[ignore = "5 minutes: what a hundred boxes cost and how many values a second arrive"]
fn a_hundred_boxes_into_one_stream_and_one_database() {
    let Some(cluster) = Cluster::start(3) else { return };
    let Some(postgres) = Postgres::start() else { return };
    let (boxes, seconds) = (setting("FLEET_BOXES", 100), setting("FLEET_S", 60));
    let address = format!("{}/cnc", cluster.address());
    let limit = Duration::from_secs(600);
    wait_for("the stream", limit, || {
        run(&["fleet", "stream", &address, "--replicas", "3", "--max-gb", "1"]).status.success().then_some(())
    });
    let reader = ingest(&address, &postgres.address());
    let sending: Vec<Sending> = (0..boxes).map(|_| Sending::to(&address, "")).collect();
    wait_for("every box", limit, || (postgres.number("SELECT count(*) FROM boxes") >= boxes).then_some(()));
    let values = || postgres.number("SELECT coalesce(sum(cardinality(numbers)), 0) FROM items");
    let pids: Vec<u32> =
        sending.iter().filter_map(|one| one.gateway.as_ref().map(testkit::process::Gateway::pid)).collect();
    let cpu = || pids.iter().map(|pid| cpu_s(*pid)).sum::<f64>();
    let (began, values_before, cpu_before, reader_before) = (Instant::now(), values(), cpu(), cpu_s(reader.pid()));
    std::thread::sleep(Duration::from_secs(seconds));
    let (passed, came) = (began.elapsed().as_secs_f64(), values() - values_before);
    let (boxes_cpu, reader_cpu) = (cpu() - cpu_before, cpu_s(reader.pid()) - reader_before);
    let late = postgres.sql("SELECT round(extract(epoch FROM now() - max(at))::numeric, 2) FROM items");
    println!(
        "{boxes} boxes, {passed:.0} s: {:.0} values a second in the database; {:.2} % of a core for a box, {:.1} % for the \
         reader; newest row {late} s old",
        came as f64 / passed,
        100.0 * boxes_cpu / passed / boxes as f64,
        100.0 * reader_cpu / passed
    );
    drop(sending);
    let rest = run(&["fleet", "ingest", &address, "--database", &postgres.address(), "--once"]);
    assert!(rest.status.success());
    let holes = "SELECT count(*) FROM (SELECT box_id, max(sequence) - count(*) AS lost FROM items GROUP BY box_id) AS each WHERE lost <> 0";
    assert_eq!(postgres.number(holes), 0, "no box has a hole");
}
