//! Reading a history while the gateway writes it: a connection of its own that cannot change anything.

use super::error::{Doing, HistoryError};
use super::schema;
use super::series::Series;
use adapters::clock::TimeNs;
use rusqlite::Connection;
use std::path::{Path, PathBuf};

/// Reads one history. Cheap to open; one per thread.
#[derive(Debug)]
pub struct Reader {
    pub(crate) db: Connection,
    pub(crate) path: PathBuf,
}

impl Reader {
    /// Opens the history at `path` for reading.
    ///
    /// # Errors
    /// [`HistoryError::Missing`], [`HistoryError::NewerSchema`], [`HistoryError::NotAHistory`], or what `SQLite` says.
    pub fn open(path: &Path) -> Result<Self, HistoryError> {
        let db = schema::open_for_reading(path)?;
        Ok(Self { db, path: path.to_owned() })
    }

    /// The database.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Every series the history knows, channels and estimates.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn series(&self) -> Result<Vec<Series>, HistoryError> {
        schema::known_series(&self.db)
    }

    /// Time of the first and the last row; `None` when there are no rows.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn span(&self) -> Result<Option<(TimeNs, TimeNs)>, HistoryError> {
        let bounds: (Option<TimeNs>, Option<TimeNs>) = self
            .db
            .query_row(
                "SELECT min(first_ns), max(last_ns) FROM (
                   SELECT min(start_ns) AS first_ns, NULL AS last_ns FROM blocks
                   UNION ALL SELECT NULL, max(end_ns) FROM blocks WHERE start_ns >=
                     (SELECT max(start_ns) FROM blocks) - 600000000000
                   UNION ALL SELECT min(start_ns), max(end_ns) FROM tail
                     WHERE first_row >= coalesce((SELECT first_row + rows FROM blocks ORDER BY first_row DESC LIMIT 1), 0))",
                [],
                |row| Ok((row.get(0)?, row.get(1)?)),
            )
            .doing("looking for the first and the last row")?;
        Ok(bounds.0.zip(bounds.1))
    }

    /// A whole copy of the file as it is now, at `to`, where nothing may be yet. The one who writes goes on meanwhile.
    ///
    /// # Errors
    /// There is something at `to`, it cannot be written, or what `SQLite` says.
    pub fn copy_to(&self, to: &Path) -> Result<(), HistoryError> {
        if to.exists() {
            return Err(HistoryError::Question(format!("{} is there already; name another file", to.display())));
        }
        let name = to.to_string_lossy();
        self.db.execute("VACUUM INTO ?1", [&*name]).doing("copying the history").map(drop)
    }

    /// Does the file pass `SQLite`'s own check? The findings otherwise.
    ///
    /// # Errors
    /// What `SQLite` says when it cannot even check.
    pub fn check(&self) -> Result<Vec<String>, HistoryError> {
        let mut statement = self.db.prepare("PRAGMA integrity_check").doing("checking the file")?;
        let lines = statement.query_map([], |row| row.get::<_, String>(0));
        let lines: Vec<String> = lines.and_then(Iterator::collect).doing("checking the file")?;
        Ok(lines.into_iter().filter(|line| line != "ok").collect())
    }
}
