//! The box: clock, tokio, configuration, tick loop, gate, history, outputs, web page, command line.
//!
//! | crate | what | uses |
//! |---|---|---|
//! | `gateway_files` | files that are replaced, noticed, owned | |
//! | `gateway_records` | what is remembered besides samples, one type per kind of row | |
//! | [`gateway_base`] | clock, messages | `gateway_files` |
//! | [`gateway_history`] | everything in SQLite | `gateway_base`, `gateway_records` |
//! | [`gateway_gate`] | the only way to the controller | `gateway_files`, `gateway_records` |
//! | [`gateway_control`] | orders to a running box | `gateway_history` |
//! | [`gateway_nats`] | a client of NATS JetStream | `gateway_base` |
//! | [`gateway_sinks`] | what leaves the box | `gateway_control`, `gateway_nats` |
//! | [`gateway_fleet`] | from NATS JetStream into PostgreSQL | `gateway_sinks` |
//! | [`gateway_diagnosis`] | the twin at work, and its report | `gateway_history` |
//! | [`gateway_commission`] | from measurements in the workshop to models | `gateway_diagnosis` |
//! | [`gateway_pipeline`] | from a sample to estimates, decisions and records | `gateway_gate`, `gateway_history` |
//! | [`gateway_config`] | the configuration file | `gateway_pipeline`, `gateway_sinks` |
//! | [`gateway_status`] | what the box says of itself; delays of its sources | `gateway_config`, `gateway_diagnosis` |
//! | [`gateway_sources`] | from the configuration to samples; what an address answers | `gateway_status` |
//! | [`gateway_scripts`] | the shop's scripts on disk, their settings and drafts | `gateway_history` |
//! | [`gateway_backtest`] | edited scripts over the stored history | `gateway_pipeline`, `gateway_scripts` |
//! | [`gateway_backup`] | backups, and archives that a person takes | `gateway_config`, `gateway_scripts` |
//! | [`gateway_access`] | persons, roles, sessions, tokens | `gateway_control` |
//! | [`gateway_handbook`] | the chapters of the handbook | |
//! | [`gateway_http`] | the page and the interface | `gateway_sources`, `gateway_backtest`, `gateway_backup`, `gateway_access`, `gateway_commission`, `gateway_handbook` |
//! | [`gateway_run`] | one machine, live: the tick and everything beside it | `gateway_http` |
//!
//! This crate is the command line, and what only the command line needs.

pub mod bench;
pub mod check;
pub mod cli;
pub mod demo;
pub mod monitoring;
pub mod replay;
pub mod setup;

pub use gateway_access as access;
pub use gateway_backtest as backtest;
pub use gateway_backup as backup;
pub use gateway_backup::archive;
pub use gateway_base::{cannot_run, clock, convert, files, log, machine_path, moment, state_file, usage};
pub use gateway_commission as commission;
pub use gateway_commission::{identification, pulses};
pub use gateway_config as config;
pub use gateway_control as control;
pub use gateway_diagnosis as diagnosis;
pub use gateway_diagnosis::report;
#[cfg(feature = "fleet")]
pub use gateway_fleet as fleet;
pub use gateway_gate as gate;
pub use gateway_handbook as handbook;
pub use gateway_history as history;
pub use gateway_http as http;
pub use gateway_http::{gallery, records, samples};
pub use gateway_nats as nats;
pub use gateway_pipeline as pipeline;
pub use gateway_run as run;
pub use gateway_run::{operations, signals, update};
pub use gateway_scripts::{active_scripts, drafts, reload, settings};
pub use gateway_sinks as sinks;
pub use gateway_sources as sources;
pub use gateway_sources::{doctor, waveform};
pub use gateway_status as status;
pub use gateway_status::alignment;
