//! The box: clock, tokio, configuration, tick loop, gate, history, outputs, web page, command line.

pub mod config;
pub mod history;
