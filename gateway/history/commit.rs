//! One group commit: everything that is not durable yet, in one transaction.

use super::block::Block;
use super::error::{Doing, HistoryError};
use super::minute_buffer::MinuteBuffer;
use super::outbox::Gatherer;
use super::record_sql;
use super::{pyramid, segments, tail};
use gateway_base::clock::ClockMark;
use rusqlite::{Connection, params};
use std::collections::VecDeque;
use std::ops::Range;

/// Rows kept in the tail although they are in a block already, so that `recent_samples` always has something to show:
/// two minutes at 10 Hz.
const TAIL_ROWS: i64 = 1_200;
/// Blocks in one transaction: bounds the room a commit needs in the log.
const BLOCKS_MAX: usize = 16;

/// One entry of the crash tail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct TailEntry {
    slot: i64,
    /// Number of the row after its last.
    end_row: i64,
}

/// An entry of the tail stays below this, so that it never needs a page of its own beyond the leaf it lies in.
const ENTRY_BYTES: usize = 3_800;
/// Entries are padded to multiples of this: one that is as long as the one it replaces is written over it in place.
const ENTRY_STEP: usize = 256;

/// Which slots of the crash tail hold what, oldest first.
#[derive(Debug, Clone, Default)]
pub(crate) struct TailSlots {
    used: VecDeque<TailEntry>,
}

impl TailSlots {
    /// The slots of a file that is opened again; their rows are in blocks by then.
    pub(crate) fn load(db: &Connection) -> Result<Self, HistoryError> {
        let mut statement = db
            .prepare("SELECT slot, first_row + rows FROM tail ORDER BY first_row")
            .with_activity("reading the crash tail")?;
        let used = statement.query_map([], |row| Ok(TailEntry { slot: row.get(0)?, end_row: row.get(1)? }));
        Ok(Self { used: used.and_then(Iterator::collect).with_activity("reading the crash tail")? })
    }

    /// Takes out the oldest entry if its rows are in blocks and not needed to show the last rows up to `next_row`.
    fn take_spare(&mut self, sealed_row: i64, next_row: i64) -> Option<i64> {
        let spare = |entry: &mut TailEntry| entry.end_row <= sealed_row.min(next_row - TAIL_ROWS);
        self.used.pop_front_if(spare).map(|entry| entry.slot)
    }

    fn new_slot(&self) -> i64 {
        self.used.iter().map(|entry| entry.slot + 1).max().unwrap_or(0)
    }
}

/// Makes the oldest of what is in `minute_buffer` durable, dated as `dated` says (origin and clock of new segments), or changes nothing. False when blocks are left; with the last of
/// them go, if `with_tail`, the rows of the running minute. Records go with their rows: what a kill leaves behind is the
/// history up to one moment, with everything before it and nothing after it.
pub(crate) fn commit_buffer(
    db: &mut Connection,
    minute_buffer: &mut MinuteBuffer,
    slots: &mut TailSlots,
    outbox: &mut Option<Gatherer>,
    dated: (&str, &ClockMark),
    with_tail: bool,
) -> Result<bool, HistoryError> {
    let writing =
        db.transaction_with_behavior(rusqlite::TransactionBehavior::Immediate).with_activity("beginning a commit")?;
    minute_buffer.segments.iter().try_for_each(|segment| segments::insert(&writing, segment, dated))?;
    let blocks = minute_buffer.blocks.len().min(BLOCKS_MAX);
    minute_buffer.blocks.iter().take(blocks).try_for_each(|block| insert_block(&writing, block))?;
    let last = blocks == minute_buffer.blocks.len();
    let mut replaced = slots.clone();
    if last && with_tail {
        put_tail(&writing, minute_buffer, &mut replaced)?;
    }
    let end_row = rows_end(minute_buffer, blocks, with_tail);
    let records = minute_buffer.records_through(end_row);
    let mut storing = minute_buffer.records.iter().take(records);
    storing
        .try_for_each(|posted| record_sql::store_record(&writing, &posted.record))
        .with_activity("storing a record")?;
    let items = outbox.as_ref().map(|outbox| {
        let records = minute_buffer.records.iter().take(records);
        let stored = minute_buffer.blocks.iter().take(blocks).map(|block| block.key.start_ns);
        let rows = (minute_buffer.opened_row, end_row);
        outbox.store_items(&writing, records, rows, (stored, dated.1.is_certain()))
    });
    let items = items.transpose()?;
    writing.commit().with_activity("making samples durable")?;
    if let (Some(outbox), Some(items)) = (outbox, items) {
        outbox.confirm_commit(items, &minute_buffer.reasons);
    }
    minute_buffer.segments.clear();
    minute_buffer.blocks.drain(..blocks);
    *slots = replaced;
    minute_buffer.forget_records(records);
    if last && with_tail {
        minute_buffer.in_tail = minute_buffer.open.len();
    }
    Ok(last)
}

