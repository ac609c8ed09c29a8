//! The page: one document at the address of each view, and its files.

use super::Shared;
use super::files::{FILES, INDEX};
use super::problem::ApiProblem;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use rules::physics::explain::Language;

/// Only what this box serves may run or load; nothing may frame it. Styles are set from scripts through the object model,
/// which this allows; no text of a style or script stands in a document.
const POLICY: &str = "default-src 'self'; img-src 'self' data: blob:; object-src 'none'; frame-ancestors 'none'; \
                      base-uri 'none'; form-action 'self'";

/// `GET /` and the address of every view.
pub(super) async fn page(State(shared): State<Shared>) -> Response {
    let chosen = match shared.language {
        None => return answer(INDEX.kind, INDEX.content),
        Some(Language::En) => "<html lang=\"en\" data-opens=\"en\">",
        Some(Language::Zh) => "<html lang=\"zh-CN\" data-opens=\"zh\">",
    };
    answer(INDEX.kind, INDEX.content.replacen("<html lang=\"en\">", chosen, 1))
}

/// `GET /web/{file}`: a browser that has this version already is told so.
pub(super) async fn web(Path(name): Path<String>, headers: HeaderMap) -> Response {
    let Some(file) = FILES.iter().find(|file| file.name == name) else {
        return ApiProblem::not_found(&format!("/web/{name}")).into_response();
    };
    let tag = format!("\"{:016x}\"", crate::reload::digest(file.content.as_bytes()));
    let known = headers.get(header::IF_NONE_MATCH).and_then(|value| value.to_str().ok());
    let mut response = if known == Some(tag.as_str()) {
        StatusCode::NOT_MODIFIED.into_response()
    } else {
        answer(file.kind, file.content)
    };
    if let Ok(tag) = HeaderValue::from_str(&tag) {
        response.headers_mut().insert(header::ETAG, tag);
    }
    response
}

pub(super) fn answer(kind: &'static str, content: impl IntoResponse) -> Response {
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(kind)),
        (header::CACHE_CONTROL, HeaderValue::from_static("no-cache")),
        (header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY)),
        (header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
    ];
    (headers, content).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_document_holds_a_script_or_a_style_of_its_own() {
        assert!(!INDEX.content.contains("style=") && !INDEX.content.contains("<style"));
        assert!(
            INDEX.content.matches("<script").count() == INDEX.content.matches("<script type=\"module\" src=").count()
        );
        assert!(!POLICY.contains("unsafe"));
    }

    #[test]
    fn every_file_of_the_page_is_served_under_one_name() {
        let mut names: Vec<_> = FILES.iter().map(|file| file.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), FILES.len());
    }
}
