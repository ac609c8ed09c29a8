//! Which reading of the wall clock is believed, and when another one is followed. Pure.

use crate::convert::saturate_to_ns;
use adapter_core::clock::{SECOND_NS, TimeNs};
use serde::Serialize;
use std::time::Duration;

/// Wall clocks are disciplined by less than this without anybody calling it a step.
const STEP_MIN_NS: i64 = 2 * SECOND_NS;
/// A better supported reading is followed after this part of the time of confirmation: half a minute of two hours.
const SUPPORTED_PART: u32 = 240;
/// A machine may be off for a week without anybody wondering.
const LONG_SILENCE_NS: i64 = 7 * 86_400 * SECOND_NS;
/// Each leap is told, but not more often than this: a clock that flaps must not fill the history.
const TOLD_EVERY_NS: i64 = 10 * SECOND_NS;

/// What is thought of the wall clock. See the [module](super).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Trust {
    /// It has said nothing yet that can be true.
    Unset,
    /// It agrees with the box, for a short time.
    Plausible,
    /// It has agreed for the time of confirmation.
    Confirmed,
    /// It says something else than the box.
    Leapt,
}

impl Trust {
    /// The word in files and documents.
    #[must_use]
    pub const fn as_word(self) -> &'static str {
        match self {
            Self::Unset => "unset",
            Self::Plausible => "plausible",
            Self::Confirmed => "confirmed",
            Self::Leapt => "leapt",
        }
    }
}

/// How long is waited.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClockRules {
    confirm_ns: i64,
}

impl ClockRules {
    /// A reading that has stood for so long is believed.
    #[must_use]
    pub fn new(confirm: Duration) -> Self {
        Self { confirm_ns: saturate_to_ns(confirm).max(SECOND_NS) }
    }

    fn supported_ns(self) -> i64 {
        self.confirm_ns / i64::from(SUPPORTED_PART)
    }
}

impl Default for ClockRules {
    /// Two hours: longer than a time server is wrong for, shorter than a shift.
    fn default() -> Self {
        Self::new(Duration::from_secs(7200))
    }
}

/// What is known of time without the wall clock of today.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Certain {
    /// It is later than this: the program was made then, or a row was stored then under a confirmed clock.
    pub at_least_ns: TimeNs,
}

/// What happened to the clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClockNews {
    /// It has agreed with the box for long enough.
    Confirmed,
    /// It says so much more (less where negative) than the box, which keeps its own time.
    Leapt {
        /// Wall clock minus box, ns.
        ahead_ns: i64,
    },
    /// It agrees with the box again after it had leapt.
    Returned,
    /// Another reading has stood long enough: the box is to begin again with it.
    Follow {
        /// Wall clock minus box, ns.
        ahead_ns: i64,
    },
}

/// A reading that is not that of the box.
#[derive(Debug, Clone, Copy)]
struct Leap {
    ahead_ns: i64,
    since_ns: TimeNs,
}

/// The judgement of one run.
#[derive(Debug)]
pub(super) struct Judge {
    rules: ClockRules,
    certain: Certain,
    /// [`Trust::Unset`], [`Trust::Plausible`] or [`Trust::Confirmed`].
    base: Trust,
    agreed_since_ns: TimeNs,
    leap: Option<Leap>,
    told_ns: Option<TimeNs>,
    told: bool,
}

impl Judge {
    /// The first reading of a run: the time at which the box begins. `decided`: the reading has stood long enough already.
    /// A reading less than a step behind the last certain row agrees with it, as it would have while the box ran: the box goes on
    /// behind that row, so that no row is dated before it.
    pub(super) fn from_first_reading(
        rules: ClockRules,
        certain: Certain,
        wall_ns: TimeNs,
        decided: bool,
    ) -> (Self, TimeNs) {
        let possible = wall_ns >= super::MADE_NS;
        let next_ns = certain.at_least_ns.saturating_add(1);
        let is_step_behind = next_ns.saturating_sub(wall_ns) >= STEP_MIN_NS;
        let unset = !possible || (!decided && is_step_behind);
        let now_ns = match (unset, decided) {
            (false, true) => wall_ns,
            (false, false) => wall_ns.max(next_ns),
            (true, _) => next_ns,
        };
        let base = if unset { Trust::Unset } else { Trust::Plausible };
        let judge = Self { rules, certain, base, agreed_since_ns: now_ns, leap: None, told_ns: None, told: false };
        (judge, now_ns)
    }

    /// The state at this moment.
    pub(super) fn trust(&self) -> Trust {
        if self.base != Trust::Unset && self.leap.is_some() { Trust::Leapt } else { self.base }
    }

    /// Wall clock minus box, where they differ.
    pub(super) fn ahead_ns(&self) -> i64 {
        self.leap.map_or(0, |leap| leap.ahead_ns)
    }

    /// What is certain without the wall clock.
    pub(super) fn certain(&self) -> Certain {
        self.certain
    }

    /// Is what was stored in this run dated by a clock that was confirmed?
    pub(super) fn is_confirmed(&self) -> bool {
        self.base == Trust::Confirmed
    }

