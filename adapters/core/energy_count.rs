//! Can this be the count of an energy meter? What one reading of a counter says beside the one before it.
//!
//! A counter moves by no more than the greatest power of its channel in the time that has passed. Every other step is an event:
//!
//! | event | what is seen | the reading | consumption |
//! |---|---|---|---|
//! | [`CounterEvent::Rollover`] | a fall from just below the end of the register or of the digits to just above 0 | believed | goes on over it |
//! | [`CounterEvent::BelowZero`] | a jump to the end of an unsigned register: a number below zero | withheld | stands |
//! | [`CounterEvent::Zero`] | exactly 0 for some readings, then the count of before | withheld | goes on |
//! | [`CounterEvent::Jump`] | another count for some readings, then the one of before | withheld | goes on |
//! | [`CounterEvent::Reset`] | a lower count that stays | withheld until it has stayed | goes on from the new count |
//! | [`CounterEvent::Replaced`] | a higher count that stays | withheld until it has stayed | goes on from the new count |
//!
//! What stays is the same count, or moves as a counter does, for [`STAYS_READINGS`] readings and [`STAYS_NS`]. A shorter time would
//! believe the zeros of a meter that starts, a longer one costs a count that was really reset its values for so long. Pure: time is an argument.

use crate::clock::{SECOND_NS, TimeNs};
use crate::driver::{Fact, SourceProblem};

/// Greatest power of a machine, kW: that of the channels `total_power_w` and `spindle_power_w`.
const POWER_MAX_KW: f64 = 1000.0;
/// Readings of another count after which it is believed.
pub const STAYS_READINGS: u32 = 5;
/// And so long, ns.
pub const STAYS_NS: i64 = 3 * SECOND_NS;
/// Greatest fall of a counter that counts with a sign, and greatest step over the digits of a display, kWh: ten seconds of the greatest power.
const FALL_MAX_KWH: f64 = POWER_MAX_KW * 10.0 / 3600.0;
/// Of an unsigned register, the last part in which a count is a number below zero, unless it was reached by counting.
const BELOW_ZERO_SHARE: f64 = 1e-3;
/// Digits of a display after which a counter begins anew.
const DIGITS: std::ops::RangeInclusive<i32> = 4..=9;
/// An event is told for so long.
const TOLD_NS: i64 = 600 * SECOND_NS;

/// What happened to a counter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CounterEvent {
    /// It began anew at the end of its range.
    Rollover,
    /// It was set to a lower count and went on from there.
    Reset,
    /// It was set to a higher count, or is another counter.
    Replaced,
    /// It said exactly 0 for a moment.
    Zero,
    /// It said another count for a moment.
    Jump,
    /// It said a number below zero in a register that has none.
    BelowZero,
}

impl CounterEvent {
    /// Every event, in the order of their counts.
    pub const ALL: [Self; 6] = [Self::Rollover, Self::Reset, Self::Replaced, Self::Zero, Self::Jump, Self::BelowZero];

    /// The fact that counts it.
    #[must_use]
    pub fn as_fact(self) -> &'static str {
        match self {
            Self::Rollover => "counter_rollovers",
            Self::Reset => "counter_resets",
            Self::Replaced => "counter_replacements",
            Self::Zero => "counter_zeros",
            Self::Jump => "counter_jumps",
            Self::BelowZero => "counter_underflows",
        }
    }

    fn describe_event(self) -> (&'static str, &'static str) {
        match self {
            Self::Rollover => {
                ("began anew at the end of its range", "Nothing needs to be done: the consumption goes on over it")
            }
            Self::Reset => ("was set back", "Nothing needs to be done if somebody has reset or changed the meter"),
            Self::Replaced => ("went on from a higher count", "Nothing needs to be done if the meter was changed"),
            Self::Zero => (
                "said 0 for a moment, which is not believed",
                "Look at the meter's supply and its line if that comes often",
            ),
            Self::Jump => (
                "said another count for a moment, which is not believed",
                "Look at the meter's line if that comes often",
            ),
            Self::BelowZero => (
                "said a number below zero, which its register cannot hold",
                "Look whether the meter counts energy that is fed back with a sign",
            ),
        }
    }
}

/// How a counter lies in its register.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CounterForm {
    /// Where the register begins anew, kWh; `None` for one that never does.
    pub wraps_at_kwh: Option<f64>,
    /// Has the register no sign?
    pub is_unsigned: bool,
    /// Smallest step, as a share of the count and in kWh.
    pub resolution: (f64, f64),
}

/// Another count than was expected.
#[derive(Debug, Clone, Copy, PartialEq)]
struct OtherCount {
    first_ns: TimeNs,
    first_kwh: f64,
    last_ns: TimeNs,
    last_kwh: f64,
    readings: u32,
}

