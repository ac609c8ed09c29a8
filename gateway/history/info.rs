//! What a history holds, how fast it grows, and how long the disk lasts at that rate.

use super::error::{Doing, HistoryError};
use super::options::DAY_NS;
use super::readable_time::format_utc;
use super::reader::Reader;
use super::retention::used_bytes;
use super::space::disk_room;
use adapter_core::clock::TimeNs;
use serde::Serialize;
use std::fmt;

/// The rate is taken from the last week that was recorded.
const RATE_OVER_NS: i64 = 7 * DAY_NS;

/// Rows of one table.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct TableRows {
    /// Name of the table in the database.
    pub table: &'static str,
    /// Number of rows in it.
    pub rows: i64,
}

/// What retention or a full disk has taken.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Dropped {
    /// Raw samples, minute summaries, ...
    pub kind: String,
    /// How many rows were removed.
    pub rows: i64,
    /// Time of the newest of them.
    pub through_ns: TimeNs,
    /// `age`, `the size limit`, `the disk is full`.
    pub because: String,
}

/// The figures of a history. Sizes in bytes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Info {
    /// Path of the database file.
    pub path: String,
    /// Time of the first row.
    pub first_ns: Option<TimeNs>,
    /// Time of the last row.
    pub last_ns: Option<TimeNs>,
    /// Number of rows of samples.
    pub samples: i64,
    /// Stretches of increasing time: starts of the gateway and steps of the clock.
    pub segments: i64,
    /// Size of the database file.
    pub file_bytes: u64,
    /// Pages in use in it.
    pub used_bytes: u64,
    /// Bytes of compressed samples.
    pub sample_bytes: i64,
    /// Bytes of compressed samples per row.
    pub bytes_per_sample: Option<f64>,
    /// Growth over the last recorded week, everything included.
    pub bytes_per_day: Option<f64>,
    /// Free on the disk.
    pub disk_free_bytes: Option<u64>,
    /// The size limit the gateway keeps.
    pub max_bytes: Option<i64>,
    /// At this rate the disk lasts so many days.
    pub disk_lasts_days: Option<f64>,
    /// At this rate the size limit is reached in so many days; then the oldest raw samples go.
    pub limit_reached_days: Option<f64>,
    /// Rows of the other tables.
    pub tables: Vec<TableRows>,
    /// What has been removed.
    pub dropped: Vec<Dropped>,
}

/// A rate of growth is told after ten minutes.
const RATE_AFTER_DAYS: f64 = 600.0 / 86_400.0;

static TABLES: [&str; 11] =
    ["states", "parts", "events", "alarms", "decisions", "commands", "models", "diagnoses", "minutes", "hours", "days"];

