//! `cnc-gateway update`: another version of the program, with the way back. What it prints of the box is what it has seen of the box.

use super::{CannotRun, CommandOutcome, CommandResult, load_configuration, print_text};
use crate::update::{
    BoxState, CONFIRM_WITHIN, HOME, PACKAGE_SLOT, PageAnswer, PublicKeySource, SystemdService, Trial, TrialOutcome,
    UpdateError, UpdateKey, VersionSlots, ask_page, look_until_runs, read_bundle, run_trial,
};
use clap::Args;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// After an update the version that should run has this time until its page answers, s: a start takes seconds, the way back of a large
/// history a minute.
const LOOK_WITHIN_S: u64 = 60;
/// A page that is asked without an update may be starting, s.
const ONE_LOOK_S: u64 = 0;

#[derive(Debug, Args)]
pub(super) struct UpdateArguments {
    /// The update, a .tar.gz with the program; its signature stands beside it as FILE.minisig. Without it: which version runs.
    file: Option<PathBuf>,
    /// Public key of whoever signs updates: a file that minisign wrote, or the key itself. The box keeps the first one.
    #[arg(long, value_name = "KEY", requires = "file")]
    verify: Option<String>,
    /// Keep another public key for the updates from now on, in the place of the first one.
    #[arg(long, value_name = "KEY", conflicts_with = "file")]
    change_key: Option<String>,
    /// Install it although its version is not newer than the confirmed one.
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
    /// How long the new version has until it says that it is well, s.
    #[arg(long, value_name = "S", default_value_t = CONFIRM_WITHIN.as_secs_f64(), hide = true)]
    confirm_within: f64,
}

impl UpdateArguments {
    /// Asks the page that the configuration in force names.
    fn ask_page(&self) -> PageAnswer {
        match load_configuration(Some(&self.config)) {
            Ok(config) if config.http.enabled => ask_page(&config.http.listen, config.http.tls),
            Ok(_) => PageAnswer::NotAsked("the configuration serves none".to_owned()),
            Err(_) => PageAnswer::NotAsked(format!("{} cannot be read or is refused", self.config.display())),
        }
    }

    /// What is seen of the box, as soon as this slot runs, or after this time.
    fn look_until(&self, slot: &str, within_s: u64) -> BoxState {
        look_until_runs(slot, &SystemdService, || self.ask_page(), Duration::from_secs(within_s))
    }
}

/// Installs an update, or tells which version runs.
pub(super) fn run(arguments: &UpdateArguments) -> CommandResult {
    let slots = VersionSlots::open(&arguments.home).map_err(|error| describe_error(arguments, None, &error))?;
    if let Some(key) = &arguments.change_key {
        return change_key(&slots, key).map_err(|error| describe_error(arguments, Some(&slots), &error));
    }
    match &arguments.file {
        None => print_versions(&slots, arguments),
        Some(file) => {
            install_update(&slots, arguments, file).map_err(|error| describe_error(arguments, Some(&slots), &error))
        }
    }
}

fn install_update(
    slots: &VersionSlots,
    arguments: &UpdateArguments,
    file: &Path,
) -> Result<CommandOutcome, UpdateError> {
    let _alone = slots.lock_updates()?;
    let given = arguments.verify.as_deref().map(|given| UpdateKey::read(&key_source(given))).transpose()?;
    let key = UpdateKey::choose(given, UpdateKey::read_kept(slots.home())?)?;
    let before = slots.confirmed_slot(&arguments.data_dir);
    let version = stage_update(slots, arguments, file, (&key, &before))?;
    put_back_unconfirmed(slots, &before)?;
    slots.keep_staged(&version)?;
    key.keep(slots.home())?;
    print_text(&format!("{version} is in its place beside {before}; the service is started anew with it\n"));
    let trial = Trial { before, new: version };
    let within = Duration::try_from_secs_f64(arguments.confirm_within).unwrap_or(CONFIRM_WITHIN);
    Ok(match run_trial(slots, &trial, &arguments.data_dir, &SystemdService, within)? {
        TrialOutcome::Confirmed => describe_confirmed(arguments, &trial),
        TrialOutcome::TakenBack { reason, linked } => describe_taken_back(arguments, &trial, &reason, &linked),
    })
}

fn describe_confirmed(arguments: &UpdateArguments, trial: &Trial) -> CommandOutcome {
    let seen = arguments.look_until(&trial.new, LOOK_WITHIN_S);
    if seen.runs_slot(&trial.new) {
        print_text(&format!(
            "{} has reported good health and stays. Seen now: {seen}. The gate is not armed: arming ends with every start\n",
            trial.new
        ));
        return CommandOutcome::Fine;
    }
    print_text(&format!("{} had reported good health, and then: {seen}. {}\n", trial.new, advise_look()));
    CommandOutcome::No
}

