//! Means that are told once more: of minutes, hours and days from which rows went, or into which they came, when their clock turned out
//! to have been wrong. What is due stands in `meta` until the commit that tells it.

use super::means::Bucket;
use super::property::read_property;
use crate::HistoryError;
use crate::error::Doing;
use crate::levels::LEVELS;
use adapter_core::clock::TimeNs;
use rusqlite::Connection;
use std::collections::BTreeSet;
use std::ops::Range;

/// Key of the table `meta`.
const AGAIN: &str = "outbox_means_again";
/// More are not told: a quarter of a year of minutes. A commit holds a part of them.
const BUCKETS_MAX: usize = 131_072;

/// The means of these stretches of time are due once more.
pub(super) fn note_stretches(db: &Connection, stretches: &[Range<TimeNs>]) -> Result<(), HistoryError> {
    let mut all = load_stretches(db)?;
    all.extend_from_slice(stretches);
    let text = serde_json::to_string(&all).unwrap_or_default();
    db.execute("INSERT OR REPLACE INTO meta (key, value) VALUES (?1, ?2)", [AGAIN, &text])
        .map(drop)
        .with_activity("noting which means are due")
}

fn load_stretches(db: &Connection) -> Result<Vec<Range<TimeNs>>, HistoryError> {
    let text = read_property(db, AGAIN)?;
    Ok(text.and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default())
}

/// The buckets that are due.
pub(super) fn load_buckets(db: &Connection) -> Result<BTreeSet<Bucket>, HistoryError> {
    let stretches = load_stretches(db)?;
    let of_level = |level: usize, stretch: &Range<TimeNs>| {
        let (first, last) = (LEVELS[level].bucket_at(stretch.start), LEVELS[level].bucket_at(stretch.end));
        (first..=last).map(move |bucket| (level, bucket))
    };
    let all = stretches.iter().flat_map(|stretch| (0..LEVELS.len()).flat_map(move |level| of_level(level, stretch)));
    Ok(all.take(BUCKETS_MAX).collect())
}

/// They have been told.
pub(super) fn forget_stretches(db: &Connection) -> Result<(), HistoryError> {
    db.execute("DELETE FROM meta WHERE key = ?1", [AGAIN]).map(drop).with_activity("noting which means were told")
}
