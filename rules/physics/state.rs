//! States that effects carry: first-order lags with true time stamps, across pauses where they are known.

use super::Scene;

/// A first-order state `dx/dt = (u - x) / tau_s`, exact for an input held between rows, starting from zero at every
/// restart of the scene. The input is held through a known pause only for one period, then it is zero.
#[must_use]
pub fn first_order(scene: &Scene, input: &[f64], tau_s: f64) -> Vec<f64> {
    let mut state = vec![0.0; input.len()];
    for_each_stretch(scene, |rows| {
        let mut x = 0.0;
        for row in rows.clone() {
            if row > rows.start {
                x = advance(scene, x, input[row - 1], row, tau_s);
            }
            state[row] = x;
        }
    });
    state
}

fn advance(scene: &Scene, x: f64, input: f64, row: usize, tau_s: f64) -> f64 {
    let dt_s = (scene.time_s()[row] - scene.time_s()[row - 1]).max(0.0);
    let driven_s = dt_s.min(10.0 * scene.period_s());
    let x = input + (x - input) * (-driven_s / tau_s).exp();
    x * (-(dt_s - driven_s) / tau_s).exp()
}

/// What is left of an initial state of one: `exp(-(t - t0) / tau_s)` since each restart.
#[must_use]
pub fn decay(scene: &Scene, tau_s: f64) -> Vec<f64> {
    let mut left = vec![0.0; scene.rows()];
    for_each_stretch(scene, |rows| {
        for row in rows.clone() {
            left[row] = (-(scene.time_s()[row] - scene.time_s()[rows.start]) / tau_s).exp();
        }
    });
    left
}

/// Seconds since the last restart.
#[must_use]
pub fn elapsed_s(scene: &Scene) -> Vec<f64> {
    let mut elapsed = vec![0.0; scene.rows()];
    for_each_stretch(scene, |rows| {
        for row in rows.clone() {
            elapsed[row] = scene.time_s()[row] - scene.time_s()[rows.start];
        }
    });
    elapsed
}

/// Calls `act` with the rows between two restarts.
pub fn for_each_stretch(scene: &Scene, mut act: impl FnMut(std::ops::Range<usize>)) {
    let restarts = scene.restarts();
    for (index, start) in restarts.iter().enumerate() {
        let end = restarts.get(index + 1).copied().unwrap_or(scene.rows());
        act(*start..end);
    }
}

/// The value of `values` at `time_s[row] - delay_s` within the run, linearly between rows; held beyond its ends.
#[must_use]
pub fn delayed(scene: &Scene, values: &[f64], delay_s: f64) -> Vec<f64> {
    let mut shifted = vec![0.0; values.len()];
    for run in scene.runs() {
        let time_s = &scene.time_s()[run.clone()];
        let inside = &values[run.clone()];
        let mut at = 0;
        for (index, now_s) in time_s.iter().enumerate() {
            let wanted_s = now_s - delay_s;
            while at + 1 < time_s.len() && time_s[at + 1] <= wanted_s {
                at += 1;
            }
            shifted[run.start + index] = between(time_s, inside, at, wanted_s);
        }
    }
    shifted
}

fn between(time_s: &[f64], values: &[f64], at: usize, wanted_s: f64) -> f64 {
    let Some(next) = time_s.get(at + 1) else { return values[at] };
    let span_s = next - time_s[at];
    if span_s <= 0.0 {
        return values[at];
    }
    let share = ((wanted_s - time_s[at]) / span_s).clamp(0.0, 1.0);
    values[at] + share * (values[at + 1] - values[at])
}
