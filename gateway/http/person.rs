//! Who asks, as handlers see it, and the cookie by which a browser says so.

use super::peer::Peer;
use super::problem::ApiProblem;
use axum::extract::{FromRequest, FromRequestParts, OptionalFromRequestParts, Request};
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use gateway_access::Person;
use serde::de::DeserializeOwned;
use std::convert::Infallible;

/// The person who is signed in. In a route that only reads take an `Option` of it.
#[derive(Debug, Clone)]
pub(crate) struct SignedIn(pub(crate) Person);

impl<S: Send + Sync> FromRequestParts<S> for SignedIn {
    type Rejection = ApiProblem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, ApiProblem> {
        let nobody = || ApiProblem::unauthorised("nobody is signed in", "sign in at /sign-in");
        parts.extensions.get::<Self>().cloned().ok_or_else(nobody)
    }
}

impl<S: Send + Sync> OptionalFromRequestParts<S> for SignedIn {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Option<Self>, Infallible> {
        Ok(parts.extensions.get::<Self>().cloned())
    }
}

/// A body of JSON. Anything else is refused with the place at which it goes wrong.
#[derive(Debug, Clone)]
pub(crate) struct JsonBody<T>(pub(crate) T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequest<S> for JsonBody<T> {
    type Rejection = ApiProblem;

    async fn from_request(request: Request, state: &S) -> Result<Self, ApiProblem> {
        let kind =
            request.headers().get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or_default();
        let essence = kind.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
        if essence != "application/json" {
            return Err(ApiProblem::media_type(&essence));
        }
        let bytes = axum::body::Bytes::from_request(request, state).await;
        let bytes = bytes.map_err(|error| ApiProblem::bad_request(error.to_string(), "send it again"))?;
        let unusable = |error: &dyn std::fmt::Display| {
            ApiProblem::bad_request(format!("the body cannot be used: {error}"), "/openapi.json describes it")
        };
        // A list in the place of an object would fill its fields in their order.
        if !bytes.trim_ascii_start().starts_with(b"{") {
            return Err(unusable(&"it is no object"));
        }
        serde_json::from_slice(&bytes).map(Self).map_err(|error| unusable(&error))
    }
}

/// Name of the cookie. Over TLS its prefix makes browsers hold it to this host and to TLS.
pub(super) fn name_of_cookie(peer: &Peer) -> &'static str {
    if peer.tls { "__Host-cnc_gateway" } else { "cnc_gateway" }
}

/// The value of a cookie.
pub(super) fn find_cookie<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    let lines = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
    let mut pairs = lines.flat_map(|line| line.split(';')).filter_map(|pair| pair.trim().split_once('='));
    pairs.find(|(key, _)| *key == name).map(|(_, value)| value)
}

/// The header that sets the cookie for so many seconds; 0 removes it. No script can read it, no other site can send it.
pub(super) fn set_cookie(peer: &Peer, value: &str, seconds: u64) -> String {
    let secure = if peer.tls { "; Secure" } else { "" };
    format!("{}={value}; Path=/; Max-Age={seconds}; HttpOnly; SameSite=Strict{secure}", name_of_cookie(peer))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cookie_is_found_among_others() {
        let mut headers = HeaderMap::new();
        headers.append(header::COOKIE, "a=1; cnc_gateway=abc ;b=2".parse().expect("one"));
        assert_eq!(find_cookie(&headers, "cnc_gateway"), Some("abc"));
        assert_eq!(find_cookie(&headers, "cnc"), None);
        let peer = Peer::new("[::1]:9".parse().expect("one"), "[::1]:80".parse().expect("one"), true);
        let set = set_cookie(&peer, "abc", 60);
        assert!(set.contains("Secure") && set.contains("HttpOnly") && set.contains("SameSite=Strict"), "{set}");
    }
}
