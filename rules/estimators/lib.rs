//! What is inferred: machine state, no-load power, cutting power, load loss, and what is too small to be seen.
//!
//! [`Inference::update_with_sample`] takes one [`adapter_core::Sample`] per tick and yields [`Estimates`]. Every tolerance and length is a
//! row of [`SETTINGS`]. Nothing here reads a clock: time is that of the sample.
//!
//! | file | what |
//! |---|---|
//! | `settings`, `stage_settings`, `place_settings` | the one table of tolerances and lengths, and values for one gear stage, tool or operation |
//! | `state`, `estimate`, `estimate_words` | the words and numbers that come out |
//! | `filter` | anti-pulse moving average |
//! | `basis` | what stands for spindle power where nobody measures it |
//! | `inputs`, `signals`, `noise` | what is needed of a sample, its recent past, how noisy it is |
//! | `window` | has the power settled: two stationary windows that agree |
//! | `evidence` | a small lasting step in noise |
//! | `situation`, `detector` | the states and every transition between them |
//! | `no_load`, `interpolation`, `learning` | no-load power over speed, per gear stage, learned from idle |
//! | `supply` | no-load power over supply voltage, its exponent learned |
//! | `visibility` | over a whole recording: could cutting be seen at all |
//! | `part` | what is known of the part that was finished last |
//! | `loads` | the load beside its target and beside what was learned, and the feed override between them |
//! | `cutting`, `load_loss_doubt` | power balance: cutting power and load loss, and how well the load loss is known |
//! | `power_separation` | no-load power and load loss from recordings |
//! | `alignment` | lag, drift and averaging window between controller and meter |
//! | `thermal` | thermal error from temperatures: sensors, laws, compensation, pulse insertion |
//! | `spindle_current` | filter, feature and feed curve of the spindle current |
//! | `regression` | least squares with intervals, distributions, refusals |

pub mod alignment;
mod basis;
mod bound;
mod cutting;
mod detector;
mod estimate;
mod estimate_words;
mod evidence;
mod filter;
mod inference;
mod inputs;
mod interpolation;
mod learning;
mod load_loss_doubt;
pub mod loads;
mod no_load;
mod noise;
mod part;
mod place_settings;
pub mod power_separation;
pub mod regression;
mod script_number;
mod settings;
mod signals;
mod situation;
pub mod spindle_current;
mod stage_settings;
mod supply;
pub mod thermal;
mod visibility;
pub mod wear;
mod window;

pub use adapter_core::state::State;
pub use basis::StateBasis;
pub use evidence::Evidence;
pub use window::{Means, PowerWindow, is_stationary};

pub use cutting::{Balance, LoadLossLaw, solve_power_balance};
pub use estimate::{Estimate, Estimated, Estimates, NoEstimate};
pub use estimate_words::{LoadLossOrigin, NoLoadOrigin, Visibility};
pub use filter::AntiPulse;
pub use inference::{Inference, RestoreError};
pub use load_loss_doubt::LoadLossDoubt;
pub use no_load::{NoLoad, NoLoadPoint, NoLoadTable};
pub use numerics::speed_weights::{
    EXTRAPOLATION_GAIN_MAX, SimulatedSpeedWeights, SpeedWeights, Weights, form_sd, lagrange_weights, noise_gain,
    select_adjacent_speeds, weigh_known_speeds,
};
pub use part::PartFigures;
pub use script_number::format_script_number;
pub use settings::{SETTINGS, SPEEDS_PER_STAGE, STAGES, Setting, SettingError, Settings};
pub use visibility::{VisibilityTally, VisibilityVerdict};
