//! Instants as users write them: RFC 3339, a date, `now`, or so long before the newest sample.

use adapters::clock::{SECOND_NS, TimeNs};

/// How instants are written, for messages.
pub const NOTATION: &str =
    "write 2026-01-31T08:15:00Z, 2026-01-31, now, or a time before the newest sample such as -90s, -10m, -8h, -7d";

/// The instant that `text` means; `newest_ns` is the time of the newest sample.
///
/// # Errors
/// What is wrong and how instants are written.
pub fn parse(text: &str, newest_ns: TimeNs) -> Result<TimeNs, String> {
    let text = text.trim();
    if text == "now" {
        return Ok(newest_ns);
    }
    if let Some(back) = text.strip_prefix('-') {
        let span_ns = span(back).ok_or_else(|| format!("{text:?} is no time; {NOTATION}"))?;
        return Ok(newest_ns.saturating_sub(span_ns));
    }
    let utc = if text.len() == 10 { format!("{text}T00:00:00Z") } else { text.to_owned() };
    let stamp: jiff::Timestamp = utc.parse().map_err(|_| format!("{text:?} is no time; {NOTATION}"))?;
    i64::try_from(stamp.as_nanosecond()).map_err(|_| format!("{text} is outside the years 1678 to 2261"))
}

/// `90s`, `10m`, `8h`, `7d` in nanoseconds.
fn span(text: &str) -> Option<i64> {
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
pub fn utc(at_ns: TimeNs) -> String {
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
        assert_eq!(parse("1970-01-02", newest), Ok(86_400 * SECOND_NS));
        assert_eq!(parse("1970-01-01T00:00:01.5+00:00", newest), Ok(SECOND_NS * 3 / 2));
        assert_eq!(utc(SECOND_NS * 3 / 2), "1970-01-01T00:00:01.500Z");
    }

    #[test]
    fn nonsense_is_told_how_to_write() {
        for text in ["", "-", "-5", "-m", "yesterday", "-1e99d", "-NaNs", "9999-01-01T00:00:00Z", "-−5m", "机"] {
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
