//! The tables of the outbox: one row for the items of a commit, one for each sink.

use super::epoch;
use super::handle::{DeliveryState, Outbox, OutboxFigures};
use super::number::{read_item_number, to_stored_number};
use super::position::Position;
use super::property::read_property;
use crate::HistoryError;
use crate::error::Doing;
use crate::schema::{open_for_reading, open_for_writing};
use crate::tables::has_table;
use adapter_core::clock::{SECOND_NS, TimeNs};
use gateway_base::convert::{clamp_to_signed, clamp_to_unsigned, saturate_to_ns};
use rusqlite::{Connection, OptionalExtension, TransactionBehavior, params};
use std::borrow::Cow;
use std::path::Path;

/// Made when the first sink is configured; a box without one has a file without these.
const TABLES: &str = "
CREATE TABLE IF NOT EXISTS outbox (
  first_sequence INTEGER PRIMARY KEY,
  items INTEGER NOT NULL,
  start_ns INTEGER NOT NULL, end_ns INTEGER NOT NULL,
  bytes INTEGER NOT NULL,
  body BLOB NOT NULL              -- one line of JSON per item, zstd
);
CREATE TABLE IF NOT EXISTS outbox_sinks (
  name TEXT PRIMARY KEY,
  position TEXT NOT NULL,         -- JSON: what it has not delivered, as gaps and the number from which on nothing is
  dropped INTEGER NOT NULL,       -- items that were dropped before it had delivered them
  connections INTEGER NOT NULL DEFAULT 0  -- connections that were begun
) WITHOUT ROWID;";

/// zstd level: higher ones gain little on bodies of a kilobyte.
pub(super) const LEVEL: i32 = 3;
/// Rows beyond the bounds that are removed in one commit, so that a commit stays short; one commit adds one row.
const ROWS_REMOVED_MAX: usize = 64;
/// Delivered rows that are removed at a time, about two megabytes. A sink that makes up for an outage delivers up to some
/// thousand rows a second: with fewer at a time the file would stay full for hours after it.
const DELIVERED_REMOVED_MAX: i64 = 8192;
/// What a row costs beside its body, bytes.
const ROW_BYTES: u64 = 40;

/// What lies in the table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OutboxContents {
    pub(super) next_sequence: u64,
    pub(super) bytes: u64,
    pub(super) oldest_ns: Option<TimeNs>,
    pub(super) newest_ns: Option<TimeNs>,
    /// Since opening: bytes added, and over how much time of the items.
    pub(super) added_bytes: u64,
    pub(super) first_ns: Option<TimeNs>,
}

impl OutboxContents {
    pub(super) fn to_figures(self, lost: u64) -> OutboxFigures {
        let seconds =
            self.newest_ns.zip(self.first_ns).map(|(newest, first)| (newest - first) as f64 / SECOND_NS as f64);
        let rate = seconds.filter(|seconds| *seconds >= 60.0).map(|seconds| self.added_bytes as f64 / seconds);
        OutboxFigures { bytes: self.bytes, bytes_per_s: rate, oldest_ns: self.oldest_ns, lost }
    }
}

/// Creates the tables, takes up what each sink still has to deliver, and forgets sinks that are configured no more.
pub(super) fn open_outbox(db: &mut Connection, outbox: &Outbox) -> Result<OutboxContents, HistoryError> {
    let opening = db.transaction().with_activity("opening the outbox")?;
    opening.execute_batch(TABLES).with_activity("creating the outbox")?;
    if opening.prepare("SELECT connections FROM outbox_sinks").is_err() {
        opening
            .execute_batch("ALTER TABLE outbox_sinks ADD COLUMN connections INTEGER NOT NULL DEFAULT 0")
            .with_activity("extending the outbox")?;
    }
    let name = box_name(&opening, outbox.machine())?;
    let next = next_sequence(&opening)?;
    outbox.set_identity(name, epoch::begin_epoch(&opening, epoch::oldest_number(&opening, next)?, next)?);
    outbox.for_each_sink(|name, standing| load_delivery_state(&opening, name, next, standing))?;
    let names = outbox.sink_names();
    let mut statement = opening.prepare("SELECT name FROM outbox_sinks").with_activity("reading the sinks")?;
    let known: Vec<String> =
        statement.query_map([], |row| row.get(0)).and_then(Iterator::collect).with_activity("reading the sinks")?;
    drop(statement);
    for gone in known.iter().filter(|name| !names.contains(name)) {
        opening.execute("DELETE FROM outbox_sinks WHERE name = ?1", [gone]).with_activity("forgetting a sink")?;
    }
    let stored = measure_outbox(&opening, next)?;
    opening.commit().with_activity("opening the outbox")?;
    Ok(stored)
}

