//! What every answer says besides its content: only what this box serves may run or load, nothing may frame it, nothing guesses
//! the type of anything, nobody is told the address a reader came from.

use axum::Router;
use axum::http::header::{self, HeaderName, HeaderValue};
use axum::response::{IntoResponse, Response};
use std::fmt::Write;
use tower_http::set_header::SetResponseHeaderLayer;

use crate::access::TokenError;

/// The policy without a nonce. Nothing inline is allowed, neither script nor style.
pub(super) const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; font-src 'self'; \
                                 connect-src 'self'; manifest-src 'self'; form-action 'self'; frame-ancestors 'none'; base-uri 'none'";
/// What stands in a page in the place of the nonce.
const PLACE: &str = "{{nonce}}";

/// Every answer gets these, unless it has its own.
const ALWAYS: [(HeaderName, &str); 7] = [
    (header::CONTENT_SECURITY_POLICY, POLICY),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (header::REFERRER_POLICY, "same-origin"),
    (header::CACHE_CONTROL, "no-store"),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
];

/// Puts the headers on every answer of the router.
pub(super) fn on<S: Clone + Send + Sync + 'static>(router: Router<S>) -> Router<S> {
    ALWAYS.into_iter().fold(router, |router, (name, value)| {
        router.layer(SetResponseHeaderLayer::if_not_present(name, HeaderValue::from_static(value)))
    })
}

/// A page of the box. Where it holds `{{nonce}}`, a number that nobody can foresee takes this place, and style elements with
/// this number are allowed: what an editor makes its style of.
pub(super) fn page(html: &str) -> Response {
    let kind = (header::CONTENT_TYPE, HeaderValue::from_static("text/html; charset=utf-8"));
    if !html.contains(PLACE) {
        return ([kind], html.to_owned()).into_response();
    }
    let nonce = nonce().unwrap_or_default();
    let policy = POLICY.replacen("style-src 'self'", &format!("style-src 'self' 'nonce-{nonce}'"), 1);
    let policy = HeaderValue::from_str(&policy).unwrap_or(HeaderValue::from_static(POLICY));
    ([kind, (header::CONTENT_SECURITY_POLICY, policy)], html.replace(PLACE, &nonce)).into_response()
}

fn nonce() -> Result<String, TokenError> {
    Ok(crate::access::random::<16>()?.iter().fold(String::with_capacity(32), |mut hex, byte| {
        let _infallible = write!(hex, "{byte:02x}");
        hex
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_nonce_is_new_in_every_page_and_stands_in_its_policy() {
        assert!(!POLICY.contains("unsafe"));
        let nonce = |response: &Response| {
            let policy = response.headers()[header::CONTENT_SECURITY_POLICY].to_str().expect("text").to_owned();
            policy.split_once("'nonce-").expect("there").1[..32].to_owned()
        };
        let (one, other) = (page("<meta content=\"{{nonce}}\">"), page("<meta content=\"{{nonce}}\">"));
        assert_ne!(nonce(&one), nonce(&other));
        assert!(page("<p>").headers().get(header::CONTENT_SECURITY_POLICY).is_none(), "the usual one is added later");
    }
}
