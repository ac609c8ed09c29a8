//! A copy of the history as it was before a newer version of the program changed its tables, and the way back to it.
//!
//! An older program cannot read newer tables. So a version that goes back after an update (`crate::update`) would have no
//! history. It finds the copy of its own kind beside the file, `history.db.schema-N`, gives the newer file another name, and
//! goes on with the copy. What was stored in between stays in the newer file, which the newer program reads.

use super::damage::{Aside, set_aside};
use super::error::{HistoryError, at};
use super::lock::beside;
use super::record::Event;
use super::schema::SCHEMA;
use super::space::disk_room;
use crate::{clock, files};
use adapters::clock::TimeNs;
use rusqlite::Connection;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// What stands between the name of a history and the schema of a copy.
const COPY: &str = ".schema-";
/// A copy is kept for so long: a box that runs well for a week is not taken back to the version before. Until then it takes as much
/// room on the disk as the history did.
const KEPT_FOR: Duration = Duration::from_secs(7 * 86_400);
/// Bytes that stay free beside a copy, so that it does not take the room of what is to be stored.
const KEEP_FREE: u64 = 256 * 1024 * 1024;

fn name_copy(path: &Path, schema: i64) -> PathBuf {
    beside(path, &format!("{COPY}{schema}"))
}

/// Copies the file with the tables of `schema`, byte for byte, and returns the event that tells it. Nobody else may be writing it.
/// Without a copy, for want of room, the tables are changed all the same: a box that stores nothing would lose more.
pub(crate) fn copy_before_change(path: &Path, db: &Connection, schema: i64) -> Event {
    let text = match copy(path, db, schema) {
        Ok(to) => format!(
            "the tables of schema {schema} became those of {SCHEMA}; the file of before is kept as {}",
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

fn copy(path: &Path, db: &Connection, schema: i64) -> Result<PathBuf, String> {
    let (to, fresh) = (name_copy(path, schema), beside(path, ".copying"));
    // Whatever the log holds goes into the file first.
    db.execute_batch("PRAGMA wal_checkpoint(TRUNCATE)").map_err(|error| error.to_string())?;
    let told = |error: std::io::Error| format!("{}: {error}", fresh.display());
    let bytes = fs::metadata(path).map_err(told)?.len();
    if let Some(room) = disk_room(path)
        && room.free < bytes + KEEP_FREE
    {
        return Err(format!(
            "the disk has room for {} MB, and {} are needed",
            room.free / 1_000_000,
            bytes / 1_000_000
        ));
    }
    let copied = fs::copy(path, &fresh).and_then(|_| File::open(&fresh)?.sync_all());
    copied.and_then(|()| fs::rename(&fresh, &to)).map_err(|error| {
        // Half a copy is of no use to anybody.
        let _removed = fs::remove_file(&fresh);
        told(error)
    })?;
    Ok(to)
}

/// Removes copies that are older than a week at this time, which a confirmed clock says.
pub fn remove_old_copies(path: &Path, now_ns: TimeNs) {
    let now = SystemTime::UNIX_EPOCH + Duration::from_nanos(u64::try_from(now_ns).unwrap_or(0));
    let (Some(directory), Some(name)) = (path.parent(), path.file_name().and_then(|name| name.to_str())) else {
        return;
    };
    let ours = format!("{name}{COPY}");
    for copy in files::list_named(directory, |found| found.starts_with(&ours)).unwrap_or_default() {
        let made = fs::metadata(&copy).and_then(|file| file.modified());
        if made.is_ok_and(|made| now.duration_since(made).is_ok_and(|age| age > KEPT_FOR)) {
            // What cannot be removed costs room only; the next night tries again.
            let _left = fs::remove_file(copy);
        }
    }
}

/// Puts the copy that this program can read in the place of a newer history. Gives the new name of the newer one; `None` where there is
/// no copy, and then nothing is changed.
///
/// # Errors
/// A file cannot be renamed.
pub fn go_back(path: &Path) -> Result<Option<PathBuf>, HistoryError> {
    let copy = name_copy(path, SCHEMA);
    if !copy.is_file() {
        return Ok(None);
    }
    let newer = set_aside(path, Aside::Newer)?;
    fs::rename(&copy, path).map_err(at(&copy))?;
    Ok(Some(newer))
}
