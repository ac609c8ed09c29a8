//! The audit as it is asked for: rows of a range, rows after a number, and whether the chain holds.

use super::audit::{AuditCheck, AuditEntry, AuditRemoval, BEGINNING, Break, COLUMNS, hash, noted_head, read_entry};
use super::error::{Doing, HistoryError};
use super::reader::Reader;
use super::tables::has_table;
use adapter_core::clock::TimeNs;
use rusqlite::params;

/// Follows the chain row by row.
struct AuditChain {
    rows: u64,
    first: i64,
    /// What the oldest row follows from.
    from: String,
    last: i64,
    head: String,
    /// What the rows say of others that were removed.
    removed: Vec<AuditRemoval>,
}

impl AuditChain {
    /// The next row, or why it cannot be the next one.
    fn check_entry(&mut self, entry: &AuditEntry) -> Result<(), Break> {
        let broken = |what: String| Err(Break { number: entry.number, what });
        if self.rows > 0 && entry.number != self.last + 1 {
            return broken(format!("the rows {} to {} before it are missing", self.last + 1, entry.number - 1));
        }
        if self.rows > 0 && entry.previous != self.head || entry.number == 1 && entry.previous != BEGINNING {
            return broken("it does not follow from the row before it".to_owned());
        }
        if hash(&entry.previous, entry.number, &entry.audit) != entry.hash {
            return broken("it is not as it was written".to_owned());
        }
        (self.last, self.head, self.rows) = (entry.number, entry.hash.clone(), self.rows + 1);
        if self.first == 0 {
            (self.first, self.from) = (entry.number, entry.previous.clone());
        }
        self.removed.extend(AuditRemoval::from_entry(entry));
        Ok(())
    }

    fn finish_check(mut self, broken: Option<Break>) -> AuditCheck {
        let told =
            self.removed.iter().position(|removed| removed.through == self.first - 1 && removed.hash == self.from);
        let removed = told.map(|index| self.removed.swap_remove(index));
        let untold = (self.first > 1 && removed.is_none()).then(|| Break {
            number: 1,
            what: format!("the rows 1 to {} are gone, and no row says that they were removed", self.first - 1),
        });
        let broken = untold.or(broken);
        AuditCheck { rows: self.rows, first: self.first, last: self.last, head: self.head, removed, broken }
    }
}

impl Reader {
    fn has_audit(&self) -> Result<bool, HistoryError> {
        has_table(&self.db, "audit").with_activity("looking for the audit")
    }

    /// Rows of the time range, the newest `limit` of them, oldest first.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn read_audit(&self, from_ns: TimeNs, to_ns: TimeNs, limit: u32) -> Result<Vec<AuditEntry>, HistoryError> {
        if !self.has_audit()? {
            return Ok(Vec::new());
        }
        let select =
            format!("SELECT {COLUMNS} FROM audit WHERE at_ns >= ?1 AND at_ns < ?2 ORDER BY number DESC LIMIT ?3");
        let mut statement = self.db.prepare(&select).with_activity("reading the audit")?;
        let rows = statement.query_map(params![from_ns, to_ns, limit], read_entry);
        let mut rows: Vec<AuditEntry> = rows.and_then(Iterator::collect).with_activity("reading the audit")?;
        rows.reverse();
        Ok(rows)
    }

    /// The `limit` rows that follow the one of this number, oldest first.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn audit_after(&self, number: i64, limit: u32) -> Result<Vec<AuditEntry>, HistoryError> {
        if !self.has_audit()? {
            return Ok(Vec::new());
        }
        let select = format!("SELECT {COLUMNS} FROM audit WHERE number > ?1 ORDER BY number LIMIT ?2");
        let mut statement = self.db.prepare(&select).with_activity("reading the audit")?;
        let rows = statement.query_map(params![number, limit], read_entry);
        rows.and_then(Iterator::collect).with_activity("reading the audit")
    }

    /// Checks the whole chain from the oldest row on, and its end against the head that was noted with it.
    ///
    /// # Errors
    /// What `SQLite` says; a chain that is broken is no error but the answer.
    pub fn verify_audit(&self) -> Result<AuditCheck, HistoryError> {
        let (from, head) = (String::new(), BEGINNING.to_owned());
        let mut chain = AuditChain { rows: 0, first: 0, from, last: 0, head, removed: Vec::new() };
        if !self.has_audit()? {
            return Ok(chain.finish_check(None));
        }
        // One view of the file, also while a gateway appends to it.
        let reading = self.db.unchecked_transaction().with_activity("reading the audit")?;
        let mut statement = reading
            .prepare(&format!("SELECT {COLUMNS} FROM audit ORDER BY number"))
            .with_activity("reading the audit")?;
        let mut rows = statement.query([]).with_activity("reading the audit")?;
        loop {
            let row = match rows.next().with_activity("reading the audit") {
                Ok(Some(row)) => row,
                Ok(None) => break,
                Err(error) if error.is_damage() => {
                    let broken = Break { number: chain.last + 1, what: format!("it cannot be read: {error}") };
                    return Ok(chain.finish_check(Some(broken)));
                }
                Err(error) => return Err(error),
            };
            let number: i64 = row.get(0).with_activity("reading the audit")?;
            let followed = match read_entry(row) {
                Ok(entry) => chain.check_entry(&entry),
                Err(error) => Err(Break { number, what: format!("it cannot be read: {error}") }),
            };
            if let Err(broken) = followed {
                return Ok(chain.finish_check(Some(broken)));
            }
        }
        let noted = noted_head(&reading).with_activity("reading the head of the audit")?;
        let cut = noted.filter(|(number, hash)| (*number, hash.as_str()) != (chain.last, chain.head.as_str()));
        let broken = cut.map(|(number, _)| Break {
            number: chain.last + 1,
            what: format!("the chain ends before it; its last row was number {number}"),
        });
        Ok(chain.finish_check(broken))
    }
}
