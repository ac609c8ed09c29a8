//! `doctor` for a sink: connects as the box would, and says what is wrong. Sends nothing.

use super::{Requests, SinkAddress, SinkError, open_sink};
use gateway_history::{Outbox, OutboxSettings};
use serde_json::json;
use std::path::Path;
use std::time::{Duration, Instant};

/// A receiver that takes longer than this does not answer.
const DEADLINE: Duration = Duration::from_secs(20);

/// Whether a receiver takes what the box sends, and how long connecting took.
#[derive(Debug, Clone, PartialEq)]
pub struct SinkFinding {
    /// From nothing to ready to send, ms.
    pub connected_ms: f64,
    /// Why it takes nothing; `None`: it is ready.
    pub error: Option<SinkError>,
}

/// Connects to the receiver once.
pub async fn examine_sink(address: &SinkAddress) -> SinkFinding {
    let outbox = Outbox::new("doctor", OutboxSettings::default(), []);
    let mut sink = open_sink(address, ("doctor", Requests::without_gate()), &outbox, Path::new(""));
    let began = Instant::now();
    let connected = tokio::time::timeout(DEADLINE, sink.probe_receiver()).await;
    let connected_ms = began.elapsed().as_secs_f64() * 1e3;
    let late = || {
        let what = format!("{address} did not become ready within {} s", DEADLINE.as_secs());
        Err(SinkError::failed_line(what, "look whether the receiver is overloaded or a firewall swallows the packets"))
    };
    let error = connected.unwrap_or_else(|_| late()).err();
    SinkFinding { connected_ms, error }
}

impl SinkFinding {
    /// Address, reachability, time and problem as JSON.
    #[must_use]
    pub fn to_json(&self, address: &SinkAddress) -> serde_json::Value {
        let problem = |error: &SinkError| {
            let (what, next) = error.as_parts();
            json!({"what": what, "next": next})
        };
        json!({
            "address": address.text(),
            "reachable": self.error.is_none(),
            "timing": {"connected_ms": (self.connected_ms * 10.0).round() / 10.0},
            "problems": self.error.iter().map(problem).collect::<Vec<_>>(),
        })
    }
}
