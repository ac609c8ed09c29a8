//! What does not work, with what to do next.

use serde::Serialize;

/// Something that does not work while the box goes on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StatusProblem {
    /// What does not work, and where.
    pub what: String,
    /// What to do next.
    pub next: String,
}
