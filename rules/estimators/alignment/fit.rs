//! The power model at one lag and window, and its residual.

use super::speed::{PREDICTORS, RunningIntegrals, Transient};
use super::steady::regularize_stamps;
use numerics::linear::cholesky::{LinearSolution, NormalEquations};

/// Constant, and every predictor.
const COLUMNS: usize = PREDICTORS + 1;

/// What of the power the speed explains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PowerModel {
    /// Power at rest, W.
    pub constant_w: f64,
    /// W per 1000 rpm.
    pub linear_w_krpm: f64,
    /// W per (1000 rpm)^2.
    pub square_w_krpm2: f64,
    /// W per (1000 rpm)^3.
    pub cube_w_krpm3: f64,
    /// Inertia seen while the speed rises, kg m2.
    pub inertia_kg_m2: f64,
    /// The same while it falls; smaller where braking does not come back.
    pub braking_inertia_kg_m2: f64,
    /// Excess at the beginning of a run-up, W; 0 where it explains nothing.
    pub excess_w: f64,
    /// More at any speed than at rest, W: the field of the motor.
    pub turning_w: f64,
}

/// A transient, ready to be compared at any lag and window.
#[derive(Debug, Clone)]
pub(super) struct Ready {
    running: RunningIntegrals,
    power: Vec<(f64, f64)>,
    pub(super) middle_s: f64,
}

impl Ready {
    /// Power readings for which every lag up to `reach_s` and window up to `window_s` lies within the course of speed, so
    /// that all are judged by the same rows.
    pub(super) fn from_transient(
        transient: &Transient,
        top_rpm: f64,
        tau_s: f64,
        reach_s: (f64, f64),
        window_s: f64,
    ) -> Self {
        let running = RunningIntegrals::from_speeds(&regularize_stamps(&transient.speed), top_rpm, tau_s);
        let inside = |time_s: f64| {
            running.average_window(time_s - reach_s.0, window_s).is_some()
                && running.average_window(time_s - reach_s.1, window_s).is_some()
        };
        let rows = transient.power.iter().filter(|point| point.power_w.is_finite() && inside(point.time_s));
        let power = rows.map(|point| (point.time_s, point.power_w)).collect();
        Self { running, power, middle_s: transient.middle_s() }
    }

    pub(super) fn rows(&self) -> usize {
        self.power.len()
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct FittedLag {
    pub(super) model: [f64; COLUMNS],
    pub(super) rss: f64,
    pub(super) rows: usize,
    /// Sum of squares about the mean.
    pub(super) total: f64,
}

impl FittedLag {
    pub(super) fn power_model(&self) -> PowerModel {
        let [constant_w, linear_w_krpm, square_w_krpm2, cube_w_krpm3, up, down, excess_w, turning_w] = self.model;
        PowerModel {
            constant_w,
            linear_w_krpm,
            square_w_krpm2,
            cube_w_krpm3,
            inertia_kg_m2: up,
            braking_inertia_kg_m2: down,
            excess_w,
            turning_w,
        }
    }
}

/// Which predictors take part besides those that always do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PredictorSet {
    /// The cube of the speed.
    pub(super) cube: bool,
    /// That it turns at all.
    pub(super) turning: bool,
    /// What it takes to change the speed.
    pub(super) inertia: bool,
    /// The excess of a run-up.
    pub(super) excess: bool,
}

impl PredictorSet {
    pub(super) const WHOLE: Self = Self { cube: true, turning: true, inertia: true, excess: true };
}

/// Fits all transients together at one lag and window; a predictor that takes no part has the coefficient 0.
pub(super) fn fit_transients(ready: &[Ready], lag_s: f64, window_s: f64, shape: PredictorSet) -> FittedLag {
    let mut sums = NormalEquations::<COLUMNS>::new();
    for one in ready {
        for (time_s, power_w) in &one.power {
            let Some(mean) = one.running.average_window(time_s - lag_s, window_s) else { continue };
            sums.add(&build_regressor_row(&mean, shape), *power_w);
        }
    }
    let LinearSolution { coefficients, rss, total, rows } = sums.solve();
    FittedLag { model: coefficients, rss, rows, total }
}

/// Residual sum of squares of one transient under a given model.
pub(super) fn residual_sum_of_squares(one: &Ready, model: &[f64; COLUMNS], lag_s: f64, window_s: f64) -> f64 {
    let each = one.power.iter().filter_map(|(time_s, power_w)| {
        let mean = one.running.average_window(time_s - lag_s, window_s)?;
        let said: f64 = build_regressor_row(&mean, PredictorSet::WHOLE).iter().zip(model).map(|(x, c)| x * c).sum();
        Some((power_w - said).powi(2))
    });
    each.sum()
}

fn build_regressor_row(mean: &[f64; PREDICTORS], shape: PredictorSet) -> [f64; COLUMNS] {
    let [linear, square, cube, up, down, start, turning] = *mean;
    let with = |takes_part: bool, value: f64| if takes_part { value } else { 0.0 };
    let (up, down) = (with(shape.inertia, up), with(shape.inertia, down));
    let turning = with(shape.turning, turning);
    [1.0, linear, square, with(shape.cube, cube), up, down, with(shape.excess, start), turning]
}
