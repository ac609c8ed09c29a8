//! Why something that a person asked for could not run: one error for the whole program, with the next step.

use std::fmt;

/// Why a command could not run (exit code 2): what happened, where, and what to do next.
#[derive(Debug)]
pub struct CannotRun {
    /// What happened, and where.
    pub what: String,
    /// What to do next; may be empty when `what` says it.
    pub next: String,
}

impl CannotRun {
    /// What happened and what to do next.
    pub fn new(what: impl Into<String>, next: impl Into<String>) -> Self {
        Self { what: what.into(), next: next.into() }
    }

    /// An error whose own words say what to do next.
    pub fn from_error(error: impl fmt::Display) -> Self {
        Self::new(error.to_string(), "")
    }
}

impl fmt::Display for CannotRun {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.what)?;
        if self.next.is_empty() { Ok(()) } else { write!(f, "\n  {}", self.next) }
    }
}
