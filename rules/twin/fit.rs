//! Fitting: all free parameters of all parts together, by Gauss-Newton on whitened residuals, the noise profiled.

use super::frame::Frame;
use super::linear::{Solution, dot, least_squares};
use super::model::{Part, Simulated, simulate, simulate_changed};
use super::noise::Arma;
use crate::physics::{Entry, Scene};
use crate::statistics::{count, rms, robust_deviation};

/// Gauss-Newton steps at most, per noise model.
const STEPS_MAX: usize = 8;
/// Standard deviation of the weak prior on a baseline parameter, as a multiple of its nominal size.
const PRIOR_SPREAD: f64 = 3.0;

/// A parameter that is fitted: part and position within the part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Free {
    /// Index of the part.
    pub part: usize,
    /// Index of the parameter within the part.
    pub parameter: usize,
}

/// A fitted set of parts.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The parts with fitted values.
    pub parts: Vec<Part>,
    /// The fitted parameters.
    pub free: Vec<Free>,
    /// The noise of this hypothesis.
    pub noise: Arma,
    /// Logarithm of the likelihood at that noise.
    pub log_likelihood: f64,
    /// Recorded minus simulated, per group.
    pub residual: Vec<f64>,
    /// Tangent columns at the solution, per group and free parameter, not whitened.
    pub tangent: Vec<Vec<f64>>,
}

/// Deviations beyond which an innovation counts as this many in the dispersion.
const DISPERSION_CUT: f64 = 6.0;

/// What is being fitted to.
pub struct Data<'a> {
    /// The recording.
    pub scene: &'a mut Scene,
    /// The groups that take part.
    pub frame: &'a Frame,
    /// The recorded output, per group.
    pub recorded: &'a [f64],
}

/// Fits `parts`, starting from their present values, with the noise that makes the recording likeliest. `None` when a
/// part lacks an input.
///
/// Parameters and noise can trap each other: much memory explains away what a level would explain. So the fit starts
/// from several noises, and the likeliest end counts.
#[must_use]
pub fn fit(data: &mut Data<'_>, parts: &[Part], noise: Arma) -> Option<Fit> {
    let mut best: Option<Fit> = None;
    for start in [Arma { phi: 0.4, theta: 0.0 }, noise] {
        let fitted = fit_from(data, parts, start)?;
        if best.as_ref().is_none_or(|best| fitted.log_likelihood > best.log_likelihood) {
            best = Some(fitted);
        }
    }
    best
}

/// Fits `parts` to the levels alone: as if the noise had no memory.
#[must_use]
pub(super) fn fit_levels(data: &mut Data<'_>, parts: &[Part]) -> Option<Fit> {
    fit_at(data, parts, Arma::WHITE)
}

/// Fits `parts` in noise that is known.
#[must_use]
pub(super) fn fit_at(data: &mut Data<'_>, parts: &[Part], noise: Arma) -> Option<Fit> {
    let mut state = FitState::new(data, parts.to_vec())?;
    state.descend(data, parts, noise)?;
    let log_likelihood = data.frame.log_likelihood(state.cost(data, noise), noise);
    let tangent = tangent(data, &state.parts, &state.free)?;
    Some(Fit { log_likelihood, parts: state.parts, free: state.free, noise, residual: state.residual, tangent })
}

fn fit_from(data: &mut Data<'_>, nominal: &[Part], start: Arma) -> Option<Fit> {
    let mut state = FitState::new(data, nominal.to_vec())?;
    state.descend(data, nominal, start)?;
    let (_, noise) = super::noise::fit_near(&state.residual, data.frame, start);
    state.descend(data, nominal, noise)?;
    let (log_likelihood, noise) = super::noise::fit_near(&state.residual, data.frame, noise);
    let tangent = tangent(data, &state.parts, &state.free)?;
    Some(Fit { log_likelihood, parts: state.parts, free: state.free, noise, residual: state.residual, tangent })
}

