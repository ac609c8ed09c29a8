//! Moments written as digits alone: `20260317081500`, `20260317`, `081500`. Each is a number as well, so that only a column in which every
//! number is one may be taken for time.

use super::moment::{WrittenDate, WrittenMoment};
use adapter_core::clock::SECOND_NS;

/// Which moment digits alone may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CompactKind {
    /// A date with its time of day.
    Moment,
    /// A date without a time of day.
    Date,
    /// A time of day alone.
    TimeOfDay,
}

/// Years of which recordings are.
const YEARS: std::ops::RangeInclusive<i16> = 1990..=2099;

/// Takes digits as a moment; what follows a point or a comma are parts of a second.
pub(crate) fn parse_compact(text: &str) -> Option<(CompactKind, WrittenMoment)> {
    let digits = text.bytes().take_while(u8::is_ascii_digit).count();
    if !matches!(digits, 6 | 8 | 12 | 14 | 17) {
        return None;
    }
    let (whole, rest) = text.split_at(digits);
    let part = match rest.as_bytes().first() {
        None => "",
        Some(b'.' | b',') if matches!(digits, 6 | 14) => &rest[1..],
        Some(_) => return None,
    };
    let (date, time) = if digits == 6 { ("", whole) } else { whole.split_at(8) };
    let date = if date.is_empty() { None } else { Some(parse_date(date)?) };
    let time_of_day_ns = if time.is_empty() { None } else { Some(parse_time(time, part)?) };
    let kind = match (date, time_of_day_ns) {
        (Some(_), Some(_)) => CompactKind::Moment,
        (Some(_), None) => CompactKind::Date,
        (None, _) => CompactKind::TimeOfDay,
    };
    Some((kind, WrittenMoment { date, time_of_day_ns, offset_s: None }))
}

fn parse_date(digits: &str) -> Option<WrittenDate> {
    let year = digits.get(..4)?.parse().ok().filter(|year| YEARS.contains(year))?;
    let (month, day) = (digits.get(4..6)?.parse().ok()?, digits.get(6..8)?.parse().ok()?);
    jiff::civil::Date::new(year, month, day).ok()?;
    Some(WrittenDate::YearFirst(year, month, day))
}

/// Hour, minute, second where it stands there, thousandths or parts of a second.
fn parse_time(digits: &str, part: &str) -> Option<i64> {
    let two = |at: usize| digits.get(at..at + 2).map_or(Some(0), |two| two.parse::<i64>().ok());
    let (hour, minute, second) = (two(0)?, two(2)?, two(4)?);
    let part = if digits.len() > 6 { &digits[6..] } else { part };
    if part.len() > 9 || !part.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let scale = 10_i64.pow(u32::try_from(9 - part.len()).ok()?);
    let ns = if part.is_empty() { 0 } else { part.parse::<i64>().ok()? * scale };
    (hour < 24 && minute < 60 && second < 60).then_some((hour * 3600 + minute * 60 + second) * SECOND_NS + ns)
}

#[cfg(test)]
mod tests {
    use super::super::moment::DateOrder;
    use super::*;

    #[test]
    fn digits_alone_are_a_moment_of_the_calendar_or_none() {
        let local = |text: &str| parse_compact(text).and_then(|(_, moment)| moment.local_ns(DateOrder::DayFirst));
        let at = local("20260317081500").expect("a moment");
        assert_eq!(local("20260317081500.250"), Some(at + SECOND_NS / 4));
        assert_eq!(local("20260317081500250"), Some(at + SECOND_NS / 4));
        assert_eq!(local("202603170815"), Some(at));
        assert_eq!(parse_compact("20260317").map(|(kind, _)| kind), Some(CompactKind::Date));
        assert_eq!(parse_compact("081500").map(|(kind, _)| kind), Some(CompactKind::TimeOfDay));
        for none in ["20261317081500", "20260230000000", "20260317246000", "1250", "20260317081500.x", "088500", "1.5"]
        {
            assert_eq!(parse_compact(none), None, "{none}");
        }
    }
}
