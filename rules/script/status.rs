//! Who is in charge, who is not, and why: what a page, the log and `/api/v1/status` show.

use super::problem::ScriptProblem;
use std::sync::Arc;

/// How a script is doing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ScriptCondition {
    /// It runs when it is due.
    Running,
    /// It worked on a value that is not there; it asks for nothing and tries again when due.
    Waiting(ScriptProblem),
    /// The newest version failed while running; the version before it is in charge.
    Reverted(ScriptProblem),
    /// It failed while running and has no good version; it asks for nothing until the file is changed.
    Suspended(Option<ScriptProblem>),
}

impl ScriptCondition {
    /// The word in JSON and on the page.
    #[must_use]
    pub fn as_word(&self) -> &'static str {
        match self {
            Self::Running => "running",
            Self::Waiting(_) => "waiting",
            Self::Reverted(_) => "reverted",
            Self::Suspended(_) => "suspended",
        }
    }

    /// Why it does not run as written.
    #[must_use]
    pub fn problem(&self) -> Option<&ScriptProblem> {
        match self {
            Self::Running => None,
            Self::Waiting(problem) | Self::Reverted(problem) => Some(problem),
            Self::Suspended(problem) => problem.as_ref(),
        }
    }

    pub(super) fn is_active(&self) -> bool {
        matches!(self, Self::Running | Self::Waiting(_))
    }

    pub(super) fn is_suspended(&self) -> bool {
        matches!(self, Self::Suspended(_))
    }
}

/// How one script of the set in charge is doing.
#[derive(Debug, Clone, PartialEq)]
pub struct ScriptStatus {
    /// File name of the script.
    pub file: Arc<str>,
    /// FNV-1a hash of the text in charge, as decisions are recorded with; shown as 16 hexadecimal digits.
    pub version: u64,
    /// How it is doing.
    pub condition: ScriptCondition,
    /// Time between two runs; `None`: at every tick.
    pub every_s: Option<f64>,
    /// Runs since it came into charge.
    pub runs: u64,
    /// The channels and estimates it looks at.
    pub reads: Vec<&'static str>,
    /// Its constants, name and value as written.
    pub thresholds: Vec<(String, String)>,
}

/// All scripts, and why the newest set was refused.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Status {
    /// In the order of their names.
    pub scripts: Vec<ScriptStatus>,
    /// Problems of the newest files when they were refused; the set before them is in charge then.
    pub refused: Vec<ScriptProblem>,
}

impl Status {
    /// Is everything in charge that the user wrote?
    #[must_use]
    pub fn is_healthy(&self) -> bool {
        self.refused.is_empty() && self.scripts.iter().all(|script| script.condition.is_active())
    }
}
