//! `GET /api/v1/utilisation`: seconds in each machine state, by hour, shift, day or week of the reader's own clock.

use super::ServerState;
use super::history::{Answer, HistoryQuery, describe_history_error, parse_range, read_history};
use super::problem::ApiProblem;
use super::query::QueryKeys;
use super::route::Route;
use adapters::clock::{SECOND_NS, TimeNs};
use axum::extract::{Query as Pairs, State};
use axum::routing::get;
use gateway_base::moment::time_of_day;
use gateway_history::{Reader, RecordSpan, StateHour, StateInterval};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::ops::Range;

const MINUTE_NS: i64 = 60 * SECOND_NS;
const HOUR_NS: i64 = 60 * MINUTE_NS;
const DAY_MINUTES: i64 = 24 * 60;
/// Rows of hours and states in one answer: eight states for five years.
const HOURS_MAX: u32 = 400_000;
/// Shifts of one day.
const SHIFTS_MAX: usize = 12;

/// How the time is cut.
#[derive(Debug, Clone, PartialEq, Eq)]
enum GroupBy {
    Hour,
    Day,
    Week,
    /// Minutes after midnight at which a shift begins, increasing.
    Shift(Vec<i64>),
}

impl GroupBy {
    /// Beginning of the stretch that holds this minute of the reader's clock (minutes since 1970, local).
    fn find_start(&self, minute: i64) -> i64 {
        let day = minute.div_euclid(DAY_MINUTES);
        match self {
            Self::Hour => minute.div_euclid(60) * 60,
            Self::Day => day * DAY_MINUTES,
            // The first of January 1970 was a Thursday; weeks begin on Monday.
            Self::Week => ((day + 3).div_euclid(7) * 7 - 3) * DAY_MINUTES,
            Self::Shift(starts) => {
                let within = minute.rem_euclid(DAY_MINUTES);
                let begun = starts.iter().rev().find(|start| **start <= within);
                match (begun, starts.last()) {
                    (Some(start), _) => day * DAY_MINUTES + start,
                    (None, Some(last)) => (day - 1) * DAY_MINUTES + last,
                    (None, None) => day * DAY_MINUTES,
                }
            }
        }
    }
}

/// `6:00,14:00,22:00` in minutes after midnight.
fn parse_shifts(keys: &QueryKeys, usual: &[i64]) -> Result<Vec<i64>, ApiProblem> {
    let bad = |text: &str| {
        ApiProblem::bad_request(
            format!("shifts: {text:?} is no time of day"),
            "write the beginnings as 6:00,14:00,22:00",
        )
    };
    let mut starts = keys
        .split_list("shifts")
        .map(|text| time_of_day(text).ok_or_else(|| bad(text)))
        .collect::<Result<Vec<_>, _>>()?;
    if starts.is_empty() {
        starts = usual.to_vec();
    }
    if starts.len() > SHIFTS_MAX {
        return Err(ApiProblem::bad_request(format!("{} shifts in one day", starts.len()), "give at most 12"));
    }
    starts.sort_unstable();
    Ok(starts)
}

fn parse_group_by(keys: &QueryKeys, usual: &[i64]) -> Result<GroupBy, ApiProblem> {
    match keys.find_text("by") {
        None | Some("day") => Ok(GroupBy::Day),
        Some("hour") => Ok(GroupBy::Hour),
        Some("week") => Ok(GroupBy::Week),
        Some("shift") => parse_shifts(keys, usual).map(GroupBy::Shift),
        Some(other) => {
            Err(ApiProblem::bad_request(format!("by={other} is not known"), "write by=hour, shift, day or week"))
        }
    }
}

pub(super) const ROUTES: &[Route] = &[Route::read("/api/v1/utilisation", || get(serve_utilisation))];

