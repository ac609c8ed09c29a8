//! The Gram matrix of a stage: inner products of the baseline's tangents, the levels of the runs, every column of the bank
//! and the output, whitened for one noise.
//!
//! Every hypothesis is a Schur complement of it. For the inner test the columns of one hypothesis alone are whitened and
//! summed unit by unit (`cross_validation.rs`): leaving a unit out is a difference.

use super::inputs::RecordingInputs;
use super::linear_algebra::compute_gram_matrix;
use super::noise::NoiseModel;
use super::variant_bank::VariantBank;
use ndarray::{Array2, ShapeBuilder};
use numerics::statistics::{count_to_f64, rms};
use std::ops::Range;

/// Independent rows beyond which more rows do not make a form of a law truer: evidence is tempered there.
const ROWS_OF_A_FORM: f64 = 3000.0;

/// What is compared: the recorded output less the refitted simulation, its tangents and the bank, over the fitted rows.
pub(super) struct Comparison<'a> {
    pub(super) bank: &'a VariantBank,
    /// Fitted rows in order; the first of each group where neighbours are averaged.
    pub(super) rows: Vec<usize>,
    /// How many neighbours are averaged, at most.
    pub(super) group: usize,
    /// Stretches of unbroken noise, as places in `rows`.
    pub(super) blocks: Vec<Range<usize>>,
    /// Noise of each row relative to the ordinary one.
    scale: Vec<f64>,
    /// Row after the last of each group.
    ends: Vec<usize>,
    /// Tangents of the baseline and levels of the runs, full length.
    fixed: Vec<Vec<f64>>,
    /// How many tangents there are; the levels of the runs follow.
    pub(super) tangents: usize,
    /// Recorded less simulated, full length.
    output: Vec<f64>,
    /// Deviation of the recorded output.
    pub(super) deviation: f64,
    /// Size of the recorded output, three deviations at most.
    pub(super) size: f64,
    /// Share of each row that counts as evidence.
    pub(super) tempering: f64,
}

/// The same whitened for one noise.
pub(super) struct Gram {
    pub(super) noise: NoiseModel,
    pub(super) whole: Array2<f64>,
}

/// What a comparison is made from, besides the bank.
pub(super) struct ComparisonInput<'a> {
    pub(super) tangents: &'a [Vec<f64>],
    /// Recorded output with outliers cut.
    pub(super) recorded: &'a [f64],
    /// Noise of each row relative to the ordinary one.
    pub(super) scale: &'a [f64],
}

impl<'a> Comparison<'a> {
    /// Compares over the fitted rows, one by one where there are at most so many; beyond, neighbours are averaged *after*
    /// every law has been evaluated row by row, so that edges keep their shape.
    pub(super) fn new(
        inputs: &RecordingInputs<'_>,
        bank: &'a VariantBank,
        of: &ComparisonInput<'_>,
        rows_max: usize,
    ) -> Self {
        let (group, rows) = group_rows(inputs, rows_max);
        let recorded: Vec<f64> = rows.iter().map(|row| of.recorded[*row]).collect();
        let middle = numerics::statistics::mean(&recorded);
        let around: Vec<f64> = recorded.iter().map(|y| y - middle).collect();
        let deviation = rms(&around) + 1e-12;
        let mut fixed: Vec<Vec<f64>> = of.tangents.iter().map(|tangent| scale_to_unit_rms(tangent, &rows)).collect();
        let tangents = fixed.len();
        fixed.extend(build_run_levels(inputs));
        Self {
            bank,
            blocks: inputs.list_unbroken_stretches(&rows),
            scale: rows.iter().map(|row| of.scale[*row]).collect(),
            group,
            ends: find_group_ends(&rows, inputs),
            fixed,
            tangents,
            output: of.recorded.iter().zip(&inputs.simulated).map(|(y, f)| y - f).collect(),
            deviation,
            size: rms(&recorded).min(3.0 * deviation),
            tempering: (ROWS_OF_A_FORM / count_to_f64(rows.len().max(1))).min(1.0),
            rows,
        }
    }

    /// A noise of these rows as it is from one recorded row to the next.
    pub(super) fn convert_noise_to_rows(&self, noise: NoiseModel) -> NoiseModel {
        if self.group == 1 {
            noise
        } else {
            NoiseModel::from_share_and_phi(noise.share, noise.phi.powf(1.0 / count_to_f64(self.group)))
        }
    }

    /// How many columns stand before those of the bank.
    pub(super) fn count_fixed_columns(&self) -> usize {
        self.fixed.len()
    }

    /// Columns of a variant.
    pub(super) fn variant_columns(&self, variant: usize) -> Range<usize> {
        let of = &self.bank.variants[variant].columns;
        self.count_fixed_columns() + of.start..self.count_fixed_columns() + of.end
    }

