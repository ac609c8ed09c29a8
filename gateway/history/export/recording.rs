//! A time range as a recording in memory, for `diagnose`, `identify` and back-tests.

use super::super::error::HistoryError;
use super::super::query::{Chunk, Query};
use super::super::reader::Reader;
use super::super::series_kind::SeriesKind;
use super::{ColumnPlan, RUN, run_text};
use recording::Recording;
use recording::{Cells, Numbers, Words};
use std::ops::ControlFlow;

struct ColumnBuilder<'a> {
    plan: &'a ColumnPlan,
    time_s: Vec<f64>,
    columns: Vec<Cells>,
    /// Reasons of absence, where a series has any.
    missing: Vec<Option<Words>>,
    runs: Words,
}

impl Reader {
    /// The answer to `query` as a recording: the series as columns, `<series>_missing` beside those with absent values.
    ///
    /// # Errors
    /// [`HistoryError::Question`] when there are no rows, and what [`Reader::for_each_chunk`] says.
    pub fn read_recording(&self, query: &Query) -> Result<Recording, HistoryError> {
        let _view = self.begin_view()?;
        let plan = self.plan_columns(query)?;
        let mut building = ColumnBuilder::new(&plan);
        self.for_each_chunk(&Query { series: plan.series_names(), ..query.clone() }, |chunk| {
            building.add(chunk);
            ControlFlow::Continue(())
        })?;
        Ok(building.into_recording(self.path.display().to_string()))
    }
}

impl<'a> ColumnBuilder<'a> {
    fn new(plan: &'a ColumnPlan) -> Self {
        let empty = |kind| match kind {
            SeriesKind::Number => Cells::Numbers(Numbers::default()),
            SeriesKind::Text => Cells::Words(Words::default()),
        };
        Self {
            plan,
            time_s: Vec::new(),
            columns: plan.series.iter().map(|(series, _)| empty(series.kind)).collect(),
            missing: plan.series.iter().map(|(_, missing)| missing.then(Words::default)).collect(),
            runs: Words::default(),
        }
    }

    fn add(&mut self, chunk: &Chunk<'_>) {
        let plan = self.plan;
        self.time_s.extend(chunk.at_ns.iter().map(|at_ns| plan.seconds_since_start(*at_ns)));
        let run = plan.series.iter().position(|(series, _)| &*series.name == RUN);
        for row in 0..chunk.at_ns.len() {
            if !plan.monotone {
                let run = run.and_then(|index| chunk.columns[index].word_at(row));
                self.runs.push(&run_text(chunk.segment, run));
            }
            for (index, column) in self.columns.iter_mut().enumerate() {
                match column {
                    Cells::Numbers(numbers) => numbers.push(chunk.columns[index].number_at(row)),
                    Cells::Words(words) => words.push(chunk.columns[index].word_at(row).unwrap_or("")),
                }
                if let Some(words) = &mut self.missing[index] {
                    words.push(chunk.missing_reason(index, row).filter(|word| *word != "not_provided").unwrap_or(""));
                }
            }
        }
    }

    fn into_recording(self, source: String) -> Recording {
        let start_ns = self.plan.monotone.then_some(self.plan.first_ns);
        let mut recording = Recording::new(source, self.time_s, start_ns);
        for ((series, _), (cells, missing)) in self.plan.series.iter().zip(self.columns.into_iter().zip(self.missing)) {
            recording.set_column(&series.name, cells);
            if let Some(words) = missing {
                recording.set_column(&format!("{}_missing", series.name), Cells::Words(words));
            }
        }
        if !self.plan.monotone {
            recording.set_column(RUN, Cells::Words(self.runs));
        }
        recording
    }
}
