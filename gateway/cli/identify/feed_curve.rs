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
    /// What the script holds, in the unit of the feature; without it the mean of the recorded cuts.
    #[arg(long, value_name = "VALUE", value_parser = parse_positive)]
    target: Option<f64>,
}

fn parse_positive(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("{text:?} is no number"))?;
    if value.is_finite() && value > 0.0 { Ok(value) } else { Err("a target is greater than 0".to_owned()) }
}

pub(super) fn run(arguments: &FeedCurveArguments) -> CommandResult {
    let recording = adapters::recording::with_derived(arguments.reading.read()?);
    let learned = identify_feed_curve(&recording, &arguments.feed, &arguments.feature).map(|learned| IdentifyOutput {
        text: format!("{learned}{}", learned.target_text(arguments.target)),
        json: json!(learned),
        file: learned.format_script(arguments.target),
    });
    arguments.reading.report_result("feed-curve", learned)
}
