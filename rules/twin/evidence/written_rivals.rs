//! Names that are still open, each tried as it would be written: a law that predicts rows left out worse than another, and the rows that are
//! told as well, gives way to it. The curve that the names were found by has freedoms that no file has.
//!
//! A law that is followed through the recording (a drift, a lot, an edge) fits between the rows that it was fitted to; one that can be
//! simulated ahead has no such freedom. The two are not compared.

use super::answer::Rival;
use super::report::EvidenceReport;
use super::textbook::Textbook;
use super::thresholds::THRESHOLDS;
use super::written_model::WrittenModel;
use crate::diagnosis::{UNKNOWN, Verdict};
use crate::model::Part;
use numerics::statistics::count_to_f64;

/// Rivals that are written and compared, at most, the likeliest first: each takes as long as the fit of what is told, once in the place of
/// each name.
const RIVALS_MAX: usize = 4;

/// How well a file predicts.
#[derive(Debug, Clone, Copy)]
pub(super) struct WrittenPrediction {
    /// Logarithmic likelihood of rows left out, nats, but for a constant.
    log_likelihood: f64,
    /// Root mean square error of the rows that are told.
    error: f64,
}

impl WrittenPrediction {
    /// Nats by which rows left out are likelier than with `other`; zero where the rows that are told say the opposite.
    pub(super) fn compute_lead(self, other: Self) -> f64 {
        let lead = self.log_likelihood - other.log_likelihood;
        let agrees = (other.error - self.error) * lead > 0.0;
        if agrees { lead } else { 0.0 }
    }
}

impl EvidenceReport<'_, '_> {
    /// Settles what is open among names by their written laws; what is told may be another name then.
    pub(super) fn settle_rivals(&mut self, textbook: Textbook, written: WrittenModel) -> (Textbook, WrittenModel) {
        let mut told = (textbook, written);
        let Some(mut best) = self.measure_prediction(&told.0, &told.1) else { return told };
        let mut open = self.answer.rivals.clone();
        open.retain(|rival| rival.name != UNKNOWN);
        open.sort_by(|a, b| a.nats.total_cmp(&b.nats));
        for mut rival in open.into_iter().take(RIVALS_MAX) {
            // What it stands beside may have given way to another name meanwhile.
            let Some(known) = self.answer.rivals.iter().find(|known| known.name == rival.name) else { continue };
            rival.instead_of.clone_from(&known.instead_of);
            let Some((instead_of, other, prediction)) = self.write_in_best_place(&rival) else { continue };
            self.answer.move_rival(&rival, &instead_of);
            rival.instead_of = instead_of;
            if list_followed(&other.0) != list_followed(&told.0) {
                continue;
            }
            let lead = best.compute_lead(prediction);
            self.answer.debug.push_str(&format!("\n{} for {}: written lead {lead:.1}", rival.name, rival.instead_of));
            if lead < -THRESHOLDS.rival_nats {
                self.answer.exchange_name(&rival);
                (told, best) = (other, prediction);
            } else if lead > THRESHOLDS.rival_nats {
                self.answer.drop_rival(&rival);
            }
        }
        let is_there = self.answer.existence.probability_of_nothing < THRESHOLDS.nothing_sure;
        if self.answer.rivals.is_empty() && is_there {
            self.answer.verdict = Verdict::Explained;
        }
        told
    }

    pub(super) fn measure_prediction(&self, textbook: &Textbook, written: &WrittenModel) -> Option<WrittenPrediction> {
        let square = self.prepare_left_out(textbook.fit.as_ref()?).compute_square().max(f64::MIN_POSITIVE);
        let rows = self.comparison.tempering * count_to_f64(self.comparison.rows.len());
        Some(WrittenPrediction {
            log_likelihood: -0.5 * rows * square.ln(),
            error: self.compute_told_rmse(&written.total)?,
        })
    }

    /// The names with `rival` in the place of the one that it replaces best: of two causes it may stand for the one that it was not listed
    /// beside.
    fn write_in_best_place(&mut self, rival: &Rival) -> Option<(String, (Textbook, WrittenModel), WrittenPrediction)> {
        let mut best: Option<(String, (Textbook, WrittenModel), WrittenPrediction)> = None;
        for name in self.answer.names.clone() {
            if name == UNKNOWN || name == rival.name {
                continue;
            }
            let placed = Rival { instead_of: name.clone(), ..rival.clone() };
            let Some((written, prediction)) = self.write_with_rival(&placed) else { continue };
            let is_best = best.as_ref().is_none_or(|(_, _, known)| prediction.log_likelihood > known.log_likelihood);
            if is_best {
                best = Some((name, written, prediction));
            }
        }
        best
    }

    /// The names with `rival` in its place, as they would be written; `None` where one of them has no law or an impossible one.
    fn write_with_rival(&mut self, rival: &Rival) -> Option<((Textbook, WrittenModel), WrittenPrediction)> {
        let back = self.answer.exchange_name(rival);
        let textbook = self.fit_textbook_laws();
        let is_possible = textbook.laws.iter().all(Option::is_some) && self.list_refused_names(&textbook).is_empty();
        self.answer.exchange_name(&back);
        let written = textbook.fit.as_ref().filter(|_| is_possible).and_then(|fit| self.write_fit(fit))?;
        let prediction = self.measure_prediction(&textbook, &written)?;
        Some(((textbook, written), prediction))
    }
}

/// Which laws are followed through the recording.
fn list_followed(textbook: &Textbook) -> Vec<bool> {
    let part = |place: usize| textbook.fit.as_ref().and_then(|fit| fit.parts.get(place));
    textbook.laws.iter().map(|law| law.and_then(|(place, _)| part(place)).is_some_and(Part::is_followed)).collect()
}
