//! Summaries by minute, hour and day, so that a year is drawn from 365 or 8 760 points per series instead of from 315
//! million samples. Each level is brought up to date when a block is written, in the same transaction.

use super::block::{Block, ValueSummary};
use super::error::{Doing, HistoryError};
use super::levels::{LEVELS, Level, MINUTE_NS};
use super::schema::known_series;
use super::series::Series;
use super::series_kind::SeriesKind;
use super::walk::Walk;
use rusqlite::{Connection, params};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Adds the summaries of a block, which lies within one minute, to every level.
pub(crate) fn add(db: &Connection, block: &Block) -> Result<(), rusqlite::Error> {
    for level in &LEVELS {
        let mut insert = db.prepare_cached(level.insert)?;
        for (series, summary) in &block.summaries {
            let ValueSummary { count, min, max, mean } = *summary;
            insert.execute(params![level.bucket_at(block.key.start_ns), series, count as i64, min, max, mean])?;
        }
    }
    Ok(())
}

/// Those of these minutes that are not before the oldest block: of earlier ones only the summaries are left.
pub(crate) fn with_blocks(db: &Connection, minutes: Range<i64>) -> Result<Range<i64>, HistoryError> {
    let oldest: Option<i64> = db
        .query_row("SELECT min(start_ns) / ?1 FROM blocks", [MINUTE_NS], |row| row.get(0))
        .with_activity("looking for the oldest block")?;
    Ok(minutes.start.max(oldest.unwrap_or(minutes.end))..minutes.end)
}

/// Makes the summaries of these minutes anew from the blocks, and those of their hours and days from them.
pub(crate) fn renew_buckets(db: &Connection, minutes: Range<i64>) -> Result<(), HistoryError> {
    if minutes.is_empty() {
        return Ok(());
    }
    renew_minutes(db, &minutes)?;
    let mut range = minutes;
    for pair in LEVELS.windows(2) {
        let (fine, coarse) = (&pair[0], &pair[1]);
        let per = coarse.width_ns / fine.width_ns;
        range = range.start.div_euclid(per)..(range.end - 1).div_euclid(per) + 1;
        renew_level(db, fine, coarse, &range).with_activity("making summaries anew")?;
    }
    Ok(())
}

fn renew_minutes(db: &Connection, minutes: &Range<i64>) -> Result<(), HistoryError> {
    let sums = minute_sums(db, minutes)?;
    let minute = &LEVELS[0];
    db.execute("DELETE FROM minutes WHERE minute >= ?1 AND minute < ?2", [minutes.start, minutes.end])
        .with_activity("making summaries anew")?;
    let mut insert = db.prepare_cached(minute.insert).with_activity("making summaries anew")?;
    for ((bucket, series), ValueSummary { count, min, max, mean }) in sums {
        insert.execute(params![bucket, series, count as i64, min, max, mean]).with_activity("making summaries anew")?;
    }
    Ok(())
}

/// Summaries by minute and series, from the samples. What is damaged is left out.
fn minute_sums(db: &Connection, minutes: &Range<i64>) -> Result<BTreeMap<(i64, i64), ValueSummary>, HistoryError> {
    let range = minutes.start.saturating_mul(MINUTE_NS)..minutes.end.saturating_mul(MINUTE_NS);
    let series: Arc<[Series]> = known_series(db)?.into();
    let mut walk = Walk::of_blocks(db, range, series.clone())?;
    let mut sums: BTreeMap<(i64, i64), ValueSummary> = BTreeMap::new();
    while let Some(stretch) = walk.next(db)? {
        for one in series.iter().filter(|one| one.kind == SeriesKind::Number) {
            let Some(cells) = walk.read_cells(&stretch, one.id)? else { continue };
            for row in walk.rows_of(&stretch) {
                let Some(value) = cells.number_at(row) else { continue };
                let sum = sums.entry((stretch.at_ns[row].div_euclid(MINUTE_NS), one.id)).or_default();
                *sum = sum.merge_with(ValueSummary { count: 1, min: value, max: value, mean: value });
            }
        }
    }
    Ok(sums)
}

fn renew_level(db: &Connection, fine: &Level, coarse: &Level, range: &Range<i64>) -> Result<(), rusqlite::Error> {
    let (table, key, from, of) = (coarse.table, coarse.key, fine.table, fine.key);
    let per = coarse.width_ns / fine.width_ns;
    db.execute(&format!("DELETE FROM {table} WHERE {key} >= ?1 AND {key} < ?2"), [range.start, range.end])?;
    db.execute(
        &format!(
            "INSERT INTO {table} ({key}, series, count, min, max, mean)
             SELECT {of} / {per}, series, sum(count), min(min), max(max), sum(mean * count) / sum(count) FROM {from}
             WHERE {of} >= ?1 AND {of} < ?2 GROUP BY {of} / {per}, series"
        ),
        [range.start.saturating_mul(per), range.end.saturating_mul(per)],
    )
    .map(drop)
}