fn measure_outbox(db: &Connection, next_sequence: u64) -> Result<OutboxContents, HistoryError> {
    // The newest is the last that was stored: an earlier one may be dated by a clock that was ahead.
    let newest = "SELECT end_ns FROM outbox ORDER BY first_sequence DESC LIMIT 1";
    let select = format!("SELECT coalesce(sum(bytes), 0), min(start_ns), ({newest}) FROM outbox");
    db.query_row(&select, [], |row| {
        Ok(OutboxContents {
            next_sequence,
            bytes: clamp_to_unsigned(row.get(0)?),
            oldest_ns: row.get(1)?,
            newest_ns: row.get(2)?,
            added_bytes: 0,
            first_ns: None,
        })
    })
    .with_activity("measuring the outbox")
}

/// From which number on the numbering goes, in `meta`, where an older version of the program has left numbers out.
const NUMBERS_FROM: &str = "outbox_numbers_from";

/// The newest row is never removed: the numbering goes on from it.
fn next_sequence(db: &Connection) -> Result<u64, HistoryError> {
    let stored: u64 = db
        .query_row("SELECT coalesce(max(first_sequence + items), 1) FROM outbox", [], |row| read_item_number(row, 0))
        .with_activity("numbering the outbox")?;
    let from = read_property(db, NUMBERS_FROM)?.and_then(|text| text.parse().ok()).unwrap_or(1);
    // A number 0 would name no item.
    Ok(stored.max(from).max(1))
}

/// The number of the next item; 0 where there is no outbox.
pub(crate) fn next_sequence_of(db: &Connection) -> Result<u64, HistoryError> {
    if has_tables(db)? { next_sequence(db) } else { Ok(0) }
}

/// Creates the tables in `to` where `from` has them.
pub(crate) fn create_like(from: &Connection, to: &Connection) -> Result<(), HistoryError> {
    if has_tables(from)? { to.execute_batch(TABLES).with_activity("creating the outbox") } else { Ok(()) }
}

/// Does the file have the tables?
pub(super) fn has_tables(db: &Connection) -> Result<bool, HistoryError> {
    has_table(db, "outbox_sinks").with_activity("looking for the outbox")
}

/// The name of this box, made once: a machine that is renamed stays the same box. The digits tell boxes apart whose machines
/// have the same letters, or none that an address may hold.
fn box_name(db: &Connection, machine: &str) -> Result<String, HistoryError> {
    if let Some(name) = known_box_id(db)? {
        return Ok(name);
    }
    // Histories of before had six digits, and the name of the machine as it was at each start.
    let mark = read_property(db, "outbox_box")?
        .unwrap_or_else(|| adapter_core::unique_id::generate_unique_id()[..10].to_owned());
    let name = format!("{}-{mark}", letters_of(machine));
    db.execute("INSERT INTO meta (key, value) VALUES ('outbox_box_id', ?1)", [&name])
        .with_activity("naming the outbox")?;
    Ok(name)
}

/// The name of the box that keeps the history at `path`; made now where it has none. `machine` is the name of the machine.
///
/// # Errors
/// The file cannot be read, or a name cannot be written into it.
pub fn box_id(path: &Path, machine: &str) -> Result<String, HistoryError> {
    if path.is_file() {
        if let Some(name) = known_box_id(&open_for_reading(path)?)? {
            return Ok(name);
        }
    } else if let Some(parent) = path.parent().filter(|parent| !parent.as_os_str().is_empty()) {
        std::fs::create_dir_all(parent).map_err(|error| HistoryError::Io { path: parent.to_owned(), error })?;
    }
    let mut db = open_for_writing(path)?;
    let naming = db.transaction_with_behavior(TransactionBehavior::Immediate).with_activity("naming the outbox")?;
    let name = box_name(&naming, machine)?;
    naming.commit().with_activity("naming the outbox")?;
    Ok(name)
}

/// The name of the box of an open history, where it has one.
pub(crate) fn known_box_id(db: &Connection) -> Result<Option<String>, HistoryError> {
    read_property(db, "outbox_box_id")
}

