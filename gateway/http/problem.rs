//! Errors of the API as JSON problems (RFC 9457) with a hint.

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use std::time::Duration;

/// What a client did or met, and what to do about it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ApiProblem {
    /// HTTP status code of the answer.
    pub status: u16,
    /// What is wrong, in one sentence.
    pub title: String,
    /// What to do next.
    pub hint: String,
    /// Ask again after so many seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub retry_after_s: Option<u64>,
}

impl ApiProblem {
    fn with_status(status: StatusCode, title: impl Into<String>, hint: impl Into<String>) -> Self {
        Self { status: status.as_u16(), title: title.into(), hint: hint.into(), retry_after_s: None }
    }

    /// The request cannot be understood: 400.
    pub fn bad_request(title: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::with_status(StatusCode::BAD_REQUEST, title, hint)
    }

    /// Nobody is signed in, or name and token are wrong: 401.
    pub fn unauthorised(title: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::with_status(StatusCode::UNAUTHORIZED, title, hint)
    }

    /// Whoever asks may not: 403.
    pub fn forbidden(title: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::with_status(StatusCode::FORBIDDEN, title, hint)
    }

    /// There is no such page: 404.
    #[must_use]
    pub fn not_found(path: &str) -> Self {
        let title = format!("there is nothing at {path}");
        Self::with_status(StatusCode::NOT_FOUND, title, "GET /openapi.json lists everything there is")
    }

    /// The address takes another method: 405.
    #[must_use]
    pub fn method_not_allowed(takes: &str) -> Self {
        Self::with_status(
            StatusCode::METHOD_NOT_ALLOWED,
            format!("this address takes {takes}"),
            "GET /openapi.json says more",
        )
    }

    /// The request does not fit what is there now: 409.
    pub fn conflict(title: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::with_status(StatusCode::CONFLICT, title, hint)
    }

    /// The request came too slowly: 408.
    #[must_use]
    pub fn request_timeout(within: Duration) -> Self {
        let title = format!("the request was not complete within {} s", within.as_secs());
        Self::with_status(StatusCode::REQUEST_TIMEOUT, title, "send it again")
    }

    /// The body is longer than so many bytes: 413.
    #[must_use]
    pub fn too_large(most: usize) -> Self {
        let most = match most {
            most if most > 0 && most % (1 << 20) == 0 => format!("{} MB", most >> 20),
            most => format!("{most} bytes"),
        };
        let title = format!("the body is longer than {most}");
        Self::with_status(StatusCode::PAYLOAD_TOO_LARGE, title, "send less")
    }

    /// The body is of another kind than JSON: 415.
    #[must_use]
    pub fn media_type(found: &str) -> Self {
        let title = format!("the body is {found:?}; application/json is needed");
        Self::with_status(StatusCode::UNSUPPORTED_MEDIA_TYPE, title, "send Content-Type: application/json")
    }

    /// The request is meant for another host: 421.
    #[must_use]
    pub fn misdirected_request(host: &str) -> Self {
        let hint = "write the address of this box, or add the name to `allow_hosts` under [http]";
        Self::with_status(StatusCode::MISDIRECTED_REQUEST, format!("this box is not {host:?}"), hint)
    }

    /// Too many wrong tokens: 429.
    #[must_use]
    pub fn too_many(wait: Duration) -> Self {
        let seconds = wait.as_secs().max(1);
        let title = format!("too many wrong tokens: nothing is tried for {seconds} s");
        let hint = "wait, or sign in from another computer; arming and disarming at the box itself work";
        Self { retry_after_s: Some(seconds), ..Self::with_status(StatusCode::TOO_MANY_REQUESTS, title, hint) }
    }

    /// The box itself went wrong: 500.
    #[must_use]
    pub fn internal_error() -> Self {
        let hint = "report this with the log; the machine is still polled";
        Self::with_status(StatusCode::INTERNAL_SERVER_ERROR, "the answer could not be made", hint)
    }

    /// The box cannot answer at this moment: 503.
    pub fn unavailable(title: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::with_status(StatusCode::SERVICE_UNAVAILABLE, title, hint)
    }
}

impl IntoResponse for ApiProblem {
    fn into_response(self) -> Response {
        let status = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let kind = [(header::CONTENT_TYPE, "application/problem+json")];
        let mut answer = (status, kind, format_problem(&self)).into_response();
        if let Some(seconds) = self.retry_after_s {
            answer.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from(seconds));
        }
        // The rest of such a body is not waited for.
        if [StatusCode::REQUEST_TIMEOUT, StatusCode::PAYLOAD_TOO_LARGE].contains(&status) {
            answer.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
        }
        answer
    }
}

fn format_problem(problem: &ApiProblem) -> String {
    serde_json::to_string(problem)
        .unwrap_or_else(|_| r#"{"status":500,"title":"the answer cannot be written"}"#.to_owned())
}
