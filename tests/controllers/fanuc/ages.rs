//! How old is what is delivered? The control counts milliseconds in the number of the block; every delivered value is held
//! against the clock. Nothing is old when its source says it is fresh, nothing is fresh while polls fail, and what is over is over soon.
//!
//! `cargo test --test controllers fanuc::ages -- --nocapture` prints the table.

use crate::fanuc::support::{controller, opened};
use crate::fanuc::vendor::{library, opened_in, settings};
use adapters::clock::{Clock, SystemClock};
use adapters::fanuc_server::{Controller, InjectedFault, ServedControl, Server, ServerSettings};
use adapters::merge::{Delay, Merge, SourceId, SourcePlan};
use adapters::worker::{Worker, WorkerSettings, WorkerState};
use adapters::{ChannelId, Sample, Source};
use std::net::TcpListener;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A control whose block number is the milliseconds since the beginning.
struct Counting(Controller, Instant);

impl ServedControl for Counting {
    fn update_controller(&mut self) -> Option<&mut Controller> {
        self.0.sequence = self.1.elapsed().as_millis() as i32;
        Some(&mut self.0)
    }
}

/// What a stretch of time showed.
#[derive(Debug, Default)]
struct Seen {
    values: u32,
    /// Greatest age of a delivered value against the truth, s.
    oldest_s: f64,
    /// The same in periods that were in force at that moment.
    oldest_periods: f64,
    /// The truth of the last delivered value, ms since the beginning.
    last_ms: f64,
    /// Values that were delivered while the last poll had failed.
    fresh_while_failing: u32,
    /// Until the wanted period was kept again and a value was there, s.
    back_s: f64,
}

struct Stand {
    clock: Arc<SystemClock>,
    workers: Vec<Worker>,
    merge: Merge,
    began: Instant,
    began_ns: i64,
}

/// Time between two ticks.
const TICK: Duration = Duration::from_millis(20);
const WANTED: Duration = Duration::from_millis(100);

impl Stand {
    fn new(sources: Vec<Box<dyn Source>>, began: Instant) -> Self {
        let clock = Arc::new(SystemClock::new());
        let began_ns = clock.now_ns() - began.elapsed().as_nanos() as i64;
        let plans: Vec<SourcePlan> = sources.iter().map(|source| SourcePlan::from_source(source.as_ref())).collect();
        let merge = Merge::new(&plans, Delay::SlowestPeriod);
        let start = |source| Worker::start(source, clock.clone(), WorkerSettings::default()).expect("a thread");
        let workers = sources.into_iter().map(start).collect();
        Self { clock, workers, merge, began, began_ns }
    }

    /// Looks until `done` says so; `truth` is the count that a delivered value stands for.
    fn look(&mut self, mut done: impl FnMut(&Seen, f64, bool) -> bool) -> Seen {
        let block = ChannelId::from_name("block").expect("in the table");
        let (mut seen, mut sample, from) = (Seen::default(), Sample::new_empty(0), self.began.elapsed());
        loop {
            std::thread::sleep(TICK);
            for (index, worker) in self.workers.iter().enumerate() {
                worker.drain_into(&mut self.merge, SourceId(index));
            }
            let now_ns = self.clock.now_ns();
            let stats = self.workers[0].stats(now_ns);
            let at_ns = now_ns - self.merge.delay_ns();
            self.merge.sample_into(&mut sample, at_ns);
            let value = sample.text(block).map(|text| text.trim_start_matches('N').parse::<f64>().expect("a count"));
            if let Some(count_ms) = value {
                // What the value claims to be is true at the instant of the sample.
                let age_s = ((at_ns - self.began_ns) as f64 / 1e6 - count_ms) / 1e3;
                seen.values += 1;
                seen.last_ms = count_ms;
                if age_s > seen.oldest_s {
                    (seen.oldest_s, seen.oldest_periods) = (age_s, age_s / stats.pace.as_secs_f64());
                }
                // The last failure ended before the instant of the sample, and nothing has come since.
                let failing = stats.state == WorkerState::Failing && at_ns > stats.state_since_ns;
                seen.fresh_while_failing += u32::from(failing);
            }
            let kept = stats.pace <= WANTED * 11 / 10 && value.is_some() && stats.state == WorkerState::Reading;
            let after_s = (self.began.elapsed() - from).as_secs_f64();
            if done(&seen, after_s, kept) {
                seen.back_s = after_s;
                return seen;
            }
        }
    }

    fn settle(&mut self) {
        self.look(|seen, after_s, kept| assert_in_time(after_s, 20.0) && kept && seen.values > 20);
    }
}

