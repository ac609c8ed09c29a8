//! Backups that are taken by themselves: to a directory, a stick or a share that is mounted there; each one is restored into
//! a scratch folder before it counts.

use super::{BackupPaths, RestoreError, RestoreRequest, archive_name, collect_files, copy_history, restore_backup};
use crate::archive::{pack, unpack};
use adapter_core::threads::receive_work_within;
use gateway_base::convert::seconds_to_instant;
use gateway_base::files::{keep_last, list_named};
use gateway_base::log::{Notice, Severity};
use gateway_config::BackupConfig;
use gateway_history::HistoryError;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Time between two looks whether a backup is due.
const LOOK_EVERY: Duration = Duration::from_secs(60);
/// After one that failed the next try waits: a stick that is not there is not asked for every minute.
const TRY_AGAIN_LOOKS: u32 = 15;
/// What the archives are called.
const ARCHIVE: (&str, &str) = ("cnc-gateway-backup-", ".tar.gz");
/// What the copies of the history are called.
const HISTORY: (&str, &str) = ("cnc-gateway-history-", ".db");
/// The scratch folder in the data directory.
const SCRATCH: &str = "backup-check";

/// Why there is no backup.
#[derive(Debug, Error)]
pub enum BackupError {
    /// The directory is not there: a stick that was taken out, a share that is not mounted.
    #[error("{} is not there; put the stick in, mount the share, or change `directory` under [backup]", .0.display())]
    Directory(PathBuf),
    /// A file cannot be written or read.
    #[error("{}: {error}", path.display())]
    File {
        /// The file or directory that was written or read.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// What was written does not come back.
    #[error("the backup was written and could not be restored into a scratch folder: {0}")]
    NotRestorable(RestoreError),
    /// What was written cannot be unpacked.
    #[error("the backup was written and could not be restored into a scratch folder: {0}")]
    NotUnpacked(std::io::Error),
    /// The history cannot be copied, or its wear models cannot be read.
    #[error("the history cannot be copied: {0}")]
    History(#[from] HistoryError),
}

/// One backup: collected, written, restored into a scratch folder. Gives its path.
///
/// # Errors
/// See [`BackupError`].
pub fn take_backup(paths: &BackupPaths, config: &BackupConfig, at_s: u64) -> Result<PathBuf, BackupError> {
    let directory = &config.directory;
    if !directory.is_dir() {
        return Err(BackupError::Directory(directory.clone()));
    }
    let files = collect_files(paths)?;
    let file = |path: &Path| {
        let path = path.to_owned();
        move |error| BackupError::File { path, error }
    };
    let archive = pack(&files, at_s).map_err(file(directory))?;
    let path = directory.join(archive_name("backup", at_s));
    let writing = path.with_extension("writing");
    let written = fs::write(&writing, &archive)
        .and_then(|()| fs::File::open(&writing)?.sync_all())
        .map_err(file(&writing))
        .and_then(|()| verify_backup(paths, &writing, at_s))
        .and_then(|()| copy_history_beside(paths, config, at_s));
    if let Err(error) = written {
        // A failure every quarter of an hour must not fill the stick.
        let _half = fs::remove_file(&writing);
        return Err(error);
    }
    fs::rename(&writing, &path).map_err(file(&path))?;
    for kind in [ARCHIVE, HISTORY] {
        // One that cannot be removed costs space only; the next backup tries again.
        let _left = keep_last(directory, config.keep, |name| is_of_kind(kind, name));
    }
    Ok(path)
}

/// Where the configuration wants it, the history too.
fn copy_history_beside(paths: &BackupPaths, config: &BackupConfig, at_s: u64) -> Result<(), BackupError> {
    if !config.history {
        return Ok(());
    }
    let copy = config.directory.join(archive_name("history", at_s)).with_extension("").with_extension("db");
    copy_history(&paths.history, &copy)?;
    Ok(())
}

/// Reads the archive back from where it was written and restores it into a scratch folder.
fn verify_backup(paths: &BackupPaths, archive: &Path, at_s: u64) -> Result<(), BackupError> {
    let bytes = fs::read(archive).map_err(|error| BackupError::File { path: archive.to_owned(), error })?;
    let files = unpack(&bytes).map_err(BackupError::NotUnpacked)?;
    let scratch = paths.data_dir.join(SCRATCH);
    let _none_left = fs::remove_dir_all(&scratch);
    let below = |path: &Option<PathBuf>| {
        path.as_ref().and_then(|path| path.file_name()).map(|name| scratch.join("named").join(name))
    };
    let places = BackupPaths {
        machine: paths.machine.clone(),
        data_dir: scratch.join("data"),
        scripts: scratch.join("scripts"),
        history: scratch.join("data").join("history.db"),
        operations: below(&paths.operations),
        model: below(&paths.model),
        thermal_model: below(&paths.thermal_model),
        configuration: None,
    };
    let at_ns = seconds_to_instant(at_s);
    let request = RestoreRequest { by: "backup", at_ns, before: (&[], "none.tar.gz") };
    let outcome = restore_backup(&places, &files, request).map(drop).map_err(BackupError::NotRestorable);
    let _scratch_left = fs::remove_dir_all(&scratch);
    outcome
}

/// Is this the name of an archive of this kind? Their names hold the time, so that they sort by it.
fn is_of_kind((begin, end): (&str, &str), name: &str) -> bool {
    name.starts_with(begin) && name.ends_with(end)
}

/// Time since the newest archive was written; `None` where there is none, or where its time lies in the future: then the clock was
/// wrong when it was written, or is wrong now.
fn newest_age(directory: &Path) -> Option<Duration> {
    let newest = list_named(directory, |name| is_of_kind(ARCHIVE, name)).ok()?.pop()?;
    let written = fs::metadata(newest).and_then(|file| file.modified()).ok()?;
    written.elapsed().ok()
}

/// Takes backups while it lives, on a thread of its own.
#[derive(Debug)]
pub struct BackupSchedule {
    _stop: Sender<()>,
}

impl BackupSchedule {
    /// Starts. `tell` is given what happened.
    ///
    /// # Errors
    /// No thread could be started.
    pub fn start(
        paths: BackupPaths,
        config: BackupConfig,
        now_s: impl Fn() -> u64 + Send + 'static,
        tell: impl Fn(&Notice) + Send + 'static,
    ) -> std::io::Result<Self> {
        let (stop, stopped) = channel();
        std::thread::Builder::new()
            .name("backup".to_owned())
            .spawn(move || run_schedule(&stopped, &paths, &config, &now_s, &tell))?;
        Ok(Self { _stop: stop })
    }
}

fn run_schedule(
    stopped: &Receiver<()>,
    paths: &BackupPaths,
    config: &BackupConfig,
    now_s: &dyn Fn() -> u64,
    tell: &dyn Fn(&Notice),
) {
    let mut looks_to_wait = 0;
    // After the first one the time of this thread counts, which no clock that is set wrongly can move.
    let mut taken: Option<Instant> = None;
    while matches!(receive_work_within("backup", stopped, LOOK_EVERY), Err(RecvTimeoutError::Timeout)) {
        if looks_to_wait > 0 {
            looks_to_wait -= 1;
            continue;
        }
        let age = taken.map_or_else(|| newest_age(&config.directory), |taken| Some(taken.elapsed()));
        if age.is_some_and(|age| age < config.every) {
            continue;
        }
        match take_backup(paths, config, now_s()) {
            Ok(path) => {
                taken = Some(Instant::now());
                let text = format!("a backup was taken and restored into a scratch folder: {}", path.display());
                tell(&Notice::new(Severity::Info, "backup_taken", text));
            }
            Err(error) => {
                looks_to_wait = TRY_AGAIN_LOOKS;
                tell(&Notice::new(Severity::Warning, "backup_failed", format!("no backup: {error}")));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_archives_stay() {
        let directory = tempfile::tempdir().expect("a directory");
        for hour in 10..15 {
            let name = format!("cnc-gateway-backup-2026-11-26T{hour}-00-00Z.tar.gz");
            fs::write(directory.path().join(name), "x").expect("written");
        }
        fs::write(directory.path().join("something else"), "x").expect("written");
        let ours = |name: &str| is_of_kind(ARCHIVE, name);
        keep_last(directory.path(), 2, ours).expect("removed");
        let left = list_named(directory.path(), ours).expect("read");
        let hours: Vec<bool> = left.iter().map(|path| path.to_string_lossy().contains("T1")).collect();
        assert_eq!((left.len(), hours), (2, vec![true, true]));
        assert!(left[1].to_string_lossy().contains("T14") && directory.path().join("something else").exists());
        assert!(newest_age(directory.path()).is_some_and(|age| age < Duration::from_secs(60)));
    }
}
