//! One group commit: everything that is not durable yet, in one transaction.

use super::block::Block;
use super::error::{Doing, HistoryError};
use super::keeper::{Keeper, Segment};
use super::record_sql;
use super::{pyramid, tail};
use rusqlite::{Connection, params};
use std::collections::VecDeque;

/// Tail entries kept although their rows are in a block already, so that `recent_samples` always has something to show:
/// two minutes at one commit a second.
const TAIL_KEPT: usize = 120;

/// Which slots of the crash tail hold what, oldest first.
#[derive(Debug, Default)]
pub(crate) struct TailSlots {
    /// Slot and number of the row after its last.
    used: VecDeque<(i64, i64)>,
}

impl TailSlots {
    /// The slots of a file that is opened again; their rows are in blocks by then.
    pub(crate) fn load(db: &Connection) -> Result<Self, HistoryError> {
        let mut statement =
            db.prepare("SELECT slot, first_row + rows FROM tail ORDER BY first_row").doing("reading the crash tail")?;
        let used = statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?)));
        Ok(Self { used: used.and_then(Iterator::collect).doing("reading the crash tail")? })
    }

    /// The slot for the next entry: the oldest whose rows are in blocks, or a new one. The second is true when it is an
    /// old one.
    fn next(&self, sealed_row: i64) -> (i64, bool) {
        match self.used.front() {
            Some((slot, end_row)) if self.used.len() >= TAIL_KEPT && *end_row <= sealed_row => (*slot, true),
            _ => (self.used.iter().map(|(slot, _)| slot + 1).max().unwrap_or(0), false),
        }
    }

    fn took(&mut self, slot: i64, reused: bool, end_row: i64) {
        if reused {
            self.used.pop_front();
        }
        self.used.push_back((slot, end_row));
    }
}

/// Makes everything in `keeper` durable, or changes nothing.
pub(crate) fn commit(
    db: &mut Connection,
    keeper: &mut Keeper,
    slots: &mut TailSlots,
    origin: &str,
) -> Result<(), HistoryError> {
    let writing = db.transaction_with_behavior(rusqlite::TransactionBehavior::Immediate).doing("beginning a commit")?;
    keeper.segments.iter().try_for_each(|segment| insert_segment(&writing, segment, origin))?;
    keeper.blocks.iter().try_for_each(|block| insert_block(&writing, block))?;
    keeper.records.iter().try_for_each(|record| record_sql::store(&writing, record).doing("storing a record"))?;
    let fresh = keeper.in_tail..keeper.open.len();
    let (slot, reused) = slots.next(keeper.open_row());
    if !fresh.is_empty() {
        insert_tail(&writing, keeper, slot)?;
    }
    writing.commit().doing("making samples durable")?;
    if !fresh.is_empty() {
        slots.took(slot, reused, keeper.next_row);
    }
    keeper.in_tail = keeper.open.len();
    keeper.segments.clear();
    keeper.blocks.clear();
    keeper.records.clear();
    Ok(())
}

fn insert_segment(db: &Connection, segment: &Segment, origin: &str) -> Result<(), HistoryError> {
    db.prepare_cached(
        "INSERT INTO segments (id, first_row, start_ns, origin, reason, version) VALUES (?1, ?2, ?3, ?4, ?5, ?6)",
    )
    .and_then(|mut insert| {
        let version = env!("CARGO_PKG_VERSION");
        insert.execute(params![segment.id, segment.first_row, segment.start_ns, origin, segment.reason, version])
    })
    .map(drop)
    .doing("beginning a segment")
}

/// Stores a fresh block and its summaries.
pub(crate) fn insert_block(db: &Connection, block: &Block) -> Result<(), HistoryError> {
    put_block(db, block).and_then(|()| pyramid::add(db, block)).doing("storing a block")
}

/// Stores a block without touching the summaries.
pub(crate) fn put_block(db: &Connection, block: &Block) -> Result<(), rusqlite::Error> {
    db.prepare_cached(
        "INSERT INTO blocks (first_row, segment, rows, start_ns, end_ns, directory, columns)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
    )?
    .execute(params![
        block.first_row,
        block.segment,
        block.rows as i64,
        block.start_ns,
        block.end_ns,
        block.directory,
        block.columns
    ])
    .map(drop)
}

fn insert_tail(db: &Connection, keeper: &Keeper, slot: i64) -> Result<(), HistoryError> {
    let fresh = keeper.in_tail..keeper.open.len();
    let body = tail::to_text(&keeper.open, fresh.clone(), &keeper.series, &keeper.reasons);
    db.prepare_cached(
        "INSERT OR REPLACE INTO tail (slot, segment, first_row, rows, start_ns, end_ns, body)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
    )
    .and_then(|mut insert| {
        insert.execute(params![
            slot,
            keeper.segment,
            keeper.open_row() + fresh.start as i64,
            fresh.len() as i64,
            keeper.open.at_ns[fresh.start],
            keeper.open.at_ns[fresh.end - 1],
            body
        ])
    })
    .map(drop)
    .doing("storing the crash tail")
}
