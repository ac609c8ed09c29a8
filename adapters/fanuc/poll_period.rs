//! Which period each group of a control can keep, from how long the control takes to answer it.
//!
//! A control shares its processor between the machine and whoever asks. All groups together are given
//! [`duty_pct`](crate::address::FanucOptions::duty_pct) of its time at most. A group whose answers take `b` seconds and which
//! is asked every `W` seconds needs the share `b / W`. Where the shares do not fit, the slow groups are stretched first until
//! together they take a quarter of the cap, and the first group gets what is left: its period is `b / share`. The periods are
//! measured anew with every answer, so that a control that becomes slow under load is asked less often, and a quick one again
//! at the period that was wanted. Between the plan and what happens stands the line, which makes every group wait while the
//! control has been busy for longer than its share.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Of the cap, this share is planned with; the rest is for writes and for answers that take longer than usual. With none
/// left, a single late answer would delay every poll after it.
const PLANNED: f64 = 0.9;

/// The slow groups give way until they take this share of what is planned.
const SLOW_SHARE: f64 = 0.25;

/// Answers within this factor of the known time are noise about it, and move it by [`SMOOTH`].
const OTHER: f64 = 2.0;
const SMOOTH: f64 = 0.25;

/// No group is asked less often than this, however slow the control is.
const PERIOD_MAX: Duration = Duration::from_secs(60);

#[derive(Debug, Clone, Copy)]
struct PollGroup {
    wanted_s: f64,
    /// How long the control takes to answer it; `None` before the first answer.
    busy_s: Option<f64>,
    /// The answer before, where it was much longer than what is known.
    longer_s: Option<f64>,
}

impl PollGroup {
    /// An answer that takes much longer is believed when the next one does too: one hiccup changes no period. A much shorter
    /// one is believed at once: a control that has recovered is read as was wanted from its first quick answer on. What a
    /// wrong belief costs is bounded by the line, which keeps the duty over some seconds.
    fn record_busy_time(&mut self, busy_s: f64) {
        let known_s = self.busy_s.unwrap_or(busy_s);
        let before_s = self.longer_s.take();
        self.busy_s = Some(match before_s {
            _ if busy_s * OTHER < known_s => busy_s,
            Some(before_s) if busy_s > known_s * OTHER => before_s.min(busy_s),
            None if busy_s > known_s * OTHER => {
                self.longer_s = Some(busy_s);
                known_s
            }
            _ => known_s + SMOOTH * (busy_s - known_s),
        });
    }

    /// Share of the control's time that it takes at the period that is wanted.
    fn compute_share(&self) -> f64 {
        self.busy_s.unwrap_or(0.0) / self.wanted_s
    }
}

/// The groups of one control; clones are handles on the same ones.
#[derive(Debug, Clone)]
pub struct SharedPace {
    groups: Arc<Mutex<Vec<PollGroup>>>,
    planned: f64,
}

/// One group among those of its control.
#[derive(Debug, Clone)]
pub struct GroupPace {
    shared: SharedPace,
    at: usize,
}

impl SharedPace {
    /// The groups may take so many percent of the control's time together.
    #[must_use]
    pub fn new(duty_pct: u8) -> Self {
        Self { groups: Arc::default(), planned: PLANNED * f64::from(duty_pct.clamp(1, 100)) / 100.0 }
    }

    /// Adds a group; the first one is the quick one.
    #[must_use]
    pub fn add_group(&self, wanted: Duration) -> GroupPace {
        let mut groups = self.lock_groups();
        groups.push(PollGroup { wanted_s: wanted.as_secs_f64().max(1e-3), busy_s: None, longer_s: None });
        GroupPace { shared: self.clone(), at: groups.len() - 1 }
    }

