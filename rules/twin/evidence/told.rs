//! The answer as a diagnosis: texts, textbook parameters with intervals, places, and what to record next.
//!
//! What was found is a curve; what is told beside it is the textbook law that comes nearest, refitted together with the
//! baseline, so that its parameters mean what the catalogue says and the extended model can be simulated.

use super::baseline::Baseline;
use super::inputs::RecordingInputs;
use super::judge::{EvidenceAnswer, sum_of};
use crate::physics::{Effect, effect};
use crate::statistics::{count, rms};
use crate::twin::diagnose::Case;
use crate::twin::diagnosis::{
    Alternative, Diagnosis, Experiment, Fits, Missing, ParameterEstimate, Quality, Rows, Shift, UNKNOWN, Verdict,
};
use crate::twin::estimate::estimates;
use crate::twin::fit::{Fit, fit};
use crate::twin::inputs::rows_with_inputs;
use crate::twin::linear::least_squares;
use crate::twin::locate::{Region, conditions, spans};
use crate::twin::model::{Model, Part};
use crate::twin::next_step::{alternative, experiment, of_effects};
use crate::twin::noise::Arma;
use crate::twin::verdicts::unit_of;
use crate::twin::words;

/// Noise from which the fit of the textbook laws starts.
const START: Arma = Arma { phi: 0.4, theta: 0.0 };
/// Minutes of an experiment that varies one channel, and those asked for where nothing is known.
const SWEEP_MINUTES: f64 = 10.0;

/// Everything that is told.
pub(super) struct EvidenceReport<'a, 'm> {
    pub(super) case: &'a mut Case<'m>,
    pub(super) inputs: &'a RecordingInputs<'a>,
    pub(super) baseline: &'a Baseline,
    pub(super) answer: EvidenceAnswer,
    /// Deviation of the ordinary noise.
    pub(super) ordinary: f64,
}

impl EvidenceReport<'_, '_> {
    /// The diagnosis.
    pub(super) fn diagnosis(mut self) -> Diagnosis {
        let fits = self.fits();
        let (parts, fit) = self.textbook();
        let missing = self.missing(&fits, &parts, fit.as_ref());
        let alternatives = self.alternatives();
        let model = fit.as_ref().map_or_else(
            || self.case.model.clone(),
            |fit| Model { parts: fit.parts.clone(), ..self.case.model.clone() },
        );
        let shift =
            if missing.is_empty() { Vec::new() } else { fit.as_ref().map_or_else(Vec::new, |f| self.shifts(f)) };
        let mut diagnosis = Diagnosis {
            output: self.case.model.output.clone(),
            unit: unit_of(&self.case.model.output).to_owned(),
            verdict: self.answer.verdict,
            summary: String::new(),
            next_experiment: self.experiment(&alternatives),
            mismatch: self.regions(),
            rows: self.rows(),
            fit: Some(fits),
            baseline_shift: shift,
            missing,
            alternatives,
            withdrawn: self.answer.withdrawn.as_ref().map_or_else(Vec::new, |withdrawn| withdrawn.found.clone()),
            data_quality: self.case.faults.clone(),
            model,
            debug: self.answer.debug.clone(),
        };
        diagnosis.summary = match &self.answer.withdrawn {
            Some(withdrawn) => words::withdrawn(withdrawn, &diagnosis.unit),
            None => words::summary(&diagnosis),
        };
        diagnosis
    }

    fn error(&self, total: &[f64], rows: &[bool]) -> Option<f64> {
        let recorded = self.inputs.scene.recorded();
        let left: Vec<f64> = (0..rows.len()).filter(|row| rows[*row]).map(|row| recorded[row] - total[row]).collect();
        (!left.is_empty()).then(|| rms(&left))
    }

    fn fits(&self) -> Fits {
        let quality = |total: &[f64]| Quality {
            rmse: self.error(total, &self.inputs.fitted).unwrap_or(0.0),
            held_out_rmse: self.error(total, &self.inputs.held_out),
        };
        Fits {
            rows: self.inputs.comparable.iter().filter(|comparable| **comparable).count(),
            runs: self.case.units.len(),
            held_out_runs: self.case.held.iter().map(|unit| self.case.units[*unit].name.clone()).collect(),
            noise_floor: self.ordinary,
            before: quality(&self.inputs.simulated),
            after: quality(&self.answer.after),
        }
    }

