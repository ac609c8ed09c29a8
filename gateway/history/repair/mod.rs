//! Saving what is whole from a damaged history into a new one; also the way by which a file of an older version gets sums on its
//! pages.
//!
//! Rows are read one by one in the order of their keys, from pages that are as they were written. Where a page is not, the rows
//! behind it are found again by trying keys further on. Blocks have sums of their own: they are taken from damaged pages, too,
//! where those sums are right. Summaries whose rows were lost are made anew from the blocks.

mod header;
mod rows;

use super::block::StoredBlock;
use super::damage::DamagedRows;
use super::error::{Doing, HistoryError};
use super::schema;
use super::{outbox, pyramid};
use rows::{Keys, TableCopy};
use rusqlite::Connection;
use serde::Serialize;
use std::path::Path;

/// What was saved of one table.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct RepairedTable {
    /// Name of the table in both files.
    pub table: &'static str,
    /// Rows in the new file.
    pub saved: u64,
    /// Stretches of keys behind which rows were lost: after the first, before the second.
    pub lost: Vec<(i64, i64)>,
}

/// What a repair has saved.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Repaired {
    /// What was saved of each table.
    pub tables: Vec<RepairedTable>,
    /// Samples that are lost.
    pub damaged: Vec<DamagedRows>,
}

impl Repaired {
    /// Whether no row of any table was lost.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.damaged.is_empty() && self.tables.iter().all(|table| table.lost.is_empty())
    }
}

/// The tables and their keys, in an order in which nothing refers to what comes later.
const TABLES: [(&str, Keys); 24] = [
    ("meta", Keys::Whole),
    ("series", Keys::Number("id")),
    ("segments", Keys::Number("id")),
    ("blocks", Keys::Number("first_row")),
    ("tail", Keys::Number("slot")),
    ("minutes", Keys::Number("minute")),
    ("hours", Keys::Number("hour")),
    ("days", Keys::Number("day")),
    ("states", Keys::Number("id")),
    ("state_hours", Keys::Number("hour")),
    ("parts", Keys::Number("id")),
    ("events", Keys::Number("id")),
    ("alarms", Keys::Number("id")),
    ("decisions", Keys::Number("id")),
    ("commands", Keys::Number("id")),
    ("audit", Keys::Number("number")),
    ("reactions", Keys::Number("id")),
    ("facts", Keys::Number("id")),
    ("models", Keys::Number("id")),
    ("diagnoses", Keys::Number("id")),
    ("wear_models", Keys::Number("id")),
    ("dropped", Keys::Whole),
    ("outbox", Keys::Number("first_sequence")),
    ("outbox_sinks", Keys::Whole),
];
/// Summaries, and how many minutes each of their keys is long.
const SUMMARIES: [(&str, i64); 3] = [("minutes", 1), ("hours", 60), ("days", 1_440)];

/// Copies everything that is whole from the history at `from` into a new one at `to`.
///
/// # Errors
/// There is something at `to`, it cannot be written, or nothing at all can be read from `from`.
pub fn repair_history(from: &Path, to: &Path) -> Result<Repaired, HistoryError> {
    if to.exists() {
        return Err(HistoryError::Question(format!("{} is there already; name another file", to.display())));
    }
    let source = header::open_source(from, to)?;
    let new = schema::open_for_writing(to)?;
    new.pragma_update(None, "synchronous", "OFF").with_activity("writing the new file")?;
    outbox::create_like(&source.checked, &new)?;
    let mut repaired = Repaired { tables: Vec::new(), damaged: Vec::new() };
    for (table, keys) in TABLES {
        let copied = copy_table(&source, &new, table, keys)?;
        repaired.damaged.extend(copied.damaged);
        repaired.tables.extend(copied.table);
    }
    renew_summaries(&new, &repaired.tables)?;
    new.pragma_update(None, "synchronous", "FULL").with_activity("writing the new file")?;
    new.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |_| Ok(())).with_activity("writing the new file")?;
    Ok(repaired)
}

/// What one table gave.
struct CopiedTable {
    table: Option<RepairedTable>,
    damaged: Vec<DamagedRows>,
}

