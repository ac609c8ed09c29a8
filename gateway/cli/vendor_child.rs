//! `cnc-gateway vendor-child`: this program as the child process around a vendor's library. Never called by a person.

use super::{CannotRun, CommandOutcome, CommandResult};
use clap::Args;

/// Arguments of the child.
#[derive(Debug, Args)]
pub(super) struct VendorChildArguments {
    /// Which library is served.
    kind: String,
}

/// Answers the parent until it is gone.
pub(super) fn run(arguments: &VendorChildArguments) -> CommandResult {
    let ended = match arguments.kind.as_str() {
        adapters::fanuc::vendor::KIND => adapters::fanuc::vendor::serve_parent(),
        adapters::hnc::KIND => adapters::hnc::serve_parent(),
        other => return Err(CannotRun::new(format!("no library is served as {other}"), "")),
    };
    ended
        .map(|()| CommandOutcome::Fine)
        .map_err(|error| CannotRun::new(format!("the line to the gateway: {error}"), ""))
}
