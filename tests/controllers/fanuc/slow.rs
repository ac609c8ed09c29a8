//! Controls that answer slowly: no sample is stale, the duty is kept, and the real period is told.
//!
//! `cargo test --test controllers slow_controls -- --ignored --nocapture` prints the whole table.

use crate::fanuc::support::{controller, serve};
use crate::fanuc::vendor::{library, settings};
use adapters::address::{Address, Target};
use adapters::clock::{Clock, SystemClock};
use adapters::driver::FactValue;
use adapters::fanuc::line::Connect;
use adapters::fanuc::open::{self, OpenedFanuc};
use adapters::fanuc::vendor::Vendor;
use adapters::fanuc_server::{InjectedFault, ServerSettings};
use adapters::merge::{Delay, Merge, SourceId, SourcePlan};
use adapters::worker::{Worker, WorkerSettings};
use adapters::{ChannelId, Sample};
use std::sync::Arc;
use std::time::Duration;

/// What a run of some seconds shows.
struct Seen {
    /// Share of the samples with a value that was too old or missing after the first value, per mille.
    stale: u64,
    samples: u64,
    /// Median interval between two polls of the quick group, s.
    kept_s: f64,
    /// The same as the source tells it, ms.
    told_ms: f64,
    /// Share of the time in which the control was asked, %.
    busy_pct: f64,
    missed: u64,
}

/// As the gateway does it: a thread per group, merged at 10 Hz.
fn watched(opened: OpenedFanuc, seconds: f64) -> Seen {
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let plans: Vec<SourcePlan> = opened.sources.iter().map(|source| SourcePlan::from_source(source.as_ref())).collect();
    let mut merge = Merge::new(&plans, Delay::SlowestPeriod);
    let start = |source| Worker::start(source, clock.clone(), WorkerSettings::default()).expect("a thread");
    let workers: Vec<Worker> = opened.sources.into_iter().map(start).collect();
    let channels = ["feed_mm_min", "spindle_speed_rpm", "execution", "part_count"];
    let channels = channels.map(|name| ChannelId::from_name(name).expect("in the table"));
    let (mut known, mut stale, mut samples) = ([false; 4], 0, 0);
    let (mut sample, begun_ns) = (Sample::new_empty(0), clock.now_ns());
    let until_ns = begun_ns + (seconds * 1e9) as i64;
    let mut tick_ns = begun_ns;
    while tick_ns < until_ns {
        tick_ns += 100_000_000;
        clock.sleep_until(tick_ns);
        for (index, worker) in workers.iter().enumerate() {
            worker.drain_into(&mut merge, SourceId(index));
        }
        merge.sample_into(&mut sample, clock.now_ns() - merge.delay_ns());
        for (known, channel) in known.iter_mut().zip(channels) {
            let there = sample.slot(channel).value.is_ok();
            *known |= there;
            samples += u64::from(*known);
            stale += u64::from(*known && !there);
        }
    }
    let stats = workers[0].stats(clock.now_ns());
    let all: Vec<_> = workers.iter().map(|worker| worker.stats(clock.now_ns())).collect();
    let answer_s = |at: usize, name: &str| fact(&all[at].facts, name) / 1000.0 * all[at].polls as f64;
    let busy_s = answer_s(0, "fast_group_answer_ms") + answer_s(1, "slow_group_answer_ms");
    let told_ms = fact(&stats.facts, "fast_group_period_ms");
    workers.into_iter().for_each(Worker::join);
    Seen {
        stale: 1000 * stale / samples.max(1),
        samples,
        kept_s: stats.period_kept.p50.as_secs_f64(),
        told_ms,
        busy_pct: 100.0 * busy_s / seconds,
        missed: stats.missed,
    }
}

fn fact(facts: &[adapters::Fact], name: &str) -> f64 {
    let found = facts.iter().find(|fact| fact.name == name).map(|fact| fact.value.clone());
    match found {
        Some(FactValue::Number(number)) => number,
        other => panic!("{name}: {other:?}"),
    }
}

fn native(delay_ms: u64, seconds: f64) -> Seen {
    let server = serve(controller(4), ServerSettings::default());
    server.inject_fault(InjectedFault::Delay(Duration::from_millis(delay_ms)));
    let address: Address = format!("fanuc://{}", server.address()).parse().expect("usable");
    let Target::Fanuc { at, path, options, .. } = address.target() else { panic!("{address}") };
    watched(open::open_native(address.text(), at, *path, options), seconds)
}

fn vendor(call_ms: u64, seconds: f64) -> Seen {
    let library = library(&[]);
    library.fault(&format!("wait any {call_ms}"));
    let settings = settings(&library);
    let settings = adapters::fanuc::vendor::VendorSettings { deadline: Some(Duration::from_secs(10)), ..settings };
    let connect: Connect = Box::new(move || Ok(Box::new(Vendor::connect(settings.clone())?)));
    let address: Address = "fanuc://fake".parse().expect("usable");
    let Target::Fanuc { path, options, .. } = address.target() else { panic!("{address}") };
    watched(open::open_controller(address.text(), connect, *path, options), seconds)
}

fn told(what: &str, seen: &Seen) {
    println!(
        "{what}: {} of 1000 samples stale (n = {}), period kept {:.2} s, told {:.2} s, busy {:.0} %, missed beats {}",
        seen.stale,
        seen.samples,
        seen.kept_s,
        seen.told_ms / 1000.0,
        seen.busy_pct,
        seen.missed
    );
    assert_eq!(seen.stale, 0, "{what}");
    assert!(seen.busy_pct < 60.0, "{what}: {} % of the control's time, 50 are allowed", seen.busy_pct);
    assert!(seen.told_ms / 1000.0 > 0.6 * seen.kept_s, "{what}: {} s is told", seen.told_ms / 1000.0);
}

#[test]
fn a_slow_control_gives_no_stale_sample() {
    told("native, 200 ms per frame", &native(200, 6.0));
    told("vendor library, 10 ms per call", &vendor(10, 6.0));
}

#[test]
#[ignore = "4 minutes: stale share of slow controls, six delays and six call times"]
fn slow_controls_in_full() {
    for delay_ms in [0, 60, 120, 200, 300, 500] {
        told(&format!("native, {delay_ms} ms per frame"), &native(delay_ms, 20.0));
    }
    for call_ms in [1, 5, 10, 20, 35, 50] {
        told(&format!("vendor library, {call_ms} ms per call"), &vendor(call_ms, 20.0));
    }
}
