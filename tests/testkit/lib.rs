//! What several programs of tests need: the gateway as a process, its partners, and machines whose truth is known.
//!
//! Nothing of the gateway's library is in here, so that a change of it does not compile this anew. What needs the library stays with
//! the tests.

pub mod axis;
pub mod bench;
pub mod box_under_test;
pub mod broker;
pub mod command;
pub mod host;
pub mod library;
pub mod nats_cluster;
pub mod plain_reading;
pub mod port;
pub mod process;
pub mod process_status;
pub mod scoring;
pub mod served;
pub mod small_disk;
pub mod thermal_machine;
pub mod weights;
