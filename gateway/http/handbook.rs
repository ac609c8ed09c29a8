//! `GET /api/v1/handbook/{chapter}`: the handbook of the box, part of the binary.

use super::problem::ApiProblem;
use super::route::Route;
use axum::extract::{Path, Query};
use axum::http::header;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use gateway_handbook::{CHAPTERS, Chapter};
use rules::physics::explain::Language;
use serde::Deserialize;
use serde_json::{Value, json};

pub(super) const ROUTES: &[Route] = &[Route::for_file("/api/v1/handbook/{chapter}", || get(serve_chapter))];

/// The language of a chapter.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct ChapterQuery {
    lang: String,
}

/// `GET /api/v1/handbook/{chapter}?lang=zh`: Markdown; `index` gives the list of the chapters with their titles.
async fn serve_chapter(Path(name): Path<String>, Query(asked): Query<ChapterQuery>) -> Response {
    let language = if asked.lang == "zh" { Language::Zh } else { Language::En };
    if name == "index" {
        let row = |chapter: &Chapter| json!({ "name": chapter.topic, "title": chapter.title(language), "zh": chapter.zh.is_some() });
        let list: Vec<Value> = CHAPTERS.iter().map(row).collect();
        return axum::Json(json!({ "schema": "handbook/1", "chapters": list })).into_response();
    }
    match gateway_handbook::find_chapter(&name) {
        Some(chapter) => {
            ([(header::CONTENT_TYPE, "text/markdown; charset=utf-8")], chapter.text_in(language)).into_response()
        }
        None => ApiProblem::not_found(&format!("/api/v1/handbook/{name}")).into_response(),
    }
}