impl Fit {
    /// The innovations at the fitted noise.
    #[must_use]
    pub fn innovations(&self, frame: &Frame) -> Vec<f64> {
        frame.whiten(&self.residual, self.noise)
    }

    /// Sum of squares that the fit leaves in this noise: in its own, what is missing poses as slow noise.
    #[must_use]
    pub fn left_in(&self, frame: &Frame, noise: Arma) -> f64 {
        let left = frame.whiten(&self.residual, noise);
        dot(&left, &left)
    }

    /// By how much the squares of the innovations, the few greatest cut off, exceed those of the noise between them: one
    /// where the fit leaves nothing but noise; likelihoods mean that many times less where it leaves more (Wedderburn,
    /// Biometrika 61, 1974).
    #[must_use]
    pub fn dispersion(&self, frame: &Frame) -> f64 {
        let innovations = self.innovations(frame);
        let ordinary = robust_deviation(innovations.iter().copied()).unwrap_or(0.0).powi(2);
        let cut = DISPERSION_CUT * DISPERSION_CUT * ordinary;
        let mean = innovations.iter().map(|e| (e * e).min(cut)).sum::<f64>() / count(innovations.len().max(1));
        if ordinary > 0.0 { (mean / ordinary).max(1.0) } else { 1.0 }
    }

    /// Variances of the free parameters: from the whitened tangent, or from how far the units of hold-out disagree
    /// (Liang and Zeger, Biometrika 73, 1986) where that is more - the innovations are never quite white, and no law is
    /// quite true.
    #[must_use]
    pub fn variances(&self, frame: &Frame) -> Vec<f64> {
        let columns: Vec<Vec<f64>> = self.tangent.iter().map(|column| frame.whiten(column, self.noise)).collect();
        let innovations = self.innovations(frame);
        let inverse = least_squares(&columns, &innovations).inverse;
        let variance = self.innovation_variance(&innovations);
        let among_units = disagreement(&columns, &innovations, &inverse, &frame.unit);
        (0..columns.len()).map(|index| (inverse[index][index] * variance).max(among_units[index])).collect()
    }

    /// Variance of one innovation, the freedom of the fit taken off.
    #[must_use]
    pub(super) fn innovation_variance(&self, innovations: &[f64]) -> f64 {
        dot(innovations, innovations) / count(innovations.len().saturating_sub(self.free.len()).max(1))
    }
}

/// Units below which their disagreement says nothing.
pub(super) const UNITS_MIN: usize = 5;

/// Variances of the parameters from the sums of each unit; zero for too few units.
fn disagreement(columns: &[Vec<f64>], innovations: &[f64], inverse: &[Vec<f64>], unit: &[usize]) -> Vec<f64> {
    let units = unit.last().map_or(0, |last| last + 1);
    let mut scores = vec![vec![0.0; columns.len()]; units];
    for (row, unit) in unit.iter().enumerate() {
        columns.iter().zip(&mut scores[*unit]).for_each(|(column, score)| *score += column[row] * innovations[row]);
    }
    scores.retain(|score| score.iter().any(|x| *x != 0.0));
    if scores.len() < UNITS_MIN {
        return vec![0.0; columns.len()];
    }
    let few = count(scores.len()) / (count(scores.len()) - 1.0);
    let of = |line: &Vec<f64>| few * scores.iter().map(|score| dot(line, score).powi(2)).sum::<f64>();
    inverse.iter().map(of).collect()
}

/// The free parameters of parts: everything not fixed.
#[must_use]
pub fn free_parameters(parts: &[Part]) -> Vec<Free> {
    let of_part = |(index, part): (usize, &Part)| -> Vec<Free> {
        let open = part.parameters.iter().enumerate().filter(|(_, parameter)| !parameter.fixed);
        open.map(|(parameter, _)| Free { part: index, parameter }).collect()
    };
    parts.iter().enumerate().flat_map(of_part).collect()
}

