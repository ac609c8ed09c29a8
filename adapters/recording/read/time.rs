//! From the cells of time to seconds: zones, the night of the clock change, stamps that stand still, clocks that jump.

use super::mapping::TimeMapping;
use super::merge::usual_step;
use super::note::{Note, NoteKind};
use super::repeated_stamps::spread_stamps;
use super::restart::{divide_at, note_restarts};
use super::row_times::{RawTime, RawTimes, TimeSort};
use crate::Words;
use adapter_core::clock::{SECOND_NS, TimeNs};
use jiff::tz::{AmbiguousOffset, TimeZone};
use std::collections::HashMap;

/// The time of every row.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Timed {
    /// Seconds as given, or since the first row where the day is known.
    pub(super) time_s: Vec<f64>,
    pub(super) start_ns: Option<TimeNs>,
    /// Rows at which time begins again and a new run with it, as the map says.
    pub(super) restarts: Vec<usize>,
    /// Rows whose time does not fit among those of the others, with the reason.
    pub(super) out_of_order: Vec<(usize, String)>,
}

/// A clock change moves the time by so much, s.
const CLOCK_CHANGE_S: f64 = 3600.0;

/// Turns the cells of a whole column into time.
pub(super) fn resolve_times(
    raw: RawTimes,
    runs: Option<&Words>,
    mapping: &TimeMapping,
    notes: &mut Vec<Note>,
) -> Timed {
    let rows = raw.len();
    let mut timed = if raw.has(TimeSort::Utc) || raw.has(TimeSort::Local) {
        resolve_moments(raw, mapping, notes)
    } else {
        Timed { time_s: to_seconds(raw, notes), ..Timed::default() }
    };
    let is_absolute = timed.start_ns.is_some();
    if mapping.set_back.as_deref() == Some("join") {
        join_set_back(&mut timed.time_s, notes);
    }
    let mut stretches = time_stretches(rows, runs.filter(|_| !is_absolute));
    if mapping.set_back.as_deref() == Some("run") {
        timed.restarts = (1..rows).filter(|row| timed.time_s[*row] < timed.time_s[row - 1]).collect();
        note_restarts(timed.restarts.len(), notes);
        stretches = divide_at(stretches, &timed.restarts);
    }
    for rows in stretches {
        spread_stamps(&mut timed.time_s[rows.clone()], notes);
        let start = rows.start;
        let found = out_of_order(&timed.time_s[rows]);
        timed.out_of_order.extend(found.into_iter().map(|(row, reason)| (start + row, reason)));
    }
    timed
}

/// Rows within which time must increase: all of them, or those of a run.
fn time_stretches(rows: usize, runs: Option<&Words>) -> Vec<std::ops::Range<usize>> {
    let mut found: Vec<std::ops::Range<usize>> = Vec::new();
    for row in 0..rows {
        match found.last_mut() {
            Some(stretch) if runs.is_none_or(|runs| runs.find_code(stretch.start) == runs.find_code(row)) => {
                stretch.end = row + 1
            }
            _ => found.push(row..row + 1),
        }
    }
    found
}

#[expect(
    clippy::cast_precision_loss,
    reason = "a double counts nanoseconds exactly over 104 days, microseconds beyond"
)]
fn in_seconds(ns: i64) -> f64 {
    ns as f64 / SECOND_NS as f64
}

fn to_seconds(raw: RawTimes, notes: &mut Vec<Note>) -> Vec<f64> {
    let has_times_of_day = raw.has(TimeSort::OfDay);
    let mut times: Vec<f64> = raw.map(|time| match time {
        RawTime::Seconds(seconds) => seconds,
        RawTime::OfDay(ns) | RawTime::Utc(ns) | RawTime::Local(ns) => in_seconds(ns),
    });
    if has_times_of_day {
        let mut days = 0.0;
        for row in 1..times.len() {
            // Half a day back is midnight; less is a clock that was set back.
            if times[row] + days < times[row - 1] - 43_200.0 {
                days += 86_400.0;
            }
            times[row] += days;
        }
        notes.push(Note::new(
            NoteKind::Assumption,
            "times of day or durations, without a date",
            "只有时刻或时长，没有日期",
        ));
    }
    times
}

fn resolve_moments(raw: RawTimes, mapping: &TimeMapping, notes: &mut Vec<Note>) -> Timed {
    let is_local = raw.has(TimeSort::Local);
    let zone = mapping.zone.as_deref().and_then(|name| TimeZone::get(name).ok()).unwrap_or_else(TimeZone::system);
    let mut local = LocalClock { zone, known: HashMap::new(), last_ns: None };
    let mut utc: Vec<TimeNs> = raw.map(|time| match time {
        RawTime::Utc(at_ns) => at_ns,
        RawTime::Local(at_ns) => local.resolve_utc(at_ns),
        RawTime::Seconds(_) | RawTime::OfDay(_) => 0,
    });
    if is_local {
        let name = local.zone.iana_name().unwrap_or("UTC").to_owned();
        let given = if mapping.zone.is_some() { "" } else { ", that of this computer" };
        let given_zh = if mapping.zone.is_some() { "" } else { "，即本机时区" };
        notes.push(Note::new(
            NoteKind::Assumption,
            format!("local time {name}{given}"),
            format!("当地时间{name}{given_zh}"),
        ));
        end_of_summer_time(&mut utc, notes);
    }
    let start_ns = utc.first().copied();
    let since = |at_ns: TimeNs| in_seconds(at_ns.saturating_sub(start_ns.unwrap_or(0)));
    Timed { time_s: utc.into_iter().map(since).collect(), start_ns, ..Timed::default() }
}

