//! From an address to a sink.

use super::mail::open_mail;
use super::mqtt::MqttSink;
use super::nats::NatsSink;
#[cfg(feature = "opcua")]
use super::opcua::OpcuaSink;
use super::parquet::ParquetSink;
use super::shdr::ShdrSink;
use super::sparkplug::SparkplugSink;
use super::webhook::open_webhook;
use super::{Requests, Sink, SinkAddress, SinkTarget};
use gateway_history::Outbox;
use std::path::Path;

/// The sink of an address. `name` is its name in the configuration, `requests` the way of its network to the gate, `outbox`
/// knows the machine, the box and the series, `history` is the database that it belongs to. Nothing is connected yet.
#[must_use]
pub fn open_sink(
    address: &SinkAddress,
    (name, requests): (&str, Requests),
    outbox: &Outbox,
    history: &Path,
) -> Box<dyn Sink> {
    match address.target() {
        SinkTarget::Mail(target) => Box::new(open_mail(target.clone(), outbox)),
        SinkTarget::Mqtt(target) => Box::new(MqttSink::new(target.clone(), (name, requests), outbox)),
        SinkTarget::Nats(target) => Box::new(NatsSink::new(target.clone(), name, outbox)),
        #[cfg(feature = "opcua")]
        SinkTarget::Opcua(target) => Box::new(OpcuaSink::new(target.clone(), outbox, history)),
        SinkTarget::Parquet(target) => Box::new(ParquetSink::new(target.clone(), outbox, history)),
        SinkTarget::Shdr(target) => Box::new(ShdrSink::new(target.clone(), outbox)),
        SinkTarget::Sparkplug(target) => Box::new(SparkplugSink::new(target.clone(), (name, requests), outbox)),
        SinkTarget::Webhook(target) => Box::new(open_webhook(target.clone(), outbox)),
    }
}
