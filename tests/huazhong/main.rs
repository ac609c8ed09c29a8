//! Huazhong controllers: NC-Link in both roles at a real broker, and the vendor's library in a child process.
//!
//! The broker is mosquitto, started and killed by the tests. Where it is not installed they say that they skip; with
//! `CNC_GATEWAY_CI` set they fail.

#[path = "../box/process.rs"]
#[expect(dead_code, reason = "the tests of the box use the rest of it")]
mod process;

mod broker;
mod dialects;
mod foreign;
mod hnc;
#[path = "../support/library.rs"]
mod library;
mod nclink;
#[path = "../support/port.rs"]
mod port;
mod samples;
mod sampling;
#[path = "../support/served.rs"]
#[expect(dead_code, reason = "the suite of FANUC uses the rest of it")]
mod served;
mod shifting;
mod stand;
mod whole_box;
mod writing;
