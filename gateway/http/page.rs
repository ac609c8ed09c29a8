//! The live page: three kinds of file, part of the binary, nothing from elsewhere.

use axum::extract::{Path, State};
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;

use super::problem::ApiProblem;
use super::route::Route;
use super::{Shared, headers};
use rules::physics::explain::Language;

const INDEX: &str = include_str!("../web/index.html");
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

pub(super) const ROUTES: &[Route] = &[Route::read("/", || get(page)), Route::file("/web/{file}", || get(web))];

/// `GET /`
pub(super) async fn page(State(shared): State<Shared>) -> Response {
    let chosen = match shared.language {
        None => return headers::page(INDEX),
        Some(Language::En) => "<html lang=\"en\" data-opens=\"en\">",
        Some(Language::Zh) => "<html lang=\"zh-CN\" data-opens=\"zh\">",
    };
    headers::page(&INDEX.replacen("<html lang=\"en\">", chosen, 1))
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
    ];
    (headers, content).into_response()
}
