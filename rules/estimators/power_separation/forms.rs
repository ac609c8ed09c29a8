//! How a1 goes with the spindle speed, found in cuts at two or more speeds of a gear stage.
//!
//! Two forms, each with one a0 and one a1 for all speeds: a1 the same at every speed, as the source of the method has it, and a1 with
//! `1 / n^2`, which is what the windings lose below the drive's base speed (the square of the torque `Pc / omega`). They have the same number of
//! parameters, so the one that leaves less is taken, without a test. Neither need be right: above the base speed, where the current goes
//! with the power again, or with iron losses that fall, each speed wants coefficients of its own, and the F test of
//! [`super::load_loss`] says so.
//!
//! A heavy cut scatters ten times as much as idling does, in watts. One residual for all would make what rests on the cuts look better known than
//! it is. Therefore the F test is made on the cuts alone, and the intervals are those of points that scatter unequally
//! ([`UnequalScatter`]).

use super::cuts::SteadyPoint;
use super::stretches::SAME_SPEED;
use crate::LoadLossLaw;
use crate::regression::{Column, FTest, Intercept, Refusal, Regression, UnequalScatter, fit_unweighted};
use numerics::statistics::count_to_f64;
use serde::Serialize;

/// What each form leaves, residual standard deviation, W.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FormResiduals {
    /// a1 the same at every speed.
    pub same_at_every_speed_w: f64,
    /// a1 that goes with 1/n^2, n the spindle speed.
    pub with_torque_squared_w: f64,
}

/// The form that leaves less, fitted.
pub(super) struct FittedLoss {
    pub(super) regression: Regression,
    /// Speed at which a1 is as fitted; `None` where it is the same at every speed, or only one is known.
    pub(super) speed_rpm: Option<f64>,
    /// Of both forms, where there are two speeds to tell them apart.
    pub(super) residuals: Option<FormResiduals>,
    /// Variances of combinations of `1 + a0` and a1.
    pub(super) scatter: UnequalScatter,
    /// Where a0 stands among the coefficients; a1 follows.
    at: usize,
}

impl FittedLoss {
    pub(super) fn load_loss(&self) -> LoadLossLaw {
        LoadLossLaw {
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
pub(super) fn fit_best_form(points: &[&SteadyPoint], speeds: &[f64]) -> Result<FittedLoss, Refusal> {
    let at = speeds.len();
    let of_form = |speed_rpm: Option<f64>| {
        let (power, columns) = build_design(points, speeds, speed_rpm, false);
        let regression = fit_unweighted(&power, &columns, Intercept::None)?;
        let scatter = UnequalScatter::new(&regression, &columns, &[at, at + 1]);
        Ok::<_, Refusal>(FittedLoss { regression, speed_rpm, residuals: None, scatter, at })
    };
    let same = of_form(None)?;
    if at < 2 {
        return Ok(same);
    }
    let torque = of_form(Some(speeds.iter().sum::<f64>() / count_to_f64(at)))?;
    let (same_sd_w, torque_sd_w) = (same.regression.residual_sd, torque.regression.residual_sd);
    let residuals = Some(FormResiduals { same_at_every_speed_w: same_sd_w, with_torque_squared_w: torque_sd_w });
    // Where both leave the same, the source's form holds.
    let better = if torque_sd_w < same_sd_w { torque } else { same };
    Ok(FittedLoss { residuals, ..better })
}

/// Do the speeds want coefficients of their own? On the cuts alone, each less the no-load power of its speed. `None` for one speed,
/// or for too few cuts.
pub(super) fn by_speed(points: &[&SteadyPoint], speeds: &[f64], together: &FittedLoss) -> Option<FTest> {
    if speeds.len() < 2 {
        return None;
    }
    let cuts: Vec<&SteadyPoint> = points.iter().copied().filter(|point| point.cut).collect();
    let (mut power, shorter) = build_design(&cuts, speeds, together.speed_rpm, false);
    let (_, longer) = build_design(&cuts, speeds, None, true);
    for (power_w, cut) in power.values.iter_mut().zip(&cuts) {
        let at = speeds.iter().position(|speed| is_same_speed(*speed, cut.speed_rpm))?;
        *power_w -= together.regression.coefficients[at].value;
    }
    let fit_of = |columns: &[Column]| fit_unweighted(&power, &columns[speeds.len()..], Intercept::None).ok();
    fit_of(&longer)?.test_against(&fit_of(&shorter)?)
}

/// The spindle power, and the columns: no-load power of each speed, then Pc and Pc^2, for all speeds together or for each. `speed_rpm`: where a1 is stated, if it
/// goes with 1/n^2.
fn build_design(points: &[&SteadyPoint], speeds: &[f64], speed_rpm: Option<f64>, each: bool) -> (Column, Vec<Column>) {
    let used: Vec<&&SteadyPoint> =
        points.iter().filter(|point| speeds.iter().any(|it| is_same_speed(*it, point.speed_rpm))).collect();
    let column =
        |name: String, of: &dyn Fn(&SteadyPoint) -> f64| Column::new(name, used.iter().map(|it| of(it)).collect());
    let at = |speed: f64, point: &SteadyPoint| f64::from(u8::from(is_same_speed(speed, point.speed_rpm)));
    let unit = LoadLossLaw { linear: 0.0, quadratic_per_w: 1.0, speed_rpm };
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
    (y, columns)
}

pub(super) fn is_same_speed(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() <= SAME_SPEED
}
