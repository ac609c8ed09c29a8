//! What stands before every route, made from its row of the table: the method, who asks, where the request comes from, its body
//! (`body`), and afterwards the account of it in the audit.

use super::ServerState;
use super::body::{with_body, with_body_in_file};
use super::peer::Peer;
use super::person::{SignedIn, find_cookie, name_of_cookie};
use super::problem::ApiProblem;
use super::route::{BodyPlace, Needs, Route};
use axum::body::Body;
use axum::extract::{Form, FromRequest, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Redirect, Response};
use gateway_access::{Person, Role, SignInError, Token, Urgency};
use serde::Deserialize;
use std::time::Duration;

/// An answer begins within this time.
const ANSWER_WITHIN: Duration = Duration::from_secs(60);

/// What a handler says about what it has changed, for the audit.
#[derive(Debug, Clone)]
struct AuditNote(String);

/// The answer with what stands in the audit about it: which thing was changed, from what to what. One line.
pub(super) fn with_audit_note(answer: impl IntoResponse, words: impl Into<String>) -> Response {
    let mut answer = answer.into_response();
    answer.extensions_mut().insert(AuditNote(words.into()));
    answer
}

/// What the guard of one route knows.
#[derive(Clone)]
pub(super) struct Guarded {
    pub(super) shared: ServerState,
    pub(super) route: Route,
}

pub(super) async fn guard_route(State(guarded): State<Guarded>, request: Request, next: Next) -> Response {
    match admit_request(&guarded, request).await {
        Ok((request, person)) => answer_and_audit(&guarded, request, person, next).await,
        Err(refused) => *refused,
    }
}

type Admitted = (Request, Option<Person>);

async fn admit_request(Guarded { shared, route }: &Guarded, mut request: Request) -> Result<Admitted, Box<Response>> {
    let refuse = |problem: ApiProblem| Box::new(problem.into_response());
    if !route.verb().matches_method(request.method()) {
        return Err(refuse(ApiProblem::method_not_allowed(route.verb().word())));
    }
    let Some(peer) = request.extensions().get::<Peer>().copied() else {
        return Err(refuse(ApiProblem::unavailable("the connection has no address", "connect again")));
    };
    let mut person = recognise_person(shared, route, request.headers(), &peer)
        .await
        .map_err(|error| refuse(describe_sign_in_error(&error)))?;
    if person.is_none() && route.urgency() == Urgency::GivesBack {
        // Whoever sends what names nobody is nobody.
        let unnamed = |problem| refuse(check_role(shared, route, None).err().unwrap_or(problem));
        request = with_body(request, route.body_max()).await.map_err(unnamed)?;
        (request, person) = identify_by_body(shared, request, &peer).await.map_err(refuse)?;
        person = person.or_else(|| shared.access.find_stand_in(""));
    }
    if let Err(problem) = check_role(shared, route, person.as_ref()) {
        let what = format!("{} {} from {}: {}", route.verb().word(), route.path(), peer.from, problem.title);
        // Whoever reads without having signed in is shown where to do so, which a page may ask for again and again.
        if matches!(route.needs(), Needs::Role(_)) {
            shared.access.record_refusal(&what, person.as_ref());
        }
        return Err(Box::new(ask_to_sign_in(&request, problem)));
    }
    if route.changes_state() {
        same_origin(request.headers(), &peer)
            .inspect_err(|problem| {
                let what = format!("{} {} from {}: {}", route.verb().word(), route.path(), peer.from, problem.title);
                shared.access.record_refusal(&what, person.as_ref());
            })
            .map_err(refuse)?;
        check_accountability(shared, route).map_err(refuse)?;
        request = match route.body_place() {
            BodyPlace::Memory => with_body(request, route.body_max()).await,
            BodyPlace::File => with_body_in_file(request, route.body_max(), shared).await,
        }
        .map_err(refuse)?;
    }
    if let Some(person) = &person {
        request.extensions_mut().insert(SignedIn(person.clone()));
    }
    Ok((request, person))
}

