//! The time of the box: the wall clock of one moment, carried on by the processor.

use super::ClockStatus;
use super::judge::{Certain, ClockNews, ClockRules, Judge, Trust};
use crate::convert::saturate_to_ns;
use adapter_core::clock::{Clock, SECOND_NS, TimeNs};
use rustix::time::{ClockId, clock_gettime};
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Where the system says which start of the computer this is.
const BOOT_ID: &str = "/proc/sys/kernel/random/boot_id";

/// By which clock the rows of a run are dated: kept with them, so that they can be dated anew.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ClockMark {
    /// What was thought of the clock: the word of [`Trust`], or `stepped` where the machine brings its own time.
    pub trust: &'static str,
    /// Which start of the computer; empty where the system does not tell, or the machine brings its own time.
    pub boot: String,
    /// Time of the rows minus time since that start, ns.
    pub anchor_ns: i64,
}

impl ClockMark {
    /// A machine that brings its own time: a recording, a simulation at another speed.
    #[must_use]
    pub fn from_stepped_time() -> Self {
        Self { trust: "stepped", boot: String::new(), anchor_ns: 0 }
    }

    /// May anything be judged by the age that these rows give it?
    #[must_use]
    pub fn is_certain(&self) -> bool {
        [Trust::Confirmed.as_word(), "stepped"].contains(&self.trust)
    }
}

/// The time of the box: the wall clock of one moment, carried on by the processor.
#[derive(Debug)]
pub struct BoxClock {
    /// Time of the box minus time since the computer was started, ns. Moved only while no run is going on.
    anchor_ns: AtomicI64,
    judge: Mutex<Judge>,
}

/// The clock of this process.
#[must_use]
pub fn of_box() -> &'static Arc<BoxClock> {
    static CLOCK: OnceLock<Arc<BoxClock>> = OnceLock::new();
    CLOCK.get_or_init(|| Arc::new(BoxClock::new()))
}

impl Default for BoxClock {
    fn default() -> Self {
        Self::new()
    }
}

impl BoxClock {
    /// Anchored to the wall clock of this moment, whatever it says; [`BoxClock::begin_run`] judges it.
    #[must_use]
    pub fn new() -> Self {
        let (wall_ns, rules) = (wall_ns(), ClockRules::default());
        let certain = Certain { at_least_ns: super::MADE_NS };
        let (judge, _) = Judge::from_first_reading(rules, certain, wall_ns, true);
        Self { anchor_ns: AtomicI64::new(wall_ns.saturating_sub(since_boot_ns())), judge: Mutex::new(judge) }
    }

    fn lock_judge(&self) -> MutexGuard<'_, Judge> {
        // It is complete whenever the lock is free.
        self.judge.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins a run: from now on the box has the time of the wall clock, or, where that cannot be, the last certain one.
    /// `decided`: the reading has stood long enough already. Nothing that lives by this clock may be running.
    pub fn begin_run(&self, rules: ClockRules, certain: Certain, decided: bool) {
        let (judge, now_ns) = Judge::from_first_reading(rules, certain, wall_ns(), decided);
        self.anchor_ns.store(now_ns.saturating_sub(since_boot_ns()), Ordering::SeqCst);
        *self.lock_judge() = judge;
    }

    /// Compares with the wall clock; call it about once per second.
    pub fn compare_with_wall(&self) -> Option<ClockNews> {
        self.lock_judge().judge_reading(self.now_ns(), wall_ns())
    }

    /// What is thought of the wall clock.
    #[must_use]
    pub fn trust(&self) -> Trust {
        self.lock_judge().trust()
    }

    /// Are the rows of this run dated by a confirmed clock? Only then may anything go because of its age.
    #[must_use]
    pub fn is_confirmed(&self) -> bool {
        self.lock_judge().is_confirmed()
    }

    /// It is certainly later than this.
    #[must_use]
    pub fn at_least_ns(&self) -> TimeNs {
        self.lock_judge().certain().at_least_ns
    }

    /// By which clock rows are dated from now on.
    #[must_use]
    pub fn current_mark(&self) -> ClockMark {
        let trust = match self.trust() {
            Trust::Leapt if self.is_confirmed() => Trust::Confirmed,
            Trust::Leapt => Trust::Plausible,
            trust => trust,
        };
        let boot = std::fs::read_to_string(BOOT_ID).map(|id| id.trim().to_owned()).unwrap_or_default();
        ClockMark { trust: trust.as_word(), boot, anchor_ns: self.anchor_ns.load(Ordering::SeqCst) }
    }

    /// Whether the wall clock is believed, and by how many seconds it is ahead.
    #[must_use]
    pub fn build_status(&self) -> ClockStatus {
        let judge = self.lock_judge();
        #[expect(clippy::cast_precision_loss, reason = "for a reader")]
        let wall_ahead_s = judge.ahead_ns() as f64 / SECOND_NS as f64;
        ClockStatus { trust: judge.trust(), wall_ahead_s }
    }
}

impl Clock for BoxClock {
    fn now_ns(&self) -> TimeNs {
        self.anchor_ns.load(Ordering::SeqCst).saturating_add(since_boot_ns())
    }

    fn sleep_until(&self, until_ns: TimeNs) {
        let wait_ns = until_ns.saturating_sub(self.now_ns());
        if wait_ns > 0 {
            std::thread::sleep(Duration::from_nanos(wait_ns.unsigned_abs()));
        }
    }
}

/// Time since the computer was started, its sleep included.
fn since_boot_ns() -> i64 {
    let since = clock_gettime(ClockId::Boottime);
    since.tv_sec.saturating_mul(SECOND_NS).saturating_add(since.tv_nsec)
}

fn wall_ns() -> TimeNs {
    match SystemTime::now().duration_since(UNIX_EPOCH) {
        Ok(since) => saturate_to_ns(since),
        Err(before) => -saturate_to_ns(before.duration()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_has_the_time_of_the_wall_unless_that_cannot_be() {
        let clock = BoxClock::new();
        assert!((clock.now_ns() - wall_ns()).abs() < SECOND_NS);
        let later_ns = wall_ns() + 1_000_000 * SECOND_NS;
        clock.begin_run(ClockRules::default(), Certain { at_least_ns: later_ns }, false);
        assert!(clock.now_ns() > later_ns && clock.trust() == Trust::Unset);
        assert_eq!((clock.current_mark().trust, clock.at_least_ns()), ("unset", later_ns));
        let before_ns = clock.now_ns();
        clock.sleep_until(before_ns + 1_000_000);
        assert!(clock.now_ns() >= before_ns + 1_000_000);
        assert_eq!(clock.compare_with_wall(), Some(ClockNews::Leapt { ahead_ns: clock.lock_judge().ahead_ns() }));
        assert!(clock.build_status().wall_ahead_s < -999_000.0);
    }
}
