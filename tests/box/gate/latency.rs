//! How long the gateway itself takes between a sample and the write that it leads to.

use super::running::{gate, order, prepared, start};
use serde_json::Value;
use std::path::Path;
use std::time::Duration;
use testkit::process::{run, stdout, text, wait_for};

/// A sample is one merge delay behind its tick by design: one and a quarter of the slowest period.
const MERGE_DELAY_MS: f64 = 125.0;
/// So many writes are measured.
const WRITES: usize = 1000;

/// The times of every write so far, in ascending order: from the sample to the write, and from there to the ladder showing it.
fn reactions(database: &Path) -> [Vec<f64>; 2] {
    let sql = "SELECT sample_to_write_ms AS ms, write_to_seen_ms AS seen FROM reactions";
    let told = stdout(&run(&["history", "query", "--history", text(database), "--json", "--sql", sql]));
    let document: Value = serde_json::from_str(&told).expect("JSON");
    let rows = document["rows"].as_array().expect("rows");
    ["ms", "seen"].map(|name| {
        let mut values: Vec<f64> = rows.iter().filter_map(|row| row[name].as_f64()).collect();
        values.sort_by(f64::total_cmp);
        values
    })
}

/// The value below which this share lies.
fn at(values: &[f64], share: f64) -> f64 {
    values[((values.len() as f64 * share) as usize).min(values.len() - 1)]
}

/// A script that wants another override at every tick while the machine cuts: the lateness of the tick, merge,
/// estimates, scripts, gate, and the way to the thread that writes.
///
/// `cargo test --release --test box added_latency -- --ignored --nocapture`
#[test]
#[ignore = "4 minutes: time from a reading to the issued write, in real time; a loaded computer does not keep its limits"]
fn added_latency_from_sample_to_issued_write() {
    let directory = tempfile::tempdir().expect("a directory");
    let config = prepared(directory.path(), "simulated://lathe?dropouts_per_h=0&begun_s=110");
    let written = std::fs::read_to_string(&config).expect("readable");
    let quick = "[gate]\nmin_interval_s = 0.0\ndead_band_pct = 0.0\nslew_up_pct_per_s = 100.0";
    std::fs::write(&config, written.replace("[gate]", quick)).expect("a configuration");
    let turning = "let n = memory.n ?? 0.0; memory.n = 1.0 - n;\n\
                   request_feed_override(if n > 0.0 { 80 } else { 85 }, \"to and fro\");";
    std::fs::write(directory.path().join("data/scripts/slow.rhai"), turning).expect("a script");
    let (gateway, address) = start(&config, "1");
    wait_for("a decision", Duration::from_secs(60), || gate(&address)["permitted_pct"].is_number().then_some(()));
    assert_eq!(order(&config, &["arm", "--by", "fitter"]).0, Some(0));
    let database = directory.path().join("data/history.db");
    wait_for("enough writes", Duration::from_secs(1200), || {
        std::thread::sleep(Duration::from_secs(20));
        (reactions(&database)[0].len() >= WRITES).then_some(())
    });
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let said = gateway.stop();
    let priority = said.lines().find(|line| line.contains("tick and writing have")).unwrap_or_default();
    let [write, seen] = reactions(&database);
    let added = |share: f64| at(&write, share) - MERGE_DELAY_MS;
    println!("{priority}; load {}", load.trim());
    println!(
        "{} writes: added by the gateway p50 {:.3} ms, p90 {:.3}, p99 {:.3}, p99.9 {:.3}, greatest {:.3}; from the write to the \
         ladder showing it p50 {:.1} ms, p99 {:.1}",
        write.len(),
        added(0.5),
        added(0.9),
        added(0.99),
        added(0.999),
        added(1.0),
        at(&seen, 0.5),
        at(&seen, 0.99)
    );
    assert!(write.len() >= WRITES && added(0.99) <= 1.0, "{} writes, p99 {} ms", write.len(), added(0.99));
}