/// Letters, digits and `-` of a machine's name, `box` where there are none.
fn letters_of(machine: &str) -> String {
    let plain = |letter: char| if letter.is_ascii_alphanumeric() { letter } else { '-' };
    let name: String = machine.chars().map(plain).collect();
    let name = name.split('-').filter(|part| !part.is_empty()).collect::<Vec<_>>().join("-");
    if name.is_empty() { "box".to_owned() } else { name }
}

/// A sink that is new begins with what is made from now on.
fn load_delivery_state(
    db: &Connection,
    name: &str,
    next: u64,
    standing: &mut DeliveryState,
) -> Result<(), HistoryError> {
    let found: Option<(String, i64, i64)> = db
        .query_row("SELECT position, dropped, connections FROM outbox_sinks WHERE name = ?1", [name], |row| {
            Ok((row.get(0)?, row.get(1)?, row.get(2)?))
        })
        .optional()
        .with_activity("reading what a sink has delivered")?;
    match found {
        Some((text, dropped, connections)) => {
            // A text that this version cannot read begins anew rather than sending everything twice.
            standing.position = serde_json::from_str(&text).unwrap_or(Position::from_next(next));
            standing.dropped = clamp_to_unsigned(dropped);
            standing.connections = clamp_to_unsigned(connections);
        }
        None => {
            *standing = DeliveryState { linked: standing.linked, ..DeliveryState::from_next(next) };
            save_delivery_state(db, name, standing)?;
        }
    }
    Ok(())
}

fn save_delivery_state(db: &Connection, name: &str, standing: &DeliveryState) -> Result<(), HistoryError> {
    let position = serde_json::to_string(&standing.position).unwrap_or_default();
    db.prepare_cached(
        "INSERT OR REPLACE INTO outbox_sinks (name, position, dropped, connections) VALUES (?1, ?2, ?3, ?4)",
    )
    .and_then(|mut save| {
        save.execute(params![name, position, clamp_to_signed(standing.dropped), clamp_to_signed(standing.connections)])
    })
    .map(drop)
    .with_activity("noting what a sink has delivered")
}

/// What a transaction did to the outbox.
pub(super) struct Put {
    pub(super) contents: OutboxContents,
    /// Stretches of numbers that were dropped before they were delivered everywhere.
    pub(super) dropped: Vec<(u64, u64)>,
}