async fn answer_and_audit(
    Guarded { shared, route }: &Guarded,
    request: Request,
    person: Option<Person>,
    next: Next,
) -> Response {
    let path = request.uri().path().to_owned();
    let answer = match tokio::time::timeout(ANSWER_WITHIN, next.run(request)).await {
        Ok(answer) => answer,
        Err(_) => {
            let title = format!("no answer within {} s", ANSWER_WITHIN.as_secs());
            ApiProblem::unavailable(title, "ask for less, or again when the box has less to do").into_response()
        }
    };
    if let (true, Some(person)) = (route.changes_state(), person) {
        let outcome = match answer.status() {
            status if status.is_success() || status.is_redirection() => "done",
            status if status.is_client_error() => "refused",
            _ => "failed",
        };
        let words = answer.extensions().get::<AuditNote>().map_or(String::new(), |told| format!(": {}", told.0));
        let code = answer.status().as_u16();
        shared.access.record_change(outcome, &format!("{} {path} ({code}){words}", route.verb().word()), &person).await;
    }
    answer
}

/// Who asks: by the cookie of a session, or by name and token in the request itself.
async fn recognise_person(
    shared: &ServerState,
    route: &Route,
    headers: &HeaderMap,
    peer: &Peer,
) -> Result<Option<Person>, SignInError> {
    let given = headers.get(header::AUTHORIZATION).and_then(|value| std::str::from_utf8(value.as_bytes()).ok());
    if let Some(given) = given.and_then(|text| text.strip_prefix("Bearer ")) {
        return shared.access.of_bearer(given.trim(), peer.from, route.urgency()).await.map(Some);
    }
    Ok(find_cookie(headers, name_of_cookie(peer))
        .and_then(|cookie| shared.access.of_cookie(cookie))
        .map(|(person, _)| person))
}

/// Whoever gives the machine back may say who he is with the request itself, signed in or not: `name` and `token`, as a form or as
/// JSON.
async fn identify_by_body(
    shared: &ServerState,
    request: Request,
    peer: &Peer,
) -> Result<(Request, Option<Person>), ApiProblem> {
    let (parts, body) = request.into_parts();
    let broken = |error: axum::Error| ApiProblem::bad_request(format!("the body broke off: {error}"), "send it again");
    let bytes = axum::body::to_bytes(body, usize::MAX).await.map_err(broken)?;
    let again = Request::from_parts(parts.clone(), Body::from(bytes.clone()));
    let named = match serde_json::from_slice::<NameAndToken>(&bytes) {
        Ok(named) => Some(named),
        Err(_) => Form::<NameAndToken>::from_request(again, &()).await.ok().map(|Form(named)| named),
    };
    let person = match named {
        None => None,
        Some(NameAndToken { name, token }) => {
            let token = Token::from_typed_text(&token);
            let found = shared.access.check_token(&name, &token, peer.from, "disarmed", Urgency::GivesBack).await;
            Some(found.map_err(|error| describe_sign_in_error(&error))?)
        }
    };
    Ok((Request::from_parts(parts, Body::from(bytes)), person))
}

#[derive(Debug, Deserialize)]
struct NameAndToken {
    name: String,
    token: String,
}

/// Why nobody was recognised.
pub(super) fn describe_sign_in_error(error: &SignInError) -> ApiProblem {
    match error {
        SignInError::Wrong(0) => ApiProblem::too_many(gateway_access::LOCKED_FOR),
        SignInError::Wrong(left) => ApiProblem::unauthorised(
            "name or token is wrong",
            format!("{left} tries are left; an administrator gives a new token with `cnc-gateway person token NAME`"),
        ),
        SignInError::Wait(wait) => ApiProblem::too_many(*wait),
        SignInError::Busy => ApiProblem::unavailable("the box is busy", "try again in a few seconds"),
        SignInError::FirstToken => ApiProblem::unauthorised(
            "the token of the first start signs in once, at /sign-in, within a day",
            "make a lasting one at the box: `sudo cnc-gateway setup`, or `sudo cnc-gateway person token NAME`",
        ),
        SignInError::Unreadable(why) => ApiProblem::unavailable(
            format!("who may sign in cannot be read: {why}"),
            "at the box: `sudo chown --reference=DATA_DIR DATA_DIR/persons.json`; giving the machine back works all the same",
        ),
    }
}

