//! Waiting until the service has confirmed a version, and going back when it does not.

use super::UpdateError;
use super::look::{ServiceControl, slot_of_process};
use super::slots::{CONFIRMED, TRIAL_STARTS, Trial, VersionSlots, read_confirmed};
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

/// The service is well for this long before it confirms its own version: the time in which a leak of threads, a source that
/// hangs or a history that does not commit has shown itself. Longer would keep an integrator waiting.
pub const WELL_FOR: Duration = Duration::from_secs(30);
/// An update waits this long for the confirmation before it goes back.
pub const CONFIRM_WITHIN: Duration = Duration::from_secs(75);
/// The longest time in which a history is copied: ten gigabytes at the pace of a worn card.
const COPY_WITHIN: Duration = Duration::from_secs(1_200);

/// How a trial ended. What runs after it is another question, see [`super::look_until_runs`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TrialOutcome {
    /// The new version has said that it is well.
    Confirmed,
    /// It has not, and the link names another version again.
    TakenBack {
        /// What spoke against the new version.
        reason: String,
        /// The slot that the link names now.
        linked: String,
    },
}

/// Puts a kept version on trial: notes it, moves the link, starts the service anew, and waits. Goes back when the service
/// does not confirm it in time.
///
/// # Errors
/// A file cannot be written, or the service manager refuses.
pub fn run_trial(
    slots: &VersionSlots,
    trial: &Trial,
    data_dir: &Path,
    service: &dyn ServiceControl,
    within: Duration,
) -> Result<TrialOutcome, UpdateError> {
    let confirmed = data_dir.join(CONFIRMED);
    let _none_left = fs::remove_file(&confirmed);
    slots.begin_trial(trial)?;
    slots.switch_to(&trial.new)?;
    let reason = match service.restart() {
        Ok(()) => wait_for_confirmation(slots, &trial.new, data_dir, within),
        Err(error) => Some(error.to_string()),
    };
    let Some(reason) = reason else {
        slots.end_trial()?;
        slots.remove_others(&[&trial.before, &trial.new]);
        return Ok(TrialOutcome::Confirmed);
    };
    if slots.linked_slot().as_deref() == Some(&trial.new) {
        slots.go_back(&trial.before)?;
    }
    slots.end_trial()?;
    let linked = slots.linked_slot().unwrap_or_else(|| trial.before.clone());
    // The guard may have gone back already, and the version before runs.
    if service.read_state().slot.as_ref() != Some(&linked) {
        service.restart()?;
    }
    Ok(TrialOutcome::TakenBack { reason, linked })
}

/// `None` when the version was confirmed; otherwise why not.
fn wait_for_confirmation(slots: &VersionSlots, new: &str, data_dir: &Path, within: Duration) -> Option<String> {
    let started = Instant::now();
    let mut waits_since = started;
    let copying = data_dir.join(format!("history.db{}", gateway_history::COPYING));
    while waits_since.elapsed() < within {
        if read_confirmed(data_dir).as_deref() == Some(new) {
            return None;
        }
        if slots.linked_slot().as_deref() != Some(new) {
            return Some(match slots.read_rolled_back() {
                Some(trial) if trial.new == new => {
                    format!("it was started {TRIAL_STARTS} times and was not well for {} s", WELL_FOR.as_secs())
                }
                _ => "another version was put in its place meanwhile".to_owned(),
            });
        }
        // A large history is copied before its tables change; that is no bad health.
        if copying.exists() && started.elapsed() < COPY_WITHIN {
            waits_since = Instant::now();
        }
        std::thread::sleep(Duration::from_millis(250));
    }
    Some(format!("it did not report good health within {} s", within.as_secs()))
}

/// Says in the data directory that this version is well. Called once, by a service that has been well for [`WELL_FOR`].
///
/// # Errors
/// The file cannot be written.
pub fn confirm_running_version(data_dir: &Path) -> std::io::Result<()> {
    match slot_of_process("self") {
        Some(slot) => gateway_base::files::replace_durably(&data_dir.join(CONFIRMED), &slot),
        None => Ok(()),
    }
}
