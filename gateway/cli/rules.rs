//! `cnc-gateway rules`: what scripts can see, call and set; their trials; edited ones over stored history.

use super::lang::language;
use super::{CannotRun, CommandOutcome, CommandResult, print_json, print_text, refuse_scripts};
use crate::backtest::{BacktestPlan, run_backtest};
use crate::config::{self, Config};
use crate::history::Reader;
use crate::reload::{read_directory, read_file};
use crate::{active_scripts, moment, settings};
use ::rules::physics::explain::Language;
use ::rules::script::{self, ScriptFile, ScriptProblem, ScriptSet, SettingValues, TrialResult};
use clap::{Args, Subcommand};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct RulesArguments {
    #[command(subcommand)]
    what: RulesCommand,
}

#[derive(Debug, Subcommand)]
enum RulesCommand {
    /// Every method, variable, handler, function, trial function and setting of scripts, with units.
    Api {
        /// Print JSON (rules-api/1), with the texts in both languages.
        #[arg(long)]
        json: bool,
    },
    /// Run the trials that are written in script files; exit code 1 when one fails.
    Test(TestArguments),
    /// Run edited scripts over stored history beside the running ones: alarms lost and gained, requests, states. Exit code 1
    /// when an alarm or a stop is lost or an edited script fails.
    Backtest(BacktestArguments),
}

#[derive(Debug, Args)]
struct TestArguments {
    /// Script files or directories of them; without any, the scripts of the configuration.
    #[arg(value_name = "FILES")]
    files: Vec<PathBuf>,
    /// Configuration file; without one the built-in configuration.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Print JSON (trials/1).
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct BacktestArguments {
    /// Beginning: so long before the newest sample (24h, 7d, 90m), or 2026-01-31T08:15:00Z.
    #[arg(long, allow_hyphen_values = true, value_name = "TIME", default_value = "24h")]
    since: String,
    /// End (excluded), in the same notation; without it the newest sample.
    #[arg(long, allow_hyphen_values = true, value_name = "TIME")]
    until: Option<String>,
    /// Directory of the edited scripts; without it that of the configuration, as it is on disk.
    #[arg(long, value_name = "DIR")]
    scripts: Option<PathBuf>,
    /// Directory of the scripts to compare with; without it those that were last in charge on this box, or those that come
    /// with the gateway.
    #[arg(long, value_name = "DIR")]
    running: Option<PathBuf>,
    /// Configuration file; without one the built-in configuration.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// History database; without it that of the data directory.
    #[arg(long, value_name = "DB", conflicts_with = "data_dir")]
    history: Option<PathBuf>,
    /// Data directory of the gateway; without it that of the configuration.
    #[arg(long, value_name = "DIR")]
    data_dir: Option<PathBuf>,
    /// Least time between two samples, s: leaves samples out, which is faster and coarser. 0 takes every sample.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
    every: f64,
    /// Print JSON (backtest/1).
    #[arg(long)]
    json: bool,
}

/// Does what was asked.
pub(super) fn run(arguments: &RulesArguments) -> CommandResult {
    match &arguments.what {
        RulesCommand::Api { json: true, .. } => print_json(&script::api_json()),
        RulesCommand::Api { .. } => print_text(&script::format_api_reference(language() == Language::Zh)),
        RulesCommand::Test(arguments) => return test_scripts(arguments),
        RulesCommand::Backtest(arguments) => return compare_over_history(arguments),
    }
    Ok(CommandOutcome::Fine)
}

pub(super) fn load_configuration(file: Option<&Path>) -> Result<Config, CannotRun> {
    let environment =
        std::env::vars_os().filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)));
    config::load(file, environment).map_err(|problems| {
        let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
        CannotRun::new(lines.join("\n"), "")
    })
}

/// The scripts of the configuration, or those that come with the gateway where the directory is not there yet.
pub(super) fn load_configured_scripts(config: &Config) -> Result<Vec<ScriptFile>, CannotRun> {
    let directory = &config.scripts.directory;
    if directory.is_dir() {
        read_directory(directory).map_err(refuse_scripts)
    } else {
        Ok(script::list_shipped_scripts())
    }
}

fn read_named_scripts(files: &[PathBuf]) -> Result<Vec<ScriptFile>, CannotRun> {
    let mut found = Vec::new();
    for path in files {
        if path.is_dir() {
            found.extend(read_directory(path).map_err(refuse_scripts)?);
        } else {
            found.push(read_file(path).map_err(|problem| refuse_scripts(vec![problem]))?);
        }
    }
    Ok(found)
}

fn test_scripts(arguments: &TestArguments) -> CommandResult {
    let (files, values) = if arguments.files.is_empty() {
        let config = load_configuration(arguments.config.as_deref())?;
        (
            load_configured_scripts(&config)?,
            settings::read(&settings::values_path(&config.gateway.data_dir)).map_err(refuse_scripts)?,
        )
    } else {
        (read_named_scripts(&arguments.files)?, SettingValues::default())
    };
    let (results, problems) = run_trials(&files, &values);
    let fine = problems.is_empty() && results.iter().all(|result| result.problem.is_none());
    if arguments.json {
        print_json(&json!({
            "schema": "trials/1",
            "fine": fine,
            "trials": results.iter().map(trial_to_json).collect::<Vec<_>>(),
            "problems": problems.iter().map(problem_to_json).collect::<Vec<_>>(),
        }));
    } else {
        print_text(&describe_trials(&files, &results, &problems));
    }
    Ok(if fine { CommandOutcome::Fine } else { CommandOutcome::No })
}

