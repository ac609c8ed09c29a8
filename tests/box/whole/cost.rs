//! What the default run costs. `cargo test --release --test box whole::cost -- --ignored --nocapture` takes ten minutes.

use std::fs;
use std::thread;
use std::time::{Duration, Instant};
use testkit::process::{Gateway, get};
use testkit::process_status::status_figure;

/// Resident memory in MB and processor seconds of a process.
fn usage(pid: u32) -> (f64, f64) {
    let kilobytes = status_figure(&pid.to_string(), "VmRSS:").expect("running");
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).expect("running");
    let mut fields = stat.rsplit_once(')').expect("a name").1.split_whitespace().skip(11);
    let mut ticks = || fields.next().and_then(|text| text.parse::<f64>().ok()).expect("a number");
    (kilobytes / 1000.0, (ticks() + ticks()) / 100.0)
}

fn measured(length: Duration) -> (f64, f64) {
    let directory = tempfile::tempdir().expect("a directory");
    let mut gateway = Gateway::start(directory.path(), &[]);
    let address = gateway.address();
    let (began, (_, before)) = (Instant::now(), usage(gateway.pid()));
    while began.elapsed() < length {
        thread::sleep(Duration::from_secs(1));
        assert_eq!(get(&address, "/healthz").status, 200);
    }
    let (resident_mb, cpu_s) = usage(gateway.pid());
    let share = (cpu_s - before) / began.elapsed().as_secs_f64();
    println!("after {length:?}: {resident_mb:.1} MB resident, {:.2} % of a core at 10 Hz", 100.0 * share);
    gateway.stop();
    (resident_mb, share)
}

#[test]
fn ten_seconds_cost_little() {
    let (resident_mb, share) = measured(Duration::from_secs(10));
    assert!(resident_mb <= 60.0 && share <= 0.25, "{resident_mb} MB, {share}");
}

#[test]
#[ignore = "10 minutes: memory and processor of the default run"]
fn ten_minutes_cost_what_was_aimed_at() {
    let (resident_mb, share) = measured(Duration::from_secs(600));
    assert!(resident_mb <= 40.0 && share <= 0.05, "{resident_mb} MB, {share}");
}
