//! A vendor's library in a child process of its own: it may abort, hang, overrun its buffers or print, and the gateway
//! goes on.
//!
//! ```text
//!   gateway ── Supervised ──► [length, bytes] ──► child: serve ──► handler ──► the library
//!                 │          one socket pair, the child's standard input
//!                 └─ deadline per request, kill, restart, counts
//! ```
//!
//! The child is this same program started with a hidden subcommand, so that nothing else has to be installed. Its
//! standard input is one end of a socket pair on which requests and answers travel; standard output and error go
//! nowhere, because such libraries print there. A request and its answer are bytes of the user's own choosing, at most
//! [`MESSAGE_MAX`] of them, each behind its length. One request is outstanding; it may have several answers, which come as
//! the child has them, so that it is known at which of them it died. The child is single-threaded: a handle that is bound
//! to its thread stays where it was made.
//!
//! When an answer does not come in time, or the child is gone, it is killed and waited for, and the next request
//! starts another one, after a pause that doubles from [`ChildSettings::pause_min`] to [`ChildSettings::pause_max`]
//! (within five seconds) while it keeps dying. A child whose parent is gone reads the end of its input and ends.
//!
//! | file | what |
//! |---|---|
//! | `message` | length and bytes, bounded |
//! | `supervise` | the parent's side |
//! | `serve` | the child's side |
//! | `client` | the parent's side with words of one's own, and what the library did not survive |
//! | `guard` | buffers around what a library fills in, with a margin that shows an overrun |
//! | `ffi` | loading, symbols and calls: the only `unsafe` |

mod client;
mod ffi;
mod guard;
mod message;
mod serve;
mod supervise;

#[cfg(test)]
mod tests;

pub use crate::vendor_functions as functions;
pub use client::{ChildClient, Taken};
pub use ffi::{Argument, LoadError, Missing, Returned};
pub use guard::{Guarded, MARGIN_LEN, Overrun};
#[doc(hidden)]
pub use libloading::Library;
pub use message::MESSAGE_MAX;
pub use serve::{SUBCOMMAND, serve_requests, serve_words};
pub use supervise::{ChildCounts, ChildError, ChildSettings, Supervised};