struct LocalClock {
    zone: TimeZone,
    /// Offsets of quarters of an hour that are not in a clock change, s.
    known: HashMap<i64, i32>,
    last_ns: Option<TimeNs>,
}

impl LocalClock {
    /// In the hour that comes twice, the second one is taken once time would go back otherwise.
    fn resolve_utc(&mut self, local_ns: TimeNs) -> TimeNs {
        let quarter = local_ns.div_euclid(900 * SECOND_NS);
        let minus = |offset_s: i32| local_ns.saturating_sub(i64::from(offset_s) * SECOND_NS);
        if let Some(offset_s) = self.known.get(&quarter) {
            let at_ns = minus(*offset_s);
            self.last_ns = Some(at_ns);
            return at_ns;
        }
        let civil =
            jiff::Timestamp::from_nanosecond(i128::from(local_ns)).map(|stamp| TimeZone::UTC.to_datetime(stamp));
        let Ok(civil) = civil else { return local_ns };
        let at_ns = match self.zone.to_ambiguous_timestamp(civil).offset() {
            AmbiguousOffset::Unambiguous { offset } => {
                self.known.insert(quarter, offset.seconds());
                minus(offset.seconds())
            }
            AmbiguousOffset::Gap { before, .. } => minus(before.seconds()),
            AmbiguousOffset::Fold { before, after } => {
                let first = minus(before.seconds());
                if self.last_ns.is_some_and(|last_ns| first < last_ns) { minus(after.seconds()) } else { first }
            }
        };
        self.last_ns = Some(at_ns);
        at_ns
    }
}

/// A step back of an hour in a Sunday night of spring or autumn: the end of summer time of a place whose zone was not named.
fn end_of_summer_time(utc: &mut [TimeNs], notes: &mut Vec<Note>) {
    let is_change = |pair: &[TimeNs]| {
        let back_s = in_seconds(pair[0] - pair[1]);
        let Ok(stamp) = jiff::Timestamp::from_nanosecond(i128::from(pair[0])) else { return false };
        let civil = TimeZone::UTC.to_datetime(stamp);
        let in_season = [3, 4, 10, 11].contains(&civil.month());
        (CLOCK_CHANGE_S - 60.0..CLOCK_CHANGE_S + 1.0).contains(&back_s)
            && in_season
            && civil.weekday() == jiff::civil::Weekday::Sunday
            && civil.hour() <= 3
    };
    let changes: Vec<usize> = (1..utc.len()).filter(|row| is_change(&utc[row - 1..=*row])).collect();
    if let [row] = changes[..] {
        utc[row..].iter_mut().for_each(|at_ns| *at_ns += 3600 * SECOND_NS);
        notes.push(Note::new(
            NoteKind::Assumption,
            format!("the clock goes back by an hour in data row {}: the end of summer time", row + 1),
            format!("第{}个数据行时钟后退一小时：按夏令时结束处理", row + 1),
        ));
    }
}

fn join_set_back(times: &mut [f64], notes: &mut Vec<Note>) {
    let step = usual_step(times);
    let (mut shift, mut joined) = (0.0, 0);
    for row in 1..times.len() {
        if times[row] + shift < times[row - 1] {
            shift = times[row - 1] + step - times[row];
            joined += 1;
        }
        times[row] += shift;
    }
    if joined > 0 {
        notes.push(Note::new(
            NoteKind::Assumption,
            format!(
                "the clock was set back {joined} times; what comes after follows one period later, as the map says"
            ),
            format!("时钟被回拨{joined}次；按映射文件，其后的数据接续一个周期"),
        ));
    }
}

/// Rows that are not part of the longest sequence in which time does not go back, with the reason.
fn out_of_order(times: &[f64]) -> Vec<(usize, String)> {
    if times.windows(2).all(|pair| pair[1] >= pair[0]) {
        return Vec::new();
    }
    let mut kept = going_forward(times);
    let longest = longest_forward(times);
    // A few strange stamps are left out; where many are out of order, the clock itself was set.
    if longest.len() > kept.len() && times.len() - longest.len() <= times.len() / 200 + 3 {
        kept = longest;
    }
    let mut is_kept = vec![false; times.len()];
    kept.iter().for_each(|row| is_kept[*row] = true);
    let mut found = Vec::new();
    let mut before: Option<f64> = None;
    for row in 0..times.len() {
        if is_kept[row] {
            before = Some(times[row]);
            continue;
        }
        let reason = match before {
            Some(before) if times[row] < before => {
                format!(
                    "time goes back from {before} s to {} s; a clock that was set back: [time] set_back = \"join\" in a map; a new test that begins there: \
                     set_back = \"run\"",
                    times[row]
                )
            }
            _ => format!("time jumps to {} s and is earlier again in the next rows", times[row]),
        };
        found.push((row, reason));
    }
    found
}

