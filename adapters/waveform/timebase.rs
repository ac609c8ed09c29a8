//! The sampler's clock on the gateway's.
//!
//! A packet can be late, never early: of all differences between arrival and the time of the last sample, the least ones
//! are those with nothing in the way. The least of every few seconds is kept for a minute; a straight line through them
//! gives offset and drift.

use crate::clock::{SECOND_NS, TimeNs};
use std::collections::VecDeque;

/// Length of a stretch of which the least difference counts.
const STRETCH_NS: i64 = 2 * SECOND_NS;
/// So many of them: a minute.
const STRETCHES: usize = 30;

/// Maps one clock to the other by the lower envelope of their differences.
#[derive(Debug, Clone, Default)]
pub struct TimeBase {
    /// Sampler's time and difference, the least of each stretch, the oldest first.
    least: VecDeque<(TimeNs, i64)>,
    began_ns: Option<TimeNs>,
}

impl TimeBase {
    /// Takes the time of a block's last sample on the sampler's clock, and when it arrived on the gateway's.
    pub fn push(&mut self, sampler_ns: TimeNs, arrived_ns: TimeNs) {
        let difference = arrived_ns.saturating_sub(sampler_ns);
        let new = self.began_ns.is_none_or(|began_ns| !(0..STRETCH_NS).contains(&(sampler_ns - began_ns)));
        if self.began_ns.is_some_and(|began_ns| sampler_ns < began_ns) {
            self.least.clear();
        }
        if new {
            if self.least.len() >= STRETCHES {
                self.least.pop_front();
            }
            self.least.push_back((sampler_ns, difference));
            self.began_ns = Some(sampler_ns);
        } else if let Some(last) = self.least.back_mut().filter(|last| difference < last.1) {
            *last = (sampler_ns, difference);
        }
    }

    /// The sampler's time on the gateway's clock.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "differences within a minute")]
    pub fn gateway_ns(&self, sampler_ns: TimeNs) -> TimeNs {
        let Some((from_ns, offset_ns, slope)) = self.fit_line() else { return sampler_ns };
        let drift_ns = (slope * (sampler_ns - from_ns) as f64) as i64;
        sampler_ns.saturating_add(offset_ns).saturating_add(drift_ns)
    }

    /// The sampler's clock runs slow by so many parts per million; `None` before ten seconds have been seen.
    #[must_use]
    pub fn drift_ppm(&self) -> Option<f64> {
        let span_ns = self.least.back()?.0 - self.least.front()?.0;
        (span_ns >= 10 * SECOND_NS).then(|| 1e6 * self.fit_line().map_or(0.0, |(.., slope)| slope))
    }

    /// Time, difference there, and slope. Below the points: their mean, lowered until none lies under it.
    #[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "differences within a minute")]
    fn fit_line(&self) -> Option<(TimeNs, i64, f64)> {
        let (from_ns, base_ns) = *self.least.front()?;
        let count = f64::from(u32::try_from(self.least.len()).ok()?);
        let points: Vec<(f64, f64)> =
            self.least.iter().map(|(at, difference)| ((at - from_ns) as f64, (difference - base_ns) as f64)).collect();
        let mean = points.iter().fold((0.0, 0.0), |sum, point| (sum.0 + point.0 / count, sum.1 + point.1 / count));
        let spread: f64 = points.iter().map(|point| (point.0 - mean.0).powi(2)).sum();
        let joint: f64 = points.iter().map(|point| (point.0 - mean.0) * (point.1 - mean.1)).sum();
        let slope = if self.least.len() >= 6 && spread > 0.0 { joint / spread } else { 0.0 };
        let under = points.iter().map(|point| point.1 - slope * point.0).fold(f64::INFINITY, f64::min);
        Some((from_ns, base_ns + under as i64, slope))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn late_packets_do_not_move_the_clock_and_drift_is_seen() {
        let mut base = TimeBase::default();
        let truth = |sampler_ns: i64| sampler_ns + 5_000_000_000 + sampler_ns / 20_000;
        for block in 0_i64..600 {
            let sampler_ns = block * 100_000_000;
            // Up to 40 ms late; in every second one of ten has nothing in the way.
            let late_ns = (block * 7 % 10) * 4_000_000;
            base.push(sampler_ns, truth(sampler_ns) + late_ns);
        }
        let error_ns = base.gateway_ns(59_000_000_000) - truth(59_000_000_000);
        assert!(error_ns.abs() < 500_000, "{error_ns} ns");
        let ppm = base.drift_ppm().expect("a minute");
        assert!((ppm - 50.0).abs() < 5.0, "{ppm}");
    }

    #[test]
    fn a_sampler_that_begins_anew_is_followed() {
        let mut base = TimeBase::default();
        base.push(1_000, 11_000);
        base.push(10, 50_010);
        assert_eq!(base.gateway_ns(10), 50_010);
    }
}