fn describe_taken_back(arguments: &UpdateArguments, trial: &Trial, reason: &str, linked: &str) -> CommandOutcome {
    let seen = arguments.look_until(linked, LOOK_WITHIN_S);
    let next = if seen.runs_slot(linked) { String::new() } else { format!(". {}", advise_look()) };
    print_text(&format!(
        "{} was taken back: {reason}. The next starts run {linked}. Seen now: {seen}{next}\n",
        trial.new
    ));
    CommandOutcome::No
}

fn advise_look() -> &'static str {
    "Look at it: journalctl -u cnc-gateway; the service manager tries again by itself"
}

/// A version that is on trial from an update before is not what the next one goes back to.
fn put_back_unconfirmed(slots: &VersionSlots, before: &str) -> Result<(), UpdateError> {
    if let Some(linked) = slots.linked_slot().filter(|linked| linked != before) {
        slots.go_back(before)?;
        print_text(&format!("{linked} was on trial and has not been confirmed; {before} is put back first\n"));
    }
    slots.end_trial()
}

/// The error, and what is seen of the box after it.
fn describe_error(arguments: &UpdateArguments, slots: Option<&VersionSlots>, error: &UpdateError) -> CannotRun {
    let Some(slots) = slots else {
        return CannotRun::new(error.to_string(), "");
    };
    let linked = slots.linked_slot().unwrap_or_else(|| PACKAGE_SLOT.to_owned());
    let seen = arguments.look_until(&linked, ONE_LOOK_S);
    CannotRun::new(error.to_string(), format!("the next start runs {linked}. Seen now: {seen}"))
}

fn key_source(given: &str) -> PublicKeySource {
    match Path::new(given).is_file() {
        true => PublicKeySource::File(given.into()),
        false => PublicKeySource::Text(given.to_owned()),
    }
}

fn change_key(slots: &VersionSlots, given: &str) -> Result<CommandOutcome, UpdateError> {
    let key = UpdateKey::read(&key_source(given))?;
    let _alone = slots.lock_updates()?;
    key.keep(slots.home())?;
    print_text(&format!("updates of this box are verified with the key {} from now on\n", key.text()));
    Ok(CommandOutcome::Fine)
}

fn print_versions(slots: &VersionSlots, arguments: &UpdateArguments) -> CommandResult {
    let linked = slots.linked_slot().unwrap_or_default();
    let seen = arguments.look_until(&linked, ONE_LOOK_S);
    let mut text = format!("the next start runs: {linked}\nseen now: {seen}\n");
    let is_unconfirmed = slots.confirmed_slot(&arguments.data_dir) != linked;
    if let Some(trial) = slots.read_trial().filter(|trial| is_unconfirmed && trial.new == linked) {
        let left = slots.count_starts_left();
        text += &format!("{} is on trial, with {left} more starts; before it: {}\n", trial.new, trial.before);
    }
    if let Some(trial) = slots.read_rolled_back() {
        text += &format!("{} was taken back before a start: nothing had confirmed it\n", trial.new);
    }
    text += &match UpdateKey::read_kept(slots.home()) {
        Ok(Some(key)) => format!("updates are verified with the key {}\n", key.text()),
        Ok(None) => "no update was verified here yet, so no key is kept\n".to_owned(),
        Err(error) => format!("{error}\n"),
    };
    print_text(&text);
    Ok(CommandOutcome::Fine)
}

/// Verifies, unpacks, asks the new program whether it runs here and accepts the configuration. Gives its version.
fn stage_update(
    slots: &VersionSlots,
    arguments: &UpdateArguments,
    file: &Path,
    (key, before): (&UpdateKey, &str),
) -> Result<String, UpdateError> {
    let bundle = read_bundle(file, key)?;
    let program = slots.stage_program(&bundle.program)?;
    let new = version_of(&program)?;
    if new == before {
        return Err(UpdateError::InPlace { slot: new });
    }
    // A version that does not answer is no reason to refuse a newer one.
    let confirmed = version_of(&slots.program_path(before)).unwrap_or_else(|_| env!("CARGO_PKG_VERSION").to_owned());
    if !arguments.allow_older && parse_version(&new) <= parse_version(&confirmed) {
        return Err(UpdateError::Older { new, confirmed });
    }
    ask_about_configuration(&program, &arguments.config, &arguments.data_dir)?;
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
