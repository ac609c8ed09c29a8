//! Naming by projection: a nameless curve that is the curve of a named law gets its name.
//!
//! The curve, the baseline projected out of it, is regressed on every named family. One name is enough when the family
//! makes nearly all of the curve with the right sign; two are taken when they do so and one alone falls clearly short, and
//! then each gets the part that the regression gives it. The metric is that of the noise, or the plain one: the first
//! alone loses levels, the second alone small effects that change fast.

use super::gram::{Comparison, Gram};
use super::linear_algebra::{CholeskyFactor, compute_schur_complement, extract_block};
use super::thresholds::THRESHOLDS;
use super::variant_bank::{Variant, VariantBank};
use adapter_core::channel::quantity::Quantity;
use ndarray::{Array1, Array2};
use numerics::statistics::count_to_f64;
use physics::find_effect;
use std::ops::Range;

/// Columns of a law that may claim a curve: wider ones could claim any.
const COLUMNS_MAX: usize = 5;
/// Ridge of a claim, as a share of each column's own square.
const RIDGE: f64 = 1e-3;
/// Share of the curve that each further column must make.
const PRICE: f64 = 0.02;
/// Single names from which pairs are formed, and those looked through for them.
const PAIRED: usize = 4;
const LOOKED_THROUGH: usize = 60;

/// A curve that has a name, or two.
#[derive(Debug, Clone)]
pub(super) struct Claim {
    /// Share of the curve that the named laws make, the price of their columns taken off.
    pub(super) share: f64,
    /// Each law with its coefficients.
    pub(super) laws: Vec<(usize, Vec<f64>)>,
}

/// A law in the place of a contribution.
pub(super) struct StandIn {
    pub(super) kind: String,
    /// What it costs, nats.
    pub(super) nats: f64,
    /// Share of the contribution that it makes, the price of its columns taken off.
    pub(super) share: f64,
    /// Directions beyond the first in which its columns may bend.
    pub(super) bends: f64,
}

/// Projects curves on named laws.
pub(super) struct Naming<'a> {
    bank: &'a VariantBank,
    first: usize,
    /// Gram matrices with the baseline projected out: in the metric of the noise, and in the plain one.
    metrics: Vec<Array2<f64>>,
    /// Named variants that may claim.
    named: Vec<usize>,
}

/// A regression of a curve on one or two laws.
struct CurveRegression {
    share: f64,
    coefficients: Vec<f64>,
}

impl<'a> Naming<'a> {
    pub(super) fn new(comparison: &Comparison<'a>, grams: &[&Gram]) -> Self {
        let bank = comparison.bank;
        let fixed: Vec<usize> = (0..comparison.tangents).collect();
        let cleared = |gram: &&Gram| {
            let trace: f64 = fixed.iter().map(|index| gram.whole[[*index, *index]]).sum();
            let flat = 1e-9 * trace / count_to_f64(fixed.len().max(1));
            compute_schur_complement(&gram.whole, &fixed, &vec![flat; fixed.len()]).0
        };
        let may = |index: &usize| {
            let variant = &bank.variants[*index];
            variant.kind().is_some() && variant.law_columns().len() <= COLUMNS_MAX && !variant.is_contained_law()
        };
        let named = (0..bank.variants.len()).filter(may).collect();
        Self { bank, first: comparison.count_fixed_columns(), metrics: grams.iter().map(cleared).collect(), named }
    }

    /// May a law be what these curves are: does it know their channels?
    fn matches_channels(&self, law: usize, parts: &[(usize, &[f64])]) -> bool {
        let Some(effect) = self.bank.variants[law].kind().and_then(find_effect) else { return true };
        let quantities = parts.iter().filter_map(|(variant, _)| self.bank.variants[*variant].nameless_curve());
        quantities
            .map(|drawn| Quantity::from_column_name(&drawn.over))
            .all(|quantity| effect.follows_quantity(quantity))
    }

    /// The best claim on a curve, given as nameless variants with their coefficients.
    pub(super) fn find_best_claim(&self, parts: &[(usize, &[f64])]) -> Option<Claim> {
        let claims = self.metrics.iter().filter_map(|metric| self.find_claim_in_metric(metric, parts));
        let accepted = |claim: &Claim| claim.share >= THRESHOLDS.name_share;
        let better = |a: &Claim, b: &Claim| {
            let key = |c: &Claim| (accepted(c), -count_to_f64(c.laws.len()), c.share);
            key(b).partial_cmp(&key(a)).is_some_and(std::cmp::Ordering::is_gt)
        };
        claims.reduce(|best, next| if better(&best, &next) { next } else { best }).filter(accepted)
    }

