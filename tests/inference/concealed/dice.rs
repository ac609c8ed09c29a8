//! Seeded randomness: one generator per purpose, so that adding a draw in one place changes nothing elsewhere.

use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal, StudentT};
use rand_pcg::Pcg64Mcg;

/// A random source that is a function of a label and a seed alone.
#[derive(Clone)]
pub(crate) struct Dice(Pcg64Mcg);

impl Dice {
    /// The dice of `label` under `seed`; different labels are independent.
    pub(crate) fn seeded(label: &str, seed: u64) -> Self {
        Self(Pcg64Mcg::seed_from_u64(hash(label) ^ seed.wrapping_mul(0x9e37_79b9_7f4a_7c15)))
    }

    /// Uniform between `low` and `high`.
    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    /// Uniform in the logarithm between `low` and `high`, both positive.
    pub(crate) fn log_uniform(&mut self, low: f64, high: f64) -> f64 {
        self.uniform(low.ln(), high.ln()).exp()
    }

    /// Standard normal.
    pub(crate) fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// Student's t with `degrees` of freedom, not scaled.
    pub(crate) fn student(&mut self, degrees: f64) -> f64 {
        StudentT::new(degrees).map_or(0.0, |law| law.sample(&mut self.0))
    }

    /// True with probability `p`.
    pub(crate) fn chance(&mut self, p: f64) -> bool {
        self.0.random::<f64>() < p
    }

    /// -1 or 1.
    pub(crate) fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// A whole number from `low` up to and including `high`.
    pub(crate) fn whole(&mut self, low: usize, high: usize) -> usize {
        self.0.random_range(low..=high)
    }

    /// One of `items`, which must not be empty.
    pub(crate) fn pick<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        &items[self.whole(0, items.len() - 1)]
    }
}

/// FNV-1a, 64 bit.
fn hash(label: &str) -> u64 {
    label.bytes().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3))
}