struct FitState {
    parts: Vec<Part>,
    free: Vec<Free>,
    residual: Vec<f64>,
}

impl FitState {
    fn new(data: &mut Data<'_>, parts: Vec<Part>) -> Option<Self> {
        let free = free_parameters(&parts);
        let residual = residual(data, &parts)?;
        Some(Self { parts, free, residual })
    }

    fn descend(&mut self, data: &mut Data<'_>, nominal: &[Part], noise: Arma) -> Option<()> {
        let mut cost = self.cost(data, noise);
        for _ in 0..STEPS_MAX {
            let tangent = tangent(data, &self.parts, &self.free)?;
            let step = self.step(data, nominal, noise, &tangent);
            let (parts, residual, new_cost) = self.try_step(data, noise, &step, cost)?;
            let gained = cost - new_cost;
            if gained <= 0.0 {
                break;
            }
            (self.parts, self.residual, cost) = (parts, residual, new_cost);
            if gained < 3e-6 * cost {
                break;
            }
        }
        Some(())
    }

    fn cost(&self, data: &Data<'_>, noise: Arma) -> f64 {
        let innovations = data.frame.whiten(&self.residual, noise);
        dot(&innovations, &innovations)
    }

    /// Gauss-Newton step under a weak prior around the nominal values, so that a parameter the recording does not
    /// touch stays where the file put it.
    fn step(&self, data: &Data<'_>, nominal: &[Part], noise: Arma, tangent: &[Vec<f64>]) -> Vec<f64> {
        let whitened = |column: &[f64]| data.frame.whiten(column, noise);
        let mut target = whitened(&self.residual);
        let sigma = (dot(&target, &target) / count(target.len().max(1))).sqrt();
        let mut columns: Vec<Vec<f64>> = tangent.iter().map(|column| whitened(column)).collect();
        for (index, free) in self.free.iter().enumerate() {
            let now = self.parts[free.part].parameters[free.parameter].value;
            let start = nominal[free.part].parameters[free.parameter].value;
            let reach = rms(data.recorded) / rms(&tangent[index]).max(f64::MIN_POSITIVE);
            let spread = PRIOR_SPREAD * if start == 0.0 { 10.0 * reach } else { start.abs().max(1e-6 * reach) };
            let weight = sigma / spread;
            columns
                .iter_mut()
                .enumerate()
                .for_each(|(other, column)| column.push(if other == index { weight } else { 0.0 }));
            target.push(weight * (start - now));
        }
        self.within_ranges(&mut columns, &target)
    }

    /// Solves with the parameters at rest that stand at the end of their range and would leave it: a step that is cut
    /// off there afterwards need not lead downwards any more.
    fn within_ranges(&self, columns: &mut [Vec<f64>], target: &[f64]) -> Vec<f64> {
        let mut resting = vec![false; self.free.len()];
        loop {
            let Solution { mut coefficients, .. } = least_squares(columns, target);
            coefficients.truncate(self.free.len());
            resting.iter().zip(&mut coefficients).filter(|(rests, _)| **rests).for_each(|(_, step)| *step = 0.0);
            let leaves = |index: usize| !resting[index] && self.leaves_range(index, coefficients[index]);
            let Some(index) = (0..self.free.len()).find(|index| leaves(*index)) else { return coefficients };
            resting[index] = true;
            columns[index].fill(0.0);
        }
    }

    /// Does the parameter stand at the end of its range that the step points beyond?
    fn leaves_range(&self, index: usize, step: f64) -> bool {
        let free = self.free[index];
        let parameter = &self.parts[free.part].parameters[free.parameter];
        let (low, high) = parameter.range;
        (parameter.value <= low && step < 0.0) || (parameter.value >= high && step > 0.0)
    }

