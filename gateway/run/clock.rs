//! The box's clock: the monotonic clock anchored to the wall clock, following the wall clock forwards only.
//!
//! A box without a battery starts in 1970 and is set right minutes later: the clock then jumps forward once, which the
//! merge sees as a gap. A wall clock that is set *back* is not followed, because history would run backwards; the box
//! says so and keeps its own time until it is started again.

use adapters::clock::{Clock, SECOND_NS, SystemClock, TimeNs};
use std::sync::atomic::{AtomicI64, Ordering};

/// Wall clocks are disciplined by less than this without anybody calling it a step.
const STEP_MIN_NS: i64 = 2 * SECOND_NS;

/// What the wall clock did since it was last looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClockStep {
    /// It was set forward by so much, and the box with it.
    Forward(i64),
    /// It was set back and now lies so much behind the box.
    Back(i64),
    /// It is right again after having been set back.
    Right,
}

/// See the [module](self).
#[derive(Debug, Default)]
pub struct BoxClock {
    system: SystemClock,
    shift_ns: AtomicI64,
    behind_ns: AtomicI64,
}

impl BoxClock {
    /// Anchored to the wall clock of this moment.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Compares with the wall clock; call it about once per second.
    pub fn look(&self) -> Option<ClockStep> {
        let ahead_ns = self.system.wall_offset_ns() - self.shift_ns.load(Ordering::SeqCst);
        self.notice(ahead_ns)
    }

    /// The wall clock is `ahead_ns` ahead of this one.
    fn notice(&self, ahead_ns: i64) -> Option<ClockStep> {
        let behind_ns = self.behind_ns.load(Ordering::SeqCst);
        if ahead_ns >= STEP_MIN_NS {
            self.shift_ns.fetch_add(ahead_ns, Ordering::SeqCst);
            self.behind_ns.store(0, Ordering::SeqCst);
            return Some(ClockStep::Forward(ahead_ns));
        }
        let now_behind_ns = if ahead_ns <= -STEP_MIN_NS { -ahead_ns } else { 0 };
        if (now_behind_ns - behind_ns).abs() < STEP_MIN_NS {
            return None;
        }
        self.behind_ns.store(now_behind_ns, Ordering::SeqCst);
        Some(if now_behind_ns > 0 { ClockStep::Back(now_behind_ns) } else { ClockStep::Right })
    }
}

impl Clock for BoxClock {
    fn now_ns(&self) -> TimeNs {
        self.system.now_ns().saturating_add(self.shift_ns.load(Ordering::SeqCst))
    }

    fn sleep_until(&self, until_ns: TimeNs) {
        self.system.sleep_until(until_ns.saturating_sub(self.shift_ns.load(Ordering::SeqCst)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_forward_is_followed_once() {
        let clock = BoxClock::new();
        let before = clock.now_ns();
        assert_eq!(clock.notice(3600 * SECOND_NS), Some(ClockStep::Forward(3600 * SECOND_NS)));
        assert!(clock.now_ns() - before >= 3600 * SECOND_NS);
        assert_eq!(clock.notice(SECOND_NS / 10), None);
    }

    #[test]
    fn a_step_back_is_told_once_and_never_followed() {
        let clock = BoxClock::new();
        let before = clock.now_ns();
        assert_eq!(clock.notice(-60 * SECOND_NS), Some(ClockStep::Back(60 * SECOND_NS)));
        assert_eq!(clock.notice(-60 * SECOND_NS - 5), None);
        assert!(clock.now_ns() >= before);
        assert_eq!(clock.notice(0), Some(ClockStep::Right));
    }
}
