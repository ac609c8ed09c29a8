//! One group commit: everything that is not durable yet, in one transaction.

use super::block::Block;
use super::error::{Doing, HistoryError};
use super::keeper::{Keeper, Segment};
use super::record_sql;
use super::{pyramid, tail};
use rusqlite::{Connection, params};
use std::collections::VecDeque;

/// Rows kept in the tail although they are in a block already, so that `recent_samples` always has something to show:
/// two minutes at 10 Hz.
const TAIL_ROWS: i64 = 1_200;
/// Blocks in one transaction: bounds the room a commit needs in the log.
const BLOCKS_MAX: usize = 16;

/// One entry of the crash tail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Entry {
    slot: i64,
    /// Number of the row after its last.
    end_row: i64,
}

/// Which slots of the crash tail hold what, oldest first.
#[derive(Debug, Default)]
pub(crate) struct TailSlots {
    used: VecDeque<Entry>,
}

impl TailSlots {
    /// The slots of a file that is opened again; their rows are in blocks by then.
    pub(crate) fn load(db: &Connection) -> Result<Self, HistoryError> {
        let mut statement =
            db.prepare("SELECT slot, first_row + rows FROM tail ORDER BY first_row").doing("reading the crash tail")?;
        let used = statement.query_map([], |row| Ok(Entry { slot: row.get(0)?, end_row: row.get(1)? }));
        Ok(Self { used: used.and_then(Iterator::collect).doing("reading the crash tail")? })
    }

    /// How many of the oldest entries are in blocks and not needed to show the last rows up to `next_row`.
    fn spare(&self, sealed_row: i64, next_row: i64) -> usize {
        let spare = |entry: &&Entry| entry.end_row <= sealed_row && entry.end_row <= next_row - TAIL_ROWS;
        self.used.iter().take_while(spare).count()
    }

    /// The slot for the next entry when `spare` entries go: one of theirs, or a new one.
    fn next(&self, spare: usize) -> i64 {
        match self.used.front() {
            Some(oldest) if spare > 0 => oldest.slot,
            _ => self.used.iter().map(|entry| entry.slot + 1).max().unwrap_or(0),
        }
    }

    fn took(&mut self, slot: i64, spare: usize, end_row: i64) {
        self.used.drain(..spare);
        self.used.push_back(Entry { slot, end_row });
    }
}

/// Makes the oldest of what is in `keeper` durable, or changes nothing. False when something is left: records and the
/// crash tail go with the last blocks.
pub(crate) fn commit(
    db: &mut Connection,
    keeper: &mut Keeper,
    slots: &mut TailSlots,
    origin: &str,
) -> Result<bool, HistoryError> {
    let writing = db.transaction_with_behavior(rusqlite::TransactionBehavior::Immediate).doing("beginning a commit")?;
    keeper.segments.iter().try_for_each(|segment| insert_segment(&writing, segment, origin))?;
    let blocks = keeper.blocks.len().min(BLOCKS_MAX);
    keeper.blocks.iter().take(blocks).try_for_each(|block| insert_block(&writing, block))?;
    let last = blocks == keeper.blocks.len();
    let tail =
        if last && keeper.in_tail < keeper.open.len() { Some(replace_tail(&writing, keeper, slots)?) } else { None };
    if last {
        keeper.records.iter().try_for_each(|record| record_sql::store(&writing, record).doing("storing a record"))?;
    }
    writing.commit().doing("making samples durable")?;
    keeper.segments.clear();
    keeper.blocks.drain(..blocks);
    if let Some((slot, spare)) = tail {
        slots.took(slot, spare, keeper.next_row);
        keeper.in_tail = keeper.open.len();
    }
    if last {
        keeper.records.clear();
    }
    Ok(last)
}

/// Writes the rows that the crash tail lacks over the oldest entry that is not needed; its slot, and how many went.
fn replace_tail(db: &Connection, keeper: &Keeper, slots: &TailSlots) -> Result<(i64, usize), HistoryError> {
    let spare = slots.spare(keeper.open_row(), keeper.next_row);
    let slot = slots.next(spare);
    for entry in slots.used.iter().take(spare).skip(1) {
        db.prepare_cached("DELETE FROM tail WHERE slot = ?1")
            .and_then(|mut delete| delete.execute([entry.slot]))
            .doing("shortening the crash tail")?;
    }
    insert_tail(db, keeper, slot)?;
    Ok((slot, spare))
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
