//! Huazhong controllers: NC-Link in both roles at a real broker, and the vendor's library in a child process.
//!
//! The broker is mosquitto, started and killed by the tests. Where it is not installed they say that they skip; with
//! `CNC_GATEWAY_CI` set they fail.

mod dialects;
mod foreign;
mod hnc;
mod nclink;
mod samples;
mod sampling;
mod shifting;
mod stand;
mod whole_box;
mod writing;
