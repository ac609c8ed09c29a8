//! Names whose law the file does not need: the others, fitted without it, are at least as likely for their number of parameters, and predict
//! rows left out as well, and keep what the curve gains. Where they keep less of it, it is not the name that is too many: its law is not fitted.
//!
//! The curve that a set of names was found by is drawn on a grid: a delay between two of its values is made of two laws there, of which a
//! file needs one.

use super::answer::Rival;
use super::report::EvidenceReport;
use super::textbook::Textbook;
use super::thresholds::THRESHOLDS;
use super::written_model::WrittenModel;
use crate::diagnosis::{UNKNOWN, Verdict};
use crate::fit::Fit;
use numerics::statistics::count_to_f64;

/// A name that is not needed, and the others as they are written without it.
struct Needless {
    name: String,
    information: f64,
    without: WrittenModel,
}

impl EvidenceReport<'_, '_> {
    /// Takes out the names that are not needed, the least needed first; each stands beside the others until it is compared in their place.
    pub(super) fn drop_needless_names(&mut self, mut textbook: Textbook) -> Textbook {
        while let Some(needless) = self.find_needless_name(&textbook) {
            let known = self.answer.clone();
            if !self.drop_name(&textbook, needless) {
                self.answer.restore(known);
                break;
            }
            let fewer = self.fit_textbook_laws();
            let file = fewer.fit.as_ref().and_then(|fit| self.write_fit(fit));
            if file.is_none_or(|file| self.compute_kept_share(&file) < THRESHOLDS.kept_share) {
                self.answer.restore(known);
                break;
            }
            textbook = fewer;
        }
        textbook
    }

    /// Takes a name out; the others contribute what they do in the file without it. False where none is left.
    fn drop_name(&mut self, textbook: &Textbook, needless: Needless) -> bool {
        let Needless { name: gone, information, without } = needless;
        self.answer.debug.push_str(&format!("\n{gone} needless {information:.1}"));
        let of_gone = self.answer.names.iter().position(|name| *name == gone);
        let gone_place = of_gone.and_then(|at| textbook.laws[at]).map_or(usize::MAX, |(place, _)| place);
        for (name, law) in self.answer.names.iter().zip(&textbook.laws).filter(|(name, _)| **name != gone) {
            let Some((place, _)) = law else { continue };
            let own = &without.contributions[if *place > gone_place { place - 1 } else { *place }];
            let all = self.answer.contributions.iter_mut();
            all.filter(|(known, _)| known == name).for_each(|(_, x)| x.clone_from(own));
        }
        self.answer.names.retain(|name| *name != gone);
        self.answer.contributions.retain(|(name, _)| *name != gone);
        self.answer.remaining.retain(|(name, _)| *name != gone);
        let Some(instead_of) = self.answer.names.iter().find(|name| *name != UNKNOWN).cloned() else { return false };
        for rival in self.answer.rivals.iter_mut().filter(|rival| rival.instead_of == gone) {
            rival.instead_of.clone_from(&instead_of);
        }
        self.answer.rivals.push(Rival { name: gone, instead_of, nats: 0.0 });
        self.answer.verdict = Verdict::Ambiguous;
        true
    }

    fn find_needless_name(&mut self, textbook: &Textbook) -> Option<Needless> {
        let fit = textbook.fit.as_ref()?;
        let named = self.answer.names.clone();
        let places = named.iter().zip(&textbook.laws).filter_map(|(name, law)| Some((name, law.as_ref()?.0)));
        let places: Vec<(&String, usize)> = places.collect();
        if places.len() < 2 {
            return None;
        }
        let left_out = self.prepare_left_out(fit).compute_square();
        let mut least: Option<Needless> = None;
        for (name, place) in places {
            let Some(without) = self.fit_without(fit, place) else { continue };
            let information = self.compare_information(fit, &without);
            let limit = least.as_ref().map_or(0.0, |known| known.information);
            let predicts = left_out < self.prepare_left_out(&without).compute_square();
            if predicts || information >= limit {
                continue;
            }
            let written = self.write_fit(&without).map(|without| Needless { name: name.clone(), information, without });
            least = written.or(least);
        }
        least
    }

    /// Twice the loss of logarithmic likelihood from a fit to one of fewer parameters, less the price of those that it lacks.
    pub(super) fn compare_information(&self, fit: &Fit, without: &Fit) -> f64 {
        let rows = count_to_f64(self.comparison.rows.len());
        let parameters = count_to_f64(fit.free.len().saturating_sub(without.free.len()));
        let squares = |fit: &Fit| self.sum_left_squares(fit).max(f64::MIN_POSITIVE);
        let likelihood = rows * (squares(without) / squares(fit)).ln();
        self.comparison.tempering * likelihood - parameters * (self.comparison.tempering * rows).ln()
    }
}