/// `GET /api/v1/utilisation`: time in each machine state, by hour, shift, day or week.
async fn serve_utilisation(State(shared): State<ServerState>, Pairs(pairs): HistoryQuery) -> Answer {
    let keys = QueryKeys::from_pairs(pairs, &["from", "to", "by", "shifts", "offset_min"])?;
    let usual = shared.configured.config.http.shifts.clone();
    let by = parse_group_by(&keys, &usual)?;
    let offset_min = keys.parse_number("offset_min", -1080_i64, 1080)?.unwrap_or(0);
    read_history(shared, move |reader, newest_ns| {
        let (from_ns, to_ns) = parse_range(&keys, newest_ns)?;
        let hours = read_hours(reader, from_ns, to_ns, newest_ns)?;
        let rows = group_hours(&hours, &by, offset_min);
        Ok(json!({
            "schema": "utilisation/1",
            "from_ms": from_ns.div_euclid(1_000_000),
            "to_ms": to_ns.div_euclid(1_000_000),
            "rows": rows,
            "shifts": usual.iter().map(|at| format!("{}:{:02}", at / 60, at % 60)).collect::<Vec<_>>(),
        }))
    })
    .await
}

/// Seconds of each state within the range: whole hours as they are stored, the hours at its ends and the state that lasts from the intervals.
fn read_hours(
    reader: &Reader,
    from_ns: TimeNs,
    to_ns: TimeNs,
    newest_ns: TimeNs,
) -> Result<Vec<StateHour>, ApiProblem> {
    let WholeHours { before, whole, behind } = WholeHours::split_range(from_ns..to_ns);
    let span = RecordSpan::between(whole.start, whole.end, HOURS_MAX);
    let mut hours =
        if whole.is_empty() { Vec::new() } else { reader.state_hours(span).map_err(|e| describe_history_error(&e))? };
    let read = |range: &Range<TimeNs>, most: u32| {
        reader.read_states(RecordSpan::between(range.start, range.end, most)).map_err(|e| describe_history_error(&e))
    };
    for range in [before, behind].into_iter().filter(|range| !range.is_empty()) {
        read(&range, HOURS_MAX)?.iter().for_each(|state| add_state_seconds(&mut hours, state, &range, newest_ns));
    }
    let newest = if whole.is_empty() { Vec::new() } else { read(&whole, 1)? };
    let open = newest.iter().filter(|state| state.until_ns.is_none());
    open.for_each(|state| add_state_seconds(&mut hours, state, &whole, newest_ns));
    Ok(hours)
}

/// A range as the whole hours in it, and what lies before and behind them; within one hour everything lies before.
struct WholeHours {
    before: Range<TimeNs>,
    whole: Range<TimeNs>,
    behind: Range<TimeNs>,
}

impl WholeHours {
    fn split_range(range: Range<TimeNs>) -> Self {
        let end_ns = range.end.div_euclid(HOUR_NS) * HOUR_NS;
        let start_ns = range.start.saturating_add(HOUR_NS - 1).div_euclid(HOUR_NS) * HOUR_NS;
        if start_ns > end_ns {
            return Self { whole: start_ns..start_ns, behind: range.end..range.end, before: range };
        }
        Self { before: range.start..start_ns, whole: start_ns..end_ns, behind: end_ns..range.end }
    }
}

/// What an interval takes of each hour of a range; one that lasts goes to the newest row.
fn add_state_seconds(hours: &mut Vec<StateHour>, state: &StateInterval, range: &Range<TimeNs>, newest_ns: TimeNs) {
    let mut at_ns = state.since_ns.max(range.start);
    let end_ns = state.until_ns.unwrap_or(newest_ns).min(range.end);
    while at_ns < end_ns {
        let start_ns = at_ns.div_euclid(HOUR_NS) * HOUR_NS;
        let until_ns = end_ns.min(start_ns + HOUR_NS);
        hours.push(StateHour { start_ns, state: state.state.clone(), seconds: to_seconds(until_ns - at_ns) });
        at_ns = until_ns;
    }
}

#[expect(clippy::cast_precision_loss, reason = "less than an hour")]
fn to_seconds(ns: i64) -> f64 {
    ns as f64 / SECOND_NS as f64
}