/// Each file by itself, so that one that does not compile leaves the others their trials; then all of them together.
fn run_trials(files: &[ScriptFile], values: &SettingValues) -> (Vec<TrialResult>, Vec<ScriptProblem>) {
    let (mut results, mut problems) = (Vec::new(), Vec::new());
    for file in files {
        match script::compile_one(file, files, values) {
            Ok(set) => results.extend(script::run_trials(&set)),
            Err(found) => problems.extend(found),
        }
    }
    if problems.is_empty() {
        problems.extend(script::compile_with(files, values).err().into_iter().flatten());
    }
    (results, problems)
}

fn describe_trials(files: &[ScriptFile], results: &[TrialResult], problems: &[ScriptProblem]) -> String {
    let mut text = String::new();
    for result in results {
        let (file, line, name) = (&result.file, result.line, &result.name);
        match &result.problem {
            None => text += &format!("ok      {file}:{line} {name} ({} met, {:.1} s)\n", result.met, result.passed_s),
            Some(problem) => text += &format!("FAILED  {problem}\n"),
        }
    }
    for problem in problems {
        text += &format!("{problem}\n");
    }
    let without = files.iter().filter(|file| !results.iter().any(|result| *result.file == *file.name));
    for file in without.filter(|file| !problems.iter().any(|problem| problem.file == file.name)) {
        text += &format!(
            "none    {}: write fn trial_...() {{ given(#{{ ... }}); after_s(1.0); expect_...; }}\n",
            file.name
        );
    }
    let failed = results.iter().filter(|result| result.problem.is_some()).count();
    text += &format!("{} trials, {failed} failed, {} other problems\n", results.len(), problems.len());
    text
}

fn trial_to_json(result: &TrialResult) -> Value {
    json!({
        "file": &*result.file, "line": result.line, "name": result.name, "passed": result.problem.is_none(),
        "met": result.met, "seconds": result.passed_s, "problem": result.problem.as_ref().map(problem_to_json),
    })
}

fn problem_to_json(problem: &ScriptProblem) -> Value {
    let ScriptProblem { file, line, column, what, next } = problem;
    json!({ "file": file, "line": line, "column": column, "what": what, "next": next })
}

fn compare_over_history(arguments: &BacktestArguments) -> CommandResult {
    let config = load_configuration(arguments.config.as_deref())?;
    let of_directory = arguments.data_dir.as_ref().map(|directory| directory.join("history.db"));
    let history = arguments.history.clone().or(of_directory).unwrap_or_else(|| config.history.path.clone());
    let newest_ns = read_newest_ns(&history)?;
    if !(0.0..=3600.0).contains(&arguments.every) {
        return Err(CannotRun::new(format!("--every {} is outside 0 to 3600 s", arguments.every), ""));
    }
    #[expect(clippy::cast_possible_truncation, reason = "at most an hour")]
    let every_ns = (arguments.every * 1e9) as i64;
    let report = run_backtest(BacktestPlan {
        from_ns: parse_instant(&arguments.since, newest_ns)?,
        to_ns: arguments.until.as_deref().map(|until| parse_instant(until, newest_ns)).transpose()?,
        history,
        every_ns,
        running: load_running_set(arguments, &config)?,
        edited: load_edited_set(arguments, &config)?,
    });
    let report = report.map_err(|error| CannotRun::new(error.to_string(), ""))?;
    if arguments.json {
        print_json(&report.to_json());
    } else {
        print_text(&report.to_string());
    }
    Ok(if report.is_worse() { CommandOutcome::No } else { CommandOutcome::Fine })
}

fn read_newest_ns(history: &Path) -> Result<i64, CannotRun> {
    let span = Reader::open(history).and_then(|reader| reader.read_present_span());
    let span = span.map_err(|error| CannotRun::new(error.to_string(), "--history names the database"))?;
    span.map(|(_, newest_ns)| newest_ns).ok_or_else(|| {
        CannotRun::new(format!("{} holds no samples yet", history.display()), "let the box run for a while first")
    })
}

/// `24h` means as much before the newest sample.
fn parse_instant(text: &str, newest_ns: i64) -> Result<i64, CannotRun> {
    let back = text.ends_with(['s', 'm', 'h', 'd']) && text.starts_with(|c: char| c.is_ascii_digit());
    let text = if back { format!("-{text}") } else { text.to_owned() };
    moment::parse(&text, newest_ns).map_err(CannotRun::from_error)
}

fn load_running_set(arguments: &BacktestArguments, config: &Config) -> Result<ScriptSet, CannotRun> {
    let files = match &arguments.running {
        Some(directory) => read_directory(directory).map_err(refuse_scripts)?,
        None => active_scripts::read_texts(&config.gateway.data_dir).unwrap_or_else(script::list_shipped_scripts),
    };
    script::compile_with(&files, &values_for(&files, config)).map_err(refuse_scripts)
}

/// Failing trials do not end it: what a script does to the history may be looked at before they are rewritten. They are told.
fn load_edited_set(arguments: &BacktestArguments, config: &Config) -> Result<ScriptSet, CannotRun> {
    let files = match &arguments.scripts {
        Some(directory) => read_directory(directory).map_err(refuse_scripts)?,
        None => load_configured_scripts(config)?,
    };
    script::compile_with(&files, &values_for(&files, config)).map_err(refuse_scripts)
}

/// The settings of this machine, where these scripts declare them all; otherwise the defaults.
fn values_for(files: &[ScriptFile], config: &Config) -> SettingValues {
    let values = settings::read(&settings::values_path(&config.gateway.data_dir)).unwrap_or_default();
    if script::compile_with(files, &values).is_ok() { values } else { SettingValues::default() }
}
