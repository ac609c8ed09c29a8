//! Multiple linear regression of a thermal error on temperatures, with intervals that hold although errors remember.
//!
//! `E = b0 + sum b_j T_j`, E in um, T in °C. Source: thermal error with 13 temperature points (multiple linear regression
//! by least squares). What the source leaves out: its residuals are taken as independent, which they never are.

use super::course::{Course, Sensor};
use super::law::{Path, ThermalLaw, ThermalTerm};
use super::noise::{self, Averaged};
use super::quantities::{self, THERMAL_ERROR};
use crate::regression::{Coefficient, Column, Intercept, Refusal, Regression, fit_unweighted, t_quantile, t_two_sided};
use numerics::statistics::rms;
use serde::Serialize;

/// Rows that a regression under memory works on; more are averaged first.
pub(super) const ROWS_MAX: usize = 1500;

/// The probability that an interval covers, and that all intervals of a law cover together.
const CONFIDENCE: f64 = 0.95;

/// How the residuals remember.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Autocorrelation {
    /// Time after which the slow part has forgotten, s.
    pub memory_s: f64,
    /// Share of the variance that is white.
    pub white_share: f64,
    /// Independent rows that would tell as much about a level.
    pub effective_rows: f64,
}

/// One coefficient of a thermal law.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ThermalCoefficient {
    /// `intercept`, a sensor, `late(sensor)` for a lagged one, or `tau_s`.
    #[serde(flatten)]
    pub own: Coefficient,
    /// Ends of the interval that covers together with those of all other coefficients in 95 of 100 cases (Bonferroni).
    pub joint_interval: (f64, f64),
}

/// A fitted law with what it takes to believe it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ThermalFit {
    /// The law with its covariance, as a file holds it.
    #[serde(skip)]
    pub law: ThermalLaw,
    /// Coefficients with intervals that respect the memory of the residuals.
    pub coefficients: Vec<ThermalCoefficient>,
    /// How the residuals remember.
    pub memory: Autocorrelation,
    /// Root mean square of the residuals, um.
    pub residual_rms_um: f64,
    /// Share of the variance explained.
    pub r2: f64,
    /// The same with the number of coefficients taken into account.
    pub adjusted_r2: f64,
    /// Belsley's condition number of the columns.
    pub condition_number: f64,
    /// How many rows were fitted.
    pub rows: usize,
    /// Measured less fitted, row by row, um.
    #[serde(skip)]
    pub residuals_um: Vec<f64>,
    /// Best log likelihood, to compare laws of the same rows.
    #[serde(skip)]
    pub likelihood: f64,
}

/// Fits the error on these sensors (positions in the course), as they are.
///
/// # Errors
/// A [`Refusal`]: what is wrong with the rows, sensors that say the same, too few rows that are independent.
pub fn fit_static(course: &Course, sensors: &[usize]) -> Result<ThermalFit, Refusal> {
    course.check_sensors(sensors)?;
    let columns: Vec<Column> = sensors.iter().map(|at| to_column(&course.sensors()[*at])).collect();
    let paths = vec![Path::Direct; sensors.len()];
    fit_design(&RegressionDesign { course, sensors, paths: &paths, columns, nuisance: Vec::new(), tau: None })
}

/// A temperature as a column.
pub(super) fn to_column(sensor: &Sensor) -> Column {
    Column::new(sensor.name.as_str(), sensor.values.clone())
}

/// Everything that a law is fitted with; `columns` stand for the sensors, `nuisance` is fitted along and not kept.
pub(super) struct RegressionDesign<'a> {
    pub(super) course: &'a Course,
    pub(super) sensors: &'a [usize],
    pub(super) paths: &'a [Path],
    pub(super) columns: Vec<Column>,
    pub(super) nuisance: Vec<Column>,
    pub(super) tau: Option<Tau>,
}

/// A time constant that was searched for, with the derivative of the law by its logarithm.
pub(super) struct Tau {
    pub(super) tau_s: f64,
    pub(super) spread_k: f64,
    pub(super) by_log_tau: Column,
}

impl Tau {
    /// The time constant that the linearised fit suggests; one step never more than halves or doubles it.
    fn better_s(&self, averaged: &Averaged, at: usize) -> f64 {
        self.tau_s * averaged.values[at].clamp(-std::f64::consts::LN_2, std::f64::consts::LN_2).exp()
    }
}

impl RegressionDesign<'_> {
    /// The constant, the terms, then what is not kept.
    fn build_all_columns(&self) -> Vec<Column> {
        let ones = Column::new("intercept", vec![1.0; self.course.rows()]);
        let tau = self.tau.iter().map(|tau| tau.by_log_tau.clone());
        let kept = std::iter::once(ones).chain(self.columns.iter().cloned());
        kept.chain(tau).chain(self.nuisance.iter().cloned()).collect()
    }

    fn count_terms(&self) -> usize {
        self.columns.len()
    }
}

