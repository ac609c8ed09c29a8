//! How noisy each row is, and which rows are outliers: told by what a wide smooth model leaves.
//!
//! Only isolated outliers are cut: plain cutting by size would delete real effects at edges and in short events.

use super::inputs::RecordingInputs;
use super::linear_algebra::{CholeskyFactor, compute_gram_matrix};
use super::variant_bank::VariantBank;
use crate::hold_out::Random;
use ndarray::{Array1, Array2, ShapeBuilder};
use numerics::statistics::{count_to_f64, median, quantile, rms, robust_deviation};

/// Rows that the wide model is fitted to, at most.
const ROWS_MAX: usize = 6000;
/// Nameless curves in the wide model.
const CURVES_MAX: usize = 24;
/// Ratio of the noise of a row to the ordinary one.
const SCALES: (f64, f64) = (0.6, 4.0);
/// Rows on each side against which a row is judged.
const NEIGHBOURS: usize = 3;
/// Deviations from the neighbours' median beyond which a row is cut, and where the simulation jumps.
const CUT: f64 = 4.5;
const CUT_AT_JUMPS: f64 = 15.0;

/// Noise and outliers of the rows.
pub(super) struct Outliers {
    /// Noise of each row relative to the ordinary one.
    pub(super) scale: Vec<f64>,
    /// Deviation of the ordinary noise.
    pub(super) ordinary: f64,
    /// The recorded output with outliers cut.
    pub(super) recorded: Vec<f64>,
    /// What the wide smooth model leaves.
    pub(super) left: Vec<f64>,
}

/// Noise below this share of the output's size is none that a meter has: a series that a formula has written has its last digits.
const RESOLUTION: f64 = 1e-6;

impl Outliers {
    /// A recording without any noise makes every law infinitely likely or impossible. Noise that is finer than any meter stands in
    /// for what is not there, the same for the same recording.
    pub(super) fn dither_exact_output(&mut self, inputs: &RecordingInputs<'_>) {
        let taken: Vec<f64> = inputs.fitted_rows(false).map(|row| self.recorded[row]).collect();
        let size = RESOLUTION * rms(&taken);
        if self.ordinary >= size {
            return;
        }
        let mut random = Random::new(1);
        // Even numbers of this width have the deviation that is wanted.
        let width = 12.0_f64.sqrt() * size;
        for row in 0..inputs.rows {
            let step = width * (random.draw_uniform() - 0.5);
            self.recorded[row] += step;
            self.left[row] += step;
        }
        self.scale.fill(1.0);
        self.ordinary = size;
    }
}

pub(super) fn detect_outliers(inputs: &RecordingInputs<'_>, bank: &VariantBank, tangents: &[Vec<f64>]) -> Outliers {
    let recorded = inputs.scene.recorded_output();
    let residual = inputs.build_column(|row| recorded[row] - inputs.simulated[row]);
    let (left, ordinary) = fit_wide_model(inputs, bank, tangents, &residual);
    let scale = estimate_noise_scales(inputs, &left, ordinary);
    let middle = compute_running_median(inputs, &left);
    let moved = |row: usize| {
        let near = row.saturating_sub(1)..(row + 2).min(inputs.rows - 1);
        near.map(|at| (inputs.simulated[at + 1] - inputs.simulated[at]).abs()).fold(0.0, f64::max)
    };
    let law = |row: usize| {
        let limit = if moved(row) > 4.0 * ordinary { CUT_AT_JUMPS } else { CUT } * scale[row] * ordinary;
        let alone = (left[row] - middle[row]).clamp(-limit, limit);
        let value = recorded[row] - left[row] + middle[row] + alone;
        if inputs.comparable[row] { value } else { inputs.simulated[row] }
    };
    let recorded = inputs.build_column(law);
    Outliers { recorded, scale, ordinary, left }
}

