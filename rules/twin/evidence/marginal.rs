//! The evidence of a hypothesis: how likely the recording is when all sizes are summed out that the prior allows.
//!
//! With `A = D G D = U g U'` the block of a variant after everything before it is projected out, `b = U' D G_y`,
//! `lambda = s^2 S^2 / sigma^2`:
//!
//! `ln E = -(kappa n / 2) ln((q - sum lambda b^2 / (1 + lambda g)) / q) - 1/2 sum ln(1 + lambda g) + ln 2 Phi(sign w0 / sd) + ln p(s)`

use super::gram::{Comparison, Gram};
use super::linear_algebra::{CholeskyFactor, Resolved, Tridiagonal, compute_schur_complement, extract_block};
use super::noise::NoiseModel;
use super::variant_bank::Variant;
use ndarray::linalg::general_mat_mul;
use ndarray::{Array1, Array2, Axis, s};
use numerics::statistics::{count_to_f64, normal_share};

/// Sizes of a contribution, in deviations of the output, and their prior probabilities.
pub(super) const SIZES: [f64; 7] = [0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0];
const SIZE_PRIORS: [f64; 7] = [0.12, 0.22, 0.24, 0.2, 0.12, 0.07, 0.03];
/// What a size beyond the largest of its family costs, as a logarithm: odds of 1 to 3000, so that only a much better fit
/// makes a law larger than its family is known to be.
const TOO_LARGE: f64 = -8.0;
/// Deviation of the random level of a run, as a share of the output: a meter and a machine are never quite the same again.
const RUN_LEVEL: f64 = 0.004;
/// Deviation of a column of the saturated model, as a share of the output's.
const SATURATED: f64 = 0.05;
/// Ridge of the baseline's tangents, as a share of their mean size: the flat prior, made solvable.
const FLAT: f64 = 1e-9;

/// Share of its square that the baseline must leave of a law: below it rounding decides.
const HIDDEN: f64 = 1e-6;

/// The saturated model: what remains when every nameless curve is free.
#[derive(Debug, Clone, Copy)]
pub(super) struct Saturated {
    /// Variance of an innovation.
    pub(super) variance: f64,
    /// Logarithm of its likelihood.
    pub(super) ln_likelihood: f64,
}

/// The Gram matrix that a search starts from: the baseline projected out, and where each variant stands in it.
pub(super) struct Ground {
    pub(super) gram: Array2<f64>,
    /// Variants of whose law the baseline leaves next to nothing: no recording like this one tells them.
    hidden: Vec<bool>,
    /// First column of each variant; `None` of what is not in it.
    pub(super) starts: Vec<Option<usize>>,
    pub(super) variance: f64,
}

/// What a hypothesis takes out of it: `gram - reach reach'` is left.
pub(super) struct MarginalState<'g> {
    ground: &'g Ground,
    reach: Array2<f64>,
    /// Sum of squares left of the output.
    left: f64,
}

impl Ground {
    /// Nothing taken out yet.
    pub(super) fn build_initial_state(&self) -> MarginalState<'_> {
        let size = self.gram.nrows();
        MarginalState {
            ground: self,
            reach: Array2::zeros((size, 0)),
            left: self.gram[[size - 1, size - 1]].max(f64::MIN_POSITIVE),
        }
    }

    /// Inner products of every column with the output.
    pub(super) fn extract_output_products(&self) -> Array1<f64> {
        let last = self.gram.nrows() - 1;
        self.gram.slice(s![..last, last]).to_owned()
    }

    /// Sum of squares of the output.
    pub(super) fn output_square(&self) -> f64 {
        let last = self.gram.nrows() - 1;
        self.gram[[last, last]].max(f64::MIN_POSITIVE)
    }

    /// The same of another output, given its inner products with every column and its sum of squares.
    pub(super) fn with_output(&self, along: &Array1<f64>, square: f64) -> Self {
        let mut gram = self.gram.clone();
        let last = gram.nrows() - 1;
        gram.slice_mut(s![..last, last]).assign(along);
        gram.slice_mut(s![last, ..last]).assign(along);
        gram[[last, last]] = square;
        Self { gram, hidden: self.hidden.clone(), starts: self.starts.clone(), variance: self.variance }
    }

    /// The part that holds some variants only.
    pub(super) fn select_variants(
        &self,
        variants: impl Iterator<Item = usize>,
        columns: impl Fn(usize) -> usize,
    ) -> Self {
        let mut all = Vec::new();
        let mut starts = vec![None; self.starts.len()];
        for variant in variants {
            if let (None, Some(start)) = (starts[variant], self.starts[variant]) {
                starts[variant] = Some(all.len());
                all.extend(start..start + columns(variant));
            }
        }
        all.push(self.gram.nrows() - 1);
        let hidden = self.hidden.clone();
        Self { gram: extract_block(&self.gram, &all, &all), hidden, starts, variance: self.variance }
    }

    /// Does the baseline leave next to nothing of this variant's law?
    pub(super) fn is_variant_hidden(&self, variant: usize) -> bool {
        self.hidden[variant]
    }
}

