//! The same law late: the structure warms later than its sensors, so the error draws a loop over temperature.
//!
//! `E = b0 + sum b_j w_j` with `dw_j/dt = (T_j - w_j) / tau`, in one of two forms: every sensor late, or the first sensor
//! both as it is and late (which also follows an error that is ahead of its sensor). For every tau the law is linear, so
//! tau is searched for alone (variable projection); its interval comes from the derivative of the law by its
//! logarithm, fitted along with the coefficients. States run on true time stamps, through pauses in a
//! straight line from the last temperature to the first one after; how they stood at the first row is fitted and not kept.
//! Sources: Golub and Pereyra (1973), SIAM J. Numer. Anal. 10:413; static regression "not satisfied", a model with memory
//! 94 %: 10.1177/0954405414556499.

use super::course::Course;
use super::cross_validation::{HeldOut, compute_squared_errors, exclude_block, train_outside_block};
use super::law::{Path, first_order};
use super::quantities::THERMAL_ERROR;
use super::regression::{ROWS_MAX, RegressionDesign, Tau, ThermalFit, fit_design, to_column};
use crate::regression::{Column, Intercept, Refusal, RefusalKind, fit_unweighted};
use numerics::statistics::rms;
use std::ops::Range;

/// Which terms are late.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LagForm {
    All,
    /// The first one as it is and late, the others as they are.
    FirstTwice,
}

/// Time constants that are tried: from a few rows to half of the longest run, in these many steps.
const TAUS: i32 = 18;
/// Steps of narrowing down after that.
const NARROW: usize = 24;
/// The derivative by the logarithm of tau is a difference over this much.
const STEP: f64 = 0.01;
/// Times the error is linearised anew.
const ROUNDS: usize = 4;

/// Fits the law with lags on these sensors.
///
/// # Errors
/// A [`Refusal`]: pauses that are not known, runs too short for any time constant, and all that stops a regression.
pub(super) fn fit_lagged(course: &Course, sensors: &[usize], form: LagForm) -> Result<ThermalFit, Refusal> {
    course.check_sensors(sensors)?;
    known_pauses(course)?;
    let law = LaggedCourse { course, sensors, form };
    let mut tau_s = law.search_tau()?;
    let mut fit = law.fit_at_tau(tau_s)?;
    for _ in 0..ROUNDS {
        let Some(better_s) = fit.law.tau_s else { break };
        let moved = (better_s / tau_s).ln();
        tau_s = better_s.clamp(law.tau_bounds_s().0, law.tau_bounds_s().1);
        fit = law.fit_at_tau(tau_s)?;
        if moved.abs() < 1e-3 {
            break;
        }
    }
    Ok(fit)
}

fn known_pauses(course: &Course) -> Result<(), Refusal> {
    if course.pauses_known() {
        return Ok(());
    }
    let what = "the pauses between runs are not known, so how far the structure cooled meanwhile is not either";
    let next = "record with time_utc, or with a time_s that goes on from run to run";
    Err(Refusal::new(RefusalKind::Missing, what, next).with_place("time_s"))
}

/// The first-order state of a temperature along the clock of the course; it begins at the first temperature.
pub(super) fn compute_lagged_states(course: &Course, values: &[f64], tau_s: f64) -> Vec<f64> {
    let mut states = Vec::with_capacity(values.len());
    let mut state = values.first().copied().unwrap_or(0.0);
    for (row, value) in values.iter().enumerate() {
        state = match course.since_s(row) {
            Some(dt_s) => first_order(state, values[row - 1], *value, dt_s, tau_s),
            None => *value,
        };
        states.push(state);
    }
    states
}

/// A few time constants over the range that is tried.
pub(super) fn some_taus(course: &Course) -> Result<Vec<f64>, Refusal> {
    known_pauses(course)?;
    let all = LaggedCourse { course, sensors: &[], form: LagForm::All }.list_taus()?;
    Ok(all.into_iter().skip(1).step_by(2).collect())
}

struct LaggedCourse<'a> {
    course: &'a Course,
    sensors: &'a [usize],
    form: LagForm,
}

