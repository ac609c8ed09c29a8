//! The box: clock, tokio, configuration, tick loop, gate, history, outputs, web page, command line.
//!
//! | crate | what | uses |
//! |---|---|---|
//! | [`gateway_base`] | clock, messages, files | |
//! | [`gateway_history`] | everything in SQLite | `gateway_base` |
//! | [`gateway_gate`] | the only way to the controller | `gateway_base`, `gateway_history` |
//! | [`gateway_control`] | orders to a running box | `gateway_base`, `gateway_history` |
//! | [`gateway_nats`] | a client of NATS JetStream | `gateway_base` |
//! | [`gateway_sinks`] | what leaves the box | `gateway_control`, `gateway_history`, `gateway_nats` |
//! | [`gateway_diagnosis`] | the twin at work, and its report | `gateway_base`, `gateway_history` |
//!
//! This crate puts them together: configuration, tick, page, command line.

pub mod access;
pub mod active_scripts;
pub mod alignment;
pub mod archive;
pub mod backtest;
pub mod backup;
pub mod bench;
pub mod check;
pub mod cli;
pub mod commission;
pub mod config;
pub mod demo;
pub mod doctor;
pub mod drafts;
#[cfg(feature = "fleet")]
pub mod fleet;
pub mod gallery;
pub mod handbook;
pub mod http;
pub mod identified;
pub mod learned;
pub mod monitoring;
pub mod operations;
pub mod pipeline;
pub mod pulses;
pub mod records;
pub mod reload;
pub mod replay;
pub mod run;
pub mod samples;
pub mod settings;
pub mod setup;
pub mod signals;
pub mod status;
pub mod update;
pub mod usage;
pub mod waveform;

pub use gateway_base::{cannot_run, clock, convert, files, log, moment};
pub use gateway_control as control;
pub use gateway_diagnosis as diagnosis;
pub use gateway_diagnosis::report;
pub use gateway_gate as gate;
pub use gateway_history as history;
pub use gateway_nats as nats;
pub use gateway_sinks as sinks;
