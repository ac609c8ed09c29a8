//! The page: one document at the address of each view, and its files.

use super::files::{FILES, INDEX};
use super::problem::ApiProblem;
use super::route::Route;
use super::{ServerState, headers};
use axum::extract::{Path, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use rules::physics::explain::Language;

pub(super) const ROUTES: &[Route] = &[
    Route::read("/", || get(serve_page)),
    Route::read("/now", || get(serve_page)),
    Route::read("/history", || get(serve_page)),
    Route::read("/wear", || get(serve_page)),
    Route::read("/thermal", || get(serve_page)),
    Route::read("/twin", || get(serve_page)),
    Route::read("/rules", || get(serve_page)),
    Route::read("/audit", || get(serve_page)),
    Route::read("/box", || get(serve_page)),
    Route::read("/setup", || get(serve_page)),
    Route::read("/help", || get(serve_page)),
    Route::for_file("/web/{file}", || get(serve_web_file)),
];

/// `GET /` and the address of every view.
async fn serve_page(State(shared): State<ServerState>) -> Response {
    let chosen = match shared.language {
        None => return headers::respond_with_page(INDEX),
        Some(Language::En) => "<html lang=\"en\" data-opens=\"en\">",
        Some(Language::Zh) => "<html lang=\"zh-CN\" data-opens=\"zh\">",
    };
    headers::respond_with_page(&INDEX.replacen("<html lang=\"en\">", chosen, 1))
}

/// `GET /web/{file}`: a browser that has this version already is told so.
async fn serve_web_file(Path(name): Path<String>, asked: HeaderMap) -> Response {
    let Some(file) = FILES.iter().find(|file| file.name == name) else {
        return ApiProblem::not_found(&format!("/web/{name}")).into_response();
    };
    let tag = format!("\"{:016x}\"", gateway_base::files::compute_digest(file.content.as_bytes()));
    let known = asked.get(header::IF_NONE_MATCH).and_then(|value| value.to_str().ok());
    let mut response = if known == Some(tag.as_str()) {
        StatusCode::NOT_MODIFIED.into_response()
    } else {
        respond_with_content(file.kind, file.content)
    };
    if let Ok(tag) = HeaderValue::from_str(&tag) {
        response.headers_mut().insert(header::ETAG, tag);
    }
    response
}

fn respond_with_content(kind: &'static str, content: impl IntoResponse) -> Response {
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(kind)),
        (header::CACHE_CONTROL, HeaderValue::from_static("no-cache")),
    ];
    (headers, content).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_document_holds_a_script_or_a_style_of_its_own() {
        assert!(!INDEX.contains("style=") && !INDEX.contains("<style"));
        assert!(INDEX.matches("<script").count() == INDEX.matches("<script type=\"module\" src=").count());
    }

    #[test]
    fn every_file_of_the_page_is_served_under_one_name() {
        let mut names: Vec<_> = FILES.iter().map(|file| file.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), FILES.len());
    }

    #[test]
    fn every_module_of_the_words_is_preloaded() {
        let named = |text: &str, before: &str| -> Vec<String> {
            text.split(before).skip(1).filter_map(|rest| Some(rest.split_once('"')?.0.to_owned())).collect()
        };
        let preloaded = named(INDEX, "rel=\"modulepreload\" href=\"/web/");
        let table = FILES.iter().find(|file| file.name == "word-table.js").expect("the table is served");
        let words = named(table.content, "from \"/web/");
        assert!(words.len() >= 9 && words.iter().all(|name| preloaded.contains(name)), "{words:?}");
        assert!(preloaded.iter().all(|name| FILES.iter().any(|file| file.name == *name)), "{preloaded:?}");
    }
}
