//! Fitting: all free parameters of all parts together, by Gauss-Newton in the metric of a noise.
//!
//! The model without what is missing is fitted by plain least squares (`before`), the textbook laws of what was found in
//! the metric of the likeliest noise. Every number is computed over all rows; only those that the metric takes are fitted.

use super::linear::{dot, least_squares};
use super::model::{Part, Simulated, simulate_changed_part, simulate_parts};
use numerics::statistics::rms;
use physics::{Entry, Scene};

/// Gauss-Newton steps at most.
const STEPS_MAX: usize = 12;
/// Share of the sum of squares below which nothing improves any more.
const AT_REST: f64 = 1e-10;
/// Share of its value by which a shape may move in one step.
const SHAPE_STEP: f64 = 0.5;
/// Share of its value by which a parameter is moved to see what it does.
const DIFFERENCE: f64 = 1e-4;
/// Shares of a step that are tried.
const SHARES: [f64; 6] = [1.0, 0.4, 0.16, 0.06, 0.025, 0.01];

/// A parameter that is fitted: part and position within the part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Free {
    /// Index of the part.
    pub(super) part: usize,
    /// Index of the parameter within the part.
    pub(super) parameter: usize,
}

/// In what an error is measured: which rows take part, and how each counts.
pub(super) struct Metric<'a> {
    /// The recorded output, every row.
    pub(super) recorded: &'a [f64],
    /// From a column of every row to one number per row that takes part.
    pub(super) weigh: &'a dyn Fn(&[f64]) -> Vec<f64>,
    /// Must proportional parameters stay within what is physically possible? Shapes always do.
    pub(super) bounded: bool,
}

#[derive(Debug, Clone)]
pub(super) struct Fit {
    /// The parts with fitted values.
    pub(super) parts: Vec<Part>,
    pub(super) free: Vec<Free>,
    /// The simulated output, every row.
    pub(super) simulated: Vec<f64>,
    /// Change of the output with each fitted parameter, every row.
    pub(super) tangents: Vec<Vec<f64>>,
}

/// Fits everything in `parts` that is not fixed, from its present values; the scene keeps load and simulated output of the
/// fitted parts. `None` when a part lacks an input.
pub(super) fn fit_parts(scene: &mut Scene, parts: &[Part], metric: &Metric<'_>) -> Option<Fit> {
    let free = list_free_parameters(parts);
    let mut parts = parts.to_vec();
    if metric.bounded {
        parts.iter_mut().for_each(clamp_to_range);
    }
    let mut simulated = simulate_parts(&parts, scene)?;
    let mut error = sum_residual_squares(metric, &simulated.total);
    for _ in 0..STEPS_MAX {
        let tangents = compute_tangents(scene, &parts, &free, &simulated)?;
        let step = solve_gauss_newton_step(&parts, &free, metric, &simulated.total, &tangents);
        let Some((moved, total, less)) = search_step_length(scene, &parts, &free, &step, metric, error)? else { break };
        let gained = error - less;
        (parts, simulated, error) = (moved, total, less);
        if gained <= AT_REST * error {
            break;
        }
    }
    let tangents = compute_tangents(scene, &parts, &free, &simulated)?;
    let simulated = simulate_parts(&parts, scene)?.total;
    Some(Fit { parts, free, simulated, tangents })
}

/// A fit without bounds may have left a parameter outside of its range; from there no step would lead back.
fn clamp_to_range(part: &mut Part) {
    for parameter in part.parameters.iter_mut().filter(|parameter| !parameter.fixed) {
        let (low, high) = parameter.range;
        parameter.value = parameter.value.clamp(low, high);
    }
}

/// Everything that is not fixed.
fn list_free_parameters(parts: &[Part]) -> Vec<Free> {
    let of = |(part, p): (usize, &Part)| {
        let free = (0..p.parameters.len()).filter(|index| !p.parameters[*index].fixed);
        free.map(|parameter| Free { part, parameter }).collect::<Vec<_>>()
    };
    parts.iter().enumerate().flat_map(of).collect()
}

/// What is left, as it counts.
fn compute_weighted_residual(metric: &Metric<'_>, total: &[f64]) -> Vec<f64> {
    let left: Vec<f64> = metric.recorded.iter().zip(total).map(|(recorded, total)| recorded - total).collect();
    (metric.weigh)(&left)
}