/// Number of the row after the last one that a commit of the first `blocks` blocks makes durable.
fn rows_end(minute_buffer: &MinuteBuffer, blocks: usize, with_tail: bool) -> i64 {
    match minute_buffer.blocks.get(blocks) {
        Some(left) => left.key.first_row,
        None if with_tail => minute_buffer.next_row,
        None => minute_buffer.open_row() + minute_buffer.in_tail as i64,
    }
}

/// Writes the rows that the crash tail lacks, over its oldest entries where those are not needed any more.
fn put_tail(db: &Connection, minute_buffer: &MinuteBuffer, slots: &mut TailSlots) -> Result<(), HistoryError> {
    let mut from = minute_buffer.in_tail;
    let mut count = minute_buffer.open.len() - from;
    while from < minute_buffer.open.len() {
        count = count.min(minute_buffer.open.len() - from);
        let body =
            tail::to_text(&minute_buffer.open, from..from + count, &minute_buffer.series, &minute_buffer.reasons);
        if body.len() > ENTRY_BYTES && count > 1 {
            count = (count * ENTRY_BYTES / body.len()).clamp(1, count - 1);
            continue;
        }
        let slot =
            slots.take_spare(minute_buffer.open_row(), minute_buffer.next_row).unwrap_or_else(|| slots.new_slot());
        insert_tail(db, minute_buffer, slot, from..from + count, &pad_entry(body))?;
        from += count;
        slots.used.push_back(TailEntry { slot, end_row: minute_buffer.open_row() + from as i64 });
    }
    while let Some(slot) = slots.take_spare(minute_buffer.open_row(), minute_buffer.next_row) {
        db.prepare_cached("DELETE FROM tail WHERE slot = ?1")
            .and_then(|mut delete| delete.execute([slot]))
            .with_activity("shortening the crash tail")?;
    }
    Ok(())
}

/// Blanks up to the next multiple of the step. Not by the width of a format, which ends the thread beyond 65,535.
fn pad_entry(mut body: String) -> String {
    let blanks = body.len().next_multiple_of(ENTRY_STEP) - body.len();
    body.extend(std::iter::repeat_n(' ', blanks));
    body
}

/// Stores a fresh block and its summaries.
pub(crate) fn insert_block(db: &Connection, block: &Block) -> Result<(), HistoryError> {
    put_block(db, block).and_then(|()| pyramid::add(db, block)).with_activity("storing a block")
}

/// Stores a block without touching the summaries.
pub(crate) fn put_block(db: &Connection, block: &Block) -> Result<(), rusqlite::Error> {
    let key = &block.key;
    db.prepare_cached(
        "INSERT INTO blocks (first_row, segment, rows, start_ns, end_ns, directory, columns)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
    )?
    .execute(params![key.first_row, key.segment, key.rows, key.start_ns, key.end_ns, block.directory, block.columns])
    .map(drop)
}

fn insert_tail(
    db: &Connection,
    minute_buffer: &MinuteBuffer,
    slot: i64,
    rows: Range<usize>,
    body: &str,
) -> Result<(), HistoryError> {
    db.prepare_cached(
        "INSERT OR REPLACE INTO tail (slot, segment, first_row, rows, start_ns, end_ns, body)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
    )
    .and_then(|mut insert| {
        insert.execute(params![
            slot,
            minute_buffer.segment,
            minute_buffer.open_row() + rows.start as i64,
            rows.len() as i64,
            minute_buffer.open.at_ns[rows.start],
            minute_buffer.open.at_ns[rows.end - 1],
            body
        ])
    })
    .map(drop)
    .with_activity("storing the crash tail")
}
