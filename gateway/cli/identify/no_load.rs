//! `identify no-load`: the power of the idling spindle, per gear stage and speed.

use super::{IdentifyFiles, IdentifyOutput};
use crate::cli::CommandResult;
use clap::Args;
use rules::estimators::power_separation::identify_no_load;
use serde_json::json;

#[derive(Debug, Args)]
pub(super) struct NoLoadArguments {
    #[command(flatten)]
    reading: IdentifyFiles,
}

pub(super) fn run(arguments: &NoLoadArguments) -> CommandResult {
    let recording = arguments.reading.read()?;
    let learned = identify_no_load(&recording).map(|learned| IdentifyOutput {
        text: learned.to_string(),
        json: json!(learned),
        file: Some(learned.format_script()),
    });
    arguments.reading.report_result("no-load", learned)
}
