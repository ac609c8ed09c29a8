//! Posterior means: how large each member of a hypothesis is.

use super::gram::Comparison;
use super::linear_algebra::{CholeskyFactor, extract_block};
use super::marginal::SIZES;
use ndarray::{Array1, Array2, s};

/// Posterior means of a hypothesis.
#[derive(Debug, Clone)]
pub(super) struct PosteriorMeans {
    pub(super) tangents: Vec<f64>,
    pub(super) members: Vec<Vec<f64>>,
}

impl Comparison<'_> {
    /// Posterior means: coefficients of the tangents and of each member.
    pub(super) fn solve_posterior_means(
        &self,
        gram: &Array2<f64>,
        variance: f64,
        members: &[(usize, usize)],
    ) -> PosteriorMeans {
        let last = gram.nrows() - 1;
        let own = members.iter().flat_map(|(variant, _)| self.variant_columns(*variant));
        let all: Vec<usize> = (0..self.count_fixed_columns()).chain(own).collect();
        let ridge = self.build_ridges(gram, variance, members);
        let mut inner = extract_block(gram, &all, &all);
        ridge.iter().enumerate().for_each(|(at, ridge)| inner[[at, at]] += ridge);
        let y = Array1::from_iter(all.iter().map(|index| gram[[*index, last]]));
        self.split_coefficients(&CholeskyFactor::from_matrix(&inner).solve_system(&y), members)
    }

    /// Ridges of the tangents, the levels of the runs and the columns of some members, in this order.
    pub(super) fn build_ridges(&self, gram: &Array2<f64>, variance: f64, members: &[(usize, usize)]) -> Vec<f64> {
        let mut ridge = self.build_fixed_ridge(gram, variance);
        for (variant, size) in members {
            let of = &self.bank.variants[*variant];
            ridge.extend(of.relative.iter().map(|d| variance / (SIZES[*size] * self.deviation * d).powi(2)));
        }
        ridge
    }

    /// Coefficients in the order of [`Self::ridges`] by what they belong to.
    pub(super) fn split_coefficients(&self, w: &Array1<f64>, members: &[(usize, usize)]) -> PosteriorMeans {
        let tangents = w.slice(s![..self.tangents]).to_vec();
        let mut at = self.count_fixed_columns();
        let of_member = |(variant, _): &(usize, usize)| {
            let size = self.bank.variants[*variant].relative.len();
            at += size;
            w.slice(s![at - size..at]).to_vec()
        };
        PosteriorMeans { tangents, members: members.iter().map(of_member).collect() }
    }
}
