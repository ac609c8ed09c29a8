//! A host and port, and the vendor library beside it.

use super::keys::Keys;
use super::problem::AddressProblem;
use std::path::PathBuf;

/// A host and port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Endpoint {
    /// Name or number of the host, without brackets.
    pub host: String,
    /// TCP port from 1 to 65535.
    pub port: u16,
}

/// Host and port of `//HOST:PORT`, or of `HOST` with the default port.
///
/// # Errors
/// [`AddressProblem::Secret`], [`AddressProblem::NoHost`] or [`AddressProblem::NoPort`].
pub fn parse_endpoint(body: &str, default_port: Option<u16>) -> Result<Endpoint, AddressProblem> {
    let text = body.strip_prefix("//").unwrap_or(body).trim_end_matches('/');
    if text.contains('@') {
        return Err(AddressProblem::Secret);
    }
    let (host, port) = split_port(text);
    let host = host.trim_start_matches('[').trim_end_matches(']');
    if host.is_empty() || host.contains('/') {
        return Err(AddressProblem::NoHost(text.to_owned()));
    }
    let port = match port {
        Some(port) => port.parse().ok().filter(|port| *port > 0),
        None => default_port,
    };
    let port = port.ok_or_else(|| AddressProblem::NoPort(text.to_owned()))?;
    Ok(Endpoint { host: host.to_owned(), port })
}

/// Splits at the last colon, unless it belongs to a bracketed IPv6 address.
fn split_port(text: &str) -> (&str, Option<&str>) {
    match text.rsplit_once(':') {
        Some((host, port)) if !port.contains(']') => (host, Some(port)),
        _ => (text, None),
    }
}

/// The key `library`: the vendor's library.
///
/// # Errors
/// [`AddressProblem::NoLibrary`].
pub fn parse_library(keys: &mut Keys) -> Result<PathBuf, AddressProblem> {
    keys.take_text("library").map(PathBuf::from).ok_or(AddressProblem::NoLibrary)
}
