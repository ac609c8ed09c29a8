//! The power model at one lag and window, and its residual.

use super::speed::{PREDICTORS, Running, Transient};
use super::steady::steadied;

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
    running: Running,
    power: Vec<(f64, f64)>,
    pub(super) middle_s: f64,
}

impl Ready {
    /// Power readings for which every lag up to `reach_s` and window up to `window_s` lies within the course of speed, so
    /// that all are judged by the same rows.
    pub(super) fn of(transient: &Transient, top_rpm: f64, tau_s: f64, reach_s: (f64, f64), window_s: f64) -> Self {
        let running = Running::of(&steadied(&transient.speed), top_rpm, tau_s);
        let inside = |time_s: f64| {
            running.mean(time_s - reach_s.0, window_s).is_some() && running.mean(time_s - reach_s.1, window_s).is_some()
        };
        let rows = transient.power.iter().filter(|point| point.power_w.is_finite() && inside(point.time_s));
        let power = rows.map(|point| (point.time_s, point.power_w)).collect();
        Self { running, power, middle_s: transient.middle_s() }
    }

    pub(super) fn rows(&self) -> usize {
        self.power.len()
    }
}

/// A fit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fitted {
    pub(super) model: [f64; COLUMNS],
    pub(super) rss: f64,
    pub(super) rows: usize,
    /// Sum of squares about the mean.
    pub(super) total: f64,
}

impl Fitted {
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

/// Sums of products of the columns and the power.
#[derive(Debug, Clone, Copy)]
struct Normal {
    xx: [[f64; COLUMNS]; COLUMNS],
    xy: [f64; COLUMNS],
    yy: f64,
    y: f64,
    rows: usize,
}

/// Which predictors take part besides those that always do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shape {
    /// The cube of the speed.
    pub(super) cube: bool,
    /// That it turns at all.
    pub(super) turning: bool,
    /// What it takes to change the speed.
    pub(super) inertia: bool,
    /// The excess of a run-up.
    pub(super) excess: bool,
}

impl Shape {
    /// Every predictor.
    pub(super) const WHOLE: Self = Self { cube: true, turning: true, inertia: true, excess: true };
}

/// Fits all transients together at one lag and window; a predictor that takes no part has the coefficient 0.
pub(super) fn fit(ready: &[Ready], lag_s: f64, window_s: f64, shape: Shape) -> Fitted {
    let mut normal = Normal { xx: [[0.0; COLUMNS]; COLUMNS], xy: [0.0; COLUMNS], yy: 0.0, y: 0.0, rows: 0 };
    for one in ready {
        for (time_s, power_w) in &one.power {
            let Some(mean) = one.running.mean(time_s - lag_s, window_s) else { continue };
            normal.add(&row(&mean, shape), *power_w);
        }
    }
    normal.solve()
}

/// Residual sum of squares of one transient under a given model.
pub(super) fn residual(one: &Ready, model: &[f64; COLUMNS], lag_s: f64, window_s: f64) -> f64 {
    let each = one.power.iter().filter_map(|(time_s, power_w)| {
        let mean = one.running.mean(time_s - lag_s, window_s)?;
        let said: f64 = row(&mean, Shape::WHOLE).iter().zip(model).map(|(x, c)| x * c).sum();
        Some((power_w - said).powi(2))
    });
    each.sum()
}

fn row(mean: &[f64; PREDICTORS], shape: Shape) -> [f64; COLUMNS] {
    let [linear, square, cube, up, down, start, turning] = *mean;
    let with = |takes_part: bool, value: f64| if takes_part { value } else { 0.0 };
    let (up, down) = (with(shape.inertia, up), with(shape.inertia, down));
    let turning = with(shape.turning, turning);
    [1.0, linear, square, with(shape.cube, cube), up, down, with(shape.excess, start), turning]
}

impl Normal {
    fn add(&mut self, row: &[f64; COLUMNS], power_w: f64) {
        for (i, a) in row.iter().enumerate() {
            self.xy[i] += a * power_w;
            row.iter().enumerate().for_each(|(j, b)| self.xx[i][j] += a * b);
        }
        self.yy += power_w * power_w;
        self.y += power_w;
        self.rows += 1;
    }

    /// Cholesky of the columns scaled to length one; a column that says what others say gets 0.
    fn solve(&self) -> Fitted {
        let length: Vec<f64> = (0..COLUMNS).map(|i| self.xx[i][i].sqrt()).collect();
        let scaled = |i: usize, j: usize| self.xx[i][j] / (length[i] * length[j]);
        let mut lower = [[0.0; COLUMNS]; COLUMNS];
        let mut used = [false; COLUMNS];
        let mut half = [0.0; COLUMNS];
        for i in 0..COLUMNS {
            if length[i] <= 0.0 {
                continue;
            }
            for j in (0..i).filter(|j| used[*j]).collect::<Vec<_>>() {
                let inner: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
                lower[i][j] = (scaled(i, j) - inner) / lower[j][j];
            }
            let rest = 1.0 - (0..i).map(|k| lower[i][k].powi(2)).sum::<f64>();
            if rest < 1e-9 {
                lower[i] = [0.0; COLUMNS];
                continue;
            }
            used[i] = true;
            lower[i][i] = rest.sqrt();
            half[i] = (self.xy[i] / length[i] - (0..i).map(|k| lower[i][k] * half[k]).sum::<f64>()) / lower[i][i];
        }
        let mut model = [0.0; COLUMNS];
        for i in (0..COLUMNS).rev().filter(|i| used[*i]).collect::<Vec<_>>() {
            let inner: f64 = (i + 1..COLUMNS).map(|k| lower[k][i] * model[k] * length[k]).sum();
            model[i] = (half[i] - inner) / lower[i][i] / length[i];
        }
        let explained: f64 = half.iter().map(|half| half * half).sum();
        let rows = f64::from(u32::try_from(self.rows).unwrap_or(u32::MAX)).max(1.0);
        let total = (self.yy - self.y * self.y / rows).max(0.0);
        Fitted { model, rss: (self.yy - explained).max(0.0), rows: self.rows, total }
    }
}
