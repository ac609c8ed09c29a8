//! From an address to a sink.

use super::mqtt::MqttSink;
use super::shdr::ShdrSink;
use super::sparkplug::SparkplugSink;
use super::{Sink, SinkAddress, SinkTarget};
use crate::history::Outbox;

/// The sink of an address. `name` is its name in the configuration, `outbox` knows the machine, the box and the series.
/// Nothing is connected yet.
#[must_use]
pub fn open(address: &SinkAddress, name: &str, outbox: &Outbox) -> Box<dyn Sink> {
    match address.target() {
        SinkTarget::Mqtt(target) => Box::new(MqttSink::new(target.clone(), name, outbox)),
        SinkTarget::Shdr(target) => Box::new(ShdrSink::new(target.clone(), outbox)),
        SinkTarget::Sparkplug(target) => Box::new(SparkplugSink::new(target.clone(), name, outbox)),
    }
}
