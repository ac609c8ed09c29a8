//! `cnc-gateway identify`: a machine's own numbers from recordings of it.
//!
//! Every subcommand reads recordings, learns, prints what it learned as text or JSON, and writes with `--out` the form
//! that the gateway reads. What the recordings cannot tell is refused with the reason: exit code 1.

mod feed_curve;
mod load_loss;
mod no_load;
mod thermal;
mod tool_wear;

use super::diagnose::cannot_use;
use super::{CannotRun, CommandOutcome, CommandResult, load_configuration, print_json, print_text};
use crate::diagnosis::{Copies, read_recordings, write_output};
use crate::identification;
use adapters::Recording;
use clap::{Args, Subcommand};
use rules::estimators::regression::Refusal;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct IdentifyArguments {
    #[command(subcommand)]
    what: IdentifyCommand,
}

#[derive(Debug, Subcommand)]
enum IdentifyCommand {
    /// No-load power per gear stage and speed, from the idle stretches of recordings.
    NoLoad(no_load::NoLoadArguments),
    /// Load loss per gear stage, from cuts whose power at the edge is known besides.
    LoadLoss(load_loss::LoadLossArguments),
    /// Spindle current over feed, by speed and depth of cut, from cuts at several feeds.
    FeedCurve(feed_curve::FeedCurveArguments),
    /// Thermal error from temperatures: which sensors, static or late, with intervals.
    Thermal(thermal::ThermalArguments),
    /// Cutting power over wear, speed, feed and depth; the cuts to make for it; the library of models.
    ToolWear(Box<tool_wear::ToolWearArguments>),
}

/// What every subcommand reads and writes.
#[derive(Debug, Args)]
struct IdentifyFiles {
    /// Recordings (recording/1): .csv, .csv.gz, .parquet, or history:DB?from=..&to=..; several are put together.
    #[arg(long, value_name = "R.csv", num_args = 1.., required = true)]
    recording: Vec<String>,
    /// Print JSON (identify/1).
    #[arg(long)]
    json: bool,
    /// Write what was learned in the form that the gateway reads; - is standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// The box whose page shows how the model was found.
#[derive(Debug, Args)]
struct ShownBy {
    /// Configuration of the box whose page is to show the answer, for its data directory.
    #[arg(long, value_name = "FILE", conflicts_with = "data_dir")]
    config: Option<PathBuf>,
    /// Data directory of the box whose page is to show the answer: it is kept there under identified/.
    #[arg(long, value_name = "DIR")]
    data_dir: Option<PathBuf>,
}

impl ShownBy {
    /// Keeps the answer on this subject, and says where. Without a box that is named nothing is kept: recordings may be of any machine.
    /// `history`: a history that the model is stored in; its directory is that of the box where none is named.
    fn store_answer(
        &self,
        subject: &str,
        learned: &mut IdentifyOutput,
        history: Option<&Path>,
    ) -> Result<(), CannotRun> {
        let named = match (&self.data_dir, &self.config) {
            (Some(directory), _) => Some(directory.clone()),
            (None, Some(config)) => Some(load_configuration(Some(config))?.gateway.data_dir),
            (None, None) => history.and_then(Path::parent).map(Path::to_owned),
        };
        let Some(directory) = named else { return Ok(()) };
        let path = identification::save_answer(&directory, subject, &learned.json).map_err(CannotRun::from_error)?;
        learned.text += &format!("\nfor the page of the box: {}\n", path.display());
        Ok(())
    }
}

/// What a subcommand learned.
struct IdentifyOutput {
    text: String,
    json: Value,
    /// The form that the gateway reads.
    file: Option<String>,
}

impl IdentifyFiles {
    /// The recordings, put together; rows that were refused are told on standard error.
    fn read(&self) -> Result<Recording, CannotRun> {
        let given = read_recordings(&self.recording, Copies::CountOnce).map_err(|problems| cannot_use(&problems))?;
        given.warnings.iter().for_each(|warning| eprintln!("{warning}"));
        Ok(given.recording)
    }

    /// Prints the result or the refusal, and writes the file.
    fn report_result(&self, what: &str, learned: Result<IdentifyOutput, Refusal>) -> CommandResult {
        match learned {
            Ok(learned) => {
                match (&self.out, &learned.file) {
                    (Some(path), Some(file)) => write_output(path, file).map_err(CannotRun::from_error)?,
                    (Some(path), None) => eprintln!(
                        "note: nothing was written to {}: nothing in it is of use to the gateway",
                        path.display()
                    ),
                    (None, _) => {}
                }
                let document = identification::build_answer(what, &learned.json);
                if self.json {
                    print_json(&document)
                } else {
                    print_text(&learned.text)
                }
                Ok(CommandOutcome::Fine)
            }
            Err(refusal) => {
                let document = json!({ "schema": "identify/1", "what": what, "refused": refusal, "learned": null });
                if self.json {
                    print_json(&document)
                } else {
                    print_text(&format!("cannot tell: {refusal}\n"))
                }
                Ok(CommandOutcome::No)
            }
        }
    }
}

pub(super) fn run_identification(arguments: &IdentifyArguments) -> CommandResult {
    match &arguments.what {
        IdentifyCommand::NoLoad(arguments) => no_load::run(arguments),
        IdentifyCommand::LoadLoss(arguments) => load_loss::run(arguments),
        IdentifyCommand::FeedCurve(arguments) => feed_curve::run(arguments),
        IdentifyCommand::Thermal(arguments) => thermal::run(arguments),
        IdentifyCommand::ToolWear(arguments) => tool_wear::run(arguments),
    }
}
