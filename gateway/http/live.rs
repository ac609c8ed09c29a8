//! `GET /api/v1/live`: the status as server-sent events, a few per second.

use super::Shared;
use super::problem::ApiProblem;
use axum::extract::State;
use axum::response::sse::{Event, KeepAlive, Sse};
use std::convert::Infallible;
use std::time::Duration;
use tokio_stream::wrappers::WatchStream;
use tokio_stream::{Stream, StreamExt};

/// More listeners than this at once are turned away.
pub(super) const LISTENERS_MAX: usize = 32;

/// `GET /api/v1/live`
///
/// # Errors
/// Too many listeners.
pub(super) async fn live(
    State(shared): State<Shared>,
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>>>, ApiProblem> {
    let seat = shared.listeners.clone().try_acquire_owned().map_err(|_| {
        ApiProblem::unavailable(
            format!("{LISTENERS_MAX} clients listen already"),
            "close a page, or read /api/v1/status instead",
        )
    })?;
    // The stream ends when the tick ends and drops its side.
    let events = WatchStream::new(shared.live.clone()).filter_map(move |published| {
        let _held_while_listening = &seat;
        let text = serde_json::to_string(&*published?.status).ok()?;
        Some(Ok(Event::default().event("status").data(text)))
    });
    Ok(Sse::new(events).keep_alive(KeepAlive::new().interval(Duration::from_secs(15))))
}
