//! What the estimators knew before the box was last stopped: read from files of the data directory, told where one cannot be used.

use ::rules::estimators;
use gateway_base::log::{Notice, Severity};
use gateway_base::state_file;
use gateway_pipeline::Pipeline;
use std::path::Path;

/// The wear of the edges, as it was known before.
pub(super) fn restore_edge_wear(pipeline: &mut Pipeline, memory: &Path, told: &mut Vec<Notice>) {
    let Some(state) = state_file::read(memory, |notice| told.push(notice)) else { return };
    let snapshot = serde_json::from_str(&state).unwrap_or(serde_json::Value::Null);
    if !pipeline.wear_mut().restore_snapshot(snapshot) {
        let text = format!("{} cannot be used: the wear of the edges is followed anew", memory.display());
        told.push(Notice::new(Severity::Warning, "wear_forgotten", text));
    }
}

/// The estimators, with what they had learned before.
pub(super) fn restore_estimators(memory: &Path, told: &mut Vec<Notice>) -> estimators::Inference {
    let settings = estimators::Settings::default();
    let fresh = || estimators::Inference::new(settings.clone());
    let Some(state) = state_file::read(memory, |notice| told.push(notice)) else { return fresh() };
    let snapshot = serde_json::from_str(&state).unwrap_or(serde_json::Value::Null);
    estimators::Inference::from_snapshot(settings.clone(), snapshot).unwrap_or_else(|error| {
        told.push(Notice::new(Severity::Warning, "nothing_learned", error.to_string()));
        fresh()
    })
}
