//! The live page: three kinds of file, part of the binary, nothing from elsewhere.

use axum::extract::{Path, State};
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};

use super::Shared;
use super::problem::ApiProblem;
use rules::physics::explain::Language;

const INDEX: &str = include_str!("../web/index.html");
const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";

/// The files below `/web/`: name, type, content.
const FILES: [(&str, &str, &str); 5] = [
    ("page.css", CSS, include_str!("../web/page.css")),
    ("page.js", SCRIPT, include_str!("../web/page.js")),
    ("chart.js", SCRIPT, include_str!("../web/chart.js")),
    ("words.js", SCRIPT, include_str!("../web/words.js")),
    ("icon.svg", "image/svg+xml", include_str!("../web/icon.svg")),
];

/// Only what this box serves may run or load; nothing may frame it.
const POLICY: &str = "default-src 'self'; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'; base-uri 'none'";

/// `GET /`
pub(super) async fn page(State(shared): State<Shared>) -> Response {
    let chosen = match shared.language {
        None => return file(HTML, INDEX),
        Some(Language::En) => "<html lang=\"en\" data-opens=\"en\">",
        Some(Language::Zh) => "<html lang=\"zh-CN\" data-opens=\"zh\">",
    };
    file(HTML, INDEX.replacen("<html lang=\"en\">", chosen, 1))
}

/// `GET /web/{file}`
pub(super) async fn web(Path(name): Path<String>) -> Response {
    match FILES.iter().find(|(known, ..)| *known == name) {
        Some((_, kind, content)) => file(kind, *content),
        None => ApiProblem::not_found(&format!("/web/{name}")).into_response(),
    }
}

fn file(kind: &'static str, content: impl IntoResponse) -> Response {
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(kind)),
        (header::CACHE_CONTROL, HeaderValue::from_static("no-cache")),
        (header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY)),
        (header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
    ];
    (headers, content).into_response()
}
