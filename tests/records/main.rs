//! What is kept and what is passed on: recordings, the history, the outputs, and the database of many boxes.

#[cfg(feature = "fleet")]
mod fleet;
mod history;
mod outputs;
mod recordings;
mod sealed;
