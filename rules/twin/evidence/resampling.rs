//! The posterior averaged over resamples of the fitted rows: what holds only because of a few stretches loses.
//!
//! Each resample weighs the pieces of the fitted rows anew (Dirichlet weights, the Bayesian bootstrap: Rubin, Annals of
//! Statistics 9, 1981), and the posterior probabilities of all sets are averaged over the resamples (BayesBag: Huggins and
//! Miller, Bayesian Analysis 18, 2023). Two explanations that no law separates share their probability, however many rows
//! there are; a posterior of all rows as they are gives it to one of them.

use super::gram::Comparison;
use super::linear_algebra::{CholeskyFactor, compute_gram_matrix, compute_schur_complement, extract_block};
use super::marginal::{SIZES, compute_ln_size_prior, log_sum_exp};
use super::posterior::NoiseSetting;
use super::search::Members;
use crate::hold_out::Random;
use ndarray::{Array1, Array2, Axis, s};
use numerics::statistics::{count_to_f64, normal_share};
use std::collections::BTreeMap;
use std::ops::Range;

/// Resamples: the averaged probability is known to a twentieth.
const DRAWS: usize = 32;
/// Pieces that are wanted, and the most.
const PIECES: f64 = 24.0;
const PIECES_MAX: usize = 48;
/// Least length of a piece: rows, and memories of the noise, so that pieces are independent.
const PIECE_ROWS: f64 = 30.0;
const PIECE_MEMORIES: f64 = 3.0;
/// Seed of the weights: the same recording gives the same answer.
const SEED: u64 = 1;

/// One set under one noise.
pub(super) struct Candidate<'a> {
    /// Which set it is: candidates of one set under several noises share it.
    pub(super) set: usize,
    /// Number of the noise.
    pub(super) noise: usize,
    pub(super) members: &'a Members,
}

/// Pieces of the fitted rows, as places among them, never across stretches of unbroken noise; short neighbours share one.
pub(super) fn split_into_pieces(blocks: &[Range<usize>], rows: usize, memory: f64) -> Vec<Vec<usize>> {
    let size = (count_to_f64(rows) / PIECES).max(PIECE_ROWS).max(PIECE_MEMORIES * memory);
    let mut all: Vec<Vec<usize>> = Vec::new();
    for range in blocks {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of pieces")]
        let number = (count_to_f64(range.len()) / size).round().max(1.0) as usize;
        for piece in 0..number {
            let at = |piece: usize| range.start + range.len() * piece / number;
            let own = at(piece)..at(piece + 1);
            match all.last_mut() {
                Some(last) if count_to_f64(last.len()) < 0.5 * size && count_to_f64(own.len()) < 0.5 * size => {
                    last.extend(own)
                }
                _ => all.push(own.collect()),
            }
        }
    }
    if all.len() <= PIECES_MAX {
        return all;
    }
    let mut merged: Vec<Vec<usize>> = vec![Vec::new(); PIECES_MAX];
    let total = all.len();
    all.into_iter().enumerate().for_each(|(index, own)| merged[index * PIECES_MAX / total].extend(own));
    merged
}

/// Dirichlet weights of this many pieces, of mean one.
fn draw_dirichlet_weights(pieces: usize, random: &mut Random) -> Vec<f64> {
    let drawn: Vec<f64> = (0..pieces).map(|_| -random.draw_uniform().ln()).collect();
    let mean = drawn.iter().sum::<f64>() / count_to_f64(pieces.max(1));
    drawn.iter().map(|x| x / mean).collect()
}

/// The bag over the columns that some sets need.
pub(super) struct Bag<'a> {
    comparison: &'a Comparison<'a>,
    settings: &'a [NoiseSetting],
    priors: &'a [f64],
    pieces: Vec<Vec<usize>>,
    /// First column of each variant among the columns that are needed.
    first_columns: BTreeMap<usize, usize>,
    columns: Vec<&'a [f64]>,
}

