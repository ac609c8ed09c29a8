//! Time as an argument: the one interface through which drivers and the gateway see a clock.

use crate::integer::saturate_to_ns;
use std::sync::Arc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Nanoseconds since 1970-01-01 UTC on the gateway's clock.
pub type TimeNs = i64;

/// One second in [`TimeNs`].
pub const SECOND_NS: i64 = 1_000_000_000;

/// A source of time that can also wait.
pub trait Clock: Send + Sync {
    /// Now. Never runs backwards within one process.
    fn now_ns(&self) -> TimeNs;
    /// Returns when `now_ns() >= until_ns`, or at once when that time has passed.
    fn sleep_until(&self, until_ns: TimeNs);
}

/// The machine's clock: the wall clock read once, then advanced by the monotonic clock, so that a step of the wall
/// clock cannot reorder samples.
#[derive(Debug)]
pub struct SystemClock {
    started: Instant,
    started_ns: TimeNs,
}

impl SystemClock {
    /// Anchors the monotonic clock to the wall clock of this moment.
    #[must_use]
    pub fn new() -> Self {
        Self { started: Instant::now(), started_ns: wall_ns() }
    }
}

impl Default for SystemClock {
    fn default() -> Self {
        Self::new()
    }
}

fn wall_ns() -> TimeNs {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    saturate_to_ns(since)
}

impl Clock for SystemClock {
    fn now_ns(&self) -> TimeNs {
        self.started_ns + saturate_to_ns(self.started.elapsed())
    }

    fn sleep_until(&self, until_ns: TimeNs) {
        let wait = until_ns - self.now_ns();
        if wait > 0 {
            std::thread::sleep(Duration::from_nanos(wait.unsigned_abs()));
        }
    }
}

/// The system clock at a multiple of its pace, for an accelerated demonstration: everything that lives by this clock
/// runs faster together, and all times stay consistent.
#[derive(Debug)]
pub struct ScaledClock {
    started: Instant,
    started_ns: TimeNs,
    speed: f64,
}

impl ScaledClock {
    /// `speed` seconds pass on this clock in one real second; anything but a positive number counts as 1.
    #[must_use]
    pub fn new(speed: f64) -> Self {
        let speed = if speed.is_finite() && speed > 0.0 { speed } else { 1.0 };
        Self { started: Instant::now(), started_ns: wall_ns(), speed }
    }
}

impl Clock for ScaledClock {
    fn now_ns(&self) -> TimeNs {
        let elapsed = self.started.elapsed().mul_f64(self.speed);
        self.started_ns.saturating_add(saturate_to_ns(elapsed))
    }

    fn sleep_until(&self, until_ns: TimeNs) {
        let wait = until_ns - self.now_ns();
        if wait > 0 {
            std::thread::sleep(Duration::from_nanos(wait.unsigned_abs()).div_f64(self.speed));
        }
    }
}

/// A clock that the caller moves; sleeping on it waits until somebody does. For tests and accelerated replays.
#[derive(Debug, Clone, Default)]
pub struct ManualClock {
    now: Arc<AtomicI64>,
    moved: Arc<(Mutex<()>, std::sync::Condvar)>,
}

impl ManualClock {
    /// A clock standing at `now_ns`.
    #[must_use]
    pub fn with_time(now_ns: TimeNs) -> Self {
        let clock = Self::default();
        clock.set_time(now_ns);
        clock
    }

    /// Moves the clock to `now_ns` and wakes every sleeper whose time has come. Moving backwards is ignored.
    pub fn set_time(&self, now_ns: TimeNs) {
        self.now.fetch_max(now_ns, Ordering::SeqCst);
        let _held = self.moved.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        self.moved.1.notify_all();
    }
}

impl Clock for ManualClock {
    fn now_ns(&self) -> TimeNs {
        self.now.load(Ordering::SeqCst)
    }

    fn sleep_until(&self, until_ns: TimeNs) {
        let mut held = self.moved.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        while self.now_ns() < until_ns {
            held = self.moved.1.wait(held).unwrap_or_else(std::sync::PoisonError::into_inner);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_system_clock_does_not_run_backwards() {
        let clock = SystemClock::new();
        let before = clock.now_ns();
        clock.sleep_until(before + 1_000_000);
        assert!(clock.now_ns() >= before + 1_000_000);
    }

    #[test]
    fn a_scaled_clock_runs_faster() {
        let (system, scaled) = (SystemClock::new(), ScaledClock::new(100.0));
        let (system_ns, scaled_ns) = (system.now_ns(), scaled.now_ns());
        scaled.sleep_until(scaled_ns + SECOND_NS);
        assert!(scaled.now_ns() - scaled_ns >= SECOND_NS);
        assert!(system.now_ns() - system_ns >= SECOND_NS / 100);
    }

    #[test]
    fn a_sleeper_wakes_when_the_manual_clock_moves() {
        let clock = ManualClock::with_time(0);
        let sleeper = clock.clone();
        let thread = std::thread::spawn(move || sleeper.sleep_until(5));
        clock.set_time(10);
        thread.join().expect("the sleeper ends");
    }
}
