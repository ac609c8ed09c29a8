//! Items while the clock turns out to have been wrong: those that wait are sent with the right time, and receivers of those that were sent
//! are told by how much each moves ([`ItemMove`]).

use super::epoch::Epochs;
use super::line;
use super::means_again;
use super::position::Position;
use super::reader::unpack_lines;
use super::store::{LEVEL, has_tables, next_sequence_of};
use crate::HistoryError;
use crate::error::Doing;
use adapter_core::clock::TimeNs;
use gateway_base::convert::clamp_to_signed;
use rusqlite::{Connection, params};
use serde::Serialize;
use std::ops::Range;

/// Items whose time moves: those of an epoch with these numbers. What an item says of itself as `redated_ns` is contained.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ItemMove {
    /// The epoch of the items.
    pub epoch: u64,
    /// The first of them.
    pub from_sequence: u64,
    /// The number after the last one.
    pub to_sequence: u64,
    /// By how much they are later now, ns.
    pub by_ns: i64,
    /// Time of the first sample before the move; `None` where there are no samples.
    pub from_ns: Option<TimeNs>,
    /// Time of the last sample before the move.
    pub to_ns: Option<TimeNs>,
}

/// What was done with the items of a segment.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct RedatedItems {
    /// Numbers of those that some sink had delivered before under their old date.
    pub(crate) sent_range: Range<u64>,
    /// What receivers have to know.
    pub(crate) moves: Vec<ItemMove>,
}

/// Moves the items from number `from` on (to before `to`) by so much, whose samples are the rows of these numbers, which have moved
/// already.
pub(crate) fn redate_items(
    db: &Connection,
    (from, to): (u64, Option<u64>),
    rows: &Range<i64>,
    by_ns: i64,
) -> Result<RedatedItems, HistoryError> {
    if from == 0 || !has_tables(db)? {
        return Ok(RedatedItems::default());
    }
    move_waiting(db, from, to, by_ns)?;
    let end = to.map_or_else(|| next_sequence_of(db), Ok)?;
    let after = span_of_rows(db, rows)?;
    let before = after.as_ref().map(|after| after.start.saturating_sub(by_ns)..after.end.saturating_sub(by_ns));
    if let (Some(after), Some(before)) = (&after, &before) {
        means_again::note_stretches(db, &[before.clone(), after.clone()])?;
    }
    let in_time = |it: super::epoch::EpochStretch| ItemMove {
        epoch: it.epoch,
        from_sequence: it.from,
        to_sequence: it.to,
        by_ns,
        from_ns: before.as_ref().map(|before| before.start),
        to_ns: before.as_ref().map(|before| before.end),
    };
    let moves = Epochs::load(db)?.divide(from, end).into_iter().map(in_time).collect();
    Ok(RedatedItems { sent_range: from..sent_before(db)?.min(end).max(from), moves })
}

fn move_waiting(db: &Connection, from: u64, to: Option<u64>, by_ns: i64) -> Result<(), HistoryError> {
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
    Ok(())
}

/// First and last time of the samples of these rows.
fn span_of_rows(db: &Connection, rows: &Range<i64>) -> Result<Option<Range<TimeNs>>, HistoryError> {
    let select = "SELECT min(start_ns), max(end_ns) FROM blocks WHERE first_row >= ?1 AND first_row < ?2";
    let found: (Option<TimeNs>, Option<TimeNs>) = db
        .query_row(select, [rows.start, rows.end], |row| Ok((row.get(0)?, row.get(1)?)))
        .with_activity("looking for rows to date anew")?;
    Ok(found.0.zip(found.1).map(|(start, end)| start..end))
}

/// The number before which some sink may have delivered everything.
fn sent_before(db: &Connection) -> Result<u64, HistoryError> {
    let mut select = db.prepare("SELECT position FROM outbox_sinks").with_activity("reading the sinks")?;
    let texts: Vec<String> =
        select.query_map([], |row| row.get(0)).and_then(Iterator::collect).with_activity("reading the sinks")?;
    let next = texts.iter().filter_map(|text| serde_json::from_str(text).ok()).map(|it: Position| it.next());
    Ok(next.max().unwrap_or(0))
}
