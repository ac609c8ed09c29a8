//! One connection: encrypted where that is wanted, one request after another, each with its head in time.

use super::slow_reader::Paced;
use super::table::{ConnectionActivity, ConnectionEntry, Waits};
use crate::ApiProblem;
use crate::peer::Peer;
use axum::Router;
use axum::body::{Body, Bytes};
use axum::http::{Request, Response};
use http_body::{Frame, SizeHint};
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper_util::rt::TokioIo;
use std::convert::Infallible;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::sync::watch;
use tokio_rustls::TlsAcceptor;
use tower::ServiceExt;

/// The head of a request is complete so long after its first byte, the first request so long after connecting.
const HEAD_WITHIN: Duration = Duration::from_secs(10);
/// Another request may come so long after the last answer.
const NEXT_WITHIN: Duration = Duration::from_secs(60);
/// How often a connection looks whether its time is over.
const LOOK_EVERY: Duration = Duration::from_millis(250);
/// Head of a request, bytes.
const HEAD_BYTES_MAX: usize = 16 * 1024;
/// Header lines of a request.
const HEADERS_MAX: usize = 64;
/// What is said to a client that is sent away is written within this time.
const FAREWELL_WITHIN: Duration = Duration::from_secs(1);

/// What every connection needs.
pub(super) struct Talk {
    pub(super) tls: Option<TlsAcceptor>,
    pub(super) router: Router,
    pub(super) stopped: watch::Receiver<bool>,
}

impl Talk {
    /// Until the client has gone, has to go, or the box stops.
    pub(super) async fn run(self, stream: TcpStream, from: SocketAddr, entry: ConnectionEntry) {
        let Ok(to) = stream.local_addr() else { return };
        let _as_it_is = stream.set_nodelay(true);
        let line = entry.activity.clone();
        let peer = Peer::new(from, to, self.tls.is_some());
        let talk = async {
            match self.tls.clone() {
                None => self.serve_requests(Paced::new(stream, line.clone()), peer, &line).await,
                Some(acceptor) => {
                    let greeted = tokio::time::timeout(HEAD_WITHIN, acceptor.accept(stream)).await;
                    if let Ok(Ok(stream)) = greeted {
                        self.serve_requests(Paced::new(stream, line.clone()), peer, &line).await;
                    }
                }
            }
        };
        tokio::select! {
            () = talk => {}
            () = line.has_to_go() => {}
        }
        drop(entry);
    }

    async fn serve_requests<S: AsyncRead + AsyncWrite + Unpin>(
        &self,
        stream: S,
        peer: Peer,
        line: &Arc<ConnectionActivity>,
    ) {
        let service = hyper::service::service_fn(|request: Request<Incoming>| {
            line.mark_answering();
            let (line, router) = (line.clone(), self.router.clone());
            async move { Ok::<_, Infallible>(answer_request(router, request, peer, line).await) }
        });
        let mut connection = http1::Builder::new()
            .max_headers(HEADERS_MAX)
            .max_buf_size(HEAD_BYTES_MAX)
            .serve_connection(TokioIo::new(stream), service);
        let mut stopped = self.stopped.clone();
        let mut stopping = false;
        loop {
            tokio::select! {
                _done_or_broken = &mut connection => return,
                () = tokio::time::sleep(LOOK_EVERY) => {}
                () = until_stopped(&mut stopped), if !stopping => {
                    stopping = true;
                    Pin::new(&mut connection).graceful_shutdown();
                }
            }
            match line.wait_state() {
                Waits::Rest(waited) if waited >= HEAD_WITHIN => {
                    return send_timeout(connection.into_parts().io.into_inner()).await;
                }
                Waits::First(waited) if waited >= HEAD_WITHIN => return,
                Waits::Next(waited) if waited >= NEXT_WITHIN => return,
                _ => {}
            }
        }
    }
}

/// Returns when the box stops.
pub(super) async fn until_stopped(stopped: &mut watch::Receiver<bool>) {
    let _stop_or_gone = stopped.wait_for(|stop| *stop).await;
}

/// The head did not come in time.
async fn send_timeout<S: AsyncWrite + Unpin>(mut stream: S) {
    let text = format_response(&ApiProblem::request_timeout(HEAD_WITHIN), "408 Request Timeout");
    let _gone = tokio::time::timeout(FAREWELL_WITHIN, async {
        stream.write_all(text.as_bytes()).await?;
        stream.shutdown().await
    })
    .await;
}

async fn answer_request(
    router: Router,
    request: Request<Incoming>,
    peer: Peer,
    line: Arc<ConnectionActivity>,
) -> Response<TrackedBody> {
    let mut request = request.map(Body::new);
    request.extensions_mut().insert(peer);
    let Ok(response) = router.oneshot(request).await;
    response.map(|body| TrackedBody { body, _line: Answering(line) })
}

/// While it is there, the connection answers.
struct Answering(Arc<ConnectionActivity>);

impl Drop for Answering {
    fn drop(&mut self) {
        self.0.mark_waiting();
    }
}

/// A body that tells the book when it has gone.
struct TrackedBody {
    body: Body,
    _line: Answering,
}

impl http_body::Body for TrackedBody {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        Pin::new(&mut self.body).poll_frame(context)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

/// A problem as the text of a whole answer, for where there is no request to answer.
pub(crate) fn format_response(problem: &ApiProblem, status: &str) -> String {
    let body = serde_json::to_string(problem).unwrap_or_default();
    let length = body.len();
    format!(
        "HTTP/1.1 {status}\r\nContent-Type: application/problem+json\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{body}"
    )
}
