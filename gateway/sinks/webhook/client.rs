//! One HTTP/1.1 connection to the receiver.

use super::SinkError;
use crate::alarms::KeptConnection;
use adapter_core::address::Endpoint;
use device_line::tls::TlsFiles;
use hmac::{Hmac, KeyInit, Mac};
use http_body_util::{BodyExt, Full, Limited};
use hyper::body::Bytes;
use hyper::client::conn::http1::{self, SendRequest};
use hyper::{Request, header};
use hyper_util::rt::TokioIo;
use sha2::Sha256;
use std::fmt::Write;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_rustls::TlsConnector;
use tokio_rustls::rustls::pki_types::ServerName;

/// Connecting and each answer may take this long: a slow line over a mobile network.
const DEADLINE: Duration = Duration::from_secs(10);
/// Of an answer so much is read, and nothing of it is looked at.
const ANSWER_BYTES_MAX: usize = 64 * 1024;

/// A message that is ready to go.
pub(super) struct Post(Request<Full<Bytes>>);

impl Post {
    /// The body, with its key and its signature.
    pub(super) fn new(path: &str, at: &Endpoint, body: Vec<u8>, key: &str, secret: &[u8]) -> Self {
        let signature = format!("sha256={}", sign_body(secret, &body));
        let mut request = Request::new(Full::new(Bytes::from(body)));
        *request.method_mut() = hyper::Method::POST;
        // The address has been parsed with this path.
        *request.uri_mut() = path.parse().unwrap_or_default();
        let headers = [
            (header::HOST, format_place(at)),
            (header::CONTENT_TYPE, "application/json".to_owned()),
            (header::USER_AGENT, concat!("cnc-gateway/", env!("CARGO_PKG_VERSION")).to_owned()),
            (header::HeaderName::from_static("idempotency-key"), key.to_owned()),
            (header::HeaderName::from_static("x-signature-256"), signature),
        ];
        for (name, value) in headers {
            // Names of boxes are letters, digits and hyphens; a host is none that a header could not hold.
            if let Ok(value) = header::HeaderValue::from_str(&value) {
                request.headers_mut().insert(name, value);
            }
        }
        Self(request)
    }
}

/// HMAC-SHA256 of the body (RFC 2104, FIPS 180-4) as hexadecimal digits.
fn sign_body(secret: &[u8], body: &[u8]) -> String {
    let Ok(mut mac) = Hmac::<Sha256>::new_from_slice(secret) else { unreachable!("HMAC takes a key of any length") };
    mac.update(body);
    let mut digits = String::with_capacity(64);
    for byte in mac.finalize().into_bytes() {
        let _infallible = write!(digits, "{byte:02x}");
    }
    digits
}

/// A connection that stands.
pub(super) struct HttpConnection(SendRequest<Full<Bytes>>);

impl KeptConnection for HttpConnection {
    /// False where the receiver has closed it.
    async fn is_ready(&mut self) -> bool {
        self.0.ready().await.is_ok()
    }
}

impl HttpConnection {
    /// Connects, with TLS where there are files of it.
    pub(super) async fn open_connection(at: &Endpoint, tls: Option<&TlsFiles>) -> Result<Self, SinkError> {
        let opened = timeout(DEADLINE, Self::open_now(at, tls)).await;
        opened.unwrap_or_else(|_| Err(broken(at, &format!("no connection within {} s", DEADLINE.as_secs()))))
    }

    async fn open_now(at: &Endpoint, tls: Option<&TlsFiles>) -> Result<Self, SinkError> {
        let config = tls.map(TlsFiles::build_config).transpose();
        let config = config.map_err(|error| SinkError::failed_line(error.what, error.next))?;
        let failed = |error: std::io::Error| broken(at, &error.to_string());
        let stream = TcpStream::connect((at.host.as_str(), at.port)).await.map_err(failed)?;
        stream.set_nodelay(true).map_err(failed)?;
        let Some(config) = config else { return Self::begin_http(stream, at).await };
        let name = ServerName::try_from(at.host.clone()).map_err(|error| broken(at, &error.to_string()))?;
        let secured = TlsConnector::from(config).connect(name, stream).await.map_err(failed)?;
        Self::begin_http(secured, at).await
    }

    async fn begin_http<T>(stream: T, at: &Endpoint) -> Result<Self, SinkError>
    where
        T: AsyncRead + AsyncWrite + Send + Unpin + 'static,
    {
        let (sender, connection) =
            http1::handshake(TokioIo::new(stream)).await.map_err(|error| broken(at, &error.to_string()))?;
        // It ends with the sender; what it ends with is told by the request that was on its way.
        tokio::spawn(async move { drop(connection.await) });
        Ok(Self(sender))
    }

    /// Sends the message and gives the status of the answer.
    pub(super) async fn send_post(&mut self, post: Post, at: &Endpoint) -> Result<u16, SinkError> {
        let exchange = async {
            let answer = self.0.send_request(post.0).await?;
            let status = answer.status().as_u16();
            // Read, so that the connection can carry the next request; where that fails the next one is carried by another.
            let _read = Limited::new(answer.into_body(), ANSWER_BYTES_MAX).collect().await;
            Ok::<u16, hyper::Error>(status)
        };
        match timeout(DEADLINE, exchange).await {
            Ok(answered) => answered.map_err(|error| broken(at, &error.to_string())),
            Err(_late) => Err(broken(at, &format!("no answer within {} s", DEADLINE.as_secs()))),
        }
    }
}

/// `host:port`, with brackets around an address of IPv6.
pub(crate) fn format_place(at: &Endpoint) -> String {
    let Endpoint { host, port } = at;
    if host.contains(':') { format!("[{host}]:{port}") } else { format!("{host}:{port}") }
}

fn broken(at: &Endpoint, what: &str) -> SinkError {
    SinkError::failed_line(
        format!("webhook at {}: {what}", format_place(at)),
        "look whether the receiver runs and can be reached from here",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_signature_is_that_of_rfc_4231() {
        // RFC 4231, test cases 2 and 6: a short key, and one that is longer than a block.
        assert_eq!(
            sign_body(b"Jefe", b"what do ya want for nothing?"),
            "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843"
        );
        assert_eq!(
            sign_body(&[0xaa; 131], b"Test Using Larger Than Block-Size Key - Hash Key First"),
            "60e431591ee0b67f0d8a26aacbf5b77f8e0bc6213728c5140546040f0ee37f54"
        );
    }
}