fn assert_in_time(after_s: f64, most_s: f64) -> bool {
    assert!(after_s < most_s, "not within {most_s} s");
    true
}

/// A fault for so long, then until all is as it was.
fn row(what: &str, fault: InjectedFault, seconds: f64, keys: &str) -> Seen {
    let began = Instant::now();
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let control = Counting(controller(4), began);
    let server = Server::start(listener, Box::new(control), ServerSettings::default()).expect("threads");
    let mut stand = Stand::new(opened(&server, keys).sources, began);
    stand.settle();
    server.inject_fault(fault);
    let during = stand.look(|_, after_s, _| after_s >= seconds);
    server.inject_fault(InjectedFault::None);
    // What still waits in the control may be late; only a value from after the fault says that it is over.
    let over_ms = stand.began.elapsed().as_secs_f64() * 1e3;
    let after = stand.look(|seen, after_s, kept| assert_in_time(after_s, 40.0) && kept && seen.last_ms > over_ms);
    told(what, during, after)
}

fn told(what: &str, during: Seen, after: Seen) -> Seen {
    let worst = if during.oldest_s > after.oldest_s { &during } else { &after };
    let seen = Seen {
        values: during.values + after.values,
        oldest_s: worst.oldest_s,
        oldest_periods: worst.oldest_periods,
        fresh_while_failing: during.fresh_while_failing + after.fresh_while_failing,
        back_s: after.back_s,
        last_ms: after.last_ms,
    };
    println!(
        "{what}: n = {} values, greatest age {:.2} s = {:.1} periods in force, {} fresh while failing, back after {:.2} s",
        seen.values, seen.oldest_s, seen.oldest_periods, seen.fresh_while_failing, seen.back_s
    );
    assert_eq!(seen.fresh_while_failing, 0, "{what}");
    // Half a period for the tick and the thread of a busy computer.
    assert!(seen.oldest_periods < 2.5 || seen.oldest_s < 0.35, "{what}: {seen:?}");
    seen
}

/// 1.5 s for an answer is within the patience of 3 s.
const PATIENT: &str = "timeout_ms=3000";

#[test]
fn ages_through_a_hiccup() {
    let hiccup = row("one answer of 1.5 s", InjectedFault::Delay(Duration::from_millis(1500)), 0.2, PATIENT);
    // From the end of the fault on, of which most is the answer itself.
    assert!(hiccup.back_s < 1.5 + 1.5, "{hiccup:?}");
}

#[test]
fn ages_through_a_slow_spell() {
    let slow = row("10 s of answers of 1.5 s", InjectedFault::Delay(Duration::from_millis(1500)), 10.0, PATIENT);
    assert!(slow.back_s < 1.5 + 3.5, "{slow:?}");
}

#[test]
fn ages_through_everything_that_is_no_answer() {
    for (what, fault) in [
        ("corrupt", InjectedFault::WrongMagic),
        ("wrong echo", InjectedFault::WrongEcho),
        ("blackhole", InjectedFault::Blackhole),
        ("fragment", InjectedFault::Truncated),
    ] {
        let seen = row(what, fault, 4.0, "timeout_ms=500");
        assert!(seen.back_s < 4.0, "{what}: {seen:?}");
    }
}

#[test]
#[ignore = "2 minutes: ages through 10 s of every fault, natively, and of slow calls of a library of ours"]
fn ages_in_full() {
    for (what, fault) in [
        ("corrupt", InjectedFault::WrongMagic),
        ("wrong echo", InjectedFault::WrongEcho),
        ("blackhole", InjectedFault::Blackhole),
        ("fragment", InjectedFault::Truncated),
        ("byte by byte", InjectedFault::ByteByByte(Duration::from_millis(5))),
    ] {
        row(what, fault, 10.0, "");
    }
    let library = library(&[]);
    let mut settings = settings(&library);
    settings.deadline = Some(Duration::from_secs(4));
    let began = Instant::now();
    let mut stand = Stand::new(opened_in(settings, "fanuc://fake").sources, began);
    std::thread::sleep(Duration::from_secs(3));
    library.fault("wait any 80");
    std::thread::sleep(Duration::from_secs(10));
    library.well();
    let from = Instant::now();
    while stand.workers[0].stats(stand.clock.now_ns()).pace > WANTED * 3 {
        assert!(from.elapsed() < Duration::from_secs(20), "the library's pace comes back");
        std::thread::sleep(TICK);
    }
    println!("vendor library, 10 s of a call of 1.5 s: back to its pace after {:.2} s", from.elapsed().as_secs_f64());
    stand.workers.drain(..).for_each(Worker::join);
}
