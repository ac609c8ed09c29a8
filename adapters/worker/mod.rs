//! One thread per source, at the source's own pace.
//!
//! Vendor libraries block for seconds; nothing else waits for them. The thread sleeps to absolute times, skips the
//! beats it missed and counts them, and fills a bounded queue from which the gateway takes what there is at each tick.
//! The pace is the one that was wanted until the source says that the device keeps a slower one; from then on it is polled, and
//! its values count as fresh, at that one. A poll that fails is repeated at the next beat; from the second failure on, the pause
//! is a quarter of the time for which nothing has come, from 1 s to 30 s: what is over is found out within a quarter of its
//! length. A machine that is off is a normal state and asked again every two seconds.

mod queue;
mod stats;

#[cfg(test)]
mod tests;

pub use queue::Poll;
pub use stats::{Spread, WorkerState, WorkerStats};

use crate::clock::{Clock, SECOND_NS, TimeNs};
use crate::driver::{Source, SourceError, SourceProblem};
use crate::merge::{Merge, SourceId};
use crate::plausibility::Plausibility;
use crate::reading::Reading;
use adapter_core::integer::saturate_to_wait_ns;
use adapter_core::threads::reach_fault_point;
use queue::Queue;
use stats::WorkerCounters;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// A beat that the device has stretched begins at most so long after the poll before it. A control that answers slowly for half a minute
/// stretches the beat by as much as one poll takes, and is well again long before that; how much of its time may be asked of it is bounded by
/// its own line. More would cost values that are there, less only turns of a loop.
const STRETCHED_PAUSE_NS: i64 = 2 * SECOND_NS;

/// A sleeping worker looks this often whether it shall stop.
const STOP_LOOK_NS: i64 = SECOND_NS / 5;

/// Limits of a worker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WorkerSettings {
    /// At most this many polls wait to be taken; then the oldest is dropped and counted.
    pub queue_polls: usize,
    /// Shortest pause after repeated failures.
    pub backoff_min: Duration,
    /// Longest pause after repeated failures.
    pub backoff_max: Duration,
    /// Pause between two looks at a machine that is off.
    pub off_pause: Duration,
    /// A poll that has not returned after this time is shown as stuck.
    pub deadline: Duration,
    /// Time between two polls; `None`: the source's own pace.
    pub period: Option<Duration>,
}

impl Default for WorkerSettings {
    fn default() -> Self {
        Self {
            queue_polls: 1024,
            backoff_min: Duration::from_secs(1),
            backoff_max: Duration::from_secs(30),
            off_pause: Duration::from_secs(2),
            deadline: Duration::from_secs(10),
            period: None,
        }
    }
}

struct Shared {
    stop: AtomicBool,
    /// Polls and short waits that are over: it grows unless the thread hangs.
    steps: AtomicU64,
    queue: Mutex<Queue>,
    counters: Mutex<WorkerCounters>,
}

