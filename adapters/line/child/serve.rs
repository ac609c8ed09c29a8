//! The child's side: requests from standard input, answers back on the same socket.

use super::message;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::io::ErrorKind;
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;

/// The hidden subcommand with which the program starts as a child: `cnc-gateway vendor-child KIND ARGUMENT...`.
pub const SUBCOMMAND: &str = "vendor-child";

/// Answers requests until the parent is gone. `handler` gives the answers to a request, each as soon as it has it; it is
/// never called from another thread.
///
/// # Errors
/// Standard input is no socket of a parent, or the line failed in another way than by the parent's going.
pub fn serve_requests(mut handler: impl FnMut(&[u8], &mut dyn FnMut(&[u8]))) -> std::io::Result<()> {
    let mut stream = UnixStream::from(std::io::stdin().as_fd().try_clone_to_owned()?);
    loop {
        let request = match message::receive(&mut stream) {
            Err(error) if is_disconnect(error.kind()) => return Ok(()),
            other => other?,
        };
        let mut sent = Ok(());
        handler(&request, &mut |answer| {
            if sent.is_ok() {
                sent = message::send(&mut stream, answer);
            }
        });
        match sent {
            Err(error) if is_disconnect(error.kind()) => return Ok(()),
            other => other?,
        }
    }
}

/// The same in words of one's own, as JSON: small, and legible in a debugger. What cannot be read is an `Err`
/// that says where.
///
/// # Errors
/// As [`serve_requests`].
pub fn serve_words<Ask: DeserializeOwned, Tell: Serialize>(
    mut handler: impl FnMut(Result<Ask, serde_json::Error>, &mut dyn FnMut(&Tell)),
) -> std::io::Result<()> {
    serve_requests(|request, give| {
        handler(serde_json::from_slice(request), &mut |told| {
            give(&serde_json::to_vec(told).unwrap_or_default());
        });
    })
}

fn is_disconnect(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::UnexpectedEof | ErrorKind::BrokenPipe | ErrorKind::ConnectionReset)
}
