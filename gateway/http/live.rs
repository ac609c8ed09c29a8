//! `GET /api/v1/live`: the status as server-sent events, a few per second.

use super::ServerState;
use super::peer::Peer;
use super::person::{SignedIn, find_cookie, name_of_cookie};
use super::route::Route;
use axum::extract::{Extension, State};
use axum::http::{HeaderMap, header};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use gateway_access::digest_cookie;
use std::convert::Infallible;
use std::time::Duration;
use tokio_stream::StreamExt;
use tokio_stream::wrappers::WatchStream;

pub(super) const ROUTES: &[Route] = &[Route::read("/api/v1/live", || get(stream_live))];

/// `GET /api/v1/live`: every new status as an event of a stream.
async fn stream_live(
    State(shared): State<ServerState>,
    Extension(peer): Extension<Peer>,
    person: Option<SignedIn>,
    headers: HeaderMap,
) -> Response {
    let held = match shared.streams.open_stream(peer.from) {
        Ok(held) => held,
        // Whoever reads until the end has his answer now.
        Err(problem) => return ([(header::CONNECTION, "close")], problem).into_response(),
    };
    let session = find_cookie(&headers, name_of_cookie(&peer)).map(digest_cookie);
    let access = shared.access.clone();
    // Where reading needs a person, the stream ends with the session, or when the person is not known any more.
    let goes_on = move || match (&session, &person) {
        _ if !access.rules().tokens_always => true,
        (Some(session), _) => access.of_key(session).is_some(),
        (None, Some(SignedIn(person))) => access.has_person(&person.name),
        (None, None) => false,
    };
    // It also ends when the tick ends and drops its side.
    let events = WatchStream::new(shared.live.clone()).take_while(move |_| goes_on()).filter_map(move |published| {
        let _held_while_listening = &held;
        let text = serde_json::to_string(&*published?.status).ok()?;
        Some(Ok::<_, Infallible>(Event::default().event("status").data(text)))
    });
    Sse::new(events).keep_alive(KeepAlive::new().interval(Duration::from_secs(15))).into_response()
}