/// Seconds per state, by beginning.
fn group_hours(hours: &[StateHour], by: &GroupBy, offset_min: i64) -> Vec<Value> {
    let mut rows: BTreeMap<i64, BTreeMap<&str, f64>> = BTreeMap::new();
    for hour in hours {
        let local = hour.start_ns.div_euclid(MINUTE_NS) + offset_min;
        let begin = (by.find_start(local) - offset_min).saturating_mul(60_000);
        *rows.entry(begin).or_default().entry(&hour.state).or_default() += hour.seconds;
    }
    let row = |(from_ms, states): (i64, BTreeMap<&str, f64>)| {
        let total: f64 = states.values().sum();
        let states: Map<String, Value> = states.into_iter().map(|(word, s)| (word.to_owned(), json!(s))).collect();
        json!({ "from_ms": from_ms, "total_s": total, "seconds": states })
    };
    rows.into_iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_weeks_and_shifts_begin_where_the_readers_clock_says() {
        // 1970-01-07 was a Wednesday; its week began on Monday the 5th, day number 4.
        let wednesday_5_00 = 6 * DAY_MINUTES + 5 * 60;
        assert_eq!(GroupBy::Day.find_start(wednesday_5_00), 6 * DAY_MINUTES);
        assert_eq!(GroupBy::Week.find_start(wednesday_5_00), 4 * DAY_MINUTES);
        let shift = GroupBy::Shift(vec![360, 840, 1320]);
        assert_eq!(shift.find_start(wednesday_5_00), 5 * DAY_MINUTES + 22 * 60);
        assert_eq!(shift.find_start(wednesday_5_00 + 60), 6 * DAY_MINUTES + 6 * 60);
        assert_eq!(GroupBy::Week.find_start(-1), -3 * DAY_MINUTES);
    }

    #[test]
    fn a_range_is_whole_hours_and_what_lies_around_them() {
        for (from_s, to_s, whole) in
            [(0, 7200, 0..7200), (10, 7300, 3600..7200), (10, 3610, 3600..3600), (10, 900, 0..0)]
        {
            let split = WholeHours::split_range(from_s * SECOND_NS..to_s * SECOND_NS);
            let length = |range: &Range<TimeNs>| (range.end - range.start) / SECOND_NS;
            assert_eq!(length(&split.whole), whole.end - whole.start, "{from_s} to {to_s}");
            let all = length(&split.before) + length(&split.whole) + length(&split.behind);
            assert_eq!(all, to_s - from_s, "nothing is counted twice or left out");
        }
    }

    #[test]
    fn an_interval_counts_only_within_the_range() {
        let state = |until_ns| StateInterval {
            state: "idle".to_owned(),
            since_ns: 0,
            until_ns,
            program: String::new(),
            tool: String::new(),
            ended_by: String::new(),
        };
        let mut hours = Vec::new();
        let range = 3000 * SECOND_NS..4000 * SECOND_NS;
        add_state_seconds(&mut hours, &state(Some(9000 * SECOND_NS)), &range, 9000 * SECOND_NS);
        assert_eq!(hours.iter().map(|hour| hour.seconds).collect::<Vec<_>>(), [600.0, 400.0]);
        hours.clear();
        add_state_seconds(&mut hours, &state(None), &range, 3500 * SECOND_NS);
        assert_eq!(hours.iter().map(|hour| hour.seconds).collect::<Vec<_>>(), [500.0]);
    }

    #[test]
    fn hours_are_added_up_by_local_day() {
        let hour = |at: i64, seconds| StateHour { start_ns: at * HOUR_NS, state: "idle".to_owned(), seconds };
        let rows = group_hours(&[hour(15, 100.0), hour(16, 200.0), hour(40, 50.0)], &GroupBy::Day, 8 * 60);
        let told: Vec<_> = rows.iter().map(|row| (row["from_ms"].as_i64(), row["total_s"].as_f64())).collect();
        let day_ms = 86_400_000;
        let eight_h_ms = 8 * 3_600_000;
        assert_eq!(
            told,
            [
                (Some(-eight_h_ms), Some(100.0)),
                (Some(day_ms - eight_h_ms), Some(200.0)),
                (Some(2 * day_ms - eight_h_ms), Some(50.0)),
            ]
        );
    }

    #[test]
    fn a_shift_that_is_no_time_is_refused() {
        let keys = |text: &str| {
            QueryKeys::from_pairs(vec![("shifts".to_owned(), text.to_owned())], &["shifts"]).expect("known")
        };
        for text in ["25:00", "6:61", "six", "-1:00"] {
            assert!(parse_shifts(&keys(text), &[0]).is_err(), "{text}");
        }
        assert_eq!(parse_shifts(&keys("14,6:30"), &[0]), Ok(vec![390, 840]));
        assert_eq!(parse_shifts(&keys(""), &[360]), Ok(vec![360]));
    }
}
