//! What every answer says besides its content: only what this box serves may run or load, nothing may frame it, nothing guesses
//! the type of anything, nobody is told the address a reader came from.

use axum::Router;
use axum::http::header::{self, HeaderName, HeaderValue};
use axum::response::{IntoResponse, Response};
use std::fmt::Write;
use tower_http::set_header::SetResponseHeaderLayer;

use gateway_access::TokenError;

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
pub(super) fn add_headers<S: Clone + Send + Sync + 'static>(router: Router<S>) -> Router<S> {
    ALWAYS.into_iter().fold(router, |router, (name, value)| {
        router.layer(SetResponseHeaderLayer::if_not_present(name, HeaderValue::from_static(value)))
    })
}

/// A page of the box. Where it holds `{{nonce}}`, a number that nobody can foresee takes this place, and style elements with
/// this number are allowed: what an editor makes its style of.
pub(super) fn respond_with_page(html: &str) -> Response {
    let kind = (header::CONTENT_TYPE, HeaderValue::from_static("text/html; charset=utf-8"));
    if !html.contains(PLACE) {
        return ([kind], html.to_owned()).into_response();
    }
    let nonce = create_nonce().unwrap_or_default();
    let policy = POLICY.replacen("style-src 'self'", &format!("style-src 'self' 'nonce-{nonce}'"), 1);
    let policy = HeaderValue::from_str(&policy).unwrap_or(HeaderValue::from_static(POLICY));
    ([kind, (header::CONTENT_SECURITY_POLICY, policy)], html.replace(PLACE, &nonce)).into_response()
}

/// A report that was made to be read anywhere, with its style and script inside. Here nothing inline is allowed, so its style and
/// script get a nonce, and what stands in `style` attributes moves into a style element of its own.
pub(super) fn respond_with_report(html: &str) -> Response {
    let nonce = create_nonce().unwrap_or_default();
    let (html, rules) = without_style_attributes(html);
    let head = format!("<style nonce=\"{nonce}\">{rules}</style></head>");
    let html = html.replacen("<style>", &format!("<style nonce=\"{nonce}\">"), 1);
    let html = html.replacen("<script>", &format!("<script nonce=\"{nonce}\">"), 1).replacen("</head>", &head, 1);
    let policy = format!(
        "default-src 'none'; style-src 'nonce-{nonce}'; script-src 'nonce-{nonce}'; img-src data:; frame-ancestors 'none'; base-uri 'none'"
    );
    let policy = HeaderValue::from_str(&policy).unwrap_or(HeaderValue::from_static(POLICY));
    let kind = HeaderValue::from_static("text/html; charset=utf-8");
    ([(header::CONTENT_TYPE, kind), (header::CONTENT_SECURITY_POLICY, policy)], html).into_response()
}

/// The document with a number in the place of every `style="..."`, and the rules that these numbers stand for.
fn without_style_attributes(html: &str) -> (String, String) {
    let (mut kept, mut rules, mut rest, mut number) = (String::with_capacity(html.len()), String::new(), html, 0_u32);
    while let Some((before, after)) = rest.split_once(" style=\"") {
        let Some((style, after)) = after.split_once('"') else { break };
        let _infallible = write!(kept, "{before} data-style=\"{number}\"");
        let _infallible = write!(rules, "[data-style=\"{number}\"]{{{style}}}");
        (rest, number) = (after, number + 1);
    }
    kept.push_str(rest);
    (kept, rules)
}

fn create_nonce() -> Result<String, TokenError> {
    Ok(gateway_access::random_bytes::<16>()?.iter().fold(String::with_capacity(32), |mut hex, byte| {
        let _infallible = write!(hex, "{byte:02x}");
        hex
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_in_style_attributes_moves_into_a_style_element() {
        let html = "<head><style>a</style></head><i style=\"width:3%\" class=\"x\"></i><b style=\"left:1%\"></b><script>1</script>";
        let (kept, rules) = without_style_attributes(html);
        assert!(!kept.contains(" style=") && kept.contains("<i data-style=\"0\" class=\"x\">"), "{kept}");
        assert_eq!(rules, "[data-style=\"0\"]{width:3%}[data-style=\"1\"]{left:1%}");
        let policy =
            respond_with_report(html).headers()[header::CONTENT_SECURITY_POLICY].to_str().expect("text").to_owned();
        assert!(policy.contains("script-src 'nonce-") && !policy.contains("unsafe"), "{policy}");
    }

    #[test]
    fn a_nonce_is_new_in_every_page_and_stands_in_its_policy() {
        assert!(!POLICY.contains("unsafe"));
        let nonce = |response: &Response| {
            let policy = response.headers()[header::CONTENT_SECURITY_POLICY].to_str().expect("text").to_owned();
            policy.split_once("'nonce-").expect("there").1[..32].to_owned()
        };
        let (one, other) =
            (respond_with_page("<meta content=\"{{nonce}}\">"), respond_with_page("<meta content=\"{{nonce}}\">"));
        assert_ne!(nonce(&one), nonce(&other));
        assert!(
            respond_with_page("<p>").headers().get(header::CONTENT_SECURITY_POLICY).is_none(),
            "the usual one is added later"
        );
    }
}
