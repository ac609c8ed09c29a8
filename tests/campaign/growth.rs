//! What grows: memory, descriptors and files of a box over simulated days and over real minutes under load, and its pace then.

use crate::box_under_test::Sending;
use crate::broker::Broker;
use crate::kills::status;
use crate::process::{Gateway, get, wait_for};
use crate::table::{Row, Scale};
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// What a process holds.
#[derive(Debug, Clone, Copy, Default)]
struct Held {
    resident_mb: f64,
    descriptors: usize,
    threads: usize,
}

fn held(pid: u32) -> Held {
    let told = fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
    let number = |name: &str| {
        let line = told.lines().find(|line| line.starts_with(name));
        line.and_then(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok()).unwrap_or(0.0)
    };
    let descriptors = fs::read_dir(format!("/proc/{pid}/fd")).map_or(0, Iterator::count);
    Held { resident_mb: number("VmRSS:") / 1024.0, descriptors, threads: number("Threads:") as usize }
}

fn files_mb(directory: &Path) -> f64 {
    let entries = fs::read_dir(directory).into_iter().flatten().filter_map(Result::ok);
    entries.filter_map(|entry| entry.metadata().ok()).map(|file| file.len() as f64).sum::<f64>() / 1e6
}

/// The greatest of each in a part of the run.
fn greatest(held: &[Held]) -> Held {
    held.iter().fold(Held::default(), |most, held| Held {
        resident_mb: most.resident_mb.max(held.resident_mb),
        descriptors: most.descriptors.max(held.descriptors),
        threads: most.threads.max(held.threads),
    })
}

/// The second quarter against the last: after that caches are full.
fn compare(all: &[Held], row: &mut Row, allowed_mb: f64) -> String {
    let quarter = (all.len() / 4).max(1);
    let (second, last) = (
        greatest(&all[quarter.min(all.len() - 1)..(2 * quarter).min(all.len())]),
        greatest(&all[all.len() - quarter..]),
    );
    let grown = last.resident_mb - second.resident_mb;
    row.must(grown < allowed_mb, format!("memory grew by {grown:.0} MB"));
    row.must(
        last.descriptors <= second.descriptors + 10,
        format!("{} descriptors became {}", second.descriptors, last.descriptors),
    );
    row.must(last.threads <= second.threads + 4, format!("{} threads became {}", second.threads, last.threads));
    format!(
        "memory {:.0} MB in the second quarter, {:.0} MB in the last; descriptors {}, {}; threads {}, {}",
        second.resident_mb, last.resident_mb, second.descriptors, last.descriptors, second.threads, last.threads
    )
}

/// Three days as fast as the box goes, with a receiver that is not there.
pub(crate) fn hours(scale: &Scale) -> Row {
    let mut row = Row::new("--speed max over 72 h of machine time, with a broker that is not there; /proc each second");
    let directory = tempfile::tempdir().expect("a directory");
    let (data, config) = (directory.path().join("data"), directory.path().join("box.toml"));
    let sink = "[[source]]\naddress = \"simulated://lathe?seed=3\"\n[[sink]]\nname = \"plant\"\naddress = \"mqtt://127.0.0.1:1/works/lathe\"\n";
    fs::write(&config, sink).expect("written");
    let hours = 72.0 * scale.time(Duration::from_secs(1000), Duration::from_secs(20)).as_secs_f64() / 1000.0;
    let seconds = format!("{:.0}", hours * 3600.0);
    let arguments = ["--config", config.to_str().expect("a path"), "--speed", "max", "--for", &seconds];
    let mut gateway = Gateway::start(&data, &arguments);
    let (began, mut all, mut files) = (Instant::now(), Vec::new(), Vec::new());
    while !gateway.has_ended() && began.elapsed() < Duration::from_secs(5400) {
        all.push(held(gateway.pid()));
        files.push(files_mb(&data));
        std::thread::sleep(Duration::from_secs(1));
    }
    row.must(gateway.has_ended(), "it did not come to its end");
    // The last looks are at a process that ends.
    all.truncate(all.len().saturating_sub(2).max(1));
    row.n = hours.round() as usize;
    let half = files.get(files.len() / 2).copied().unwrap_or(0.0);
    row.note = format!(
        "{}; files {half:.0} MB at half time, {:.0} MB at the end; {:.0} s",
        compare(&all, &mut row, 20.0),
        files_mb(&data),
        began.elapsed().as_secs_f64()
    );
    row
}

/// Clients that ask for everything, again and again.
fn crowd(address: &str, stop: &Arc<AtomicBool>) -> Vec<std::thread::JoinHandle<u64>> {
    let paths = ["/", "/api/v1/status", "/metrics", "/api/v1/history?channels=spindle_power_w&from=-5m"];
    let client = |path: &'static str| {
        let (address, stop) = (address.to_owned(), stop.clone());
        std::thread::spawn(move || {
            let mut asked = 0;
            while !stop.load(Ordering::SeqCst) {
                let _limited = std::panic::catch_unwind(|| get(&address, path));
                asked += 1;
                std::thread::sleep(Duration::from_millis(50));
            }
            asked
        })
    };
    paths.into_iter().map(client).collect()
}

fn under_load(row: &mut Row, lasts: Duration) -> Option<(Vec<Held>, f64, u64)> {
    let broker = Broker::start()?;
    let sending = Sending::to(&format!("mqtt://127.0.0.1:{}/works/lathe", broker.port), "");
    let pid = sending.gateway.as_ref().map_or(0, Gateway::pid);
    let stop = Arc::new(AtomicBool::new(false));
    let clients = crowd(sending.page(), &stop);
    let (began, mut all) = (Instant::now(), Vec::new());
    while began.elapsed() < lasts {
        all.push(held(pid));
        std::thread::sleep(Duration::from_secs(1));
    }
    let tick = wait_for("a status", Duration::from_secs(60), || status(sending.page()))["tick"].clone();
    stop.store(true, Ordering::SeqCst);
    let asked: u64 = clients.into_iter().map(|client| client.join().unwrap_or(0)).sum();
    row.n = usize::try_from(lasts.as_secs() / 60).unwrap_or(0);
    row.note = format!(
        "{} ticks, {} skipped and told, p99 late {} ms; {asked} requests",
        tick["count"], tick["skipped"], tick["late_p99_ms"]
    );
    Some((all, tick["late_p99_ms"].as_f64().unwrap_or(f64::MAX), asked))
}

/// R11: the tick under load. Whoever else has the processor has it here, too.
pub(crate) fn pace(scale: &Scale) -> Row {
    let mut row =
        Row::new("10 Hz with a sink and four clients that ask 20 times a second each; how late ticks are; n: minutes");
    let lasts = scale.time(Duration::from_secs(180), Duration::from_secs(20));
    let Some((_, late_ms, _)) = under_load(&mut row, lasts) else { return Row::skipped(row.how) };
    row.must(late_ms <= 20.0, format!("p99 {late_ms} ms late; the load of the computer was {}", load()));
    row
}

fn load() -> String {
    fs::read_to_string("/proc/loadavg").unwrap_or_default().split(' ').take(1).collect()
}

pub(crate) fn minutes(scale: &Scale) -> Row {
    let mut row = Row::new("20 real minutes with a sink and four clients that ask 20 times a second each; n: minutes");
    let lasts = scale.time(Duration::from_secs(1200), Duration::from_secs(30));
    let Some((all, ..)) = under_load(&mut row, lasts) else { return Row::skipped(row.how) };
    row.note = format!("{}; {}", compare(&all, &mut row, 10.0), row.note);
    row
}
