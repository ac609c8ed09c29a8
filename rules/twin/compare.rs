//! Which comparison a recording gets.
//!
//! By evidence (`evidence`), but for two cases that go to the search over forms (`diagnose`):
//!
//! - more rows than are fitted one by one: the evidence holds about 750 columns for every row in memory, the search looks at an
//!   excerpt of them;
//! - a model without a free parameter: nothing of a missing contribution is absorbed there, and the evidence gives a mere factor of
//!   the cut the name of any law of the cut.

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
    let has_free = model.parts.iter().flat_map(|part| &part.parameters).any(|parameter| !parameter.fixed);
    if recording.rows() > ROWS_MAX || !has_free {
        diagnose(recording, model, seed)
    } else {
        evidence::diagnose(recording, model)
    }
}
