//! Opening a history again: the rows of the crash tail become a block, and a state nobody ended is ended.

use super::block::{Encoder, LEVEL_FRESH};
use super::commit::insert_block;
use super::damage::DamagedRows;
use super::error::{Doing, HistoryError};
use super::minute_buffer::End;
use super::reason::Reasons;
use super::record_sql::{close_state, store_record};
use super::rows::SeriesRows;
use super::{schema, tail};
use adapter_core::clock::TimeNs;
use gateway_records::{Event, Record};
use rusqlite::{Connection, OptionalExtension};

/// Brings the file into order and says where it ends. If the last rows came from `goes_on`, the state they ended in is
/// left open.
pub(crate) fn recover_file(db: &mut Connection, goes_on: Option<&str>) -> Result<End, HistoryError> {
    let repairing = db.transaction().with_activity("beginning to recover")?;
    let end = end_of_blocks(&repairing)?;
    let end = seal_tail(&repairing, end)?;
    let last_origin = last_origin(&repairing)?;
    if let Some(last_ns) = end.last_ns.filter(|_| goes_on.is_none() || goes_on != last_origin.as_deref()) {
        close_state(&repairing, last_ns, "stop").with_activity("ending the last state")?;
    }
    repairing.commit().with_activity("recovering")?;
    Ok(end)
}

fn end_of_blocks(db: &Connection) -> Result<End, HistoryError> {
    let last: Option<(i64, TimeNs)> = db
        .query_row("SELECT first_row + rows, end_ns FROM blocks ORDER BY first_row DESC LIMIT 1", [], |row| {
            Ok((row.get(0)?, row.get(1)?))
        })
        .optional()
        .with_activity("looking for the last block")?;
    let segment: Option<i64> = db
        .query_row("SELECT max(id) FROM segments", [], |row| row.get(0))
        .with_activity("looking for the last segment")?;
    Ok(End {
        segment: segment.unwrap_or(0),
        next_row: last.map_or(0, |(row, _)| row),
        last_ns: last.map(|(_, end_ns)| end_ns),
    })
}

/// Where the newest rows came from.
fn last_origin(db: &Connection) -> Result<Option<String>, HistoryError> {
    db.query_row("SELECT origin FROM segments ORDER BY id DESC LIMIT 1", [], |row| row.get(0))
        .optional()
        .with_activity("looking for the last segment")
}

/// One entry of the crash tail whose rows are in no block.
pub(crate) struct Unsealed {
    pub(crate) segment: i64,
    pub(crate) first_row: i64,
    pub(crate) rows: i64,
    pub(crate) start_ns: TimeNs,
    pub(crate) end_ns: TimeNs,
    pub(crate) body: String,
}

impl Unsealed {
    /// Its rows, when its text is none.
    pub(crate) fn to_damaged_rows(&self) -> DamagedRows {
        DamagedRows { first_row: self.first_row, rows: self.rows, span_ns: Some((self.start_ns, self.end_ns)) }
    }
}

/// The entries of the crash tail from row `from_row` on, in order.
pub(crate) fn read_unsealed(db: &Connection, from_row: i64) -> Result<Vec<Unsealed>, HistoryError> {
    let mut statement = db
        .prepare_cached(
            "SELECT segment, first_row, rows, start_ns, end_ns, body FROM tail WHERE first_row >= ?1 ORDER BY first_row",
        )
        .with_activity("reading the crash tail")?;
    let entries = statement.query_map([from_row], |row| {
        Ok(Unsealed {
            segment: row.get(0)?,
            first_row: row.get(1)?,
            rows: row.get(2)?,
            start_ns: row.get(3)?,
            end_ns: row.get(4)?,
            body: row.get(5)?,
        })
    });
    entries.and_then(Iterator::collect).with_activity("reading the crash tail")
}

fn seal_tail(db: &Connection, mut end: End) -> Result<End, HistoryError> {
    let mut series = schema::known_series(db)?;
    // The tail holds what is to be kept already.
    series.iter_mut().for_each(|series| series.decimals = None);
    let mut encoder = Encoder::new(LEVEL_FRESH).map_err(|error| HistoryError::Io { path: "zstd".into(), error })?;
    let entries = read_unsealed(db, end.next_row)?;
    // A commit only ever holds rows of one minute and one segment in the tail, so one block takes them all.
    for group in entries.chunk_by(|a, b| a.segment == b.segment && b.first_row == a.first_row + a.rows) {
        let (mut rows, mut reasons) = (SeriesRows::for_series(&series), Reasons::default());
        let whole =
            group.iter().all(|entry| tail::parse_rows_into(&entry.body, &mut rows, &series, &mut reasons).is_some());
        if !whole {
            note_damage(db, &group[0])?;
        }
        if rows.is_empty() {
            continue;
        }
        let block = encoder.encode_block(&rows, &series, &reasons, group[0].segment, group[0].first_row);
        insert_block(db, &block)?;
        end.next_row = block.key.first_row + block.key.rows;
        end.last_ns = Some(block.key.end_ns);
    }
    Ok(end)
}

/// The machine must be watched again even if a second of the past is unreadable.
fn note_damage(db: &Connection, entry: &Unsealed) -> Result<(), HistoryError> {
    let event = Event {
        at_ns: entry.start_ns,
        kind: "history_damaged".to_owned(),
        source: "history".to_owned(),
        text: "Part of the last minute before the gateway stopped is unreadable and was left out.".to_owned(),
        detail: format!("{{\"first_row\":{},\"rows\":{}}}", entry.first_row, entry.rows),
    };
    store_record(db, &Record::Event(event)).with_activity("noting damage")
}