    /// The nearest law of the catalogue for each name, and all of them refitted with the baseline.
    fn textbook(&mut self) -> (Vec<Option<usize>>, Option<Fit>) {
        let mut parts = self.baseline.parts.clone();
        let mut places = Vec::new();
        for name in &self.answer.names {
            let own = self.answer.contributions.iter().find(|(known, _)| known == name);
            let part = own.and_then(|(_, x)| self.nearest(name, x));
            places.push(part.is_some().then_some(parts.len()));
            parts.extend(part);
        }
        if self.answer.names.is_empty() {
            return (places, None);
        }
        // Told as the inner split of the fitted runs wants it: much memory of the noise would swallow levels.
        let fit = self.case.with_data(|data| fit(data, &parts, START));
        (places, fit.map(|fit| self.case.checked(&fit, fit.noise).fit))
    }

    /// The form of a kind whose law, the baseline beside it, comes nearest to a contribution.
    fn nearest(&self, kind: &str, contribution: &[f64]) -> Option<Part> {
        let hypothesis = self.case.model.hypotheses.iter().find(|part| part.label() == kind);
        if let Some(part) = hypothesis {
            return Some(part.clone());
        }
        let effect = effect(kind)?;
        let scene = self.inputs.scene;
        let rows: Vec<usize> = self.inputs.taken(false).collect();
        let over = |column: &[f64]| rows.iter().map(|row| column[*row]).collect::<Vec<f64>>();
        let wanted = over(contribution);
        let mut best: Option<(f64, Part)> = None;
        for form in effect.forms(scene) {
            let Some(laws) = effect.columns(scene, &form) else { continue };
            let mut columns: Vec<Vec<f64>> = laws.iter().map(|(_, law)| over(law)).collect();
            let own = columns.len();
            columns.extend(self.baseline.tangents.iter().map(|tangent| over(tangent)));
            let solution = least_squares(&columns, &wanted);
            if best.as_ref().is_none_or(|(left, _)| solution.rss < *left) {
                let names: Vec<&'static str> = laws.iter().map(|(name, _)| *name).collect();
                let part = with_values(effect, &form, &names, &solution.coefficients[..own]);
                best = Some((solution.rss, part));
            }
        }
        best.map(|(_, part)| part)
    }

    fn missing(&mut self, fits: &Fits, places: &[Option<usize>], fit: Option<&Fit>) -> Vec<Missing> {
        let names = self.answer.names.clone();
        let mut all = Vec::new();
        for (at, name) in names.iter().enumerate() {
            let place = places.get(at).copied().flatten();
            let parameters: Vec<ParameterEstimate> = match (place, fit) {
                (Some(place), Some(fit)) => estimates(self.case, fit, place),
                _ => self.curve_size(name),
            };
            let (statement, equation) = texts(name, place.and_then(|place| fit.map(|fit| &fit.parts[place])));
            all.push(Missing {
                effect: name.clone(),
                statement,
                equation,
                parameters,
                delta_ic: self.answer.information,
                p_value: (-0.5 * self.answer.information).exp().clamp(1e-12, 1.0),
                held_out_rmse_before: fits.before.held_out_rmse,
                held_out_rmse_after: fits.after.held_out_rmse,
                absorbed_share: self.absorbed(name),
            });
        }
        all
    }

    /// The size of a curve that has no law: its root mean square where it acts.
    fn curve_size(&self, name: &str) -> Vec<ParameterEstimate> {
        let Some((_, x)) = self.answer.contributions.iter().find(|(known, _)| known == name) else { return Vec::new() };
        let value = rms(x);
        let unit = unit_of(&self.case.model.output).to_owned();
        vec![ParameterEstimate { name: "rms".to_owned(), value, low: 0.8 * value, high: 1.2 * value, unit }]
    }

    /// Share of a contribution's square that the baseline can imitate.
    fn absorbed(&self, name: &str) -> f64 {
        let of = |all: &[(String, Vec<f64>)]| {
            let own = all.iter().find(|(known, _)| known == name);
            own.map_or(0.0, |(_, x)| self.inputs.taken(false).map(|row| x[row] * x[row]).sum::<f64>())
        };
        let (whole, left) = (of(&self.answer.contributions), of(&self.answer.remaining));
        if whole > 0.0 { (1.0 - left / whole).clamp(0.0, 1.0) } else { 0.0 }
    }

    fn alternatives(&self) -> Vec<Alternative> {
        self.answer.alternatives.iter().map(|(other, instead)| alternative(other, instead, 0.0)).collect()
    }

