//! Nightly compaction: the minute blocks of ten minutes become one, compressed harder. A third of the bytes goes.

use super::block::{
    BLOCK_COLUMNS, Block, Cells, Decoder, Directory, Encoder, LEVEL_COMPACT, NumberCells, StoredBlock, WordCells,
};
use super::commit::put_block;
use super::error::{Doing, HistoryError};
use super::reason::{NOT_PROVIDED, PRESENT, Reasons};
use super::rows::{Column, SeriesRows, Word};
use super::schema::known_series;
use super::series::Series;
use adapter_core::clock::SECOND_NS;
use rusqlite::{Connection, OptionalExtension, params};

/// Length of a compacted block.
pub(crate) const COMPACT_NS: i64 = 600 * SECOND_NS;
/// More rows than this are not put together: bounds memory at high rates.
const ROWS_MAX: i64 = 20_000;
/// At most this many blocks are looked at in one step.
const LOOK_AHEAD: i64 = 64;

/// Compacts the next ten minutes; false when there is nothing left that is complete.
pub(crate) fn compact_next(db: &mut Connection) -> Result<bool, HistoryError> {
    let cursor = read_cursor(db)?;
    let stored = read_blocks(db, cursor)?;
    let Some(first) = stored.first() else { return Ok(false) };
    let first = first.key;
    let mut end_row = first.first_row;
    let mut rows = 0;
    let belongs = |block: &&StoredBlock| {
        let key = block.key;
        let follows = key.first_row == end_row && rows + key.rows <= ROWS_MAX.max(key.rows);
        end_row = key.first_row + key.rows;
        rows += key.rows;
        follows
            && key.segment == first.segment
            && key.start_ns.div_euclid(COMPACT_NS) == first.start_ns.div_euclid(COMPACT_NS)
    };
    let together = stored.iter().take_while(belongs).count().max(1);
    if together == stored.len() {
        // The block after these is not there yet, so these may not be complete.
        return Ok(false);
    }
    let group = &stored[..together];
    // Blocks that the disk has changed stay as they are, and are told by whoever reads them.
    let merged = if together > 1 { merge_blocks(db, group)? } else { None };
    replace_blocks(db, group, merged.as_ref(), stored[together].key.first_row)?;
    Ok(true)
}

fn read_cursor(db: &Connection) -> Result<i64, HistoryError> {
    let cursor: Option<i64> = db
        .query_row("SELECT value FROM meta WHERE key = 'compacted_row'", [], |row| row.get(0))
        .optional()
        .with_activity("looking up what is compacted")?;
    Ok(cursor.unwrap_or(0))
}

fn read_blocks(db: &Connection, cursor: i64) -> Result<Vec<StoredBlock>, HistoryError> {
    let mut statement = db
        .prepare_cached(&format!(
            "SELECT {BLOCK_COLUMNS} FROM blocks WHERE first_row >= ?1 ORDER BY first_row LIMIT ?2"
        ))
        .with_activity("reading blocks")?;
    let blocks = statement.query_map([cursor, LOOK_AHEAD], StoredBlock::of_row);
    blocks.and_then(Iterator::collect).with_activity("reading blocks")
}

/// The block of all of these; `None` when one of them is damaged.
fn merge_blocks(db: &Connection, group: &[StoredBlock]) -> Result<Option<Block>, HistoryError> {
    let mut series = known_series(db)?;
    // What is stored has been rounded already.
    series.iter_mut().for_each(|series| series.decimals = None);
    let zstd = |error| HistoryError::Io { path: "zstd".into(), error };
    let mut decoder = Decoder::new().map_err(zstd)?;
    let mut reasons = Reasons::default();
    let mut rows = SeriesRows::for_series(&series);
    for stored in group {
        let Some(more) = rows_of(stored, &series, &mut decoder, &mut reasons) else { return Ok(None) };
        let count = more.len();
        rows.append_rows(&more, 0..count);
    }
    let mut encoder = Encoder::new(LEVEL_COMPACT).map_err(zstd)?;
    let key = group[0].key;
    Ok(Some(encoder.encode_block(&rows, &series, &reasons, key.segment, key.first_row)))
}

/// All rows of a block, with the reasons of `reasons`; `None` when it is damaged.
pub(crate) fn rows_of(
    stored: &StoredBlock,
    series: &[Series],
    decoder: &mut Decoder,
    reasons: &mut Reasons,
) -> Option<SeriesRows> {
    let directory = stored.verify_directory()?;
    let mut rows = SeriesRows::for_series(series);
    rows.at_ns = decoder.decode_times(&directory, &stored.columns)?;
    let codes = own_codes(&directory, reasons);
    for (series, column) in series.iter().zip(&mut rows.columns) {
        if let Some(entry) = directory.find_entry(series.id) {
            *column = column_of(decoder.decode_cells(&directory, entry, &stored.columns)?, &codes);
        }
    }
    Some(rows)
}

/// From the codes of a block to the codes of `reasons`.
pub(crate) fn own_codes(directory: &Directory, reasons: &mut Reasons) -> [u8; 256] {
    let mut codes = [NOT_PROVIDED; 256];
    (0..=u8::MAX).zip(&mut codes).for_each(|(code, own)| *own = code);
    for (code, word) in &directory.words {
        codes[usize::from(*code)] = reasons.intern_word(word);
    }
    codes
}

fn column_of(cells: Cells, codes: &[u8; 256]) -> Column {
    match cells {
        Cells::Numbers(NumberCells { values, mut missing }) => {
            missing.iter_mut().for_each(|code| *code = codes[usize::from(*code)]);
            Column::Numbers { values, missing }
        }
        Cells::Words(WordCells { words, codes: which, missing }) => {
            let word = |(code, missing): (&u32, &u8)| match *missing {
                PRESENT => words.get(*code as usize).map_or(Word::Missing(NOT_PROVIDED), |word| Word::Is(word.clone())),
                reason => Word::Missing(codes[usize::from(reason)]),
            };
            let mut changes: Vec<(usize, Word)> = (0..).zip(which.iter().zip(&missing).map(word)).collect();
            changes.dedup_by(|later, earlier| later.1 == earlier.1);
            Column::Words(changes)
        }
    }
}

fn replace_blocks(
    db: &mut Connection,
    group: &[StoredBlock],
    merged: Option<&Block>,
    next_row: i64,
) -> Result<(), HistoryError> {
    let replacing = db.transaction().with_activity("beginning to compact")?;
    if let Some(merged) = merged {
        let first_row = merged.key.first_row;
        let last_row = group.last().map_or(first_row, |last| last.key.first_row);
        replacing
            .execute("DELETE FROM blocks WHERE first_row BETWEEN ?1 AND ?2", [first_row, last_row])
            .and_then(|_| put_block(&replacing, merged))
            .with_activity("replacing blocks by one")?;
    }
    replacing
        .execute("INSERT OR REPLACE INTO meta (key, value) VALUES ('compacted_row', ?1)", params![next_row])
        .with_activity("noting what is compacted")?;
    replacing.commit().with_activity("compacting")
}
