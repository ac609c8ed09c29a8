//! How each sink is doing, for the status, the page and the metrics.

use adapter_core::histogram::Histogram;
use serde::Serialize;

/// How one sink is doing now.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SinkStatus {
    /// Its name in the configuration.
    pub name: String,
    /// Its address as it was written; it holds no password.
    pub address: String,
    /// `waiting` (for the history, or for the next try), `connecting`, `connected`, `stopped`.
    pub state: &'static str,
    /// Items it has not delivered.
    pub behind_items: u64,
    /// How much older than the newest item the oldest undelivered one is, s; 0 when nothing waits, `null` when not known.
    pub behind_s: Option<f64>,
    /// Items delivered since the start.
    pub delivered: u64,
    /// From the time of the newest delivered item to its delivery, s; of live data only.
    pub delay_s: Option<f64>,
    /// The same of all batches of live data; for the metrics.
    #[serde(skip)]
    pub delays: Histogram,
    /// Items that the bounds of the outbox dropped before they were delivered, since the sink was first configured.
    pub dropped: u64,
    /// Items that the receiver will never take, since the start.
    pub refused: u64,
    /// Connections since the start.
    pub connections: u64,
    /// How long an outage fits at the present rate, hours; `null` in the first minute.
    pub outage_fits_h: Option<f64>,
    /// What is wrong and what to do; `null` while it is connected.
    pub error: Option<String>,
    /// The last item that the receiver would not take, why, and what to do; it was left out.
    pub refusal: Option<String>,
    /// Does the error last?
    pub failing: bool,
}
