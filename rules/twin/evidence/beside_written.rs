//! What stands beside the written names: the search is made once more with the file as its model.
//!
//! The first search takes a law on a grid of its shapes, and what the grid misses of a large effect hides a small one, or is given to a name
//! that is not there. The file has the law as it was fitted; what it leaves is judged by the same rules as any recording beside any model.

use super::naming_decision::are_confused;
use super::report::EvidenceReport;
use super::search_missing;
use super::textbook::Textbook;
use super::thresholds::THRESHOLDS;
use super::written_model::WrittenModel;
use crate::diagnosis::{UNKNOWN, Verdict};
use crate::model::Model;

impl EvidenceReport<'_, '_> {
    /// The names with those that are sure beside them, written together; as they were where there are none, or where the file of all is no
    /// better. One that the catalogue says is confused with a name known before, or with which the file is no better than the curve that
    /// the first names were found by, has something without a name beside it: it may be what their law lacks of their own curve.
    pub(super) fn search_beside_names(
        &mut self,
        textbook: Textbook,
        written: WrittenModel,
    ) -> (Textbook, WrittenModel) {
        let Some(before) = self.measure_prediction(&textbook, &written) else { return (textbook, written) };
        let curve = self.compute_told_rmse(&self.answer.after);
        let known = self.answer.clone();
        if self.add_names_beside(&textbook, &written).is_none() {
            self.answer.restore(known);
            return (textbook, written);
        }
        let wider = self.fit_textbook_laws();
        let wider = self.drop_needless_names(wider);
        let is_possible = wider.laws.iter().all(Option::is_some) && self.list_refused_names(&wider).is_empty();
        let file = wider.fit.as_ref().filter(|_| is_possible).and_then(|fit| self.write_fit(fit));
        let better =
            file.filter(|file| self.measure_prediction(&wider, file).is_some_and(|own| own.compute_lead(before) > 0.0));
        let Some(file) = better else {
            self.answer.restore(known);
            return (textbook, written);
        };
        self.doubt_names_beside(&known.names, self.compute_told_rmse(&file.total) < curve);
        (wider, file)
    }

    /// Sets something without a name beside each added name that may be what the law of a name known before lacks of its own curve.
    fn doubt_names_beside(&mut self, known: &[String], is_beyond_curve: bool) {
        let is_own = |name: &String| is_beyond_curve && !known.iter().any(|other| are_confused(name, other));
        let beside = self.answer.names.iter().filter(|name| !known.contains(name));
        let doubted: Vec<String> = beside.filter(|name| !is_own(name)).cloned().collect();
        if !doubted.is_empty() {
            self.answer.add_unknown_rivals(&doubted);
        }
    }

    /// Adds what is sure beside the names; `None` where nothing is.
    fn add_names_beside(&mut self, textbook: &Textbook, written: &WrittenModel) -> Option<()> {
        // What a law leaves of its own curve is an error of its form, and no other cause.
        if textbook.laws.iter().any(Option::is_none) || self.compute_kept_share(written) < THRESHOLDS.kept_share {
            return None;
        }
        let model = Model { parts: written.parts.clone(), ..self.case.model.clone() };
        let found = search_missing(self.case, &model.parts, &model, |_, found| found.answer)?;
        self.answer.debug.push_str(&format!("\nbeside: {:?} {:?}", found.verdict, found.names));
        let is_new = |name: &String| name != UNKNOWN && !self.answer.names.contains(name);
        if found.verdict != Verdict::Explained || !found.names.iter().all(is_new) {
            return None;
        }
        let beside = found.contributions.into_iter().filter(|(name, _)| found.names.contains(name));
        self.set_contributions(self.list_written_contributions(textbook, written).into_iter().chain(beside).collect());
        for name in &found.names {
            let probability = found.probabilities.get(name).copied();
            self.answer.probabilities.extend(probability.map(|probability| (name.clone(), probability)));
        }
        self.answer.rivals.retain(|rival| !found.names.contains(&rival.name));
        self.answer.names.extend(found.names);
        Some(())
    }
}
