//! Which sensors: those that predict warm-ups they have not seen, and do not repeat each other.
//!
//! Grey relational grades alone choose sensors that say the same (variance inflation 81 to 1262 for the published four on
//! a synthetic warm-up). Here lists of one sensor, of two (all pairs), of three and four (grown from the best) are
//! compared by the error in blocks that were left out; lists with collinear columns are refused, and a longer list must
//! be clearly better than a shorter one. The grades are shown beside it.
//! Sources: Machines 2022 10(6):427 (collinearity makes the selected points vary from run to run); variance inflation up
//! to 10: Montgomery, Introduction to Linear Regression Analysis, 9.4.2.

use super::course::{Course, Sensor};
use super::cross_validation::{HeldOut, held_out};
use super::grey::{Grades, Normalisation, compute_grades};
use super::lagged::compute_lagged_states;
use super::quantities::{self, Series};
use super::regression::to_column;
use crate::regression::{Column, Intercept, Refusal, RefusalKind, fit_unweighted};
use serde::Serialize;
use std::ops::Range;

mod verdict;

pub use verdict::SensorVerdict;

/// What is asked of a selection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SelectionSettings {
    /// How many sensors a law may have at most.
    pub sensors_max: usize,
    /// Greatest variance inflation factor.
    pub inflation_max: f64,
    /// Least share by which a further sensor must lower the held-out error.
    pub gain_min: f64,
    /// Resolution coefficient of the grades.
    pub rho: f64,
}

impl Default for SelectionSettings {
    /// Four sensors as in the source, variance inflation up to 10, 5 %, rho 0.5.
    fn default() -> Self {
        Self { sensors_max: 4, inflation_max: 10.0, gain_min: 0.05, rho: super::grey::RHO_USUAL }
    }
}

/// The sensors, and why.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Selection {
    /// Positions of the chosen sensors in the course, in the order in which they were chosen.
    #[serde(skip)]
    pub chosen: Vec<usize>,
    /// Every sensor with its verdict, in the order of the course.
    pub sensors: Vec<SensorVerdict>,
    /// Error in blocks left out, with the chosen sensors.
    pub held_out: HeldOut,
    /// The same without any sensor.
    pub held_out_mean: HeldOut,
    /// Belsley's condition number of the chosen columns.
    pub condition_number: f64,
    /// What the four best grades would have given.
    pub by_grades: Option<GradeChoice>,
}

/// The sensors with the best grades, for comparison.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GradeChoice {
    /// Names, best grade first; as many as were chosen, at least two where there are two.
    pub sensors: Vec<String>,
    /// Greatest variance inflation among them; none where they are linearly dependent.
    pub variance_inflation: Option<f64>,
    /// Belsley's condition number; none where they are linearly dependent.
    pub condition_number: Option<f64>,
    /// Error in blocks left out, um.
    pub held_out_rms_um: Option<f64>,
}

/// Rows that the search works on; more are averaged first.
const ROWS_MAX: usize = 400;
/// Sensors of a late law: the lag stands for what further sensors would have to imitate.
const LATE_MAX: usize = 2;
/// Lists of three or more sensors that are extended further.
const BEAM: usize = 8;

/// Chooses sensors.
///
/// # Errors
/// A [`Refusal`]: unusable rows (see [`Course::find_usable_sensors`]), or no sensor predicts the error better than its mean.
pub fn select_sensors(course: &Course, settings: SelectionSettings) -> Result<Selection, Refusal> {
    let candidates = course.find_usable_sensors()?;
    let search = SensorSelection::new(course, settings, candidates);
    let chosen = search.choose_sensors()?;
    search.build_selection(course, chosen)
}

