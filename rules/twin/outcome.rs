//! What a search comes to: the names and what is doubted of them, and the fits that the verdict compares.

use super::designs::Design;
use super::diagnose::{Case, ordinary_noise};
use super::diagnosis::{Fits, Rows, UNKNOWN, Verdict};
use super::fit::Fit;
use super::holdout::Prediction;
use super::inner_split::Left;
use super::scan::price;
use super::search::{Hypothesis, SearchResult};
use super::unknown::{Doubt, Nameless, Unknown};

/// What was found, before it is told.
pub(super) struct SearchAnswer {
    pub(super) base: Fit,
    pub(super) found: SearchResult,
    pub(super) designs: Vec<Design>,
    pub(super) doubt: Doubt,
}

/// What does not hold in runs that took no part in fitting it.
#[derive(Debug, Clone, PartialEq)]
pub struct FailedHoldout {
    /// The kinds that were left at the end; empty where there was no name.
    pub kinds: Vec<String>,
    /// Everything that had been found in the fitted rows, before one name after the other was taken away; `unknown` where it
    /// had no name.
    pub found: Vec<String>,
    /// Were they fitted runs (the inner split), or those held out?
    pub among_fitted: bool,
    /// Root mean square errors there, without it and with it.
    pub errors: (f64, f64),
    /// What it explained, in units of information.
    pub information: f64,
    /// What it would have added to every row, by label.
    pub added: Vec<(String, Vec<f64>)>,
}

/// The names, or the word for something that has none.
pub(super) fn or_unknown(kinds: &[String]) -> Vec<String> {
    if kinds.is_empty() { vec![UNKNOWN.to_owned()] } else { kinds.to_vec() }
}

/// Everything the verdict is made from.
pub struct Outcome {
    /// The baseline fitted alone, as the search compares with it.
    pub base: Fit,
    /// The baseline as it is reported.
    pub reported_base: Fit,
    /// What was found, with the baseline, as it is reported.
    pub reported: Fit,
    /// What the inner split leaves before and after.
    pub(super) inner: Option<(Left, Left)>,
    /// What had been found and does not hold in runs that took no part in fitting it.
    pub withdrawn: Option<FailedHoldout>,
    /// What the search found.
    pub found: SearchResult,
    /// Every hypothesis of the search.
    pub designs: Vec<Design>,
    /// What remains unexplained.
    pub unknown: Option<Unknown>,
    /// A cause without a name that explains as much as the named ones.
    pub nameless: Option<Nameless>,
    /// The fits compared.
    pub fits: Fits,
    /// Row by row.
    pub rows: Rows,
    /// Contribution of each added effect, by label.
    pub added: Vec<(String, Vec<f64>)>,
}

impl Outcome {
    /// Simulates what was found over every row.
    pub(super) fn new(case: &mut Case<'_>, answer: SearchAnswer) -> Self {
        let SearchAnswer { base, found, designs, doubt: Doubt { unknown, nameless } } = answer;
        let last = unknown.as_ref().map_or_else(|| found.best.fit.clone(), |unknown| unknown.fit.clone());
        let empty = || Prediction { total: vec![0.0; case.told().scene.rows()], contributions: Vec::new() };
        let none = empty();
        let (checked_base, checked) = (case.checked(&base, last.noise), case.checked(&last, last.noise));
        let inner = checked_base.left.zip(checked.left);
        let (reported_base, before) = case.strictest(checked_base.fit);
        let (reported, before) = (checked.fit, before.unwrap_or_else(|| none.clone()));
        let after = case.predict(&reported).unwrap_or(none);
        let first = case.parts.len();
        let labels = last.parts[first..].iter().map(|part| part.label().to_owned());
        let added: Vec<(String, Vec<f64>)> = labels.zip(after.contributions.iter().skip(first).cloned()).collect();
        let fits = Fits {
            rows: case.told().frame.len() + case.told().held_frame.len(),
            runs: case.units.len(),
            held_out_runs: case.held.iter().map(|unit| case.units[*unit].name.clone()).collect(),
            noise_floor: ordinary_noise(&reported),
            before: case.quality(&before),
            after: case.quality(&after),
        };
        let known = super::inputs::rows_with_inputs(&case.told().scene, &case.parts);
        let visible = |total: Vec<f64>| total.into_iter().zip(&known).map(|(x, known)| known.then_some(x)).collect();
        let rows = Rows {
            simulated_before: visible(before.total),
            simulated_after: visible(after.total),
            compared: case.told().scene.usable().to_vec(),
            effects: added.clone(),
        };
        Self {
            base,
            reported_base,
            reported,
            inner,
            withdrawn: None,
            found,
            designs,
            unknown,
            nameless,
            fits,
            rows,
            added,
        }
    }

