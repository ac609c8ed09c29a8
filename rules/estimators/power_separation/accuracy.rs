//! Accuracy of the separation, as its source defines it: `E = |Pc estimated - Pc measured| / Pc measured`, per group of cuts.
//!
//! A group is one steady cut; its means stand for it, as in the source's own numbers. Coefficients for a group are learned from
//! the other cuts, and with them the form of a1 over the speed, so that no cut judges numbers that were made of it. Beside it stands what the fixed load losses of
//! practice, 0.15 and 0.25 of the cutting power, would have told from the same power and the same no-load power.

use super::cuts::SteadyPoint;
use super::forms::{fit_best_form, is_same_speed};
use crate::LoadLossLaw;
use numerics::statistics::count_to_f64;
use serde::Serialize;

/// Fixed load losses that were usual before: shares of the cutting power.
pub const FIXED_LOSSES: [f64; 2] = [0.15, 0.25];

/// Accuracy in one cut.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GroupAccuracy {
    /// Middle of the cut, s.
    pub at_s: f64,
    /// Spindle speed during the cut, rpm.
    pub speed_rpm: f64,
    /// Cutting power by the reference, W.
    pub measured_w: f64,
    /// Cutting power from spindle power, with coefficients learned from the other cuts, W.
    pub estimated_w: f64,
    /// E of this cut; 0.05 is 5 % of the measured cutting power.
    pub error: f64,
    /// E with each of [`FIXED_LOSSES`].
    pub error_fixed: [f64; 2],
}

/// Accuracy over all cuts of a gear stage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Accuracy {
    /// Every cut, each judged by coefficients learned without it.
    pub groups: Vec<GroupAccuracy>,
    /// Mean of E over the cuts.
    pub mean: f64,
    /// Greatest E of a cut.
    pub greatest: f64,
    /// Mean of E with each of [`FIXED_LOSSES`].
    pub mean_fixed: [f64; 2],
}

/// Accuracy of the separation on these points of one gear stage; `None` where too few cuts are left to learn from without one.
pub(super) fn evaluate_accuracy(points: &[&SteadyPoint], speeds: &[f64]) -> Option<Accuracy> {
    let groups: Vec<GroupAccuracy> =
        points.iter().filter(|point| point.cut).filter_map(|cut| evaluate_cut(points, speeds, cut)).collect();
    if groups.is_empty() {
        return None;
    }
    let mean = |of: &dyn Fn(&GroupAccuracy) -> f64| groups.iter().map(of).sum::<f64>() / count_to_f64(groups.len());
    Some(Accuracy {
        mean: mean(&|it| it.error),
        greatest: groups.iter().map(|it| it.error).fold(0.0, f64::max),
        mean_fixed: [mean(&|it| it.error_fixed[0]), mean(&|it| it.error_fixed[1])],
        groups,
    })
}

fn evaluate_cut(points: &[&SteadyPoint], speeds: &[f64], cut: &SteadyPoint) -> Option<GroupAccuracy> {
    let others: Vec<&SteadyPoint> = points.iter().copied().filter(|it| !std::ptr::eq(*it, cut)).collect();
    let at_speed = |point: &&&SteadyPoint| is_same_speed(point.speed_rpm, cut.speed_rpm);
    let cuts_left = others.iter().filter(|it| it.cut && is_same_speed(it.speed_rpm, cut.speed_rpm)).count();
    if cuts_left == 0 || cut.cutting_power_w <= 0.0 {
        return None;
    }
    let idle: Vec<f64> = others.iter().filter(at_speed).filter(|it| !it.cut).map(|it| it.power.mean).collect();
    let no_load_w = idle.iter().sum::<f64>() / count_to_f64(idle.len());
    let estimated = |loss: LoadLossLaw| {
        loss.split_excess_power(cut.power.mean - no_load_w, cut.speed_rpm).map(|split| split.cutting_power_w)
    };
    let error = |estimated_w: f64| (estimated_w - cut.cutting_power_w).abs() / cut.cutting_power_w;
    let estimated_w = estimated(fit_best_form(&others, speeds).ok()?.load_loss())?;
    let [first, second] = FIXED_LOSSES.map(|share| LoadLossLaw::with_constant_coefficients(share, 0.0));
    Some(GroupAccuracy {
        at_s: cut.at_s,
        speed_rpm: cut.speed_rpm,
        measured_w: cut.cutting_power_w,
        estimated_w,
        error: error(estimated_w),
        error_fixed: [error(estimated(first)?), error(estimated(second)?)],
    })
}
