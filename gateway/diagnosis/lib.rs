//! The twin at work: recordings from files and from the history, models from files, what becomes of a diagnosis. What a
//! diagnosis is stands in `rules::twin`.

pub mod arriving;
pub mod beside;
pub mod child;
pub mod child_process;
pub mod clicked_map;
pub mod context;
pub mod execute;
pub mod files;
pub mod handle;
mod history;
mod join;
pub mod map_file;
#[cfg(test)]
mod map_file_tests;
pub mod model_new;
mod models;
mod order;
mod outputs;
pub mod preview;
mod recordings;
pub mod report;
pub mod request;
pub mod series;
pub mod series_alignment;
pub mod simulation;
pub mod status;
pub mod steps;
pub mod store;
pub mod stretch;
pub mod unit_check;
pub mod words;
pub mod worker;

pub use join::{JoinError, join_recordings};
pub use models::{read_hypotheses, read_model};
pub use order::Copies;
pub use outputs::{DiagnosisOutputs, write_output};
pub use recordings::{
    InputRecordings, describe_reading, describe_refusals, loses_too_much, read_recordings, read_recordings_as,
};
