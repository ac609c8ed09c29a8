//! Rows of warm-ups and cool-downs: times, error and temperatures, run by run.

use super::quantities::{self, Series};
use crate::regression::{Column, Refusal, RefusalKind};
use numerics::statistics::mean;
use std::ops::Range;

/// A named temperature, one value per row, °C.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensor {
    /// Channel or column that it was read from.
    pub name: String,
    /// One finite number per row.
    pub values: Vec<f64>,
}

/// What is learned from: rows in the order of measurement; every series has a value in every row.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    clock_s: Vec<f64>,
    runs: Vec<Range<usize>>,
    pauses_known: bool,
    error_um: Vec<f64>,
    sensors: Vec<Sensor>,
}

/// Blocks for cross-validation where there are not enough runs.
const BLOCKS: usize = 6;
/// Whole runs serve as blocks from this many on; more than the second number are put together.
const RUNS_MIN: usize = 3;
const RUNS_MAX: usize = 12;

impl Course {
    /// Rows at `clock_s`, in consecutive `runs` that cover them all. With `pauses_known` the clock goes on between runs.
    #[must_use]
    pub fn new(
        clock_s: Vec<f64>,
        runs: Vec<Range<usize>>,
        pauses_known: bool,
        error_um: Vec<f64>,
        sensors: Vec<Sensor>,
    ) -> Self {
        Self { clock_s, runs, pauses_known, error_um, sensors }
    }

    /// Refuses what no law can be learned from with these sensors (positions).
    ///
    /// # Errors
    /// The first obstacle: time that goes back within a run, and all that is wrong with a series.
    pub fn check_sensors(&self, sensors: &[usize]) -> Result<(), Refusal> {
        let series: Vec<Series<'_>> = sensors.iter().map(|at| self.sensors[*at].as_series()).collect();
        quantities::check_series(&self.error_um, &series)?;
        let back = (1..self.rows()).find(|row| self.since_s(*row).is_some_and(|dt_s| dt_s.is_nan() || dt_s <= 0.0));
        let Some(row) = back else { return Ok(()) };
        let what = format!("does not increase in row {}", row + 1);
        let next = "sort the rows, or give each warm-up a run of its own";
        Err(Refusal::new(RefusalKind::Contradiction, what, next).with_place("time_s"))
    }

    /// Positions of the sensors that can be used; those that did not change cannot.
    ///
    /// # Errors
    /// A sensor that is wrong in another way, its unit among them; or the first obstacle where none can be used.
    pub fn find_usable_sensors(&self) -> Result<Vec<usize>, Refusal> {
        quantities::enough_rows(self.rows())?;
        let mut usable = Vec::new();
        let mut refused = None;
        for (at, sensor) in self.sensors.iter().enumerate() {
            match quantities::temperature_is_usable(sensor.as_series(), self.rows()) {
                Ok(()) => usable.push(at),
                Err(refusal) if refusal.kind == RefusalKind::Constant => refused = refused.or(Some(refusal)),
                Err(refusal) => return Err(refusal),
            }
        }
        self.check_sensors(&usable).map_err(|refusal| match refusal.kind {
            RefusalKind::Missing => refused.unwrap_or(refusal),
            _ => refusal,
        })?;
        Ok(usable)
    }

