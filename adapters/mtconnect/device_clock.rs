//! From the times that observations are told with to the gateway's clock.
//!
//! They are times of the adapter or of the agent, whose clocks may be set to anything. An observation cannot be told before it is made: the
//! least difference between arrival and told time is the difference of the clocks, and what an observation has on top of it is its way. The
//! least one of the last minute or two counts, so that a clock that is set back is followed, and one that is set forward at once.

use adapter_core::clock::{SECOND_NS, TimeNs};
use jiff::Timestamp;
use jiff::civil::DateTime;
use jiff::tz::TimeZone;

/// A least difference counts for one to two of these: a drift of 100 ppm is 12 ms in that time.
const WINDOW_NS: i64 = 60 * SECOND_NS;

/// The time that an observation is told with, ns since 1970 (UTC); a time without a zone is taken for UTC, as the standard wants. `None`
/// for what is no time.
pub(crate) fn parse_time(text: &str) -> Option<TimeNs> {
    let text = text.trim();
    let timestamp = text.parse::<Timestamp>().ok().or_else(|| {
        let local: DateTime = text.parse().ok()?;
        TimeZone::UTC.to_timestamp(local).ok()
    })?;
    i64::try_from(timestamp.as_nanosecond()).ok()
}

/// What is known of the device's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct DeviceClock {
    began_ns: Option<TimeNs>,
    least_ns: Option<i64>,
    /// Of the window before.
    earlier_ns: Option<i64>,
}

impl DeviceClock {
    /// Takes an observation that has just come.
    pub(crate) fn record_arrival(&mut self, arrived_ns: TimeNs, told_ns: TimeNs) {
        let began_ns = *self.began_ns.get_or_insert(arrived_ns);
        if !(0..WINDOW_NS).contains(&(arrived_ns.saturating_sub(began_ns))) {
            (self.began_ns, self.earlier_ns, self.least_ns) = (Some(arrived_ns), self.least_ns, None);
        }
        let difference_ns = arrived_ns.saturating_sub(told_ns);
        self.least_ns = Some(self.least_ns.map_or(difference_ns, |least_ns| least_ns.min(difference_ns)));
    }

    /// The gateway's clock minus the device's, ns; `None` before the first observation.
    pub(crate) fn find_difference_ns(&self) -> Option<i64> {
        self.least_ns.into_iter().chain(self.earlier_ns).min()
    }

    /// When it was on the gateway's clock; never later than it came.
    pub(crate) fn convert_time(&self, told_ns: TimeNs, arrived_ns: TimeNs) -> TimeNs {
        self.find_difference_ns()
            .map_or(arrived_ns, |difference_ns| told_ns.saturating_add(difference_ns).min(arrived_ns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_with_and_without_a_zone() {
        assert_eq!(parse_time("1970-01-01T00:00:01Z"), Some(SECOND_NS));
        assert_eq!(parse_time("1970-01-01T00:00:01.250"), Some(1_250_000_000));
        assert_eq!(parse_time("1970-01-01T08:00:01+08:00"), Some(SECOND_NS));
        for wrong in ["", "noon", "12:00", "2026-13-01T00:00:00Z"] {
            assert_eq!(parse_time(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn an_observation_is_placed_by_the_quickest_one_of_the_last_minutes() {
        let mut clock = DeviceClock::default();
        assert_eq!(clock.convert_time(5, 1000), 1000, "nothing is known");
        // The device is an hour behind; ways of 30, 10 and 20 ms.
        let hour_ns = 3600 * SECOND_NS;
        for (at_ms, way_ms) in [(0, 30), (100, 10), (200, 20)] {
            let told_ns = at_ms * 1_000_000;
            clock.record_arrival(told_ns + hour_ns + way_ms * 1_000_000, told_ns);
        }
        assert_eq!(clock.find_difference_ns(), Some(hour_ns + 10_000_000));
        assert_eq!(clock.convert_time(300_000_000, hour_ns + 400_000_000), hour_ns + 310_000_000);
        assert_eq!(
            clock.convert_time(500_000_000, hour_ns + 400_000_000),
            hour_ns + 400_000_000,
            "never in the future"
        );
        // It is set forward by an hour: followed at once. Set back: after two windows.
        let now_ns = hour_ns + SECOND_NS;
        clock.record_arrival(now_ns, now_ns);
        assert_eq!(clock.find_difference_ns(), Some(0));
        for window in 1..=2 {
            let arrived_ns = now_ns + window * WINDOW_NS;
            clock.record_arrival(arrived_ns, arrived_ns - 7);
        }
        assert_eq!(clock.find_difference_ns(), Some(7));
    }
}
