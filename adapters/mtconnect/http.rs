//! One request by HTTP/1.1 (RFC 9112) and its answer, on a connection of its own. Only what agents need: `GET`, no encryption, no compression.

use crate::body::BodyDecoder;
use crate::deadline::Deadline;
use crate::multipart::DOCUMENT_BYTES_MAX;
use adapter_core::address::Endpoint;
use adapter_core::percent::escape_percent;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use thiserror::Error;

/// Longest head of an answer, bytes.
const HEAD_BYTES_MAX: usize = 32 << 10;
const HEADERS_MAX: usize = 64;
/// Bytes that are read at once.
pub(crate) const READ_BYTES: usize = 64 << 10;

/// Why there is no answer.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub(crate) enum HttpError {
    #[error("{0}")]
    Line(String),
    #[error("no answer in time")]
    Timeout,
    /// What was sent is no answer by HTTP, or a longer one than is read.
    #[error("{0}")]
    Nonsense(String),
}

/// An answer whose body is still to come.
pub(crate) struct Response {
    pub(crate) status: u16,
    pub(crate) content_type: String,
    /// Where the answer says that it is instead.
    pub(crate) location: Option<String>,
    pub(crate) stream: TcpStream,
    pub(crate) decoder: BodyDecoder,
    /// Bytes behind the head that have come already.
    pub(crate) rest: Vec<u8>,
}

/// Asks for a path with its query, both as they stand in a request.
pub(crate) fn send_request(endpoint: &Endpoint, path: &str, deadline: Deadline) -> Result<Response, HttpError> {
    let mut stream = connect(endpoint, deadline)?;
    let host = if endpoint.host.contains(':') { format!("[{}]", endpoint.host) } else { endpoint.host.clone() };
    let request = format!(
        "GET {path} HTTP/1.1\r\nHost: {host}:{}\r\nAccept: text/xml, application/xml, multipart/x-mixed-replace\r\nUser-Agent: cnc-gateway\r\nConnection: close\r\n\r\n",
        endpoint.port
    );
    stream.set_write_timeout(Some(deadline.silence)).map_err(|error| to_error(&error))?;
    stream.write_all(request.as_bytes()).map_err(|error| to_error(&error))?;
    read_head(stream, deadline)
}

fn connect(endpoint: &Endpoint, deadline: Deadline) -> Result<TcpStream, HttpError> {
    let resolved = (endpoint.host.as_str(), endpoint.port).to_socket_addrs();
    let resolved = resolved.map_err(|error| HttpError::Line(format!("{} is not found: {error}", endpoint.host)))?;
    let mut last = HttpError::Line(format!("{} has no address", endpoint.host));
    for address in resolved {
        let wait = deadline.find_wait().ok_or(HttpError::Timeout)?;
        match TcpStream::connect_timeout(&address, wait) {
            Ok(stream) => {
                stream.set_nodelay(true).map_err(|error| to_error(&error))?;
                return Ok(stream);
            }
            Err(error) => last = to_error(&error),
        }
    }
    Err(last)
}

pub(crate) fn to_error(error: &std::io::Error) -> HttpError {
    match error.kind() {
        ErrorKind::WouldBlock | ErrorKind::TimedOut => HttpError::Timeout,
        _ => HttpError::Line(error.to_string()),
    }
}

/// Reads some bytes; none are the end of the connection.
fn read_some(stream: &mut TcpStream, bytes: &mut [u8], deadline: Deadline) -> Result<usize, HttpError> {
    let wait = deadline.find_wait().ok_or(HttpError::Timeout)?;
    stream.set_read_timeout(Some(wait)).map_err(|error| to_error(&error))?;
    loop {
        match stream.read(bytes) {
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            other => return other.map_err(|error| to_error(&error)),
        }
    }
}

