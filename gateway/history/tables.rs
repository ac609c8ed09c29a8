//! Which tables a file has.

use rusqlite::{Connection, OptionalExtension};

/// Does the file have the table? One of an older version that nobody has written since lacks those that came later.
pub(crate) fn has_table(db: &Connection, name: &str) -> Result<bool, rusqlite::Error> {
    db.query_row("SELECT 1 FROM sqlite_schema WHERE name = ?1", [name], |_| Ok(()))
        .optional()
        .map(|found| found.is_some())
}
