//! Size: what is too small to be claimed, however surely it is there.

use super::designs::Design;
use super::diagnose::{Case, distance, ordinary_noise};
use super::fit::{Fit, fit};
use super::scan::{price, price_of};
use super::search::{FIRST_INFORMATION, Hypothesis, SearchResult};
use super::verdicts::CLASS_INFORMATION;
use crate::statistics::count;

/// Size, in deviations of the ordinary noise, below which an effect is not claimed.
const SIZE_DEVIATIONS: f64 = 0.3;
/// Size, as a share of the mean output, below which an effect is not claimed.
const SIZE_SHARE: f64 = 0.005;
/// Information from which something is beyond doubt, however small it is, and even where a form without a name does not
/// carry over to rows held out.
pub(super) const BEYOND_DOUBT_INFORMATION: f64 = 60.0;
/// The same beside an effect that explains more.
const BEYOND_DOUBT_BESIDE: f64 = 100.0;
/// Share of what is explained up to which a member on which the runs disagree is dropped: most of it is no imitation.
const MINOR_SHARE: f64 = 0.5;
/// Share of the mean output below which an output counts as that share.
const OUTPUT_FLOOR: f64 = 0.1;

impl Case<'_> {
    /// Drops members whose remaining part is too small to claim, and those beside others on which the runs disagree.
    pub(super) fn worth_claiming(&mut self, mut found: SearchResult, base: &Fit, designs: &[Design]) -> SearchResult {
        let ln_rows = self.ln_rows(base);
        let mut refunded = 0.0;
        while let Some(position) = self.smallest_unclaimable(&found.best, base, designs) {
            let Some(less) = self.without(&found.best, position) else { break };
            refunded += price(&designs[found.best.members[position]], ln_rows);
            found.best = less;
            found.p_values.remove(position.min(found.p_values.len() - 1));
        }
        if refunded > 0.0 {
            self.take_likelier_of_as_many(&mut found, refunded);
        }
        if found.best.members.is_empty() || !self.is_worth_its_noise(&found.best, base, designs) {
            // What was dropped, here or before, carried the rest.
            found.best = Hypothesis { members: Vec::new(), fit: base.clone(), information: 0.0 };
            found.p_values.clear();
        }
        found
    }

    /// What is left after members were dropped need not be the best of its size: then the best stands in its place. Its
    /// information has the price of the dropped ones taken off still, for what was close to it before stays so.
    fn take_likelier_of_as_many(&mut self, found: &mut SearchResult, refunded: f64) {
        let as_many = found.others.iter().filter(|other| other.members.len() == found.best.members.len());
        let likeliest = as_many.max_by(|a, b| a.information.total_cmp(&b.information));
        let clearly = found.best.information + refunded + CLASS_INFORMATION;
        let Some(other) = likeliest.filter(|other| other.information > clearly).cloned() else { return };
        let Some(fit) = self.with_data(|data| fit(data, &other.fit.parts, other.fit.noise)) else { return };
        let left = std::mem::replace(&mut found.best, Hypothesis { fit, ..other });
        found.others.push(left);
    }

    /// Does a hypothesis explain enough beyond the baseline, its price paid, for what it leaves besides noise?
    fn is_worth_its_noise(&self, best: &Hypothesis, base: &Fit, designs: &[Design]) -> bool {
        let gained = 2.0 * (best.fit.log_likelihood - base.log_likelihood);
        let information = gained - price_of(designs, &best.members, self.ln_rows(base));
        information >= FIRST_INFORMATION * best.fit.dispersion(&self.frame)
    }

    fn smallest_unclaimable(&mut self, best: &Hypothesis, base: &Fit, designs: &[Design]) -> Option<usize> {
        let deviation = ordinary_noise(&best.fit);
        let several = best.members.len() > 1;
        let ln_rows = self.ln_rows(base);
        let unclaimable = |position: usize| {
            if best.is_exceeded(position, designs) {
                return None;
            }
            let without = if several { self.without(best, position)?.fit } else { base.clone() };
            let gained = 2.0 * (best.fit.log_likelihood - without.log_likelihood);
            let minor = several && gained < MINOR_SHARE * best.information;
            let paid = price(&designs[best.members[position]], ln_rows);
            let beyond_doubt = gained >= if minor { BEYOND_DOUBT_BESIDE } else { BEYOND_DOUBT_INFORMATION };
            let drops = several && gained < paid
                || self.negligible(&without.residual, &best.fit.residual, deviation, beyond_doubt)
                || several && !self.predicts_more(&without, &best.fit);
            drops.then_some((position, gained))
        };
        let all = (0..best.members.len()).filter_map(unclaimable);
        all.min_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(position, _)| position)
    }

    /// Is less left of fitted runs that are predicted from the others with a member than without it?
    fn predicts_more(&mut self, without: &Fit, with: &Fit) -> bool {
        let of = |case: &mut Self, fit: &Fit| case.left_of_inner(fit, fit.noise, with.noise);
        let left = of(self, without).zip(of(self, with));
        left.is_none_or(|(without, with)| !with.exceeds(without))
    }

    /// Is the difference of two residuals too small to claim: everywhere a share of the output by which a model or a
    /// class 0.5 meter is wrong anyway, and not beyond all doubt, or small on the whole and lost in the noise?
    pub(super) fn negligible(&self, one: &[f64], other: &[f64], deviation: f64, beyond_doubt: bool) -> bool {
        let mean = self.recorded.iter().map(|x| x.abs()).sum::<f64>() / count(self.recorded.len().max(1));
        let of_output = |x: f64| x.abs() + OUTPUT_FLOOR * mean;
        let mut shares: Vec<f64> =
            one.iter().zip(other).zip(&self.recorded).map(|((a, b), x)| (a - b).abs() / of_output(*x)).collect();
        shares.sort_by(|a, b| b.total_cmp(a));
        let size = |rows: usize| (shares[..rows].iter().map(|x| x * x).sum::<f64>() / count(rows.max(1))).sqrt();
        // On the whole, in the fifth and in the twentieth of the rows where it is greatest.
        let sizes = [(1, 1.0), (5, 1.6), (20, 2.2)];
        let small = sizes.iter().all(|(part, times)| size((shares.len() / part).max(1)) < times * SIZE_SHARE);
        small && !beyond_doubt || distance(one, other) < (SIZE_DEVIATIONS * deviation).min(SIZE_SHARE * mean)
    }
}
