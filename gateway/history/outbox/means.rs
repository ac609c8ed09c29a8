//! Means of minutes, hours and days as items: what the summaries of the history hold of a bucket, once it is over.
//!
//! A minute is told with its block; an hour and a day when a block of the next one is stored, and at a clean end. What
//! was added to the last bucket by opening again after a kill is told with the first commit. An item holds everything of its bucket,
//! so a later one of the same bucket replaces it.

use super::line;
use crate::HistoryError;
use crate::error::Doing;
use crate::levels::{LEVELS, Level};
use adapter_core::clock::{SECOND_NS, TimeNs};
use rusqlite::Connection;
use std::collections::BTreeSet;
use std::time::Duration;

/// A bucket: the index of its level, and its number.
pub(super) type Bucket = (usize, i64);

/// Which buckets are due.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MeanSchedule {
    /// Beginning of the newest block, whose hour and day are running.
    newest_ns: Option<TimeNs>,
    /// What opening has added to the last buckets is not told yet.
    opened: bool,
}

impl MeanSchedule {
    /// Of a history whose newest row is of this time.
    pub(super) fn new(newest_ns: Option<TimeNs>) -> Self {
        Self { newest_ns, opened: newest_ns.is_some() }
    }

    /// The buckets that are over when blocks that begin at these times are stored.
    pub(super) fn collect_due_buckets(&mut self, blocks: impl Iterator<Item = TimeNs>) -> BTreeSet<Bucket> {
        let mut due = BTreeSet::new();
        if std::mem::take(&mut self.opened) {
            due.extend(self.current_buckets());
        }
        for start_ns in blocks {
            let over = |(level, bucket): &Bucket| *level > 0 && LEVELS[*level].bucket_at(start_ns) != *bucket;
            due.extend(self.current_buckets().filter(over));
            self.newest_ns = Some(start_ns);
            due.insert((0, LEVELS[0].bucket_at(start_ns)));
        }
        due
    }

    /// The buckets that hold the newest block.
    pub(super) fn current_buckets(&self) -> impl Iterator<Item = Bucket> + use<> {
        let newest_ns = self.newest_ns;
        let bucket =
            move |(index, level): (usize, &Level)| newest_ns.map(|newest_ns| (index, level.bucket_at(newest_ns)));
        LEVELS.iter().enumerate().filter_map(bucket)
    }
}

/// The lines of these buckets. A tick stands for `tick`: so many ticks with a value are so many seconds.
pub(super) fn format_lines(
    db: &Connection,
    due: &BTreeSet<Bucket>,
    tick: Duration,
) -> Result<Vec<(TimeNs, String)>, HistoryError> {
    let mut lines = Vec::with_capacity(due.len());
    for (index, bucket) in due {
        let level = &LEVELS[*index];
        let means = read(db, level, *bucket, tick).with_activity("reading the summaries")?;
        let start_ns = bucket.saturating_mul(level.width_ns);
        if !means.is_empty() {
            lines.push((start_ns, line::of_means(start_ns, level.width_s, &means)));
        }
    }
    Ok(lines)
}

fn read(db: &Connection, level: &Level, bucket: i64, tick: Duration) -> Result<Vec<(i64, [f64; 4])>, rusqlite::Error> {
    let Level { table, key, width_ns, .. } = level;
    let question = format!("SELECT series, count, mean, min, max FROM {table} WHERE {key} = ?1 ORDER BY series");
    let longest_s = *width_ns as f64 / SECOND_NS as f64;
    let mut select = db.prepare_cached(&question)?;
    let rows = select.query_map([bucket], |row| {
        let seconds = (row.get::<_, i64>(1)? as f64 * tick.as_secs_f64()).min(longest_s);
        Ok((row.get(0)?, [round_digits(seconds), round_digits(row.get(2)?), row.get(3)?, row.get(4)?]))
    });
    rows?.collect()
}

/// With nine significant digits: a mean has no more, and each costs room on every line.
fn round_digits(number: f64) -> f64 {
    format!("{number:.8e}").parse().unwrap_or(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR_NS: i64 = 3600 * SECOND_NS;

    #[test]
    fn a_minute_is_told_with_its_block_and_an_hour_when_the_next_begins() {
        let mut schedule = MeanSchedule::new(None);
        let minute = |hour: i64, minute: i64| hour * HOUR_NS + minute * 60 * SECOND_NS;
        assert_eq!(
            schedule.collect_due_buckets([minute(5, 0), minute(5, 1)].into_iter()),
            BTreeSet::from([(0, 300), (0, 301)])
        );
        assert_eq!(schedule.collect_due_buckets([minute(6, 0)].into_iter()), BTreeSet::from([(0, 360), (1, 5)]));
        assert_eq!(schedule.collect_due_buckets(std::iter::empty()), BTreeSet::new());
        assert_eq!(schedule.current_buckets().collect::<Vec<_>>(), [(0, 360), (1, 6), (2, 0)]);
    }

    #[test]
    fn what_opening_has_added_is_told_once() {
        let mut schedule = MeanSchedule::new(Some(25 * HOUR_NS));
        assert_eq!(schedule.collect_due_buckets(std::iter::empty()), BTreeSet::from([(0, 1500), (1, 25), (2, 1)]));
        assert_eq!(schedule.collect_due_buckets(std::iter::empty()), BTreeSet::new());
    }
}
