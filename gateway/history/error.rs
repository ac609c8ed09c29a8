//! What can go wrong with a history, in words that say what to do next.

use super::pages::damaged_page;
use rusqlite::{ErrorCode, ffi};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// What to do about damage, as the end of a sentence.
pub(crate) const REPAIR: &str = "`cnc-gateway history repair NEW` saves everything that is whole into a new file";

/// Does `SQLite` say that the file is not as it was written?
pub(crate) fn is_of_disk(error: &rusqlite::Error) -> bool {
    let extended = error.sqlite_error().map(|error| error.extended_code);
    extended == Some(ffi::SQLITE_IOERR_DATA)
        || matches!(error.sqlite_error_code(), Some(ErrorCode::DatabaseCorrupt | ErrorCode::NotADatabase))
        // A value of another type than its column, a number that is none of its kind, or text that is no text: only a changed file
        // has that.
        || matches!(
            error,
            rusqlite::Error::InvalidColumnType(..)
                | rusqlite::Error::IntegralValueOutOfRange(..)
                | rusqlite::Error::FromSqlConversionFailure(..)
        )
}

/// Why a history cannot be opened, written or read.
#[derive(Debug, Error)]
pub enum HistoryError {
    /// Another process writes this history.
    #[error(
        "{}: another cnc-gateway ({holder}) is writing this history. Stop it, or give this one its own file with --history.",
        path.display()
    )]
    InUse {
        /// Path of the database that is in use.
        path: PathBuf,
        /// Process number and start, as the other one wrote them into the lock file.
        holder: String,
    },
    /// The file was written by a newer version.
    #[error(
        "{}: the history has schema {found}, this cnc-gateway knows up to {known}. Update the gateway, or give it another file with --history; nothing was changed.",
        path.display()
    )]
    NewerSchema {
        /// Path of the database that is too new.
        path: PathBuf,
        /// Schema of the file.
        found: i64,
        /// Newest schema this version can use.
        known: i64,
    },
    /// The file is something else.
    #[error("{}: not a cnc-gateway history ({what}). Choose another file with --history; nothing was changed.", path.display())]
    NotAHistory {
        /// Path of the file that is no history.
        path: PathBuf,
        /// What it is instead.
        what: String,
    },
    /// There is no such file.
    #[error("{}: no history there. Check the path, or run the gateway first so that it writes one.", path.display())]
    Missing {
        /// The path at which no file is.
        path: PathBuf,
    },
    /// The directory or the file cannot be written.
    #[error("{}: cannot be written ({error}). Give the gateway's user write permission to {}, or choose another place with --history.",
        path.display(), place.display())]
    ReadOnly {
        /// Path of the database that cannot be written.
        path: PathBuf,
        /// What lacks the permission.
        place: PathBuf,
        /// What the system said.
        error: String,
    },
    /// A file operation failed.
    #[error("{}: {error}", path.display())]
    Io {
        /// The file that the operation was about.
        path: PathBuf,
        /// What the system said.
        error: std::io::Error,
    },
    /// `SQLite` refused a statement.
    #[error("history, while {doing}: {error}")]
    Sqlite {
        /// What was being done.
        doing: &'static str,
        /// The error as `SQLite` gave it.
        error: rusqlite::Error,
    },
    /// `SQLite` found that the file is not as it was written.
    #[error("history, while {doing}: the file is not as it was written{}: {error}. {REPAIR}.", describe_page(*page))]
    NotAsWritten {
        /// What was being done.
        doing: &'static str,
        /// The page, where it is known.
        page: Option<u32>,
        /// The error as `SQLite` gave it.
        error: rusqlite::Error,
    },
    /// A block cannot be decoded.
    #[error("history, block at row {first_row}: {what}. The rest of the history is readable; {REPAIR}.")]
    Damaged {
        /// Number of the block's first row.
        first_row: i64,
        /// What does not fit.
        what: &'static str,
    },
    /// A question that cannot be answered as it was put.
    #[error("{0}")]
    Question(String),
    /// The writer has stopped.
    #[error("the history writer has stopped; restart the gateway")]
    Stopped,
    /// What was asked for did not become durable in time.
    #[error("the history did not become durable within {seconds} s: {reason}")]
    NotDurable {
        /// How long was waited.
        seconds: f64,
        /// The writer's last error, or that it is busy.
        reason: String,
    },
}

fn describe_page(page: Option<u32>) -> String {
    page.map_or_else(String::new, |page| format!(" (page {page})"))
}

/// Adds what was being done to an error of `SQLite`.
pub(crate) trait Doing<T> {
    /// `doing` completes the sentence "history, while ...".
    fn with_activity(self, doing: &'static str) -> Result<T, HistoryError>;
}

impl<T> Doing<T> for Result<T, rusqlite::Error> {
    fn with_activity(self, doing: &'static str) -> Result<T, HistoryError> {
        self.map_err(|error| match is_of_disk(&error) {
            true => HistoryError::NotAsWritten { doing, page: damaged_page(), error },
            false => HistoryError::Sqlite { doing, error },
        })
    }
}

/// Adds the file to an input or output error.
pub(crate) fn add_path(path: &Path) -> impl FnOnce(std::io::Error) -> HistoryError + '_ {
    move |error| HistoryError::Io { path: path.to_owned(), error }
}

impl HistoryError {
    /// Is the disk, or the room that the configuration allows, used up?
    #[must_use]
    pub fn is_full(&self) -> bool {
        match self {
            Self::Sqlite { error, .. } => error.sqlite_error_code() == Some(rusqlite::ErrorCode::DiskFull),
            Self::Io { error, .. } => error.kind() == std::io::ErrorKind::StorageFull,
            _ => false,
        }
    }

    /// Is the file not as it was written?
    #[must_use]
    pub fn is_damage(&self) -> bool {
        matches!(self, Self::Damaged { .. } | Self::NotAsWritten { .. })
    }

    /// Does another program hold the file locked?
    #[must_use]
    pub fn is_locked(&self) -> bool {
        matches!(self, Self::Sqlite { error, .. } if error.sqlite_error_code() == Some(rusqlite::ErrorCode::DatabaseBusy))
    }
}
