//! Connections: how many there may be, who has to go when there are too many, how slowly one may ask and read.
//!
//! There are at most [`CONNECTIONS_MAX`] connections, fewer where the system gives the process few files. When another one
//! comes, the oldest of those that are only waiting - for the rest of a request, or for the next one - is closed, of the
//! address that has most of them; so neither a thousand half-open connections nor a hundred idle ones keep anybody out. One
//! address has at most [`OF_ONE_MAX`]. A request whose head is not complete in time is told so (408) and closed; whoever does
//! not read what was asked for is closed without a word.
//!
//! | file | what |
//! |---|---|
//! | `table` | which connections there are, and which one has to go |
//! | `slow_reader` | a stream that is not waited for longer than so when it takes nothing |
//! | `talk` | one connection: TLS, heads in time, one request after another |
//! | `tls` | certificate and key: the user's own, or made at the first start |

mod slow_reader;
mod table;
mod talk;
mod tls;

pub use tls::{Certificate, CertificateError};

use super::ApiProblem;
use crate::connection::talk::format_response;
use axum::Router;
use gateway_base::convert::clamp_to_length;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use std::io::Write;
use std::sync::Arc;
use std::time::Duration;
use table::ConnectionTable;
use talk::Talk;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, watch};
use tokio::task::JoinSet;
use tokio_rustls::TlsAcceptor;

/// Connections of all addresses at once.
const CONNECTIONS_MAX: usize = 256;
/// Connections of one address at once.
const OF_ONE_MAX: usize = 96;
/// Files that the rest of the box needs: history, sources, scripts, the control socket.
const FILES_OF_THE_BOX: usize = 256;
/// Connections that are being closed while others take their place.
const CLOSING_MAX: usize = 32;
/// After a connection that could not be taken: the process or the system is short of files for a moment.
const PAUSE: Duration = Duration::from_millis(50);
/// At the end so long is waited for answers that are under way.
const CLOSE_WITHIN: Duration = Duration::from_millis(1500);

/// Lets the process open as many files as the system allows it, and gives how many connections that leaves room for.
fn raise_connection_limit() -> usize {
    let limit = getrlimit(Resource::Nofile);
    // Where the limit cannot be raised, what there is has to do.
    let _as_it_is = setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, maximum: limit.maximum });
    let files = getrlimit(Resource::Nofile).current.map_or(usize::MAX, clamp_to_length);
    files.saturating_sub(FILES_OF_THE_BOX + CLOSING_MAX).clamp(8, CONNECTIONS_MAX)
}

/// Serves until `stopped` says so.
pub(super) async fn serve_connections(
    listener: TcpListener,
    tls: Option<TlsAcceptor>,
    router: Router,
    mut stopped: watch::Receiver<bool>,
) {
    let most = raise_connection_limit();
    let (book, files) =
        (ConnectionTable::new(most, OF_ONE_MAX.min(most)), Arc::new(Semaphore::new(most + CLOSING_MAX)));
    let mut tasks = JoinSet::new();
    loop {
        let Ok(file) = files.clone().acquire_owned().await else { break };
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            () = talk::until_stopped(&mut stopped) => break,
        };
        let Ok((stream, from)) = accepted else {
            tokio::time::sleep(PAUSE).await;
            continue;
        };
        while tasks.try_join_next().is_some() {}
        let Some(entry) = book.register_connection(from.ip().to_canonical()) else {
            turn_away(stream);
            continue;
        };
        let talk = Talk { tls: tls.clone(), router: router.clone(), stopped: stopped.clone() };
        tasks.spawn(async move {
            talk.run(stream, from, entry).await;
            drop(file);
        });
    }
    drop(listener);
    let _gave_up = tokio::time::timeout(CLOSE_WITHIN, async { while tasks.join_next().await.is_some() {} }).await;
}

/// Every connection is busy with an answer: says so, as far as that goes without waiting.
fn turn_away(stream: TcpStream) {
    let problem = ApiProblem::unavailable("the box talks to as many clients as it can", "close a page, or try again");
    if let Ok(mut stream) = stream.into_std() {
        let _gone = stream.write_all(format_response(&problem, "503 Service Unavailable").as_bytes());
    }
}
