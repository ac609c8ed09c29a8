//! Length and bytes, bounded.

use adapter_core::integer::widen_to_usize;
use std::io::{Error, ErrorKind, Read, Result, Write};

/// Longest request or answer.
pub const MESSAGE_MAX: usize = 256 * 1024;

/// Distinguishes the protocol from whatever else might be on the line.
const MARK: [u8; 4] = *b"cncg";

/// Sends one message.
///
/// # Errors
/// Too long, or the other side is gone.
pub(super) fn send(stream: &mut impl Write, bytes: &[u8]) -> Result<()> {
    let long = || Error::new(ErrorKind::InvalidInput, format!("a message of {} bytes is too long", bytes.len()));
    let length = u32::try_from(bytes.len()).ok().filter(|_| bytes.len() <= MESSAGE_MAX).ok_or_else(long)?;
    let whole = [&MARK[..], &length.to_le_bytes(), bytes].concat();
    stream.write_all(&whole)?;
    stream.flush()
}

/// Bytes before a message.
const HEAD_LEN: usize = 8;

/// The length that a head announces.
///
/// # Errors
/// It is no head, or announces too much.
fn parse_length(head: [u8; HEAD_LEN]) -> Result<usize> {
    let [a, b, c, d, length @ ..] = head;
    let length = widen_to_usize(u32::from_le_bytes(length));
    match [a, b, c, d] == MARK && length <= MESSAGE_MAX {
        true => Ok(length),
        false => Err(Error::new(ErrorKind::InvalidData, "the message begins with something else")),
    }
}

/// The first message of what has arrived, with the bytes it takes; `None` when it is not whole yet.
///
/// # Errors
/// What has arrived is no message.
pub(super) fn split_first_message(arrived: &[u8]) -> Result<Option<(&[u8], usize)>> {
    let Some(head) = arrived.first_chunk::<HEAD_LEN>() else { return Ok(None) };
    let end = HEAD_LEN + parse_length(*head)?;
    Ok(arrived.get(HEAD_LEN..end).map(|bytes| (bytes, end)))
}

/// Receives one message, however long it takes.
///
/// # Errors
/// The other side is gone or sends something else.
pub(super) fn receive(stream: &mut impl Read) -> Result<Vec<u8>> {
    let mut head = [0; HEAD_LEN];
    stream.read_exact(&mut head)?;
    let mut bytes = vec![0; parse_length(head)?];
    stream.read_exact(&mut bytes)?;
    Ok(bytes)
}