    /// What was found, if runs that took no part in fitting it are predicted no better with it than without: the inner
    /// split decides, and the runs held out may only withdraw.
    fn refuted(&self) -> Option<FailedHoldout> {
        let best = &self.found.best;
        if best.members.is_empty() && self.unknown.is_none() {
            return None;
        }
        let named = best.members.iter().filter(|_| self.unknown.is_none());
        let kinds: Vec<String> = named.map(|member| self.designs[*member].kind.clone()).collect();
        let held_out = self.fits.before.held_out_rmse.zip(self.fits.after.held_out_rmse);
        let inner = self.inner.filter(|(before, after)| after.exceeds(*before));
        let inner = inner.map(|(before, after)| (true, (before.error(), after.error())));
        let held_out = held_out.filter(|(before, after)| after >= before).map(|errors| (false, errors));
        let (among_fitted, errors) = inner.or(held_out)?;
        let (found, information, added) = (or_unknown(&kinds), self.information(), self.added.clone());
        Some(FailedHoldout { kinds, found, among_fitted, errors, information, added })
    }

    /// Units of information of what is told or was withdrawn.
    pub(super) fn information(&self) -> f64 {
        let told = self.unknown.as_ref().map_or(self.found.best.information, |unknown| unknown.information);
        self.withdrawn.as_ref().map_or(told, |withdrawn| withdrawn.information)
    }

    /// The same with nothing told that is refuted: of several names, the one whose absence leaves least goes first.
    pub(super) fn confirmed(self, case: &mut Case<'_>) -> Self {
        let Some(withdrawn) = self.refuted() else { return self };
        let fewer = if self.unknown.is_none() { self.without_one(case, withdrawn.among_fitted) } else { None };
        let Self { base, mut found, designs, nameless, .. } = self;
        if let Some((position, less)) = fewer {
            found.best = less;
            found.p_values.remove(position.min(found.p_values.len() - 1));
            let doubt = Doubt { unknown: None, nameless };
            let mut fewer = Self::new(case, SearchAnswer { base, found, designs, doubt }).confirmed(case);
            if let Some(last) = &mut fewer.withdrawn {
                last.found = withdrawn.found;
            }
            return fewer;
        }
        found.best = Hypothesis { members: Vec::new(), fit: base.clone(), information: 0.0 };
        let nothing = SearchAnswer { base, found, designs, doubt: Doubt::NONE };
        Self { withdrawn: Some(withdrawn), ..Self::new(case, nothing) }
    }

    /// The names without the one in whose absence the rows that refuted them are predicted best, and its position; `None`
    /// for a name that stands alone.
    fn without_one(&self, case: &mut Case<'_>, among_fitted: bool) -> Option<(usize, Hypothesis)> {
        let best = &self.found.best;
        if best.members.len() < 2 {
            return None;
        }
        let mut least: Option<(f64, usize, Hypothesis)> = None;
        for position in 0..best.members.len() {
            let Some(mut less) = case.without(best, position) else { continue };
            less.information += price(&self.designs[best.members[position]], case.ln_rows(&self.base));
            let error = if among_fitted {
                case.left_of_inner(&less.fit, less.fit.noise, best.fit.noise).map(Left::error)
            } else {
                case.predict(&less.fit).and_then(|prediction| case.quality(&prediction).held_out_rmse)
            };
            let Some(error) = error else { continue };
            if least.as_ref().is_none_or(|(least, ..)| error < *least) {
                least = Some((error, position, less));
            }
        }
        least.map(|(_, position, less)| (position, less))
    }

    /// The fit that is reported.
    #[must_use]
    pub fn last(&self) -> &Fit {
        &self.reported
    }

    /// Is nothing missing?
    #[must_use]
    pub fn verdict(&self, ambiguous: bool) -> Verdict {
        match (&self.unknown, self.found.best.members.is_empty()) {
            (Some(_), _) => Verdict::Unexplained,
            (None, true) if self.withdrawn.is_some() => Verdict::CannotTell,
            (None, true) => Verdict::NoMismatch,
            (None, false) if ambiguous => Verdict::Ambiguous,
            (None, false) => Verdict::Explained,
        }
    }
}
