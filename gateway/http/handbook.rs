//! `GET /api/v1/handbook/{chapter}`: the handbook of the box, part of the binary.

use super::problem::ApiProblem;
use super::route::Route;
use axum::extract::Path;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use serde_json::{Value, json};

macro_rules! chapters {
    ($($name:literal,)*) => {
        &[$(($name, include_str!(concat!("../handbook/", $name, ".md"))),)*]
    };
}

/// Every chapter: name and Markdown, in the order of reading.
static CHAPTERS: &[(&str, &str)] = chapters! {
    "page",
    "access",
};

pub(super) const ROUTES: &[Route] = &[Route::file("/api/v1/handbook/{chapter}", || get(chapter))];

/// The first heading of a chapter.
fn title(text: &str) -> &str {
    text.lines().find_map(|line| line.strip_prefix("# ")).unwrap_or("?").trim()
}

/// `GET /api/v1/handbook/{chapter}`: Markdown; `index` gives the list of the chapters with their titles.
async fn chapter(Path(name): Path<String>) -> Response {
    if name == "index" {
        let list: Vec<Value> =
            CHAPTERS.iter().map(|(name, text)| json!({ "name": name, "title": title(text) })).collect();
        return axum::Json(json!({ "schema": "handbook/1", "chapters": list })).into_response();
    }
    match CHAPTERS.iter().find(|(known, _)| *known == name) {
        Some((_, text)) => ([(header::CONTENT_TYPE, "text/markdown; charset=utf-8")], *text).into_response(),
        None => ApiProblem::not_found(&format!("/api/v1/handbook/{name}")).into_response(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_file_of_the_handbook_is_a_chapter_with_a_title() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/gateway/handbook");
        let files = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("readable").file_name());
        let files: BTreeSet<String> =
            files.filter_map(|name| name.to_str()?.strip_suffix(".md").map(str::to_owned)).collect();
        let known: BTreeSet<String> = CHAPTERS.iter().map(|(name, _)| (*name).to_owned()).collect();
        assert_eq!(files, known, "list the chapters of gateway/handbook in CHAPTERS");
        assert!(CHAPTERS.iter().all(|(_, text)| title(text) != "?"), "a chapter begins with `# Title`");
    }
}
