//! The alarm of a worn edge: only on repeated violation of the limit, cleared with a hysteresis.
//!
//! One standard deviation of a single cut about a surface is worth half a millimetre of wear in places; a single power above
//! the limit means little.

use adapters::clock::{SECOND_NS, TimeNs};
use std::collections::VecDeque;

/// When the alarm is raised and cleared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlarmRule {
    /// Judged moments that must violate the limit,
    pub violations: usize,
    /// of so many in a row,
    pub of: usize,
    /// that lie within this time, s.
    pub window_s: f64,
    /// Least time between two judged moments, s: neighbouring ticks repeat each other.
    pub spacing_s: f64,
    /// A violation exceeds the limit by so many of its standard deviations.
    pub margin_sd: f64,
    /// The alarm is cleared when as many moments lie below this share of the limit.
    pub clear_share: f64,
}

impl Default for AlarmRule {
    fn default() -> Self {
        Self { violations: 4, of: 6, window_s: 600.0, spacing_s: 2.0, margin_sd: 0.0, clear_share: 0.95 }
    }
}

impl AlarmRule {
    /// The rule with every number where it makes sense: at least one violation, no more than moments.
    #[must_use]
    pub fn bounded(self) -> Self {
        let finite = |value: f64, or: f64| if value.is_finite() { value } else { or };
        let of = self.of.clamp(1, MOMENTS_MAX);
        Self {
            violations: self.violations.clamp(1, of),
            of,
            window_s: finite(self.window_s, 600.0).max(0.0),
            spacing_s: finite(self.spacing_s, 2.0).max(0.0),
            margin_sd: finite(self.margin_sd, 0.0),
            clear_share: finite(self.clear_share, 0.95).clamp(0.0, 1.0),
        }
    }
}

/// Moments that a rule can look back at.
const MOMENTS_MAX: usize = 1000;

/// What changed at a moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// The alarm begins.
    Raised,
    /// The alarm ends.
    Cleared,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Judged {
    at_ns: TimeNs,
    above: bool,
    below: bool,
}

/// Follows one edge.
#[derive(Debug, Clone)]
pub struct WearAlarm {
    rule: AlarmRule,
    judged: VecDeque<Judged>,
    stands: bool,
}

impl WearAlarm {
    /// No alarm; the rule is bounded first.
    #[must_use]
    pub fn new(rule: AlarmRule) -> Self {
        Self { rule: rule.bounded(), judged: VecDeque::new(), stands: false }
    }

    /// Does the alarm stand?
    #[must_use]
    pub fn stands(&self) -> bool {
        self.stands
    }

    /// Judges one moment of cutting: a power against its limit and the standard deviation of the limit, W. Only observable,
    /// not extrapolated moments belong here; time does not go back.
    pub fn judge(&mut self, at_ns: TimeNs, power_w: f64, (limit_w, limit_sd_w): (f64, f64)) -> Option<Change> {
        let spacing_ns = nanoseconds(self.rule.spacing_s);
        let numbers = [power_w, limit_w, limit_sd_w].iter().all(|number| number.is_finite());
        if !numbers || self.judged.back().is_some_and(|last| at_ns - last.at_ns < spacing_ns) {
            return None;
        }
        let above = power_w > limit_w + self.rule.margin_sd * limit_sd_w;
        self.judged.push_back(Judged { at_ns, above, below: power_w < self.rule.clear_share * limit_w });
        self.forget(at_ns);
        self.turn()
    }

    fn forget(&mut self, at_ns: TimeNs) {
        let window_ns = nanoseconds(self.rule.window_s);
        while self.judged.len() > self.rule.of || self.judged.front().is_some_and(|it| at_ns - it.at_ns > window_ns) {
            self.judged.pop_front();
        }
    }