/// The fit of a design.
///
/// # Errors
/// As the regression.
pub(super) fn fit_design(design: &RegressionDesign<'_>) -> Result<ThermalFit, Refusal> {
    let target = Column::new(THERMAL_ERROR, design.course.error_um().to_vec());
    let others: Vec<Column> = design.columns.iter().chain(&design.nuisance).cloned().collect();
    let plain = fit_unweighted(&target, &others, Intercept::Fitted)?;
    let (short, columns) = design.course.condense_rows(&design.build_all_columns(), ROWS_MAX);
    let averaged = noise::average_over_noises(&short, &columns, short.error_um())?;
    let coefficients = build_coefficients(design, &plain, &averaged);
    let fitted = |row: usize| {
        let terms = design.columns.iter().zip(&averaged.values[1..]).map(|(c, b)| b * c.values[row]).sum::<f64>();
        let rest = averaged.values.len() - design.nuisance.len();
        let nuisance = design.nuisance.iter().zip(&averaged.values[rest..]).map(|(c, b)| b * c.values[row]);
        averaged.values[0] + terms + nuisance.sum::<f64>()
    };
    let error = design.course.error_um().iter().enumerate();
    let residuals_um: Vec<f64> = error.map(|(row, error)| error - fitted(row)).collect();
    let law = build_law(design, &averaged, &coefficients, &residuals_um);
    Ok(ThermalFit {
        law,
        coefficients,
        memory: Autocorrelation {
            memory_s: averaged.memory_s,
            white_share: averaged.white,
            effective_rows: averaged.effective_rows,
        },
        residual_rms_um: rms(&residuals_um),
        r2: plain.r2,
        adjusted_r2: plain.adjusted_r2,
        condition_number: plain.condition_number,
        rows: design.course.rows(),
        residuals_um,
        likelihood: averaged.likelihood,
    })
}

fn build_coefficients(
    design: &RegressionDesign<'_>,
    plain: &Regression,
    averaged: &Averaged,
) -> Vec<ThermalCoefficient> {
    let df = averaged.degrees_of_freedom;
    let count = 1 + design.count_terms() + usize::from(design.tau.is_some());
    let own = t_quantile(0.5 + 0.5 * CONFIDENCE, df);
    let joint = t_quantile(1.0 - 0.5 * (1.0 - CONFIDENCE) / count as f64, df);
    let around = |value: f64, half: f64| (value - half, value + half);
    let mut all: Vec<ThermalCoefficient> = (0..=design.count_terms())
        .map(|at| {
            let (value, sd) = (averaged.values[at], averaged.covariance[at][at].max(0.0).sqrt());
            let p = if sd > 0.0 { t_two_sided(value / sd, df) } else { 0.0 };
            let variance_inflation = plain.coefficients[at].variance_inflation;
            let name = if at == 0 { "intercept".to_owned() } else { format_term_name(design, at - 1) };
            let interval = around(value, own * sd);
            let own = Coefficient { name, value, standard_error: sd, interval, p, variance_inflation };
            ThermalCoefficient { own, joint_interval: around(value, joint * sd) }
        })
        .collect();
    if let Some(tau) = &design.tau {
        let at = 1 + design.count_terms();
        let sd = averaged.covariance[at][at].max(0.0).sqrt();
        let tau_s = tau.better_s(averaged, at);
        let times = |factor: f64| (tau_s * (-factor * sd).exp(), tau_s * (factor * sd).exp());
        all.push(ThermalCoefficient {
            own: Coefficient {
                name: "tau_s".to_owned(),
                value: tau_s,
                standard_error: tau_s * sd,
                interval: times(own),
                p: if sd > 0.0 { t_two_sided(1.0 / sd, df) } else { 0.0 },
                variance_inflation: None,
            },
            joint_interval: times(joint),
        });
    }
    all
}

fn format_term_name(design: &RegressionDesign<'_>, term: usize) -> String {
    let sensor = &design.course.sensors()[design.sensors[term]].name;
    if design.paths[term] == Path::Lagged { format!("late({sensor})") } else { sensor.clone() }
}

fn build_law(
    design: &RegressionDesign<'_>,
    averaged: &Averaged,
    all: &[ThermalCoefficient],
    residuals: &[f64],
) -> ThermalLaw {
    let size = 1 + design.count_terms();
    let covariance: Vec<Vec<f64>> = averaged.covariance[..size].iter().map(|row| row[..size].to_vec()).collect();
    let term = |at: usize| ThermalTerm {
        sensor: design.course.sensors()[design.sensors[at]].name.clone(),
        path: design.paths[at],
        um_per_k: averaged.values[at + 1],
        interval: all[at + 1].own.interval,
        range_c: quantities::find_extremes(&design.course.sensors()[design.sensors[at]].values),
    };
    let tau = design.tau.as_ref();
    let mut law = ThermalLaw {
        intercept_um: averaged.values[0],
        intercept_interval: all[0].own.interval,
        tau_s: tau.map(|tau| tau.better_s(averaged, size)),
        tau_interval_s: tau.and_then(|_| all.last()).map(|tau| tau.own.interval),
        residual_sd_um: rms(residuals),
        law_sd_max_um: 0.0,
        lag_spread_k: tau.map_or(0.0, |tau| tau.spread_k),
        terms: (0..design.count_terms()).map(term).collect(),
        covariance,
    };
    let point =
        |row: usize| std::iter::once(1.0).chain(design.columns.iter().map(|c| c.values[row])).collect::<Vec<f64>>();
    law.law_sd_max_um = (0..design.course.rows()).map(|row| law.law_sd_um(&point(row))).fold(0.0, f64::max);
    law
}

#[cfg(test)]
pub(super) mod tests;