/// Follows the count of one meter.
#[derive(Debug, Clone, PartialEq)]
pub struct EnergyCount {
    form: CounterForm,
    last_count: Option<(TimeNs, f64)>,
    other: Option<OtherCount>,
    is_below_zero: bool,
    consumed_kwh: f64,
    events: [u32; CounterEvent::ALL.len()],
    last_event: Option<(TimeNs, CounterEvent)>,
}

impl EnergyCount {
    /// A counter of which nothing is known.
    #[must_use]
    pub fn new(form: CounterForm) -> Self {
        Self {
            form,
            last_count: None,
            other: None,
            is_below_zero: false,
            consumed_kwh: 0.0,
            events: [0; CounterEvent::ALL.len()],
            last_event: None,
        }
    }

    /// Energy since the first reading, kWh, over every event.
    #[must_use]
    pub fn consumed_kwh(&self) -> f64 {
        self.consumed_kwh
    }

    /// How often this has happened.
    #[must_use]
    pub fn count_events(&self, event: CounterEvent) -> u32 {
        self.events[event as usize]
    }

    /// Is this reading, in kWh, believed?
    pub fn judge_count(&mut self, at_ns: TimeNs, kwh: f64) -> bool {
        if self.last_event.is_some_and(|(told_ns, _)| !(0..TOLD_NS).contains(&at_ns.saturating_sub(told_ns))) {
            self.last_event = None;
        }
        let Some((believed_ns, last_kwh)) = self.last_count else {
            return self.judge_first(at_ns, kwh);
        };
        let most_kwh = self.compute_most_kwh(at_ns, believed_ns, last_kwh);
        if self.is_counted_step(last_kwh, kwh, most_kwh) {
            self.end_other_count(at_ns);
            self.consumed_kwh += kwh - last_kwh;
            self.believe(at_ns, kwh);
            return true;
        }
        if self.is_end_of_register(kwh) {
            self.record_below_zero(at_ns);
            return false;
        }
        if let Some(step_kwh) = self.find_rollover_step(last_kwh, kwh, most_kwh) {
            self.record_event(at_ns, CounterEvent::Rollover);
            self.consumed_kwh += step_kwh;
            self.believe(at_ns, kwh);
            return true;
        }
        self.follow_other_count(at_ns, kwh, most_kwh)
    }

    fn judge_first(&mut self, at_ns: TimeNs, kwh: f64) -> bool {
        if self.is_end_of_register(kwh) {
            self.record_below_zero(at_ns);
            return false;
        }
        self.believe(at_ns, kwh);
        true
    }

    fn believe(&mut self, at_ns: TimeNs, kwh: f64) {
        (self.last_count, self.other, self.is_below_zero) = (Some((at_ns, kwh)), None, false);
    }

    /// Can a counter have moved so? A register without a sign never falls. One that counts what is fed back does, by no more than the
    /// greatest power makes in a few seconds: a longer outage in which it falls has hidden a reset. Exactly 0 is no step of a count.
    fn is_counted_step(&self, last_kwh: f64, kwh: f64, most_kwh: f64) -> bool {
        let blur_kwh = self.compute_most_kwh(0, 0, last_kwh);
        let fall_kwh = if self.form.is_unsigned { blur_kwh } else { most_kwh.min(blur_kwh + FALL_MAX_KWH) };
        match kwh - last_kwh {
            _ if kwh == 0.0 && last_kwh.abs() > blur_kwh => false,
            step_kwh if step_kwh < 0.0 => -step_kwh <= fall_kwh,
            step_kwh => step_kwh <= most_kwh,
        }
    }

    /// By how much a counter may have moved since then, kWh.
    #[expect(clippy::cast_precision_loss, reason = "a time between two readings")]
    fn compute_most_kwh(&self, at_ns: TimeNs, since_ns: TimeNs, count_kwh: f64) -> f64 {
        let hours = at_ns.saturating_sub(since_ns).max(0) as f64 / (3600.0 * SECOND_NS as f64);
        let (share, kwh) = self.form.resolution;
        POWER_MAX_KW * hours + 2.0 * (kwh + share * count_kwh.abs())
    }

    fn is_end_of_register(&self, kwh: f64) -> bool {
        self.form.is_unsigned && self.form.wraps_at_kwh.is_some_and(|end_kwh| kwh >= end_kwh * (1.0 - BELOW_ZERO_SHARE))
    }

    fn record_below_zero(&mut self, at_ns: TimeNs) {
        if !self.is_below_zero {
            self.record_event(at_ns, CounterEvent::BelowZero);
        }
        (self.is_below_zero, self.other) = (true, None);
    }

