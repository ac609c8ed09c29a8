//! Facts of production in the database, see [`Fact`]: stored once, read by time.

use super::error::{Doing, HistoryError};
use super::list::RecordSpan;
use super::reader::Reader;
use gateway_records::{Fact, FactKind};
use rusqlite::{Connection, OptionalExtension, Row, params};

/// Stores it once, whatever comes twice.
pub(crate) fn store_fact(db: &Connection, fact: &Fact) -> Result<(), rusqlite::Error> {
    db.prepare_cached(
        "INSERT INTO facts (at_ns, from_ns, until_ns, fact, value, parts, mark, way, author)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9) ON CONFLICT (mark) DO NOTHING",
    )?
    .execute(params![
        fact.at_ns,
        fact.from_ns,
        fact.until_ns,
        fact.fact.as_word(),
        fact.value,
        fact.parts,
        fact.mark,
        fact.way,
        fact.author
    ])
    .map(drop)
}

fn read_fact(row: &Row<'_>) -> Result<Fact, rusqlite::Error> {
    let word: String = row.get(3)?;
    Ok(Fact {
        at_ns: row.get(0)?,
        from_ns: row.get(1)?,
        until_ns: row.get(2)?,
        // The table takes no other word.
        fact: FactKind::from_word(&word).unwrap_or_default(),
        value: row.get(4)?,
        parts: row.get(5)?,
        mark: row.get(6)?,
        way: row.get(7)?,
        author: row.get(8)?,
    })
}

impl Reader {
    /// Does the file have the table? One of an older version that nobody has written since does not.
    fn has_facts(&self) -> Result<bool, HistoryError> {
        self.db
            .query_row("SELECT 1 FROM sqlite_schema WHERE name = 'facts'", [], |_| Ok(()))
            .optional()
            .map(|found| found.is_some())
            .with_activity("looking for facts")
    }

    /// Facts that happened or began in the range, the newest `limit` of them, oldest first.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn read_facts(&self, span: RecordSpan) -> Result<Vec<Fact>, HistoryError> {
        self.select_facts("from_ns", span)
    }

    /// Facts that the box was told in the range, the newest `limit` of them, oldest first.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn read_facts_told(&self, span: RecordSpan) -> Result<Vec<Fact>, HistoryError> {
        self.select_facts("at_ns", span)
    }

    fn select_facts(&self, time: &str, span: RecordSpan) -> Result<Vec<Fact>, HistoryError> {
        if !self.has_facts()? {
            return Ok(Vec::new());
        }
        let select = format!(
            "SELECT at_ns, from_ns, until_ns, fact, value, parts, mark, way, author FROM facts
             WHERE {time} >= ?1 AND {time} < ?2 ORDER BY {time} DESC, id DESC LIMIT ?3"
        );
        self.read_records(&select, span, read_fact)
    }
}
