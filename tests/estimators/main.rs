//! The estimators against machines whose true state is known, against the plain reading of their source, against its
//! published numbers, and against anything at all.

mod bed;
#[path = "../support/bench/mod.rs"]
mod bench;
mod golden;
mod milling;
#[path = "../support/plain_reading.rs"]
mod plain_reading;
mod properties;
mod score;
#[path = "../support/scoring/mod.rs"]
mod scoring;
mod simulated;
mod transitions;
#[path = "../support/weights.rs"]
mod weights;