/// Chooses up to two sensors for a law in which every sensor is late, over several time constants.
///
/// # Errors
/// As [`select_sensors`].
pub(super) fn select_late(course: &Course, settings: SelectionSettings, taus_s: &[f64]) -> Result<Selection, Refusal> {
    let candidates = course.find_usable_sensors()?;
    let settings = SelectionSettings { sensors_max: settings.sensors_max.min(LATE_MAX), ..settings };
    let mut best: Option<(f64, SensorSelection, Vec<usize>)> = None;
    for tau_s in taus_s {
        let search = SensorSelection::with_lagged_states(course, settings, candidates.clone(), *tau_s);
        let Ok(chosen) = search.choose_sensors() else { continue };
        let error = search.score_sensors(&chosen).map_or(f64::MAX, |it| it.rms_um);
        if best.as_ref().is_none_or(|(least, ..)| error < *least) {
            best = Some((error, search, chosen));
        }
    }
    match best {
        Some((_, search, chosen)) => search.build_selection(course, chosen),
        None => Err(nothing_found()),
    }
}

/// What can be said of sensors that someone else chose.
///
/// # Errors
/// As the regression of blocks left out.
pub(super) fn describe_chosen(
    course: &Course,
    settings: SelectionSettings,
    chosen: Vec<usize>,
) -> Result<Selection, Refusal> {
    let candidates = (0..course.sensors().len()).collect();
    SensorSelection::new(course, settings, candidates).build_selection(course, chosen)
}

/// A selection in progress; columns of all sensors, condensed.
pub(super) struct SensorSelection {
    pub(super) settings: SelectionSettings,
    pub(super) candidates: Vec<usize>,
    columns: Vec<Column>,
    error_um: Vec<f64>,
    blocks: Vec<Range<usize>>,
}

impl SensorSelection {
    fn new(course: &Course, settings: SelectionSettings, candidates: Vec<usize>) -> Self {
        let (short, _) = course.condense_rows(&[], ROWS_MAX);
        let columns = short.sensors().iter().map(to_column).collect();
        let (error_um, blocks) = (short.error_um().to_vec(), short.split_into_blocks());
        Self { settings, candidates, columns, error_um, blocks }
    }

    /// The same with the state of every sensor in its place.
    fn with_lagged_states(course: &Course, settings: SelectionSettings, candidates: Vec<usize>, tau_s: f64) -> Self {
        let state =
            |sensor: &Sensor| Column::new(sensor.name.as_str(), compute_lagged_states(course, &sensor.values, tau_s));
        let states: Vec<Column> = course.sensors().iter().map(state).collect();
        let (short, columns) = course.condense_rows(&states, ROWS_MAX);
        let (error_um, blocks) = (short.error_um().to_vec(), short.split_into_blocks());
        Self { settings, candidates, columns, error_um, blocks }
    }

    fn select_columns(&self, sensors: &[usize]) -> Vec<Column> {
        sensors.iter().map(|at| self.columns[*at].clone()).collect()
    }

    /// Error in blocks left out; none where the remaining rows do not identify the coefficients.
    pub(super) fn score_sensors(&self, sensors: &[usize]) -> Option<HeldOut> {
        held_out(&self.select_columns(sensors), &self.error_um, &self.blocks).ok()
    }

    /// Greatest variance inflation, and condition number; none where the sensors are linearly dependent.
    pub(super) fn compute_inflation(&self, sensors: &[usize]) -> Option<(f64, f64)> {
        let target = Column::new(quantities::THERMAL_ERROR, self.error_um.clone());
        let fitted = fit_unweighted(&target, &self.select_columns(sensors), Intercept::Fitted).ok()?;
        let factors = fitted.coefficients.iter().filter_map(|coefficient| coefficient.variance_inflation);
        Some((factors.fold(1.0, f64::max), fitted.condition_number))
    }

    fn is_inflation_allowed(&self, sensors: &[usize]) -> bool {
        self.compute_inflation(sensors).is_some_and(|(inflation, _)| inflation <= self.settings.inflation_max)
    }

    fn choose_sensors(&self) -> Result<Vec<usize>, Refusal> {
        let mut chosen: Vec<usize> = Vec::new();
        let mut beam: Vec<Vec<usize>> = vec![Vec::new()];
        for size in 1..=self.settings.sensors_max {
            let longer = self.extend_lists(&beam);
            let Some(best) = longer.first() else { break };
            if self.is_better(best, &chosen) {
                chosen.clone_from(best);
            }
            // Every sensor alone goes on: two that are useless alone may be right together.
            beam = longer.into_iter().take(if size == 1 { usize::MAX } else { BEAM }).collect();
        }
        if !chosen.is_empty() {
            return Ok(chosen);
        }
        Err(nothing_found())
    }

