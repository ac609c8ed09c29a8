//! The box: clock, tokio, configuration, tick loop, gate, history, outputs, web page, command line.

pub mod alignment;
pub mod backtest;
pub mod bench;
pub mod check;
pub mod cli;
pub mod config;
pub mod control;
pub mod doctor;
pub mod gate;
pub mod history;
pub mod http;
pub mod in_charge;
pub mod log;
pub mod moment;
pub mod operations;
pub mod pipeline;
pub mod records;
pub mod reload;
pub mod replay;
pub mod run;
pub mod samples;
pub mod signals;
pub mod status;
pub mod twin;
pub mod usage;
pub mod waveform;
