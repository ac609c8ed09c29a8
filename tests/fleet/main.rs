//! Many boxes and one database: real NATS servers and a real PostgreSQL, and what is left when parts of them die.
//!
//! `nats-server` and `initdb` are looked for; where one is not installed the tests say that they skip, with `CNC_GATEWAY_CI` set
//! they fail.

#[path = "../outputs/box_under_test.rs"]
#[expect(dead_code, reason = "the tests of the sinks use the rest of it")]
mod box_under_test;
#[path = "../huazhong/broker.rs"]
#[expect(dead_code, reason = "only its search for programs is used")]
mod broker;
#[path = "../outputs/certificates.rs"]
#[expect(dead_code, reason = "the tests of the sinks use the rest of it")]
mod certificates;
#[path = "../support/port.rs"]
mod port;
#[path = "../box/process.rs"]
#[expect(dead_code, reason = "the tests of the box use the rest of it")]
mod process;
#[path = "../support/process_status.rs"]
mod process_status;

mod boxes;
mod cluster;
mod killed;
mod means;
mod monitoring;
mod partitions;
mod pipeline;
mod poison;
mod postgres;
mod questions;
mod secured;
mod sizes;
mod told;
mod versions;
