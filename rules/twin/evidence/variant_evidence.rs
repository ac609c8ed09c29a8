//! The evidence of single variants for many outputs: what does not depend on the output is computed once.

use super::gram::Comparison;
use super::linear_algebra::CholeskyFactor;
use super::marginal::{Ground, SIZES, compute_ln_size_prior, log_sum_exp};
use ndarray::{Array1, Array2};
use numerics::statistics::{count_to_f64, normal_share};

/// A variant with what its evidence needs for any output.
pub(super) struct AskedVariant {
    variant: usize,
    start: usize,
    sizes: Vec<AskedSize>,
}

/// The same for one size.
struct AskedSize {
    lambda: f64,
    ln_determinant: f64,
    /// First line of the inverse.
    first: Array1<f64>,
    factor: CholeskyFactor,
}

impl Comparison<'_> {
    /// Every variant, ready to be asked of many outputs.
    pub(super) fn prepare_variants(&self, ground: &Ground) -> Vec<AskedVariant> {
        (0..self.bank.variants.len()).map(|variant| self.prepare_variant(ground, variant)).collect()
    }

    fn prepare_variant(&self, ground: &Ground, variant: usize) -> AskedVariant {
        let relative = &self.bank.variants[variant].relative;
        let start = ground.starts[variant].unwrap_or(0);
        let size = relative.len();
        let inner = Array2::from_shape_fn((size, size), |(i, j)| {
            ground.gram[[start + i, start + j]] * relative[i] * relative[j]
        });
        let of_size = |index: usize| {
            let lambda = (SIZES[index] * self.deviation).powi(2) / ground.variance;
            let factor = CholeskyFactor::from_matrix(&(Array2::eye(size) + &inner * lambda));
            let mut unit = Array1::zeros(size);
            unit[0] = 1.0;
            AskedSize { lambda, ln_determinant: factor.ln_determinant(), first: factor.solve_system(&unit), factor }
        };
        AskedVariant { variant, start, sizes: (0..SIZES.len()).map(of_size).collect() }
    }

    /// Logarithm of the evidence that a variant has for an output, given its inner products with every column and its sum of
    /// squares, the baseline projected out of both.
    pub(super) fn compute_variant_evidence(
        &self,
        ground: &Ground,
        asked: &AskedVariant,
        along: &Array1<f64>,
        square: f64,
    ) -> f64 {
        let of = &self.bank.variants[asked.variant];
        let own =
            Array1::from_iter(of.relative.iter().enumerate().map(|(k, relative)| along[asked.start + k] * relative));
        let rows = self.tempering * count_to_f64(self.rows.len());
        let all = asked.sizes.iter().enumerate().map(|(index, size)| {
            let explained = size.lambda * size.factor.compute_quadratic_form(&own);
            let left = (square - explained).max(1e-6 * square);
            let sign = if of.sign() == 0.0 {
                0.0
            } else {
                let mean = size.lambda * size.first.dot(&own);
                let variance = size.lambda * size.first[0] * ground.variance / self.tempering.max(1e-3);
                (2.0 * normal_share(of.sign() * mean / (variance + 1e-300).sqrt()) + 1e-12).ln()
            };
            -0.5 * rows * (left / square).ln() - 0.5 * size.ln_determinant + sign + compute_ln_size_prior(of, index)
        });
        log_sum_exp(all.collect::<Vec<_>>())
    }
}
