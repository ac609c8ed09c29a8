//! `GET /api/v1/samples`, `states`, `alarms`, ...: the history, read through connections of its own.

use super::ServerState;
use super::problem::ApiProblem;
use super::query::QueryKeys;
use super::route::Route;
use crate::records::{RecordKind, RecordQuery, build_document, read_records};
use crate::samples;
use adapters::clock::{SECOND_NS, TimeNs};
use axum::Json;
use axum::extract::{Query as Pairs, State};
use axum::routing::get;
use gateway_base::moment;
use gateway_history::{HistoryError, Query, Reader, audit_document};
use serde_json::{Value, json};
use std::time::Duration;

/// Questions that are answered at the same time.
pub(super) const READERS_MAX: usize = 4;
/// A question that waits for longer is not answered.
const READING_WITHIN: Duration = Duration::from_secs(20);
/// What is read when nobody says otherwise.
const SPAN_DEFAULT_NS: i64 = 600 * SECOND_NS;
/// About so many buckets when nobody says otherwise.
const BUCKETS_DEFAULT: i64 = 600;
/// Points in one answer, all series together.
const POINTS_MAX: usize = 200_000;
/// Series in one answer.
const SERIES_MAX: usize = 32;
/// Channels shown when nobody asks for others.
const CHANNELS_DEFAULT: [&str; 3] = ["spindle_speed_rpm", "feed_mm_min", "spindle_power_w"];

pub(super) const ROUTES: &[Route] = &[
    Route::read("/api/v1/samples", || get(sample_series)),
    Route::read("/api/v1/states", || get(serve_states)),
    Route::read("/api/v1/alarms", || get(serve_alarms)),
    Route::read("/api/v1/decisions", || get(serve_decisions)),
    Route::read("/api/v1/events", || get(serve_events)),
    Route::read("/api/v1/parts", || get(serve_parts)),
    Route::read("/api/v1/facts", || get(serve_facts)),
    Route::read("/api/v1/audit", || get(serve_audit)),
    Route::read("/api/v1/audit/verify", || get(verify_audit)),
];

pub(super) type Answer = Result<Json<Value>, ApiProblem>;
pub(super) type HistoryQuery = Pairs<Vec<(String, String)>>;

/// Runs `read` on a connection of its own, off the threads that serve.
pub(super) async fn read_history(
    shared: ServerState,
    read: impl FnOnce(&Reader, TimeNs) -> Result<Value, ApiProblem> + Send + 'static,
) -> Answer {
    let newest_ns = shared.require_status()?.at_ms.saturating_add(1).saturating_mul(1_000_000);
    let path = shared.history.clone();
    let place = tokio::time::timeout(READING_WITHIN, shared.readers.acquire_owned()).await;
    let Ok(Ok(place)) = place else {
        return Err(ApiProblem::unavailable("too many questions about the history at once", "ask again in a moment"));
    };
    let task = tokio::task::spawn_blocking(move || {
        let _held_while_reading = place;
        let reader = Reader::open(&path).map_err(|error| describe_history_error(&error))?;
        read(&reader, newest_ns)
    });
    let broken = |_| ApiProblem::unavailable("the history cannot be read", "ask again; look at the log if it stays");
    task.await.map_err(broken)?.map(Json)
}

pub(super) fn describe_history_error(error: &HistoryError) -> ApiProblem {
    match error {
        HistoryError::Question(text) => ApiProblem::bad_request(text.clone(), "see /api/v1/channels and /openapi.json"),
        error => ApiProblem::unavailable(error.to_string(), "the machine is still polled; see /api/v1/status"),
    }
}

/// The keys `from` and `to`; without them the last stretch up to the newest sample.
pub(super) fn parse_range(keys: &QueryKeys, newest_ns: TimeNs) -> Result<(TimeNs, TimeNs), ApiProblem> {
    let bad =
        |key: &str, what: moment::MomentError| ApiProblem::bad_request(format!("{key}: {what}"), moment::NOTATION);
    let moment =
        |key: &str| keys.find_text(key).map(|text| moment::parse(text, newest_ns).map_err(|what| bad(key, what)));
    let to_ns = moment("to").transpose()?.unwrap_or(newest_ns);
    let from_ns = moment("from").transpose()?.unwrap_or(to_ns.saturating_sub(SPAN_DEFAULT_NS));
    if from_ns > to_ns {
        return Err(ApiProblem::bad_request("from lies after to", "swap them"));
    }
    Ok((from_ns, to_ns))
}

async fn serve_records(shared: ServerState, kind: RecordKind, pairs: Vec<(String, String)>) -> Answer {
    let known: &[&str] =
        if kind == RecordKind::States { &["from", "to", "limit", "state"] } else { &["from", "to", "limit"] };
    let keys = QueryKeys::from_pairs(pairs, known)?;
    let limit = keys.parse_number("limit", 1, 10_000)?.unwrap_or(1000);
    read_history(shared, move |reader, newest_ns| {
        let (from_ns, to_ns) = parse_range(&keys, newest_ns)?;
        let query = RecordQuery { from_ns, to_ns, state: keys.find_text("state").map(str::to_owned), limit };
        let found = read_records(reader, kind, &query).map_err(|error| describe_history_error(&error))?;
        Ok(build_document(kind, &query, found))
    })
    .await
}

/// `GET /api/v1/states`: the stretches in each machine state.
pub(super) async fn serve_states(State(shared): State<ServerState>, Pairs(pairs): HistoryQuery) -> Answer {
    serve_records(shared, RecordKind::States, pairs).await
}

