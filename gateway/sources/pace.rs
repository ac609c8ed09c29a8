//! When the next tick is: on the box's clock, or at a multiple of real time for a machine that is simulated.

use adapters::clock::{Clock, SECOND_NS, TimeNs};
use adapters::histogram::Histogram;
use gateway_base::convert::saturate_to_ns;
use gateway_control::Wake;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Lateness is told over so many ticks: a minute at 10 Hz.
const WINDOW: usize = 600;

/// A slow tick looks this often whether it shall stop.
const STOP_LOOK_NS: i64 = SECOND_NS / 5;

/// Woken so much before a tick that may lead to a write, and awake until then: what a processor takes to wake up, which on a
/// loaded or virtual one can be half a millisecond, is over when the tick begins. At 10 Hz 0.3 % of a processor.
pub const LEAD: Duration = Duration::from_micros(300);
/// At shorter periods nobody lies in wait.
pub const LEAD_PERIOD_MIN: Duration = Duration::from_millis(20);

/// An accelerated machine that falls further behind than this goes on from where it is.
const BEHIND_MAX: Duration = Duration::from_secs(1);

enum Beat {
    /// The ticks of a real machine: on the clock, late ones are left out. With the time by which it is woken early, ns.
    Clock(Arc<dyn Clock>, i64),
    /// `speed` seconds of machine time per second, `None` as fast as possible; no tick is left out.
    Stepped { speed: Option<f64>, anchor: (Instant, TimeNs) },
}

/// Gives the times of the ticks, waiting for each.
pub struct TickSchedule {
    beat: Beat,
    period_ns: i64,
    due_ns: TimeNs,
    late_ns: Vec<i64>,
    late: Histogram,
    cursor: usize,
    skipped: u64,
}

impl TickSchedule {
    /// Ticks on the clock.
    #[must_use]
    pub fn on_clock(clock: Arc<dyn Clock>, period: Duration) -> Self {
        let due_ns = clock.now_ns();
        Self::new(Beat::Clock(clock, 0), due_ns, period)
    }

    /// From now on wakes a little before each tick: for a machine that is written to, by a thread of real-time priority. One of
    /// ordinary priority would be passed over for it when it is needed.
    pub fn wake_early(&mut self) {
        let lead_ns = saturate_to_ns(LEAD);
        if let Beat::Clock(_, early_ns) = &mut self.beat
            && self.period_ns >= saturate_to_ns(LEAD_PERIOD_MIN)
        {
            *early_ns = lead_ns;
        }
    }

    /// Ticks of an accelerated machine, beginning at `start_ns`.
    #[must_use]
    pub fn with_speed(speed: Option<f64>, start_ns: TimeNs, period: Duration) -> Self {
        Self::new(Beat::Stepped { speed, anchor: (Instant::now(), start_ns) }, start_ns, period)
    }

    fn new(beat: Beat, due_ns: TimeNs, period: Duration) -> Self {
        let period_ns = saturate_to_ns(period).max(1);
        Self {
            beat,
            period_ns,
            due_ns,
            late_ns: Vec::with_capacity(WINDOW),
            late: Histogram::default(),
            cursor: 0,
            skipped: 0,
        }
    }

    /// Waits for the next tick and gives its time; `None` when it shall stop.
    pub fn next_tick(&mut self, stop: &AtomicBool) -> Option<TimeNs> {
        self.next_tick_or(stop, &Wake::default(), || {})
    }

    /// The same; whenever the waiting thread is woken, `meanwhile` is done.
    pub fn next_tick_or(&mut self, stop: &AtomicBool, wake: &Wake, mut meanwhile: impl FnMut()) -> Option<TimeNs> {
        let mut look = || {
            if wake.take_wakeup() {
                meanwhile();
            }
        };
        self.due_ns += self.period_ns;
        match &mut self.beat {
            Beat::Clock(clock, early_ns) => {
                let wake_ns = self.due_ns - *early_ns;
                while !stop.load(Ordering::SeqCst) && clock.now_ns() < wake_ns {
                    look();
                    park_thread((wake_ns - clock.now_ns()).min(STOP_LOOK_NS));
                }
                while !stop.load(Ordering::SeqCst) && clock.now_ns() < self.due_ns {
                    // Others of the same priority may go on meanwhile, on a box with one processor.
                    std::thread::yield_now();
                }
                let late_ns = clock.now_ns() - self.due_ns;
                self.record_lateness(late_ns);
                // What is more than a period late is left out, so that the box catches up at once.
                let whole = (late_ns / self.period_ns).max(0);
                self.skipped += whole.unsigned_abs();
                self.due_ns += whole * self.period_ns;
            }
            Beat::Stepped { speed: None, .. } => {}
            Beat::Stepped { speed: Some(speed), anchor } => {
                let late = wait_until_due(*speed, *anchor, self.due_ns, look);
                if late > BEHIND_MAX {
                    *anchor = (Instant::now(), self.due_ns);
                }
                self.record_lateness(saturate_to_ns(late));
            }
        }
        (!stop.load(Ordering::SeqCst)).then_some(self.due_ns)
    }

