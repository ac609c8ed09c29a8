//! A day of a bad line, in accelerated time: a worker polls once per second of a clock that jumps, and every few minutes
//! something goes wrong.

use crate::fanuc::support::{address, controller, serve};
use adapters::address::Target;
use adapters::clock::{Clock, SECOND_NS, TimeNs};
use adapters::fanuc::open::open_native;
use adapters::fanuc_server::{InjectedFault, Server, ServerSettings};
use adapters::worker::{Worker, WorkerSettings, WorkerState};
use adapters::{ChannelId, Reading, Source, SourceError};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::{Duration, Instant};

/// Nobody waits on this clock: it jumps.
#[derive(Default)]
struct JumpingClock(AtomicI64);

impl Clock for JumpingClock {
    fn now_ns(&self) -> TimeNs {
        self.0.load(Ordering::SeqCst)
    }

    fn sleep_until(&self, until_ns: TimeNs) {
        self.0.fetch_max(until_ns, Ordering::SeqCst);
    }
}

/// What goes wrong in a stretch of five minutes, from the seed.
fn fault(stretch: i64) -> InjectedFault {
    let mut random = Pcg64Mcg::seed_from_u64(20_261_121 ^ stretch.unsigned_abs());
    match random.random_range(0..20) {
        0 => InjectedFault::Reset,
        1 => InjectedFault::WrongEcho,
        2 => InjectedFault::WrongMagic,
        3 | 4 => InjectedFault::PowerOff,
        5 => InjectedFault::NoSession,
        6 => InjectedFault::WrongCount,
        7 => InjectedFault::Silence,
        _ => InjectedFault::None,
    }
}

/// A source whose line goes wrong by the clock.
struct Flapping {
    inner: Box<dyn Source>,
    server: Arc<Server>,
}

impl Source for Flapping {
    fn name(&self) -> &str {
        self.inner.name()
    }

    fn channels(&self) -> &[ChannelId] {
        self.inner.channels()
    }

    fn period(&self) -> Duration {
        self.inner.period()
    }

    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        // A short fault every five minutes, so that most of the day is well.
        let (stretch, within_s) = (clock.now_ns() / (300 * SECOND_NS), clock.now_ns() / SECOND_NS % 300);
        self.server.inject_fault(if within_s < 30 { fault(stretch) } else { InjectedFault::None });
        self.inner.read(clock, out)
    }
}

fn day(hours: i64) {
    let server = Arc::new(serve(controller(4), ServerSettings::default()));
    let address = address(&server, "timeout_ms=50&period_ms=1000&duty_pct=100");
    let Target::Fanuc { at, path, options, .. } = address.target() else { panic!("{address}") };
    let opened = open_native(address.text(), at, *path, options);
    let (line, inner) = (opened.line, opened.sources.into_iter().next().expect("the quick group"));
    let clock = Arc::new(JumpingClock::default());
    let (began, files) = (Instant::now(), open_files());
    let source = Box::new(Flapping { inner, server: server.clone() });
    let worker = Worker::start(source, clock.clone(), WorkerSettings::default()).expect("a thread");
    let (mut polls, mut well) = (0u64, 0u64);
    while clock.now_ns() < hours * 3600 * SECOND_NS {
        worker.drain(|poll| {
            polls += 1;
            well += u64::from(poll.error.is_none());
        });
        std::thread::sleep(Duration::from_millis(5));
    }
    let (stats, counts) = (worker.stats(clock.now_ns()), line.counts());
    worker.join();
    println!(
        "{hours} h in {:.1} s: {polls} polls, {well} well, {} failures; {} connections, {} broken, {} not opened",
        began.elapsed().as_secs_f64(),
        stats.failures,
        counts.connections,
        counts.broken,
        counts.refused
    );
    assert!(matches!(stats.state, WorkerState::Reading | WorkerState::Failing | WorkerState::Off | WorkerState::Stuck));
    assert!(well * 10 > polls * 8, "most of the day was well: {well} of {polls}");
    assert!(counts.connections > 2 && counts.broken > 2);
    assert!(open_files() < files + 60, "no open file is left behind");
    assert!(server.count_sessions() <= 2);
}

fn open_files() -> usize {
    std::fs::read_dir("/proc/self/fd").map_or(0, Iterator::count)
}

#[test]
fn two_hours_of_flapping() {
    day(2);
}

/// `cargo test --test controllers a_day_of_flapping -- --ignored --nocapture`
#[test]
#[ignore = "30 seconds: 24 h of a flapping FANUC line leak nothing"]
fn a_day_of_flapping() {
    day(24);
}
