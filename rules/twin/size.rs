//! Size: what is too small to be claimed, however surely it is there.

use super::agreement::differs_by_run;
use super::designs::Design;
use super::diagnose::{Case, distance, ordinary_noise};
use super::fit::{Fit, fit};
use super::holdout::rmse;
use super::scan::{price, price_of};
use super::search::{FIRST_INFORMATION, Found, Hypothesis};
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
/// Information from which a member stands whatever it leaves of the rows held out: their lots and tools may be others.
const MISLEADING_MAX: f64 = 200.0;
/// Share of what is explained up to which a member on which the runs disagree is dropped: most of it is no imitation.
const MINOR_SHARE: f64 = 0.5;
/// Share of the mean output below which an output counts as that share.
const OUTPUT_FLOOR: f64 = 0.1;

impl Case<'_> {
    /// Drops members whose remaining part is too small to claim, and those beside others on which the runs disagree.
    pub(super) fn worth_claiming(&mut self, mut found: Found, base: &Fit, designs: &[Design]) -> Found {
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
    fn take_likelier_of_as_many(&mut self, found: &mut Found, refunded: f64) {
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
        let first = best.first_part();
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
                || minor && differs_by_run(&best.fit, &self.frame, first + position)
                || self.negligible(&without.residual, &best.fit.residual, deviation, beyond_doubt)
                || several && self.misleads(&without, &best.fit, gained - paid);
            drops.then_some((position, gained))
        };
        let all = (0..best.members.len()).filter_map(unclaimable);
        all.min_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(position, _)| position)
    }

    /// Does a member that explains so much of the fitted rows leave more than that of those held out, with it than without?
    fn misleads(&mut self, without: &Fit, with: &Fit, information: f64) -> bool {
        if information > MISLEADING_MAX {
            return false;
        }
        let rows = count(self.held_frame.len()) / with.noise.inflation();
        let errors = self.held_out_rmse(without).zip(self.held_out_rmse(with));
        errors.is_some_and(|(without, with)| costs_more(information, rows, without, with))
    }

    /// Error of a fit on the held-out rows of what is fitted here; `None` where none are.
    fn held_out_rmse(&mut self, fit: &Fit) -> Option<f64> {
        let prediction = self.predict_here(fit)?;
        rmse(&self.scene, &self.held_frame, &prediction.total)
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

/// Is an error on so many independent held-out rows that rises from `without` to `with` worth more than the information
/// gained on the fitted ones? Both in units of information, so that the one can be held against the other.
fn costs_more(information: f64, rows: f64, without: f64, with: f64) -> bool {
    let rises = without > 0.0 && with > without;
    rises && 2.0 * rows * (with / without).ln() > information
}

#[cfg(test)]
mod tests {
    use super::costs_more;

    #[test]
    fn what_is_paid_for_on_held_out_rows_is_not_gained() {
        // A drift that bends away behind the last fitted run, and one that is a little off there.
        assert!(costs_more(22.0, 180.0, 0.2, 6.3));
        assert!(!costs_more(22.0, 180.0, 0.20, 0.21));
        assert!(!costs_more(22.0, 180.0, 0.3, 0.2) && !costs_more(22.0, 180.0, 0.0, 0.2));
    }
}
