//! How a sink reads the outbox: on a connection of its own that only reads, a bounded piece at a time.

use super::item::{Item, SeriesInfo};
use super::line::{self, Known};
use crate::history::HistoryError;
use crate::history::error::Doing;
use crate::history::schema::{known_series, open_for_reading};
use rusqlite::Connection;
use std::path::Path;
use std::sync::Arc;

/// A piece of the outbox.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Stretch {
    /// What is there, in the order of the numbers. Numbers may be missing where items were dropped.
    pub items: Vec<Item>,
    /// The number after the last one that was looked at: acknowledge up to here.
    pub to: u64,
}

/// Reads items.
#[derive(Debug)]
pub struct Feed {
    db: Connection,
    known: Known,
}

/// A body that claims to be larger is damaged: a commit holds a minute at most.
const BODY_BYTES_MAX: usize = 256_000_000;

impl Feed {
    /// Opens the history at `path`, which the gateway must have opened for writing before.
    ///
    /// # Errors
    /// As [`Reader::open`](crate::history::Reader::open).
    pub fn open(path: &Path) -> Result<Self, HistoryError> {
        let mut feed = Self { db: open_for_reading(path)?, known: Known::new() };
        feed.learn()?;
        Ok(feed)
    }

    fn learn(&mut self) -> Result<(), HistoryError> {
        let series = known_series(&self.db)?;
        self.known = series.iter().map(|series| (series.id, Arc::new(SeriesInfo::from(series)))).collect();
        Ok(())
    }

    /// Items `from..to`, at most `items_max` of them.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn read(&mut self, from: u64, to: u64, items_max: usize) -> Result<Stretch, HistoryError> {
        let mut stretch = Stretch { items: Vec::new(), to: from };
        while stretch.to < to && stretch.items.len() < items_max {
            let Some((first, body)) = self.row_at(stretch.to, to)? else {
                stretch.to = to;
                break;
            };
            let text = unpacked(&body).unwrap_or_default();
            let lines: Vec<&str> = text.lines().collect();
            if lines.iter().any(|line| line::names_unknown(line, &self.known)) {
                self.learn()?;
            }
            let end = first + lines.len().max(1) as u64;
            stretch.to = stretch.to.max(first);
            for (sequence, text) in (first..).zip(lines) {
                if sequence < stretch.to || sequence >= to || stretch.items.len() >= items_max {
                    continue;
                }
                stretch.items.extend(line::item(sequence, text, &self.known));
                stretch.to = sequence + 1;
            }
            if stretch.items.len() < items_max {
                stretch.to = end.min(to);
            }
        }
        Ok(stretch)
    }

    /// The row that holds item `from`, or the next one below `to`.
    fn row_at(&self, from: u64, to: u64) -> Result<Option<(u64, Vec<u8>)>, HistoryError> {
        let [from, to] = [from, to].map(|number| i64::try_from(number).unwrap_or(i64::MAX));
        let mut select = self
            .db
            .prepare_cached(
                "SELECT first_sequence, body FROM outbox
                 WHERE first_sequence >= coalesce((SELECT max(first_sequence) FROM outbox WHERE first_sequence <= ?1), ?1)
                   AND first_sequence + items > ?1 AND first_sequence < ?2
                 ORDER BY first_sequence LIMIT 1",
            )
            .doing("reading the outbox")?;
        let row = select.query_map([from, to], |row| Ok((row.get::<_, i64>(0)?, row.get(1)?)));
        let found = row.and_then(|mut rows| rows.next().transpose()).doing("reading the outbox")?;
        Ok(found.map(|(first, body)| (u64::try_from(first).unwrap_or(0), body)))
    }
}

fn unpacked(body: &[u8]) -> Option<String> {
    let bytes = zstd::stream::decode_all(body).ok().filter(|bytes| bytes.len() <= BODY_BYTES_MAX)?;
    String::from_utf8(bytes).ok()
}
