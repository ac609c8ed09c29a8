//! Which comparison a recording gets.
//!
//! By evidence (`evidence`), which holds every column of its bank for every row in memory: about 750 of them. A recording of
//! more rows than are fitted one by one goes to the search over forms (`diagnose`), which looks at an excerpt of it.

use super::diagnosis::Diagnosis;
use super::frame::ROWS_MAX;
use super::model::Model;
use super::{diagnose, evidence};
use adapters::Recording;

/// Compares a model with a recording; `seed` is that of the resampling, where there is one.
///
/// # Errors
/// Everything that makes the input unusable, with what to record instead.
pub fn compare(recording: &Recording, model: &Model, seed: u64) -> Result<Diagnosis, Vec<String>> {
    if recording.rows() > ROWS_MAX { diagnose(recording, model, seed) } else { evidence::diagnose(recording, model) }
}
