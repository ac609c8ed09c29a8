//! Orders of a person: arm the gate, disarm it, acknowledge a stop or an alarm.
//!
//! A person standing at the box gives them through a socket file in the data directory; a person who is signed in on the page
//! gives them there, where arming needs `allow_arming` under `[http]` and the token once more. No script can give any. The
//! file belongs to the user that the gateway runs as and nobody else can open it (mode 600); who opened it
//! is known by the system (`SO_PEERCRED`) and stands in the audit beside the name that was given. One line of JSON asks, one
//! answers:
//!
//! ```text
//! {"order":"arm","by":"Li Wei","for_s":1800}
//! {"done":true,"text":"armed by Li Wei for 1800 s"}
//! ```
//!
//! | file | what |
//! |---|---|
//! | `server` | listens, checks, hands each order to the tick and answers with what the tick says |
//! | `order_channel` | the way to the tick and back, for the socket, for the page and for the sinks |
//! | `fact` | facts of production that the plant adds, from every door; no order |
//! | `network` | the little that a computer on the network may ask for over a sink; no order |
//! | `outcome` | what became of that in the end, on its way back to the sink |
//! | `client` | `cnc-gateway arm`, `disarm`, `acknowledge` |

mod client;
mod fact;
mod network;
mod order_channel;
mod outcome;
mod server;

pub use client::send_order;
pub use fact::{FACTS_MAX, FactDocument, FactError, FactSender, FactsError, read_facts_csv, read_facts_json};
pub use network::{NetworkRequest, RequestOrigin, RequestRefusal, RequestedChange};
pub use order_channel::{
    FactsRefused, FactsTaken, OrderReceiver, OrderSender, PostedFacts, PostedRequest, PostedRow, Wake, create_queues,
};
pub use outcome::{Ending, OUTCOMES_MAX, OutcomeSender, RequestOutcome};
pub use server::{Listening, listen_for_orders};

use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Name of the socket in the data directory.
const SOCKET: &str = "control.sock";
/// A line may be so long.
const LINE_MAX: u64 = 4096;
/// The tick answers within this time, or does not live.
const ANSWER_WITHIN: Duration = Duration::from_secs(15);
/// Orders that wait for the tick.
const WAITING_MAX: usize = 16;

/// What a person orders; written as one JSON document with the key `order`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "order", rename_all = "snake_case", deny_unknown_fields)]
pub enum Order {
    /// Let the gate write for a time.
    Arm {
        /// Who answers for it.
        by: String,
        /// For so long; without it, as long as the configuration allows.
        for_s: Option<f64>,
    },
    /// Give the machine back to its dial.
    Disarm {
        /// Name of the person who disarms, for the audit.
        by: String,
    },
    /// A feed hold or stop has been seen to: the next one may pass.
    Acknowledge {
        /// Who has seen to it.
        by: String,
    },
    /// An alarm has been seen; it stands until its reason has gone.
    AcknowledgeAlarm {
        /// Who has seen it.
        by: String,
        /// Code of the alarm, as the status shows it.
        code: String,
    },
}

impl Order {
    /// The same with the user that the system knows beside the name.
    fn of_user(mut self, user: Option<u32>) -> Self {
        let (Self::Arm { by, .. } | Self::Disarm { by } | Self::Acknowledge { by } | Self::AcknowledgeAlarm { by, .. }) =
            &mut self;
        *by = match (by.trim(), user) {
            ("", _) | (_, None) => by.trim().to_owned(),
            (name, Some(user)) => format!("{name} (user {user})"),
        };
        self
    }
}

/// What became of it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reply {
    /// Whether the order was carried out.
    pub done: bool,
    /// What was done, or why not, and what to do next.
    pub text: String,
}

impl Reply {
    /// The answer to an order that was carried out; the text says what was done.
    pub fn from_success(text: impl Into<String>) -> Self {
        Self { done: true, text: text.into() }
    }

    /// The answer to an order that was not carried out; the text says why and what to do.
    pub fn from_refusal(text: impl Into<String>) -> Self {
        Self { done: false, text: text.into() }
    }
}

/// An order on its way to the tick, with the way back.
#[derive(Debug)]
pub struct QueuedOrder {
    /// The order with the name of who gives it.
    pub order: Order,
    /// Where the answer goes.
    pub reply: tokio::sync::oneshot::Sender<Reply>,
}

/// Where the socket of this data directory is.
#[must_use]
pub fn socket_path(data_dir: &Path) -> PathBuf {
    data_dir.join(SOCKET)
}