impl LaggedCourse<'_> {
    fn tau_bounds_s(&self) -> (f64, f64) {
        (2.0 * self.course.period_s(), 0.5 * self.course.longest_s())
    }

    fn list_taus(&self) -> Result<Vec<f64>, Refusal> {
        let (least, greatest) = self.tau_bounds_s();
        if greatest <= 4.0 * least {
            let what = format!("the longest run lasts {:.0} s at one row in {:.0} s", 2.0 * greatest, 0.5 * least);
            let next = "record runs of an hour or more, at least one row a minute";
            return Err(Refusal::new(RefusalKind::TooFew, what, next).with_place("time_s"));
        }
        let ratio = (greatest / least).powf(1.0 / f64::from(TAUS - 1));
        Ok((0..TAUS).map(|step| least * ratio.powi(step)).collect())
    }

    /// Columns of the terms, in the order of [`LaggedCourse::list_terms`].
    fn build_columns(&self, tau_s: f64) -> Vec<Column> {
        let sensor = |at: &usize| &self.course.sensors()[*at];
        let direct = |at: &usize| to_column(sensor(at));
        let state = |at: &usize| {
            let name = format!("late({})", sensor(at).name);
            Column::new(name, compute_lagged_states(self.course, &sensor(at).values, tau_s))
        };
        match self.form {
            LagForm::All => self.sensors.iter().map(state).collect(),
            LagForm::FirstTwice => self.sensors.iter().map(direct).chain(self.sensors.first().map(state)).collect(),
        }
    }

    /// Sensor and path of every term.
    fn list_terms(&self) -> (Vec<usize>, Vec<Path>) {
        let mut sensors = self.sensors.to_vec();
        let path = if self.form == LagForm::All { Path::Lagged } else { Path::Direct };
        let mut paths = vec![path; sensors.len()];
        if let (LagForm::FirstTwice, Some(first)) = (self.form, self.sensors.first()) {
            sensors.push(*first);
            paths.push(Path::Lagged);
        }
        (sensors, paths)
    }

    /// What is left of a state that did not begin at the first temperature.
    fn build_beginning_column(&self, tau_s: f64) -> Column {
        let clock_s = self.course.clock_s();
        let left = |at: &f64| (-(at - clock_s[0]) / tau_s).exp();
        Column::new("beginning", clock_s.iter().map(left).collect())
    }

    /// The time constant with the least sum of squares.
    fn search_tau(&self) -> Result<f64, Refusal> {
        let taus = self.list_taus()?;
        let squares = |tau_s: f64| {
            let (short, columns) = self.course.condense_rows(&self.build_all_columns(tau_s), ROWS_MAX / 3);
            let target = Column::new(THERMAL_ERROR, short.error_um().to_vec());
            Ok(fit_unweighted(&target, &columns, Intercept::None)?.rss)
        };
        let tried = taus.iter().map(|tau_s| Ok((*tau_s, squares(*tau_s)?))).collect::<Result<Vec<_>, Refusal>>()?;
        let least = tried.iter().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(taus[0], |(tau_s, _)| *tau_s);
        let ratio = taus[1] / taus[0];
        minimise_by_golden_section(least / ratio, least * ratio, squares)
    }

    /// Constant, terms and beginning.
    fn build_all_columns(&self, tau_s: f64) -> Vec<Column> {
        let ones = Column::new("intercept", vec![1.0; self.course.rows()]);
        std::iter::once(ones).chain(self.build_columns(tau_s)).chain([self.build_beginning_column(tau_s)]).collect()
    }

    /// The fit linearised at `tau_s`; the law in it has the tau that this suggests.
    fn fit_at_tau(&self, tau_s: f64) -> Result<ThermalFit, Refusal> {
        let columns = self.build_columns(tau_s);
        let (short, whole) = self.course.condense_rows(&self.build_all_columns(tau_s), ROWS_MAX / 3);
        let target = Column::new(THERMAL_ERROR, short.error_um().to_vec());
        let white = fit_unweighted(&target, &whole, Intercept::None)?.values();
        let (more, less) = (self.build_columns(tau_s * STEP.exp()), self.build_columns(tau_s * (-STEP).exp()));
        let slope = |row: usize| {
            let terms = white[1..].iter().zip(more.iter().zip(&less));
            terms.map(|(b, (more, less))| b * (more.values[row] - less.values[row]) / (2.0 * STEP)).sum::<f64>()
        };
        let by_log_tau = Column::new("tau_s", (0..self.course.rows()).map(slope).collect());
        let (sensors, paths) = self.list_terms();
        let tau = Tau { tau_s, spread_k: self.spread_k(tau_s), by_log_tau };
        let nuisance = vec![self.build_beginning_column(tau_s)];
        fit_design(&RegressionDesign {
            course: self.course,
            sensors: &sensors,
            paths: &paths,
            columns,
            nuisance,
            tau: Some(tau),
        })
    }

    /// Root mean square of what temperatures and states differ by.
    fn spread_k(&self, tau_s: f64) -> f64 {
        let differences = self.sensors.iter().flat_map(|at| {
            let values = &self.course.sensors()[*at].values;
            let states = compute_lagged_states(self.course, values, tau_s);
            values.iter().zip(states).map(|(value, state)| value - state).collect::<Vec<f64>>()
        });
        rms(&differences.collect::<Vec<f64>>())
    }
}

