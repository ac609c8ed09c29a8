//! What the estimators knew before the box was last stopped: read from files of the data directory, told where one cannot be used.

use crate::log::{Notice, Severity};
use crate::pipeline::Pipeline;
use ::rules::estimators;
use std::path::Path;

/// The wear of the edges, as it was known before.
pub(super) fn edges(pipeline: &mut Pipeline, memory: &Path) {
    let Ok(text) = std::fs::read_to_string(memory) else { return };
    let snapshot = serde_json::from_str(&text).unwrap_or(serde_json::Value::Null);
    if !pipeline.wear_mut().restore(snapshot) {
        let text = format!("{} cannot be used: the wear of the edges is followed anew", memory.display());
        Notice::new(Severity::Warning, "wear_forgotten", text).say();
    }
}

/// The estimators, with what they had learned before.
pub(super) fn estimators(memory: &Path) -> estimators::Inference {
    let settings = estimators::Settings::default();
    let fresh = || estimators::Inference::new(settings.clone());
    let Ok(text) = std::fs::read_to_string(memory) else { return fresh() };
    let snapshot = serde_json::from_str(&text).unwrap_or(serde_json::Value::Null);
    estimators::Inference::restore(settings.clone(), snapshot).unwrap_or_else(|error| {
        Notice::new(Severity::Warning, "nothing_learned", error.to_string()).say();
        fresh()
    })
}
