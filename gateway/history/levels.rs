//! Lengths over which samples are summed up: minutes, hours, days.

use adapter_core::clock::{SECOND_NS, TimeNs};

/// One level of the pyramid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Level {
    pub(crate) width_ns: i64,
    pub(crate) width_s: u32,
    pub(crate) table: &'static str,
    pub(crate) key: &'static str,
    /// Adds one summary, or joins it with the one that is there.
    pub(crate) insert: &'static str,
}

macro_rules! level {
    ($width_s:expr, $table:literal, $key:literal) => {
        Level {
            width_ns: $width_s * SECOND_NS,
            width_s: $width_s,
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

pub(crate) static LEVELS: [Level; 3] =
    [level!(60, "minutes", "minute"), level!(3_600, "hours", "hour"), level!(86_400, "days", "day")];

/// Length of a fresh block and of the finest level, nanoseconds.
pub(crate) const MINUTE_NS: i64 = 60 * SECOND_NS;

impl Level {
    /// Number of the bucket that holds `at_ns`.
    pub(crate) fn bucket_at(&self, at_ns: TimeNs) -> i64 {
        at_ns.div_euclid(self.width_ns)
    }

    /// The coarsest level of which `width_ns` is a multiple.
    pub(crate) fn for_width(width_ns: i64) -> Option<&'static Self> {
        LEVELS.iter().rev().find(|level| width_ns > 0 && width_ns % level.width_ns == 0)
    }
}
