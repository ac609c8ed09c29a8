//! A time range as a recording: CSV, Parquet, or in memory for the twin (`recording/1`).
//!
//! Rows stand in the order of recording under `time_utc`. Where the clock went back within the range, `time_utc` would
//! decrease; then the recording has `time_s` and a `run` per segment instead.

mod csv;
mod parquet;
mod partitions;
mod recording;

pub use csv::plain_cell;
pub use partitions::{DayWritten, day_of};

use super::error::{Doing, HistoryError, add_path};
use super::query::Query;
use super::reader::Reader;
use super::series::Series;
use super::walk::blocks_in;
use adapter_core::clock::TimeNs;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

/// The column of a recording that holds the runs.
const RUN: &str = "run";

/// A file format of recordings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Comma-separated text with a header, `.csv`.
    Csv,
    /// The same text, gzipped, `.csv.gz`.
    CsvGz,
    /// Columns, compressed; for data frames and data lakes.
    Parquet,
}

impl Format {
    /// The format that the name of a file asks for: `.csv`, `.csv.gz` or `.parquet`.
    ///
    /// # Errors
    /// [`HistoryError::Question`] for another ending.
    pub fn from_path(path: &Path) -> Result<Self, HistoryError> {
        let name = path.to_string_lossy().to_lowercase();
        match name {
            name if name.ends_with(".csv") => Ok(Self::Csv),
            name if name.ends_with(".csv.gz") => Ok(Self::CsvGz),
            name if name.ends_with(".parquet") => Ok(Self::Parquet),
            _ => Err(HistoryError::Question(format!(
                "{}: the format follows from the ending; use .csv, .csv.gz or .parquet",
                path.display()
            ))),
        }
    }
}

/// What the columns of a recording will be.
struct ColumnPlan {
    /// The series, and whether a column of reasons goes with it.
    series: Vec<(Series, bool)>,
    first_ns: TimeNs,
    monotone: bool,
}

impl ColumnPlan {
    fn has_run(&self) -> bool {
        self.series.iter().any(|(series, _)| &*series.name == RUN)
    }

    fn series_names(&self) -> Vec<String> {
        self.series.iter().map(|(series, _)| series.name.to_string()).collect()
    }

    /// Seconds since the first row.
    fn seconds_since_start(&self, at_ns: TimeNs) -> f64 {
        (at_ns - self.first_ns) as f64 / 1e9
    }
}

/// The `run` of a row where time decreases: the segment, and the run it was part of.
fn run_text(segment: i64, run: Option<&str>) -> String {
    run.map_or_else(|| segment.to_string(), |run| format!("{segment}/{run}"))
}

impl Reader {
    /// Writes the answer to `query` into the file at `path`; how many rows.
    ///
    /// # Errors
    /// [`HistoryError::Question`] when there are no rows or the format is unknown, [`HistoryError::Io`], and what
    /// [`Reader::for_each_chunk`] says.
    pub fn export_to_file(&self, query: &Query, path: &Path) -> Result<u64, HistoryError> {
        let format = Format::from_path(path)?;
        let _view = self.begin_view()?;
        let plan = self.plan_columns(query)?;
        let file = File::create(path).map_err(add_path(path))?;
        let out = BufWriter::with_capacity(1 << 16, file);
        match format {
            Format::Csv => csv::write(self, query, &plan, out, path),
            Format::CsvGz => csv::write_gzip(self, query, &plan, out, path),
            Format::Parquet => parquet::write(self, query, &plan, &[], out, path),
        }
    }

    /// Writes the answer to `query` as CSV to `out`; how many rows. `name` stands for `out` in messages.
    ///
    /// # Errors
    /// As [`Reader::export_to_file`].
    pub fn export_csv(&self, query: &Query, out: impl std::io::Write, name: &Path) -> Result<u64, HistoryError> {
        let _view = self.begin_view()?;
        let plan = self.plan_columns(query)?;
        csv::write(self, query, &plan, out, name)
    }

    fn plan_columns(&self, query: &Query) -> Result<ColumnPlan, HistoryError> {
        let known: Arc<[Series]> = self.read_series()?.into();
        let mut series = self.find_delivered(query, &known)?;
        if !query.series.is_empty() {
            let wanted = self.resolve_series(query, &known)?;
            let missing = |id| series.iter().any(|(series, missing)| series.id == id && *missing);
            series = wanted.into_iter().map(|series| (series.clone(), missing(series.id))).collect();
        }
        let mut first_ns = None;
        let one = known.first().map(|series| series.name.to_string());
        self.for_each_chunk(&Query { series: one.into_iter().collect(), ..query.clone() }, |chunk| {
            first_ns = chunk.at_ns.first().copied();
            std::ops::ControlFlow::Break(())
        })?;
        let Some(first_ns) = first_ns else {
            return Err(HistoryError::Question(
                "no samples in this time range under these conditions; `cnc-gateway history info` shows what there is"
                    .to_owned(),
            ));
        };
        Ok(ColumnPlan { series, first_ns, monotone: self.is_monotone(query)? })
    }

    /// Does time never decrease in the range, over all its blocks and the tail?
    fn is_monotone(&self, query: &Query) -> Result<bool, HistoryError> {
        let keys = blocks_in(&self.db, &query.range())?;
        let mut ends = self
            .db
            .prepare_cached("SELECT start_ns, end_ns FROM blocks WHERE first_row = ?1")
            .with_activity("reading the order of blocks")?;
        let mut last_ns = TimeNs::MIN;
        for key in keys {
            let (start_ns, end_ns): (TimeNs, TimeNs) = ends
                .query_row([key], |row| Ok((row.get(0)?, row.get(1)?)))
                .with_activity("reading the order of blocks")?;
            if start_ns < last_ns {
                return Ok(false);
            }
            last_ns = end_ns;
        }
        let tail: Option<TimeNs> = self
            .db
            .query_row(
                "SELECT min(start_ns) FROM tail WHERE first_row >= coalesce((SELECT first_row + rows FROM blocks ORDER BY first_row DESC LIMIT 1), 0)
                 AND end_ns >= ?1 AND start_ns < ?2",
                [query.range().start, query.range().end],
                |row| row.get(0),
            )
            .with_activity("reading the order of the crash tail")?;
        Ok(tail.is_none_or(|start_ns| start_ns >= last_ns))
    }
}