fn sum_residual_squares(metric: &Metric<'_>, total: &[f64]) -> f64 {
    let left = compute_weighted_residual(metric, total);
    dot(&left, &left)
}

/// The step to the least error if everything were proportional; parameters that stand at the end of their range and would
/// leave it rest.
fn solve_gauss_newton_step(
    parts: &[Part],
    free: &[Free],
    metric: &Metric<'_>,
    total: &[f64],
    tangents: &[Vec<f64>],
) -> Vec<f64> {
    let left = compute_weighted_residual(metric, total);
    let mut columns: Vec<Vec<f64>> = tangents.iter().map(|tangent| (metric.weigh)(tangent)).collect();
    let sizes: Vec<f64> = columns.iter().map(|column| rms(column).max(f64::MIN_POSITIVE)).collect();
    columns.iter_mut().zip(&sizes).for_each(|(column, size)| column.iter_mut().for_each(|x| *x /= size));
    let mut resting = vec![false; free.len()];
    loop {
        let solved = least_squares(&columns, &left).coefficients;
        let steps: Vec<f64> = solved.iter().zip(&sizes).map(|(step, size)| step / size).collect();
        let leaves = |index: usize| {
            let parameter = &parts[free[index].part].parameters[free[index].parameter];
            let (low, high) = parameter.range;
            let held = metric.bounded || parameter.entry == Entry::Shape;
            let outwards =
                parameter.value <= low && steps[index] < 0.0 || parameter.value >= high && steps[index] > 0.0;
            held && !resting[index] && outwards
        };
        let Some(index) = (0..free.len()).find(|index| leaves(*index)) else { return steps };
        resting[index] = true;
        columns[index].fill(0.0);
    }
}

/// Parts that have moved, what they simulate, and the error they leave.
type Moved = (Vec<Part>, Simulated, f64);

/// Goes the step, or as much of it as makes the error smaller; nothing where no share of it does.
fn search_step_length(
    scene: &mut Scene,
    parts: &[Part],
    free: &[Free],
    step: &[f64],
    metric: &Metric<'_>,
    error: f64,
) -> Option<Option<Moved>> {
    for share in SHARES {
        let mut moved = parts.to_vec();
        for (free, step) in free.iter().zip(step) {
            let parameter = &mut moved[free.part].parameters[free.parameter];
            let (low, high) = parameter.range;
            let mut change = share * step;
            if parameter.entry == Entry::Shape {
                let narrow = if low.is_finite() && high.is_finite() { 0.02 * (high - low) } else { 0.05 };
                let most = (SHAPE_STEP * parameter.value.abs()).max(narrow);
                change = change.clamp(-most, most);
            }
            parameter.value += change;
            if metric.bounded || parameter.entry == Entry::Shape {
                parameter.value = parameter.value.clamp(low, high);
            }
        }
        let simulated = simulate_parts(&moved, scene)?;
        let less = sum_residual_squares(metric, &simulated.total);
        if less < error {
            return Some(Some((moved, simulated, less)));
        }
    }
    Some(None)
}

/// Change of the output with each free parameter: its own column where nothing else reads what it does, a difference
/// quotient (exact where it is proportional) elsewhere.
fn compute_tangents(scene: &mut Scene, parts: &[Part], free: &[Free], base: &Simulated) -> Option<Vec<Vec<f64>>> {
    simulate_parts(parts, scene)?;
    let mut columns: Vec<Option<Vec<f64>>> = vec![None; free.len()];
    for (index, part) in parts.iter().enumerate() {
        let direct = |free: &Free| free.part == index && has_column_derivative(parts, *free);
        if !free.iter().any(direct) {
            continue;
        }
        let known = part.compute_columns(scene)?;
        for (position, free) in free.iter().enumerate().filter(|(_, free)| direct(free)) {
            let name = &part.parameters[free.parameter].name;
            let own = known.iter().find(|(known, _)| known == name).map(|(_, column)| column.clone());
            columns[position] = Some(own.unwrap_or_else(|| vec![0.0; scene.rows()]));
        }
    }
    for (position, free) in free.iter().enumerate() {
        if columns[position].is_none() {
            columns[position] = Some(compute_difference_quotient(scene, parts, *free, base)?);
        }
    }
    columns.into_iter().collect()
}

