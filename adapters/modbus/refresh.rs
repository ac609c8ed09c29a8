//! How often the meter really has something new, measured: a meter that is asked ten times a second and renews its values
//! once a second gives ten readings and one measurement.
//!
//! The registers of successive polls are compared as a whole. Voltage and current of a live supply never repeat in every
//! digit over two renewals, so a change of any register is a renewal and no change is none. The mean time between changes
//! is the refresh; at every poll something new means that the meter is at least as fast as the polling.

use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::integer::count_to_f64;
use std::collections::VecDeque;

/// The last so many renewals count.
const INTERVALS: usize = 256;
/// Fewer renewals say nothing yet.
const LEAST: usize = 16;
/// As many polls as this must bring something new before the meter counts as faster than the polling.
const EVERY_POLL_SHARE: f64 = 0.9;

/// Compares successive polls of a meter.
#[derive(Debug, Clone, Default)]
pub struct Refresh {
    last: Vec<u16>,
    changed_ns: Option<TimeNs>,
    polls_since: u32,
    /// Time since the renewal before, and polls it took.
    intervals: VecDeque<(i64, u32)>,
}

/// How often a meter renews its values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effective {
    /// Mean time between two renewals, s; an upper bound when `at_least_as_fast` is set.
    pub refresh_s: f64,
    /// Half the width of its 95 % interval, s.
    pub uncertainty_s: f64,
    /// Every poll brings something new: the meter is at least as fast as the polling.
    pub at_least_as_fast: bool,
}

impl Refresh {
    /// Takes the registers of a poll, in the order of the polls.
    pub fn push(&mut self, registers: impl Iterator<Item = u16> + Clone, at_ns: TimeNs) {
        self.polls_since = self.polls_since.saturating_add(1);
        if self.last.iter().copied().eq(registers.clone()) {
            return;
        }
        if let Some(changed_ns) = self.changed_ns {
            if self.intervals.len() >= INTERVALS {
                self.intervals.pop_front();
            }
            self.intervals.push_back((at_ns - changed_ns, self.polls_since));
        }
        self.last.clear();
        self.last.extend(registers);
        (self.changed_ns, self.polls_since) = (Some(at_ns), 0);
    }

    /// A poll failed: the time over the gap says nothing.
    pub fn forget_last_change(&mut self) {
        (self.changed_ns, self.polls_since) = (None, 0);
    }

    /// What is known; `None` before enough renewals were seen.
    #[must_use]
    pub fn estimate_interval(&self) -> Option<Effective> {
        if self.intervals.len() < LEAST {
            return None;
        }
        let mut sorted: Vec<i64> = self.intervals.iter().map(|(ns, _)| *ns).collect();
        sorted.sort_unstable();
        let middle = to_seconds(sorted[sorted.len() / 2]);
        // A renewal with the same digits hides one; a stall of the line shows as a long one.
        let near = |ns: &i64| (0.5 * middle..=1.5 * middle).contains(&to_seconds(*ns));
        let kept: Vec<f64> = sorted.iter().filter(|ns| near(ns)).map(|ns| to_seconds(*ns)).collect();
        let count = count_to_f64(kept.len()).max(1.0);
        let mean = kept.iter().sum::<f64>() / count;
        let variance = kept.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
        let every = self.intervals.iter().filter(|(_, polls)| *polls == 1).count();
        let share = count_to_f64(every) / count_to_f64(sorted.len());
        Some(Effective {
            refresh_s: mean,
            uncertainty_s: 1.96 * (variance / count).sqrt(),
            at_least_as_fast: share >= EVERY_POLL_SHARE,
        })
    }
}

#[expect(clippy::cast_precision_loss, reason = "times between polls are far below 2^53 ns")]
fn to_seconds(ns: i64) -> f64 {
    ns as f64 / SECOND_NS as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A meter that renews every `refresh_ms`, asked every `poll_ms`.
    fn measured(refresh_ms: i64, poll_ms: i64, polls: i64) -> Option<Effective> {
        let mut refresh = Refresh::default();
        for poll in 0..polls {
            let at_ms = poll * poll_ms;
            let number = u16::try_from(at_ms / refresh_ms % 65536).expect("sixteen bits");
            refresh.push([number, 7].into_iter(), at_ms * 1_000_000);
        }
        refresh.estimate_interval()
    }

    #[test]
    fn a_slow_meter_is_found_out() {
        let found = measured(730, 100, 2000).expect("known");
        assert!((found.refresh_s - 0.73).abs() < 0.02 && !found.at_least_as_fast, "{found:?}");
        assert!(found.uncertainty_s < 0.02);
    }

    #[test]
    fn a_fast_meter_is_only_bounded() {
        let found = measured(64, 100, 500).expect("known");
        assert!((found.refresh_s - 0.1).abs() < 0.005 && found.at_least_as_fast, "{found:?}");
    }

    #[test]
    fn nothing_is_said_of_a_meter_that_stands_still() {
        assert_eq!(measured(1_000_000, 100, 500), None);
    }
}
