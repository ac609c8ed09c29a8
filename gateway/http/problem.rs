//! Errors of the API as JSON problems (RFC 9457) with a hint.

use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;

/// What a client did or met, and what to do about it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ApiProblem {
    /// HTTP status code.
    pub status: u16,
    /// What is wrong, in one sentence.
    pub title: String,
    /// What to do next.
    pub hint: String,
}

impl ApiProblem {
    /// The request cannot be understood: 400.
    pub fn request(title: impl Into<String>, hint: impl Into<String>) -> Self {
        Self { status: 400, title: title.into(), hint: hint.into() }
    }

    /// There is no such page: 404.
    #[must_use]
    pub fn not_found(path: &str) -> Self {
        Self {
            status: 404,
            title: format!("there is nothing at {path}"),
            hint: "GET /openapi.json lists everything there is".to_owned(),
        }
    }

    /// The box cannot answer at this moment: 503.
    pub fn unavailable(title: impl Into<String>, hint: impl Into<String>) -> Self {
        Self { status: 503, title: title.into(), hint: hint.into() }
    }
}

impl IntoResponse for ApiProblem {
    fn into_response(self) -> Response {
        let status = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        (status, [(header::CONTENT_TYPE, "application/problem+json")], text(&self)).into_response()
    }
}

fn text(problem: &ApiProblem) -> String {
    serde_json::to_string(problem)
        .unwrap_or_else(|_| r#"{"status":500,"title":"the answer cannot be written"}"#.to_owned())
}
