//! What we know: pure functions of their arguments.
//!
//! The modules read as a sentence: [`physics`] is known, [`estimators`] infer, the [`twin`] doubts, the [`script`]
//! decides; [`operations`] is what the process planner says. There is no clock, no IO, no thread and no `unsafe` here; time is an argument and randomness is seeded.

pub mod estimators;
pub mod linear;
pub mod operations;
pub mod physics;
pub mod script;
mod statistics;
pub mod twin;
