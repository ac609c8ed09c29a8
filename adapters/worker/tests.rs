//! Workers with real threads and sources that misbehave.

use super::*;
use crate::channel::ChannelId;
use crate::clock::{ScaledClock, SystemClock};
use crate::merge::{Delay, SourcePlan};
use crate::reading::{Absence, Stamp};
use crate::recording::read_csv;
use crate::replay::{LiveReplay, Replay};
use crate::sample::Sample;
use std::sync::atomic::AtomicU32;

const PERIOD: Duration = Duration::from_millis(5);

/// What the source does at its n-th poll.
type Behaviour = Box<dyn Fn(u32) -> Result<(), SourceError> + Send>;

struct Faulty {
    channels: [ChannelId; 1],
    polls: Arc<AtomicU32>,
    behaviour: Behaviour,
}

impl Source for Faulty {
    fn name(&self) -> &str {
        "faulty"
    }

    fn channels(&self) -> &[ChannelId] {
        &self.channels
    }

    fn period(&self) -> Duration {
        PERIOD
    }

    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        let poll = self.polls.fetch_add(1, Ordering::SeqCst);
        (self.behaviour)(poll)?;
        out.push(Reading::from_number(self.channels[0], Stamp::from_exact_time(clock.now_ns()), f64::from(poll)));
        Ok(())
    }
}

fn quick() -> WorkerSettings {
    WorkerSettings {
        backoff_min: Duration::from_millis(20),
        backoff_max: Duration::from_millis(60),
        off_pause: Duration::from_millis(10),
        deadline: Duration::from_millis(50),
        ..WorkerSettings::default()
    }
}

fn part_count() -> ChannelId {
    ChannelId::from_name("part_count").expect("in the table")
}

fn start(settings: WorkerSettings, behaviour: Behaviour) -> (Worker, Arc<AtomicU32>, Arc<SystemClock>) {
    let (polls, clock) = (Arc::new(AtomicU32::new(0)), Arc::new(SystemClock::new()));
    let source = Faulty { channels: [part_count()], polls: polls.clone(), behaviour };
    (Worker::start(Box::new(source), clock.clone(), settings).expect("a thread"), polls, clock)
}

/// Waits until the source was polled so often; the test fails after ten seconds.
fn wait_for(polls: &AtomicU32, count: u32) {
    wait_until(|| polls.load(Ordering::SeqCst) >= count);
}

