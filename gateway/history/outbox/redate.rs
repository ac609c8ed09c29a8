//! Items that wait while the clock turns out to have been wrong: they are sent with the right time.

use super::line;
use super::position::Position;
use super::reader::unpack_lines;
use super::store::{LEVEL, has_tables};
use crate::HistoryError;
use crate::error::Doing;
use gateway_base::convert::clamp_to_signed;
use rusqlite::{Connection, params};
use std::ops::Range;

/// Moves the items from number `from` on (to before `to`) by so much. Gives the numbers of those that some sink had delivered
/// before under their old date.
pub(crate) fn redate_items(
    db: &Connection,
    from: u64,
    to: Option<u64>,
    by_ns: i64,
) -> Result<Range<u64>, HistoryError> {
    if from == 0 || !has_tables(db)? {
        return Ok(0..0);
    }
    let mut select = db
        .prepare("SELECT first_sequence, body FROM outbox WHERE first_sequence >= ?1 AND first_sequence < ?2")
        .with_activity("reading the outbox")?;
    let rows = select.query_map([clamp_to_signed(from), clamp_to_signed(to.unwrap_or(u64::MAX))], |row| {
        Ok((row.get(0)?, row.get(1)?))
    });
    let rows: Vec<(i64, Vec<u8>)> = rows.and_then(Iterator::collect).with_activity("reading the outbox")?;
    for (first, body) in rows {
        // One that cannot be read is passed over when it is to be sent, too.
        let Some(text) = unpack_lines(&body) else { continue };
        let moved: Vec<String> = text.lines().map(|text| line::shift_line(text, by_ns)).collect();
        let body = zstd::bulk::compress(moved.join("\n").as_bytes(), LEVEL)
            .map_err(|error| HistoryError::Io { path: "zstd".into(), error })?;
        db.prepare_cached(
            "UPDATE outbox SET start_ns = start_ns + ?2, end_ns = end_ns + ?2, body = ?3 WHERE first_sequence = ?1",
        )
        .and_then(|mut update| update.execute(params![first, by_ns, body]))
        .with_activity("dating the outbox anew")?;
    }
    Ok(from..sent_before(db)?.min(to.unwrap_or(u64::MAX)).max(from))
}

/// The number before which some sink may have delivered everything.
fn sent_before(db: &Connection) -> Result<u64, HistoryError> {
    let mut select = db.prepare("SELECT position FROM outbox_sinks").with_activity("reading the sinks")?;
    let texts: Vec<String> =
        select.query_map([], |row| row.get(0)).and_then(Iterator::collect).with_activity("reading the sinks")?;
    let next = texts.iter().filter_map(|text| serde_json::from_str(text).ok()).map(|it: Position| it.next());
    Ok(next.max().unwrap_or(0))
}
