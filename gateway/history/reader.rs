//! Reading a history while the gateway writes it: a connection of its own that cannot change anything.

use super::damage::DamagedRows;
use super::error::{Doing, HistoryError};
use super::future::{self, FutureRows};
use super::schema;
use super::segments;
use super::series::Series;
use super::walk::Walk;
use adapter_core::clock::TimeNs;
use gateway_base::clock;
use rusqlite::{Connection, Transaction};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Reads one history. Cheap to open; one per thread.
#[derive(Debug)]
pub struct Reader {
    pub(crate) db: Connection,
    pub(crate) path: PathBuf,
    damaged: RefCell<BTreeMap<i64, DamagedRows>>,
}

impl Reader {
    /// Opens the history at `path` for reading.
    ///
    /// # Errors
    /// [`HistoryError::Missing`], [`HistoryError::NewerSchema`], [`HistoryError::NotAHistory`], or what `SQLite` says.
    pub fn open(path: &Path) -> Result<Self, HistoryError> {
        let db = schema::open_for_reading(path)?;
        Ok(Self { db, path: path.to_owned(), damaged: RefCell::default() })
    }

    /// What the answers until now have left out because the disk has changed it, in the order of recording.
    #[must_use]
    pub fn damaged_rows(&self) -> Vec<DamagedRows> {
        self.damaged.borrow().values().copied().collect()
    }

    pub(crate) fn note_damage(&self, walk: &Walk) {
        self.damaged.borrow_mut().extend(walk.damaged.iter().map(|damaged| (damaged.first_row, *damaged)));
    }

    /// Path of the database that was opened.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Every series the history knows, channels and estimates.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn read_series(&self) -> Result<Vec<Series>, HistoryError> {
        schema::known_series(&self.db)
    }

    /// One moment's view of the file for as long as it is kept: what the gateway writes and compacts meanwhile is not seen. `None` within a
    /// view that is kept already.
    pub(crate) fn begin_view(&self) -> Result<Option<Transaction<'_>>, HistoryError> {
        if !self.db.is_autocommit() {
            return Ok(None);
        }
        self.db.unchecked_transaction().map(Some).with_activity("beginning to read")
    }

    /// Time of the first and the last row; `None` when there are no rows.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn read_span(&self) -> Result<Option<(TimeNs, TimeNs)>, HistoryError> {
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
            .with_activity("looking for the first and the last row")?;
        Ok(bounds.0.zip(bounds.1))
    }

    /// Time of the first row, and the time that `now`, `today` and `-10m` count from: that of the newest row which is not from
    /// the future. `None` when there are no rows.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn read_present_span(&self) -> Result<Option<(TimeNs, TimeNs)>, HistoryError> {
        let now_ns = clock::now_ns();
        match self.read_span()? {
            Some((first_ns, newest_ns)) if newest_ns > now_ns.saturating_add(future::AHEAD_NS) => {
                Ok(Some((first_ns, future::present_ns(&self.db, now_ns, newest_ns)?.max(first_ns))))
            }
            span => Ok(span),
        }
    }

    /// The rows that say they come from after `now_ns`, unless the machine brought its own time. `None` without any.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn find_future_rows(&self, now_ns: TimeNs) -> Result<Option<FutureRows>, HistoryError> {
        FutureRows::find_after(&self.db, now_ns)
    }

    /// It is certainly later than this: a row was stored then under a confirmed clock. `None` when no clock was confirmed yet.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn certain_ns(&self) -> Result<Option<TimeNs>, HistoryError> {
        segments::certain_ns(&self.db)
    }

    /// A whole copy of the file as it is now, at `to`, where nothing may be yet. The one who writes goes on meanwhile.
    ///
    /// # Errors
    /// There is something at `to`, it cannot be written, or what `SQLite` says.
    pub fn copy_to(&self, to: &Path) -> Result<(), HistoryError> {
        if to.exists() {
            return Err(HistoryError::Question(format!("{} is there already; name another file", to.display())));
        }
        schema::copy_whole(&self.db, to).with_activity("copying the history")
    }

    /// Does the file pass `SQLite`'s own check? The findings otherwise.
    ///
    /// # Errors
    /// What `SQLite` says when it cannot even check.
    pub fn check_integrity(&self) -> Result<Vec<String>, HistoryError> {
        let mut statement = self.db.prepare("PRAGMA integrity_check").with_activity("checking the file")?;
        let lines = statement.query_map([], |row| row.get::<_, String>(0));
        let lines: Vec<String> = lines.and_then(Iterator::collect).with_activity("checking the file")?;
        Ok(lines.into_iter().filter(|line| line != "ok").collect())
    }
}
