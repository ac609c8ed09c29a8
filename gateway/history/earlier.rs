//! A copy of the history as it was before a newer version of the program changed its tables, and the way back to it.
//!
//! An older program cannot read newer tables. So a version that goes back after an update (the command `update`) would have no
//! history. It finds the copy of its own kind beside the file, `history.db.schema-N`, gives the newer file another name, and
//! goes on with the copy. What was stored in between stays in the newer file, which the newer program reads.

use super::damage::{Aside, set_aside};
use super::error::{HistoryError, add_path};
use super::lock::append_suffix;
use super::schema::{SCHEMA, copy_whole};
use super::space::disk_room;
use adapter_core::clock::TimeNs;
use gateway_base::convert::clamp_to_unsigned;
use gateway_base::{clock, files};
use gateway_records::Event;
use rusqlite::Connection;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};
use thiserror::Error;

/// What stands between the name of a history and the schema of a copy.
const COPY: &str = ".schema-";
/// A copy is kept for so long: a box that runs well for a week is not taken back to the version before. Until then it takes as much
/// room on the disk as the history did.
const KEPT_FOR: Duration = Duration::from_secs(7 * 86_400);
/// Bytes that stay free beside a copy, so that it does not take the room of what is to be stored.
const KEEP_FREE: u64 = 256 * 1024 * 1024;
/// What stands behind the name of a history while it is copied.
pub const COPYING: &str = ".copying";

fn name_copy(path: &Path, schema: i64) -> PathBuf {
    append_suffix(path, &format!("{COPY}{schema}"))
}

/// Copies the history with the tables of `schema` and returns the event that tells it.
/// Without a copy, for want of room, the tables are changed all the same: a box that stores nothing would lose more.
pub(crate) fn copy_before_change(path: &Path, db: &Connection, schema: i64) -> Event {
    let text = match copy_database(path, db, schema) {
        Ok(to) => format!(
            "the tables of schema {schema} became those of {SCHEMA}; the history of before is kept as {}",
            to.display()
        ),
        Err(why) => format!(
            "the tables of schema {schema} became those of {SCHEMA} without a copy ({why}): an older version of the program \
             cannot go on with this history"
        ),
    };
    let (kind, source) = ("history_schema".to_owned(), "history".to_owned());
    Event { at_ns: clock::now_ns(), kind, source, text, detail: String::new() }
}

/// Why there is no copy.
#[derive(Debug, Error)]
enum CopyError {
    /// A file cannot be read, written or renamed.
    #[error("{}: {error}", path.display())]
    File { path: PathBuf, error: std::io::Error },
    /// The disk is too full.
    #[error("the disk has room for {} MB, and {} are needed", free / 1_000_000, needed / 1_000_000)]
    NoRoom { free: u64, needed: u64 },
    /// The history cannot be read, or its copy cannot be written.
    #[error(transparent)]
    Database(#[from] rusqlite::Error),
    /// The copy cannot be made durable.
    #[error(transparent)]
    NotDurable(#[from] std::io::Error),
}

fn copy_database(path: &Path, db: &Connection, schema: i64) -> Result<PathBuf, CopyError> {
    let (to, fresh) = (name_copy(path, schema), append_suffix(path, COPYING));
    // One that a power cut has left is half a copy.
    let _none_left = fs::remove_file(&fresh);
    let told = |error| CopyError::File { path: fresh.clone(), error };
    let bytes = fs::metadata(path).map_err(told)?.len();
    if let Some(room) = disk_room(path)
        && room.free < bytes + KEEP_FREE
    {
        return Err(CopyError::NoRoom { free: room.free, needed: bytes });
    }
    let copied = write_copy(db, &fresh).and_then(|()| fs::rename(&fresh, &to).map_err(told));
    copied.inspect_err(|_| {
        let _removed = fs::remove_file(&fresh);
    })?;
    Ok(to)
}

/// With what still stands in the log, also while somebody reads.
fn write_copy(db: &Connection, fresh: &Path) -> Result<(), CopyError> {
    copy_whole(db, fresh)?;
    let file = fs::OpenOptions::new().write(true).open(fresh)?;
    // Not dated yet: the clock of this moment may be wrong.
    let undated = file.set_modified(SystemTime::UNIX_EPOCH);
    undated.and_then(|()| file.sync_all())?;
    Ok(())
}

/// Removes copies that are older than a week at this time, which a confirmed clock says. A copy is dated when it is first met here.
pub fn remove_old_copies(path: &Path, now_ns: TimeNs) {
    let now = SystemTime::UNIX_EPOCH + Duration::from_nanos(clamp_to_unsigned(now_ns));
    let (Some(directory), Some(name)) = (path.parent(), path.file_name().and_then(|name| name.to_str())) else {
        return;
    };
    let ours = [format!("{name}{COPY}"), format!("{name}{COPYING}")];
    let is_ours = |found: &str| ours.iter().any(|begin| found.starts_with(begin.as_str()));
    for copy in files::list_named(directory, is_ours).unwrap_or_default() {
        // What cannot be dated or removed costs room only; the next night tries again.
        let Ok(made) = fs::metadata(&copy).and_then(|file| file.modified()) else { continue };
        if made == SystemTime::UNIX_EPOCH || made > now {
            let _undated = fs::OpenOptions::new().write(true).open(&copy).and_then(|file| file.set_modified(now));
        } else if now.duration_since(made).is_ok_and(|age| age > KEPT_FOR) {
            let _left = fs::remove_file(copy);
        }
    }
}

/// Did the power fail while this program went back? Then the newer history has its other name, and the copy not yet its place.
#[must_use]
pub fn is_going_back(path: &Path) -> bool {
    !path.exists() && name_copy(path, SCHEMA).is_file()
}

/// Puts the copy that this program can read in the place of a newer history. Gives the new name of the newer one; `None` where there is
/// no copy, and then nothing is changed.
///
/// # Errors
/// A file cannot be renamed, or the copy cannot be written.
pub fn go_back(path: &Path) -> Result<Option<PathBuf>, HistoryError> {
    let copy = name_copy(path, SCHEMA);
    if !copy.is_file() {
        return Ok(None);
    }
    // The numbers that the newer version has sent are of other epochs.
    let newer = if path.exists() { set_aside(path, Aside::Newer)? } else { path.to_owned() };
    fs::rename(&copy, path).map_err(add_path(&copy))?;
    Ok(Some(newer))
}
