//! A client of NATS and JetStream: as much as the sink `nats://` and `fleet ingest` need.
//!
//! # Why one of our own
//! The text protocol of NATS has nine verbs, and publishing into JetStream is an ordinary message with the header
//! `Nats-Msg-Id` and a reply subject on which the acknowledgement comes. `async-nats` 0.51 with its least features would add
//! 36 crates to the program (Unicode tables for host names among them) and a second TLS set-up; here are some 600 lines that
//! use the TLS, the certificates and the words of the other sinks. What it leaves out: NKeys and JWT, object and key-value
//! stores, services, WebSocket.
//!
//! | file | what |
//! |---|---|
//! | `target` | servers, TLS and login of an address |
//! | `wire` | bytes from the server to operations; pure |
//! | `connection` | one connection, requests |
//! | `jetstream` | publish with acknowledgement, streams, consumers, fetching |
//! | `words` | what is wrong and what to do next |

mod connection;
mod jetstream;
mod target;
mod wire;
mod words;

pub use connection::{Connection, Message};
pub use jetstream::{Backlog, FetchLimits, JetStreamFailure, Outgoing, StreamSettings};
pub use target::{ClusterAddressError, NatsTarget};

use gateway_base::cannot_run::CannotRun;
use std::fmt;

/// What went wrong with a server, and what to do next.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NatsError {
    /// What happened and where, one sentence without the full stop.
    pub what: String,
    /// What to do next.
    pub next: String,
}

impl From<NatsError> for CannotRun {
    fn from(error: NatsError) -> Self {
        Self::new(error.what, error.next)
    }
}

impl NatsError {
    /// An error from its two parts.
    pub fn new(what: impl Into<String>, next: impl Into<String>) -> Self {
        Self { what: what.into(), next: next.into() }
    }
}

impl fmt::Display for NatsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.next.as_str() {
            "" => f.write_str(&self.what),
            next => write!(f, "{}: {next}", self.what),
        }
    }
}

impl std::error::Error for NatsError {}