    /// What separates what is left; always where the answer is not sure.
    fn experiment(&self, alternatives: &[Alternative]) -> Option<Experiment> {
        if matches!(self.answer.verdict, Verdict::Explained | Verdict::NoMismatch) {
            return None;
        }
        let open = alternatives.iter().flat_map(|other| [other.effect.as_str(), other.instead_of.as_str()]);
        let gone = self.answer.withdrawn.iter().flat_map(|withdrawn| &withdrawn.kinds);
        let kinds = open.chain(self.answer.names.iter().chain(gone).map(String::as_str));
        let gain = self.answer.information;
        of_effects(kinds, gain).or_else(|| Some(experiment(self.sweep(), SWEEP_MINUTES, gain, "")))
    }

    /// To vary one input where the difference is largest.
    fn sweep(&self) -> String {
        let place = self.regions().into_iter().find_map(|region| region.conditions.into_iter().next());
        let channel = place.map_or("the input that changes most".to_owned(), |condition| condition.column().to_owned());
        format!("hold everything else and step {channel} through its range in five levels, upwards and downwards")
    }

    /// One region for each name, the largest share first.
    fn regions(&self) -> Vec<Region> {
        let rows = self.inputs.rows;
        let whole: f64 = sum_of(&self.answer.remaining, rows).iter().map(|x| x * x).sum();
        let mut all: Vec<Region> = Vec::new();
        for (name, left) in &self.answer.remaining {
            if !self.answer.names.contains(name) {
                continue;
            }
            let own = self.answer.contributions.iter().find(|(known, _)| known == name).map(|(_, x)| x);
            let squares: Vec<f64> = left.iter().map(|x| x * x).collect();
            let mean = crate::statistics::mean(&squares);
            let active: Vec<bool> = squares.iter().map(|square| *square > mean && mean > 0.0).collect();
            let inside = active.iter().filter(|active| **active).count();
            let over = |x: &[f64]| x.iter().zip(&active).filter(|(_, active)| **active).map(|(x, _)| *x).sum::<f64>();
            all.push(Region {
                effect: name.clone(),
                share: over(&squares) / whole.max(f64::MIN_POSITIVE),
                mean: over(own.unwrap_or(left)) / count(inside.max(1)),
                conditions: conditions(self.inputs.scene, &active),
                spans: spans(self.inputs.scene, &active),
                onset: None,
            });
        }
        all.retain(|region| !region.spans.is_empty());
        all.sort_by(|a, b| b.share.total_cmp(&a.share));
        all
    }

    fn rows(&self) -> Rows {
        let known = rows_with_inputs(self.inputs.scene, &self.case.parts);
        let visible = |total: &[f64]| total.iter().zip(&known).map(|(x, known)| known.then_some(*x)).collect();
        Rows {
            simulated_before: visible(&self.inputs.simulated),
            simulated_after: visible(&self.answer.after),
            compared: self.inputs.comparable.clone(),
            effects: self.answer.contributions.clone(),
        }
    }

    fn shifts(&self, fit: &Fit) -> Vec<Shift> {
        let pairs = self.baseline.parts.iter().zip(&fit.parts);
        let of = |(before, after): (&Part, &Part)| {
            let parameters = before.parameters.iter().zip(&after.parameters).filter(|(before, _)| !before.fixed);
            let shift = |(b, a): (&crate::twin::model::Parameter, &crate::twin::model::Parameter)| Shift {
                parameter: format!("{}.{}", before.label(), b.name),
                before: b.value,
                after: a.value,
            };
            parameters.map(shift).collect::<Vec<_>>()
        };
        pairs.flat_map(of).collect()
    }
}

/// A candidate with these values of its linear parameters, within what is possible.
fn with_values(
    effect: &'static dyn Effect,
    form: &crate::physics::Form,
    names: &[&'static str],
    values: &[f64],
) -> Part {
    let mut part = Part::candidate(effect, form, names);
    for (name, value) in names.iter().zip(values) {
        if let Some(parameter) = part.parameters.iter_mut().find(|p| p.name == *name && !p.fixed) {
            parameter.value = value.clamp(parameter.range.0, parameter.range.1);
        }
    }
    part
}

fn texts(name: &str, part: Option<&Part>) -> (String, String) {
    if name == UNKNOWN {
        let statement = "Something real that no effect of the catalogue explains; described by its shape only";
        return (statement.to_owned(), "a curve over the inputs, as drawn".to_owned());
    }
    let place = part.and_then(Part::effect_and_form).and_then(|(_, form)| form.place);
    let place = place.map(|(column, word)| format!(" ({column} {word})")).unwrap_or_default();
    effect(name).map_or_else(
        || ("The user's hypothesis".to_owned(), name.to_owned()),
        |effect| (format!("{}{place}", effect.doc().en.statement), effect.doc().law.to_owned()),
    )
}