    /// Every list with one more sensor that is not collinear, best first by the error of blocks left out.
    fn extend_lists(&self, lists: &[Vec<usize>]) -> Vec<Vec<usize>> {
        let mut longer: Vec<Vec<usize>> = Vec::new();
        for list in lists {
            let new = self.candidates.iter().filter(|at| !list.contains(at)).map(|at| with(list, *at));
            for list in new {
                if !longer.iter().any(|other| list.iter().all(|at| other.contains(at))) {
                    longer.push(list);
                }
            }
        }
        let scored = longer.into_iter().filter(|list| self.is_inflation_allowed(list));
        let mut scored: Vec<_> = scored.filter_map(|list| Some((self.score_sensors(&list)?.rms_um, list))).collect();
        scored.sort_by(|a, b| a.0.total_cmp(&b.0));
        scored.into_iter().map(|(_, list)| list).collect()
    }

    fn is_better(&self, list: &[usize], other: &[usize]) -> bool {
        let (Some(ours), Some(theirs)) = (self.score_sensors(list), self.score_sensors(other)) else { return false };
        ours.is_better_than(&theirs, self.settings.gain_min)
    }

    fn build_selection(&self, course: &Course, chosen: Vec<usize>) -> Result<Selection, Refusal> {
        let held_out = held_out(&self.select_columns(&chosen), &self.error_um, &self.blocks)?;
        let graded = Graded::from_course(course, &self.candidates, self.settings.rho);
        Ok(Selection {
            sensors: verdict::judge_sensors(self, course, &chosen, &graded),
            held_out_mean: cross_mean(&self.error_um, &self.blocks)?,
            condition_number: self.compute_inflation(&chosen).map_or(f64::MAX, |(_, condition)| condition),
            by_grades: graded
                .image
                .as_ref()
                .or(graded.range.as_ref())
                .map(|it| self.by_grades(course, it, chosen.len())),
            held_out,
            chosen,
        })
    }

    fn by_grades(&self, course: &Course, grades: &Grades, count: usize) -> GradeChoice {
        let names: Vec<String> = grades.order_sensors().into_iter().take(count.max(2)).map(str::to_owned).collect();
        let position = |name: &String| course.sensors().iter().position(|sensor| sensor.name == *name);
        let list: Vec<usize> = names.iter().filter_map(position).collect();
        let inflation = self.compute_inflation(&list);
        GradeChoice {
            variance_inflation: inflation.map(|it| it.0),
            condition_number: inflation.map(|it| it.1),
            held_out_rms_um: self.score_sensors(&list).map(|it| it.rms_um),
            sensors: names,
        }
    }
}

fn nothing_found() -> Refusal {
    let what = "no temperature predicts blocks that were left out better than the mean of the others does";
    let next = "record several warm-ups and cool-downs, with sensors near the spindle, the motor and the column";
    Refusal::new(RefusalKind::NotIdentifiable, what, next).with_place(quantities::THERMAL_ERROR)
}

fn cross_mean(error_um: &[f64], blocks: &[Range<usize>]) -> Result<HeldOut, Refusal> {
    held_out(&[], error_um, blocks)
}

pub(super) fn with(list: &[usize], sensor: usize) -> Vec<usize> {
    list.iter().copied().chain([sensor]).collect()
}

/// Grades of the usable sensors, where they can be had.
pub(super) struct Graded {
    pub(super) image: Option<Grades>,
    pub(super) range: Option<Grades>,
}

impl Graded {
    fn from_course(course: &Course, candidates: &[usize], rho: f64) -> Self {
        let series: Vec<Series<'_>> = candidates.iter().map(|at| course.sensors()[*at].as_series()).collect();
        let of = |normalisation| compute_grades(course.error_um(), &series, normalisation, rho).ok();
        Self { image: of(Normalisation::InitialImage), range: of(Normalisation::Range) }
    }
}

#[cfg(test)]
mod tests;
