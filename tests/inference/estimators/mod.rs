//! The estimators against machines whose true state is known, against the plain reading of their source, against its
//! published numbers, and against anything at all.

mod bed;
mod golden;
mod milling;
mod properties;
mod score;
mod simulated;
mod transitions;
