//! A long outage at 200 values a second: what it takes on disk and in memory, and how fast it is made up for.
//!
//! `OUTAGE_H=72 cargo test --release --test outputs outage -- --ignored --nocapture`

use crate::fake_sink::{FakeSink, Seen};
use adapters::{ChannelId, Sample, Slot, Value};
use gateway::history::{Options, Outbox, OutboxSettings, WhenFull, Writer};
use gateway::sinks::{Board, drive};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

const TICKS_PER_S: i64 = 10;
const BEGIN_NS: i64 = 1_700_000_000_000_000_000;
/// Twenty quantities that change at every tick: 200 values a second.
const VALUES: usize = 20;

/// Resident memory of this process, MB.
fn resident_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let line = status.lines().find(|line| line.starts_with("VmRSS")).expect("there");
    line.split_whitespace().nth(1).and_then(|kb| kb.parse::<f64>().ok()).expect("a number") / 1024.0
}

/// A tick with noise as meters have it, in their digits.
fn sample(tick: i64, channels: &[ChannelId], state: &mut u64) -> Sample {
    let mut sample = Sample::empty(BEGIN_NS + tick * 1_000_000_000 / TICKS_PER_S);
    for (index, channel) in channels.iter().enumerate() {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let noise = (*state >> 40) as f64 / f64::from(1 << 24) - 0.5;
        let slow = 40.0 * (tick as f64 / 600.0 + index as f64).sin();
        let number = ((50.0 + slow + 4.0 * noise) * 10.0).round() / 10.0;
        sample.set(*channel, Slot { value: Ok(Value::Number(number)), age_ns: 0 });
    }
    sample
}

#[test]
#[ignore = "5 minutes: an outage fits into the outbox and is made up for"]
fn an_outage_fits_and_is_made_up_for_without_delaying_live_data() {
    let hours: f64 = std::env::var("OUTAGE_H").ok().and_then(|hours| hours.parse().ok()).unwrap_or(2.0);
    let channels: Vec<ChannelId> =
        ChannelId::all().filter(|id| id.channel().holds(50.0) && id.channel().unit != "1").take(VALUES).collect();
    assert_eq!(channels.len(), VALUES);
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("history.db");
    let settings = OutboxSettings { max_age: Duration::from_secs(100 * 3600), ..OutboxSettings::default() };
    let outbox = Outbox::new("lathe", settings.clone(), ["plant".to_owned()]);
    let options = Options { outbox: Some(outbox.clone()), when_full: WhenFull::Wait, ..Options::default() };
    let writer = Writer::open(&path, options).expect("opens");
    let (mut state, mut tick) = (1, 0);
    let ticks = (hours * 3600.0) as i64 * TICKS_PER_S;
    let mut memory_before = None;
    while tick < ticks {
        writer.sample(&sample(tick, &channels, &mut state), &[]);
        tick += 1;
        // As live: a commit each half second.
        if tick % (TICKS_PER_S / 2) == 0 {
            writer.flush().expect("durable");
        }
        if tick == 3600 * TICKS_PER_S / 4 {
            memory_before = Some(resident_mb());
        }
    }
    let grown = resident_mb() - memory_before.expect("longer than a quarter of an hour");
    let figures = outbox.figures();
    let per_value = figures.bytes as f64 / (ticks as f64 * VALUES as f64);
    println!(
        "{hours} h: {:.1} MB waiting, {per_value:.2} bytes a value, fits {:.0} h, memory grew by {grown:.1} MB",
        figures.bytes as f64 / 1e6,
        figures.outage_fits_h(&settings).expect("known")
    );
    assert!(figures.bytes <= settings.max_bytes);
    let seen = Arc::new(Mutex::new(Seen::default()));
    let sink = FakeSink { seen: seen.clone(), batch: 256, takes_history: true };
    let board = Board::new(outbox.clone(), [("plant".to_owned(), "fake".to_owned())]);
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().expect("threads");
    let before = outbox.head().borrow().next_sequence;
    let began = Instant::now();
    let sinks = runtime
        .block_on(async { drive::start_with(vec![("plant".to_owned(), Box::new(sink))], &outbox, &board, &path) });
    let mut latest_ms: f64 = 0.0;
    while seen.lock().expect("whole").items.len() < (before - 1) as usize {
        // Live data goes on meanwhile, in real time.
        for _ in 0..TICKS_PER_S / 2 {
            writer.sample(&sample(tick, &channels, &mut state), &[]);
            tick += 1;
        }
        writer.flush().expect("durable");
        let (made, newest) = (Instant::now(), outbox.head().borrow().next_sequence - 1);
        while !seen.lock().expect("whole").items.iter().rev().take(2000).any(|(number, _)| *number == newest) {
            std::thread::sleep(Duration::from_millis(2));
            assert!(made.elapsed() < Duration::from_secs(30), "live data is late");
        }
        latest_ms = latest_ms.max(made.elapsed().as_secs_f64() * 1e3);
        std::thread::sleep(Duration::from_millis(500).saturating_sub(made.elapsed()));
    }
    let seconds = began.elapsed().as_secs_f64();
    let rate = before as f64 / seconds;
    println!(
        "{before} items made up for in {seconds:.1} s: {rate:.0} a second, {:.0} times the live rate; live data at most \
         {latest_ms:.0} ms after its commit; memory {:.1} MB",
        rate / TICKS_PER_S as f64,
        resident_mb()
    );
    runtime.block_on(sinks.stop());
    assert!(rate >= 10.0 * TICKS_PER_S as f64 && latest_ms < 1000.0);
}
