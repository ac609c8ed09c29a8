//! Orders of a person on the page: arm the gate, give the machine back to its dial, acknowledge. They go the way of the orders
//! at the box, see `control`; what the tick makes of them stands in the audit with the name of the person.

use super::ServerState;
use super::guard::{told, wrong};
use super::peer::Peer;
use super::person::{JsonBody, SignedIn};
use super::plain;
use super::problem::ApiProblem;
use super::route::Route;
use crate::access::{Person, Role, Token, Urgency};
use crate::control::{Order, Reply};
use axum::Json;
use axum::extract::{Extension, State};
use axum::http::HeaderMap;
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::post;
use serde::Deserialize;
use serde_json::json;

/// A token and a time, or the code of an alarm.
const BYTES_MAX: usize = 1024;

pub(super) const ROUTES: &[Route] = &[
    Route::post(Role::Armer, "/api/v1/arm", BYTES_MAX, || post(arm)),
    Route::post(Role::Viewer, "/api/v1/disarm", BYTES_MAX, || post(disarm)).gives_back(),
    Route::post(Role::Setter, "/api/v1/alarms/acknowledge", BYTES_MAX, || post(acknowledge)),
];

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Arm {
    token: String,
    for_s: Option<f64>,
}

/// `POST /api/v1/arm`: only where the configuration allows it, and only with the token once more.
async fn arm(
    State(shared): State<ServerState>,
    Extension(peer): Extension<Peer>,
    SignedIn(person): SignedIn,
    JsonBody(wanted): JsonBody<Arm>,
) -> Result<Response, ApiProblem> {
    if !shared.access.rules().allow_arming {
        let hint = "arm at the box with `cnc-gateway arm --by NAME`, or write allow_arming = true under [http]";
        return Err(ApiProblem::forbidden("the gate cannot be armed from the page", hint));
    }
    let again =
        shared.access.check(&person.name, &Token::typed(&wanted.token), peer.from, "armed", Urgency::Waits).await;
    again.map_err(|error| wrong(&error))?;
    let order = Order::Arm { by: format_author(&person, &peer), for_s: wanted.for_s };
    answer(shared.post.order(order).await, "look at [gate] in the configuration, and at the problems of /api/v1/status")
}

/// `POST /api/v1/disarm`: back to the dial.
async fn disarm(
    State(shared): State<ServerState>,
    Extension(peer): Extension<Peer>,
    SignedIn(person): SignedIn,
    headers: HeaderMap,
) -> Result<Response, ApiProblem> {
    let reply = shared.post.order(Order::Disarm { by: format_author(&person, &peer) }).await;
    match plain::wants_page(&headers) {
        true => Ok(Redirect::to("/plain").into_response()),
        false => answer(reply, "press the button at the machine's panel; the dial of the machine always works"),
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Acknowledge {
    /// Code of an alarm; without it a feed hold or stop was seen to.
    code: Option<String>,
}

/// `POST /api/v1/alarms/acknowledge`
async fn acknowledge(
    State(shared): State<ServerState>,
    Extension(peer): Extension<Peer>,
    SignedIn(person): SignedIn,
    JsonBody(wanted): JsonBody<Acknowledge>,
) -> Result<Response, ApiProblem> {
    let by = format_author(&person, &peer);
    let order = match wanted.code {
        Some(code) => Order::AcknowledgeAlarm { by, code },
        None => Order::Acknowledge { by },
    };
    answer(shared.post.order(order).await, "GET /api/v1/status lists the alarms that stand")
}

/// The name as it stands in the audit.
fn format_author(person: &Person, peer: &Peer) -> String {
    format!("{} (from {})", person.name, peer.from)
}

fn answer(reply: Reply, hint: &str) -> Result<Response, ApiProblem> {
    match reply.done {
        true => {
            let body = json!({ "schema": "order/1", "done": true, "text": reply.text });
            Ok(told(Json(body), reply.text))
        }
        false => Err(ApiProblem::conflict(reply.text, hint)),
    }
}
