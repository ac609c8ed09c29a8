//! Signing in and out, and who may: `/api/v1/login`, `logout`, `session`, `persons`.

use super::ServerState;
use super::guard::{describe_sign_in_error, with_audit_note};
use super::history::{Answer, HistoryQuery};
use super::peer::Peer;
use super::person::{JsonBody, SignedIn, find_cookie, name_of_cookie, set_cookie};
use super::plain;
use super::problem::ApiProblem;
use super::query::QueryKeys;
use super::route::Route;
use axum::Json;
use axum::extract::{Extension, Form, FromRequest, Path, Query as Pairs, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::{delete, get, post, put};
use gateway_access::{NewSession, Person, PersonsError, Role, Token};
use serde::Deserialize;
use serde_json::{Value, json};
use std::time::Instant;

/// Name, token and where to go afterwards.
const LOGIN_BYTES_MAX: usize = 4096;
/// A name and a role.
const PERSON_BYTES_MAX: usize = 1024;

pub(super) const ROUTES: &[Route] = &[
    Route::sign_in("/api/v1/login", LOGIN_BYTES_MAX, || post(sign_in_person)),
    Route::post(Role::Viewer, "/api/v1/logout", PERSON_BYTES_MAX, || post(sign_out_person)),
    Route::for_file("/api/v1/session", || get(serve_session)),
    Route::read_by(Role::Admin, "/api/v1/persons", || get(serve_persons)),
    Route::post(Role::Admin, "/api/v1/persons", PERSON_BYTES_MAX, || post(add)),
    Route::put(Role::Admin, "/api/v1/persons/{name}", PERSON_BYTES_MAX, || put(give_role)),
    Route::delete(Role::Admin, "/api/v1/persons/{name}", 0, || delete(remove)),
    Route::post(Role::Admin, "/api/v1/persons/{name}/token", PERSON_BYTES_MAX, || post(give_token)),
];

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Login {
    name: String,
    token: String,
    /// Of the form alone: where to go afterwards.
    #[serde(default)]
    next: String,
}

/// `POST /api/v1/login`, as JSON or from the form of `/sign-in`.
async fn sign_in_person(
    State(shared): State<ServerState>,
    Extension(peer): Extension<Peer>,
    request: Request,
) -> Response {
    let kind = request.headers().get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let headers = request.headers().clone();
    if kind.starts_with("application/x-www-form-urlencoded") {
        return match Form::<Login>::from_request(request, &()).await {
            Ok(Form(login)) => login_by_form(&shared, &peer, &headers, login).await,
            Err(error) => ApiProblem::bad_request(error.to_string(), "fill in the form at /sign-in").into_response(),
        };
    }
    match JsonBody::<Login>::from_request(request, &()).await {
        Ok(JsonBody(login)) => match begin_session(&shared, &peer, &login).await {
            Ok((begun, set)) => {
                ([(header::SET_COOKIE, set)], Json(session_to_json(&shared, Some((begun.person, None)))))
                    .into_response()
            }
            Err(problem) => problem.into_response(),
        },
        Err(problem) => problem.into_response(),
    }
}

async fn login_by_form(shared: &ServerState, peer: &Peer, headers: &HeaderMap, login: Login) -> Response {
    match begin_session(shared, peer, &login).await {
        Ok((_, set)) => {
            let next = if plain::is_local_path(&login.next) { login.next.as_str() } else { "/" };
            ([(header::SET_COOKIE, set)], Redirect::to(next)).into_response()
        }
        Err(problem) => plain::sign_in_again(shared, headers, &login.next, &problem),
    }
}

async fn begin_session(shared: &ServerState, peer: &Peer, login: &Login) -> Result<(NewSession, String), ApiProblem> {
    let begun = shared.access.sign_in(&login.name, &Token::from_typed_text(&login.token), peer.from).await;
    let begun = begun.map_err(|error| describe_sign_in_error(&error))?;
    let set = set_cookie(peer, &begun.cookie, shared.access.rules().session.as_secs());
    Ok((begun, set))
}

/// `POST /api/v1/logout`: ends the session of the cookie and removes the cookie.
async fn sign_out_person(
    State(shared): State<ServerState>,
    Extension(peer): Extension<Peer>,
    headers: HeaderMap,
) -> Response {
    if let Some(cookie) = find_cookie(&headers, name_of_cookie(&peer)) {
        shared.access.sign_out(cookie, peer.from).await;
    }
    let gone = [(header::SET_COOKIE, set_cookie(&peer, "", 0))];
    match plain::wants_page(&headers) {
        true => (gone, Redirect::to("/plain")).into_response(),
        false => (gone, Json(session_to_json(&shared, None))).into_response(),
    }
}

/// `GET /api/v1/session`: who is signed in and what that person may do.
async fn serve_session(
    State(shared): State<ServerState>,
    Extension(peer): Extension<Peer>,
    person: Option<SignedIn>,
    headers: HeaderMap,
    Pairs(pairs): HistoryQuery,
) -> Answer {
    QueryKeys::from_pairs(pairs, &[])?;
    let until = find_cookie(&headers, name_of_cookie(&peer)).and_then(|cookie| shared.access.of_cookie(cookie));
    Ok(Json(session_to_json(&shared, person.map(|SignedIn(person)| (person, until.map(|(_, until)| until))))))
}

/// `session/1`: who is signed in, for how long, and what the box lets such a person do. Times are lengths: the clock of a
/// browser may be wrong.
fn session_to_json(shared: &ServerState, person: Option<(Person, Option<Instant>)>) -> Value {
    let rules = shared.access.rules();
    let until = person.as_ref().and_then(|(_, until)| *until);
    let left_s = match (&person, until) {
        (None, _) => None,
        (Some(_), Some(until)) => Some(until.saturating_duration_since(Instant::now()).as_secs()),
        (Some(_), None) => Some(rules.session.as_secs()),
    };
    let role = person.as_ref().map(|(person, _)| person.role);
    let at_least = |needed: Role| role.is_some_and(|role| role >= needed);
    json!({
        "schema": "session/1",
        "person": person.map(|(person, _)| json!({ "name": person.name, "role": person.role })),
        "left_s": left_s,
        "roles": Role::ALL.map(Role::as_word),
        "tokens": if rules.tokens_always { "always" } else { "changes" },
        "arming_allowed": rules.allow_arming,
        "may": {
            "edit": at_least(Role::Setter),
            "arm": at_least(Role::Armer) && rules.allow_arming,
            "disarm": role.is_some(),
            "manage": at_least(Role::Admin),
        },
    })
}

/// `GET /api/v1/persons`: names and roles of all persons.
async fn serve_persons(State(shared): State<ServerState>, Pairs(pairs): HistoryQuery) -> Answer {
    QueryKeys::from_pairs(pairs, &[])?;
    let persons = shared.access.persons();
    let rows: Vec<Value> =
        persons.list_entries().iter().map(|it| json!({ "name": it.name, "role": it.role, "by": it.by })).collect();
    Ok(Json(json!({ "schema": "persons/1", "persons": rows })))
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct NewPerson {
    name: String,
    role: Role,
}

/// `POST /api/v1/persons`: the token is in the answer, once.
async fn add(
    State(shared): State<ServerState>,
    SignedIn(by): SignedIn,
    JsonBody(wanted): JsonBody<NewPerson>,
) -> Result<Response, ApiProblem> {
    let token = shared
        .access
        .change_persons(|persons| persons.add(&wanted.name, wanted.role, &by.name))
        .await
        .map_err(describe_persons_error)?;
    let body = json!({ "schema": "token/1", "name": wanted.name.trim(), "role": wanted.role, "token": token.text() });
    Ok(with_audit_note((StatusCode::CREATED, Json(body)), format!("{} is {}", wanted.name.trim(), wanted.role)))
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct NewRole {
    role: Role,
}

/// `PUT /api/v1/persons/{name}`: gives a person another role.
async fn give_role(
    State(shared): State<ServerState>,
    SignedIn(by): SignedIn,
    Path(name): Path<String>,
    JsonBody(wanted): JsonBody<NewRole>,
) -> Result<Response, ApiProblem> {
    shared
        .access
        .change_persons(|persons| persons.give_role(&name, wanted.role, &by.name))
        .await
        .map_err(describe_persons_error)?;
    let body = json!({ "schema": "person/1", "name": name, "role": wanted.role });
    Ok(with_audit_note(Json(body), format!("{name} is {}", wanted.role)))
}

/// `POST /api/v1/persons/{name}/token`: the token is in the answer, once; sessions with the one before end.
async fn give_token(
    State(shared): State<ServerState>,
    SignedIn(by): SignedIn,
    Path(name): Path<String>,
) -> Result<Response, ApiProblem> {
    let token = shared
        .access
        .change_persons(|persons| persons.give_token(&name, &by.name))
        .await
        .map_err(describe_persons_error)?;
    let role = shared.access.persons().find_by_name(&name).map(|it| it.role);
    let body = json!({ "schema": "token/1", "name": name, "role": role, "token": token.text() });
    Ok(with_audit_note(Json(body), format!("{name} has a new token")))
}

/// `DELETE /api/v1/persons/{name}`: removes a person; the last administrator stays.
async fn remove(State(shared): State<ServerState>, Path(name): Path<String>) -> Result<Response, ApiProblem> {
    shared.access.change_persons(|persons| persons.remove(&name)).await.map_err(describe_persons_error)?;
    Ok(with_audit_note(
        Json(json!({ "schema": "person/1", "name": name, "role": null })),
        format!("{name} was removed"),
    ))
}

fn describe_persons_error(error: PersonsError) -> ApiProblem {
    let hint = "GET /api/v1/persons lists everybody";
    match error {
        PersonsError::Nobody(name) => ApiProblem::not_found(&format!("/api/v1/persons/{name}")),
        PersonsError::Name(_) => ApiProblem::bad_request(error.to_string(), hint),
        PersonsError::Taken(_) | PersonsError::LastAdmin(_) | PersonsError::Full => {
            ApiProblem::conflict(error.to_string(), hint)
        }
        PersonsError::File(..) | PersonsError::Content(..) | PersonsError::Token(_) => {
            ApiProblem::unavailable(error.to_string(), "look at the data directory of the gateway")
        }
    }
}
