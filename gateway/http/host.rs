//! Is the request meant for this box? A page of another site can make a browser connect here under that site's own name (DNS
//! rebinding); the name then stands in the `Host` header, and nothing is answered under a name that is not ours.

use super::ServerState;
use super::peer::Peer;
use super::problem::ApiProblem;
use axum::extract::{Request, State};
use axum::http::header::HOST;
use axum::http::uri::Authority;
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::net::IpAddr;

/// Refuses what is meant for another host.
pub(super) async fn guard_host(State(shared): State<ServerState>, request: Request, next: Next) -> Response {
    let Some(peer) = request.extensions().get::<Peer>().copied() else {
        return ApiProblem::unavailable("the connection has no address", "connect again").into_response();
    };
    match parse_hosts(&request) {
        Ok(hosts) => {
            let other = hosts.iter().find(|host| !is_ours(host, &peer, &shared.hosts));
            if let Some(other) = other {
                let reason = format!("from {}: asked for host {other:?}", peer.from);
                shared.access.record_refusal(&reason, None);
                return ApiProblem::misdirected_request(other).into_response();
            }
            next.run(request).await
        }
        Err(problem) => problem.into_response(),
    }
}

/// The hosts that the request names: in the header, and in the address where it names one. There must be one.
fn parse_hosts(request: &Request) -> Result<Vec<String>, ApiProblem> {
    let hint = "send one Host header with the address of this box, as every browser does";
    let headers = request.headers().get_all(HOST);
    let mut hosts = Vec::new();
    for value in headers {
        let authority = value.to_str().ok().and_then(|text| text.parse::<Authority>().ok());
        let authority = authority.ok_or_else(|| ApiProblem::bad_request("the Host header cannot be read", hint))?;
        hosts.push(authority.host().to_lowercase());
    }
    if hosts.len() > 1 {
        return Err(ApiProblem::bad_request("there are several Host headers", hint));
    }
    hosts.extend(request.uri().host().map(str::to_lowercase));
    if hosts.is_empty() { Err(ApiProblem::bad_request("the Host header is missing", hint)) } else { Ok(hosts) }
}

/// Is this a name of this box? An address is, when it is the one that was connected to: nobody can give another name to it.
fn is_ours(host: &str, peer: &Peer, allowed: &[String]) -> bool {
    let bare = host.trim_start_matches('[').trim_end_matches(']');
    match bare.parse::<IpAddr>() {
        Ok(address) => address.to_canonical() == peer.to.ip(),
        Err(_) => {
            let name = bare.trim_end_matches('.');
            allowed.iter().any(|known| known == name) || (name == "localhost" && peer.to.ip().is_loopback())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_of_this_box_are_answered() {
        let peer = |to: &str| Peer::new("127.0.0.1:50000".parse().expect("one"), to.parse().expect("one"), false);
        let (local, lan) = (peer("127.0.0.1:8080"), peer("192.168.1.5:443"));
        let allowed = ["gateway.local".to_owned()];
        for (host, peer, ours) in [
            ("127.0.0.1", local, true),
            ("localhost", local, true),
            ("localhost.", local, true),
            ("gateway.local", local, true),
            ("evil.example", local, false),
            ("127.0.0.1.evil.example", local, false),
            ("192.168.1.5", local, false),
            ("192.168.1.5", lan, true),
            ("localhost", lan, false),
            ("[::1]", peer("[::1]:8080"), true),
            ("127.0.0.1", peer("[::ffff:127.0.0.1]:80"), true),
            ("", local, false),
        ] {
            assert_eq!(is_ours(host, &peer, &allowed), ours, "{host}");
        }
    }
}