/// Is the derivative simply the part's own column? Not where other parts read what this one simulates.
fn has_column_derivative(parts: &[Part], free: Free) -> bool {
    let part = &parts[free.part];
    let linear = part.parameters[free.parameter].entry == Entry::Linear;
    let coupled = parts.iter().any(Part::acts_on_output) && !part.acts_on_output();
    linear && !coupled && !parts.iter().any(|other| part.is_read_by(other))
}

fn compute_difference_quotient(scene: &mut Scene, parts: &[Part], free: Free, base: &Simulated) -> Option<Vec<f64>> {
    let mut moved = parts.to_vec();
    let parameter = &mut moved[free.part].parameters[free.parameter];
    let mut step = DIFFERENCE * parameter.value.abs().max(if parameter.entry == Entry::Shape { 1e-2 } else { 1e-6 });
    if parameter.value + step > parameter.range.1 {
        step = -step;
    }
    parameter.value += step;
    let ahead = simulate_changed_part(&moved, scene, base, free.part)?;
    simulate_parts(parts, scene)?;
    Some(ahead.iter().zip(&base.total).map(|(ahead, base)| (ahead - base) / step).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parse_model;
    use recording::read_csv;
    use std::fmt::Write;

    const MODEL: &str = "schema = \"model/1\"\noutput = \"force_n\"\n[[effect]]\nkind = \"linear\"\n\
                         columns = { acceleration_m_s2 = 10.0, velocity_m_s = 1.0 }\n\
                         [[effect]]\nkind = \"dry_friction\"\nparameters = { level = 1.0, reversal_share = 0.05 }\n";

    fn scene(level_n: f64) -> Scene {
        let mut text = String::from("time_s,velocity_m_s,acceleration_m_s2,force_n\n");
        for row in 0..400_u32 {
            let t = 0.05 * f64::from(row);
            let (v, a) = (0.1 * t.sin() + 0.05 * (3.0 * t).sin(), 0.1 * t.cos() + 0.15 * (3.0 * t).cos());
            let force = 90.0 * a + 200.0 * v + level_n * (v / 0.0015).tanh();
            writeln!(text, "{t},{v},{a},{force}").expect("a string takes it");
        }
        let recording = read_csv(text.as_bytes(), "t.csv").expect("readable").recording;
        Scene::new(&recording, "force_n", &Default::default()).expect("recorded")
    }

    fn fitted(level_n: f64, bounded: bool) -> Fit {
        let mut scene = scene(level_n);
        let recorded = scene.recorded_output().to_vec();
        let parts = parse_model(MODEL).expect("fine").parts;
        let metric = Metric { recorded: &recorded, weigh: &|column| column.to_vec(), bounded };
        fit_parts(&mut scene, &parts, &metric).expect("every input is recorded")
    }

    #[test]
    fn sizes_and_shapes_are_those_of_the_recording() {
        let fit = fitted(20.0, true);
        let value = |part: usize, name: &str| fit.parts[part].find_parameter(name).expect("a parameter").value;
        assert!((value(0, "acceleration_m_s2") - 90.0).abs() < 0.5, "{:?}", fit.parts);
        assert!((value(1, "level") - 20.0).abs() < 0.2, "{:?}", fit.parts);
    }

    #[test]
    fn what_must_stay_possible_rests_at_its_bound() {
        let level = |bounded: bool| fitted(-20.0, bounded).parts[1].find_parameter("level").expect("a level").value;
        assert_eq!(level(true), 0.0);
        assert!(level(false) < -15.0, "{}", level(false));
    }

    #[test]
    fn what_a_free_fit_has_moved_outside_comes_back() {
        let mut scene = scene(-20.0);
        let recorded = scene.recorded_output().to_vec();
        let outside = fitted(-20.0, false).parts;
        let metric = Metric { recorded: &recorded, weigh: &|column| column.to_vec(), bounded: true };
        let held = fit_parts(&mut scene, &outside, &metric).expect("every input is recorded");
        assert_eq!(held.parts[1].find_parameter("level").expect("a level").value, 0.0);
    }
}
