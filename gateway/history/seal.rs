//! Blocks of a version that wrote no checksums get them, some every night. What the disk had changed before cannot be seen;
//! what it changes from then on can.

use super::block::{BLOCK_COLUMNS, Decoder, StoredBlock};
use super::error::{Doing, HistoryError};
use rusqlite::{Connection, OptionalExtension, params};

/// Blocks in one run of maintenance: some hundred megabytes that are written once.
pub(crate) const BLOCKS_PER_RUN: usize = 4_000;
/// Blocks in one step.
const STEP: i64 = 16;

/// Seals the next blocks; how many. 0 when there are none left.
pub(crate) fn seal_next_blocks(db: &mut Connection) -> Result<usize, HistoryError> {
    let sealing = db.transaction().with_activity("beginning to seal blocks")?;
    let cursor: i64 = sealing
        .query_row("SELECT value FROM meta WHERE key = 'sealed_row'", [], |row| row.get(0))
        .optional()
        .with_activity("looking up what is sealed")?
        .unwrap_or(0);
    let mut select = sealing
        .prepare_cached(&format!(
            "SELECT {BLOCK_COLUMNS} FROM blocks WHERE first_row >= ?1 ORDER BY first_row LIMIT ?2"
        ))
        .with_activity("reading blocks")?;
    let blocks = select.query_map([cursor, STEP], StoredBlock::of_row);
    let blocks: Vec<StoredBlock> = blocks.and_then(Iterator::collect).with_activity("reading blocks")?;
    drop(select);
    let Some(last) = blocks.last().map(|block| block.key.first_row) else { return Ok(0) };
    let mut decoder = Decoder::new().map_err(|error| HistoryError::Io { path: "zstd".into(), error })?;
    for block in blocks.iter().filter(|block| !block.is_sealed()) {
        let Some(sealed) = block.with_checksums(&mut decoder) else { continue };
        sealing
            .execute(
                "UPDATE blocks SET directory = ?2 WHERE first_row = ?1",
                params![sealed.key.first_row, sealed.directory],
            )
            .with_activity("sealing a block")?;
    }
    sealing
        .execute("INSERT OR REPLACE INTO meta (key, value) VALUES ('sealed_row', ?1)", [last + 1])
        .with_activity("noting what is sealed")?;
    sealing.commit().with_activity("sealing blocks")?;
    Ok(blocks.len())
}
