//! Fitting: all free parameters of all parts together, by Gauss-Newton in the metric of a noise.
//!
//! The model without what is missing is fitted by plain least squares (`before`), the textbook laws of what was found in
//! the metric of the likeliest noise. Every number is computed over all rows; only those that the metric takes are fitted.

use super::linear::{dot, least_squares};
use super::model::{Part, Simulated, simulate_parts};
use super::tangents::{Side, compute_tangents, has_kink};
use numerics::statistics::{count_to_f64, rms};
use physics::{Entry, Scene};

/// Gauss-Newton steps at most, of a fit without bounds and of one with: what rests at a bound and leaves it again takes more.
const STEPS_MAX: usize = 12;
/// The same with bounds. Chosen by hand: too few end before a parameter has left its bound again, too many cost time.
const BOUNDED_STEPS_MAX: usize = 40;
/// Dampings (Marquardt, J. SIAM 11, 1963) of a bounded fit, as shares of each column's square, that are tried where no share
/// of the whole step lowers the error: two lags that explain one delay have a valley that a plain step leaps across.
const DAMPINGS: [f64; 4] = [0.0, 0.003, 0.1, 3.0];
/// Share of its size over all rows that a column must have in the rows that are fitted, so that they tell its coefficient: an
/// initial state that has faded there would be fitted to anything.
const SEEN: f64 = 1e-6;
/// Share of the sum of squares below which nothing improves any more.
const AT_REST: f64 = 1e-10;
/// Share of its value by which a shape may move in one step.
const SHAPE_STEP: f64 = 0.5;
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
    pub(super) has_bounds: bool,
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
    if metric.has_bounds {
        parts.iter_mut().for_each(clamp_to_range);
    }
    let mut simulated = simulate_parts(&parts, scene)?;
    let left = compute_weighted_residual(metric, &simulated.total);
    // What keeps a departure near zero counts in deviations of an innovation.
    let ridge = dot(&left, &left) / count_to_f64(left.len().max(1));
    let sum = |parts: &[Part], total: &[f64]| {
        let left = compute_weighted_residual(metric, total);
        dot(&left, &left) + ridge * sum_prior_squares(parts, &free)
    };
    let mut error = sum(&parts, &simulated.total);
    let (steps_max, dampings) =
        if metric.has_bounds { (BOUNDED_STEPS_MAX, &DAMPINGS[..]) } else { (STEPS_MAX, &DAMPINGS[..1]) };
    let mut side = Side::Above;
    for _ in 0..steps_max {
        let tangents = compute_tangents(scene, &parts, &free, (&simulated, side))?;
        let linear = Linearised::new(&parts, &free, metric, (&simulated.total, &tangents), ridge);
        let mut found = None;
        for damping in dampings {
            let step = linear.solve_step(*damping);
            found = search_step_length(scene, &parts, &free, &step, metric, (error, &sum))?;
            if found.is_some() {
                break;
            }
        }
        let Some((moved, total, less)) = found else {
            if side == Side::Below || !has_kink(scene, &parts, &free, (&simulated, &tangents))? {
                break;
            }
            side = Side::Below;
            continue;
        };
        side = Side::Above;
        let gained = error - less;
        (parts, simulated, error) = (moved, total, less);
        if gained <= AT_REST * error {
            break;
        }
    }
    let tangents = compute_tangents(scene, &parts, &free, (&simulated, Side::Above))?;
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

/// Sum of the squared deviations of departures from none, in those that are usual.
fn sum_prior_squares(parts: &[Part], free: &[Free]) -> f64 {
    let of = |free: &Free| {
        let parameter = &parts[free.part].parameters[free.parameter];
        parameter.prior_deviation().map_or(0.0, |deviation| (parameter.value / deviation).powi(2))
    };
    free.iter().map(of).sum()
}