    fn try_step(
        &self,
        data: &mut Data<'_>,
        noise: Arma,
        step: &[f64],
        cost: f64,
    ) -> Option<(Vec<Part>, Vec<f64>, f64)> {
        let mut share = 1.0;
        loop {
            let parts = self.moved(step, share);
            let trial = FitState { residual: residual(data, &parts)?, parts, free: Vec::new() };
            let new_cost = trial.cost(data, noise);
            if new_cost < cost || share < 0.05 {
                return Some((trial.parts, trial.residual, new_cost));
            }
            share *= 0.3;
        }
    }

    fn moved(&self, step: &[f64], share: f64) -> Vec<Part> {
        let mut parts = self.parts.clone();
        for (free, delta) in self.free.iter().zip(step) {
            let parameter = &mut parts[free.part].parameters[free.parameter];
            let mut delta = share * delta;
            if parameter.entry == Entry::Shape && parameter.range.0.is_finite() && parameter.range.1.is_finite() {
                // A shape must not leap across its whole range in one linearised step.
                let most = (0.5 * parameter.value.abs()).max(0.02 * (parameter.range.1 - parameter.range.0));
                delta = delta.clamp(-most, most);
            }
            parameter.value = (parameter.value + delta).clamp(parameter.range.0, parameter.range.1);
        }
        parts
    }
}

/// Recorded minus simulated, per group.
pub fn residual(data: &mut Data<'_>, parts: &[Part]) -> Option<Vec<f64>> {
    let simulated = simulate(parts, data.scene)?;
    let reduced = data.frame.reduce(&simulated.total);
    Some(data.recorded.iter().zip(&reduced).map(|(recorded, simulated)| recorded - simulated).collect())
}

/// Derivatives of the simulated output by each free parameter, per group.
pub fn tangent(data: &mut Data<'_>, parts: &[Part], free: &[Free]) -> Option<Vec<Vec<f64>>> {
    let base = simulate(parts, data.scene)?;
    let direct = |free: &Free| is_direct(parts, *free);
    let mut columns = vec![Vec::new(); free.len()];
    // The direct columns first: they read the load and output that were just simulated.
    for (index, part) in parts.iter().enumerate() {
        if !free.iter().any(|free| free.part == index && direct(free)) {
            continue;
        }
        let known = part.columns(data.scene)?;
        for (position, free) in free.iter().enumerate().filter(|(_, free)| free.part == index && direct(free)) {
            let name = &part.parameters[free.parameter].name;
            let column = known.iter().find(|(known, _)| known == name);
            columns[position] =
                column.map_or_else(|| vec![0.0; data.frame.len()], |(_, column)| data.frame.reduce(column));
        }
    }
    for (position, free) in free.iter().enumerate().filter(|(_, free)| !direct(free)) {
        columns[position] = difference(data, parts, *free, &base)?;
    }
    Some(columns)
}

/// Is the derivative simply the part's own column? Not where other parts read what this one simulates.
fn is_direct(parts: &[Part], free: Free) -> bool {
    let part = &parts[free.part];
    let linear = part.parameters[free.parameter].entry == Entry::Linear;
    let coupled = parts.iter().any(Part::acts_on_output) && !part.acts_on_output();
    let read = parts.iter().any(|other| part.is_read_by(other));
    linear && !coupled && !read
}

fn difference(data: &mut Data<'_>, parts: &[Part], free: Free, base: &Simulated) -> Option<Vec<f64>> {
    let mut parts = parts.to_vec();
    let parameter = &mut parts[free.part].parameters[free.parameter];
    let mut step = 1e-4 * parameter.value.abs().max(1e-3);
    if parameter.value + step > parameter.range.1 {
        step = -step;
    }
    parameter.value += step;
    let moved = simulate_changed(&parts, data.scene, base, free.part)?;
    let slope: Vec<f64> = moved.iter().zip(&base.total).map(|(moved, base)| (moved - base) / step).collect();
    Some(data.frame.reduce(&slope))
}
