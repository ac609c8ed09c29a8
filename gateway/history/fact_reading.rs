//! Facts of production as they are asked for.

use super::error::{Doing, HistoryError};
use super::fact::read_fact;
use super::list::RecordSpan;
use super::reader::Reader;
use super::tables::has_table;
use gateway_records::Fact;

impl Reader {
    fn has_facts(&self) -> Result<bool, HistoryError> {
        has_table(&self.db, "facts").with_activity("looking for facts")
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