    fn lock_groups(&self) -> MutexGuard<'_, Vec<PollGroup>> {
        // Each group is complete whenever the lock is free.
        self.groups.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl GroupPace {
    /// The control took so long to answer this group.
    pub fn record_busy_time(&self, busy: Duration) {
        let mut groups = self.shared.lock_groups();
        let Some(group) = groups.get_mut(self.at) else { return };
        group.record_busy_time(busy.as_secs_f64());
    }

    /// How long the control takes to answer this group; `None` before the first answer.
    #[must_use]
    pub fn busy_time(&self) -> Option<Duration> {
        self.shared.lock_groups().get(self.at)?.busy_s.map(Duration::from_secs_f64)
    }

    /// The period that is wanted.
    #[must_use]
    pub fn wanted_period(&self) -> Duration {
        self.shared.lock_groups().get(self.at).map_or(PERIOD_MAX, |group| Duration::from_secs_f64(group.wanted_s))
    }

    /// The period that the control can keep; at least the one that is wanted.
    #[must_use]
    pub fn period(&self) -> Duration {
        let groups = self.shared.lock_groups();
        let (Some(first), Some(own)) = (groups.first(), groups.get(self.at)) else { return PERIOD_MAX };
        let planned = self.shared.planned;
        let slow: f64 = groups.iter().skip(1).map(PollGroup::compute_share).sum();
        // What the slow groups may take: what the first one leaves, and never less than their quarter.
        let left = (planned - first.compute_share()).max(SLOW_SHARE * planned);
        let stretch = (slow / left).max(1.0);
        let period_s = if self.at == 0 {
            let share = planned - slow / stretch;
            own.wanted_s.max(own.busy_s.unwrap_or(0.0) / share.max(1e-3))
        } else {
            own.wanted_s * stretch
        };
        Duration::from_secs_f64(period_s).min(PERIOD_MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paces(duty_pct: u8, fast_ms: u64, slow_ms: u64) -> (f64, f64) {
        let shared = SharedPace::new(duty_pct);
        let fast = shared.add_group(Duration::from_millis(100));
        let slow = shared.add_group(Duration::from_secs(1));
        fast.record_busy_time(Duration::from_millis(fast_ms));
        slow.record_busy_time(Duration::from_millis(slow_ms));
        (fast.period().as_secs_f64(), slow.period().as_secs_f64())
    }

    #[test]
    fn a_quick_control_is_asked_as_was_wanted() {
        assert_eq!(paces(50, 10, 5), (0.1, 1.0));
    }

    #[test]
    fn a_slow_control_never_gives_more_than_its_duty() {
        for duty_pct in [5, 25, 50, 100] {
            for (fast_ms, slow_ms) in [(60, 30), (120, 120), (300, 300), (500, 40), (950, 250), (30, 500)] {
                let (fast_s, slow_s) = paces(duty_pct, fast_ms, slow_ms);
                let duty = fast_ms as f64 / 1000.0 / fast_s + slow_ms as f64 / 1000.0 / slow_s;
                let planned = PLANNED * f64::from(duty_pct) / 100.0;
                assert!(duty <= planned + 1e-9, "{duty_pct} % {fast_ms} {slow_ms}: {duty}");
                let waits = fast_s > 0.1 || slow_s > 1.0;
                assert!(
                    !waits || duty > 0.99 * planned,
                    "nothing is given away: {duty_pct} % {fast_ms} {slow_ms} {duty}"
                );
            }
        }
    }

    #[test]
    fn a_hiccup_changes_no_period_and_a_slow_spell_ends_with_its_first_quick_answer() {
        let shared = SharedPace::new(50);
        let fast = shared.add_group(Duration::from_millis(100));
        let took = |ms: u64| {
            fast.record_busy_time(Duration::from_millis(ms));
            fast.period()
        };
        assert_eq!((fast.busy_time(), fast.period()), (None, Duration::from_millis(100)));
        assert_eq!([took(5), took(1500), took(5)], [Duration::from_millis(100); 3], "one hiccup");
        took(1500);
        assert!(took(1500) > Duration::from_secs(3), "twice is a slow control");
        assert_eq!(took(5), Duration::from_millis(100), "and it is quick again");
        assert_eq!(
            [took(300), took(5), took(300), took(5)],
            [Duration::from_millis(100); 4],
            "the line keeps the duty"
        );
    }

    #[test]
    fn noise_about_the_usual_time_moves_the_period_little() {
        let shared = SharedPace::new(50);
        let fast = shared.add_group(Duration::from_millis(100));
        (0..40).for_each(|n| fast.record_busy_time(Duration::from_millis(150 + 100 * (n % 2))));
        let period_s = fast.period().as_secs_f64();
        assert!((period_s - 0.2 / 0.45).abs() < 0.05, "{period_s}");
    }
}
