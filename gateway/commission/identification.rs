//! How a model was found: the whole answer of `identify tool-wear` and `identify thermal`, kept beside the history of the box.
//!
//! The model in the library holds what is needed to use it. The analysis of variance, and which points of measurement were chosen
//! and why, stand in this answer alone. `identify` and `commission --write` keep it in `identified/SUBJECT.json` of the data
//! directory; `GET /api/v1/identified/SUBJECT` hands it to the page.

use gateway_base::files::replace_file;
use rules::estimators::thermal::{LeftOut, ThermalLearned};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The subject of the wear model.
pub const TOOL_WEAR: &str = "tool-wear";
/// The subject of the thermal law.
pub const THERMAL: &str = "thermal";
/// What the page shows.
pub const SUBJECTS: [&str; 2] = [TOOL_WEAR, THERMAL];
/// Directory of the answers, in the data directory.
const DIRECTORY: &str = "identified";

/// Where the answer on this subject stands.
#[must_use]
pub fn answer_path(data_dir: &Path, subject: &str) -> PathBuf {
    data_dir.join(DIRECTORY).join(format!("{subject}.json"))
}

/// The answer (identify/1) that `--json` prints as well.
#[must_use]
pub fn build_answer(subject: &str, learned: &Value) -> Value {
    json!({ "schema": "identify/1", "what": subject, "refused": null, "learned": learned })
}

/// What was learned of the thermal error: the laws that were tried, the chosen one, and what was left out.
#[must_use]
pub fn of_thermal(learned: &ThermalLearned, left_out: &LeftOut) -> Value {
    let mut document = json!(learned);
    document["left_out"] = json!(left_out);
    document["law"] = json!(learned.best_candidate().fit.law);
    document["coefficients"] = json!(learned.best_candidate().fit.coefficients);
    document
}

/// The answer could not be kept.
#[derive(Debug, Error)]
#[error("{}: {error}", path.display())]
pub struct NotSaved {
    /// Where it should stand.
    pub path: PathBuf,
    /// What the system says.
    pub error: std::io::Error,
}

/// Keeps what was learned; the newest takes the place of what was there. Where it stands.
///
/// # Errors
/// The file cannot be written: which, and why.
pub fn save_answer(data_dir: &Path, subject: &str, learned: &Value) -> Result<PathBuf, NotSaved> {
    let path = answer_path(data_dir, subject);
    let text = format!("{:#}\n", build_answer(subject, learned));
    let made = std::fs::create_dir_all(data_dir.join(DIRECTORY)).and_then(|()| replace_file(&path, &text));
    match made {
        Ok(()) => Ok(path),
        Err(error) => Err(NotSaved { path, error }),
    }
}
