//! What we know: pure functions of their arguments.
//!
//! The crates read as a sentence: [`physics`] is known, [`estimators`] infer, the [`twin`] doubts, the [`script`]
//! decides; [`operations`] is what the process planner says. There is no clock, no IO, no thread and no `unsafe` here;
//! time is an argument and randomness is seeded.
//!
//! | crate | what | uses |
//! |---|---|---|
//! | [`numerics`] | least squares, robust statistics | |
//! | [`physics`] | one physical effect per file | `numerics` |
//! | [`estimators`] | machine state, power balance, wear, thermal error | `numerics` |
//! | [`twin`] | what a model has left out | `physics`, `numerics` |
//! | [`script`] | the host of rhai scripts | `estimators` |

pub mod operations;
pub use estimators;
pub use numerics;
pub use physics;
pub use script;
pub use twin;
