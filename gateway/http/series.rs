//! `GET /api/v1/series`: what this history holds, and from when to when.

use super::ServerState;
use super::history::{Answer, HistoryQuery, describe_history_error, read_history};
use super::query::QueryKeys;
use super::route::Route;
use axum::extract::{Query as Pairs, State};
use axum::routing::get;
use gateway_history::SeriesKind;
use serde_json::{Value, json};

pub(super) const ROUTES: &[Route] = &[Route::read("/api/v1/series", || get(serve_series))];

/// `GET /api/v1/series`: every series of the history, with its unit.
async fn serve_series(State(shared): State<ServerState>, Pairs(pairs): HistoryQuery) -> Answer {
    QueryKeys::from_pairs(pairs, &[])?;
    read_history(shared, |reader, _| {
        let span = reader.read_present_span().map_err(|error| describe_history_error(&error))?;
        let known = reader.read_series().map_err(|error| describe_history_error(&error))?;
        let rows: Vec<Value> = known
            .iter()
            .map(|series| {
                let kind = if series.kind == SeriesKind::Number { "number" } else { "text" };
                json!({
                    "name": &*series.name, "unit": &*series.unit, "kind": kind,
                    "en": &*series.en, "zh": &*series.zh, "estimated": series.estimated,
                })
            })
            .collect();
        let ms = |at_ns: i64| at_ns.div_euclid(1_000_000);
        Ok(json!({
            "schema": "series/1",
            "first_ms": span.map(|(first_ns, _)| ms(first_ns)),
            "last_ms": span.map(|(_, last_ns)| ms(last_ns)),
            "series": rows,
        }))
    })
    .await
}
