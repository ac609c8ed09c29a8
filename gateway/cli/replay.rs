//! `cnc-gateway replay`: recordings through the same pipeline as fast as possible.

use super::{CannotRun, CommandOutcome, CommandResult, print_json, recipe_from, scripts_from};
use crate::config;
use crate::replay::{ReplayPlan, replay_files};
use clap::Args;
use std::io::IsTerminal;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct ReplayArguments {
    /// Recordings (.csv, .csv.gz), in order.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// History database to store into; created when absent. The same command again stores nothing twice.
    #[arg(long, value_name = "DB")]
    history: Option<PathBuf>,
    /// Directory of scripts; without it those that come with the gateway decide.
    #[arg(long, value_name = "DIR")]
    scripts: Option<PathBuf>,
    /// Operations recipe: fills in depth of cut, diameter, tool and material where the recordings lack them.
    #[arg(long, value_name = "FILE")]
    operations: Option<PathBuf>,
    /// History whose library of wear models is used; without it that of --history.
    #[arg(long, value_name = "DB")]
    wear_models: Option<PathBuf>,
    /// Print the summary as JSON.
    #[arg(long)]
    json: bool,
}

/// Replays and prints the summary.
pub(super) fn run(arguments: ReplayArguments) -> CommandResult {
    let ReplayArguments { files, history, scripts, operations, wear_models, json } = arguments;
    let operations = operations.as_deref().map(recipe_from).transpose()?;
    let plan = ReplayPlan {
        files,
        operations,
        models: wear_models,
        history,
        progress: std::io::stderr().is_terminal(),
        talk: true,
    };
    let config = config::load(None, []).map_err(|problems| CannotRun::new(format!("{problems:?}"), ""))?;
    let summary = replay_files(&plan, scripts_from(scripts.as_deref())?, config.gate)?;
    if json {
        print_json(&summary.to_json());
    } else {
        super::print_text(&summary.to_string());
    }
    Ok(CommandOutcome::Fine)
}
