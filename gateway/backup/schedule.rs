//! Backups that are taken by themselves: to a directory, a stick or a share that is mounted there; each one is restored into
//! a scratch folder before it counts.

use super::target::{BackupKind, keep_newest, list_own, remove_half_written};
use super::{BackupError, BackupPaths, BoxOrigin, RestoreRequest, collect_files, copy_history, restore_backup};
use crate::archive::{pack, unpack};
use adapter_core::threads::{reach_fault_point, receive_work_within};
use gateway_base::convert::seconds_to_instant;
use gateway_base::log::{Notice, Severity};
use gateway_config::BackupConfig;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::time::{Duration, Instant};

/// Time between two looks whether a backup is due.
const LOOK_EVERY: Duration = Duration::from_secs(60);
/// Time between two looks whether a backup has ended.
const WAIT_STEP: Duration = Duration::from_millis(200);
/// After one that failed the next try waits: a stick that is not there is not asked for every minute.
const TRY_AGAIN_LOOKS: u32 = 15;
/// A backup that takes longer hangs: a share whose server has gone answers nothing and says nothing. An archive takes seconds.
const TAKES_MAX: Duration = Duration::from_secs(600);
/// The slowest pace at which a history is copied to a stick that does not hang, bytes per second.
const HISTORY_PACE: u64 = 1_000_000;
/// The scratch folder in the data directory.
const SCRATCH: &str = "backup-check";

/// One backup: collected, written, restored into a scratch folder. Gives its path. A file takes its name only when it is whole and on the
/// disk.
///
/// # Errors
/// See [`BackupError`].
pub fn take_backup(paths: &BackupPaths, config: &BackupConfig, at_s: u64) -> Result<PathBuf, BackupError> {
    let directory = &config.directory;
    if !directory.is_dir() {
        return Err(BackupError::Directory(directory.clone()));
    }
    let origin = BoxOrigin::of_box(&paths.machine, &paths.data_dir)?;
    remove_half_written(directory, &origin);
    let taken = take_files(paths, config, &origin, at_s);
    // A failure every quarter of an hour must not fill the stick.
    remove_half_written(directory, &origin);
    let (archive, history) = taken?;
    keep_newest(directory, BackupKind::Archive, &origin, (&archive, config.keep))?;
    if let Some(history) = history {
        keep_newest(directory, BackupKind::History, &origin, (&history, config.keep))?;
    }
    Ok(archive)
}

/// The archive, and the copy of the history where the configuration wants one.
fn take_files(
    paths: &BackupPaths,
    config: &BackupConfig,
    origin: &BoxOrigin,
    at_s: u64,
) -> Result<(PathBuf, Option<PathBuf>), BackupError> {
    let directory = &config.directory;
    let file = |path: &Path| {
        let path = path.to_owned();
        move |error| BackupError::File { path, error }
    };
    let archive = pack(&collect_files(paths)?, at_s).map_err(file(directory))?;
    let (writing, path) = names_of(directory, BackupKind::Archive, origin, at_s);
    fs::write(&writing, &archive).map_err(file(&writing))?;
    verify_backup(paths, &writing, at_s)?;
    let history = match config.history {
        true => Some(copy_history_beside(paths, directory, origin, at_s)?),
        false => None,
    };
    rename_durably(&writing, &path).map_err(file(&path))?;
    Ok((path, history))
}

/// Where a file is written, and its name when it is whole.
fn names_of(directory: &Path, kind: BackupKind, origin: &BoxOrigin, at_s: u64) -> (PathBuf, PathBuf) {
    let name = kind.file_name(origin, at_s);
    (directory.join(format!("{name}.writing")), directory.join(name))
}

/// Gives a file its name when all of it is on the disk.
fn rename_durably(writing: &Path, path: &Path) -> std::io::Result<()> {
    fs::File::open(writing)?.sync_all()?;
    fs::rename(writing, path)?;
    let directory = path.parent().map(fs::File::open).transpose()?;
    // Some shares cannot sync a directory; the file itself is there.
    let _unsupported = directory.map(|directory| directory.sync_all());
    Ok(())
}

fn copy_history_beside(
    paths: &BackupPaths,
    directory: &Path,
    origin: &BoxOrigin,
    at_s: u64,
) -> Result<PathBuf, BackupError> {
    let (writing, path) = names_of(directory, BackupKind::History, origin, at_s);
    copy_history(&paths.history, &writing)?;
    rename_durably(&writing, &path).map_err(|error| BackupError::File { path: path.clone(), error })?;
    Ok(path)
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
    let request = RestoreRequest { by: "backup", at_ns, before: (&[], "none.tar.gz"), from_another_box: true };
    let outcome = restore_backup(&places, &files, request).map(drop).map_err(BackupError::NotRestorable);
    let _scratch_left = fs::remove_dir_all(&scratch);
    outcome
}

