//! A small synchronous MQTT client for 3.1.1 and 5: what a driver or a sink needs of a broker, and nothing else.
//!
//! - Quality of service 0 and 1, clean session, keep-alive, user and password, TLS with client certificates, a will,
//!   retained messages. No session that outlives the connection: the protocols above ask or send again after a reconnect.
//! - Many messages may be on their way at once ([`MqttClient::publish_all`]): a line with a round trip of 50 ms would
//!   otherwise carry 20 messages a second.
//! - `TCP_NODELAY` is on: without it a small request waits for the acknowledgement of the one before, 40 ms and more.
//! - One thread per connection reads, answers the broker and fills a bounded queue, so that a message is stamped when it
//!   arrives and not when somebody has time for it. When nobody takes, the oldest message goes and is counted.
//! - A connection that broke stays broken ([`MqttClient::receive_message`] tells why); the caller connects again, and the name of the
//!   broker is looked up again then.
//!
//! Limits: a packet of at most [`PACKET_MAX`] bytes, a queue of at most [`QUEUE_MESSAGES`] messages and [`QUEUE_BYTES`].
//!
//! Sources: MQTT Version 3.1.1, OASIS Standard, 29 October 2014 (sections are named beside the code), and MQTT Version 5.0,
//! OASIS Standard, 7 March 2019 (sections are named with a 5 before them).

mod client;
mod inbox;
mod incoming;
mod packet;
mod publishing;
mod reader;
mod words;

pub use client::MqttClient;
pub use packet::Qos;
pub use publishing::Outgoing;

use device_line::tls::{TlsError, TlsFiles};
use std::time::{Duration, Instant};
use thiserror::Error;

/// A packet is refused when it is longer than this.
pub const PACKET_MAX: usize = 8 * 1024 * 1024;
/// At most so many messages wait to be taken.
pub const QUEUE_MESSAGES: usize = 4096;
/// At most so many bytes of payload wait to be taken.
pub const QUEUE_BYTES: usize = 32 * 1024 * 1024;

/// The version that is spoken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Version {
    /// MQTT 3.1.1, which every broker speaks.
    #[default]
    V3,
    /// MQTT 5, in which a broker says why it refuses something.
    V5,
}

/// What the broker publishes in our name when the connection breaks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Will {
    /// The topic under which the broker publishes it.
    pub topic: String,
    /// The bytes that the broker publishes.
    pub payload: Vec<u8>,
    /// How hard it is delivered.
    pub qos: Qos,
    /// Does the broker keep it for later subscribers?
    pub retain: bool,
    /// Is it published, too, when the client leaves by itself? Only version 5 can say so.
    pub at_leave: bool,
}

/// How to talk to a broker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// Host name or number.
    pub host: String,
    /// TCP port of the broker.
    pub port: u16,
    /// Name of this client at the broker; another client of the same name is thrown out by the broker.
    pub client_id: String,
    /// User and password, where the broker wants them.
    pub login: Option<(String, String)>,
    /// The version that is spoken.
    pub version: Version,
    /// TLS, where the line is secured. The files are read at every connection: renewed ones count from the next on.
    pub tls: Option<TlsFiles>,
    /// What the broker publishes when the connection breaks.
    pub will: Option<Will>,
    /// Longest silence: half of it without a packet and the broker is asked for a sign of life.
    pub keep_alive: Duration,
    /// Longest wait for the connection and for each acknowledgement.
    pub deadline: Duration,
}

impl Options {
    /// A client with a name that nobody else has, 20 s of keep-alive and a deadline of 2 s.
    #[must_use]
    pub fn new(host: &str, port: u16, role: &str) -> Self {
        let client_id = format!("{role}-{}", adapter_core::unique_id::generate_unique_id());
        let (keep_alive, deadline) = (Duration::from_secs(20), Duration::from_secs(2));
        let (version, tls, will, login) = (Version::default(), None, None, None);
        Self { host: host.to_owned(), port, client_id, login, version, tls, will, keep_alive, deadline }
    }
}

/// One message of a subscription.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MqttMessage {
    /// The topic under which it was published.
    pub topic: String,
    /// The bytes as they came.
    pub payload: Vec<u8>,
    /// When its last byte had arrived.
    pub arrived: Instant,
    /// Did the broker keep it from before the subscription?
    pub retained: bool,
}

/// Why the broker cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum MqttError {
    /// No connection to the broker.
    #[error("no connection to the broker {broker}: {what}")]
    Unreachable {
        /// Host and port of the broker.
        broker: String,
        /// What the system said.
        what: String,
    },
    /// The other side cannot be trusted, or does not trust us.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// The broker refused the connection, a subscription or a message.
    #[error("the broker refuses: {0}")]
    Refused(String),
    /// The connection broke; the text says why.
    #[error("the connection to the broker broke: {0}")]
    Closed(String),
    /// The broker did not acknowledge in time.
    #[error("the broker did not acknowledge {what} within {deadline_ms} ms")]
    Unacknowledged {
        /// What was to be acknowledged.
        what: &'static str,
        /// How long was waited.
        deadline_ms: u128,
    },
    /// The message cannot be sent at all.
    #[error("the message cannot be sent: {0}")]
    Unsendable(String),
}

impl MqttError {
    /// What to do next.
    #[must_use]
    pub fn next(&self) -> &str {
        match self {
            Self::Unreachable { .. } => "Check that the broker runs there and that the network lets its port through.",
            Self::Tls(error) => &error.next,
            Self::Refused(_) => "Check user and password_file in the address, and what the broker allows this user.",
            Self::Closed(_) => "Look at the broker's log; two clients of one name throw each other out.",
            Self::Unacknowledged { .. } => "Look whether the broker is overloaded, and whether this port speaks MQTT.",
            Self::Unsendable(_) => "Shorten what is sent, or raise the broker's limit.",
        }
    }
}
