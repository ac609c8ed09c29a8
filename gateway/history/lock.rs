//! One writer per history: a lock file beside the database. The system releases it when the process ends, however it
//! ends, so a killed gateway leaves nothing to clean up.

use super::error::{HistoryError, add_path};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};

/// Holds the lock until dropped.
#[derive(Debug)]
pub(crate) struct Lock {
    _file: File,
}

impl Lock {
    /// Takes the lock of the history at `path`, or says who has it.
    pub(crate) fn acquire_at(path: &Path) -> Result<Self, HistoryError> {
        let beside = append_suffix(path, ".lock");
        let opened = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&beside);
        let mut file = opened.map_err(|error| lock_error(path, &beside, error))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let mut holder = String::new();
                // Only for the message: without it the lock still tells what matters.
                let _ = file.read_to_string(&mut holder);
                let holder = if holder.trim().is_empty() { "unknown process" } else { holder.trim() };
                return Err(HistoryError::InUse { path: path.to_owned(), holder: holder.to_owned() });
            }
            Err(TryLockError::Error(error)) => return Err(HistoryError::Io { path: beside, error }),
        }
        // Who holds it is a courtesy: a full disk must not keep the gateway from starting.
        let _ = note_holder(&mut file);
        Ok(Self { _file: file })
    }
}

fn note_holder(file: &mut File) -> std::io::Result<()> {
    file.set_len(0)?;
    file.rewind()?;
    write!(file, "process {}", std::process::id())
}

/// The file beside the database whose name ends in `suffix`.
pub(crate) fn append_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    name.into()
}

fn lock_error(path: &Path, beside: &Path, error: std::io::Error) -> HistoryError {
    use std::io::ErrorKind::{PermissionDenied, ReadOnlyFilesystem};
    if !matches!(error.kind(), PermissionDenied | ReadOnlyFilesystem) {
        return add_path(beside)(error);
    }
    let place = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    HistoryError::ReadOnly { path: path.to_owned(), place: place.to_owned(), error: error.to_string() }
}
