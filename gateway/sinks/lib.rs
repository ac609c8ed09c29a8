//! What leaves the box: one task per `[[sink]]`, each with its own position in the [outbox](gateway_history::Outbox).
//!
//! # How a sink is written
//! A receiver is one type that implements [`Sink`]: connect, send some items, look after an idle connection. Everything
//! else is common: [`drive`] reads the outbox, keeps the position, tries again with growing pauses, sends live data before
//! what an outage left behind, and tells how it goes. An address names the receiver ([`SinkAddress`]); [`open_sink`] makes
//! the sink of an address.
//!
//! # What is promised
//! Every item is sent at least once, unless the bounds of the outbox dropped it (counted) or the receiver will never take
//! it (counted). Its number makes a second delivery recognisable. A box that is killed repeats at most what it had
//! sent in the last five seconds. Live data never waits for old data: after an outage the sink goes on with what is new, and
//! what is missing follows in pieces of [`Sink::items_max`] between two live ones.
//!
//! Sinks run on tokio and read the history on connections of their own. No sink can hold up the tick or the writer.

pub mod address;
pub mod alarms;
mod board;
pub mod broker;
pub mod doctor;
pub mod drive;
mod isolation;
mod listen;
pub mod mail;
pub mod mqtt;
pub mod nats;
#[cfg(feature = "opcua")]
pub mod opcua;
pub mod open;
pub mod parquet;
mod requests;
mod resend;
mod sent_numbers;
pub mod shdr;
pub mod sink_config;
pub mod sparkplug;
pub mod status;
mod target_error;
pub mod webhook;

pub use address::{SinkAddress, SinkTarget};
pub use board::Board;
pub use drive::{Sinks, start_sinks};
pub use open::open_sink;
pub use requests::Requests;
pub use resend::Resender;
pub use status::SinkStatus;

use adapter_core::clock::TimeNs;
use gateway_history::Item;
use std::fmt;
use std::pin::Pin;

/// A future that a sink gives back: write `Box::pin(async move { ... })`.
pub type Pending<'a, T> = Pin<Box<dyn Future<Output = T> + Send + 'a>>;

/// Some items on their way.
#[derive(Debug, Clone, Copy)]
pub struct Batch<'a> {
    /// In the order of their numbers; never empty.
    pub items: &'a [Item],
    /// These are older than what has been sent already: they fill the gap that an outage left.
    pub historical: bool,
}

/// One receiver.
///
/// The futures may be dropped at any point where they wait (the box stops, or a deadline is over); the next call is then
/// [`Sink::connect`] or [`Sink::close`]. [`Sink::wait_for_receiver`] alone is dropped and called again all the time.
pub trait Sink: Send {
    /// Opens the connection and makes it ready to send. Also called again after every failure; leaves nothing of an older
    /// connection behind.
    fn connect(&mut self) -> Pending<'_, Result<(), SinkError>>;

    /// Sends the items and returns when the receiver has taken all of them.
    fn send_batch<'a>(&'a mut self, batch: Batch<'a>) -> Pending<'a, Result<(), SinkError>>;

    /// Waits until the receiver wants something, and returns; [`Sink::serve_receiver`] comes next. An error when the connection is
    /// over. The default waits for ever.
    fn wait_for_receiver(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(std::future::pending())
    }

    /// Does what the receiver wants since [`Sink::wait_for_receiver`] returned.
    fn serve_receiver(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(std::future::ready(Ok(())))
    }

    /// Says goodbye, where the connection still stands. At most two seconds are waited for it.
    fn close(&mut self) -> Pending<'_, ()> {
        Box::pin(std::future::ready(()))
    }

    /// For `doctor`: connects and says what is wrong, without telling the receiver anything, and ends the connection.
    fn probe_receiver(&mut self) -> Pending<'_, Result<(), SinkError>> {
        self.connect()
    }

    /// Can the receiver take old data after new data? Otherwise what an outage left is not sent, and counted as dropped.
    fn takes_history(&self) -> bool {
        true
    }

    /// Until when items are held back, where that is so now. They wait in the outbox meanwhile.
    fn find_hold(&self, _now_ns: TimeNs) -> Option<DeliveryHold> {
        None
    }

    /// Is this one of the items that are held back where [`Sink::find_hold`] says so?
    fn is_held(&self, _item: &Item) -> bool {
        true
    }

    /// What is wrong although items are delivered: for the status and the log.
    fn find_fault(&self) -> Option<SinkError> {
        None
    }

    /// Does the receiver always say which item it will not take? Then a line that breaks is never the fault of an item.
    fn tells_refusals(&self) -> bool {
        false
    }

    /// Greatest number of items in one batch. Live data waits for at most one batch of old data.
    fn items_max(&self) -> usize {
        256
    }
}

/// Items are held back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeliveryHold {
    /// Until then, ns since 1970.
    pub until_ns: TimeNs,
    /// Some items go all the same.
    pub some_pass: bool,
}

/// Why items could not be sent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SinkError {
    /// No connection, or it broke, or the receiver cannot take anything now. It is tried again.
    Line {
        /// What happened and where, one sentence without the full stop.
        what: String,
        /// What to do next.
        next: String,
    },
    /// The receiver will never take this item. Everything before it in the batch is delivered; the item is left out and
    /// counted, and the connection goes on.
    Item {
        /// Number of the item in the outbox.
        sequence: u64,
        /// What happened and where, one sentence without the full stop.
        what: String,
        /// What to do next.
        next: String,
    },
}

impl SinkError {
    /// No connection, or a broken one: it is tried again.
    pub fn failed_line(what: impl Into<String>, next: impl Into<String>) -> Self {
        Self::Line { what: what.into(), next: next.into() }
    }

    /// What happened, and what to do next.
    #[must_use]
    pub fn as_parts(&self) -> (&str, &str) {
        match self {
            Self::Line { what, next } | Self::Item { what, next, .. } => (what, next),
        }
    }
}

impl fmt::Display for SinkError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line { what, next } if next.is_empty() => write!(f, "{what}"),
            Self::Line { what, next } => write!(f, "{what}: {next}"),
            Self::Item { sequence, what, next } => write!(f, "item {sequence} is left out, {what}: {next}"),
        }
    }
}

impl std::error::Error for SinkError {}
