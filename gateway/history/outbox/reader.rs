//! How a sink reads the outbox: on a connection of its own that only reads, a bounded piece at a time.

use super::epoch::Epochs;
use super::item::{Item, SeriesInfo};
use super::line::{self, SeriesByNumber};
use super::number::read_item_number;
use super::position::Position;
use super::store::has_tables;
use crate::HistoryError;
use crate::error::Doing;
use crate::schema::{known_series, open_for_reading};
use adapter_core::clock::TimeNs;
use gateway_base::convert::clamp_to_signed;
use rusqlite::{Connection, OptionalExtension};
use std::path::Path;
use std::sync::Arc;

/// A piece of the outbox.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OutboxStretch {
    /// What is there, in the order of the numbers. Numbers may be missing where items were dropped.
    pub items: Vec<Item>,
    /// The number after the last one that was looked at: acknowledge up to here.
    pub to: u64,
}

/// Reads the items of the outbox in the order of their numbers.
#[derive(Debug)]
pub struct OutboxReader {
    db: Connection,
    known: SeriesByNumber,
    epochs: Epochs,
}

/// A body that claims to be larger is damaged: a commit holds a minute at most.
const BODY_BYTES_MAX: usize = 256_000_000;

impl OutboxReader {
    /// Opens the history at `path`, which the gateway must have opened for writing before.
    ///
    /// # Errors
    /// As [`Reader::open`](crate::Reader::open).
    pub fn open(path: &Path) -> Result<Self, HistoryError> {
        let mut feed = Self { db: open_for_reading(path)?, known: SeriesByNumber::new(), epochs: Epochs::default() };
        feed.load_series()?;
        Ok(feed)
    }

    fn load_series(&mut self) -> Result<(), HistoryError> {
        let series = known_series(&self.db)?;
        self.known = series.iter().map(|series| (series.id, Arc::new(SeriesInfo::from(series)))).collect();
        Ok(())
    }

    /// Time of the oldest item that sink `name` has still to deliver; `None` where it has none, or the outbox does not know it.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn oldest_waiting_ns(&mut self, name: &str) -> Result<Option<TimeNs>, HistoryError> {
        if !has_tables(&self.db)? {
            return Ok(None);
        }
        let text: Option<String> = self
            .db
            .query_row("SELECT position FROM outbox_sinks WHERE name = ?1", [name], |row| row.get(0))
            .optional()
            .with_activity("reading what a sink has delivered")?;
        let Some(position) = text.and_then(|text| serde_json::from_str::<Position>(&text).ok()) else {
            return Ok(None);
        };
        let oldest = self.read(position.lowest_undelivered(), u64::MAX, 1)?;
        Ok(oldest.items.first().map(|item| item.at_ns))
    }

    /// Items `from..to`, at most `items_max` of them.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn read(&mut self, from: u64, to: u64, items_max: usize) -> Result<OutboxStretch, HistoryError> {
        let mut stretch = OutboxStretch { items: Vec::new(), to: from };
        // The writer may have begun a new one since.
        self.epochs = Epochs::load(&self.db)?;
        while stretch.to < to && stretch.items.len() < items_max {
            match self.row_at(stretch.to, to)? {
                Some(row) => self.append_items(&mut stretch, &row, to, items_max)?,
                None => stretch.to = to,
            }
        }
        debug_assert!(
            stretch.items.iter().all(|item| (from..stretch.to).contains(&item.sequence)),
            "only items that were asked for leave the outbox: what is beyond them would be acknowledged unsent"
        );
        Ok(stretch)
    }

    fn append_items(
        &mut self,
        stretch: &mut OutboxStretch,
        row: &OutboxRow,
        to: u64,
        items_max: usize,
    ) -> Result<(), HistoryError> {
        // A body that cannot be read is passed over: its items are lost, those after it are not.
        let text = unpack_lines(&row.body).unwrap_or_default();
        stretch.to = stretch.to.max(row.first);
        for (sequence, text) in (row.first..).zip(text.lines()) {
            if sequence < stretch.to {
                continue;
            }
            if sequence >= to || stretch.items.len() >= items_max {
                return Ok(());
            }
            stretch.to = sequence + 1;
            let Some(parsed) = line::parse(text) else { continue };
            if parsed.names_unknown(&self.known) {
                self.load_series()?;
            }
            stretch.items.push(parsed.into_item(sequence, self.epochs.epoch_of(sequence), &self.known));
        }
        stretch.to = stretch.to.max((row.first + row.items).min(to));
        Ok(())
    }

    /// The row that holds item `from`, or the next one below `to`.
    fn row_at(&self, from: u64, to: u64) -> Result<Option<OutboxRow>, HistoryError> {
        let [from, to] = [from, to].map(clamp_to_signed);
        let mut select = self
            .db
            .prepare_cached(
                "SELECT first_sequence, items, body FROM outbox
                 WHERE first_sequence >= coalesce((SELECT max(first_sequence) FROM outbox WHERE first_sequence <= ?1), ?1)
                   AND first_sequence + items > ?1 AND first_sequence < ?2
                 ORDER BY first_sequence LIMIT 1",
            )
            .with_activity("reading the outbox")?;
        let row = select.query_map([from, to], |row| {
            Ok(OutboxRow { first: read_item_number(row, 0)?, items: read_item_number(row, 1)?, body: row.get(2)? })
        });
        row.and_then(|mut rows| rows.next().transpose()).with_activity("reading the outbox")
    }
}

/// A row of the table `outbox`.
struct OutboxRow {
    first: u64,
    items: u64,
    body: Vec<u8>,
}

/// The lines of a row; `None` when they are not as they were written.
pub(super) fn unpack_lines(body: &[u8]) -> Option<String> {
    let bytes = zstd::stream::decode_all(body).ok().filter(|bytes| bytes.len() <= BODY_BYTES_MAX)?;
    String::from_utf8(bytes).ok()
}
