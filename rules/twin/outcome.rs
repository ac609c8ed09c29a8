//! What a search comes to: the names and what is doubted of them, and the fits that the verdict compares.

use super::confirmed::Totals;
use super::designs::Design;
use super::diagnose::{Case, ordinary_noise};
use super::diagnosis::{Fits, Rows, Verdict};
use super::fit::Fit;
use super::holdout::Prediction;
use super::search::Found;
use super::size::BEYOND_DOUBT_INFORMATION;
use super::unknown::{Doubt, Nameless, Unknown};

/// What was found, before it is told.
pub(super) struct Answer {
    pub(super) base: Fit,
    pub(super) found: Found,
    pub(super) designs: Vec<Design>,
    pub(super) doubt: Doubt,
    /// Did an entry or an exit that is too slight to be one explain as much?
    pub(super) slight_entry: bool,
}

impl Answer {
    /// What is named, or what is described without a name, explains so much.
    pub(super) fn information(&self) -> f64 {
        self.doubt.unknown.as_ref().map_or(self.found.best.information, |unknown| unknown.information)
    }
}

/// Everything the verdict is made from.
pub struct Outcome {
    /// The baseline fitted alone.
    pub base: Fit,
    /// What the search found.
    pub found: Found,
    /// Every hypothesis of the search.
    pub designs: Vec<Design>,
    /// What remains unexplained.
    pub unknown: Option<Unknown>,
    /// A cause without a name that explains as much as the named ones.
    pub nameless: Option<Nameless>,
    /// Did an entry or an exit that is too slight to be one explain as much?
    pub slight_entry: bool,
    /// The kind that is in doubt although nothing else explains as much.
    pub doubted: Option<String>,
    /// The fits compared.
    pub fits: Fits,
    /// Row by row.
    pub rows: Rows,
    /// Contribution of each added effect, by label.
    pub added: Vec<(String, Vec<f64>)>,
}

impl Outcome {
    /// Simulates what was found over every row.
    pub(super) fn new(case: &mut Case<'_>, answer: Answer) -> Self {
        let Answer { base, found, designs, doubt: Doubt { unknown, nameless }, slight_entry } = answer;
        let last = unknown.as_ref().map_or_else(|| found.best.fit.clone(), |unknown| unknown.fit.clone());
        let empty = || Prediction { total: vec![0.0; case.told().scene.rows()], contributions: Vec::new() };
        let none = empty();
        let before = case.predict(&base).unwrap_or_else(|| none.clone());
        let after = case.predict(&last).unwrap_or(none);
        let totals = Totals { before: &before.total, after: &after.total };
        let shown = case.shown(&last, &totals);
        let doubted = if unknown.is_none() { case.doubted(&found.best, shown) } else { None };
        let first = case.parts.len();
        let labels = last.parts[first..].iter().map(|part| part.label().to_owned());
        let added: Vec<(String, Vec<f64>)> = labels.zip(after.contributions.iter().skip(first).cloned()).collect();
        let fits = Fits {
            rows: case.told().frame.len() + case.told().held_frame.len(),
            runs: case.units.len(),
            held_out_runs: case.held.iter().map(|unit| case.units[*unit].name.clone()).collect(),
            noise_floor: ordinary_noise(&last),
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
        Self { base, found, designs, unknown, nameless, slight_entry, doubted, fits, rows, added }
    }

    /// Is something said to remain where nothing is named, and not beyond doubt?
    #[must_use]
    pub(super) fn is_weak_alarm_without_a_name(&self) -> bool {
        let weak = self.unknown.as_ref().is_some_and(|unknown| unknown.information < BEYOND_DOUBT_INFORMATION);
        weak && self.found.best.members.is_empty()
    }

    /// The fit that is reported.
    #[must_use]
    pub fn last(&self) -> &Fit {
        self.unknown.as_ref().map_or(&self.found.best.fit, |unknown| &unknown.fit)
    }

    /// Is nothing missing?
    #[must_use]
    pub fn verdict(&self, ambiguous: bool) -> Verdict {
        match (&self.unknown, self.found.best.members.is_empty()) {
            (Some(_), _) => Verdict::Unexplained,
            (None, true) => Verdict::NoMismatch,
            (None, false) if ambiguous => Verdict::Ambiguous,
            (None, false) => Verdict::Explained,
        }
    }
}
