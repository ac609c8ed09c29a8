//! What a disk has changed: how it is recognised, and how it is told.

use super::error::{HistoryError, add_path};
use super::lock::append_suffix;
use super::readable_time::format_utc;
use adapter_core::clock::TimeNs;
use gateway_base::{clock, moment};
use rusqlite::Connection;
use serde::Serialize;
use std::fmt;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Samples that the disk has changed, and that are therefore left out of every answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct DamagedRows {
    /// Number of the first one.
    pub first_row: i64,
    /// How many, as far as that can be read.
    pub rows: i64,
    /// Their first and last time, as far as that can be read.
    pub span_ns: Option<(TimeNs, TimeNs)>,
}

impl DamagedRows {
    /// Those of the block of this key. Its times may be what was changed: they are told, and decide nothing.
    pub(crate) fn of_block(db: &Connection, first_row: i64) -> Self {
        let known =
            db.query_row("SELECT rows, start_ns, end_ns FROM blocks WHERE first_row = ?1", [first_row], |row| {
                Ok(Self { first_row, rows: row.get(0)?, span_ns: Some((row.get(1)?, row.get(2)?)) })
            });
        known.unwrap_or(Self { first_row, rows: 0, span_ns: None })
    }
}

impl fmt::Display for DamagedRows {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { first_row, rows, span_ns } = self;
        match rows {
            1.. => write!(f, "samples {first_row} to {}", first_row + rows - 1)?,
            _ => write!(f, "samples from {first_row} on")?,
        }
        match span_ns {
            Some((from_ns, to_ns)) => write!(f, " ({} to {})", format_utc(*from_ns), format_utc(*to_ns)),
            None => Ok(()),
        }
    }
}

/// What `SQLite` keeps beside a database.
const COMPANIONS: [&str; 2] = ["-wal", "-shm"];
/// What stands between the name of a history and the time at which it was set aside.
const DAMAGED: &str = ".damaged-";

/// Why a history gets another name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aside {
    /// The disk has changed it.
    Damaged,
    /// A newer version of the program has changed its tables.
    Newer,
}

impl Aside {
    /// What stands between the name of the history and the time.
    fn word(self) -> &'static str {
        match self {
            Self::Damaged => DAMAGED,
            Self::Newer => ".newer-",
        }
    }
}

/// Gives a history another name, with what belongs to it; returns that.
///
/// # Errors
/// It cannot be renamed.
pub fn set_aside(path: &Path, why: Aside) -> Result<PathBuf, HistoryError> {
    let time: String = moment::format_utc(clock::now_ns()).chars().filter(char::is_ascii_alphanumeric).collect();
    let aside = append_suffix(path, &format!("{}{time}", why.word()));
    std::fs::rename(path, &aside).map_err(add_path(path))?;
    for companion in COMPANIONS {
        // Where there is none, nothing belongs to it.
        let _none = std::fs::rename(append_suffix(path, companion), append_suffix(&aside, companion));
    }
    Ok(aside)
}

/// Histories that were set aside from this name, as paths.
#[must_use]
pub fn damaged_files(path: &Path) -> Vec<String> {
    let Some(name) = path.file_name().map(|name| format!("{}{DAMAGED}", name.to_string_lossy())) else {
        return Vec::new();
    };
    let directory = path.parent().unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(directory).into_iter().flatten().flatten();
    let is_one = |found: &str| found.starts_with(&name) && !COMPANIONS.iter().any(|end| found.ends_with(end));
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok()).filter(|found| is_one(found));
    let mut files: Vec<String> = names.map(|found| directory.join(found).display().to_string()).collect();
    files.sort();
    files
}

/// Bytes of the beginning of a file in which a history names its tables.
const SCHEMA_BYTES: u64 = 65_536;

/// Was the file at `path` a history of this program once, although its header says something else?
pub(crate) fn was_ours(path: &Path) -> bool {
    let mut bytes = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(SCHEMA_BYTES).read_to_end(&mut bytes));
    let holds = |text: &str| bytes.windows(text.len()).any(|found| found == text.as_bytes());
    read.is_ok() && holds("CREATE TABLE segments") && holds("CREATE TABLE blocks")
}
