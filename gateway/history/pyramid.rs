//! Summaries by minute, hour and day, so that a year is drawn from 365 or 8 760 points per series instead of from 315
//! million samples. Each level is brought up to date when a block is written, in the same transaction.

use super::block::{Block, ValueSummary};
use adapters::clock::{SECOND_NS, TimeNs};
use rusqlite::{Connection, params};

/// One level of the pyramid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Level {
    pub(crate) width_ns: i64,
    pub(crate) table: &'static str,
    pub(crate) key: &'static str,
    insert: &'static str,
}

macro_rules! level {
    ($width_s:expr, $table:literal, $key:literal) => {
        Level {
            width_ns: $width_s * SECOND_NS,
            table: $table,
            key: $key,
            insert: concat!(
                "INSERT INTO ",
                $table,
                " (",
                $key,
                ", series, count, min, max, mean) VALUES (?1, ?2, ?3, ?4, ?5, ?6)
                 ON CONFLICT DO UPDATE SET
                   mean = (mean * count + excluded.mean * excluded.count) / (count + excluded.count),
                   min = min(min, excluded.min), max = max(max, excluded.max), count = count + excluded.count"
            ),
        }
    };
}

/// Minutes, hours, days.
pub(crate) static LEVELS: [Level; 3] =
    [level!(60, "minutes", "minute"), level!(3_600, "hours", "hour"), level!(86_400, "days", "day")];

/// Length of a fresh block and of the finest level, nanoseconds.
pub(crate) const MINUTE_NS: i64 = 60 * SECOND_NS;

impl Level {
    /// Length of a bucket, s.
    pub(crate) fn width_s(&self) -> u32 {
        u32::try_from(self.width_ns / SECOND_NS).unwrap_or(u32::MAX)
    }

    /// Number of the bucket that holds `at_ns`.
    pub(crate) fn bucket(&self, at_ns: TimeNs) -> i64 {
        at_ns.div_euclid(self.width_ns)
    }

    /// The coarsest level of which `width_ns` is a multiple.
    pub(crate) fn for_width(width_ns: i64) -> Option<&'static Self> {
        LEVELS.iter().rev().find(|level| width_ns > 0 && width_ns % level.width_ns == 0)
    }
}

/// Adds the summaries of a block, which lies within one minute, to every level.
pub(crate) fn add(db: &Connection, block: &Block) -> Result<(), rusqlite::Error> {
    for level in &LEVELS {
        let mut insert = db.prepare_cached(level.insert)?;
        for (series, summary) in &block.summaries {
            let ValueSummary { count, min, max, mean } = *summary;
            insert.execute(params![level.bucket(block.start_ns), series, count as i64, min, max, mean])?;
        }
    }
    Ok(())
}
