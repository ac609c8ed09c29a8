//! `identify feed-curve`: the curve of the spindle current over feed, by speed and depth of cut.

use super::{IdentifyFiles, IdentifyOutput};
use crate::cli::CommandResult;
use ::rules::estimators::spindle_current::identify_feed_curve;
use clap::Args;
use serde_json::json;

#[derive(Debug, Args)]
pub(super) struct FeedCurveArguments {
    #[command(flatten)]
    reading: IdentifyFiles,
    /// Column of the feature: a current, a load, a power.
    #[arg(long, value_name = "COLUMN", default_value = "spindle_current_a")]
    feature: String,
    /// Column of the feed: feed_mm_min or feed_per_rev_mm.
    #[arg(long, value_name = "COLUMN", default_value = "feed_mm_min")]
    feed: String,
}

pub(super) fn run(arguments: &FeedCurveArguments) -> CommandResult {
    let recording = adapters::recording::with_derived(arguments.reading.read()?);
    let learned = identify_feed_curve(&recording, &arguments.feed, &arguments.feature).map(|learned| IdentifyOutput {
        text: learned.to_string(),
        json: json!(learned),
        file: learned.script(),
    });
    arguments.reading.finish("feed-curve", learned)
}