fn read_head(mut stream: TcpStream, deadline: Deadline) -> Result<Response, HttpError> {
    let (mut head, mut bytes) = (Vec::new(), vec![0; 4096]);
    loop {
        let count = read_some(&mut stream, &mut bytes, deadline)?;
        if count == 0 {
            return Err(HttpError::Line("the agent closed the connection without an answer".to_owned()));
        }
        head.extend_from_slice(&bytes[..count]);
        let mut headers = [httparse::EMPTY_HEADER; HEADERS_MAX];
        let mut response = httparse::Response::new(&mut headers);
        match response.parse(&head) {
            Ok(httparse::Status::Complete(end)) => {
                let status = response.code.unwrap_or_default();
                let find = |name: &str| {
                    let header = response.headers.iter().find(|header| header.name.eq_ignore_ascii_case(name));
                    header.map(|header| String::from_utf8_lossy(header.value).trim().to_owned())
                };
                let decoder = choose_decoder(find("transfer-encoding"), find("content-length"))?;
                let (content_type, location) = (find("content-type").unwrap_or_default(), find("location"));
                let rest = head.split_off(end);
                return Ok(Response { status, content_type, location, stream, decoder, rest });
            }
            Ok(httparse::Status::Partial) if head.len() <= HEAD_BYTES_MAX => {}
            Ok(httparse::Status::Partial) => {
                return Err(HttpError::Nonsense("the head of the answer has no end".to_owned()));
            }
            Err(error) => return Err(HttpError::Nonsense(format!("the answer is not HTTP ({error})"))),
        }
    }
}

fn choose_decoder(encoding: Option<String>, length: Option<String>) -> Result<BodyDecoder, HttpError> {
    match (encoding, length) {
        (Some(encoding), _) if encoding.eq_ignore_ascii_case("chunked") => Ok(BodyDecoder::in_chunks()),
        (Some(encoding), _) if !encoding.eq_ignore_ascii_case("identity") => {
            Err(HttpError::Nonsense(format!("the answer comes as {encoding:?}, which was not asked for")))
        }
        (_, Some(length)) => length
            .parse()
            .map(BodyDecoder::with_length)
            .map_err(|_| HttpError::Nonsense(format!("the length of the answer is {length:?}"))),
        (_, None) => Ok(BodyDecoder::until_closed()),
    }
}

impl Response {
    /// The whole body, without its framing.
    pub(crate) fn read_body(mut self, deadline: Deadline) -> Result<Vec<u8>, HttpError> {
        let nonsense = |error: crate::body::BrokenChunk| HttpError::Nonsense(error.to_string());
        let mut body = Vec::new();
        self.decoder.decode_into(&self.rest, &mut body).map_err(nonsense)?;
        let mut bytes = vec![0; READ_BYTES];
        while !self.decoder.is_complete() {
            let count = read_some(&mut self.stream, &mut bytes, deadline)?;
            if count == 0 && self.decoder.may_end() {
                break;
            }
            if count == 0 {
                return Err(HttpError::Line("the connection ended in the middle of the answer".to_owned()));
            }
            self.decoder.decode_into(&bytes[..count], &mut body).map_err(nonsense)?;
            if body.len() > DOCUMENT_BYTES_MAX {
                return Err(HttpError::Nonsense(format!("the answer is longer than {DOCUMENT_BYTES_MAX} bytes")));
            }
        }
        Ok(body)
    }
}

/// A text as a part of a path or a value of a query: everything but what RFC 3986 leaves as it is (section 2.3).
pub(crate) fn escape_path_part(text: &str) -> String {
    escape_percent(text, b"-._~")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_of_a_device_is_escaped() {
        assert_eq!(escape_path_part("M 1/车"), "M%201%2F%E8%BD%A6");
        assert_eq!(escape_path_part("Mazak-01_a.b~"), "Mazak-01_a.b~");
    }

    #[test]
    fn the_framing_follows_the_head() {
        let of = |encoding: Option<&str>, length: Option<&str>| {
            choose_decoder(encoding.map(str::to_owned), length.map(str::to_owned))
        };
        assert_eq!(of(None, Some("7")), Ok(BodyDecoder::with_length(7)));
        assert_eq!(of(Some("Chunked"), Some("7")), Ok(BodyDecoder::in_chunks()));
        assert_eq!(of(None, None), Ok(BodyDecoder::until_closed()));
        assert!(of(Some("gzip"), None).is_err() && of(None, Some("-1")).is_err());
    }
}
