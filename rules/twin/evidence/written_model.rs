//! The model as it stands in a file, and the figures of each name that it tells.

use super::answer::Named;
use super::contributions::project_out_baseline;
use super::latent_law::{is_latent, write_followed_step, write_latent_part};
use super::report::EvidenceReport;
use super::textbook::Textbook;
use super::thresholds::THRESHOLDS;
use crate::diagnosis::{UNKNOWN, Verdict};
use crate::fit::Fit;
use crate::model::Part;
use crate::simulate::simulate_written_parts;

/// Times that names are replaced by the nearest laws beside them.
const REPLACED_MAX: usize = 3;

/// What the file of a set of names does over the recording.
pub(super) struct WrittenModel {
    /// Its parts; the last are those of the names, in the order of their laws.
    pub(super) parts: Vec<Part>,
    /// The simulated output, row by row.
    pub(super) total: Vec<f64>,
    /// What each part adds.
    pub(super) contributions: Vec<Vec<f64>>,
}

/// What one name is worth beside the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OwnFigures {
    /// Twice the loss of logarithmic likelihood without it, less the price of its parameters.
    pub(super) information: f64,
    /// Root mean square error without it in rows held out; in the fitted ones where none were held out.
    pub(super) error_without: Option<f64>,
}

impl EvidenceReport<'_, '_> {
    /// Names whose file is possible and lowers the error of the rows that are told: a name that is not, or does not, gives way to the nearest
    /// law beside it, and in the end to something without a name.
    pub(super) fn settle_names(&mut self) -> (Textbook, Option<WrittenModel>) {
        let textbook = self.fit_textbook_laws();
        let mut textbook = self.drop_needless_names(textbook);
        for attempt in 0..=REPLACED_MAX {
            let mut refused = self.list_refused_names(&textbook);
            if refused.is_empty() {
                if !matches!(self.answer.verdict, Verdict::Explained | Verdict::Ambiguous) {
                    return (textbook, None);
                }
                let written = self.write_helpful_model(&textbook);
                if written.is_some() {
                    return (textbook, written);
                }
                refused.extend(self.answer.names.iter().filter(|name| *name != UNKNOWN).cloned());
            }
            let unnamed = if attempt < REPLACED_MAX { self.answer.replace_names(&refused) } else { refused };
            if !unnamed.is_empty() {
                self.answer.reject_names(&unnamed, |x| self.inputs.fitted_rows(false).map(|row| x[row] * x[row]).sum());
            }
            textbook = self.fit_textbook_laws();
        }
        (textbook, None)
    }

    /// What is written for the names; `None` where no law is, or where the file does not lower the error of the rows that are told.
    fn write_helpful_model(&mut self, textbook: &Textbook) -> Option<WrittenModel> {
        let fit = textbook.fit.as_ref().filter(|_| textbook.laws.iter().any(Option::is_some));
        let written = fit.and_then(|fit| self.write_fit(fit));
        let (before, curve) =
            (self.compute_told_error(&self.inputs.simulated), self.compute_told_error(&self.answer.after));
        let law = written.as_ref().map_or(f64::INFINITY, |written| self.compute_told_error(&written.total));
        self.answer.debug.push_str(&format!("\nwritten {law:.5} before {before:.5} curve {curve:.5}"));
        written.filter(|_| law < before)
    }

    fn compute_told_error(&self, total: &[f64]) -> f64 {
        self.compute_told_rmse(total).unwrap_or(f64::INFINITY)
    }

    /// Share of what the curve gains that the file keeps.
    pub(super) fn compute_kept_share(&self, written: &WrittenModel) -> f64 {
        let (before, curve) =
            (self.compute_told_error(&self.inputs.simulated), self.compute_told_error(&self.answer.after));
        (before - self.compute_told_error(&written.total)) / (before - curve).max(f64::MIN_POSITIVE)
    }

    /// What is told is what the file does: the free curve is the ceiling only. A law that keeps little of what the curve gains stands beside
    /// something without a name, and so does a name that nothing can be written for.
    pub(super) fn tell_written_model(&mut self, textbook: &Textbook, written: WrittenModel) -> WrittenModel {
        let kept = self.compute_kept_share(&written);
        let lawless = self.answer.names.iter().zip(&textbook.laws).filter(|(_, law)| law.is_none());
        let lawless: Vec<String> = lawless.map(|(name, _)| name.clone()).collect();
        if kept < THRESHOLDS.kept_share {
            let names = self.answer.names.clone();
            self.answer.add_unknown_rivals(&names);
        } else if !lawless.is_empty() {
            self.answer.add_unknown_rivals(&lawless);
        }
        self.set_contributions(self.list_written_contributions(textbook, &written));
        self.answer.after.clone_from(&written.total);
        written
    }

    /// What each name adds, and what of it the baseline cannot imitate.
    pub(super) fn set_contributions(&mut self, contributions: Vec<Named>) {
        let project = |(name, x): &Named| (name.clone(), project_out_baseline(self.inputs, &self.baseline.tangents, x));
        self.answer.remaining = contributions.iter().map(project).collect();
        self.answer.contributions = contributions;
    }

    /// Writes a fit and reads it again; `None` where the file would be refused.
    pub(super) fn write_fit(&self, fit: &Fit) -> Option<WrittenModel> {
        let left: Vec<f64> = self.recorded.iter().zip(&fit.simulated).map(|(y, f)| y - f).collect();
        let write = |part: &Part| match self.case.scene.unrecorded_state().filter(|_| is_latent(part)) {
            Some(on) => write_latent_part(self.inputs, part, on, &left),
            None => write_followed_step(self.inputs, part, self.ordinary).or_else(|| Some(part.clone())),
        };
        let parts: Vec<Part> = fit.parts.iter().map(write).collect::<Option<_>>()?;
        let rows = simulate_written_parts(self.recording, self.case.model, &parts)?;
        let known = |(row, x): (usize, Option<f64>)| x.unwrap_or(self.inputs.simulated[row]);
        let total: Vec<f64> = rows.total.into_iter().enumerate().map(known).collect();
        let contributions = rows.parts.into_iter().map(|(_, x)| x).collect();
        total.iter().all(|x| x.is_finite()).then_some(WrittenModel { parts, total, contributions })
    }

    /// The model's own parts refitted within what is possible; `None` where their file would be refused.
    pub(super) fn refit_baseline(&mut self) -> Option<Vec<Part>> {
        let parts = self.baseline.parts.clone();
        let fit = self.refit_parts(&parts)?;
        self.write_fit(&fit).map(|written| written.parts)
    }

    /// What each name with a law adds in the file.
    pub(super) fn list_written_contributions(&self, textbook: &Textbook, written: &WrittenModel) -> Vec<Named> {
        let named = self.answer.names.iter().zip(&textbook.laws);
        named
            .filter_map(|(name, law)| Some((name.clone(), written.contributions.get(law.as_ref()?.0)?.clone())))
            .collect()
    }

    /// What the law of a name is worth: the others refitted without it.
    pub(super) fn measure_own_figures(&mut self, fit: &Fit, place: usize) -> Option<OwnFigures> {
        let without = self.fit_without(fit, place)?;
        let information = self.compare_information(fit, &without);
        let written = self.write_fit(&without)?;
        Some(OwnFigures { information, error_without: self.compute_told_rmse(&written.total) })
    }
}