    /// Tangents of the baseline, levels of the runs and the output, as they stand in the Gram matrix.
    pub(super) fn fixed_and_output(&self) -> (&[Vec<f64>], &[f64]) {
        (&self.fixed, &self.output)
    }

    /// A tangent of the baseline, of the size it has here.
    pub(super) fn tangent(&self, index: usize) -> &[f64] {
        &self.fixed[index]
    }

    /// A full-length column whitened over the fitted rows.
    pub(super) fn whiten_column(&self, column: &[f64], noise: NoiseModel) -> Vec<f64> {
        let mut white: Vec<f64> = if self.group == 1 {
            self.rows.iter().zip(&self.scale).map(|(row, scale)| column[*row] / scale).collect()
        } else {
            let groups = self.rows.iter().zip(&self.ends).zip(&self.scale);
            groups.map(|((row, end), scale)| numerics::statistics::mean(&column[*row..*end]) / scale).collect()
        };
        noise.whiten_column(&mut white, &self.blocks);
        white
    }

    /// Every column whitened, one after the other: those before the bank, these of the bank, the output.
    pub(super) fn build_whitened_matrix(&self, noise: NoiseModel, takes: impl Fn(usize) -> bool) -> Array2<f64> {
        let of_bank = self.bank.columns.iter().enumerate().filter(|(index, _)| takes(*index)).map(|(_, c)| c);
        let columns: Vec<&[f64]> = self.fixed.iter().chain(of_bank).chain([&self.output]).map(Vec::as_slice).collect();
        self.whiten_columns(&columns, noise)
    }

    /// These full-length columns whitened over the fitted rows.
    pub(super) fn whiten_columns(&self, columns: &[&[f64]], noise: NoiseModel) -> Array2<f64> {
        let mut tall = Array2::zeros((self.rows.len(), columns.len()).f());
        for (index, column) in columns.iter().enumerate() {
            let white = self.whiten_column(column, noise);
            tall.column_mut(index).iter_mut().zip(white).for_each(|(cell, x)| *cell = x);
        }
        tall
    }

    /// The Gram matrix for this noise.
    pub(super) fn compute_gram(&self, noise: NoiseModel) -> Gram {
        self.compute_partial_gram(noise, |_| true)
    }

    /// The same of some columns of the bank only.
    pub(super) fn compute_partial_gram(&self, noise: NoiseModel, takes: impl Fn(usize) -> bool) -> Gram {
        Gram { noise, whole: compute_gram_matrix(self.build_whitened_matrix(noise, takes).view()) }
    }
}

/// How many neighbours are averaged, and the first fitted row of each group: groups never cross stretches of unbroken noise
/// or rows that are not fitted.
fn group_rows(inputs: &RecordingInputs<'_>, rows_max: usize) -> (usize, Vec<usize>) {
    let all: Vec<usize> = inputs.fitted_rows(false).collect();
    let group = all.len().div_ceil(rows_max).max(1);
    let mut rows: Vec<usize> = Vec::with_capacity(all.len() / group + 1);
    let mut size = 0;
    for (at, row) in all.iter().enumerate() {
        let goes_on = at > 0 && all[at - 1] + 1 == *row && inputs.block[*row] == inputs.block[row - 1];
        if goes_on && size < group {
            size += 1;
        } else {
            rows.push(*row);
            size = 1;
        }
    }
    (group, rows)
}

/// Row after the last fitted one of each group that begins at these rows.
fn find_group_ends(rows: &[usize], inputs: &RecordingInputs<'_>) -> Vec<usize> {
    let mut ends: Vec<usize> = Vec::with_capacity(rows.len());
    let mut next = rows.iter().skip(1).peekable();
    for row in rows {
        let limit = next.next().copied().unwrap_or(inputs.rows);
        let last = (*row + 1..limit).take_while(|row| inputs.fitted[*row]).last().unwrap_or(*row);
        ends.push(last + 1);
    }
    ends
}

fn scale_to_unit_rms(column: &[f64], rows: &[usize]) -> Vec<f64> {
    let taken: Vec<f64> = rows.iter().map(|row| column[*row]).collect();
    let size = rms(&taken) + 1e-30;
    column.iter().map(|x| x / size).collect()
}

/// A level of each run with fitted rows; none where a recording has too many or too few of them to tell.
fn build_run_levels(inputs: &RecordingInputs<'_>) -> Vec<Vec<f64>> {
    let runs = inputs.scene.runs();
    let fitted: Vec<usize> = (0..runs.len()).filter(|run| runs[*run].clone().any(|row| inputs.fitted[row])).collect();
    if !(2..=30).contains(&fitted.len()) {
        return Vec::new();
    }
    let level = |run: &usize| inputs.build_column(|row| f64::from(u8::from(inputs.run[row] == *run)));
    fitted.iter().map(level).collect()
}
