//! What is doubted: where simulation and recording differ, which physics was left out, the model with it, and the fit
//! that improves.
//!
//! The argument in one page:
//! 1. The model is refitted *together* with every candidate. What a missing effect leaves in the residual of a fitted
//!    model is a few percent of it with a distorted shape, so the residual itself is never explained.
//! 2. Each law is a family: the law of the textbook, and what its form may lack. Beside the named families stand curves
//!    without a name. They compete by their evidence (`evidence`).
//! 3. Whether anything is there is one question, asked by one test of known false-alarm rate; what it is called is
//!    another. What exists is told, located and sized even where it has no name.
//! 4. Every decision reads probabilities that are averaged over resampled stretches of the recording, so that one run or
//!    one tool cannot make it sure.
//! 5. What another law explains nearly as well is named beside it, with the experiment that separates them.
//! 6. Every fit is shown on runs that took no part in fitting, choosing or stopping. They may only withdraw.

pub mod bind;
mod candidates;
mod channel;
mod departure;
pub mod diagnosis;
mod evidence;
pub mod examine;
pub mod experiments;
pub mod expression;
mod fit;
pub mod hold_out;
pub mod inputs;
mod intervals;
pub mod json_report;
pub mod live;
pub mod model;
pub mod model_file;
mod next_step;
mod place_search;
pub mod plan;
mod prepared_recording;
pub mod quality;
pub mod region;
#[cfg(test)]
mod robustness;
pub mod simulate;
pub mod speed_table;
pub mod summary;
pub mod tangents;
mod term;
pub mod text_report;
mod thin;

pub use departure::Departure;
pub use diagnosis::Diagnosis;
pub use evidence::diagnose_recording;
pub use examine::{Examination, examine_recording};
pub use model::{Model, Parameter, Part, PartFunction, Simulated, simulate_parts};
pub use model_file::{Problem, format_toml_text, parse_hypotheses, parse_model, write_model};
pub use thin::{ThinnedRecording, thin_recording};

use numerics::linear::columns as linear;
