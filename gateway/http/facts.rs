//! Facts of production from a person or a system of the plant: `POST /api/v1/facts` with one fact, several, or a CSV table.

use super::ServerState;
use super::guard::with_audit_note;
use super::peer::Peer;
use super::person::SignedIn;
use super::problem::ApiProblem;
use super::route::Route;
use axum::Json;
use axum::body::Bytes;
use axum::extract::{Extension, State};
use axum::http::{HeaderMap, header};
use axum::response::Response;
use axum::routing::post;
use gateway_access::Role;
use gateway_base::clock;
use gateway_control::{FactSender, FactsRefused, FactsTaken, read_facts_csv, read_facts_json};
use serde_json::json;

/// Five hundred facts with the longest words.
const BYTES_MAX: usize = 200_000;

pub(super) const ROUTES: &[Route] = &[Route::post(Role::Setter, "/api/v1/facts", BYTES_MAX, || post(add_facts))];

/// The form on the page says so of itself; everything else is a program.
const FORM: (&str, &str) = ("x-door", "page");

/// `POST /api/v1/facts`: a message with anything wrong in it is refused as a whole.
async fn add_facts(
    State(shared): State<ServerState>,
    Extension(peer): Extension<Peer>,
    SignedIn(person): SignedIn,
    headers: HeaderMap,
    body: Bytes,
) -> Result<Response, ApiProblem> {
    let kind = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let kind = kind.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
    let from_page = headers.get(FORM.0).is_some_and(|door| door == FORM.1);
    let sender =
        |way: &str| FactSender { way: way.to_owned(), author: format!("{} (from {})", person.name, peer.from) };
    let now_ns = clock::now_ns();
    let facts = match kind.as_str() {
        "application/json" => read_facts_json(&body, &sender(if from_page { "page" } else { "http" }), now_ns),
        "text/csv" => read_facts_csv(&body, &sender("csv"), now_ns),
        other => return Err(ApiProblem::media_type(other)),
    };
    let facts = facts.map_err(|error| {
        ApiProblem::bad_request(
            error.to_string(),
            "none was taken; chapter fleet of the handbook says how they are written",
        )
    })?;
    let FactsTaken { new, known } = shared.orders.send_facts(facts).await.map_err(describe_refusal)?;
    let text = format!("{new} facts stored, {known} known already");
    Ok(with_audit_note(Json(json!({ "schema": "facts-taken/1", "stored": new, "known": known })), text))
}

fn describe_refusal(error: FactsRefused) -> ApiProblem {
    ApiProblem::unavailable(error.to_string(), "nothing is lost: what was taken is known when it comes again")
}
