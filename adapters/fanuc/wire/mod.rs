//! FOCAS2/Ethernet on the wire: frames, blocks and numbers. Pure; nothing here knows a socket.
//!
//! A frame is `A0 A0 A0 A0 | version u16 | kind u16 | length u16 | body`, every integer big-endian. The client writes
//! version 1; the controller's version word names its generation (2 older, 3 and 4 newer) and selects encodings. The
//! body of a request and of its answer is a count and as many blocks; every block is one question, so that everything
//! that is polled travels in one frame.
//!
//! Limits: a body of at most [`BODY_MAX`] bytes and [`BLOCKS_MAX`] blocks is looked at, whatever its length says.

mod block;
mod cursor;
mod frame;
mod number;

#[cfg(test)]
mod tests;

pub use block::{CncOrPmc, Reply, ReplyBlock, Request, parse_replies, parse_requests, reply_body, request_body};
pub use cursor::Cursor;
pub use frame::{FocasFrame, FocasHeader, FrameKind, HEADER_LEN, encode_frame};
pub use number::Number;

use thiserror::Error;

/// Longest body that is accepted; controllers send at most 3470 bytes.
pub const BODY_MAX: usize = 8192;

/// Most blocks of one frame.
pub const BLOCKS_MAX: usize = 256;

/// What makes bytes no frame of this protocol.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum WireError {
    /// The four bytes at the beginning are others.
    #[error("the frame begins with {0:02x?} in place of a0 a0 a0 a0; something else answers on this port")]
    Magic([u8; 4]),
    /// A kind of frame that is not known.
    #[error("kind of frame {0:04x} is not known")]
    Kind(u16),
    /// The length is beyond what is accepted.
    #[error("a body of {0} bytes; at most {BODY_MAX} are accepted")]
    TooLong(usize),
    /// The bytes end before the structure does.
    #[error("{what}: {needed} bytes are needed where {left} are left")]
    Short {
        /// What was being read.
        what: &'static str,
        /// Bytes that are needed for it.
        needed: usize,
        /// Bytes that are there.
        left: usize,
    },
    /// Bytes are left over.
    #[error("{what}: {left} bytes are left over")]
    Long {
        /// What was being read.
        what: &'static str,
        /// Bytes that nothing was read from.
        left: usize,
    },
    /// A count or length that contradicts another.
    #[error("{what}: {found} where {expected} was expected")]
    Mismatch {
        /// What was compared, in words.
        what: &'static str,
        /// The number that was expected.
        expected: i64,
        /// The number that came instead.
        found: i64,
    },
}
