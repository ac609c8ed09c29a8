//! Waiting until the service has confirmed a version, and going back when it does not.

use super::slots::{Trial, VersionSlots};
use super::{PACKAGE_SLOT, UpdateError};
use gateway_base::files::read_text;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// The service is well for this long before it confirms its own version: the time in which a leak of threads, a source that
/// hangs or a history that does not commit has shown itself. Longer would keep an integrator waiting.
pub const WELL_FOR: Duration = Duration::from_secs(30);
/// An update waits this long for the confirmation before it goes back.
pub const CONFIRM_WITHIN: Duration = Duration::from_secs(75);
/// The longest time in which a history is copied: ten gigabytes at the pace of a worn card.
const COPY_WITHIN: Duration = Duration::from_secs(1_200);
/// The file in the data directory in which the service confirms a version: the name of its slot.
pub(super) const CONFIRMED: &str = "confirmed";
/// The name of a version, and nothing longer, bytes.
const CONFIRMED_MAX: usize = 256;

/// How the service is started anew.
pub trait ServiceControl {
    /// Starts it anew and returns when that was asked for.
    ///
    /// # Errors
    /// The service manager refuses.
    fn restart(&self) -> Result<(), UpdateError>;
}

/// The service of the package.
#[derive(Debug, Clone, Copy)]
pub struct SystemdService;

impl ServiceControl for SystemdService {
    fn restart(&self) -> Result<(), UpdateError> {
        let output = Command::new("systemctl").args(["restart", "--no-block", "cnc-gateway.service"]).output();
        match output {
            Ok(output) if output.status.success() => Ok(()),
            Ok(output) => Err(UpdateError::Service(String::from_utf8_lossy(&output.stderr).trim().to_owned())),
            Err(error) => Err(UpdateError::Service(format!("systemctl cannot be started: {error}"))),
        }
    }
}

/// How a trial ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TrialOutcome {
    /// The new version is well and stays.
    Confirmed,
    /// It was not; the one before runs again.
    RolledBack {
        /// What spoke against the new version.
        reason: String,
    },
}

/// Puts a kept version on trial: notes it, moves the link, starts the service anew, and waits. Goes back when the service
/// does not confirm it in time.
///
/// # Errors
/// A file cannot be written, or the service cannot be started at all; the version before is in its place again then.
pub fn run_trial(
    slots: &VersionSlots,
    new: &str,
    data_dir: &Path,
    service: &dyn ServiceControl,
    within: Duration,
) -> Result<TrialOutcome, UpdateError> {
    let before = slots.running_slot().unwrap_or_else(|| PACKAGE_SLOT.to_owned());
    let confirmed = data_dir.join(CONFIRMED);
    let _none_left = fs::remove_file(&confirmed);
    slots.begin_trial(&Trial { before: before.clone(), new: new.to_owned(), starts: 0 })?;
    slots.switch_to(new)?;
    let reason = match service.restart() {
        Ok(()) => wait_for_confirmation(slots, new, &confirmed, within),
        Err(error) => Some(error.to_string()),
    };
    match reason {
        None => {
            slots.end_trial()?;
            slots.remove_others(&[&before, new]);
            Ok(TrialOutcome::Confirmed)
        }
        Some(reason) => {
            slots.switch_to(&before)?;
            slots.end_trial()?;
            service.restart()?;
            Ok(TrialOutcome::RolledBack { reason })
        }
    }
}

/// `None` when the version was confirmed; otherwise why not.
fn wait_for_confirmation(slots: &VersionSlots, new: &str, confirmed: &Path, within: Duration) -> Option<String> {
    let started = Instant::now();
    let mut waits_since = started;
    let copying = confirmed.with_file_name(format!("history.db{}", gateway_history::COPYING));
    while waits_since.elapsed() < within {
        if read_text(confirmed, CONFIRMED_MAX).is_ok_and(|text| text == new) {
            return None;
        }
        if slots.running_slot().as_deref() != Some(new) {
            return Some("it was started several times and was not well".to_owned());
        }
        // A large history is copied before its tables change; that is no bad health.
        if copying.exists() && started.elapsed() < COPY_WITHIN {
            waits_since = Instant::now();
        }
        std::thread::sleep(Duration::from_millis(250));
    }
    Some(format!("it did not report good health within {} s", within.as_secs()))
}

/// The slot that this process was started from, where it was started from one.
fn own_slot() -> Option<String> {
    let program = fs::read_link("/proc/self/exe").ok()?;
    let folder: PathBuf = program.parent()?.to_owned();
    let in_versions = folder.parent()?.file_name()? == "versions";
    in_versions.then(|| folder.file_name()?.to_str().map(str::to_owned))?
}

/// Says in the data directory that this version is well. Called once, by a service that has been well for [`WELL_FOR`].
///
/// # Errors
/// The file cannot be written.
pub fn confirm_running_version(data_dir: &Path) -> std::io::Result<()> {
    match own_slot() {
        Some(slot) => gateway_base::files::replace_durably(&data_dir.join(CONFIRMED), &slot),
        None => Ok(()),
    }
}