impl Reader {
    /// What this history holds and how fast it grows.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn read_info(&self) -> Result<Info, HistoryError> {
        let span = self.read_span()?;
        let used_bytes = used_bytes(&self.db)?;
        let (samples, sample_bytes): (i64, i64) = self
            .db
            .query_row(
                "SELECT coalesce(sum(rows), 0), coalesce(sum(length(directory) + length(columns)), 0) FROM blocks",
                [],
                |row| Ok((row.get(0)?, row.get(1)?)),
            )
            .with_activity("counting samples")?;
        let bytes_per_day = self.bytes_per_day(used_bytes, sample_bytes)?;
        let room = disk_room(&self.path).map(|room| room.free);
        let max_bytes = self.read_number("SELECT value FROM meta WHERE key = 'max_bytes'")?;
        let left = max_bytes.map(|max| max.unsigned_abs().saturating_sub(used_bytes));
        let days = |bytes: Option<u64>| bytes.zip(bytes_per_day).map(|(bytes, rate)| bytes as f64 / rate);
        Ok(Info {
            path: self.path.display().to_string(),
            first_ns: span.map(|(first_ns, _)| first_ns),
            last_ns: span.map(|(_, last_ns)| last_ns),
            samples: samples + self.read_number(UNSEALED)?.unwrap_or(0),
            segments: self.read_number("SELECT count(*) FROM segments")?.unwrap_or(0),
            file_bytes: std::fs::metadata(&self.path).map_or(0, |file| file.len()),
            used_bytes,
            sample_bytes,
            bytes_per_sample: (samples > 0).then(|| sample_bytes as f64 / samples as f64),
            bytes_per_day,
            disk_free_bytes: room,
            max_bytes,
            disk_lasts_days: days(room),
            limit_reached_days: days(left),
            tables: self.count_table_rows()?,
            dropped: self.read_dropped()?,
        })
    }

    /// The sample bytes of the last recorded week per day, times what everything else adds to them.
    fn bytes_per_day(&self, used_bytes: u64, sample_bytes: i64) -> Result<Option<f64>, HistoryError> {
        let week: (Option<i64>, Option<TimeNs>, Option<TimeNs>) = self
            .db
            .query_row(
                "SELECT sum(length(directory) + length(columns)), min(start_ns), max(end_ns) FROM blocks
                 WHERE start_ns > (SELECT max(start_ns) FROM blocks) - ?1",
                [RATE_OVER_NS],
                |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)),
            )
            .with_activity("measuring the growth")?;
        let (Some(bytes), Some(first_ns), Some(last_ns)) = week else { return Ok(None) };
        let days = (last_ns - first_ns) as f64 / DAY_NS as f64;
        let all_to_samples = used_bytes as f64 / (sample_bytes as f64).max(1.0);
        // The first minutes hold mostly what is there only once.
        Ok((days >= RATE_AFTER_DAYS).then(|| bytes as f64 / days * all_to_samples))
    }

    fn read_number(&self, select: &str) -> Result<Option<i64>, HistoryError> {
        use rusqlite::OptionalExtension;
        let number = self.db.query_row(select, [], |row| row.get::<_, Option<i64>>(0)).optional();
        Ok(number.with_activity("counting rows")?.flatten())
    }

    fn count_table_rows(&self) -> Result<Vec<TableRows>, HistoryError> {
        let count = |table| Ok(self.read_number(&format!("SELECT count(*) FROM {table}"))?.unwrap_or(0));
        TABLES.iter().map(|table| Ok(TableRows { table, rows: count(table)? })).collect()
    }

    fn read_dropped(&self) -> Result<Vec<Dropped>, HistoryError> {
        let mut statement = self
            .db
            .prepare("SELECT kind, rows, through_ns, because FROM dropped ORDER BY kind")
            .with_activity("reading what was removed")?;
        let rows = statement.query_map([], |row| {
            Ok(Dropped { kind: row.get(0)?, rows: row.get(1)?, through_ns: row.get(2)?, because: row.get(3)? })
        });
        rows.and_then(Iterator::collect).with_activity("reading what was removed")
    }
}

const UNSEALED: &str = "SELECT sum(rows) FROM tail
    WHERE first_row >= coalesce((SELECT first_row + rows FROM blocks ORDER BY first_row DESC LIMIT 1), 0)";

fn format_bytes(bytes: f64) -> String {
    if bytes < 1e9 { format!("{:.1} MB", bytes / 1e6) } else { format!("{:.2} GB", bytes / 1e9) }
}

impl fmt::Display for Info {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.path)?;
        match (self.first_ns, self.last_ns) {
            (Some(first_ns), Some(last_ns)) => writeln!(
                f,
                "{} samples from {} to {}, {} segment(s)",
                self.samples,
                format_utc(first_ns),
                format_utc(last_ns),
                self.segments
            )?,
            _ => writeln!(f, "no samples yet")?,
        }
        write!(f, "{} in use", format_bytes(self.used_bytes as f64))?;
        if let Some(bytes) = self.bytes_per_sample {
            write!(f, ", {bytes:.1} bytes per sample")?;
        }
        writeln!(f)?;
        if let (Some(rate), Some(days)) = (self.bytes_per_day, self.disk_lasts_days) {
            writeln!(f, "grows by {} a day; at this rate the disk lasts {days:.0} days", format_bytes(rate))?;
        }
        if let (Some(max), Some(days)) = (self.max_bytes, self.limit_reached_days) {
            let max = format_bytes(max as f64);
            writeln!(f, "the limit of {max} is reached in {days:.0} days; then the oldest raw samples go first")?;
        }
        if self.bytes_per_day.is_none() && self.samples > 0 {
            writeln!(f, "how long the disk lasts can be told after ten minutes of samples")?;
        }
        for TableRows { table, rows } in self.tables.iter().filter(|table| table.rows > 0) {
            writeln!(f, "{table}: {rows}")?;
        }
        for dropped in &self.dropped {
            let (rows, kind, through) = (dropped.rows, &dropped.kind, format_utc(dropped.through_ns));
            writeln!(f, "removed: {rows} {kind} up to {through} ({})", dropped.because)?;
        }
        Ok(())
    }
}
