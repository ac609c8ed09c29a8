//! `cnc-gateway check`: is everything right that the user wrote?

use super::{CannotRun, CommandOutcome, CommandResult, print_json, print_text};
use crate::check::check_configuration;
use crate::config::{self, keys};
use ::rules::script::{Declared, list_declarations, list_shipped_scripts};
use clap::Args;
use gateway_base::limits::{TimeLimits, limit_memory_and_time};
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
    /// Within the limits of a process that reads for the page. Never given by a person.
    #[arg(long = "limited", hide = true)]
    has_limits: bool,
}

/// Checks, or prints a table.
pub(super) fn run(arguments: &CheckArguments) -> CommandResult {
    if arguments.keys {
        print_text(&keys::format_table());
        print_text(&crate::settings::format_table(&read_declared_settings(arguments.config.as_deref())?));
    } else if arguments.example {
        print_text(&keys::format_example());
    } else if arguments.vocabulary {
        print_text(&::rules::script::format_vocabulary(
            super::lang::language() == ::rules::physics::explain::Language::Zh,
        ));
    } else {
        return report_problems(arguments);
    }
    Ok(CommandOutcome::Fine)
}

/// The settings that the scripts of a configuration declare, or those that come with the gateway.
fn read_declared_settings(config: Option<&Path>) -> Result<Vec<Declared>, CannotRun> {
    let files = match config {
        Some(_) => super::rules::load_configured_scripts(&super::rules::load_configuration(config)?)?,
        None => list_shipped_scripts(),
    };
    list_declarations(&files).map_err(super::refuse_scripts)
}

fn report_problems(arguments: &CheckArguments) -> CommandResult {
    if arguments.has_limits {
        limit_memory_and_time(TimeLimits::from_bytes(0)).map_err(CannotRun::from_error)?;
    }
    let unreadable = arguments.config.as_deref().filter(|path| std::fs::File::open(path).is_err());
    if let Some(path) = unreadable {
        let problems = config::load(Some(path), []).err().unwrap_or_default();
        let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
        return Err(CannotRun::new(lines.join("\n"), ""));
    }
    let environment =
        std::env::vars_os().filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)));
    let report = check_configuration(arguments.config.as_deref(), environment);
    if arguments.json {
        let json = serde_json::json!({ "schema": "check/1", "fine": report.is_fine(), "read": report.read, "problems": report.problems });
        print_json(&json);
    } else {
        print_text(&report.to_string());
    }
    Ok(if report.is_fine() { CommandOutcome::Fine } else { CommandOutcome::No })
}
