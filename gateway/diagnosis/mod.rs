//! The twin at work: recordings from files and from the history, models from files, what becomes of a diagnosis. What a
//! diagnosis is stands in `rules::twin`.

pub mod child;
pub mod execute;
pub mod handle;
mod history;
mod join;
mod models;
mod outputs;
mod parquet;
mod recordings;
pub mod simulation;
pub mod status;
pub mod steps;
pub mod store;
pub mod stretch;
pub mod words;
pub mod worker;

pub use join::join;
pub use models::{read_hypotheses, read_model};
pub use outputs::{DiagnosisOutputs, put};
pub use recordings::{InputRecordings, read_recordings};
