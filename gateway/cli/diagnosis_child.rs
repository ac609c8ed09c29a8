//! `cnc-gateway diagnosis-child`: this program as the child process that makes a diagnosis. Never called by a person.

use super::{CannotRun, CommandOutcome, CommandResult};

/// Makes the diagnosis that the parent asks for.
pub(super) fn run() -> CommandResult {
    let ended = crate::diagnosis::child::run();
    ended
        .map(|()| CommandOutcome::Fine)
        .map_err(|error| CannotRun::new(format!("the line to the gateway: {error}"), ""))
}
