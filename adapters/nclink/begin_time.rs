//! When a message of a sample channel begins, as devices write it.
//!
//! The standard has milliseconds since 1970 (UTC). Devices are seen that tell microseconds, nanoseconds, seconds with a fraction, or
//! their local time as a text. Between 2000 and 2100 the four numbers lie in ranges apart from each other, so that the size of one
//! tells its unit; whole seconds are refused, because they cannot say when a millisecond was. A number below all of them is a clock
//! that nobody set, in milliseconds. A zone does not matter: where the device's clock stands against the gateway's is found out from
//! when its messages arrive.

use super::lenient_json::parse_number;
use jiff::civil::DateTime;
use jiff::tz::TimeZone;
use serde_json::Value;

/// A time that is not told in milliseconds since 1970.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ForeignClock {
    /// A number of microseconds since 1970.
    Microseconds,
    /// A number of nanoseconds since 1970.
    Nanoseconds,
    /// Seconds since 1970, with a fraction.
    Seconds,
    /// A text with date and time.
    Text,
}

impl ForeignClock {
    /// What the device tells instead, in a sentence.
    #[must_use]
    pub fn describe_form(self) -> &'static str {
        match self {
            Self::Microseconds => "in microseconds",
            Self::Nanoseconds => "in nanoseconds",
            Self::Seconds => "in seconds with a fraction",
            Self::Text => "as a text with date and time",
        }
    }
}

/// When a message begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct BeginTime {
    /// On the device's clock, ms since 1970.
    pub(super) ms: i64,
    /// How it was told, where not in milliseconds.
    pub(super) clock: Option<ForeignClock>,
}

/// 2000-01-01 and 2100-01-01, s since 1970.
const SET_S: (f64, f64) = (946_684_800.0, 4_102_444_800.0);

/// `None` for what is no time.
pub(super) fn parse_begin(value: &Value) -> Option<BeginTime> {
    let Some(number) = parse_number(value) else { return value.as_str().and_then(parse_text) };
    let lies_within = |per_second: f64| number >= SET_S.0 * per_second && number < SET_S.1 * per_second;
    let (per_ms, clock) = match () {
        () if lies_within(1e3) => (1.0, None),
        () if lies_within(1e6) => (1e3, Some(ForeignClock::Microseconds)),
        () if lies_within(1e9) => (1e6, Some(ForeignClock::Nanoseconds)),
        () if lies_within(1.0) && number.fract() != 0.0 => (1e-3, Some(ForeignClock::Seconds)),
        () if lies_within(1.0) => return None,
        () if number.fract() == 0.0 && number.abs() < SET_S.0 * 1e3 => (1.0, None),
        () => return None,
    };
    #[expect(clippy::cast_possible_truncation, reason = "below 2100 in milliseconds")]
    let ms = (number / per_ms).round() as i64;
    Some(BeginTime { ms, clock })
}

/// `2026-11-28 03:50:24.125`, also with `T`, `/`, a comma, and a zone behind it, which does not matter.
fn parse_text(text: &str) -> Option<BeginTime> {
    let mut numbers = text.trim().split(|c: char| !c.is_ascii_digit());
    let mut next = |digits: usize| numbers.next().filter(|word| word.len() == digits)?.parse::<i16>().ok();
    let year = next(4).filter(|year| (2000..2100).contains(year))?;
    let mut two = || next(2).and_then(|number| i8::try_from(number).ok());
    let [month, day, hour, minute, second] = [two()?, two()?, two()?, two()?, two()?];
    let fraction: String = numbers.next().unwrap_or_default().chars().chain("000".chars()).take(3).collect();
    let whole = DateTime::new(year, month, day, hour, minute, second, 0).ok()?;
    let ms = TimeZone::UTC.to_timestamp(whole).ok()?.as_millisecond() + fraction.parse::<i64>().ok()?;
    Some(BeginTime { ms, clock: Some(ForeignClock::Text) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_same_moment_is_read_in_every_form() {
        use ForeignClock::{Microseconds, Nanoseconds, Seconds, Text};
        let ms = 1_795_829_024_125_i64;
        for (value, clock) in [
            (json!(ms), None),
            (json!(ms.to_string()), None),
            (json!(1_795_829_024_125_000_i64), Some(Microseconds)),
            (json!(1_795_829_024_125_000_000_i64), Some(Nanoseconds)),
            (json!("1795829024.125"), Some(Seconds)),
            (json!("2026-11-28 01:23:44.125"), Some(Text)),
            (json!("2026/11/28T01:23:44,125"), Some(Text)),
        ] {
            assert_eq!(parse_begin(&value), Some(BeginTime { ms, clock }), "{value}");
        }
        assert_eq!(parse_begin(&json!("2026-11-28 01:23:44")).map(|begin| begin.ms), Some(1_795_829_024_000));
        assert_eq!(parse_begin(&json!(5)), Some(BeginTime { ms: 5, clock: None }), "a clock that nobody set");
    }

    #[test]
    fn what_cannot_say_when_a_millisecond_was_is_refused() {
        for value in
            [json!(1_795_829_024), json!("noon"), json!(1e30), json!("2026-13-28 01:23:44"), json!({}), json!(7.5)]
        {
            assert_eq!(parse_begin(&value), None, "{value}");
        }
    }
}