/// A source on its own thread.
pub struct Worker {
    name: String,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    /// Starts to poll.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn start(
        source: Box<dyn Source>,
        clock: Arc<dyn Clock>,
        settings: WorkerSettings,
    ) -> Result<Self, std::io::Error> {
        let name = source.name().to_owned();
        let period = settings.period.unwrap_or_else(|| source.period());
        let ledger = WorkerCounters::new(period, settings.deadline, clock.now_ns());
        let shared = Arc::new(Shared {
            stop: AtomicBool::new(false),
            steps: AtomicU64::new(0),
            queue: Mutex::new(Queue::new(settings.queue_polls)),
            counters: Mutex::new(ledger),
        });
        let asked_ns = TimeNs::MIN;
        let mut poller = Poller {
            source,
            clock,
            settings,
            period,
            shared: shared.clone(),
            failing_ns: None,
            asked_ns,
            plausibility: Plausibility::default(),
        };
        let thread = std::thread::Builder::new().name("source".to_owned()).spawn(move || poller.run_until_stopped())?;
        Ok(Self { name, shared, thread: Some(thread) })
    }

    /// The address of the source.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Gives every waiting poll to the merge, and tells it when the source keeps a slower pace than it promised.
    /// Returns how many polls there were.
    pub fn drain_into(&self, merge: &mut Merge, source: SourceId) -> usize {
        self.drain_seen_into(merge, source, |_| {})
    }

    /// The same, and shows every poll to `see` before the merge takes it.
    pub fn drain_seen_into(&self, merge: &mut Merge, source: SourceId, mut see: impl FnMut(&Poll)) -> usize {
        let polls = self.drain(|poll| {
            see(poll);
            merge.push_all(source, &mut poll.readings);
            if let Some(error) = &poll.error {
                merge.record_failure(source, poll.ended_ns, error);
            }
        });
        if let Some(period) = locked(&self.shared.counters).take_new_pace() {
            merge.set_period(source, period);
        }
        polls
    }

    /// Shows every waiting poll to `take`, the oldest first.
    pub fn drain(&self, mut take: impl FnMut(&mut Poll)) -> usize {
        let mut polls = locked(&self.shared.queue).take_all();
        let count = polls.len();
        polls.iter_mut().for_each(&mut take);
        locked(&self.shared.queue).give_back(polls);
        count
    }

    /// How the source has been doing, as of `now_ns`.
    #[must_use]
    pub fn stats(&self, now_ns: TimeNs) -> WorkerStats {
        let dropped = locked(&self.shared.queue).count_dropped();
        locked(&self.shared.counters).build_stats(now_ns, dropped)
    }

    /// Polls and short waits between them that are over. Whoever looks twice sees whether the thread moves.
    #[must_use]
    pub fn count_steps(&self) -> u64 {
        self.shared.steps.load(Ordering::Relaxed)
    }

    /// Tells the thread to end after the poll it is in; does not wait for it.
    pub fn stop(&self) {
        self.shared.stop.store(true, Ordering::SeqCst);
    }

    /// Has the thread ended?
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Stops and waits until the thread has ended, which takes as long as the poll it is in (and, on a clock that stands
    /// still, until that clock is moved).
    pub fn join(mut self) {
        self.stop();
        if let Some(thread) = self.thread.take() {
            // A poll that panics is caught in the thread, so there is no panic to pass on.
            let _ = thread.join();
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.stop();
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

struct Poller {
    source: Box<dyn Source>,
    clock: Arc<dyn Clock>,
    settings: WorkerSettings,
    period: Duration,
    shared: Arc<Shared>,
    /// When the first of the failures in a row was over.
    failing_ns: Option<TimeNs>,
    /// When the source was last asked for its facts.
    asked_ns: TimeNs,
    plausibility: Plausibility,
}

impl Poller {
    /// What breaks off outside of a poll costs that poll: the source is polled again.
    fn run_until_stopped(&mut self) {
        while catch_unwind(AssertUnwindSafe(|| self.run())).is_err() && !self.stopping() {
            let (clock, pause_ns) = (self.clock.clone(), saturate_to_wait_ns(self.settings.backoff_min));
            self.sleep_until(clock.now_ns().saturating_add(pause_ns));
        }
    }

    fn run(&mut self) {
        let mut due_ns = self.clock.now_ns();
        while !self.stopping() {
            reach_fault_point("source");
            let readings = locked(&self.shared.queue).take_spare();
            let (began_ns, poll) = self.poll(readings);
            self.shared.steps.fetch_add(1, Ordering::Relaxed);
            let ended_ns = poll.ended_ns;
            let error = poll.error.clone();
            self.plausibility.record_readings(&poll.readings);
            locked(&self.shared.queue).push_poll(poll);
            self.follow_pace();
            locked(&self.shared.counters).poll_over(due_ns, began_ns, ended_ns, error.as_ref());
            self.take_facts(ended_ns);
            self.take_problems(error.is_none());
            if matches!(error, Some(SourceError::End { .. })) {
                return;
            }
            due_ns = self.next_due(due_ns, ended_ns, error.as_ref());
            self.sleep_until(due_ns);
        }
        locked(&self.shared.counters).record_stop(self.clock.now_ns());
    }

    /// The device may keep a slower pace than was wanted.
    fn follow_pace(&mut self) {
        let wanted = self.settings.period.unwrap_or_else(|| self.source.period());
        self.period = wanted.max(self.source.achievable_period());
        locked(&self.shared.counters).set_beat(self.period);
    }

    fn take_facts(&mut self, now_ns: TimeNs) {
        if now_ns.saturating_sub(self.asked_ns) < SECOND_NS {
            return;
        }
        self.asked_ns = now_ns;
        let facts = self.source.collect_facts().into_iter().chain(self.plausibility.build_fact()).collect();
        locked(&self.shared.counters).set_facts(facts);
    }

    /// A source that does not answer has an error instead.
    fn take_problems(&mut self, answers: bool) {
        let problems = if answers {
            let of_source = self.source.list_problems().into_iter().map(SourceProblem::with_short_texts);
            of_source.chain(self.plausibility.list_problems()).collect()
        } else {
            Vec::new()
        };
        locked(&self.shared.counters).set_problems(problems);
    }

    fn stopping(&self) -> bool {
        self.shared.stop.load(Ordering::SeqCst)
    }

    fn poll(&mut self, mut readings: Vec<Reading>) -> (TimeNs, Poll) {
        let began_ns = self.clock.now_ns();
        locked(&self.shared.counters).poll_began(began_ns);
        let read = AssertUnwindSafe(|| self.source.read(self.clock.as_ref(), &mut readings));
        let result = catch_unwind(read).unwrap_or_else(|_| Err(panicked(self.source.name())));
        let error = result.err().map(SourceError::with_short_texts);
        (began_ns, Poll { ended_ns: self.clock.now_ns(), readings, error })
    }

    /// The next beat after `ended_ns`, or the end of the pause after a failure.
    fn next_due(&mut self, due_ns: TimeNs, ended_ns: TimeNs, error: Option<&SourceError>) -> TimeNs {
        let period_ns = saturate_to_wait_ns(self.period).max(1);
        let failing_ns = self.failing_ns;
        self.failing_ns = error.map(|_| failing_ns.unwrap_or(ended_ns));
        match (error, failing_ns) {
            (Some(SourceError::Off { .. }), _) => {
                return ended_ns + saturate_to_wait_ns(self.settings.off_pause).max(period_ns);
            }
            (Some(_), Some(since_ns)) => return ended_ns + self.backoff_ns(ended_ns - since_ns).max(period_ns),
            _ => {}
        }
        let beats = (ended_ns - due_ns).max(0) / period_ns;
        if beats > 0 {
            locked(&self.shared.counters).count_missed(beats.unsigned_abs());
        }
        self.limit_stretched_beat(due_ns + (beats + 1) * period_ns, ended_ns)
    }

    /// The next poll, where the device keeps a slower pace than was wanted, not later than it takes to notice that it is quick again.
    fn limit_stretched_beat(&self, due_ns: TimeNs, ended_ns: TimeNs) -> TimeNs {
        let wanted = self.settings.period.unwrap_or_else(|| self.source.period());
        if self.period <= wanted {
            return due_ns;
        }
        due_ns.min(ended_ns + saturate_to_wait_ns(wanted).max(STRETCHED_PAUSE_NS))
    }

    /// The pause when nothing has come for so long.
    fn backoff_ns(&self, failing_ns: i64) -> i64 {
        let (least_ns, most_ns) =
            (saturate_to_wait_ns(self.settings.backoff_min), saturate_to_wait_ns(self.settings.backoff_max));
        (failing_ns / 4).clamp(least_ns, most_ns.max(least_ns))
    }

    fn sleep_until(&self, until_ns: TimeNs) {
        while !self.stopping() {
            let now_ns = self.clock.now_ns();
            if now_ns >= until_ns {
                return;
            }
            self.clock.sleep_until(until_ns.min(now_ns + STOP_LOOK_NS));
            self.shared.steps.fetch_add(1, Ordering::Relaxed);
        }
    }
}

fn panicked(name: &str) -> SourceError {
    SourceError::Decode {
        source_name: name.to_owned(),
        request: "the whole poll".to_owned(),
        what: "the driver failed on it; please report this with the log".to_owned(),
    }
}
