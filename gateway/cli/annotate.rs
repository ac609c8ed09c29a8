//! `cnc-gateway annotate`: what only a person can measure, noted beside the history.

use super::{CannotRun, CommandOutcome, CommandResult, load_configuration, print_text};
use crate::commission::annotations::{Quantity, TypedAnnotation, add, parse_annotation};
use crate::history::Reader;
use crate::{clock, moment};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct AnnotateArguments {
    /// What was measured.
    #[arg(value_enum)]
    quantity: Quantity,
    /// The value, in --unit.
    #[arg(allow_negative_numbers = true)]
    value: Option<f64>,
    /// Its unit: mm, um or in for lengths, Nm for the torques of a file.
    #[arg(long, value_name = "UNIT")]
    unit: Option<String>,
    /// When: now, -10m (before the newest sample), or 2026-01-31T08:15:00Z.
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    at: Option<String>,
    /// Standard deviation of the reading, in --unit.
    #[arg(long, value_name = "SD")]
    sd: Option<f64>,
    /// File of a torque sensor: columns time_s, on its own clock, and torque_nm.
    #[arg(long, value_name = "FILE")]
    file: Option<PathBuf>,
    /// Edge, axis or sensor, in your words; readings of one edge belong together.
    #[arg(long, value_name = "NAME", default_value = "")]
    of: String,
    /// Configuration of the box; without it that of the installed box, or the built-in one.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

pub(super) fn run(arguments: AnnotateArguments) -> CommandResult {
    let config = load_configuration(arguments.config.as_deref())?;
    let span = Reader::open(&config.history.path).and_then(|reader| reader.read_present_span());
    // Without a history there is no newest sample yet; then the clock says what now is.
    let newest_ns = span.ok().flatten().map_or_else(clock::now_ns, |(_, newest_ns)| newest_ns);
    let AnnotateArguments { quantity, value, unit, at, sd, file, of, .. } = arguments;
    let given = TypedAnnotation { value, unit, at, sd, file, of };
    match parse_annotation(quantity, given, newest_ns) {
        Err(refused) => {
            print_text(&format!("not noted: {refused}\n"));
            Ok(CommandOutcome::No)
        }
        Ok(annotation) => {
            add(&config.gateway.data_dir, &annotation).map_err(CannotRun::from_error)?;
            let what = annotation.value.map_or_else(
                || annotation.file.as_ref().map(|file| file.display().to_string()).unwrap_or_default(),
                |value| format!("{value} {}", quantity.unit()),
            );
            print_text(&format!("noted: {} {what} at {}\n", quantity.as_word(), moment::format_utc(annotation.at_ns)));
            Ok(CommandOutcome::Fine)
        }
    }
}
