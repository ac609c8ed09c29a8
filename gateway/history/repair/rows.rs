//! Row by row from one file into another, past what cannot be read.

use super::super::block::{BlockKey, StoredBlock};
use super::super::error::{Doing, HistoryError, is_of_disk};
use rusqlite::types::Value;
use rusqlite::{Connection, OptionalExtension, Row, params_from_iter};

/// By what the rows of a table are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Keys {
    /// A number, by which they lie in the file. Several rows may have the same.
    Number(&'static str),
    /// A few rows, all at once or not at all.
    Whole,
}

/// The copy of one table.
pub(super) struct TableCopy {
    keys: Keys,
    /// Selects the rows of the key that comes next after the first parameter and is below the second.
    select: String,
    next: String,
    insert: String,
    columns: usize,
    range: (i64, i64),
    pub(super) saved: u64,
    /// Keys of rows that were not wanted.
    pub(super) refused: Vec<i64>,
    /// After the first key, before the second, rows could not be read.
    pub(super) lost: Vec<(i64, i64)>,
}

/// The block of a row of all columns of its table, in the order of the table.
pub(super) fn read_block(row: &Row<'_>) -> Option<StoredBlock> {
    let number = |name: &str| row.get::<_, i64>(name).ok();
    let key = BlockKey {
        segment: number("segment")?,
        first_row: number("first_row")?,
        rows: number("rows")?,
        start_ns: number("start_ns")?,
        end_ns: number("end_ns")?,
    };
    Some(StoredBlock { key, directory: row.get("directory").ok()?, columns: row.get("columns").ok()? })
}

fn read_column_names(db: &Connection, table: &str) -> Result<Vec<String>, HistoryError> {
    let mut select = db.prepare(&format!("PRAGMA table_info({table})")).with_activity("looking at the tables")?;
    let names = select.query_map([], |row| row.get(1));
    names.and_then(Iterator::collect).with_activity("looking at the tables")
}

impl TableCopy {
    /// Of this table; `None` where one of the files does not have it.
    pub(super) fn for_table(
        from: &Connection,
        to: &Connection,
        table: &'static str,
        keys: Keys,
    ) -> Result<Option<Self>, HistoryError> {
        let known = read_column_names(to, table)?;
        let names: Vec<String> =
            read_column_names(from, table)?.into_iter().filter(|name| known.contains(name)).collect();
        if names.is_empty() {
            return Ok(None);
        }
        let list = names.join(", ");
        let places = vec!["?"; names.len()].join(", ");
        let (select, next) = match keys {
            Keys::Number(key) => (
                format!("SELECT {list} FROM {table} WHERE {key} = ?1"),
                format!("SELECT {key} FROM {table} WHERE {key} > ?1 AND {key} < ?2 ORDER BY {key} LIMIT 1"),
            ),
            Keys::Whole => (format!("SELECT {list} FROM {table}"), String::new()),
        };
        let insert = format!("INSERT OR REPLACE INTO {table} ({list}) VALUES ({places})");
        let range = (i64::MIN, i64::MAX);
        let (columns, refused, lost) = (names.len(), Vec::new(), Vec::new());
        Ok(Some(Self { keys, select, next, insert, columns, range, saved: 0, refused, lost }))
    }

    /// Only the keys after the first and before the second.
    pub(super) fn limit_range(&mut self, after: i64, before: i64) {
        self.range = (after, before);
    }

    /// Copies every row that can be read and is wanted.
    pub(super) fn run(
        &mut self,
        from: &Connection,
        to: &Connection,
        wanted: impl Fn(&Row<'_>) -> bool,
    ) -> Result<(), HistoryError> {
        if self.keys == Keys::Whole {
            if !self.copy_key(from, to, None, &wanted)? {
                self.lost.push((0, 0));
            }
            return Ok(());
        }
        let (mut after, before) = self.range;
        loop {
            match self.next_key(from, after, before) {
                Ok(None) => return Ok(()),
                Ok(Some(key)) => {
                    if !self.copy_key(from, to, Some(key), &wanted)? {
                        self.note_lost(after, key.saturating_add(1));
                    }
                    after = key;
                }
                Err(error) if error.is_damage() => {
                    let found = self.find_beyond(from, after, before)?;
                    self.note_lost(after, found.map_or(before, |found| found.saturating_add(1)));
                    let Some(found) = found else { return Ok(()) };
                    after = found;
                }
                Err(error) => return Err(error),
            }
        }
    }

    fn note_lost(&mut self, after: i64, before: i64) {
        match self.lost.last_mut() {
            Some((_, end)) if *end >= after.saturating_add(1) => *end = before,
            _ => self.lost.push((after, before)),
        }
    }

    fn next_key(&self, from: &Connection, after: i64, before: i64) -> Result<Option<i64>, HistoryError> {
        let found = from
            .prepare_cached(&self.next)
            .and_then(|mut select| select.query_row([after, before], |row| row.get(0)).optional());
        found.with_activity("looking for the next row")
    }

    /// The smallest number after `after` behind which the next key can be found again; `None`: there is none.
    fn find_beyond(&self, from: &Connection, after: i64, before: i64) -> Result<Option<i64>, HistoryError> {
        let readable = |key: i64| match self.next_key(from, key, before) {
            Ok(found) => Ok(found.is_some()),
            Err(error) if error.is_damage() => Ok(false),
            Err(error) => Err(error),
        };
        let start = after.max(0);
        let mut step = 1_i64;
        while !readable(start.saturating_add(step))? {
            if step > i64::MAX / 4 || start.saturating_add(step) >= before {
                return Ok(None);
            }
            step *= 2;
        }
        let (mut bad, mut good) = (start.saturating_add(step / 2), start.saturating_add(step));
        while good - bad > 1 {
            let middle = bad + (good - bad) / 2;
            if readable(middle)? {
                good = middle;
            } else {
                bad = middle;
            }
        }
        Ok(Some(good))
    }

    /// Copies the rows of one key, or all of them; false when they cannot be read.
    fn copy_key(
        &mut self,
        from: &Connection,
        to: &Connection,
        key: Option<i64>,
        wanted: &impl Fn(&Row<'_>) -> bool,
    ) -> Result<bool, HistoryError> {
        let mut select = match from.prepare_cached(&self.select) {
            Err(error) if is_of_disk(&error) => return Ok(false),
            select => select.with_activity("reading rows")?,
        };
        let mut rows = select.query(params_from_iter(key)).with_activity("reading rows")?;
        loop {
            let row = match rows.next() {
                Ok(Some(row)) => row,
                Ok(None) => return Ok(true),
                Err(error) if is_of_disk(&error) => return Ok(false),
                Err(error) => return Err(error).with_activity("reading rows"),
            };
            if !wanted(row) {
                self.refused.extend(key);
                continue;
            }
            let values = (0..self.columns).map(|column| row.get::<_, Value>(column));
            let Ok(values) = values.collect::<Result<Vec<Value>, _>>() else { return Ok(false) };
            let mut insert = to.prepare_cached(&self.insert).with_activity("writing the new file")?;
            match insert.execute(params_from_iter(values)) {
                Ok(_) => self.saved += 1,
                // A rule of the table is broken: what was read is not what was written.
                Err(error) if error.sqlite_error_code() == Some(rusqlite::ErrorCode::ConstraintViolation) => {
                    return Ok(false);
                }
                Err(error) => return Err(error).with_activity("writing the new file"),
            }
        }
    }
}
