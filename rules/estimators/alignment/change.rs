//! Has the lag changed since it was estimated? Every new change of speed is asked which lag it has under the model that is known.
//!
//! A meter that is set to another averaging, or that sits behind another line, is late by another amount from one moment to the next.
//! The estimate over all transients notices that only when most of them are new. One transient alone tells its lag well once the
//! model of the power is known; two in a row that agree with each other and not with the estimate are a change.

use super::estimate::{Lag, LagSettings};
use super::fit::{PowerModel, Ready, residual_sum_of_squares};
use super::profile::{STEP_S, find_minimum, list_lags};
use super::speed::Transient;
use numerics::statistics::count_to_f64;

/// A transient departs when its own lag lies outside the estimate's interval, and is off by at least so much, s. The
/// stamps of a controller that is polled every 100 ms scatter single lags by some 10 ms; a lag that changes by less costs little.
const DEPARTS_S: f64 = 0.045;
/// Its own lag must explain it visibly better: the residual at the known lag is at least so many times that at its own.
const BETTER: f64 = 1.3;
/// Two lags of a change agree within this, s, and within this share of the change.
const AGREE_S: f64 = 0.05;
const AGREE_SHARE: f64 = 0.3;

/// A transient whose lag is not the known one.
#[derive(Debug, Clone, Copy, PartialEq)]
struct LagDeparture {
    lag_s: f64,
    /// Off the known lag by so much, s.
    off_s: f64,
    middle_s: f64,
}

/// A lag that is another one than it was.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LagChange {
    /// The lag that was known, s.
    pub from_s: f64,
    /// What the transients since then say, s: a rough value.
    pub to_s: f64,
    /// Middle of the first transient with the other lag, s.
    pub since_s: f64,
}

/// Looks at every new transient while a lag is known.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LagWatch {
    before: Option<LagDeparture>,
}

impl LagWatch {
    /// So many transients tell a change, the newest among them.
    pub const TRANSIENTS: usize = 2;

    /// Takes the newest transient. The change, when this is the second in a row that departs in the same way.
    pub fn observe_transient(&mut self, transient: &Transient, known: &Lag) -> Option<LagChange> {
        let settings = LagSettings::default();
        if !is_telling(transient, &settings) {
            return None;
        }
        let Some(found) = find_departure(transient, known, &settings) else {
            self.before = None;
            return None;
        };
        let agrees = |before: &LagDeparture| {
            (before.lag_s - found.lag_s).abs() <= AGREE_S.max(AGREE_SHARE * found.off_s.abs())
                && before.off_s * found.off_s > 0.0
        };
        let before = self.before.replace(found).filter(agrees)?;
        self.before = None;
        Some(LagChange { from_s: known.lag_s, to_s: 0.5 * (before.lag_s + found.lag_s), since_s: before.middle_s })
    }
}

/// Is it a change of speed that tells a lag?
fn is_telling(transient: &Transient, settings: &LagSettings) -> bool {
    let (least, greatest) = transient.range_rpm();
    let range = greatest - least;
    range >= settings.change_min_rpm && range <= settings.rise_max_s * transient.steepest_rpm_s()
}

fn find_departure(transient: &Transient, known: &Lag, settings: &LagSettings) -> Option<LagDeparture> {
    let model = known.model.to_coefficients();
    let top_rpm = transient.range_rpm().1;
    let one = Ready::from_transient(transient, top_rpm, known.excess_tau_s, settings.lags_s, settings.window_max_s);
    if one.rows() < 10 {
        return None;
    }
    let residual = |lag_s: f64| residual_sum_of_squares(&one, &model, lag_s, known.window_s);
    let known_s = known.predict_lag(one.middle_s);
    let tried = list_lags(settings.lags_s).map(|lag_s| (lag_s, residual(lag_s)));
    let (nearest_s, _) = tried.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let lag_s = find_minimum(nearest_s, STEP_S, (nearest_s - STEP_S, nearest_s + STEP_S), residual);
    let off_s = lag_s - known_s;
    // Noise that the model has anyway counts on both sides.
    let noise = known.residual_w.powi(2) * count_to_f64(one.rows()) * 0.1;
    let is_better = residual(known_s) + noise > BETTER * (residual(lag_s) + noise);
    let departs = off_s.abs() > DEPARTS_S.max(known.uncertainty_s);
    (departs && is_better).then_some(LagDeparture { lag_s, off_s, middle_s: one.middle_s })
}

impl PowerModel {
    /// In the order of the regressors.
    fn to_coefficients(self) -> [f64; 8] {
        [
            self.constant_w,
            self.linear_w_krpm,
            self.square_w_krpm2,
            self.cube_w_krpm3,
            self.inertia_kg_m2,
            self.braking_inertia_kg_m2,
            self.excess_w,
            self.turning_w,
        ]
    }
}