    /// Number of rows: each has a time, an error and a value of every sensor.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.clock_s.len()
    }

    /// Time of each row, s.
    #[must_use]
    pub fn clock_s(&self) -> &[f64] {
        &self.clock_s
    }

    /// Measured thermal error of each row, um.
    #[must_use]
    pub fn error_um(&self) -> &[f64] {
        &self.error_um
    }

    /// The temperatures, in the order in which they were given.
    #[must_use]
    pub fn sensors(&self) -> &[Sensor] {
        &self.sensors
    }

    /// Rows of each run.
    #[must_use]
    pub fn runs(&self) -> &[Range<usize>] {
        &self.runs
    }

    /// Does the clock go on between runs? One run alone has no pause.
    #[must_use]
    pub fn pauses_known(&self) -> bool {
        self.pauses_known || self.runs.len() < 2
    }

    /// Seconds since the row before; none at the first row and after a pause that is not known.
    #[must_use]
    pub(super) fn since_s(&self, row: usize) -> Option<f64> {
        let starts = row == 0 || (!self.pauses_known && self.runs.iter().any(|run| run.start == row));
        (!starts).then(|| self.clock_s[row] - self.clock_s[row - 1])
    }

    /// The middle spacing of rows, s.
    #[must_use]
    pub(super) fn period_s(&self) -> f64 {
        let mut steps: Vec<f64> = (1..self.rows()).filter_map(|row| self.since_s(row)).filter(|s| *s > 0.0).collect();
        steps.sort_by(f64::total_cmp);
        steps.get(steps.len() / 2).copied().unwrap_or(1.0)
    }

    /// Duration of the longest run, s.
    #[must_use]
    pub(super) fn longest_s(&self) -> f64 {
        let length = |run: &Range<usize>| self.clock_s[run.end - 1] - self.clock_s[run.start];
        self.runs.iter().filter(|run| !run.is_empty()).map(length).fold(0.0, f64::max)
    }

    /// Rows that are left out together: whole runs where there are three or more, contiguous blocks otherwise.
    #[must_use]
    pub fn split_into_blocks(&self) -> Vec<Range<usize>> {
        if self.runs.len() < RUNS_MIN {
            let rows = self.rows();
            return (0..BLOCKS).map(|at| at * rows / BLOCKS..(at + 1) * rows / BLOCKS).collect();
        }
        let groups = self.runs.len().min(RUNS_MAX);
        let first = |group: usize| self.runs[group * self.runs.len() / groups].start;
        (0..groups).map(|at| first(at)..if at + 1 == groups { self.rows() } else { first(at + 1) }).collect()
    }

    /// Are the blocks of [`Course::split_into_blocks`] whole runs?
    #[must_use]
    pub fn blocks_are_runs(&self) -> bool {
        self.runs.len() >= RUNS_MIN
    }

    /// The same with several neighbouring rows of a run averaged into one, so that at most about `rows_max` remain;
    /// `columns` are averaged alike.
    #[must_use]
    pub(super) fn condense_rows(&self, columns: &[Column], rows_max: usize) -> (Self, Vec<Column>) {
        let group = self.rows().div_ceil(rows_max.max(1)).max(1);
        if group == 1 {
            return (self.clone(), columns.to_vec());
        }
        let (mut groups, mut runs) = (Vec::new(), Vec::new());
        for run in &self.runs {
            let start = groups.len();
            groups.extend(run.clone().step_by(group).map(|from| from..(from + group).min(run.end)));
            runs.push(start..groups.len());
        }
        let averaged = |values: &[f64]| groups.iter().map(|rows: &Range<usize>| mean(&values[rows.clone()])).collect();
        let sensor = |sensor: &Sensor| Sensor { name: sensor.name.clone(), values: averaged(&sensor.values) };
        let course = Self {
            clock_s: averaged(&self.clock_s),
            runs,
            pauses_known: self.pauses_known,
            error_um: averaged(&self.error_um),
            sensors: self.sensors.iter().map(sensor).collect(),
        };
        let columns = columns.iter().map(|c| Column::new(c.name.as_str(), averaged(&c.values))).collect();
        (course, columns)
    }
}

impl Sensor {
    /// A sensor of this name with one temperature per row, °C.
    #[must_use]
    pub fn new(name: impl Into<String>, values: Vec<f64>) -> Self {
        Self { name: name.into(), values }
    }

    /// Its values under its name, as a [`Series`].
    #[must_use]
    pub fn as_series(&self) -> Series<'_> {
        Series { name: &self.name, values: &self.values }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn course(runs: Vec<Range<usize>>, pauses_known: bool) -> Course {
        let rows = runs.last().map_or(0, |run| run.end);
        let clock_s = (0..rows).map(|row| row as f64).collect();
        let ramp: Vec<f64> = (0..rows).map(|row| 20.0 + row as f64).collect();
        Course::new(clock_s, runs, pauses_known, ramp.clone(), vec![Sensor::new("temperature_1_c", ramp)])
    }

    fn one(rows: usize) -> Vec<Range<usize>> {
        std::iter::once(0..rows).collect()
    }

    #[test]
    fn blocks_are_runs_from_three_on() {
        assert_eq!(course(vec![0..5, 5..9, 9..12], true).split_into_blocks(), [0..5, 5..9, 9..12]);
        assert_eq!(course(one(12), true).split_into_blocks().len(), BLOCKS);
        let many = course((0..20).map(|at| 3 * at..3 * at + 3).collect(), true).split_into_blocks();
        assert_eq!((many.len(), many[0].start, many[RUNS_MAX - 1].end), (RUNS_MAX, 0, 60));
        assert!(many.windows(2).all(|pair| pair[0].end == pair[1].start));
    }

    #[test]
    fn rows_are_averaged_within_runs_only() {
        let (short, columns) = course(vec![0..5, 5..12], true).condense_rows(&[Column::new("x", vec![1.0; 12])], 6);
        assert_eq!(short.runs(), [0..3, 3..7]);
        assert_eq!(short.clock_s()[..4], [0.5, 2.5, 4.0, 5.5]);
        assert_eq!(columns[0].values, [1.0; 7]);
    }

    #[test]
    fn a_pause_is_known_or_it_is_not() {
        assert_eq!(course(vec![0..5, 5..9], true).since_s(5), Some(1.0));
        assert_eq!(course(vec![0..5, 5..9], false).since_s(5), None);
        let mut wrong = course(one(9), true);
        wrong.clock_s[4] = 3.0;
        assert_eq!(wrong.check_sensors(&[0]).expect_err("time stands").place, "time_s");
    }
}