fn copy_table(
    source: &header::Source,
    new: &Connection,
    table: &'static str,
    keys: Keys,
) -> Result<CopiedTable, HistoryError> {
    let copying = new.unchecked_transaction().with_activity("writing the new file")?;
    let Some(mut copy) = TableCopy::for_table(&source.checked, &copying, table, keys)? else {
        return Ok(CopiedTable { table: None, damaged: Vec::new() });
    };
    copy.run(&source.checked, &copying, |_| true)?;
    let (mut lost, mut saved, mut damaged) = (std::mem::take(&mut copy.lost), copy.saved, Vec::new());
    if table == "blocks" {
        damaged = check_blocks(&copying)?;
        saved -= damaged.len() as u64;
        for (after, before) in lost {
            // Their own sums say whether they are whole, whatever else was on the page.
            let (found, gone) = unchecked_blocks(source, &copying, (after, before))?;
            saved += found;
            damaged.extend(gone);
        }
        lost = Vec::new();
    }
    copying.commit().with_activity("writing the new file")?;
    Ok(CopiedTable { table: Some(RepairedTable { table, saved, lost }), damaged })
}

/// Takes those blocks out again whose sums are wrong.
fn check_blocks(new: &Connection) -> Result<Vec<DamagedRows>, HistoryError> {
    let mut damaged = Vec::new();
    let mut select = new
        .prepare(&format!("SELECT {} FROM blocks ORDER BY first_row", super::block::BLOCK_COLUMNS))
        .with_activity("checking blocks")?;
    let mut rows = select.query([]).with_activity("checking blocks")?;
    while let Some(row) = rows.next().with_activity("checking blocks")? {
        let stored = StoredBlock::of_row(row);
        if stored.as_ref().is_ok_and(|stored| stored.verify_directory().is_some()) {
            continue;
        }
        let first_row: i64 = row.get(1).with_activity("checking blocks")?;
        damaged.push(DamagedRows::of_block(new, first_row));
    }
    for one in &damaged {
        new.execute("DELETE FROM blocks WHERE first_row = ?1", [one.first_row]).with_activity("checking blocks")?;
    }
    Ok(damaged)
}

/// Blocks of damaged pages that are whole themselves; how many, and the samples of the others.
fn unchecked_blocks(
    source: &header::Source,
    new: &Connection,
    (after, before): (i64, i64),
) -> Result<(u64, Vec<DamagedRows>), HistoryError> {
    let Some(unchecked) = &source.unchecked else { return Ok((0, vec![lost_between(new, after)?])) };
    let Some(mut copy) = TableCopy::for_table(unchecked, new, "blocks", Keys::Number("first_row"))? else {
        return Ok((0, Vec::new()));
    };
    copy.limit_range(after, before);
    let whole =
        |row: &rusqlite::Row<'_>| rows::read_block(row).is_some_and(|stored| stored.verify_directory().is_some());
    copy.run(unchecked, new, whole)?;
    let mut damaged = Vec::new();
    for refused in copy.refused.iter().copied() {
        damaged.push(DamagedRows::of_block(unchecked, refused));
    }
    for (after, _) in &copy.lost {
        damaged.push(lost_between(new, *after)?);
    }
    Ok((copy.saved, damaged))
}

/// Samples after a block and before the next one there is.
fn lost_between(new: &Connection, after: i64) -> Result<DamagedRows, HistoryError> {
    let bounds: (Option<i64>, Option<i64>, Option<i64>, Option<i64>) = new
        .query_row(
            "SELECT (SELECT first_row + rows FROM blocks WHERE first_row <= ?1 ORDER BY first_row DESC LIMIT 1),
                    (SELECT end_ns FROM blocks WHERE first_row <= ?1 ORDER BY first_row DESC LIMIT 1),
                    (SELECT first_row FROM blocks WHERE first_row > ?1 ORDER BY first_row LIMIT 1),
                    (SELECT start_ns FROM blocks WHERE first_row > ?1 ORDER BY first_row LIMIT 1)",
            [after],
            |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?)),
        )
        .with_activity("looking for what is lost")?;
    let first_row = bounds.0.unwrap_or(0);
    let rows = bounds.2.map_or(0, |next| next - first_row);
    Ok(DamagedRows { first_row, rows, span_ns: bounds.1.zip(bounds.3) })
}

/// Summaries whose rows were lost, from the blocks.
fn renew_summaries(new: &Connection, tables: &[RepairedTable]) -> Result<(), HistoryError> {
    let writing = new.unchecked_transaction().with_activity("making summaries anew")?;
    for (name, minutes) in SUMMARIES {
        let lost = tables.iter().filter(|table| table.table == name).flat_map(|table| &table.lost);
        for (after, before) in lost {
            let range = after.saturating_mul(minutes)..before.saturating_add(1).saturating_mul(minutes);
            pyramid::renew_buckets(&writing, pyramid::with_blocks(&writing, range)?)?;
        }
    }
    writing.commit().with_activity("making summaries anew")
}