/// Time since the newest archive of this box was written; `None` where there is none, or where its time lies in the future: then the clock
/// was wrong when it was written, or is wrong now.
fn newest_age(paths: &BackupPaths, directory: &Path) -> Option<Duration> {
    let origin = BoxOrigin::of_box(&paths.machine, &paths.data_dir).ok()?;
    let newest = list_own(directory, BackupKind::Archive, &origin).ok()?.pop()?;
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
        if taken.is_some_and(|taken| taken.elapsed() < config.every) {
            continue;
        }
        let attempt = BackupAttempt::start(paths, config, (taken.is_none(), now_s()));
        match attempt.and_then(|attempt| attempt.wait_for_end(stopped, find_limit(paths, config), tell)) {
            Ok(Attempted::NotDue) => {}
            Ok(Attempted::Stopped) => return,
            Ok(Attempted::Taken(path)) => {
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

/// After this time a backup hangs.
fn find_limit(paths: &BackupPaths, config: &BackupConfig) -> Duration {
    let bytes = fs::metadata(&paths.history).ok().filter(|_| config.history).map_or(0, |file| file.len());
    TAKES_MAX + Duration::from_secs(bytes / HISTORY_PACE)
}

/// What became of an attempt.
#[derive(Debug)]
enum Attempted {
    NotDue,
    Taken(PathBuf),
    /// The box ends before the backup is complete.
    Stopped,
}

/// A backup on a thread of its own, which a target that hangs may hold for ever. There is one at a time.
struct BackupAttempt {
    result: Receiver<Result<Attempted, BackupError>>,
    directory: PathBuf,
}

impl BackupAttempt {
    /// `is_first`: whether one is due is said by the archives that are there.
    fn start(paths: &BackupPaths, config: &BackupConfig, (is_first, at_s): (bool, u64)) -> Result<Self, BackupError> {
        let (end, ended) = channel();
        let directory = config.directory.clone();
        let (paths, config) = (paths.clone(), config.clone());
        let work = move || {
            reach_fault_point("backup work");
            let is_due = !is_first || newest_age(&paths, &config.directory).is_none_or(|age| age >= config.every);
            let done = match is_due {
                true => take_backup(&paths, &config, at_s).map(Attempted::Taken),
                false => Ok(Attempted::NotDue),
            };
            // Nobody listens any more when the box has ended meanwhile.
            let _box_has_ended = end.send(done);
        };
        let thread = std::thread::Builder::new().name("backup work".to_owned()).spawn(work);
        let path = directory.clone();
        thread.map(|_| Self { result: ended, directory }).map_err(|error| BackupError::File { path, error })
    }

    /// Waits for its end. When it takes longer than `limit` that is told once, and it is waited for all the same: another one would hang,
    /// too.
    fn wait_for_end(
        self,
        stopped: &Receiver<()>,
        limit: Duration,
        tell: &dyn Fn(&Notice),
    ) -> Result<Attempted, BackupError> {
        let (began, mut told) = (Instant::now(), false);
        loop {
            match self.result.recv_timeout(WAIT_STEP) {
                Ok(done) => return done,
                Err(RecvTimeoutError::Disconnected) => return Err(BackupError::BrokeOff(self.directory)),
                Err(RecvTimeoutError::Timeout) => {}
            }
            if !matches!(stopped.try_recv(), Err(TryRecvError::Empty)) {
                return Ok(Attempted::Stopped);
            }
            if !told && began.elapsed() >= limit {
                told = true;
                let error = BackupError::Hangs { directory: self.directory.clone(), after_s: limit.as_secs() };
                tell(&Notice::new(Severity::Error, "backup_hangs", format!("no backup: {error}")));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A target that hangs for as long as the test wants: the work behind it ends when the sender does.
    #[test]
    fn a_target_that_hangs_is_told_once_and_the_box_can_end() {
        let (end, ended) = channel();
        let attempt = BackupAttempt { result: ended, directory: "/media/share".into() };
        let (stop, stopped) = channel::<()>();
        let (tell, told) = channel();
        let waits = std::thread::spawn(move || {
            let tell = |notice: &Notice| tell.send(notice.operator.clone()).expect("heard");
            attempt.wait_for_end(&stopped, Duration::ZERO, &tell)
        });
        std::thread::sleep(4 * WAIT_STEP);
        drop(stop);
        assert!(matches!(waits.join().expect("no panic"), Ok(Attempted::Stopped)));
        drop(end);
        let told: Vec<String> = told.iter().collect();
        assert!(told.len() == 1 && told[0].contains("/media/share has not answered"), "{told:?}");
    }
}
