//! What leaves the box: the outbox under failure, and every sink against a counterpart that is not ours.
//!
//! The broker is mosquitto, the Sparkplug host is pysparkplug, the certificates are made by openssl. Where one is not
//! installed the tests say that they skip; with `CNC_GATEWAY_CI` set they fail.

mod alarm_stand;
pub(crate) mod certificates;
mod decoders;
mod delivery;
mod fake_sink;
mod layouts;
mod mail;
mod outage;
mod plain;
mod request_outcomes;
mod requests;
mod secured;
mod shdr;
mod sparkplug;
mod webhook;
