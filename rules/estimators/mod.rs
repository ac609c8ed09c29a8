//! What is inferred: machine state, no-load power, cutting power, load loss, and what is too small to be seen.
//!
//! [`Pipeline::infer`] takes one [`adapters::Sample`] per tick and yields [`Estimates`]. Every tolerance and length is a
//! row of [`SETTINGS`]. Nothing here reads a clock: time is that of the sample.
//!
//! | file | what |
//! |---|---|
//! | `settings` | the one table of tolerances and lengths |
//! | `state`, `estimate` | the words and numbers that come out |
//! | `filter` | anti-pulse moving average |
//! | `no_load` | no-load power over speed, per gear stage |
//! | `cutting` | power balance: cutting power and load loss |

mod cutting;
mod estimate;
mod filter;
mod no_load;
mod pipeline;
mod settings;
mod state;

pub use cutting::{Balance, balance};
pub use estimate::{Estimate, Estimated, Estimates, NoEstimate, NoLoadOrigin, Visibility};
pub use filter::AntiPulse;
pub use no_load::{NoLoad, NoLoadPoint, NoLoadTable, lagrange, noise_gain, triple};
pub use pipeline::{Pipeline, RestoreError};
pub use settings::{SETTINGS, SPEEDS_PER_STAGE, STAGES, Setting, SettingError, Settings};
pub use state::State;