/// A model as it is near some values: what is left, and what each free parameter changes, in the metric; each column of size one.
struct Linearised<'a> {
    parts: &'a [Part],
    free: &'a [Free],
    has_bounds: bool,
    left: Vec<f64>,
    columns: Vec<Vec<f64>>,
    sizes: Vec<f64>,
}

/// What is known beforehand of the parameters, as further rows of their columns: a departure is near zero, beside a noise of this
/// variance. Gives what these rows leave.
pub(super) fn add_prior_rows(parts: &[Part], free: &[Free], columns: &mut [Vec<f64>], variance: f64) -> Vec<f64> {
    let mut left = Vec::new();
    for (index, at) in free.iter().enumerate() {
        let parameter = &parts[at.part].parameters[at.parameter];
        let Some(deviation) = parameter.prior_deviation() else { continue };
        let weight = variance.sqrt() / deviation;
        left.push(-weight * parameter.value);
        columns.iter_mut().enumerate().for_each(|(other, c)| c.push(if other == index { weight } else { 0.0 }));
    }
    left
}

impl<'a> Linearised<'a> {
    fn new(
        parts: &'a [Part],
        free: &'a [Free],
        metric: &Metric<'_>,
        (total, tangents): (&[f64], &[Vec<f64>]),
        ridge: f64,
    ) -> Self {
        let mut left = compute_weighted_residual(metric, total);
        let mut columns: Vec<Vec<f64>> = tangents.iter().map(|tangent| (metric.weigh)(tangent)).collect();
        let rows = left.len();
        left.extend(add_prior_rows(parts, free, &mut columns, ridge));
        let sizes: Vec<f64> = columns.iter().map(|column| rms(&column[..rows]).max(f64::MIN_POSITIVE)).collect();
        for ((column, size), tangent) in columns.iter_mut().zip(&sizes).zip(tangents) {
            let unseen = metric.has_bounds && *size < SEEN * rms(tangent);
            column.iter_mut().for_each(|x| *x = if unseen { 0.0 } else { *x / size });
        }
        Self { parts, free, has_bounds: metric.has_bounds, left, columns, sizes }
    }

    /// The step to the least error if everything were proportional, damped; parameters that stand at the end of their range and
    /// would leave it rest, and go on where another that rests makes them turn back.
    fn solve_step(&self, damping: f64) -> Vec<f64> {
        let (mut columns, mut left) = (self.columns.clone(), self.left.clone());
        if damping > 0.0 {
            let own = (damping * count_to_f64(left.len())).sqrt();
            left.resize(left.len() + self.free.len(), 0.0);
            for (index, column) in columns.iter_mut().enumerate() {
                column.extend((0..self.free.len()).map(|other| if other == index { own } else { 0.0 }));
            }
        }
        let mut resting = vec![false; self.free.len()];
        loop {
            let solved = least_squares(&columns, &left).coefficients;
            let steps: Vec<f64> = solved.iter().zip(&self.sizes).map(|(step, size)| step / size).collect();
            let Some(index) =
                (0..self.free.len()).find(|index| !resting[*index] && self.leaves_range(*index, steps[*index]))
            else {
                return steps;
            };
            resting[index] = true;
            columns[index].fill(0.0);
        }
    }

    /// Does a parameter stand at the end of its range, and would it leave it with this step?
    fn leaves_range(&self, index: usize, step: f64) -> bool {
        let parameter = &self.parts[self.free[index].part].parameters[self.free[index].parameter];
        let (low, high) = parameter.range;
        let held = self.has_bounds || parameter.entry == Entry::Shape;
        held && (parameter.value <= low && step < 0.0 || parameter.value >= high && step > 0.0)
    }
}

/// Parts that have moved, what they simulate, and the error they leave.
type Moved = (Vec<Part>, Simulated, f64);

/// The sum of squares of parts with a correction of the step.
type ErrorSum<'a> = &'a dyn Fn(&[Part], &[f64]) -> f64;