fn check_role(shared: &ServerState, route: &Route, person: Option<&Person>) -> Result<(), ApiProblem> {
    let needed = match route.needs() {
        Needs::Nothing => return Ok(()),
        Needs::Reading if !shared.access.rules().tokens_always => return Ok(()),
        Needs::Reading => Role::Viewer,
        Needs::Role(role) => role,
    };
    match person {
        None => Err(ApiProblem::unauthorised("nobody is signed in", "sign in at /sign-in, or POST /api/v1/login")),
        Some(person) if person.role < needed => Err(ApiProblem::forbidden(
            format!("{} is {}; this needs the role {needed}", person.name, person.role),
            format!("an administrator gives it: `cnc-gateway person role {:?} {needed}`", person.name),
        )),
        Some(_) => Ok(()),
    }
}

/// Whoever asked for a page is brought to where he can sign in.
fn ask_to_sign_in(request: &Request, problem: ApiProblem) -> Response {
    let accepts = request.headers().get(header::ACCEPT).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let wants_page = request.method() == axum::http::Method::GET && accepts.contains("text/html");
    let path = request.uri().path_and_query().map_or("/", |path| path.as_str());
    match problem.status == StatusCode::UNAUTHORIZED.as_u16() && wants_page && super::plain::is_local_path(path) {
        // The signs that would end the value, or be read as others in it.
        true => {
            let next = path.replace('%', "%25").replace('&', "%26").replace('+', "%2B");
            Redirect::to(&format!("/sign-in?next={next}")).into_response()
        }
        false => problem.into_response(),
    }
}

/// A page of another site must not be able to change anything here, even where a browser would send the cookie along.
fn same_origin(headers: &HeaderMap, peer: &Peer) -> Result<(), ApiProblem> {
    let text = |name: header::HeaderName| headers.get(name).map(|value| value.to_str().unwrap_or("unreadable"));
    let foreign = |from: &str| {
        let hint = "open the page of this box itself and do it there";
        Err(ApiProblem::forbidden(format!("the request comes from another site ({from:?})"), hint))
    };
    let site = text(header::HeaderName::from_static("sec-fetch-site"));
    if let Some(site) = site.filter(|site| !["same-origin", "none"].contains(site)) {
        return foreign(site);
    }
    let own = text(header::HOST).map(|host| format!("{}://{host}", peer.scheme()));
    match text(header::ORIGIN) {
        Some(origin) if own.as_deref() != Some(origin) => foreign(origin),
        _ => Ok(()),
    }
}

/// What cannot be accounted for is not changed. What a viewer may do - give the machine back, sign out - always works.
fn check_accountability(shared: &ServerState, route: &Route) -> Result<(), ApiProblem> {
    let more = matches!(route.needs(), Needs::Role(role) if role > Role::Viewer);
    let error = shared.live.borrow().as_ref().and_then(|published| published.status.history.error.clone());
    match error.filter(|_| more) {
        Some(error) => Err(ApiProblem::unavailable(
            format!("the change could not be accounted for: {error}"),
            "`cnc-gateway history info` says more; disarming works",
        )),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_sites_change_nothing() {
        let peer = Peer::new("10.0.0.9:1".parse().expect("one"), "10.0.0.1:8080".parse().expect("one"), true);
        let headers = |pairs: &[(&'static str, &'static str)]| {
            pairs
                .iter()
                .map(|(name, value)| (header::HeaderName::from_static(name), value.parse().expect("one")))
                .collect()
        };
        let allowed = |pairs: &[(&'static str, &'static str)]| same_origin(&headers(pairs), &peer).is_ok();
        assert!(allowed(&[("host", "cnc7:8080")]), "no browser");
        assert!(allowed(&[("host", "cnc7:8080"), ("origin", "https://cnc7:8080"), ("sec-fetch-site", "same-origin")]));
        assert!(!allowed(&[("host", "cnc7:8080"), ("origin", "http://cnc7:8080")]), "another scheme");
        assert!(!allowed(&[("host", "cnc7:8080"), ("origin", "https://evil.example")]));
        assert!(!allowed(&[("host", "cnc7:8080"), ("origin", "null")]));
        assert!(!allowed(&[("host", "cnc7:8080"), ("sec-fetch-site", "same-site")]));
        assert!(!allowed(&[("host", "cnc7:8080"), ("sec-fetch-site", "cross-site")]));
    }
}
