//! Hours of the day in which nobody is to be disturbed. Pure.

use adapter_core::address::Keys;
use adapter_core::clock::{SECOND_NS, TimeNs};
use jiff::Timestamp;
use jiff::civil::Time;
use jiff::tz::TimeZone;

const MINUTE_NS: i64 = 60 * SECOND_NS;
/// No quiet hours are longer than a day, and no day is longer than 25 hours.
const MINUTES_MAX: i64 = 25 * 60;

/// From a time of the clock on the wall to another, over midnight where the second is the earlier one.
#[derive(Debug, Clone, PartialEq)]
pub struct QuietHours {
    from: Time,
    to: Time,
    zone: TimeZone,
}

impl QuietHours {
    /// The keys `quiet=22:00-06:00` and `zone=Europe/Berlin`; without a zone that of the box.
    pub(super) fn from_keys(keys: &mut Keys) -> Option<Self> {
        let (hours, zone) = (keys.take_text("quiet"), keys.take_text("zone"));
        let zone = match zone.as_deref().map(TimeZone::get) {
            None => TimeZone::system(),
            Some(Ok(zone)) => zone,
            Some(Err(error)) => {
                keys.add_problem(format!(
                    "zone={}: {error}; write a name such as Europe/Berlin",
                    zone.unwrap_or_default()
                ));
                TimeZone::UTC
            }
        };
        let hours = hours?;
        let parsed = Self::parse(&hours, zone);
        if parsed.is_none() {
            keys.add_problem(format!("quiet={hours}: write two different times of day, such as quiet=22:00-06:00"));
        }
        parsed
    }

    fn parse(hours: &str, zone: TimeZone) -> Option<Self> {
        let (from, to) = hours.split_once('-')?;
        let (from, to) = (parse_time(from)?, parse_time(to)?);
        (from != to).then_some(Self { from, to, zone })
    }

    /// When they are over, ns since 1970, where it is quiet at this moment: at the first whole minute that is not quiet, so that a clock
    /// on the wall that is set forward or back needs no rule of its own.
    #[must_use]
    pub fn end_after(&self, now_ns: TimeNs) -> Option<TimeNs> {
        if !self.is_quiet(now_ns)? {
            return None;
        }
        let minute_ns = now_ns.div_euclid(MINUTE_NS) * MINUTE_NS;
        let minutes = (1..=MINUTES_MAX).filter_map(|minute| minute_ns.checked_add(minute * MINUTE_NS));
        minutes.into_iter().find(|at_ns| self.is_quiet(*at_ns) == Some(false))
    }

    fn is_quiet(&self, at_ns: TimeNs) -> Option<bool> {
        let time = Timestamp::from_nanosecond(i128::from(at_ns)).ok()?.to_zoned(self.zone.clone()).time();
        Some(match self.from < self.to {
            true => (self.from..self.to).contains(&time),
            false => time >= self.from || time < self.to,
        })
    }
}

fn parse_time(text: &str) -> Option<Time> {
    let (hour, minute) = text.split_once(':')?;
    Time::new(hour.parse().ok()?, minute.parse().ok()?, 0, 0).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_ns(stamp: &str) -> TimeNs {
        let stamp: Timestamp = stamp.parse().expect("a time");
        TimeNs::try_from(stamp.as_nanosecond()).expect("in range")
    }

    #[test]
    fn it_is_quiet_over_midnight_and_over_the_change_of_the_clocks() {
        let zone = TimeZone::get("Europe/Berlin").expect("known");
        let night = QuietHours::parse("22:00-06:00", zone.clone()).expect("hours");
        for (now, end) in [
            // Local 21:59, 22:00, 23:30, 05:59, 06:00 in winter.
            ("2026-01-31T20:59:59Z", None),
            ("2026-01-31T21:00:00Z", Some("2026-02-01T05:00:00Z")),
            ("2026-01-31T22:30:00Z", Some("2026-02-01T05:00:00Z")),
            ("2026-02-01T04:59:59Z", Some("2026-02-01T05:00:00Z")),
            ("2026-02-01T05:00:00Z", None),
            // The nights in which the clocks are set forward and back: an hour less, an hour more.
            ("2026-03-28T21:00:00Z", Some("2026-03-29T04:00:00Z")),
            ("2026-10-24T20:00:00Z", Some("2026-10-25T05:00:00Z")),
        ] {
            assert_eq!(night.end_after(at_ns(now)), end.map(at_ns), "{now}");
        }
        // Until 02:30, which comes twice: quiet at both 02:00, each time for half an hour, and not between.
        let short = QuietHours::parse("01:00-02:30", zone).expect("hours");
        for (now, end) in [
            ("2026-10-25T00:10:00Z", Some("2026-10-25T00:30:00Z")),
            ("2026-10-25T00:30:00Z", None),
            ("2026-10-25T01:10:00Z", Some("2026-10-25T01:30:00Z")),
            ("2026-10-25T01:30:00Z", None),
            // In spring there is no 02:30: it ends where 03:00 follows 01:59.
            ("2026-03-29T00:30:00Z", Some("2026-03-29T01:00:00Z")),
        ] {
            assert_eq!(short.end_after(at_ns(now)), end.map(at_ns), "{now}");
        }
        let day = QuietHours::parse("12:00-13:00", TimeZone::UTC).expect("hours");
        assert_eq!(day.end_after(at_ns("2026-01-31T12:30:00Z")), Some(at_ns("2026-01-31T13:00:00Z")));
        assert_eq!(day.end_after(at_ns("2026-01-31T13:00:00Z")), None);
        for bad in ["", "22-6", "22:00", "24:00-06:00", "06:00-06:00", "a:b-c:d"] {
            assert_eq!(QuietHours::parse(bad, TimeZone::UTC), None, "{bad}");
        }
    }
}