    /// The box says `now_ns`, the wall clock `wall_ns`.
    pub(super) fn judge_reading(&mut self, now_ns: TimeNs, wall_ns: TimeNs) -> Option<ClockNews> {
        let ahead_ns = wall_ns.saturating_sub(now_ns);
        if ahead_ns.saturating_abs() < STEP_MIN_NS {
            return self.record_agreement(now_ns);
        }
        let leap = match self.leap.filter(|leap| leap.ahead_ns.saturating_sub(ahead_ns).saturating_abs() < STEP_MIN_NS)
        {
            Some(leap) => leap,
            None => {
                let leap = Leap { ahead_ns, since_ns: now_ns };
                self.leap = Some(leap);
                self.told = false;
                leap
            }
        };
        if self.wait_ns(wall_ns, now_ns).is_some_and(|wait_ns| now_ns - leap.since_ns >= wait_ns) {
            return Some(ClockNews::Follow { ahead_ns });
        }
        let rested = self.told_ns.is_none_or(|told_ns| now_ns - told_ns >= TOLD_EVERY_NS);
        if self.told || !rested {
            return None;
        }
        (self.told, self.told_ns) = (true, Some(now_ns));
        Some(ClockNews::Leapt { ahead_ns })
    }

    fn record_agreement(&mut self, now_ns: TimeNs) -> Option<ClockNews> {
        if self.leap.take().is_some() {
            self.agreed_since_ns = now_ns;
            if self.base == Trust::Unset {
                self.base = Trust::Plausible;
            }
            if std::mem::take(&mut self.told) {
                return Some(ClockNews::Returned);
            }
        }
        let long = now_ns - self.agreed_since_ns >= self.rules.confirm_ns;
        if long && self.base != Trust::Confirmed {
            self.base = Trust::Confirmed;
            return Some(ClockNews::Confirmed);
        }
        None
    }

    /// Both times lie after what is certain. For that of the box to be true, nothing was stored for a long time; for the other one
    /// less than half as long is enough.
    fn is_much_nearer(&self, wall_ns: TimeNs, now_ns: TimeNs) -> bool {
        let silent_ns = |at_ns: TimeNs| at_ns.saturating_sub(self.certain.at_least_ns);
        silent_ns(now_ns) > LONG_SILENCE_NS && silent_ns(wall_ns) < silent_ns(now_ns) / 2
    }