    /// Lateness of all ticks since the start.
    #[must_use]
    pub fn lateness_histogram(&self) -> Histogram {
        self.late
    }

    fn record_lateness(&mut self, late_ns: i64) {
        self.late.add_ns(late_ns);
        if self.late_ns.len() < WINDOW {
            self.late_ns.push(late_ns);
        } else {
            self.late_ns[self.cursor] = late_ns;
            self.cursor = (self.cursor + 1) % WINDOW;
        }
    }

    /// Median and 99th percentile of the lateness, ms.
    #[must_use]
    pub fn late_ms(&self) -> (f64, f64) {
        let mut sorted = self.late_ns.clone();
        sorted.sort_unstable();
        let at = |share: f64| {
            let index = (sorted.len() as f64 * share) as usize;
            sorted.get(index.min(sorted.len().saturating_sub(1))).map_or(0.0, |ns| *ns as f64 / 1e6)
        };
        (at(0.5), at(0.99))
    }

    /// Ticks left out since the start.
    #[must_use]
    pub fn skipped_ticks(&self) -> u64 {
        self.skipped
    }
}

/// Sleeps until machine time `due_ns`, and does `look` whenever it is woken; gives how late it is in real time.
fn wait_until_due(
    speed: f64,
    (began, began_ns): (Instant, TimeNs),
    due_ns: TimeNs,
    mut look: impl FnMut(),
) -> Duration {
    let machine = Duration::from_nanos((due_ns - began_ns).max(0).unsigned_abs());
    let due = began + machine.div_f64(speed);
    while let Some(left) = due.checked_duration_since(Instant::now()).filter(|left| !left.is_zero()) {
        look();
        std::thread::park_timeout(left);
    }
    Instant::now().saturating_duration_since(due)
}

/// Sleeps so long, or until somebody wakes this thread.
fn park_thread(ns: i64) {
    if ns > 0 {
        std::thread::park_timeout(Duration::from_nanos(ns.unsigned_abs()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapters::clock::ManualClock;

    static GO: AtomicBool = AtomicBool::new(false);

    #[test]
    fn late_ticks_are_left_out_and_counted() {
        let clock = ManualClock::with_time(0);
        let mut pace = TickSchedule::on_clock(Arc::new(clock.clone()), Duration::from_millis(100));
        clock.set_time(100_000_000);
        assert_eq!(pace.next_tick(&GO), Some(100_000_000));
        clock.set_time(450_000_000);
        assert_eq!(pace.next_tick(&GO), Some(400_000_000));
        assert_eq!(pace.skipped_ticks(), 2);
        assert_eq!(pace.late_ms().1, 250.0);
    }

    #[test]
    fn whoever_is_woken_does_what_is_asked_and_the_tick_comes_when_it_is_due() {
        let wake = Wake::default();
        let mut pace = TickSchedule::with_speed(Some(1.0), 0, Duration::from_millis(300));
        let of_other = wake.clone();
        let (began, mut after) = (Instant::now(), None);
        let tick = std::thread::scope(|scope| {
            wake.bind_current_thread();
            scope.spawn(move || {
                std::thread::sleep(Duration::from_millis(20));
                of_other.wake_thread();
            });
            pace.next_tick_or(&GO, &wake, || after = Some(began.elapsed()))
        });
        assert_eq!(tick, Some(300_000_000));
        assert!(after.is_some_and(|after| after < Duration::from_millis(200)), "{after:?}");
        assert!(began.elapsed() >= Duration::from_millis(300));
    }

    #[test]
    fn an_accelerated_machine_leaves_no_tick_out() {
        // Before the schedule begins: a thread that is held up between the two would see less time than there was.
        let began = Instant::now();
        let mut pace = TickSchedule::with_speed(Some(1000.0), 0, Duration::from_millis(100));
        let ticks: Vec<_> = (0..100).filter_map(|_| pace.next_tick(&GO)).collect();
        assert_eq!(ticks, (1..=100).map(|n| n * 100_000_000).collect::<Vec<_>>());
        assert!(began.elapsed() >= Duration::from_millis(10));
        assert_eq!(pace.skipped_ticks(), 0);
    }
}
