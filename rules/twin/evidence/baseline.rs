//! The baseline: the model refitted to the fitted rows by plain least squares, and its tangents.
//!
//! This is the `before` of the report, so it is the best refit of the model without the missing physics. The simulation
//! stands still afterwards: load, simulated output and tangents are computed once and every hypothesis reads them.

use crate::physics::{Entry, Scene};
use crate::statistics::rms;
use crate::twin::fit::Free;
use crate::twin::linear::least_squares;
use crate::twin::model::{Part, simulate};

/// Gauss-Newton steps, at most; a model that is linear needs two.
const STEPS_MAX: usize = 12;
/// Relative change of the error at which the fit has come to rest.
const AT_REST: f64 = 1e-9;
/// Change of a shape parameter in one step, as a share of its size, at most.
const SHAPE_STEP: f64 = 0.4;
/// Step of a difference quotient, as a share of the parameter.
const DIFFERENCE: f64 = 1e-4;

/// The refitted model.
pub(super) struct Baseline {
    /// Parts with fitted values.
    pub(super) parts: Vec<Part>,
    /// The refitted output, row by row.
    pub(super) simulated: Vec<f64>,
    /// Change of the output with each free parameter, row by row.
    pub(super) tangents: Vec<Vec<f64>>,
}

/// Refits the parts over some rows; the scene keeps load and simulated output of the refitted model. `None` when a part
/// lacks an input.
pub(super) fn refit(scene: &mut Scene, parts: &[Part], rows: &[usize]) -> Option<Baseline> {
    let mut parts = parts.to_vec();
    let free = free(&parts);
    let mut error = f64::INFINITY;
    for _ in 0..STEPS_MAX {
        let (simulated, tangents) = tangents(scene, &parts, &free)?;
        let left: Vec<f64> = rows.iter().map(|row| scene.recorded()[*row] - simulated[*row]).collect();
        let here = rms(&left);
        if !here.is_finite() || here > error * (1.0 - AT_REST) {
            break;
        }
        error = here;
        let columns: Vec<Vec<f64>> = tangents.iter().map(|t| rows.iter().map(|row| t[*row]).collect()).collect();
        let sizes: Vec<f64> = columns.iter().map(|column| rms(column) + 1e-30).collect();
        let scaled =
            columns.iter().zip(&sizes).map(|(c, size)| c.iter().map(|x| x / size).collect()).collect::<Vec<_>>();
        let step = least_squares(&scaled, &left).coefficients;
        let step: Vec<f64> = step.iter().zip(&sizes).map(|(step, size)| step / size).collect();
        advance(scene, &mut parts, &free, &step, rows, error)?;
    }
    let (simulated, tangents) = tangents(scene, &parts, &free)?;
    simulate(&parts, scene)?;
    Some(Baseline { parts, simulated, tangents })
}

/// Goes the step, or as much of it as makes the error smaller.
fn advance(
    scene: &mut Scene,
    parts: &mut Vec<Part>,
    free: &[Free],
    step: &[f64],
    rows: &[usize],
    error: f64,
) -> Option<()> {
    let mut share = free.iter().zip(step).map(|(free, step)| allowed(parts, *free, *step)).fold(1.0_f64, f64::min);
    for _ in 0..6 {
        let mut moved = parts.clone();
        for (free, step) in free.iter().zip(step) {
            let parameter = &mut moved[free.part].parameters[free.parameter];
            parameter.value += share * step;
            if parameter.entry == Entry::Shape {
                parameter.value = parameter.value.clamp(parameter.range.0, parameter.range.1);
            }
        }
        let simulated = simulate(&moved, scene)?.total;
        let left: Vec<f64> = rows.iter().map(|row| scene.recorded()[*row] - simulated[*row]).collect();
        if rms(&left) <= error {
            *parts = moved;
            return Some(());
        }
        share *= 0.4;
    }
    Some(())
}

/// How much of a step a shape parameter can take at once.
fn allowed(parts: &[Part], free: Free, step: f64) -> f64 {
    let parameter = &parts[free.part].parameters[free.parameter];
    let most = SHAPE_STEP * parameter.value.abs().max(0.05);
    if parameter.entry == Entry::Shape && step.abs() > most { most / step.abs() } else { 1.0 }
}

/// Everything that is not fixed.
fn free(parts: &[Part]) -> Vec<Free> {
    let of = |(part, p): (usize, &Part)| {
        let free = (0..p.parameters.len()).filter(|index| !p.parameters[*index].fixed);
        free.map(|parameter| Free { part, parameter }).collect::<Vec<_>>()
    };
    parts.iter().enumerate().flat_map(of).collect()
}

/// The output, and its change with each free parameter by a difference quotient (exact where it is linear).
fn tangents(scene: &mut Scene, parts: &[Part], free: &[Free]) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
    let base = simulate(parts, scene)?.total;
    let mut moved = parts.to_vec();
    let mut all = Vec::new();
    for of in free {
        let parameter = &mut moved[of.part].parameters[of.parameter];
        let value = parameter.value;
        let step = DIFFERENCE * value.abs().max(if parameter.entry == Entry::Shape { 1e-2 } else { 1e-6 });
        parameter.value = value + step;
        let ahead = simulate(&moved, scene)?.total;
        moved[of.part].parameters[of.parameter].value = value;
        all.push(ahead.iter().zip(&base).map(|(a, b)| (a - b) / step).collect());
    }
    Some((base, all))
}