/// `GET /api/v1/alarms`: the alarms of a time range.
pub(super) async fn serve_alarms(State(shared): State<ServerState>, Pairs(pairs): HistoryQuery) -> Answer {
    serve_records(shared, RecordKind::Alarms, pairs).await
}

/// `GET /api/v1/decisions`: what scripts wanted and what the gate made of it.
pub(super) async fn serve_decisions(State(shared): State<ServerState>, Pairs(pairs): HistoryQuery) -> Answer {
    serve_records(shared, RecordKind::Decisions, pairs).await
}

/// `GET /api/v1/events`: what happened in a time range.
pub(super) async fn serve_events(State(shared): State<ServerState>, Pairs(pairs): HistoryQuery) -> Answer {
    serve_records(shared, RecordKind::Events, pairs).await
}

/// `GET /api/v1/parts`: the parts that were finished.
pub(super) async fn serve_parts(State(shared): State<ServerState>, Pairs(pairs): HistoryQuery) -> Answer {
    serve_records(shared, RecordKind::Parts, pairs).await
}

/// `GET /api/v1/facts`: what the plant has told of the range.
pub(super) async fn serve_facts(State(shared): State<ServerState>, Pairs(pairs): HistoryQuery) -> Answer {
    serve_records(shared, RecordKind::Facts, pairs).await
}

/// `GET /api/v1/audit`: `history audit --json`, by pages. With `since` the rows after that number, with `from` and `to` those of
/// the time range, otherwise the newest.
pub(super) async fn serve_audit(State(shared): State<ServerState>, Pairs(pairs): HistoryQuery) -> Answer {
    let keys = QueryKeys::from_pairs(pairs, &["since", "limit", "from", "to"])?;
    let limit = keys.parse_number("limit", 1, 10_000)?.unwrap_or(1000);
    let since = keys.parse_number("since", 0, i64::MAX)?;
    let timed = keys.find_text("from").is_some() || keys.find_text("to").is_some();
    if timed && since.is_some() {
        return Err(ApiProblem::bad_request("since and a time range are given", "give the one or the other"));
    }
    read_history(shared, move |reader, newest_ns| {
        let rows = match since {
            Some(number) => reader.audit_after(number, limit),
            None if timed => {
                let (from_ns, to_ns) = parse_range(&keys, newest_ns)?;
                reader.read_audit(from_ns, to_ns, limit)
            }
            None => reader.read_audit(i64::MIN, i64::MAX, limit),
        };
        rows.map(|rows| audit_document(&rows)).map_err(|error| describe_history_error(&error))
    })
    .await
}

/// `GET /api/v1/audit/verify`: `history audit --verify`.
pub(super) async fn verify_audit(State(shared): State<ServerState>, Pairs(pairs): HistoryQuery) -> Answer {
    QueryKeys::from_pairs(pairs, &[])?;
    read_history(shared, |reader, _| {
        let check = reader.verify_audit().map_err(|error| describe_history_error(&error))?;
        let mut document = json!({ "schema": "audit-check/1" });
        if let (Some(into), Ok(Value::Object(found))) = (document.as_object_mut(), serde_json::to_value(&check)) {
            into.extend(found);
        }
        Ok(document)
    })
    .await
}

/// `GET /api/v1/samples`: some series over a time range, by columns.
pub(super) async fn sample_series(State(shared): State<ServerState>, Pairs(pairs): HistoryQuery) -> Answer {
    let known = ["from", "to", "channels", "resolution_s", "state", "program", "tool"];
    let keys = QueryKeys::from_pairs(pairs, &known)?;
    let resolution_s = keys.parse_number("resolution_s", 0.0, 31_622_400.0)?;
    let mut series: Vec<String> = keys.split_list("channels").map(str::to_owned).collect();
    if series.is_empty() {
        series = CHANNELS_DEFAULT.map(str::to_owned).to_vec();
    }
    if series.len() > SERIES_MAX {
        let title = format!("{} channels in one question", series.len());
        return Err(ApiProblem::bad_request(title, format!("ask for at most {SERIES_MAX} at once")));
    }
    read_history(shared, move |reader, newest_ns| {
        let (from_ns, to_ns) = parse_range(&keys, newest_ns)?;
        let text = |key: &str| keys.find_text(key).map(str::to_owned);
        let (state, program, tool) = (text("state"), text("program"), text("tool"));
        let query = Query { from_ns: Some(from_ns), to_ns: Some(to_ns), series, state, program, tool };
        let resolution_s = resolution_s.unwrap_or_else(|| usual_resolution_s(to_ns - from_ns));
        let found = if resolution_s > 0.0 {
            samples::read_bucketed(reader, &query, resolution_s, POINTS_MAX)
        } else {
            samples::read_raw(reader, &query, POINTS_MAX)
        };
        found
            .map(|series| samples::build_document((from_ns, to_ns), resolution_s, series))
            .map_err(|error| describe_history_error(&error))
    })
    .await
}

/// Whole seconds, about [`BUCKETS_DEFAULT`] of them.
fn usual_resolution_s(span_ns: i64) -> f64 {
    let seconds = (span_ns / SECOND_NS / BUCKETS_DEFAULT).max(1);
    #[expect(clippy::cast_precision_loss, reason = "seconds of centuries fit")]
    let seconds = seconds as f64;
    seconds
}