    /// What was counted over the end of the range, if that can be: over that of the register, or over the digits of the display in a few
    /// seconds. After a longer outage a fall to a small count is rather a reset than the end of some digits.
    fn find_rollover_step(&self, last_kwh: f64, kwh: f64, most_kwh: f64) -> Option<f64> {
        if kwh < 0.0 || kwh >= last_kwh {
            return None;
        }
        let blur_kwh = self.compute_most_kwh(0, 0, last_kwh);
        let digits = DIGITS.map(|digits| (10_f64.powi(digits), most_kwh.min(blur_kwh + FALL_MAX_KWH)));
        let ends = self.form.wraps_at_kwh.map(|end_kwh| (end_kwh, most_kwh)).into_iter().chain(digits);
        let is_possible =
            |(end_kwh, most_kwh): &(f64, f64)| *end_kwh > last_kwh && end_kwh - last_kwh + kwh <= *most_kwh;
        ends.filter(is_possible).map(|(end_kwh, _)| end_kwh - last_kwh + kwh).reduce(f64::min)
    }

    /// A count that stays is believed.
    fn follow_other_count(&mut self, at_ns: TimeNs, kwh: f64, most_kwh: f64) -> bool {
        let fresh = OtherCount { first_ns: at_ns, first_kwh: kwh, last_ns: at_ns, last_kwh: kwh, readings: 1 };
        let known = self.other.filter(|other| {
            (kwh - other.last_kwh).abs() <= self.compute_most_kwh(at_ns, other.last_ns, other.last_kwh)
        });
        let other = known.map_or(fresh, |other| OtherCount {
            last_ns: at_ns,
            last_kwh: kwh,
            readings: other.readings.saturating_add(1),
            ..other
        });
        if other.readings < STAYS_READINGS || at_ns.saturating_sub(other.first_ns) < STAYS_NS {
            self.other = Some(other);
            return false;
        }
        let is_lower = self.last_count.is_some_and(|(_, last_kwh)| kwh < last_kwh);
        // From zero on it has counted what it shows, as far as that can be since it was last believed.
        let from_zero = is_lower && (0.0..=most_kwh).contains(&kwh);
        self.consumed_kwh += if from_zero { kwh } else { kwh - other.first_kwh };
        self.record_event(at_ns, if is_lower { CounterEvent::Reset } else { CounterEvent::Replaced });
        self.believe(at_ns, kwh);
        true
    }

    /// The count of before is there again.
    fn end_other_count(&mut self, at_ns: TimeNs) {
        if let Some(other) = self.other.take() {
            let event = if other.last_kwh == 0.0 { CounterEvent::Zero } else { CounterEvent::Jump };
            self.record_event(at_ns, event);
        }
    }

    fn record_event(&mut self, at_ns: TimeNs, event: CounterEvent) {
        self.events[event as usize] = self.events[event as usize].saturating_add(1);
        self.last_event = Some((at_ns, event));
    }

    /// The consumption, and every event that has happened.
    #[must_use]
    pub fn collect_facts(&self) -> Vec<Fact> {
        let events = CounterEvent::ALL.into_iter().filter(|event| self.count_events(*event) > 0);
        let mut facts = vec![Fact::from_number("consumed_since_start_kwh", self.consumed_kwh)];
        facts.extend(events.map(|event| Fact::from_number(event.as_fact(), f64::from(self.count_events(event)))));
        facts
    }