    /// How long this reading has to stand before it is followed; `None`: it cannot be true.
    fn wait_ns(&self, wall_ns: TimeNs, now_ns: TimeNs) -> Option<i64> {
        let after = wall_ns >= self.certain.at_least_ns;
        match self.base {
            _ if wall_ns < super::MADE_NS => None,
            Trust::Unset if after => Some(self.rules.supported_ns()),
            Trust::Plausible if after && self.is_much_nearer(wall_ns, now_ns) => Some(self.rules.supported_ns()),
            _ => Some(self.rules.confirm_ns),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::MADE_NS;
    use super::*;

    const HOUR_NS: i64 = 3600 * SECOND_NS;
    const DAY_NS: i64 = 24 * HOUR_NS;
    /// The last certain row.
    const ROW_NS: TimeNs = MADE_NS + 100 * DAY_NS;
    const NOW_NS: TimeNs = ROW_NS + HOUR_NS;

    fn begin(wall_ns: TimeNs) -> (Judge, TimeNs) {
        Judge::from_first_reading(ClockRules::default(), Certain { at_least_ns: ROW_NS }, wall_ns, false)
    }

    /// Looks every second for so long; gives what was told, each with the second.
    fn run(
        judge: &mut Judge,
        from_ns: TimeNs,
        seconds: i64,
        wall_ns: impl Fn(TimeNs) -> TimeNs,
    ) -> Vec<(i64, ClockNews)> {
        let at = |second: i64| from_ns + second * SECOND_NS;
        (0..seconds)
            .filter_map(|second| Some((second, judge.judge_reading(at(second), wall_ns(at(second)))?)))
            .collect()
    }

    #[test]
    fn a_leap_of_up_to_an_hour_is_told_and_changes_nothing() {
        let leaps = [405 * DAY_NS, 4018 * DAY_NS, -HOUR_NS, -3653 * DAY_NS, HOUR_NS, -NOW_NS];
        for leap_ns in leaps {
            for lasts_s in [3, 10, 60, 3600] {
                let (mut judge, start_ns) = begin(NOW_NS);
                assert_eq!(start_ns, NOW_NS);
                let leapt = |now_ns: TimeNs| {
                    let within = (1800..1800 + lasts_s).contains(&((now_ns - NOW_NS) / SECOND_NS));
                    if within { now_ns + leap_ns } else { now_ns }
                };
                let told = run(&mut judge, NOW_NS, 7200 + 1800 + lasts_s + 10, leapt);
                let words: Vec<ClockNews> = told.iter().map(|(_, news)| *news).collect();
                let expected = [ClockNews::Leapt { ahead_ns: leap_ns }, ClockNews::Returned, ClockNews::Confirmed];
                assert_eq!(words, expected, "{leap_ns} for {lasts_s} s: {told:?}");
            }
        }
    }

    #[test]
    fn a_box_without_a_battery_goes_on_from_the_last_certain_row_and_follows_soon() {
        for wall_ns in [0, 10 * SECOND_NS, ROW_NS - DAY_NS] {
            let (mut judge, start_ns) = begin(wall_ns);
            assert_eq!((start_ns, judge.trust()), (ROW_NS + 1, Trust::Unset));
            let set_ns = |now_ns: TimeNs| {
                let age_ns = now_ns - start_ns;
                if age_ns < 60 * SECOND_NS { wall_ns + age_ns } else { NOW_NS + age_ns }
            };
            let told = run(&mut judge, start_ns, 91, set_ns);
            let shift_ns = NOW_NS - start_ns;
            assert!(told.contains(&(90, ClockNews::Follow { ahead_ns: shift_ns })), "{told:?}");
        }
    }

    #[test]
    fn a_clock_less_than_a_step_behind_the_last_certain_row_is_right_and_no_row_is_dated_before_it() {
        for (behind_ns, trust) in [
            (-SECOND_NS, Trust::Plausible),
            (0, Trust::Plausible),
            (1, Trust::Plausible),
            (SECOND_NS / 2, Trust::Plausible),
            (STEP_MIN_NS - 2, Trust::Plausible),
            (STEP_MIN_NS - 1, Trust::Unset),
        ] {
            let (mut judge, start_ns) = begin(ROW_NS - behind_ns);
            assert_eq!(
                (judge.trust(), start_ns),
                (trust, (ROW_NS - behind_ns).max(ROW_NS + 1)),
                "{behind_ns} ns behind"
            );
            if trust == Trust::Plausible {
                let ahead_ns = start_ns - (ROW_NS - behind_ns);
                let told = run(&mut judge, start_ns, 7300, |now_ns| now_ns - ahead_ns);
                assert_eq!(told, [(7200, ClockNews::Confirmed)], "{behind_ns} ns behind");
            }
        }
    }

    #[test]
    fn a_wrong_year_at_the_start_is_left_for_a_nearer_reading() {
        for wrong_ns in [405 * DAY_NS, 4018 * DAY_NS] {
            let (mut judge, start_ns) = begin(NOW_NS + wrong_ns);
            assert_eq!((start_ns, judge.trust()), (NOW_NS + wrong_ns, Trust::Plausible));
            let told = run(&mut judge, start_ns, 60, |now_ns| now_ns - wrong_ns);
            assert_eq!(told.get(1), Some(&(30, ClockNews::Follow { ahead_ns: -wrong_ns })), "{told:?}");
        }
    }

    #[test]
    fn a_confirmed_time_is_left_only_for_one_that_stands_as_long() {
        let (mut judge, start_ns) = begin(NOW_NS);
        assert_eq!(run(&mut judge, start_ns, 7300, |now_ns| now_ns), [(7200, ClockNews::Confirmed)]);
        let from_ns = start_ns + 7300 * SECOND_NS;
        let told = run(&mut judge, from_ns, 7300, |now_ns| now_ns - 300 * SECOND_NS);
        assert_eq!(judge.trust(), Trust::Leapt);
        assert_eq!(told[0], (0, ClockNews::Leapt { ahead_ns: -300 * SECOND_NS }));
        assert_eq!(told[1], (7200, ClockNews::Follow { ahead_ns: -300 * SECOND_NS }));
    }

    #[test]
    fn what_was_decided_is_not_doubted_again_but_the_impossible_is() {
        let certain = Certain { at_least_ns: ROW_NS };
        let (judge, now_ns) = Judge::from_first_reading(ClockRules::default(), certain, ROW_NS - DAY_NS, true);
        assert_eq!((judge.trust(), now_ns), (Trust::Plausible, ROW_NS - DAY_NS));
        let (judge, _) = Judge::from_first_reading(ClockRules::default(), certain, 0, true);
        assert_eq!(judge.trust(), Trust::Unset);
    }

    #[test]
    fn a_clock_that_flaps_is_told_now_and_then() {
        let (mut judge, start_ns) = begin(NOW_NS);
        let told = run(&mut judge, start_ns, 600, |now_ns| {
            now_ns + if (now_ns / SECOND_NS) % 2 == 0 { HOUR_NS } else { 2 * HOUR_NS }
        });
        assert!(told.len() <= 60, "{}", told.len());
        assert!(told.iter().all(|(_, news)| matches!(news, ClockNews::Leapt { .. })));
    }

    proptest::proptest! {
        #[test]
        fn no_reading_makes_it_panic_or_follow_at_once(walls in proptest::collection::vec(proptest::prelude::any::<i64>(), 1..50)) {
            let (mut judge, now_ns) = begin(walls[0]);
            for (second, wall_ns) in (0..).zip(&walls) {
                let news = judge.judge_reading(now_ns.saturating_add(second * SECOND_NS), *wall_ns);
                let follows = matches!(news, Some(ClockNews::Follow { .. }));
                proptest::prop_assert!(second >= 30 || !follows);
            }
        }
    }
}
