//! One cell as what a column wants of it: a number, a moment, text.

use super::cell::{Cell, is_absent_number};
use super::compact_moment::parse_compact;
use super::moment::{WrittenMoment, written_moment};
use super::row_times::RawTime;
use adapter_core::clock::{SECOND_NS, TimeNs};

pub(super) fn is_nothing(cell: Cell<'_>) -> bool {
    match cell {
        Cell::Empty => true,
        Cell::Text(text) => is_absent_number(text),
        _ => false,
    }
}

pub(super) fn number_of(cell: Cell<'_>) -> Option<f64> {
    match cell {
        Cell::Number(number) => Some(number),
        Cell::Text(text) => text.parse().ok().filter(|number: &f64| number.is_finite()),
        _ => None,
    }
}

/// Whole nanoseconds since 1970 exactly, which a double does not hold.
pub(super) fn unix_ns(cell: Cell<'_>, factor: f64) -> Option<TimeNs> {
    let Cell::Text(text) = cell else { return None };
    (factor <= 1e-9).then(|| text.parse().ok()).flatten()
}

#[expect(clippy::cast_possible_truncation, reason = "saturates")]
pub(super) fn to_nanoseconds(seconds: f64) -> i64 {
    (seconds * SECOND_NS as f64).round() as i64
}

/// A moment as text, or in digits alone.
pub(super) fn moment_of_cell(cell: Cell<'_>) -> Option<WrittenMoment> {
    let compact = |text: &str| parse_compact(text).map(|(_, moment)| moment);
    match cell {
        Cell::Text(text) => written_moment(text).or_else(|| compact(text)),
        Cell::Number(number) => compact(&number.to_string()),
        _ => None,
    }
}

pub(super) fn utc_or_local(moment: WrittenMoment, order: super::moment::DateOrder) -> Option<RawTime> {
    let local_ns = moment.local_ns(order)?;
    Some(match moment.offset_s {
        Some(offset_s) => RawTime::Utc(local_ns.checked_sub(i64::from(offset_s) * SECOND_NS)?),
        None => RawTime::Local(local_ns),
    })
}

/// A date in one column and the time of day in another.
pub(super) fn join_date_and_time(date: Cell<'_>, time: Cell<'_>, order: super::moment::DateOrder) -> Option<TimeNs> {
    let day_ns = match date {
        Cell::Local(at_ns) | Cell::Instant(at_ns) => Some(at_ns),
        date => moment_of_cell(date).and_then(|date| WrittenMoment { time_of_day_ns: None, ..date }.local_ns(order)),
    };
    let of_day_ns = match time {
        Cell::Local(at_ns) => Some(at_ns.rem_euclid(86_400 * SECOND_NS)),
        Cell::Number(days) if (0.0..1.0).contains(&days) => Some(to_nanoseconds(days * 86_400.0)),
        time => moment_of_cell(time).and_then(|time| time.time_of_day_ns),
    };
    day_ns.zip(of_day_ns).map(|(day_ns, of_day_ns)| day_ns + of_day_ns)
}

pub(super) fn text_of(cell: Cell<'_>) -> String {
    match cell {
        Cell::Empty => String::new(),
        Cell::Text(text) => text.to_owned(),
        Cell::Number(number) => number.to_string(),
        Cell::Flag(flag) => flag.to_string(),
        Cell::Instant(at_ns) | Cell::Local(at_ns) => jiff::Timestamp::from_nanosecond(i128::from(at_ns))
            .map_or_else(|_| String::new(), |stamp| stamp.to_string()),
    }
}

pub(super) fn show_cell(cell: Cell<'_>) -> String {
    format!("{:?}", text_of(cell).chars().take(60).collect::<String>())
}