    /// The one law that makes several curves at once, each of them for the greater part.
    pub(super) fn find_common_law(&self, parts: &[(usize, &[f64])]) -> Option<Claim> {
        let mut best: Option<Claim> = None;
        for metric in &self.metrics {
            let (along, square) = self.compute_products(metric, parts);
            let each: Vec<(Array1<f64>, f64)> =
                parts.iter().map(|part| self.compute_products(metric, std::slice::from_ref(part))).collect();
            for variant in &self.named {
                let of = |(along, square): &(Array1<f64>, f64)| self.regress_curve(metric, along, *square, &[*variant]);
                let Some(fit) = self.regress_curve(metric, &along, square, &[*variant]) else { continue };
                if !self.matches_channels(*variant, parts) {
                    continue;
                }
                let enough = best.as_ref().map_or(THRESHOLDS.name_share + THRESHOLDS.pair_more, |best| best.share);
                let makes_each = |own: &(Array1<f64>, f64)| of(own).is_some_and(|own| own.share >= THRESHOLDS.of_each);
                if fit.share > enough && each.iter().all(makes_each) {
                    best = Some(Claim { share: fit.share, laws: vec![(*variant, fit.coefficients)] });
                }
            }
        }
        best
    }

    /// Inner products of a curve with every column, and its square.
    fn compute_products(&self, metric: &Array2<f64>, parts: &[(usize, &[f64])]) -> (Array1<f64>, f64) {
        let all: Vec<usize> = parts.iter().flat_map(|(variant, _)| self.list_variant_columns(*variant)).collect();
        let w = Array1::from_iter(parts.iter().flat_map(|(_, w)| w.iter().copied()));
        let mut along = Array1::zeros(metric.nrows() - 1);
        for (index, w) in all.iter().zip(&w) {
            let column = metric.column(*index);
            along.iter_mut().zip(column).for_each(|(sum, x)| *sum += w * x);
        }
        let square = all.iter().zip(&w).map(|(index, w)| w * along[*index]).sum();
        (along, square)
    }

    /// The kind of a named variant.
    pub(super) fn kind(&self, variant: usize) -> Option<String> {
        self.bank.variants[variant].kind().map(str::to_owned)
    }

    /// What a law of these coefficients contributes.
    pub(super) fn compute_contribution(&self, law: &(usize, Vec<f64>)) -> Vec<f64> {
        self.bank.compute_contribution(&self.bank.variants[law.0], &law.1)
    }

    fn list_variant_columns(&self, variant: usize) -> Vec<usize> {
        let of = &self.bank.variants[variant].columns;
        (self.first + of.start..self.first + of.end).collect()
    }

    /// Columns of the law of a variant.
    fn find_law_columns(&self, variant: usize) -> Range<usize> {
        let of = self.bank.variants[variant].law_columns();
        self.first + of.start..self.first + of.end
    }

    fn find_claim_in_metric(&self, metric: &Array2<f64>, parts: &[(usize, &[f64])]) -> Option<Claim> {
        let (along, square) = self.compute_products(metric, parts);
        if square <= 0.0 {
            return None;
        }
        let mut single: Vec<(f64, usize, Vec<f64>)> = self
            .named
            .iter()
            .filter(|variant| self.matches_channels(**variant, parts))
            .filter_map(|variant| {
                let fit = self.regress_curve(metric, &along, square, &[*variant])?;
                Some((fit.share, *variant, fit.coefficients))
            })
            .collect();
        single.sort_by(|a, b| b.0.total_cmp(&a.0));
        let best = single.first()?;
        let one = Claim { share: best.0, laws: vec![(best.1, best.2.clone())] };
        // Levels of a group are few: two laws that hold in some of its members claim them by chance.
        let levels = parts.iter().any(|(variant, _)| {
            self.bank.variants[*variant].nameless_curve().is_some_and(|drawn| drawn.shape == "levels")
        });
        let whole = THRESHOLDS.pair_whole.max(one.share + THRESHOLDS.pair_more);
        if one.share >= THRESHOLDS.name_share && !levels && whole < 1.0 {
            let pair = self.find_pair_claim(metric, parts, (&along, square), &single);
            return Some(pair.filter(|pair| pair.share > whole).unwrap_or(one));
        }
        if one.share >= THRESHOLDS.name_share || levels {
            return Some(one);
        }
        let pair = self.find_pair_claim(metric, parts, (&along, square), &single);
        let enough = (THRESHOLDS.name_share + THRESHOLDS.pair_more).max(one.share + THRESHOLDS.pair_gain);
        Some(pair.filter(|pair| pair.share > enough).unwrap_or(one))
    }

