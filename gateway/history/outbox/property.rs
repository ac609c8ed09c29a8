//! What the outbox notes of itself in the table `meta`.

use crate::HistoryError;
use crate::error::Doing;
use rusqlite::{Connection, OptionalExtension};

/// The text of this key, where there is one.
pub(super) fn read_property(db: &Connection, key: &str) -> Result<Option<String>, HistoryError> {
    db.query_row("SELECT CAST(value AS TEXT) FROM meta WHERE key = ?1", [key], |row| row.get(0))
        .optional()
        .with_activity("reading the outbox")
}
