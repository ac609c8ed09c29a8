//! Of several names found together, which would be better without one: each is tried against a cause without a name in
//! its place, beside all the others.
//!
//! A leading name that a nameless form replaces is not what it was called, and with it falls what was named to mend it: a taper and a
//! load loss imitate an insert that is cold when it enters better than either alone. A name that adds little and can be replaced
//! mends the form of the law that leads; nothing follows for the leader, and it is not claimed.

use super::designs::Design;
use super::diagnose::Case;
use super::fit::Fit;
use super::scan::price;
use super::search::{Hypothesis, SearchResult};
use super::unknown::{STANDS_SHARE, Yardsticks, margin};

/// Share of all that is named from which a member leads.
pub(super) const LEADING_SHARE: f64 = 0.5;
/// Share below which it adds little.
const MINOR_SHARE: f64 = 0.25;

/// A member in whose place a form without a name explains clearly more.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Replaceable {
    /// Which member.
    position: usize,
    /// What it adds, as a share of all that is named.
    pub(super) share: f64,
}

impl Case<'_> {
    /// The members that a nameless form replaces; none of a name that stands alone, which is weighed as a whole.
    pub(super) fn replaceable(
        &mut self,
        base: &Fit,
        best: &Hypothesis,
        designs: &[Design],
        forms: &Yardsticks<'_>,
    ) -> Vec<Replaceable> {
        // Where a feed drive tells how each tool wears, wear and settling have been asked for one beside the other.
        if best.members.len() < 2 || self.frame.levels.is_some() {
            return Vec::new();
        }
        let tried = |position| self.tried_without(position, base, best, designs, forms);
        (0..best.members.len()).filter_map(tried).collect()
    }

    fn tried_without(
        &mut self,
        position: usize,
        base: &Fit,
        best: &Hypothesis,
        designs: &[Design],
        forms: &Yardsticks<'_>,
    ) -> Option<Replaceable> {
        // A constant is part of every line: what bends beside it is something else.
        if designs[best.members[position]].kind == "offset" || best.is_exceeded(position, designs) {
            return None;
        }
        let ln_rows = self.ln_rows(base);
        let rest = self.without(best, position)?.fit;
        let scores = forms.bank.scan(&rest, ln_rows);
        let form = self.best_empirical(&rest, forms, &scores)?;
        let gained =
            |fit: &Fit, design: &Design| 2.0 * (fit.log_likelihood - rest.log_likelihood) - price(design, ln_rows);
        let own = gained(&best.fit, &designs[best.members[position]]);
        let its = gained(&form.fit, &form.design);
        let replaceable = its > own + margin(&form.design, own) && !self.is_another_shape(&form.design, best);
        let share = own / best.information;
        if replaceable && share >= LEADING_SHARE {
            // A leader that explains as much beside the form as without it is another thing than the form.
            let both = self.with_form(&best.fit, &form.design)?.fit;
            let beside = 2.0 * (both.log_likelihood - form.fit.log_likelihood);
            return (beside < STANDS_SHARE * own).then_some(Replaceable { position, share });
        }
        replaceable.then_some(Replaceable { position, share })
    }

    /// Drops the members that add little and can be replaced, one after the other.
    pub(super) fn drop_minor(
        &mut self,
        base: &Fit,
        found: &mut SearchResult,
        designs: &[Design],
        forms: &Yardsticks<'_>,
        mut replaceable: Vec<Replaceable>,
    ) {
        let least = |replaceable: Vec<Replaceable>| {
            let minor = replaceable.into_iter().filter(|replaceable| replaceable.share < MINOR_SHARE);
            minor.min_by(|a, b| a.share.total_cmp(&b.share))
        };
        while let Some(Replaceable { position, .. }) = least(replaceable) {
            let paid = price(&designs[found.best.members[position]], self.ln_rows(base));
            let Some(less) = self.without(&found.best, position) else { return };
            found.best = Hypothesis { information: less.information + paid, ..less };
            found.p_values.remove(position.min(found.p_values.len() - 1));
            replaceable = self.replaceable(base, &found.best, designs, forms);
        }
    }
}