fn wait_until(mut done: impl FnMut() -> bool) {
    for _ in 0..10_000 {
        if done() {
            return;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("nothing happened for ten seconds");
}

fn line() -> SourceError {
    SourceError::Line { source_name: "faulty".into(), what: "reset".into(), next: "Check the cable.".into() }
}

#[test]
fn a_good_source_keeps_its_pace_and_reaches_the_merge() {
    let (worker, polls, clock) = start(quick(), Box::new(|_| Ok(())));
    let plan = SourcePlan { name: "faulty".into(), channels: vec![part_count()], period: PERIOD, stand_in: vec![] };
    let mut merge = Merge::new(&[plan], Delay::default());
    wait_for(&polls, 40);
    assert!(worker.drain_into(&mut merge, SourceId(0)) >= 39);
    let mut sample = Sample::new_empty(0);
    merge.sample_into(&mut sample, clock.now_ns());
    assert!(merge.counts(SourceId(0)).readings >= 39);
    let stats = worker.stats(clock.now_ns());
    assert_eq!((stats.state, stats.failures, stats.dropped), (WorkerState::Reading, 0, 0));
    assert!(stats.period_kept.p50 >= PERIOD * 9 / 10, "{stats:?}");
    assert!(stats.polls >= 39 && stats.last_error.is_none());
    worker.join();
}

#[test]
fn failures_are_retried_after_pauses_and_told() {
    let (worker, polls, clock) = start(quick(), Box::new(|poll| if poll < 4 { Err(line()) } else { Ok(()) }));
    let began_ns = clock.now_ns();
    wait_for(&polls, 3);
    assert_eq!(worker.stats(clock.now_ns()).state, WorkerState::Failing);
    wait_for(&polls, 6);
    // Pauses: 5 (the next beat), then 20 ms, the shortest, three times.
    assert!(clock.now_ns() - began_ns >= 65_000_000);
    let stats = worker.stats(clock.now_ns());
    assert_eq!((stats.state, stats.failures, stats.last_error), (WorkerState::Reading, 4, Some(line())));
    assert!(stats.last_error_since_ns.is_some());
    worker.join();
}

#[test]
fn a_machine_that_is_off_is_no_failure() {
    let off = || SourceError::Off { source_name: "faulty".into() };
    let (worker, polls, clock) = start(quick(), Box::new(move |_| Err(off())));
    wait_for(&polls, 4);
    let stats = worker.stats(clock.now_ns());
    assert_eq!((stats.state, stats.failures, stats.last_error), (WorkerState::Off, 0, None));
    let plan = SourcePlan { name: "faulty".into(), channels: vec![part_count()], period: PERIOD, stand_in: vec![] };
    let (mut merge, mut sample) = (Merge::new(&[plan], Delay::default()), Sample::new_empty(0));
    worker.drain_into(&mut merge, SourceId(0));
    merge.sample_into(&mut sample, clock.now_ns());
    assert_eq!(sample.number(part_count()), Err(Absence::MachineOff));
    worker.join();
}

#[test]
fn a_poll_that_does_not_return_is_shown_as_stuck() {
    let (worker, polls, clock) = start(
        quick(),
        Box::new(|poll| {
            std::thread::sleep(Duration::from_millis(if poll == 1 { 400 } else { 0 }));
            Ok(())
        }),
    );
    wait_for(&polls, 2);
    wait_until(|| worker.stats(clock.now_ns()).state == WorkerState::Stuck);
    wait_until(|| worker.stats(clock.now_ns()).state == WorkerState::Reading);
    assert!(worker.stats(clock.now_ns()).missed >= 50, "{:?}", worker.stats(clock.now_ns()));
    worker.join();
}

#[test]
fn a_driver_that_panics_is_caught() {
    let (worker, polls, clock) = start(quick(), Box::new(|poll| if poll == 0 { panic!("a bug") } else { Ok(()) }));
    wait_for(&polls, 3);
    let stats = worker.stats(clock.now_ns());
    assert!(matches!(stats.last_error, Some(SourceError::Decode { .. })), "{stats:?}");
    worker.join();
}

#[test]
fn the_queue_is_bounded_and_the_newest_survives() {
    let settings = WorkerSettings { queue_polls: 4, ..quick() };
    let (worker, polls, clock) = start(settings, Box::new(|_| Ok(())));
    wait_for(&polls, 12);
    worker.stop();
    wait_until(|| worker.is_finished());
    let mut last = None;
    let waiting = worker.drain(|poll| last = poll.readings.last().and_then(|reading| reading.value.clone().ok()));
    assert_eq!(waiting, 4);
    let asked = f64::from(polls.load(Ordering::SeqCst) - 1);
    assert_eq!(last.and_then(|value| value.as_number()), Some(asked));
    let stats = worker.stats(clock.now_ns());
    assert_eq!(stats.dropped, stats.polls - 4);
    assert_eq!(stats.state, WorkerState::Stopped);
}

#[test]
fn the_end_of_a_recording_ends_the_thread() {
    let end = || SourceError::End { source_name: "faulty".into() };
    let (worker, _, clock) = start(quick(), Box::new(move |poll| if poll == 2 { Err(end()) } else { Ok(()) }));
    wait_until(|| worker.is_finished());
    assert_eq!(worker.stats(clock.now_ns()).state, WorkerState::Ended);
}

#[test]
fn the_same_error_after_a_good_poll_is_a_new_one() {
    let (worker, polls, clock) = start(quick(), Box::new(|poll| if poll % 20 == 3 { Err(line()) } else { Ok(()) }));
    wait_for(&polls, 6);
    let first = worker.stats(clock.now_ns()).last_error_since_ns;
    wait_for(&polls, 26);
    let second = worker.stats(clock.now_ns()).last_error_since_ns;
    assert!(first.is_some() && second > first, "{first:?} {second:?}");
    worker.join();
}

#[test]
fn a_recording_replayed_by_the_clock_arrives_in_full() {
    let rows: String = (0..200).map(|row| format!("{},{row}\n", f64::from(row) / 10.0)).collect();
    let read = read_csv(format!("time_s,part_count\n{rows}").as_bytes(), "test.csv").expect("readable");
    let replay = LiveReplay::new(Replay::new("replay:test.csv", &read.recording, 0), 1.0);
    let clock: Arc<dyn Clock> = Arc::new(ScaledClock::new(100.0));
    let plans = [SourcePlan::from_source(&replay)];
    let worker = Worker::start(Box::new(replay), clock.clone(), WorkerSettings::default()).expect("a thread");
    let (mut merge, mut sample, mut seen) = (Merge::new(&plans, Delay::default()), Sample::new_empty(0), Vec::new());
    while !worker.is_finished() {
        worker.drain_into(&mut merge, SourceId(0));
        merge.sample_into(&mut sample, clock.now_ns() - merge.delay_ns());
        seen.extend(sample.number(part_count()));
    }
    worker.drain_into(&mut merge, SourceId(0));
    assert_eq!(merge.counts(SourceId(0)).readings, 200);
    assert!(!seen.is_empty() && seen.is_sorted());
}

#[test]
fn a_slow_source_is_believed_its_own_pace() {
    let (worker, polls, clock) = start(
        quick(),
        Box::new(|_| {
            std::thread::sleep(Duration::from_millis(12));
            Ok(())
        }),
    );
    wait_for(&polls, 20);
    let plan = SourcePlan { name: "faulty".into(), channels: vec![part_count()], period: PERIOD, stand_in: vec![] };
    let (mut merge, mut sample) = (Merge::new(&[plan], Delay::Fixed(Duration::ZERO)), Sample::new_empty(0));
    worker.stop();
    wait_until(|| worker.is_finished());
    worker.drain_into(&mut merge, SourceId(0));
    merge.sample_into(&mut sample, clock.now_ns());
    // Three promised periods after the newest reading it still counts, because the kept period is three times longer.
    let newest_ns = sample.at_ns - sample.slot(part_count()).age_ns;
    merge.sample_into(&mut sample, newest_ns + 15_000_000);
    assert!(sample.number(part_count()).is_ok(), "{:?}", sample.slot(part_count()));
    worker.join();
}

/// A control that takes six seconds for a poll until half a minute is over, and says so.
struct Spell {
    channels: [ChannelId; 1],
    polls_ns: Arc<Mutex<Vec<(TimeNs, TimeNs)>>>,
    began_ns: Option<TimeNs>,
    slow: bool,
}

impl Source for Spell {
    fn name(&self) -> &str {
        "spell"
    }

    fn channels(&self) -> &[ChannelId] {
        &self.channels
    }

    fn period(&self) -> Duration {
        Duration::from_millis(500)
    }

    fn achievable_period(&self) -> Duration {
        if self.slow { Duration::from_secs(18) } else { self.period() }
    }

    fn read(&mut self, clock: &dyn Clock, _: &mut Vec<Reading>) -> Result<(), SourceError> {
        let asked_ns = clock.now_ns();
        self.slow = asked_ns - *self.began_ns.get_or_insert(asked_ns) < 30 * SECOND_NS;
        if self.slow {
            clock.sleep_until(asked_ns + 6 * SECOND_NS);
        }
        locked(&self.polls_ns).push((asked_ns, clock.now_ns()));
        Ok(())
    }
}

#[test]
fn after_a_slow_spell_the_source_is_asked_again_within_seconds() {
    let polls_ns = Arc::new(Mutex::new(Vec::new()));
    let clock: Arc<dyn Clock> = Arc::new(ScaledClock::new(50.0));
    let source = Spell { channels: [part_count()], polls_ns: polls_ns.clone(), began_ns: None, slow: false };
    let worker = Worker::start(Box::new(source), clock.clone(), WorkerSettings::default()).expect("a thread");
    wait_until(|| locked(&polls_ns).len() >= 8);
    worker.join();
    let polls = locked(&polls_ns).clone();
    let pauses: Vec<i64> = polls.windows(2).map(|pair| (pair[1].0 - pair[0].1) / 1_000_000).collect();
    println!("pauses {pauses:?} ms");
    // The stretched beat alone would wait for twelve seconds; a second is what a busy test machine may add at this speed.
    assert!(pauses.iter().all(|pause_ms| *pause_ms < 3_000), "{pauses:?} ms");
    assert!(pauses[..4].iter().all(|pause_ms| *pause_ms > 1_500), "a slow control is not hurried: {pauses:?} ms");
}
