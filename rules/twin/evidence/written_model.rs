//! The model as it stands in a file, and the figures of each name that it tells.

use super::answer::Named;
use super::latent_law::{is_latent, write_followed_step, write_latent_part};
use super::report::EvidenceReport;
use super::textbook::Textbook;
use crate::fit::Fit;
use crate::model::Part;
use crate::simulate::simulate_written_parts;
use numerics::statistics::count_to_f64;

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
        let rows = count_to_f64(self.comparison.rows.len());
        let parameters = count_to_f64(fit.free.len().saturating_sub(without.free.len()));
        let squares = |fit: &Fit| self.sum_left_squares(fit).max(f64::MIN_POSITIVE);
        let likelihood = rows * (squares(&without) / squares(fit)).ln();
        let information = self.comparison.tempering * likelihood - parameters * (self.comparison.tempering * rows).ln();
        let written = self.write_fit(&without)?;
        Some(OwnFigures { information, error_without: self.compute_told_rmse(&written.total) })
    }
}
