//! What is doubted: where simulation and recording differ, which physics was left out, the model with it, and the fit
//! that improves.
//!
//! The argument in one page:
//! 1. The baseline is refitted *together* with every candidate. What a missing effect leaves in the residual of a
//!    fitted baseline is a few percent of it with a distorted shape, so the residual itself is never explained.
//! 2. Noise is a slow process plus a white meter, ARMA(1,1) within runs, profiled per hypothesis.
//! 3. A gate over the whole search, by resampling blocks of innovations, says whether anything is there at all.
//! 4. Singles, then pairs and triples on top of the leaders; signs and ranges are physics.
//! 5. Whoever cannot be told from the best within 6 units of information is named beside it, with the experiment that
//!    separates them. What no candidate explains is `unknown`, located, with an empirical form.
//! 6. Every name must predict fitted runs from the other fitted runs (the inner split, `inner_split.rs`); the same split
//!    says whether a fit is reported by generalised least squares or by its levels alone.
//! 7. Every fit is shown on runs that took no part in fitting, choosing or stopping. They may only withdraw: where the
//!    error there does not fall, nothing is told but that, with the place and the next experiment.

pub mod bind;
mod channel;
mod compare;
mod consumer;
mod corroborated;
pub mod designs;
pub mod diagnose;
pub mod diagnosis;
mod drift;
mod edge_weights;
pub mod empirical;
mod estimate;
mod events;
pub mod evidence;
pub mod examine;
mod excerpt;
mod excluded;
pub mod experiments;
pub mod expression;
pub mod fit;
pub mod frame;
pub mod gate;
pub mod hidden;
mod hidden_lots;
mod hidden_tone;
pub mod holdout;
mod inner_split;
pub mod inputs;
pub mod latent;
mod levels;
pub mod live;
mod load_dependent_noise;
pub mod locate;
pub mod model;
pub mod model_file;
mod next_step;
pub mod noise;
mod offered;
mod outcome;
mod path_state;
mod periodic;
pub mod plan;
pub mod quality;
mod race;
mod recurring_pulses;
mod replaceable;
pub mod report;
pub mod rhythm;
pub mod ripple;
pub mod scan;
pub mod search;
pub mod size;
pub mod table;
pub mod term;
pub mod text;
pub mod tone;
pub mod unknown;
pub mod verdicts;
pub mod wave;
pub mod words;

use crate::linear::columns as linear;
pub use compare::compare;
pub use diagnose::diagnose;
pub use diagnosis::Diagnosis;
pub use examine::{Examination, examine};
pub use model::{Model, Parameter, Part, PartFunction, Simulated, simulate};
pub use model_file::{Problem, parse_hypotheses, parse_model, toml_text, write_model};
