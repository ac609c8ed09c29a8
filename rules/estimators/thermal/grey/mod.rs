//! Grey relational grades: how alike two curves run, each made dimensionless first.
//!
//! `xi_i(k) = (m + rho M) / (|y'(k) - x'_i(k)| + rho M)` with `m` and `M` the least and greatest difference over all
//! sensors and rows; the grade of a sensor is the mean of its `xi`. Source: thermal error with 13 temperature points
//! (initial image `x'(k) = x(k) / x(1)`; rho is not printed there, 0.5 is usual).
//!
//! Known weakness: with the initial image the winner is the sensor with the greatest relative rise, whatever its dynamics,
//! and the grades hang on the first value of the error; the range `x'(k) = (x(k) - min) / (max - min)` has neither fault.
//! A grade is therefore shown, and never decides alone: see `selection`.

use super::quantities::{self, Series};
use crate::regression::{Refusal, RefusalKind};
use serde::{Deserialize, Serialize};

/// How a curve is made dimensionless.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Normalisation {
    /// Divided by its first value: every curve begins at 1.
    InitialImage,
    /// From 0 at its least to 1 at its greatest value; a curve that falls while the error rises is turned over.
    Range,
}

/// The grade of one sensor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Grade {
    /// Name of the sensor.
    pub sensor: String,
    /// 0 to 1; 1 is the same curve.
    pub grade: f64,
    /// 1 is the best; equal grades share the better rank.
    pub rank: usize,
}

/// Grades of all sensors, in the order given.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Grades {
    /// How the curves were made dimensionless.
    pub normalisation: Normalisation,
    /// The resolution coefficient rho of every grade; usually [`RHO_USUAL`].
    pub rho: f64,
    /// One grade per sensor.
    pub grades: Vec<Grade>,
}

/// The usual resolution coefficient; the source does not print its own.
pub const RHO_USUAL: f64 = 0.5;

/// A first value must be at least this share of what the series spans: dividing by less makes the grades arbitrary.
const FIRST_SHARE_MIN: f64 = 0.05;

/// Differences of dimensionless curves that rounding alone makes.
const SAME: f64 = 1e-12;

impl Grades {
    /// Names of the sensors, best first.
    #[must_use]
    pub fn order_sensors(&self) -> Vec<&str> {
        let mut sorted: Vec<&Grade> = self.grades.iter().collect();
        sorted.sort_by(|a, b| b.grade.total_cmp(&a.grade));
        sorted.into_iter().map(|grade| grade.sensor.as_str()).collect()
    }
}

/// Grades of temperature sensors (°C) against the thermal error (um); `rho` above 0 and at most 1.
///
/// # Errors
/// A [`Refusal`] that says what is wrong with which series: too short, not finite, constant, in kelvin or millimetres, of
/// another length, or, for the initial image, a first value by which nothing can be divided.
pub fn compute_grades(
    error_um: &[f64],
    sensors: &[Series<'_>],
    normalisation: Normalisation,
    rho: f64,
) -> Result<Grades, Refusal> {
    if !(rho > 0.0 && rho <= 1.0) {
        let next = "give a resolution coefficient above 0 and at most 1; 0.5 is usual";
        return Err(Refusal::new(RefusalKind::OutOfRange, format!("rho = {rho}"), next));
    }
    quantities::check_series(error_um, sensors)?;
    let error = normalise_values(quantities::THERMAL_ERROR, error_um, normalisation)?;
    let curves: Vec<Vec<f64>> = sensors
        .iter()
        .map(|sensor| {
            normalise_values(sensor.name, sensor.values, normalisation)
                .map(|curve| orient_curve(curve, &error, normalisation))
        })
        .collect::<Result<_, _>>()?;
    Ok(Grades { normalisation, rho, grades: rank_grades(sensors, &compute_relational_grades(&error, &curves, rho)) })
}

fn normalise_values(name: &str, values: &[f64], normalisation: Normalisation) -> Result<Vec<f64>, Refusal> {
    let (least, greatest) = quantities::find_extremes(values);
    let span = greatest - least;
    if normalisation == Normalisation::Range {
        return Ok(values.iter().map(|value| (value - least) / span).collect());
    }
    let first = values[0];
    if least < 0.0 && greatest > 0.0 {
        let what =
            format!("runs from {least:.3} to {greatest:.3}: beyond zero a multiple of the first value is no rise");
        return Err(Refusal::new(RefusalKind::OutOfRange, what, "use the range normalisation").with_place(name));
    }
    if first.abs() < FIRST_SHARE_MIN * span {
        let what = format!("begins at {first:.3} and spans {span:.3}: divided by its first value it means nothing");
        let next = "use the range normalisation, or do not set the error to zero at the start";
        return Err(Refusal::new(RefusalKind::OutOfRange, what, next).with_place(name));
    }
    Ok(values.iter().map(|value| value / first).collect())
}

/// A curve that runs against the error is turned over; only the range allows it.
fn orient_curve(curve: Vec<f64>, error: &[f64], normalisation: Normalisation) -> Vec<f64> {
    if normalisation == Normalisation::InitialImage || quantities::correlate_series(&curve, error) >= 0.0 {
        return curve;
    }
    curve.into_iter().map(|value| 1.0 - value).collect()
}

fn compute_relational_grades(error: &[f64], curves: &[Vec<f64>], rho: f64) -> Vec<f64> {
    let differences = |curve: &Vec<f64>| error.iter().zip(curve).map(|(y, x)| (y - x).abs()).collect::<Vec<f64>>();
    let all: Vec<Vec<f64>> = curves.iter().map(differences).collect();
    let (least, greatest) = quantities::find_extremes(&all.concat());
    let resolution = rho * greatest;
    let grade = |delta: &Vec<f64>| {
        let xi = delta.iter().map(|delta| (least + resolution) / (delta + resolution));
        xi.sum::<f64>() / delta.len() as f64
    };
    // Every curve is the error itself, but for rounding: nothing to resolve.
    if greatest < SAME { vec![1.0; all.len()] } else { all.iter().map(grade).collect() }
}

fn rank_grades(sensors: &[Series<'_>], values: &[f64]) -> Vec<Grade> {
    let rank = |value: f64| 1 + values.iter().filter(|other| **other > value).count();
    let grade = |(sensor, value): (&Series<'_>, &f64)| Grade {
        sensor: sensor.name.to_owned(),
        grade: *value,
        rank: rank(*value),
    };
    sensors.iter().zip(values).map(grade).collect()
}

#[cfg(test)]
mod tests;