/// Where a function of a positive number is least, by golden section over its logarithm.
fn minimise_by_golden_section(
    least: f64,
    greatest: f64,
    of: impl Fn(f64) -> Result<f64, Refusal>,
) -> Result<f64, Refusal> {
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let (mut low, mut high) = (least.ln(), greatest.ln());
    for _ in 0..NARROW {
        let (left, right) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
        if of(left.exp())? < of(right.exp())? { high = right } else { low = left }
    }
    Ok((0.5 * (low + high)).exp())
}

/// Errors of blocks left out; each block searches its own time constant in the others.
///
/// # Errors
/// As the fit.
pub(super) fn held_out_lagged(
    course: &Course,
    sensors: &[usize],
    form: LagForm,
    rows_max: usize,
) -> Result<HeldOut, Refusal> {
    let law = LaggedCourse { course, sensors, form };
    let taus = law.list_taus()?;
    let mut error_um = Vec::new();
    let mut blocks = Vec::new();
    let mut designs = Vec::new();
    for tau_s in taus {
        let columns: Vec<Column> =
            law.build_columns(tau_s).into_iter().chain([law.build_beginning_column(tau_s)]).collect();
        let (short, columns) = course.condense_rows(&columns, rows_max);
        (error_um, blocks) = (short.error_um().to_vec(), short.split_into_blocks());
        designs.push(columns);
    }
    let squares =
        blocks.iter().map(|block| one_block(&designs, &error_um, block)).collect::<Result<Vec<_>, Refusal>>()?;
    Ok(HeldOut::from_squares(&squares))
}

/// Squared errors of one block with the time constant that suits the other rows best.
fn one_block(designs: &[Vec<Column>], error_um: &[f64], block: &Range<usize>) -> Result<Vec<f64>, Refusal> {
    let mut best: Option<(f64, Vec<f64>)> = None;
    let mut refused = None;
    for columns in designs {
        // The beginning of the states is forgotten in most blocks, and then cannot be fitted.
        let terms = columns.len() - 1;
        let left = exclude_block(&columns[terms].values, block).iter().fold(0.0_f64, |most, x| most.max(*x));
        let count = if left > 0.05 { terms + 1 } else { terms };
        match train_outside_block(&columns[..count], error_um, block) {
            Ok(coefficients) => {
                let rest: f64 = [0..block.start, block.end..error_um.len()]
                    .iter()
                    .flat_map(|rows| compute_squared_errors(&coefficients, columns, error_um, rows))
                    .sum();
                if best.as_ref().is_none_or(|(least, _)| rest < *least) {
                    best = Some((rest, compute_squared_errors(&coefficients, columns, error_um, block)));
                }
            }
            Err(refusal) => refused = Some(refusal),
        }
    }
    let none = || Refusal::new(RefusalKind::TooFew, "no time constant can be tried", "record longer runs");
    best.map(|(_, squares)| squares).ok_or_else(|| refused.unwrap_or_else(none))
}

#[cfg(test)]
mod tests;