impl MarginalState<'_> {
    /// Does the baseline leave next to nothing of this variant's law?
    pub(super) fn is_variant_hidden(&self, variant: usize) -> bool {
        self.ground.is_variant_hidden(variant)
    }

    /// The entry that is left.
    fn compute_entry(&self, row: usize, column: usize) -> f64 {
        self.ground.gram[[row, column]] - self.reach.row(row).dot(&self.reach.row(column))
    }
}

/// What a variant adds to a state.
#[derive(Debug, Clone, Copy)]
pub(super) struct EvidenceGain {
    /// Number of the most likely size.
    pub(super) size: usize,
    /// Logarithm of the evidence it brings, all sizes summed.
    pub(super) ln: f64,
}

impl Comparison<'_> {
    /// Likelihood and variance of the saturated model.
    pub(super) fn fit_saturated_model(&self, gram: &Gram) -> Saturated {
        let last = gram.whole.nrows() - 1;
        let free = last - self.count_fixed_columns();
        let fixed: Vec<usize> = (0..self.tangents).collect();
        let all: Vec<usize> = fixed.iter().copied().chain(self.tangents..last).collect();
        let flat = self.compute_flat_ridge(&gram.whole, 1e-10);
        let rows = count_to_f64(self.rows.len());
        let (left, _) = compute_schur_complement(&gram.whole, &fixed, &vec![flat; fixed.len()]);
        let mut variance = left[[last, last]].max(f64::MIN_POSITIVE) / rows;
        let y = Array1::from_iter(all.iter().map(|index| gram.whole[[*index, last]]));
        let mut ln_likelihood = 0.0;
        for _ in 0..2 {
            let own = variance / (SATURATED * self.deviation).powi(2);
            let ridge = |index: usize| if index < self.tangents { flat } else { own };
            let mut inner = extract_block(&gram.whole, &all, &all);
            all.iter().enumerate().for_each(|(at, index)| inner[[at, at]] += ridge(*index));
            let factor = CholeskyFactor::from_matrix(&inner);
            let w = factor.solve_system(&y);
            let q = (gram.whole[[last, last]] - w.dot(&y)).max(1e-12 * gram.whole[[last, last]]);
            let kept: f64 =
                factor.compute_inverse_diagonal().iter().zip(&all).map(|(x, index)| x * ridge(*index)).sum();
            let freedom = count_to_f64(all.len()) - kept;
            let bent: f64 = all.iter().zip(&w).map(|(index, w)| ridge(*index) * w * w).sum();
            variance = (q - bent).max(1e-9 * q) / (rows - freedom).max(0.3 * rows);
            let ln_determinant = gram.noise.ln_determinant(self.rows.len(), self.blocks.len());
            let priors =
                factor.ln_determinant() - count_to_f64(free + self.count_fixed_columns() - self.tangents) * own.ln();
            ln_likelihood = -0.5 * self.tempering * (rows * (q / rows).ln() + ln_determinant) - 0.5 * priors;
        }
        Saturated { variance, ln_likelihood }
    }

    /// Likelihood of a residual by itself in a noise.
    pub(super) fn compute_ln_likelihood(&self, residual: &[f64], noise: NoiseModel) -> f64 {
        let white = self.whiten_column(residual, noise);
        let rows = count_to_f64(white.len());
        let square: f64 = white.iter().map(|x| x * x).sum();
        let ln_determinant = noise.ln_determinant(self.rows.len(), self.blocks.len());
        -0.5 * self.tempering * (rows * (square.max(f64::MIN_POSITIVE) / rows).ln() + ln_determinant)
    }

    fn compute_flat_ridge(&self, gram: &Array2<f64>, share: f64) -> f64 {
        let trace: f64 = (0..self.tangents).map(|index| gram[[index, index]]).sum();
        share * trace / count_to_f64(self.tangents.max(1))
    }

    /// Evidence of the baseline alone, every run with a random level.
    pub(super) fn compute_empty_evidence(&self, gram: &Gram, saturated: Saturated) -> f64 {
        let last = gram.whole.nrows() - 1;
        let all: Vec<usize> = (0..self.count_fixed_columns()).chain([last]).collect();
        let fixed: Vec<usize> = (0..self.count_fixed_columns()).collect();
        let ridge = self.build_fixed_ridge(&gram.whole, saturated.variance);
        let (left, ln_determinant) = compute_schur_complement(&extract_block(&gram.whole, &all, &all), &fixed, &ridge);
        let q = left[[self.count_fixed_columns(), self.count_fixed_columns()]].max(1e-12 * gram.whole[[last, last]]);
        self.compute_baseline_evidence(gram, q, ln_determinant, &ridge)
    }

    /// The baseline alone, every run with a random level: what every search starts from, and its evidence.
    pub(super) fn prepare_baseline(&self, gram: &Gram, saturated: Saturated) -> (Ground, f64) {
        let fixed: Vec<usize> = (0..self.count_fixed_columns()).collect();
        let ridge = self.build_fixed_ridge(&gram.whole, saturated.variance);
        let (left, ln_determinant) = compute_schur_complement(&gram.whole, &fixed, &ridge);
        let last = left.nrows() - 1;
        let q = left[[last, last]].max(1e-12 * gram.whole[[last, last]]);
        let ln = self.compute_baseline_evidence(gram, q, ln_determinant, &ridge);
        let first: Vec<usize> =
            (0..self.bank.variants.len()).map(|variant| self.variant_columns(variant).start).collect();
        let hidden = first.iter().map(|at| left[[*at, *at]] < HIDDEN * gram.whole[[*at, *at]]).collect();
        let starts = first.into_iter().map(Some).collect();
        (Ground { gram: left, hidden, starts, variance: saturated.variance }, ln)
    }

    /// Evidence of a baseline that leaves this square; its tangents have no prior, so what they cost is the same for every
    /// hypothesis and left out.
    fn compute_baseline_evidence(&self, gram: &Gram, left: f64, ln_determinant: f64, ridge: &[f64]) -> f64 {
        let rows = count_to_f64(self.rows.len());
        let noise = gram.noise.ln_determinant(self.rows.len(), self.blocks.len());
        let likelihood = -0.5 * self.tempering * (rows * (left / rows).ln() + noise);
        let levels: f64 = ridge[self.tangents..].iter().map(|ridge| ridge.ln()).sum();
        likelihood - 0.5 * (ln_determinant - self.ln_tangent_determinant(&gram.whole) - levels)
    }

    pub(super) fn ln_tangent_determinant(&self, gram: &Array2<f64>) -> f64 {
        let fixed: Vec<usize> = (0..self.tangents).collect();
        let mut inner = extract_block(gram, &fixed, &fixed);
        let flat = self.compute_flat_ridge(gram, FLAT);
        fixed.iter().for_each(|index| inner[[*index, *index]] += flat);
        CholeskyFactor::from_matrix(&inner).ln_determinant()
    }

    /// Ridges of the tangents and of the levels of the runs.
    pub(super) fn build_fixed_ridge(&self, gram: &Array2<f64>, variance: f64) -> Vec<f64> {
        let flat = self.compute_flat_ridge(gram, FLAT).max(f64::MIN_POSITIVE);
        let level = variance / (RUN_LEVEL * self.size).powi(2);
        (0..self.count_fixed_columns()).map(|index| if index < self.tangents { flat } else { level }).collect()
    }

    /// What a variant adds to a state.
    pub(super) fn compute_evidence_gain(&self, state: &MarginalState<'_>, variant: usize) -> EvidenceGain {
        let of = &self.bank.variants[variant];
        let along = self.reduce_variant_block(state, variant);
        let mut best = (0, f64::NEG_INFINITY);
        let mut all = [0.0; SIZES.len()];
        for (index, size) in SIZES.iter().enumerate() {
            let resolved = along.solve_shifted_system(self.compute_prior_ratio(state, *size));
            let ln =
                self.compute_ln_evidence(state, &resolved) + self.compute_ln_sign_factor(state, of, *size, &resolved);
            all[index] = ln + compute_ln_size_prior(of, index);
            if all[index] > best.1 {
                best = (index, all[index]);
            }
        }
        EvidenceGain { size: best.0, ln: log_sum_exp(all) }
    }

    /// Prior variance of a size over that of the noise.
    fn compute_prior_ratio(&self, state: &MarginalState<'_>, size: f64) -> f64 {
        (size * self.deviation).powi(2) / state.ground.variance
    }

    /// The block of a variant that is left, with the output, ready for every size.
    fn reduce_variant_block(&self, state: &MarginalState<'_>, variant: usize) -> Tridiagonal {
        let d = &self.bank.variants[variant].relative;
        let size = d.len();
        let Some(first) = state.ground.starts[variant] else {
            return Tridiagonal::reduce_matrix(vec![vec![0.0; size]; size], vec![0.0; size]);
        };
        let last = state.ground.gram.nrows() - 1;
        let mut inner = vec![vec![0.0; size]; size];
        for i in 0..size {
            for j in 0..=i {
                let x = state.compute_entry(first + i, first + j) * d[i] * d[j];
                (inner[i][j], inner[j][i]) = (x, x);
            }
        }
        let b = (0..size).map(|k| state.compute_entry(first + k, last) * d[k]).collect();
        Tridiagonal::reduce_matrix(inner, b)
    }

    fn compute_ln_evidence(&self, state: &MarginalState<'_>, resolved: &Resolved) -> f64 {
        let rows = self.tempering * count_to_f64(self.rows.len());
        let left = (state.left - resolved.square).max(1e-6 * state.left);
        -0.5 * rows * (left / state.left).ln() - 0.5 * resolved.ln_determinant
    }

    /// Twice the probability that the law has its sign.
    fn compute_ln_sign_factor(&self, state: &MarginalState<'_>, of: &Variant, size: f64, resolved: &Resolved) -> f64 {
        if of.sign() == 0.0 {
            return 0.0;
        }
        let lambda = self.compute_prior_ratio(state, size);
        let mean = lambda * resolved.first;
        let variance = lambda * resolved.first_variance * state.ground.variance / self.tempering.max(1e-3);
        (2.0 * normal_share(of.sign() * mean / (variance + 1e-300).sqrt()) + 1e-12).ln()
    }

    /// The evidence that a variant of exactly this size adds, its sign apart.
    pub(super) fn compute_gain_at_size(&self, state: &MarginalState<'_>, variant: usize, size: usize) -> f64 {
        let resolved = self
            .reduce_variant_block(state, variant)
            .solve_shifted_system(self.compute_prior_ratio(state, SIZES[size]));
        self.compute_ln_evidence(state, &resolved) + SIZE_PRIORS[size].ln()
    }

    /// The state once a variant of this size has been taken out as well.
    pub(super) fn condition_on_variant<'g>(
        &self,
        state: &MarginalState<'g>,
        variant: usize,
        size: usize,
    ) -> MarginalState<'g> {
        let ground = state.ground;
        let of = &self.bank.variants[variant];
        let own = of.relative.len();
        let start = ground.starts[variant].unwrap_or(0);
        let rows: Vec<usize> = (start..start + own).collect();
        let mut reach = ground.gram.select(Axis(0), &rows);
        let before = state.reach.slice(s![start..start + own, ..]);
        general_mat_mul(-1.0, &before, &state.reach.t(), 1.0, &mut reach);
        let mut inner = reach.slice(s![.., start..start + own]).to_owned();
        for (index, d) in of.relative.iter().enumerate() {
            inner[[index, index]] += ground.variance / (SIZES[size] * self.deviation * d).powi(2);
        }
        CholeskyFactor::from_matrix(&inner).forward_substitute(&mut reach);
        let last = reach.column(reach.ncols() - 1);
        let left = (state.left - last.dot(&last)).max(1e-9 * state.left);
        let known = state.reach.ncols();
        let mut joined = Array2::zeros((reach.ncols(), known + own));
        joined.slice_mut(s![.., ..known]).assign(&state.reach);
        joined.slice_mut(s![.., known..]).assign(&reach.t());
        MarginalState { ground, reach: joined, left }
    }

    /// The part of a ground that holds these members only.
    pub(super) fn select_members(&self, ground: &Ground, members: &[(usize, usize)]) -> Ground {
        ground.select_variants(members.iter().map(|(variant, _)| *variant), |variant| {
            self.bank.variants[variant].relative.len()
        })
    }
}

/// Logarithm of the prior probability of a size of a variant.
pub(super) fn compute_ln_size_prior(of: &Variant, size: usize) -> f64 {
    let too_large = SIZES[size] > 1.01 * of.largest && size > 0;
    SIZE_PRIORS[size].ln() + if too_large { TOO_LARGE } else { 0.0 }
}

/// Logarithm of a sum of exponentials.
pub(super) fn log_sum_exp(all: impl IntoIterator<Item = f64> + Clone) -> f64 {
    let top = all.clone().into_iter().fold(f64::NEG_INFINITY, f64::max);
    if top == f64::NEG_INFINITY {
        return top;
    }
    top + all.into_iter().map(|x| (x - top).exp()).sum::<f64>().ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_are_summed_without_overflow() {
        assert!((log_sum_exp([1000.0, 1000.0]) - (1000.0 + 2.0_f64.ln())).abs() < 1e-12);
        assert_eq!(log_sum_exp([f64::NEG_INFINITY]), f64::NEG_INFINITY);
    }
}