/// Adds these lines and removes what is beyond the bounds, `ages` by its age too; `tidy`, it removes what is delivered too, and notes what each
/// sink has delivered.
pub(super) fn store_lines(
    db: &Connection,
    outbox: &Outbox,
    before: &OutboxContents,
    lines: &[(TimeNs, Cow<'_, str>)],
    (tidy, ages): (bool, bool),
) -> Result<Put, HistoryError> {
    debug_assert!(before.next_sequence >= 1, "items are numbered from 1: 0 names none");
    let mut stored = *before;
    if !lines.is_empty() {
        add(db, &mut stored, lines)?;
    }
    let dropped = remove(db, outbox, &mut stored, (tidy, ages))?;
    if tidy || !dropped.is_empty() {
        note_deliveries(db, outbox, &dropped)?;
    }
    Ok(Put { contents: stored, dropped })
}

/// Notes what each sink has delivered, as if these stretches had been dropped already.
pub(super) fn note_deliveries(db: &Connection, outbox: &Outbox, dropped: &[(u64, u64)]) -> Result<(), HistoryError> {
    outbox.for_each_sink(|name, standing| {
        let mut after = standing.clone();
        for (from, to) in dropped {
            after.dropped += after.position.count_within(*from, *to);
            after.position.mark_delivered(*from, *to);
        }
        save_delivery_state(db, name, &after)
    })
}

fn add(db: &Connection, stored: &mut OutboxContents, lines: &[(TimeNs, Cow<'_, str>)]) -> Result<(), HistoryError> {
    let times = || lines.iter().map(|(at_ns, _)| *at_ns);
    let (Some(start_ns), Some(end_ns)) = (times().min(), times().max()) else { return Ok(()) };
    let text = lines.iter().map(|(_, line)| &**line).collect::<Vec<_>>().join("\n");
    let body = zstd::bulk::compress(text.as_bytes(), LEVEL)
        .map_err(|error| HistoryError::Io { path: "zstd".into(), error })?;
    let bytes = body.len() as u64 + ROW_BYTES;
    db.prepare_cached(
        "INSERT INTO outbox (first_sequence, items, start_ns, end_ns, bytes, body) VALUES (?1, ?2, ?3, ?4, ?5, ?6)",
    )
    .and_then(|mut insert| {
        debug_assert!(stored.next_sequence > 0, "a number 0 would name no item");
        let first = to_stored_number(stored.next_sequence)?;
        insert.execute(params![first, lines.len() as i64, start_ns, end_ns, clamp_to_signed(bytes), body])
    })
    .with_activity("storing the outbox")?;
    stored.next_sequence += lines.len() as u64;
    stored.bytes += bytes;
    stored.added_bytes += bytes;
    // The beginning of an hour or a day is no time at which something was added.
    stored.first_ns.get_or_insert(end_ns);
    stored.oldest_ns.get_or_insert(end_ns);
    stored.newest_ns = Some(end_ns);
    Ok(())
}

/// If `tidy`, removes what is delivered; then the oldest rows as long as they are too old or too much. Gives the stretches
/// that were not delivered everywhere.
fn remove(
    db: &Connection,
    outbox: &Outbox,
    stored: &mut OutboxContents,
    (tidy, ages): (bool, bool),
) -> Result<Vec<(u64, u64)>, HistoryError> {
    let (settings, lowest) = (outbox.settings(), outbox.lowest_undelivered().min(stored.next_sequence));
    let max_age_ns = saturate_to_ns(settings.max_age);
    let horizon_ns =
        stored.newest_ns.filter(|_| ages).map_or(i64::MIN, |newest_ns| newest_ns.saturating_sub(max_age_ns));
    if tidy {
        remove_delivered(db, lowest, stored)?;
    }
    let mut dropped = Vec::new();
    for _ in 0..ROWS_REMOVED_MAX {
        let Some((first, items, end_ns, bytes)) = find_oldest_row(db)? else {
            stored.oldest_ns = None;
            break;
        };
        let end = first + items;
        let delivered = end <= lowest;
        let due = end_ns < horizon_ns || stored.bytes > settings.max_bytes;
        if !due || end == stored.next_sequence {
            stored.oldest_ns = Some(end_ns);
            break;
        }
        db.prepare_cached("DELETE FROM outbox WHERE first_sequence = ?1")
            .and_then(|mut delete| delete.execute([to_stored_number(first)?]))
            .with_activity("shortening the outbox")?;
        stored.bytes = stored.bytes.saturating_sub(bytes);
        if !delivered {
            dropped.push((first, end));
        }
    }
    Ok(dropped)
}

/// Removes the oldest rows whose items are all below `lowest`, but never the newest row.
fn remove_delivered(db: &Connection, lowest: u64, stored: &mut OutboxContents) -> Result<(), HistoryError> {
    let end = clamp_to_signed(lowest.min(stored.next_sequence.saturating_sub(1)));
    let (last, bytes): (Option<i64>, i64) = db
        .prepare_cached(
            "SELECT max(first_sequence), coalesce(sum(bytes), 0) FROM (
               SELECT first_sequence, bytes FROM outbox
               WHERE first_sequence < ?1 AND first_sequence + items <= ?1 ORDER BY first_sequence LIMIT ?2)",
        )
        .and_then(|mut select| select.query_row([end, DELIVERED_REMOVED_MAX], |row| Ok((row.get(0)?, row.get(1)?))))
        .with_activity("looking for what is delivered")?;
    let Some(last) = last else { return Ok(()) };
    db.prepare_cached("DELETE FROM outbox WHERE first_sequence <= ?1")
        .and_then(|mut delete| delete.execute([last]))
        .with_activity("shortening the outbox")?;
    stored.bytes = stored.bytes.saturating_sub(clamp_to_unsigned(bytes));
    Ok(())
}

/// First number, items, time of the newest, bytes.
fn find_oldest_row(db: &Connection) -> Result<Option<(u64, u64, TimeNs, u64)>, HistoryError> {
    db.prepare_cached("SELECT first_sequence, items, end_ns, bytes FROM outbox ORDER BY first_sequence LIMIT 1")
        .and_then(|mut select| {
            let row = |row: &rusqlite::Row<'_>| {
                Ok((read_item_number(row, 0)?, read_item_number(row, 1)?, row.get(2)?, clamp_to_unsigned(row.get(3)?)))
            };
            select.query_row([], row).optional()
        })
        .with_activity("looking for the oldest of the outbox")
}
