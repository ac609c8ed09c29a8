//! What is asked of the worker, and why it has no diagnosis.

use super::beside::Onset;
use adapter_core::clock::TimeNs;
use rules::twin::Model;
use std::path::PathBuf;

/// A model as read from its file.
#[derive(Debug, Clone)]
pub struct LoadedModel {
    /// The parsed model, checked.
    pub model: Model,
    /// The text that the model was read from (model/1).
    pub toml: String,
}

/// A stretch to be diagnosed.
#[derive(Debug, Clone)]
pub struct DiagnosisRequest {
    /// The model in charge, as text.
    pub toml: String,
    /// The person who asks for it; `None`: the box itself.
    pub by: Option<String>,
    /// Beginning of the stretch, ns since 1970.
    pub from_ns: TimeNs,
    /// End of the stretch, ns since 1970.
    pub to_ns: TimeNs,
    /// Since when the watch sees which kinds of work differ.
    pub onsets: Vec<Onset>,
    /// A file in place of a stretch: its path, and the simulated series beside it.
    pub file: Option<(PathBuf, Option<String>)>,
}

/// Why a process has given no diagnosis.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(super) enum ChildFailure {
    /// A person has ended it, before the process was started or while it ran.
    #[error("{by} has ended it")]
    Ended { by: String },
    /// The system gave no process.
    #[error("no process for the diagnosis: {0}")]
    NotStarted(String),
    /// The process says why nothing can be diagnosed.
    #[error("{0}")]
    Refused(String),
    /// The process ended without an answer; with its exit status, empty where that is not known.
    #[error("its process broke off ({0})")]
    BrokeOff(String),
}
