//! States that effects carry: first-order lags with true time stamps, across pauses where they are known.

use super::Scene;

/// A first-order state `dx/dt = (u - x) / tau_s`, exact for an input held between rows, starting from zero. Across a
/// known pause the input is held for ten periods, then it is zero; across an unknown pause the state stands still.
#[must_use]
pub fn apply_first_order_lag(scene: &Scene, input: &[f64], tau_s: f64) -> Vec<f64> {
    let mut state = vec![0.0; input.len()];
    for row in 1..input.len() {
        state[row] = advance_state(scene, state[row - 1], input[row - 1], row, tau_s);
    }
    state
}

/// A first-order lag behind something that is there whether the machine runs or not, such as the air of a hall: linear
/// between rows, also across known pauses; from rest at the first value.
#[must_use]
pub fn apply_continuous_lag(scene: &Scene, input: &[f64], tau_s: f64) -> Vec<f64> {
    let mut state = input.to_vec();
    for row in 1..input.len() {
        let dt_s = (scene.clock_s()[row] - scene.clock_s()[row - 1]).max(0.0);
        // Behind a ramp of this pace the state lags by `pace * tau_s`.
        let lag = if dt_s > 0.0 { (input[row] - input[row - 1]) / dt_s * tau_s } else { 0.0 };
        state[row] = input[row] - lag + (state[row - 1] - input[row - 1] + lag) * (-dt_s / tau_s).exp();
    }
    state
}

fn advance_state(scene: &Scene, x: f64, input: f64, row: usize, tau_s: f64) -> f64 {
    let dt_s = (scene.clock_s()[row] - scene.clock_s()[row - 1]).max(0.0);
    let driven_s = scene.driven_s(row).min(dt_s);
    relax_state(relax_state(x, input, driven_s, tau_s), 0.0, dt_s - driven_s, tau_s)
}

/// Where a first-order state has come after `dt_s` with a constant input.
fn relax_state(x: f64, input: f64, dt_s: f64, tau_s: f64) -> f64 {
    input + (x - input) * (-dt_s / tau_s).exp()
}

/// A first-order lag that starts from zero with every pass and follows the input of the row it stands at: what acts on the
/// cut lets go where nothing is cut.
#[must_use]
pub fn apply_lag_in_each_pass(scene: &Scene, input: &[f64], tau_s: f64) -> Vec<f64> {
    let mut state = vec![0.0; input.len()];
    for pass in scene.passes() {
        for row in pass.clone().skip(1) {
            let dt_s = (scene.time_s()[row] - scene.time_s()[row - 1]).max(0.0);
            state[row] = relax_state(state[row - 1], input[row], dt_s, tau_s);
        }
    }
    state
}

/// A state that follows the direction of motion over the way, `dz = (sign(dx) - z) |dx| / way`, from zero at the first row:
/// what is bent stays bent at rest and across pauses. Velocity in m/s or rad/s, linear between rows; way in m or rad.
#[must_use]
pub fn compute_presliding_state(scene: &Scene, velocity: &[f64], way: f64) -> Vec<f64> {
    let mut state = vec![0.0; velocity.len()];
    for row in 1..velocity.len() {
        let bent = |z: f64, dx: f64| relax_state(z, dx.signum(), dx.abs(), way);
        state[row] = measure_ways(scene, velocity, row).into_iter().fold(state[row - 1], bent);
    }
    state
}

/// The ways between reversals, with their direction, in m or rad; none where the drive never moves.
#[must_use]
pub fn measure_strokes(scene: &Scene, velocity: &[f64]) -> Vec<f64> {
    let mut strokes: Vec<f64> = Vec::new();
    for dx in (1..velocity.len()).flat_map(|row| measure_ways(scene, velocity, row)).filter(|dx| *dx != 0.0) {
        match strokes.last_mut() {
            Some(stroke) if stroke.signum() == dx.signum() => *stroke += dx,
            _ => strokes.push(dx),
        }
    }
    strokes
}

/// The ways since the row before, one in each direction where it reverses in between.
fn measure_ways(scene: &Scene, velocity: &[f64], row: usize) -> [f64; 2] {
    let (before, now) = (velocity[row - 1], velocity[row]);
    let dt_s = (scene.clock_s()[row] - scene.clock_s()[row - 1]).max(0.0).min(scene.driven_s(row));
    let same = before * now >= 0.0;
    let until_s = if same { dt_s } else { dt_s * before / (before - now) };
    if same { [0.5 * (before + now) * dt_s, 0.0] } else { [0.5 * before * until_s, 0.5 * now * (dt_s - until_s)] }
}

/// What is left of an initial state of one: `exp(-t / tau_s)` since the first row.
#[must_use]
pub fn compute_decay(scene: &Scene, tau_s: f64) -> Vec<f64> {
    scene.clock_s().iter().map(|t| (-t / tau_s).exp()).collect()
}

/// Seconds since the first row.
#[must_use]
pub fn compute_elapsed_s(scene: &Scene) -> Vec<f64> {
    scene.clock_s().to_vec()
}

/// The value of `values` at `time_s[row] - delay_s` within the run, linearly between rows; held beyond its ends.
#[must_use]
pub fn delay_values(scene: &Scene, values: &[f64], delay_s: f64) -> Vec<f64> {
    let mut shifted = vec![0.0; values.len()];
    for run in scene.runs() {
        let time_s = &scene.time_s()[run.clone()];
        let inside = &values[run.clone()];
        let mut at = 0;
        for (index, now_s) in time_s.iter().enumerate() {
            let wanted_s = now_s - delay_s;
            while at > 0 && time_s[at] > wanted_s {
                at -= 1;
            }
            while at + 1 < time_s.len() && time_s[at + 1] <= wanted_s {
                at += 1;
            }
            shifted[run.start + index] = interpolate_between(time_s, inside, at, wanted_s);
        }
    }
    shifted
}

fn interpolate_between(time_s: &[f64], values: &[f64], at: usize, wanted_s: f64) -> f64 {
    let Some(next) = time_s.get(at + 1) else { return values[at] };
    let span_s = next - time_s[at];
    if span_s <= 0.0 {
        return values[at];
    }
    let share = ((wanted_s - time_s[at]) / span_s).clamp(0.0, 1.0);
    values[at] + share * (values[at + 1] - values[at])
}
