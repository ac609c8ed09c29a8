//! Summaries over time: a year by hour or day from the pyramid, anything finer or conditional from the samples.

use super::block::{Cells, ValueSummary};
use super::error::{Doing, HistoryError};
use super::levels::Level;
use super::query::{Chunk, Query};
use super::reader::Reader;
use super::series::Series;
use super::series_kind::SeriesKind;
use super::walk::Walk;
use adapter_core::clock::{SECOND_NS, TimeNs};
use rusqlite::params;
use std::collections::BTreeMap;
use std::ops::{ControlFlow, Range};
use std::sync::Arc;

/// At most this many buckets in one answer.
const BUCKETS_MAX: i64 = 1_000_000;

/// The buckets of one series.
#[derive(Debug, Clone, PartialEq)]
pub enum Buckets {
    /// Count, least, greatest and mean; a count of 0 where there is no value.
    Numbers(Vec<ValueSummary>),
    /// The last word in each bucket.
    Words(Vec<Option<Arc<str>>>),
}

/// Summaries of several series in buckets of equal width.
#[derive(Debug, Clone, PartialEq)]
pub struct Overview {
    /// Width of a bucket, nanoseconds.
    pub width_ns: i64,
    /// Beginning of each bucket that has rows, increasing; a multiple of the width.
    pub start_ns: Vec<TimeNs>,
    /// The series, in the order asked for.
    pub series: Vec<Series>,
    /// Their buckets, in the same order.
    pub columns: Vec<Buckets>,
}

/// One bucket under construction: a summary or a word per series.
#[derive(Debug, Clone, Default)]
struct BucketCell {
    summary: ValueSummary,
    word: Option<Arc<str>>,
}

/// Buckets by number, under construction.
struct BucketBuilder {
    width_ns: i64,
    series: Vec<Series>,
    buckets: BTreeMap<i64, Vec<BucketCell>>,
}

impl Reader {
    /// The answer to `query` in buckets of `width_ns`. The first and last bucket are whole even when the query begins or
    /// ends within them, if the width is a multiple of a minute and nothing but quantities is asked for.
    ///
    /// # Errors
    /// [`HistoryError::Question`] for a series that does not exist or more than a million buckets;
    /// [`HistoryError::Damaged`], or what `SQLite` says.
    pub fn read_overview(&self, query: &Query, width_ns: i64) -> Result<Overview, HistoryError> {
        let _view = self.begin_view()?;
        self.refuse_too_many(query, width_ns)?;
        let known: Arc<[Series]> = self.read_series()?.into();
        let level = Level::for_width(width_ns).filter(|_| !query.has_filter());
        if let Some(level) = level {
            let wanted = self.wanted_numbers(query, &known, level)?;
            if wanted.iter().all(|series| series.kind == SeriesKind::Number) {
                return Ok(self.read_pyramid(query, wanted, width_ns, level, &known)?.into_overview());
            }
        }
        self.read_samples(query, width_ns)
    }

    fn refuse_too_many(&self, query: &Query, width_ns: i64) -> Result<(), HistoryError> {
        if width_ns <= 0 {
            return Err(HistoryError::Question("the resolution must be more than 0 s".to_owned()));
        }
        let Some((first_ns, last_ns)) = self.read_span()? else { return Ok(()) };
        let range = query.range();
        let length_ns = range.end.min(last_ns).saturating_sub(range.start.max(first_ns));
        if length_ns / width_ns <= BUCKETS_MAX {
            return Ok(());
        }
        Err(HistoryError::Question(format!(
            "{} s is too fine for this time range: more than {BUCKETS_MAX} points. Ask for {} s or coarser, or for raw samples.",
            width_ns as f64 / SECOND_NS as f64,
            length_ns / BUCKETS_MAX / SECOND_NS + 1
        )))
    }

    /// The series asked for by name, or the quantities that have a value in that time.
    fn wanted_numbers(&self, query: &Query, known: &Arc<[Series]>, level: &Level) -> Result<Vec<Series>, HistoryError> {
        if !query.series.is_empty() {
            return self.resolve_series(query, known);
        }
        let range = buckets_of(level, query);
        let text = format!("SELECT DISTINCT series FROM {} WHERE {} BETWEEN ?1 AND ?2", level.table, level.key);
        let mut statement = self.db.prepare_cached(&text).with_activity("looking for series")?;
        let ids = statement.query_map([range.start, range.end], |row| row.get::<_, i64>(0));
        let mut ids: Vec<i64> = ids.and_then(Iterator::collect).with_activity("looking for series")?;
        let mut walk = Walk::of_tail(&self.db, query.range(), known.clone())?;
        while let Some(stretch) = walk.next(&self.db)? {
            ids.extend(stretch.delivered_series(known).into_iter().map(|(id, _)| id));
        }
        let numbers = known.iter().filter(|series| series.kind == SeriesKind::Number && ids.contains(&series.id));
        Ok(numbers.cloned().collect())
    }