/// What a ridge of smooth curves and edges leaves of the residual, and the ordinary deviation of it.
fn fit_wide_model(
    inputs: &RecordingInputs<'_>,
    bank: &VariantBank,
    tangents: &[Vec<f64>],
    residual: &[f64],
) -> (Vec<f64>, f64) {
    let columns = select_wide_columns(bank, tangents);
    let all: Vec<usize> = inputs.fitted_rows(false).collect();
    let rows: Vec<usize> = all.iter().copied().step_by(all.len().div_ceil(ROWS_MAX).max(1)).collect();
    let mut tall = Array2::zeros((rows.len(), columns.len()).f());
    for (index, column) in columns.iter().enumerate() {
        let size = if index < tangents.len() { rms(column) + 1e-30 } else { 1.0 };
        tall.column_mut(index).iter_mut().zip(&rows).for_each(|(cell, row)| *cell = column[*row] / size);
    }
    let gram = compute_gram_matrix(tall.view());
    let output: Vec<f64> = rows.iter().map(|row| residual[*row]).collect();
    let middle =
        numerics::statistics::mean(&rows.iter().map(|row| inputs.scene.recorded_output()[*row]).collect::<Vec<_>>());
    let spread: Vec<f64> = rows.iter().map(|row| inputs.scene.recorded_output()[*row] - middle).collect();
    let spread = rms(&spread) + 1e-12;
    let mut ordinary = robust_deviation(output.iter().copied()).unwrap_or(0.0) + 1e-12;
    let mut wanted = Array1::from(output.clone());
    let mut w = Array1::zeros(columns.len());
    for _ in 0..3 {
        let mut inner = gram.clone();
        for index in 0..columns.len() {
            let own = if index < tangents.len() { 1e-8 } else { 1.0 };
            inner[[index, index]] += own * (ordinary / (0.1 * spread)).powi(2) + 1e-9 * count_to_f64(rows.len());
        }
        w = CholeskyFactor::from_matrix(&inner).solve_system(&tall.t().dot(&wanted));
        let fitted = tall.dot(&w);
        let left: Vec<f64> = output.iter().zip(&fitted).map(|(y, f)| y - f).collect();
        ordinary = robust_deviation(left.iter().copied()).unwrap_or(0.0) + 1e-12;
        let limit = 3.0 * ordinary;
        wanted = fitted.iter().zip(&left).map(|(f, left)| f + left.clamp(-limit, limit)).collect();
    }
    let mut left = residual.to_vec();
    for (index, column) in columns.iter().enumerate() {
        let size = if index < tangents.len() { rms(column) + 1e-30 } else { 1.0 };
        left.iter_mut().zip(*column).for_each(|(left, x)| *left -= w[index] * x / size);
    }
    (left, ordinary)
}

/// Tangents, smooth curves and everything that acts at edges.
fn select_wide_columns<'a>(bank: &'a VariantBank, tangents: &'a [Vec<f64>]) -> Vec<&'a Vec<f64>> {
    let curves = bank.variants.iter().filter(|variant| {
        variant
            .nameless_curve()
            .is_some_and(|drawn| drawn.shape == "bumps" && ["1", "cut", "direction"].contains(&drawn.times))
    });
    let at_edges = bank.variants.iter().filter(|variant| variant.acts_at_edges());
    let variants = curves.take(CURVES_MAX).chain(at_edges);
    tangents.iter().chain(variants.flat_map(|variant| &bank.columns[variant.columns.clone()])).collect()
}

/// Noise of each row relative to the ordinary one, by fifths of the simulated size and by the engagement.
fn estimate_noise_scales(inputs: &RecordingInputs<'_>, left: &[f64], ordinary: f64) -> Vec<f64> {
    let size = |row: usize| inputs.simulated[row].abs();
    let edge = |share: f64| quantile(inputs.fitted_rows(false).map(size), share).unwrap_or(0.0);
    let edges = [0.2, 0.4, 0.6, 0.8].map(edge);
    let class = |row: usize| {
        let fifth = edges.iter().filter(|edge| size(row) >= **edge).count();
        2 * fifth + usize::from(inputs.engaged.is_some() && inputs.in_cut[row])
    };
    let mut of_class = [1.0; 10];
    for (number, scale) in of_class.iter_mut().enumerate() {
        let own: Vec<f64> =
            inputs.fitted_rows(false).filter(|row| class(*row) == number).map(|row| left[row]).collect();
        if own.len() > 60 {
            let middle = median(own.clone()).unwrap_or(0.0);
            let deviation = robust_deviation(own.iter().map(|x| x - middle)).unwrap_or(ordinary);
            *scale = (deviation / ordinary).clamp(SCALES.0, SCALES.1);
        }
    }
    inputs.build_column(|row| of_class[class(row)])
}

fn compute_running_median(inputs: &RecordingInputs<'_>, values: &[f64]) -> Vec<f64> {
    inputs.build_column(|row| {
        let near = row.saturating_sub(NEIGHBOURS)..(row + NEIGHBOURS + 1).min(inputs.rows);
        median(near.map(|at| if inputs.comparable[at] { values[at] } else { 0.0 }).collect()).unwrap_or(0.0)
    })
}
