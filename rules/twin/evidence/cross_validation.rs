//! The inner test: does a hypothesis whose sizes come from the other fitted units lower the error in each unit?
//!
//! It is asked in the metric of the noise and paired over stretches, so that slow noise, which nothing predicts, does not
//! drown what is there. Only fitted units are asked; those that are held out stay out of it.

use super::gram::Comparison;
use super::inputs::RecordingInputs;
use super::linear_algebra::{CholeskyFactor, compute_gram_matrix};
use super::marginal::SIZES;
use super::posterior::NoiseSetting;
use super::recursive_least_squares::Follower;
use ndarray::{Array1, Array2, Axis, s};
use numerics::statistics::count_to_f64;
use std::collections::BTreeMap;
use std::ops::Range;

/// Stretches over which errors are paired, s, and rows of one at least.
const PAIRED_S: f64 = 15.0;
const PAIRED_ROWS: f64 = 10.0;
/// Inner parts, at most: more units share them in turn.
const PARTS_MAX: usize = 12;
/// Share of a column's square below which it does not act in the other parts.
const NEVER: f64 = 1e-9;

/// The columns of one hypothesis, whitened, with their inner products in every part.
pub(super) struct Inner<'a> {
    comparison: &'a Comparison<'a>,
    inputs: &'a RecordingInputs<'a>,
    tall: Array2<f64>,
    parts: Vec<Vec<usize>>,
    grams: Vec<Array2<f64>>,
    ridge: Vec<f64>,
    /// Deviation of an innovation.
    deviation: f64,
    /// Columns of each member, and those that every hypothesis has.
    members: Vec<Range<usize>>,
    fixed: usize,
}

impl<'a> Inner<'a> {
    pub(super) fn new(
        inputs: &'a RecordingInputs<'a>,
        comparison: &'a Comparison<'a>,
        setting: &NoiseSetting,
        members: &[(usize, usize)],
    ) -> Self {
        let (fixed, output) = comparison.fixed_and_output();
        let mut columns: Vec<&[f64]> = fixed.iter().map(Vec::as_slice).collect();
        let mut ridge = comparison.build_fixed_ridge(&setting.gram.whole, setting.saturated.variance);
        let mut places = Vec::new();
        for (variant, size) in members {
            let of = &comparison.bank.variants[*variant];
            places.push(columns.len()..columns.len() + of.relative.len());
            columns.extend(comparison.bank.columns[of.columns.clone()].iter().map(Vec::as_slice));
            let deviation = SIZES[*size] * comparison.deviation;
            ridge.extend(of.relative.iter().map(|d| setting.saturated.variance / (deviation * d).powi(2)));
        }
        columns.push(output);
        let tall = comparison.whiten_columns(&columns, setting.gram.noise);
        let parts = split_into_parts(inputs, comparison);
        let deviation = setting.saturated.variance.sqrt();
        let grams = parts.iter().map(|part| compute_gram_matrix(tall.select(Axis(0), part).view())).collect();
        Self { comparison, inputs, tall, parts, grams, ridge, deviation, members: places, fixed: fixed.len() }
    }

    /// Gain of these members over those: in deviations of it, and in squares.
    pub(super) fn compute_gain(&self, with: &[usize], without: &[usize]) -> (f64, f64) {
        let whole = self.grams.iter().skip(1).fold(self.grams[0].clone(), |sum, gram| sum + gram);
        let mut gained: Vec<(usize, f64)> = Vec::new();
        for (part, gram) in self.parts.iter().zip(&self.grams) {
            let others = &whole - gram;
            let after = self.compute_part_errors(part, &others, &whole, with);
            let before = self.compute_part_errors(part, &others, &whole, without);
            for ((at, after), before) in part.iter().zip(after).zip(before) {
                gained.push((self.comparison.rows[*at], before * before - after * after));
            }
        }
        sum_paired_gains(self.inputs.period_s, gained)
    }

    /// Errors in the rows of a part, sizes from the others; columns that act in this part only are followed through it.
    fn compute_part_errors(
        &self,
        part: &[usize],
        others: &Array2<f64>,
        whole: &Array2<f64>,
        members: &[usize],
    ) -> Vec<f64> {
        let w = self.solve_posterior_means(others, members);
        let own = members.iter().flat_map(|member| self.members[*member].clone());
        let strange: Vec<usize> = own.filter(|at| others[[*at, *at]] <= NEVER * whole[[*at, *at]]).collect();
        let variances: Vec<f64> = strange.iter().map(|at| 1.0 / self.ridge[*at]).collect();
        let mut follower = Follower::new(&variances);
        let error = |at: &usize| {
            let line = self.tall.row(*at);
            let left = line[line.len() - 1] - line.slice(s![..line.len() - 1]).dot(&w);
            let columns: Array1<f64> = strange.iter().map(|at| line[*at]).collect();
            let expected = follower.predict_row(&columns);
            if columns.iter().any(|x| *x != 0.0) {
                follower.update_with_row(&columns, left / self.deviation);
            }
            left - self.deviation * expected
        };
        part.iter().map(error).collect()
    }

    /// Posterior means of some members, zero for the others; a run that is left out has no level.
    fn solve_posterior_means(&self, gram: &Array2<f64>, members: &[usize]) -> Array1<f64> {
        let last = gram.nrows() - 1;
        let own = members.iter().flat_map(|member| self.members[*member].clone());
        let all: Vec<usize> = (0..self.fixed).chain(own).collect();
        let mut inner = super::linear_algebra::extract_block(gram, &all, &all);
        all.iter().enumerate().for_each(|(at, index)| inner[[at, at]] += self.ridge[*index]);
        let right = Array1::from_iter(all.iter().map(|index| gram[[*index, last]]));
        let solved = CholeskyFactor::from_matrix(&inner).solve_system(&right);
        let mut w = Array1::zeros(last);
        all.iter().zip(&solved).for_each(|(index, x)| w[*index] = *x);
        w
    }
}

/// The sum of what is gained in rows, in deviations of it by stretches, and as it is.
pub(super) fn sum_paired_gains(period_s: f64, rows: impl IntoIterator<Item = (usize, f64)>) -> (f64, f64) {
    let stretch = (PAIRED_S / period_s).round().max(PAIRED_ROWS);
    let mut gained: BTreeMap<usize, f64> = BTreeMap::new();
    for (row, gain) in rows {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a count of rows")]
        let number = (count_to_f64(row) / stretch) as usize;
        *gained.entry(number).or_default() += gain;
    }
    let sum: f64 = gained.values().sum();
    let squares: f64 = gained.values().map(|x| x * x).sum();
    (sum / (squares.sqrt() + 1e-30), sum)
}

/// Places of the rows of each part: the fitted units in turn.
pub(super) fn split_into_parts(inputs: &RecordingInputs<'_>, comparison: &Comparison<'_>) -> Vec<Vec<usize>> {
    let mut number: BTreeMap<usize, usize> = BTreeMap::new();
    let mut parts: Vec<Vec<usize>> = Vec::new();
    for (at, row) in comparison.rows.iter().enumerate() {
        let next = number.len() % PARTS_MAX;
        let part = *number.entry(inputs.unit[*row]).or_insert(next);
        if part == parts.len() {
            parts.push(Vec::new());
        }
        parts[part].push(at);
    }
    parts
}