impl<'a> Bag<'a> {
    /// Over the columns that these candidates need.
    pub(super) fn new(
        comparison: &'a Comparison<'a>,
        settings: &'a [NoiseSetting],
        priors: &'a [f64],
        candidates: &[Candidate<'_>],
    ) -> Self {
        let (fixed, output) = comparison.fixed_and_output();
        let mut columns: Vec<&[f64]> = fixed.iter().map(Vec::as_slice).collect();
        let mut places = BTreeMap::new();
        for (variant, _) in candidates.iter().flat_map(|candidate| candidate.members) {
            places.entry(*variant).or_insert_with(|| {
                let at = columns.len();
                let of = comparison.bank.variants[*variant].columns.clone();
                columns.extend(comparison.bank.columns[of].iter().map(Vec::as_slice));
                at
            });
        }
        columns.push(output);
        let memory = settings.iter().map(|setting| setting.gram.noise.correlation_rows()).fold(0.0, f64::max);
        let pieces = split_into_pieces(&comparison.blocks, comparison.rows.len(), memory);
        Self { comparison, settings, priors, pieces, first_columns: places, columns }
    }

    /// Logarithm of the averaged probability of each of so many sets.
    pub(super) fn average_posterior(&self, candidates: &[Candidate<'_>], sets: usize) -> Vec<f64> {
        let mut random = Random::new(SEED);
        let draws: Vec<Vec<f64>> = (0..DRAWS).map(|_| draw_dirichlet_weights(self.pieces.len(), &mut random)).collect();
        let mut totals: Vec<Vec<Vec<f64>>> = vec![vec![Vec::new(); sets]; DRAWS];
        for (noise, setting) in self.settings.iter().enumerate() {
            let own: Vec<&Candidate<'_>> = candidates.iter().filter(|candidate| candidate.noise == noise).collect();
            if own.is_empty() {
                continue;
            }
            let grams = self.compute_piece_grams(setting);
            for (weights, totals) in draws.iter().zip(&mut totals) {
                let ground = self.build_resample(setting, &grams, weights);
                own.iter()
                    .for_each(|one| totals[one.set].push(self.compute_ln_evidence(&ground, setting, one.members)));
            }
        }
        let share = |sets: &Vec<Vec<f64>>| -> Vec<f64> {
            let sums: Vec<f64> = sets.iter().map(|all| log_sum_exp(all.iter().copied())).collect();
            let whole = log_sum_exp(sums.iter().copied());
            sums.iter().map(|sum| (sum - whole).max(-700.0)).collect()
        };
        let each: Vec<Vec<f64>> = totals.iter().map(share).collect();
        (0..sets).map(|set| log_sum_exp(each.iter().map(|draw| draw[set])) - count_to_f64(DRAWS).ln()).collect()
    }

    /// Inner products of the columns in each piece.
    fn compute_piece_grams(&self, setting: &NoiseSetting) -> Vec<Array2<f64>> {
        let tall = self.comparison.whiten_columns(&self.columns, setting.gram.noise);
        let of = |piece: &Vec<usize>| match (piece.first(), piece.last()) {
            (Some(first), Some(last)) if last + 1 - first == piece.len() => {
                compute_gram_matrix(tall.slice(s![*first..=*last, ..]))
            }
            _ => compute_gram_matrix(tall.select(Axis(0), piece).view()),
        };
        self.pieces.iter().map(of).collect()
    }

    /// A resample with the baseline projected out, and its evidence.
    fn build_resample(&self, setting: &NoiseSetting, grams: &[Array2<f64>], weights: &[f64]) -> BagGround {
        let comparison = self.comparison;
        let size = self.columns.len();
        let mut gram = Array2::zeros((size, size));
        weights.iter().zip(grams).for_each(|(weight, part)| gram.scaled_add(*weight, part));
        let rows: f64 =
            weights.iter().zip(&self.pieces).map(|(weight, piece)| weight * count_to_f64(piece.len())).sum();
        let variance = setting.saturated.variance;
        let ridge = comparison.build_fixed_ridge(&gram, variance);
        let fixed: Vec<usize> = (0..comparison.count_fixed_columns()).collect();
        let (left, ln_determinant) = compute_schur_complement(&gram, &fixed, &ridge);
        let last = size - 1;
        let square = left[[last, last]].max(1e-12 * gram[[last, last]]);
        let share = rows / count_to_f64(comparison.rows.len());
        let noise = share * setting.gram.noise.ln_determinant(comparison.rows.len(), comparison.blocks.len());
        let levels: f64 = ridge[comparison.tangents..].iter().map(|ridge| ridge.ln()).sum();
        let likelihood = -0.5 * comparison.tempering * (rows * (square / rows).ln() + noise);
        let ln = likelihood - 0.5 * (ln_determinant - comparison.ln_tangent_determinant(&gram) - levels);
        BagGround { left, square, rows, ln }
    }

    /// Logarithm of the evidence of a set in a resample.
    fn compute_ln_evidence(&self, ground: &BagGround, setting: &NoiseSetting, members: &Members) -> f64 {
        if members.is_empty() {
            return ground.ln;
        }
        let comparison = self.comparison;
        let deviation = comparison.deviation / setting.saturated.variance.sqrt();
        let (mut all, mut scales) = (Vec::new(), Vec::new());
        for (variant, size) in members {
            let of = &comparison.bank.variants[*variant];
            let at = self.first_columns[variant];
            all.extend(at..at + of.relative.len());
            scales.extend(of.relative.iter().map(|relative| relative * SIZES[*size] * deviation));
        }
        let last = self.columns.len() - 1;
        let mut inner = extract_block(&ground.left, &all, &all);
        for i in 0..all.len() {
            for j in 0..all.len() {
                inner[[i, j]] *= scales[i] * scales[j];
            }
            inner[[i, i]] += 1.0;
        }
        let along =
            Array1::from_iter(all.iter().zip(&scales).map(|(index, scale)| ground.left[[*index, last]] * scale));
        let factor = CholeskyFactor::from_matrix(&inner);
        let solved = factor.solve_system(&along);
        let kept = (ground.square - along.dot(&solved)).max(1e-6 * ground.square);
        let rows = comparison.tempering * ground.rows;
        let mut ln = ground.ln - 0.5 * rows * (kept / ground.square).ln() - 0.5 * factor.ln_determinant();
        let variances = factor.compute_inverse_diagonal();
        let mut at = 0;
        for (variant, size) in members {
            let of = &comparison.bank.variants[*variant];
            ln += self.priors[*variant] + compute_ln_size_prior(of, *size);
            if of.sign() != 0.0 {
                let spread = (variances[at] / comparison.tempering.max(1e-3)).sqrt();
                ln += (2.0 * normal_share(of.sign() * solved[at] / (spread + 1e-300)) + 1e-12).ln();
            }
            at += of.relative.len();
        }
        ln
    }
}

/// A resample with the baseline projected out.
struct BagGround {
    left: Array2<f64>,
    /// Sum of squares left of the output.
    square: f64,
    /// Rows, as they weigh.
    rows: f64,
    /// Logarithm of the evidence of nothing.
    ln: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_hold_every_row_once_and_never_cross_a_break() {
        let blocks = [0..700, 700..720, 720..735, 735..1500];
        let pieces = split_into_pieces(&blocks, 1500, 4.0);
        let mut all: Vec<usize> = pieces.iter().flatten().copied().collect();
        all.sort_unstable();
        assert_eq!(all, (0..1500).collect::<Vec<_>>());
        assert!(pieces.iter().all(|piece| !(piece.contains(&699) && piece.contains(&700))));
        assert!(pieces.len() > 20 && pieces.len() <= PIECES_MAX, "{}", pieces.len());
    }

    #[test]
    fn weights_have_a_mean_of_one_and_follow_from_the_seed() {
        let of = || draw_dirichlet_weights(24, &mut Random::new(7));
        assert_eq!(of(), of());
        assert!((of().iter().sum::<f64>() - 24.0).abs() < 1e-9);
    }
}
