//! `doctor` for a sink: connects as the box would, and says what is wrong. Sends nothing.

use super::{SinkAddress, SinkError, open};
use crate::history::{Outbox, OutboxSettings};
use std::time::{Duration, Instant};

/// A receiver that takes longer than this does not answer.
const DEADLINE: Duration = Duration::from_secs(20);

/// What was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// From nothing to ready to send, ms.
    pub connected_ms: f64,
    /// What is wrong.
    pub error: Option<SinkError>,
}

/// Connects to the receiver once.
pub async fn examine(address: &SinkAddress) -> Found {
    let outbox = Outbox::new("doctor", OutboxSettings::default(), []);
    let mut sink = open(address, "doctor", &outbox);
    let began = Instant::now();
    let connected = tokio::time::timeout(DEADLINE, sink.connect()).await;
    let connected_ms = began.elapsed().as_secs_f64() * 1e3;
    let late = || {
        let what = format!("{address} did not become ready within {} s", DEADLINE.as_secs());
        Err(SinkError::line(what, "look whether the receiver is overloaded or a firewall swallows the packets"))
    };
    let error = connected.unwrap_or_else(|_| late()).err();
    // What was not closed in time is closed with the process.
    let _late = tokio::time::timeout(Duration::from_secs(2), sink.close()).await;
    Found { connected_ms, error }
}
