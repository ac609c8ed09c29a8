//! What leaves the box: the outbox under failure, and every sink against a counterpart that is not ours.
//!
//! The broker is mosquitto, the Sparkplug host is pysparkplug, the certificates are made by openssl. Where one is not
//! installed the tests say that they skip; with `CNC_GATEWAY_CI` set they fail.

#[path = "../box/process.rs"]
#[expect(dead_code, reason = "the tests of the box use the rest of it")]
mod process;
#[path = "../support/process_status.rs"]
mod process_status;

#[path = "../huazhong/broker.rs"]
mod broker;
#[path = "../support/port.rs"]
mod port;

#[expect(dead_code, reason = "the tests of the fleet use the rest of it")]
mod box_under_test;
mod certificates;
mod decoders;
mod delivery;
mod fake_sink;
mod host;
mod layouts;
mod outage;
mod plain;
mod requests;
mod secured;
mod shdr;
mod sparkplug;