    fn turn(&mut self) -> Option<Change> {
        let count = |wanted: fn(&Judged) -> bool| self.judged.iter().filter(|it| wanted(it)).count();
        let enough = self.rule.violations;
        let change = match self.stands {
            false if count(|it| it.above) >= enough => Change::Raised,
            true if count(|it| it.below) >= enough => Change::Cleared,
            _ => return None,
        };
        self.stands = change == Change::Raised;
        self.judged.clear();
        Some(change)
    }

    /// Another edge is in use: nothing of the past counts. Tells whether an alarm ended by it.
    pub fn new_edge(&mut self) -> Option<Change> {
        self.judged.clear();
        std::mem::replace(&mut self.stands, false).then_some(Change::Cleared)
    }
}

#[expect(clippy::cast_possible_truncation, reason = "saturates, which is meant")]
fn nanoseconds(seconds: f64) -> i64 {
    (seconds * SECOND_NS as f64) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn alarm() -> WearAlarm {
        WearAlarm::new(AlarmRule { spacing_s: 1.0, ..AlarmRule::default() })
    }

    /// Judges one power a second against 1000 W; what changed, and when.
    fn follow(alarm: &mut WearAlarm, from_s: i64, powers: &[f64]) -> Vec<(i64, Change)> {
        let seconds = from_s..;
        seconds
            .zip(powers)
            .filter_map(|(at_s, power)| Some((at_s, alarm.judge(at_s * SECOND_NS, *power, (1000.0, 40.0))?)))
            .collect()
    }

    #[test]
    fn one_violation_is_none_and_four_of_six_are() {
        let mut alarm = alarm();
        assert!(follow(&mut alarm, 0, &[900.0, 1500.0, 900.0, 900.0, 1500.0, 900.0, 900.0, 1500.0]).is_empty());
        assert_eq!(
            follow(&mut alarm, 20, &[900.0, 900.0, 1010.0, 1020.0, 990.0, 1010.0, 1010.0]),
            [(26, Change::Raised)]
        );
        assert!(alarm.stands());
    }

    #[test]
    fn it_is_cleared_with_a_hysteresis_or_by_a_new_edge() {
        let mut alarm = alarm();
        follow(&mut alarm, 0, &[1100.0; 6]);
        assert!(follow(&mut alarm, 10, &[980.0; 20]).is_empty(), "between 95 % and the limit it stays");
        assert_eq!(follow(&mut alarm, 40, &[940.0; 4]), [(43, Change::Cleared)]);
        follow(&mut alarm, 50, &[1100.0; 6]);
        assert_eq!(alarm.new_edge(), Some(Change::Cleared));
        assert_eq!(alarm.new_edge(), None);
    }

    #[test]
    fn violations_that_lie_far_apart_and_neighbouring_ticks_do_not_add_up() {
        let mut alarm = alarm();
        for hour in 0..8 {
            assert_eq!(alarm.judge(hour * 3600 * SECOND_NS, 1500.0, (1000.0, 40.0)), None);
        }
        let mut alarm = self::alarm();
        for tick in 0..20 {
            assert_eq!(
                alarm.judge(tick * SECOND_NS / 10, 1500.0, (1000.0, 40.0)),
                None,
                "two seconds are three moments"
            );
        }
        assert_eq!(alarm.judge(0, f64::NAN, (1000.0, 40.0)), None);
    }

    #[test]
    fn noise_about_a_power_below_the_limit_raises_it_far_less_often_than_single_violations() {
        // Uniform noise about 940 W: three moments in twenty violate 1000 W; four of six do so in one of 300.
        let mut alarm = WearAlarm::new(AlarmRule::default());
        let mut seed = 1_u64;
        let (mut single, mut raised) = (0, 0);
        for moment in 0..20_000 {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let power_w = 855.0 + (seed >> 33) as f64 / f64::from(1_u32 << 31) * 170.0;
            single += usize::from(power_w > 1000.0);
            raised += usize::from(alarm.judge(2 * moment * SECOND_NS, power_w, (1000.0, 40.0)) == Some(Change::Raised));
        }
        assert!(single > 2500 && raised * 40 < single, "{single} violations, {raised} alarms");
    }
}