    /// What has happened in the last minutes, or goes on.
    #[must_use]
    pub fn find_problem(&self) -> Option<SourceProblem> {
        let (_, event) = self.last_event?;
        let (what, next) = event.describe_event();
        Some(SourceProblem { what: format!("the energy counter {what}"), next: next.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORM: CounterForm =
        CounterForm { wraps_at_kwh: Some(42_949_672.96), is_unsigned: true, resolution: (0.0, 0.01) };

    /// Second, count, whether it is believed.
    fn run(form: CounterForm, readings: &[(i64, f64, bool)]) -> EnergyCount {
        let mut count = EnergyCount::new(form);
        for (second, kwh, believed) in readings {
            assert_eq!(count.judge_count(second * SECOND_NS, *kwh), *believed, "{second} s: {kwh} kWh");
        }
        count
    }

    fn events(count: &EnergyCount) -> Vec<CounterEvent> {
        CounterEvent::ALL.into_iter().filter(|event| count.count_events(*event) > 0).collect()
    }

    #[test]
    fn a_zero_and_another_count_for_a_moment_cost_only_themselves() {
        let count =
            run(FORM, &[(0, 100.0, true), (1, 0.0, false), (2, 100.01, true), (3, 7000.0, false), (4, 100.02, true)]);
        assert_eq!(events(&count), [CounterEvent::Zero, CounterEvent::Jump]);
        assert!((count.consumed_kwh() - 0.02).abs() < 1e-9);
    }

    #[test]
    fn a_rollover_and_a_reset_keep_the_consumption() {
        let count = run(FORM, &[(0, 42_949_672.90, false), (1, 99_999.98, true), (2, 0.01, true), (3, 0.02, true)]);
        assert_eq!(events(&count), [CounterEvent::Rollover, CounterEvent::BelowZero], "digits of a display");
        assert!((count.consumed_kwh() - 0.04).abs() < 1e-9, "{}", count.consumed_kwh());
        let small = CounterForm { wraps_at_kwh: Some(65_536.0), is_unsigned: true, resolution: (0.0, 1.0) };
        let counted: Vec<(i64, f64, bool)> =
            (0..60).map(|step| (step * 3600, 65_470.0 + count_step(step), true)).collect();
        let mut all = counted;
        all.push((60 * 3600, 4.0, true));
        let count = run(small, &all);
        assert!((count.consumed_kwh() - 70.0).abs() < 1e-9, "{}", count.consumed_kwh());
        let stays: Vec<(i64, f64, bool)> = (1..8).map(|second| (second, 0.01, second >= 5)).collect();
        let count = run(FORM, &[&[(0, 5000.0, true)][..], &stays].concat());
        assert_eq!((events(&count), count.consumed_kwh()), (vec![CounterEvent::Reset], 0.01));
    }

    #[expect(clippy::cast_precision_loss, reason = "a small number")]
    fn count_step(step: i64) -> f64 {
        step as f64
    }

    #[test]
    fn a_number_below_zero_is_never_believed_and_one_that_is_counted_up_to_is() {
        let below: Vec<(i64, f64, bool)> = (1..100).map(|second| (second, 42_949_672.90, false)).collect();
        let count = run(FORM, &[&[(0, 0.05, true)][..], &below, &[(100, 0.06, true)]].concat());
        assert_eq!((events(&count), count.count_events(CounterEvent::BelowZero)), (vec![CounterEvent::BelowZero], 1));
        let signed = CounterForm { wraps_at_kwh: Some(21_474_836.48), is_unsigned: false, resolution: (0.0, 0.01) };
        assert_eq!(events(&run(signed, &[(0, 0.01, true), (1, -0.02, true), (2, 0.0, true)])), []);
    }

    #[test]
    fn a_changed_meter_counts_from_its_own_count_and_an_outage_costs_nothing() {
        let changed: Vec<(i64, f64, bool)> =
            (1..9).map(|second| (second, 9000.0 + count_step(second) * 0.01, second >= 5)).collect();
        let count = run(FORM, &[&[(0, 100.0, true)][..], &changed].concat());
        assert_eq!(events(&count), [CounterEvent::Replaced]);
        assert!((count.consumed_kwh() - 0.07).abs() < 1e-9, "{}", count.consumed_kwh());
        let count = run(FORM, &[(0, 9000.0, true), (36_000, 0.02, false), (36_001, 0.02, false)]);
        assert_eq!(count.consumed_kwh(), 0.0, "a reset in a long outage is no energy that was fed back");
        let count = run(FORM, &[(0, 100.0, true), (36_000, 300.0, true)]);
        assert!((count.consumed_kwh() - 200.0).abs() < 1e-9 && count.find_problem().is_none());
    }

    proptest::proptest! {
        /// A counter of any register, with disturbances of any kind: what is believed is what it has counted.
        #[test]
        fn what_is_believed_is_what_was_counted(
            start in 0.0_f64..60_000.0,
            steps in proptest::collection::vec((0.0_f64..0.05, 0_u8..12), 1..200),
        ) {
            let form = CounterForm { wraps_at_kwh: Some(65_536.0), is_unsigned: true, resolution: (0.0, 0.01) };
            let (mut count, mut true_kwh, mut consumed, mut first) = (EnergyCount::new(form), start, 0.0, None);
            for (second, (step, disturbance)) in (0_i64..).zip(steps) {
                (true_kwh, consumed) = (true_kwh + step, consumed + step);
                // Two of three readings are undisturbed, so that no disturbance stays.
                let told = match disturbance {
                    _ if second % 3 != 0 => true_kwh,
                    0 => 0.0,
                    1 => 65_535.99,
                    2 => (true_kwh + 30_000.0) % 60_000.0,
                    _ => true_kwh,
                };
                if second == 0 {
                    continue;
                }
                if count.judge_count(second * SECOND_NS, told) {
                    first.get_or_insert(consumed);
                    proptest::prop_assert!((told - true_kwh).abs() < 0.6, "{told} for {true_kwh}");
                    let wanted = consumed - first.unwrap_or(consumed);
                    proptest::prop_assert!((count.consumed_kwh() - wanted).abs() < 0.6);
                }
            }
        }
    }
}
