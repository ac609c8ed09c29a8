//! Instants as users write them: RFC 3339, a date and a time of the clock on the wall, `now`, `today`, `yesterday`, or so long before
//! the newest sample.
//!
//! A date or a time without a zone is that of the box: whoever stands before the machine reads it from the wall. The zone is that of
//! the system (`TZ`, `/etc/localtime`).

use adapter_core::clock::{SECOND_NS, TimeNs};
use jiff::Timestamp;
use jiff::civil::{Date, DateTime};
use jiff::tz::TimeZone;

/// How instants are written, for messages.
pub const NOTATION: &str = "write 2026-01-31 08:15 (time of this box), 2026-01-31T08:15:00Z, 2026-01-31, today, yesterday, now, or a time \
    before the newest sample such as -90s, -10m, -8h, -7d";

/// Why a text is no instant.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, thiserror::Error)]
pub enum MomentError {
    /// It is written in no known way.
    #[error("{text:?} is no time; {NOTATION}")]
    NoTime {
        /// What was written, without the blanks around it.
        text: String,
    },
    /// It is an instant that nanoseconds cannot count to.
    #[error("{text} is outside the years 1678 to 2261")]
    OutOfRange {
        /// What was written, without the blanks around it.
        text: String,
    },
}

/// The instant that `text` means; `newest_ns` is the time of the newest sample.
///
/// # Errors
/// What is wrong and how instants are written.
pub fn parse(text: &str, newest_ns: TimeNs) -> Result<TimeNs, MomentError> {
    let text = text.trim();
    if text == "now" {
        return Ok(newest_ns);
    }
    if let Some(back) = text.strip_prefix('-') {
        let span_ns = parse_span(back).ok_or_else(|| MomentError::NoTime { text: text.to_owned() })?;
        return Ok(newest_ns.saturating_sub(span_ns));
    }
    let stamp = parse_stamp(text, &TimeZone::system(), newest_ns)
        .ok_or_else(|| MomentError::NoTime { text: text.to_owned() })?;
    TimeNs::try_from(stamp.as_nanosecond()).map_err(|_| MomentError::OutOfRange { text: text.to_owned() })
}

/// With a zone as it says; without one in the zone of the box. The first of two moments where a clock is set back.
fn parse_stamp(text: &str, zone: &TimeZone, newest_ns: TimeNs) -> Option<Timestamp> {
    if let Ok(stamp) = text.parse::<Timestamp>() {
        return Some(stamp);
    }
    let newest = || Some(Timestamp::from_nanosecond(i128::from(newest_ns)).ok()?.to_zoned(zone.clone()).date());
    let day = match text {
        "today" => Some(newest()?),
        "yesterday" => Some(newest()?.yesterday().ok()?),
        _ => text.parse::<Date>().ok().filter(|_| text.len() == 10),
    };
    let moment = match day {
        Some(day) => day.at(0, 0, 0, 0),
        None => parse_date_time(text)?,
    };
    Some(moment.to_zoned(zone.clone()).ok()?.timestamp())
}

/// `2026-11-24 20:00`, with or without seconds, with a blank or a `T`.
fn parse_date_time(text: &str) -> Option<DateTime> {
    let (date, time) = text.split_once([' ', 'T'])?;
    let time = time.trim_start();
    let whole = if time.matches(':').count() == 1 { format!("{time}:00") } else { time.to_owned() };
    format!("{date}T{whole}").parse::<DateTime>().ok().filter(|_| whole.len() >= 8 && date.len() == 10)
}

/// `90s`, `10m`, `8h`, `7d` in nanoseconds.
fn parse_span(text: &str) -> Option<i64> {
    let unit = text.chars().last()?;
    let seconds = match unit {
        's' => 1.0,
        'm' => 60.0,
        'h' => 3600.0,
        'd' => 86_400.0,
        _ => return None,
    };
    let count: f64 = text[..text.len() - unit.len_utf8()].parse().ok()?;
    let ns = count * seconds * SECOND_NS as f64;
    #[expect(clippy::cast_possible_truncation, reason = "bounded by the line above")]
    (count >= 0.0 && ns < 9e18).then_some(ns as i64)
}

/// RFC 3339 with milliseconds, in UTC.
#[must_use]
pub fn format_utc(at_ns: TimeNs) -> String {
    let stamp = jiff::Timestamp::from_nanosecond(i128::from(at_ns)).unwrap_or(jiff::Timestamp::UNIX_EPOCH);
    format!("{stamp:.3}")
}

/// `6:00` or `6` in minutes after midnight; `None`: it is no time of day.
#[must_use]
pub fn time_of_day(text: &str) -> Option<i64> {
    let (hour, minute) = text.split_once(':').unwrap_or((text, "0"));
    let (hour, minute): (i64, i64) = (hour.parse().ok()?, minute.parse().ok()?);
    ((0..24).contains(&hour) && (0..60).contains(&minute)).then_some(60 * hour + minute)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_notation_is_understood() {
        let newest = 1_000_000 * SECOND_NS;
        assert_eq!(parse("now", newest), Ok(newest));
        assert_eq!(parse("-10m", newest), Ok(newest - 600 * SECOND_NS));
        assert_eq!(parse("-1.5h", newest), Ok(newest - 5400 * SECOND_NS));
        let zone = TimeZone::system();
        let here = |date: Date| {
            date.at(20, 0, 0, 0).to_zoned(zone.clone()).expect("a time").timestamp().as_second() * SECOND_NS
        };
        let day = jiff::civil::date(2026, 11, 24);
        assert_eq!(parse("2026-11-24 20:00", newest), Ok(here(day)));
        assert_eq!(parse("2026-11-24T20:00:00", newest), Ok(here(day)));
        assert_eq!(
            parse("2026-11-24", newest),
            Ok(day.at(0, 0, 0, 0).to_zoned(zone.clone()).expect("a time").timestamp().as_second() * SECOND_NS)
        );
        assert!(parse("today", newest) > parse("yesterday", newest) && parse("today", newest) <= Ok(newest));
        assert_eq!(parse("1970-01-01T00:00:01.5+00:00", newest), Ok(SECOND_NS * 3 / 2));
        assert_eq!(format_utc(SECOND_NS * 3 / 2), "1970-01-01T00:00:01.500Z");
    }

    #[test]
    fn a_time_of_the_wall_is_that_of_the_zone() {
        let shanghai = TimeZone::fixed(jiff::tz::offset(8));
        let stamp = |text: &str| parse_stamp(text, &shanghai, 0).map(|stamp| format_utc(stamp.as_second() * SECOND_NS));
        assert_eq!(stamp("2026-11-24 20:00").as_deref(), Some("2026-11-24T12:00:00.000Z"));
        assert_eq!(stamp("2026-11-24 20:00:30").as_deref(), Some("2026-11-24T12:00:30.000Z"));
        assert_eq!(stamp("2026-11-24").as_deref(), Some("2026-11-23T16:00:00.000Z"));
        assert_eq!(stamp("2026-11-24T20:00:00Z").as_deref(), Some("2026-11-24T20:00:00.000Z"));
        assert_eq!(stamp("2026-11-24 20"), None);
    }

    #[test]
    fn nonsense_is_told_how_to_write() {
        for text in ["", "-", "-5", "-m", "tomorrowish", "-1e99d", "-NaNs", "9999-01-01T00:00:00Z", "-−5m", "机"] {
            assert!(parse(text, 0).is_err(), "{text}");
        }
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_it_panic(text in "(-|now|[0-9.:TZ+]|[smhd]|\\PC){0,30}") {
            let _ = parse(&text, i64::MAX);
        }
    }
}
