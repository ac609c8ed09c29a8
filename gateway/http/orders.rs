//! Orders of a person on the page: arm the gate, give the machine back to its dial, acknowledge. They go the way of the orders
//! at the box, see `control`; what the tick makes of them stands in the audit with the name of the person.

use super::ServerState;
use super::guard::{describe_sign_in_error, with_audit_note};
use super::peer::Peer;
use super::person::{JsonBody, SignedIn};
use super::plain;
use super::problem::ApiProblem;
use super::route::Route;
use axum::Json;
use axum::extract::{Extension, State};
use axum::http::HeaderMap;
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::post;
use gateway_access::{Person, Role, Token, Urgency};
use gateway_control::{Order, Reply};
use serde::Deserialize;
use serde_json::json;

/// A token and a time, or the code of an alarm.
const BYTES_MAX: usize = 1024;

pub(super) const ROUTES: &[Route] = &[
    Route::post(Role::Armer, "/api/v1/arm", BYTES_MAX, || post(arm_gate)),
    Route::post(Role::Viewer, "/api/v1/disarm", BYTES_MAX, || post(disarm_gate)).gives_back(),
    Route::post(Role::Setter, "/api/v1/alarms/acknowledge", BYTES_MAX, || post(acknowledge_alarms)),
];

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Arm {
    token: String,
    for_s: Option<f64>,
}

/// `POST /api/v1/arm`: only where the configuration allows it, and only with the token once more.
async fn arm_gate(
    State(shared): State<ServerState>,
    Extension(peer): Extension<Peer>,
    SignedIn(person): SignedIn,
    JsonBody(wanted): JsonBody<Arm>,
) -> Result<Response, ApiProblem> {
    if !shared.access.rules().allow_arming {
        let hint = "arm at the box with `cnc-gateway arm --by NAME`, or write allow_arming = true under [http]";
        return Err(ApiProblem::forbidden("the gate cannot be armed from the page", hint));
    }
    let again = shared
        .access
        .check_token(&person.name, &Token::from_typed_text(&wanted.token), peer.from, "armed", Urgency::Waits)
        .await;
    again.map_err(|error| describe_sign_in_error(&error))?;
    let order = Order::Arm { by: format_author(&person, &peer), for_s: wanted.for_s };
    respond_to_order(
        shared.orders.send_order(order).await,
        "look at [gate] in the configuration, and at the problems of /api/v1/status",
    )
}

/// `POST /api/v1/disarm`: back to the dial.
async fn disarm_gate(
    State(shared): State<ServerState>,
    Extension(peer): Extension<Peer>,
    SignedIn(person): SignedIn,
    headers: HeaderMap,
) -> Result<Response, ApiProblem> {
    let reply = shared.orders.send_order(Order::Disarm { by: format_author(&person, &peer) }).await;
    match plain::wants_page(&headers) {
        true => Ok(Redirect::to("/plain").into_response()),
        false => {
            respond_to_order(reply, "press the button at the machine's panel; the dial of the machine always works")
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Acknowledge {
    /// Code of an alarm; without it a feed hold or stop was seen to.
    code: Option<String>,
}

/// `POST /api/v1/alarms/acknowledge`: an alarm has been seen; without a code, a feed hold or stop.
async fn acknowledge_alarms(
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
    respond_to_order(shared.orders.send_order(order).await, "GET /api/v1/status lists the alarms that stand")
}

/// The name as it stands in the audit.
fn format_author(person: &Person, peer: &Peer) -> String {
    format!("{} (from {})", person.name, peer.from)
}

fn respond_to_order(reply: Reply, hint: &str) -> Result<Response, ApiProblem> {
    match reply.done {
        true => {
            let body = json!({ "schema": "order/1", "done": true, "text": reply.text });
            Ok(with_audit_note(Json(body), reply.text))
        }
        false => Err(ApiProblem::conflict(reply.text, hint)),
    }
}