/// Goes the step, or as much of it as makes the error smaller; nothing where no share of it does.
fn search_step_length(
    scene: &mut Scene,
    parts: &[Part],
    free: &[Free],
    step: &[f64],
    metric: &Metric<'_>,
    (error, sum): (f64, ErrorSum<'_>),
) -> Option<Option<Moved>> {
    for share in SHARES {
        let mut moved = parts.to_vec();
        for (free, step) in free.iter().zip(step) {
            let parameter = &mut moved[free.part].parameters[free.parameter];
            let (low, high) = parameter.range;
            let mut change = share * step;
            if parameter.entry == Entry::Shape && parameter.prior_deviation().is_none() {
                let narrow = if low.is_finite() && high.is_finite() { 0.02 * (high - low) } else { 0.05 };
                let most = (SHAPE_STEP * parameter.value.abs()).max(narrow);
                change = change.clamp(-most, most);
            }
            parameter.value += change;
            if metric.has_bounds || parameter.entry == Entry::Shape {
                parameter.value = parameter.value.clamp(low, high);
            }
        }
        let simulated = simulate_parts(&moved, scene)?;
        let less = sum(&moved, &simulated.total);
        if less < error {
            return Some(Some((moved, simulated, less)));
        }
    }
    Some(None)
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

    fn fitted(level_n: f64, has_bounds: bool) -> Fit {
        let mut scene = scene(level_n);
        let recorded = scene.recorded_output().to_vec();
        let parts = parse_model(MODEL).expect("fine").parts;
        let metric = Metric { recorded: &recorded, weigh: &|column| column.to_vec(), has_bounds };
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
        let metric = Metric { recorded: &recorded, weigh: &|column| column.to_vec(), has_bounds: true };
        let held = fit_parts(&mut scene, &outside, &metric).expect("every input is recorded");
        assert_eq!(held.parts[1].find_parameter("level").expect("a level").value, 0.0);
    }

    /// What a delay ends at that starts at so many whole rows: the recording is a force that comes this late, linear between two rows.
    fn fit_delay(late_s: f64, started_rows: u32) -> f64 {
        let force = |t: f64| 90.0 * (0.1 * t.cos() + 0.15 * (3.0 * t).cos()) + 20.0 * (7.0 * t).sin();
        let mut text = String::from("time_s,one,force_n,simulated_n\n");
        for row in 0..400_u32 {
            let t = 0.05 * f64::from(row);
            let rows = (t - late_s) / 0.05;
            let (below, share) = (0.05 * rows.floor(), rows - rows.floor());
            let late = (1.0 - share) * force(below) + share * force(below + 0.05);
            writeln!(text, "{t},1,{late},{}", force(t)).expect("a string takes it");
        }
        let recording = read_csv(text.as_bytes(), "t.csv").expect("readable").recording;
        let mut scene = Scene::new(&recording, "force_n", &Default::default()).expect("recorded");
        let recorded = scene.recorded_output().to_vec();
        let model = format!(
            "schema = \"model/1\"\noutput = \"force_n\"\n[[effect]]\nkind = \"linear\"\ncolumns = {{ simulated_n = 1.0 }}\n\
             [[effect]]\nkind = \"clock_lag\"\nparameters = {{ share = 1.0, delay_s = {} }}\nfixed = [\"share\"]\n",
            0.05 * f64::from(started_rows)
        );
        let parts = parse_model(&model).expect("fine").parts;
        let metric = Metric { recorded: &recorded, weigh: &|column| column[20..].to_vec(), has_bounds: true };
        let fit = fit_parts(&mut scene, &parts, &metric).expect("every input is recorded");
        fit.parts[1].find_parameter("delay_s").expect("a delay").value
    }

    #[test]
    fn a_delay_does_not_rest_at_a_whole_row() {
        for tenths in [22, 27, 34, 38, 41, 46] {
            for started in [2, 3, 4, 5, 6] {
                let late_s = 0.005 * f64::from(tenths);
                let found = fit_delay(late_s, started);
                assert!((found - late_s).abs() < 2e-4, "{late_s} s from {started} rows: {found} s");
            }
        }
    }
}
