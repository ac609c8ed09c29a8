//! `cnc-gateway update`: another version of the program, with the way back.

use super::{CannotRun, CommandOutcome, CommandResult, print_text};
use crate::update::{
    CONFIRM_WITHIN, HOME, PublicKeySource, SystemdService, TrialOutcome, UpdateError, VersionSlots, read_bundle,
    run_trial,
};
use clap::Args;
use std::path::{Path, PathBuf};
use std::process::Command;

#[derive(Debug, Args)]
pub(super) struct UpdateArguments {
    /// The update, a .tar.gz with the program; its signature stands beside it as FILE.minisig. Without it: which version runs.
    file: Option<PathBuf>,
    /// Public key of whoever signs updates: a file that minisign wrote, or the key itself.
    #[arg(long, value_name = "KEY", requires = "file")]
    verify: Option<String>,
    /// Install it although its version is not newer than the one that runs.
    #[arg(long)]
    allow_older: bool,
    /// Configuration that the new program must accept.
    #[arg(long, value_name = "FILE", default_value = "/etc/cnc-gateway/cnc-gateway.toml")]
    config: PathBuf,
    /// Directory of the data of the service.
    #[arg(long, value_name = "DIR", default_value = "/var/lib/cnc-gateway")]
    data_dir: PathBuf,
    /// Folder of the versions.
    #[arg(long, value_name = "DIR", default_value = HOME, hide = true)]
    home: PathBuf,
}

/// Installs an update, or tells which version runs.
pub(super) fn run(arguments: &UpdateArguments) -> CommandResult {
    let slots = VersionSlots::open(&arguments.home).map_err(|error| to_cannot_run(&error))?;
    let Some(file) = &arguments.file else { return print_versions(&slots, arguments) };
    let key = key_source(arguments.verify.as_deref())?;
    let version = stage_update(&slots, arguments, file, &key).map_err(|error| to_cannot_run(&error))?;
    print_text(&format!("{version} is in its place beside the running one; the service is started anew\n"));
    let outcome = run_trial(&slots, &version, &arguments.data_dir, &SystemdService, CONFIRM_WITHIN);
    match outcome.map_err(|error| to_cannot_run(&error))? {
        TrialOutcome::Confirmed => {
            print_text(&format!("{version} runs and is well. The gate is not armed: arming ends with every start\n"));
            Ok(CommandOutcome::Fine)
        }
        TrialOutcome::RolledBack { reason } => {
            print_text(&format!("{version} was taken back: {reason}. The version before runs again\n"));
            Ok(CommandOutcome::No)
        }
    }
}

fn to_cannot_run(error: &UpdateError) -> CannotRun {
    CannotRun::new(error.to_string(), "what ran before still runs")
}

fn key_source(given: Option<&str>) -> Result<PublicKeySource, CannotRun> {
    let next = "--verify minisign.pub, the public key of whoever signs updates";
    let given =
        given.ok_or_else(|| CannotRun::new("an update is installed only when its signature is verified", next))?;
    Ok(match Path::new(given).is_file() {
        true => PublicKeySource::File(given.into()),
        false => PublicKeySource::Text(given.to_owned()),
    })
}

fn print_versions(slots: &VersionSlots, arguments: &UpdateArguments) -> CommandResult {
    let running = slots.running_slot().unwrap_or_default();
    let rolled_back = std::fs::read_to_string(arguments.home.join("rolled-back")).unwrap_or_default();
    let trial = slots.read_trial().map(|trial| {
        format!("{} is on trial, {} starts so far; before it ran {}\n", trial.new, trial.starts, trial.before)
    });
    print_text(&format!("runs: {running}\n{}{rolled_back}", trial.unwrap_or_default()));
    Ok(CommandOutcome::Fine)
}

/// Verifies, unpacks, asks the new program whether it runs here and accepts the configuration, and keeps it. Gives its version.
fn stage_update(
    slots: &VersionSlots,
    arguments: &UpdateArguments,
    file: &Path,
    key: &PublicKeySource,
) -> Result<String, UpdateError> {
    let bundle = read_bundle(file, key)?;
    let program = slots.stage_program(&bundle.program)?;
    let new = version_of(&program)?;
    let running = env!("CARGO_PKG_VERSION");
    if !arguments.allow_older && parse_version(&new) <= parse_version(running) {
        return Err(UpdateError::Older { new, running: running.to_owned() });
    }
    ask_about_configuration(&program, &arguments.config, &arguments.data_dir)?;
    slots.keep_staged(&new)?;
    Ok(new)
}

fn version_of(program: &Path) -> Result<String, UpdateError> {
    let output = Command::new(program).arg("--version").output();
    let output = output.map_err(|error| UpdateError::DoesNotRun(error.to_string()))?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    match text.trim().strip_prefix("cnc-gateway ") {
        Some(version) if output.status.success() => Ok(version.to_owned()),
        _ => Err(UpdateError::DoesNotRun(format!("--version answers {:?}", text.trim()))),
    }
}

/// The numbers of a version, for comparing.
fn parse_version(version: &str) -> Vec<u64> {
    let numbers = version.split(['-', '+']).next().unwrap_or_default();
    numbers.split('.').map(|part| part.parse().unwrap_or(0)).collect()
}

fn ask_about_configuration(program: &Path, config: &Path, data_dir: &Path) -> Result<(), UpdateError> {
    let output = Command::new(program)
        .arg("check")
        .arg("--config")
        .arg(config)
        .env("CNC_GATEWAY__GATEWAY__DATA_DIR", data_dir)
        .output()
        .map_err(|error| UpdateError::DoesNotRun(error.to_string()))?;
    if output.status.success() {
        return Ok(());
    }
    let said = [output.stdout, output.stderr].concat();
    Err(UpdateError::Configuration(String::from_utf8_lossy(&said).trim().to_owned()))
}

#[cfg(test)]
mod tests {
    use super::parse_version;

    #[test]
    fn versions_are_compared_by_their_numbers() {
        assert!(parse_version("0.10.0") > parse_version("0.9.3"));
        assert!(parse_version("1.0.0-rc1") > parse_version("0.9.9"));
        assert!(parse_version("0.1.0") <= parse_version("0.1.0"));
    }
}
