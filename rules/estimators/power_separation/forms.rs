//! How a1 goes with the spindle speed, found in cuts at two or more speeds of a gear stage.
//!
//! Two forms, each with one a0 and one a1 for all speeds: a1 the same at every speed, as the source of the method has it, and a1 with
//! `1 / n^2`, which is what the windings lose below the drive's base speed (the square of the torque `Pc / omega`). They have the same number of
//! parameters, so the one that leaves less is taken, without a test. Neither need be right: above the base speed, where the current goes
//! with the power again, or with iron losses that fall, each speed wants coefficients of its own, and the F test of
//! [`super::load_loss`] says so.

use super::cuts::SteadyPoint;
use super::load_loss::near;
use crate::estimators::LoadLoss;
use crate::estimators::regression::{Column, Intercept, Refusal, Regression, fit};
use crate::statistics::count;
use serde::Serialize;

/// What each form leaves, residual standard deviation, W.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FormResiduals {
    /// a1 the same at every speed.
    pub same_at_every_speed_w: f64,
    /// a1 with 1/n^2.
    pub with_torque_squared_w: f64,
}

/// The form that leaves less, fitted.
pub(super) struct Fitted {
    pub(super) regression: Regression,
    /// Speed at which a1 is as fitted; `None` where it is the same at every speed, or only one is known.
    pub(super) speed_rpm: Option<f64>,
    /// Of both forms, where there are two speeds to tell them apart.
    pub(super) residuals: Option<FormResiduals>,
    /// Where a0 stands among the coefficients; a1 follows.
    at: usize,
}

impl Fitted {
    /// The coefficients.
    pub(super) fn load_loss(&self) -> LoadLoss {
        LoadLoss {
            linear: self.regression.coefficients[self.at].value - 1.0,
            quadratic_per_w: self.regression.coefficients[self.at + 1].value,
            speed_rpm: self.speed_rpm,
        }
    }
}

/// Fits both forms and takes the one that leaves less; a1 that goes with 1/n^2 is that at the mean of the speeds.
///
/// # Errors
/// Columns that cannot be told apart, too few points.
pub(super) fn fitted(points: &[&SteadyPoint], speeds: &[f64]) -> Result<Fitted, Refusal> {
    let at = speeds.len();
    let same = regression(points, speeds, None, false)?;
    if at < 2 {
        return Ok(Fitted { regression: same, speed_rpm: None, residuals: None, at });
    }
    let mean_rpm = speeds.iter().sum::<f64>() / count(at);
    let torque = regression(points, speeds, Some(mean_rpm), false)?;
    let residuals =
        Some(FormResiduals { same_at_every_speed_w: same.residual_sd, with_torque_squared_w: torque.residual_sd });
    // Where both leave the same, the source's form holds.
    let (regression, speed_rpm) =
        if torque.residual_sd < same.residual_sd { (torque, Some(mean_rpm)) } else { (same, None) };
    Ok(Fitted { regression, speed_rpm, residuals, at })
}

/// Columns: no-load power of each speed, then Pc and Pc^2, for all speeds together or for each. `speed_rpm`: where a1 is stated, if it
/// goes with 1/n^2.
pub(super) fn regression(
    points: &[&SteadyPoint],
    speeds: &[f64],
    speed_rpm: Option<f64>,
    each: bool,
) -> Result<Regression, Refusal> {
    let used: Vec<&&SteadyPoint> =
        points.iter().filter(|point| speeds.iter().any(|it| near(*it, point.speed_rpm))).collect();
    let column =
        |name: String, of: &dyn Fn(&SteadyPoint) -> f64| Column::new(name, used.iter().map(|it| of(it)).collect());
    let at = |speed: f64, point: &SteadyPoint| f64::from(u8::from(near(speed, point.speed_rpm)));
    let unit = LoadLoss { linear: 0.0, quadratic_per_w: 1.0, speed_rpm };
    let y = column("spindle_power_w".to_owned(), &|point| point.power.mean);
    let mut columns: Vec<Column> =
        speeds.iter().map(|speed| column(format!("no-load {speed:.0} rpm"), &|point| at(*speed, point))).collect();
    let groups: Vec<Option<f64>> = if each { speeds.iter().copied().map(Some).collect() } else { vec![None] };
    for group in groups {
        let inside = |point: &SteadyPoint| group.map_or(1.0, |speed| at(speed, point));
        let name = group.map_or_else(String::new, |speed| format!(" {speed:.0} rpm"));
        columns.push(column(format!("Pc{name}"), &|point| inside(point) * point.cutting_power_w));
        let square = |point: &SteadyPoint| point.cutting_power_w.powi(2) * unit.quadratic_at(point.speed_rpm);
        columns.push(column(format!("Pc^2{name}"), &|point| inside(point) * square(point)));
    }
    fit(&y, &columns, Intercept::None)
}
