//! `cnc-gateway check`: is everything right that the user wrote?

use super::{CannotRun, CommandOutcome, CommandResult, print, print_json};
use crate::check::check;
use crate::config::{self, keys};
use ::rules::script::{Declared, declarations, shipped};
use clap::Args;
use std::path::{Path, PathBuf};

/// Reads configuration, scripts, model and recordings and tells everything that is wrong at once.
#[derive(Debug, Args)]
pub(super) struct CheckArguments {
    /// Configuration file; without one the built-in configuration is checked.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// The result as JSON.
    #[arg(long)]
    json: bool,
    /// Print every key of the configuration, and every setting of the scripts, with default, range and meaning.
    #[arg(long, group = "print")]
    keys: bool,
    /// Print a complete configuration file to start from.
    #[arg(long, group = "print")]
    example: bool,
    /// Print everything that a script can see, call and set.
    #[arg(long, group = "print")]
    vocabulary: bool,
}

/// Checks, or prints a table.
pub(super) fn run(arguments: &CheckArguments) -> CommandResult {
    if arguments.keys {
        print(&keys::table());
        print(&crate::settings::table(&read_declared_settings(arguments.config.as_deref())?));
    } else if arguments.example {
        print(&keys::example());
    } else if arguments.vocabulary {
        print(&::rules::script::vocabulary(super::lang::language() == ::rules::physics::explain::Language::Zh));
    } else {
        return tell(arguments);
    }
    Ok(CommandOutcome::Fine)
}

/// The settings that the scripts of a configuration declare, or those that come with the gateway.
fn read_declared_settings(config: Option<&Path>) -> Result<Vec<Declared>, CannotRun> {
    let files = match config {
        Some(_) => super::rules::configured(&super::rules::configuration(config)?)?,
        None => shipped(),
    };
    declarations(&files).map_err(super::refused)
}

fn tell(arguments: &CheckArguments) -> CommandResult {
    let unreadable = arguments.config.as_deref().filter(|path| std::fs::File::open(path).is_err());
    if let Some(path) = unreadable {
        let problems = config::load(Some(path), []).err().unwrap_or_default();
        let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
        return Err(CannotRun::new(lines.join("\n"), ""));
    }
    let environment =
        std::env::vars_os().filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)));
    let report = check(arguments.config.as_deref(), environment);
    if arguments.json {
        let json = serde_json::json!({ "schema": "check/1", "fine": report.fine(), "read": report.read, "problems": report.problems });
        print_json(&json);
    } else {
        print(&report.to_string());
    }
    Ok(if report.fine() { CommandOutcome::Fine } else { CommandOutcome::No })
}