    fn find_pair_claim(
        &self,
        metric: &Array2<f64>,
        parts: &[(usize, &[f64])],
        (along, square): (&Array1<f64>, f64),
        single: &[(f64, usize, Vec<f64>)],
    ) -> Option<Claim> {
        let mut firsts: Vec<usize> = Vec::new();
        let kind = |variant: usize| self.bank.variants[variant].kind();
        for (_, variant, _) in single.iter().take(LOOKED_THROUGH) {
            if firsts.len() < PAIRED && !firsts.iter().any(|known| kind(*known) == kind(*variant)) {
                firsts.push(*variant);
            }
        }
        let mut best: Option<Claim> = None;
        for first in firsts {
            let others = self.named.iter().copied().filter(|second| kind(*second) != kind(first));
            for second in others.filter(|second| self.matches_channels(*second, parts)) {
                let Some(fit) = self.regress_curve(metric, along, square, &[first, second]) else { continue };
                if best.as_ref().is_none_or(|best| fit.share > best.share) {
                    let size = self.find_law_columns(first).len();
                    let (a, b) = fit.coefficients.split_at(size);
                    best = Some(Claim { share: fit.share, laws: vec![(first, a.to_vec()), (second, b.to_vec())] });
                }
            }
        }
        best
    }

    /// The curve on some laws; `None` where one of them has the wrong sign.
    fn regress_curve(
        &self,
        metric: &Array2<f64>,
        along: &Array1<f64>,
        square: f64,
        laws: &[usize],
    ) -> Option<CurveRegression> {
        let all: Vec<usize> = laws.iter().flat_map(|law| self.find_law_columns(*law)).collect();
        let relative =
            laws.iter().flat_map(|law| &self.bank.variants[*law].relative[..self.find_law_columns(*law).len()]);
        let mut inner = extract_block(metric, &all, &all);
        for (at, relative) in relative.enumerate() {
            let own = inner[[at, at]].abs();
            inner[[at, at]] += own * RIDGE / (relative * relative) + 1e-12;
        }
        let right = Array1::from_iter(all.iter().map(|index| along[*index]));
        let w = CholeskyFactor::from_matrix(&inner).solve_system(&right);
        let mut at = 0;
        for law in laws {
            let variant: &Variant = &self.bank.variants[*law];
            if variant.sign() * w[at] < 0.0 {
                return None;
            }
            at += self.find_law_columns(*law).len();
        }
        let share = right.dot(&w) / square - PRICE * count_to_f64(all.len() - 1);
        Some(CurveRegression { share, coefficients: w.to_vec() })
    }

    /// What it costs in nats to put each named kind in the place of a contribution, given its inner products with every
    /// column in the metric of the noise and its square, the baseline projected out; the best of each kind.
    pub(super) fn list_stand_ins(&self, along: &Array1<f64>, square: f64, nats: f64) -> Vec<StandIn> {
        let mut all: Vec<StandIn> = Vec::new();
        for variant in &self.named {
            let of = &self.bank.variants[*variant];
            let Some(fit) = self.regress_curve(&self.metrics[0], along, square, &[*variant]) else { continue };
            let size = count_to_f64(of.law_columns().len() - 1);
            let left = square * (1.0 - fit.share - PRICE * size).max(0.0);
            let nats = nats * left + 0.7 * size - of.ln_prior.min(0.0);
            let kind = of.kind().unwrap_or_default().to_owned();
            match all.iter_mut().find(|known| known.kind == kind) {
                Some(known) => {
                    if nats < known.nats {
                        (known.nats, known.bends) = (nats, size);
                    }
                    known.share = known.share.max(fit.share);
                }
                None => all.push(StandIn { kind, nats, share: fit.share, bends: size }),
            }
        }
        all
    }

    /// Inner products of a whitened full contribution with every column, and its square, the baseline projected out.
    pub(super) fn compute_whitened_products(
        &self,
        comparison: &Comparison<'_>,
        gram: &Gram,
        contribution: &[f64],
    ) -> (Array1<f64>, f64) {
        let white = Array1::from(comparison.whiten_column(contribution, gram.noise));
        let tall = comparison.build_whitened_matrix(gram.noise, |_| true);
        let mut along = tall.t().dot(&white);
        let fixed: Vec<usize> = (0..comparison.tangents).collect();
        let mut inner = extract_block(&gram.whole, &fixed, &fixed);
        let trace: f64 = inner.diag().sum();
        fixed.iter().for_each(|index| inner[[*index, *index]] += 1e-9 * trace / count_to_f64(fixed.len().max(1)));
        let right = Array1::from_iter(fixed.iter().map(|index| along[*index]));
        let w = CholeskyFactor::from_matrix(&inner).solve_system(&right);
        let square = white.dot(&white) - right.dot(&w);
        for (index, w) in fixed.iter().zip(&w) {
            let column = gram.whole.column(*index);
            along.iter_mut().zip(column).for_each(|(sum, x)| *sum -= w * x);
        }
        (along, square.max(0.0))
    }
}
