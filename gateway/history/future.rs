//! Rows that say they come from the future: a clock that was wrong, and believed, when they were stored.

use super::error::{Doing, HistoryError};
use super::readable_time::format_utc;
use super::schema;
use adapter_core::clock::{SECOND_NS, TimeNs};
use rusqlite::{Connection, params};
use serde::Serialize;
use std::fmt;

/// So much after now is no future: clocks of two computers differ, and a file is copied from one to the other.
pub(crate) const AHEAD_NS: i64 = 60 * SECOND_NS;

/// Rows from the future.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct FutureRows {
    /// Number of samples with a time after now.
    pub samples: i64,
    /// The first of them.
    pub first_ns: TimeNs,
    /// The last of them.
    pub last_ns: TimeNs,
}

/// Rows that the machine brought its own time for are never from the future.
fn of_wall(db: &Connection) -> Result<&'static str, HistoryError> {
    let has = schema::has_clocks(db)?;
    Ok(if has { "segment NOT IN (SELECT id FROM segments WHERE clock = 'stepped')" } else { "1" })
}

impl FutureRows {
    pub(crate) fn find_after(db: &Connection, now_ns: TimeNs) -> Result<Option<Self>, HistoryError> {
        let sum = |table: &str, of_wall: &str| {
            format!(
                "SELECT sum(rows) AS rows, min(start_ns) AS first_ns, max(end_ns) AS last_ns FROM {table}
                 WHERE start_ns > ?1 AND {of_wall}"
            )
        };
        let of_wall = of_wall(db)?;
        let unsealed =
            "first_row >= coalesce((SELECT first_row + rows FROM blocks ORDER BY first_row DESC LIMIT 1), 0)";
        let select = format!(
            "SELECT sum(rows), min(first_ns), max(last_ns) FROM ({} UNION ALL {} AND {unsealed})",
            sum("blocks", of_wall),
            sum("tail", of_wall)
        );
        let found: (Option<i64>, Option<TimeNs>, Option<TimeNs>) = db
            .query_row(&select, [now_ns.saturating_add(AHEAD_NS)], |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)))
            .with_activity("looking for rows from the future")?;
        let (Some(samples), Some(first_ns), Some(last_ns)) = found else { return Ok(None) };
        Ok(Some(Self { samples, first_ns, last_ns }))
    }
}

impl fmt::Display for FutureRows {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { samples, first_ns, last_ns } = self;
        write!(f, "{samples} samples that are dated after now ({} to {})", format_utc(*first_ns), format_utc(*last_ns))
    }
}

/// The newest time that is not from the future, where `newest_ns` is after it.
pub(crate) fn present_ns(db: &Connection, now_ns: TimeNs, newest_ns: TimeNs) -> Result<TimeNs, HistoryError> {
    if FutureRows::find_after(db, now_ns)?.is_none() {
        return Ok(newest_ns);
    }
    let found: Option<TimeNs> = db
        .query_row(
            "SELECT max(end_ns) FROM (
               SELECT max(end_ns) AS end_ns FROM blocks WHERE start_ns <= ?1
               UNION ALL SELECT max(end_ns) FROM tail WHERE start_ns <= ?1)",
            params![now_ns.saturating_add(AHEAD_NS)],
            |row| row.get(0),
        )
        .with_activity("looking for the newest row")?;
    Ok(found.unwrap_or(now_ns))
}