/// Each row that is not earlier than the last one kept.
fn going_forward(times: &[f64]) -> Vec<usize> {
    let mut kept: Vec<usize> = Vec::new();
    for row in 0..times.len() {
        if kept.last().is_none_or(|last| times[row] >= times[*last]) {
            kept.push(row);
        }
    }
    kept
}

/// The longest sequence of rows in which time does not go back (patience sorting).
fn longest_forward(times: &[f64]) -> Vec<usize> {
    let mut ends: Vec<usize> = Vec::new();
    let mut before: Vec<Option<usize>> = Vec::with_capacity(times.len());
    for row in 0..times.len() {
        let length = ends.partition_point(|end| times[*end] <= times[row]);
        before.push(length.checked_sub(1).map(|shorter| ends[shorter]));
        if length == ends.len() {
            ends.push(row);
        } else {
            ends[length] = row;
        }
    }
    let mut rows: Vec<usize> = std::iter::successors(ends.last().copied(), |row| before[*row]).collect();
    rows.reverse();
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolved(raw: &[RawTime], mapping: &TimeMapping) -> (Timed, String) {
        let mut notes = Vec::new();
        let timed = resolve_times(raw.iter().copied().collect(), None, mapping, &mut notes);
        (timed, notes.iter().map(|note| note.text.en.clone()).collect::<Vec<_>>().join("; "))
    }

    fn local(text: &str) -> RawTime {
        let moment = super::super::moment::written_moment(text).expect("a moment");
        RawTime::Local(moment.local_ns(super::super::moment::DateOrder::DayFirst).expect("a date"))
    }

    #[test]
    fn the_hour_that_comes_twice_is_told_apart() {
        let raw =
            ["2026-10-25 02:59:58", "2026-10-25 02:59:59", "2026-10-25 02:00:00", "2026-10-25 02:00:01"].map(local);
        for zone in ["Europe/Berlin", "UTC"] {
            let mapping = TimeMapping { zone: Some(zone.to_owned()), ..TimeMapping::default() };
            let (timed, _) = resolved(&raw, &mapping);
            assert_eq!(timed.time_s, [0.0, 1.0, 2.0, 3.0], "{zone}");
            assert!(timed.out_of_order.is_empty());
        }
    }

    #[test]
    fn a_row_of_another_year_is_left_out_alone() {
        let raw = [0.0, 1.0, 3e8, 2.0, 3.0, 4.0].map(RawTime::Seconds);
        let (timed, _) = resolved(&raw, &TimeMapping::default());
        assert_eq!(timed.out_of_order.len(), 1);
        assert_eq!(timed.out_of_order[0].0, 2);
    }

    #[test]
    fn a_clock_that_was_set_back_is_refused_or_joined() {
        let raw = [0.0, 1.0, 2.0, 3.0, 0.5, 1.5].map(RawTime::Seconds);
        let (timed, _) = resolved(&raw, &TimeMapping::default());
        assert_eq!(timed.out_of_order.iter().map(|(row, _)| *row).collect::<Vec<_>>(), [4, 5]);
        assert!(timed.out_of_order[0].1.contains("goes back from 3 s to 0.5 s"));
        let mapping = TimeMapping { set_back: Some("join".to_owned()), ..TimeMapping::default() };
        let (timed, told) = resolved(&raw, &mapping);
        assert_eq!(timed.time_s, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert!(timed.out_of_order.is_empty() && told.contains("set back 1"), "{told}");
    }

    #[test]
    fn whole_seconds_with_several_rows_are_spread() {
        let raw = [0.0, 0.0, 2.0, 2.0, 4.0, 4.0, 6.0].map(RawTime::Seconds);
        let (timed, told) = resolved(&raw, &TimeMapping::default());
        assert_eq!(timed.time_s, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert!(told.contains("spread evenly"), "{told}");
        // One stamp that stands twice is no habit.
        let raw = [0.0, 1.0, 1.0, 2.0, 3.0].map(RawTime::Seconds);
        assert_eq!(resolved(&raw, &TimeMapping::default()).0.time_s, [0.0, 1.0, 1.0, 2.0, 3.0]);
    }

    #[test]
    fn midnight_goes_on() {
        let raw = [86_398, 86_399, 0, 1].map(|second| RawTime::OfDay(second * SECOND_NS));
        assert_eq!(resolved(&raw, &TimeMapping::default()).0.time_s, [86_398.0, 86_399.0, 86_400.0, 86_401.0]);
    }
}