    fn read_pyramid(
        &self,
        query: &Query,
        wanted: Vec<Series>,
        width_ns: i64,
        level: &Level,
        known: &Arc<[Series]>,
    ) -> Result<BucketBuilder, HistoryError> {
        let mut building = BucketBuilder { width_ns, series: wanted, buckets: BTreeMap::new() };
        let range = buckets_of(level, query);
        let (table, key) = (level.table, level.key);
        let places: BTreeMap<i64, usize> = building.series.iter().map(|series| series.id).zip(0..).collect();
        let ids: Vec<String> = places.keys().map(i64::to_string).collect();
        let text = format!(
            "SELECT {key}, series, count, min, max, mean FROM {table} WHERE {key} BETWEEN ?1 AND ?2 AND series IN ({})",
            ids.join(",")
        );
        let mut statement = self.db.prepare(&text).with_activity("reading summaries")?;
        let mut rows = statement.query(params![range.start, range.end]).with_activity("reading summaries")?;
        while let Some(row) = rows.next().with_activity("reading summaries")? {
            let summary = summary_of(row).with_activity("reading a summary")?;
            let (bucket, id): (i64, i64) = (row.get(0).with_activity("reading")?, row.get(1).with_activity("reading")?);
            building.add(bucket.saturating_mul(level.width_ns), places[&id], summary);
        }
        let mut walk = Walk::of_tail(&self.db, query.range(), known.clone())?;
        while let Some(stretch) = walk.next(&self.db)? {
            for (id, column) in &places {
                if let Some(cells) = walk.read_cells(&stretch, *id)? {
                    building.add_cells(&stretch.at_ns, *column, &cells);
                }
            }
        }
        Ok(building)
    }

    fn read_samples(&self, query: &Query, width_ns: i64) -> Result<Overview, HistoryError> {
        let mut building = BucketBuilder { width_ns, series: Vec::new(), buckets: BTreeMap::new() };
        self.for_each_chunk(query, |chunk| {
            building.add_chunk(chunk);
            ControlFlow::Continue(())
        })?;
        if building.series.is_empty() {
            building.series = self.resolve_series(query, &self.read_series()?.into())?;
        }
        Ok(building.into_overview())
    }
}

fn summary_of(row: &rusqlite::Row<'_>) -> Result<ValueSummary, rusqlite::Error> {
    Ok(ValueSummary {
        count: row.get::<_, i64>(2)?.unsigned_abs(),
        min: row.get(3)?,
        max: row.get(4)?,
        mean: row.get(5)?,
    })
}

/// First and last bucket of `level` that the time of `query` touches.
fn buckets_of(level: &Level, query: &Query) -> Range<i64> {
    let range = query.range();
    level.bucket_at(range.start)..level.bucket_at(range.end.saturating_sub(1))
}

impl BucketBuilder {
    fn cell_mut(&mut self, at_ns: TimeNs, column: usize) -> &mut BucketCell {
        let count = self.series.len();
        let cells =
            self.buckets.entry(at_ns.div_euclid(self.width_ns)).or_insert_with(|| vec![BucketCell::default(); count]);
        &mut cells[column]
    }

    fn add(&mut self, at_ns: TimeNs, column: usize, summary: ValueSummary) {
        let cell = self.cell_mut(at_ns, column);
        cell.summary = cell.summary.merge_with(summary);
    }

    fn add_chunk(&mut self, chunk: &Chunk<'_>) {
        if self.series.is_empty() {
            self.series = chunk.series.to_vec();
        }
        for (column, cells) in chunk.columns.iter().enumerate() {
            self.add_cells(&chunk.at_ns, column, cells);
        }
    }

    fn add_cells(&mut self, at_ns: &[TimeNs], column: usize, cells: &Cells) {
        let mut row = 0;
        let mut values = Vec::new();
        while row < at_ns.len() {
            let bucket = at_ns[row].div_euclid(self.width_ns);
            let end = row + at_ns[row..].partition_point(|at_ns| at_ns.div_euclid(self.width_ns) <= bucket);
            values.clear();
            values.extend((row..end).filter_map(|row| cells.number_at(row)));
            let word = (row..end).rev().find_map(|row| cells.word_at(row)).map(Arc::from);
            let cell = self.cell_mut(at_ns[row], column);
            cell.summary = cell.summary.merge_with(ValueSummary::from_values(&values));
            cell.word = word.or(cell.word.take());
            row = end;
        }
    }

    fn into_overview(self) -> Overview {
        let start_ns = self.buckets.keys().map(|bucket| bucket.saturating_mul(self.width_ns)).collect();
        let column = |(index, series): (usize, &Series)| {
            let cells = self.buckets.values().map(|cells| &cells[index]);
            match series.kind {
                SeriesKind::Number => Buckets::Numbers(cells.map(|cell| cell.summary).collect()),
                SeriesKind::Text => Buckets::Words(cells.map(|cell| cell.word.clone()).collect()),
            }
        };
        let columns = self.series.iter().enumerate().map(column).collect();
        Overview { width_ns: self.width_ns, start_ns, series: self.series, columns }
    }
}
