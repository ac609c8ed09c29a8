//! The answer as a diagnosis: texts, textbook parameters with intervals, places, and what to record next.
//!
//! What was found is a curve; what is told beside it is the textbook law that comes nearest, refitted together with the
//! baseline, so that its parameters mean what the catalogue says and the extended model can be simulated. A name that no
//! textbook law bears out is taken back.

use super::answer::{EvidenceAnswer, sum_of};
use super::decision::THRESHOLDS;
use super::gram::Comparison;
use super::inputs::RecordingInputs;
use super::noise::NoiseModel;
use crate::physics::{Bound, Effect, Entry, Form, Scene, effect};
use crate::statistics::{count, rms};
use crate::twin::case::Case;
use crate::twin::diagnosis::{
    Alternative, Diagnosis, Experiment, Fits, Missing, ParameterEstimate, Quality, Rows, Shift, UNKNOWN, Verdict,
    unit_of,
};
use crate::twin::fit::{Fit, Metric, fit};
use crate::twin::inputs::rows_with_inputs;
use crate::twin::intervals::FittedRows;
use crate::twin::linear::least_squares;
use crate::twin::locate::{Region, active_rows, spans, usual_size};
use crate::twin::model::{Model, Parameter, Part};
use crate::twin::next_step::{alternative, of_effects, over_channel};
use crate::twin::place::PlaceSearch;
use crate::twin::words;
use adapters::Recording;
use adapters::bilingual::Bilingual;

/// Share of the end of a range within which a value stands at it.
const AT_END: f64 = 1e-6;

/// Share of the greatest contribution from which a row counts as acted upon.
const ACTING: f64 = 0.1;

/// Everything that is told.
pub(super) struct EvidenceReport<'a, 'm> {
    pub(super) recording: &'a Recording,
    pub(super) case: &'a mut Case<'m>,
    pub(super) inputs: &'a RecordingInputs<'a>,
    pub(super) baseline: &'a Fit,
    pub(super) answer: EvidenceAnswer,
    pub(super) comparison: &'a Comparison<'a>,
    /// The likeliest noise.
    pub(super) noise: NoiseModel,
    /// The recorded output with outliers cut.
    pub(super) recorded: &'a [f64],
    /// Deviation of the ordinary noise.
    pub(super) ordinary: f64,
}

/// Textbook laws of what was found.
struct Textbook {
    /// The part of each name, and the share of its contribution that the textbook law makes; `None` of one without a law.
    laws: Vec<Option<(usize, f64)>>,
    /// Those parts beside the model's, refitted; `None` where nothing was found.
    fit: Option<Fit>,
}

impl EvidenceReport<'_, '_> {
    /// The diagnosis.
    pub(super) fn diagnosis(mut self) -> Diagnosis {
        let fits = self.fits();
        let mut textbook = self.textbook(&[]);
        let refused = self.refused(&textbook);
        if !refused.is_empty() {
            self.answer.refuse(&refused, |x| self.inputs.taken(false).map(|row| x[row] * x[row]).sum());
            textbook = self.textbook(&[]);
        }
        let doubted = self.doubted(&textbook);
        if !doubted.is_empty() {
            self.answer.doubt(&doubted);
            textbook = self.textbook(&doubted);
        }
        let missing = self.missing(&fits, &textbook);
        let alternatives: Vec<Alternative> = self.alternatives();
        let fit = textbook.fit.as_ref();
        let model = fit.map_or_else(
            || self.case.model.clone(),
            |fit| Model { parts: fit.parts.clone(), ..self.case.model.clone() },
        );
        let shift = if missing.is_empty() { Vec::new() } else { fit.map_or_else(Vec::new, |f| self.shifts(f)) };
        let withdrawn = self.answer.withdrawn.take();
        let mut diagnosis = Diagnosis {
            output: self.case.model.output.clone(),
            unit: unit_of(&self.case.model.output).to_owned(),
            verdict: self.answer.verdict,
            summary: Bilingual::default(),
            next_experiment: self.experiment(&alternatives, withdrawn.as_ref().map_or(&[], |gone| &gone.found)),
            mismatch: self.regions(),
            rows: self.rows(),
            existence: Some(self.answer.existence),
            fit: Some(fits),
            baseline_shift: shift,
            missing,
            alternatives,
            data_quality: self.case.faults.clone(),
            model,
            debug: self.answer.debug.clone(),
        };
        diagnosis.summary = match &withdrawn {
            Some(gone) => words::withdrawn(&gone.found, gone.among_fitted, gone.errors, &diagnosis.unit),
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

    /// The nearest law of the catalogue for each name but some, and all of them refitted with the baseline.
    fn textbook(&mut self, without: &[String]) -> Textbook {
        let mut parts = self.baseline.parts.clone();
        let mut laws = Vec::new();
        for name in &self.answer.names {
            let own = self.answer.contributions.iter().find(|(known, _)| known == name && !without.contains(known));
            let law = own.and_then(|(_, x)| self.nearest(name, x));
            laws.push(law.as_ref().map(|(_, share)| (parts.len(), *share)));
            parts.extend(law.map(|(part, _)| part));
        }
        let fit = if self.answer.names.is_empty() { None } else { self.refit(&parts) };
        Textbook { laws, fit }
    }

    /// The parts refitted in the metric of the likeliest noise; a shape that runs to the end of its range says nothing, and
    /// stays as it was.
    fn refit(&mut self, parts: &[Part]) -> Option<Fit> {
        let fitted = self.fit(parts)?;
        let mut held = parts.to_vec();
        let mut ran_away = false;
        for (part, fitted) in held.iter_mut().zip(&fitted.parts).skip(self.baseline.parts.len()) {
            for (parameter, fitted) in part.parameters.iter_mut().zip(&fitted.parameters) {
                if !parameter.fixed && parameter.entry == Entry::Shape && is_at_end(fitted.value, fitted.range) {
                    parameter.fixed = true;
                    ran_away = true;
                }
            }
        }
        if ran_away { self.fit(&held) } else { Some(fitted) }
    }

    fn fit(&mut self, parts: &[Part]) -> Option<Fit> {
        let weigh = |column: &[f64]| self.comparison.whitened(column, self.noise);
        fit(&mut self.case.scene, parts, &Metric { recorded: self.recorded, weigh: &weigh, bounded: true })
    }

    /// Names that are taken back: their sizes are impossible.
    fn refused(&mut self, textbook: &Textbook) -> Vec<String> {
        let mut refused = Vec::new();
        for (name, law) in self.answer.names.iter().zip(&textbook.laws) {
            let Some((place, share)) = law else { continue };
            let part = textbook.fit.as_ref().map(|fit| &fit.parts[*place]);
            let own = self.answer.contributions.iter().find(|(known, _)| known == name);
            let why = match (part, own) {
                (Some(part), _) if is_impossible(part) => "a size at the end of its range",
                (_, Some((_, x))) if self.is_too_large(name, x) => "larger than the machine allows",
                _ => continue,
            };
            let sizes = part.map_or_else(String::new, sizes_of);
            self.answer.debug.push_str(&format!("\n{name} refused: {why} ({share:.2}){sizes}"));
            refused.push(name.clone());
        }
        refused
    }

    /// Names of curves of which the textbook law makes little: they stand beside "unknown", without its parameters.
    fn doubted(&mut self, textbook: &Textbook) -> Vec<String> {
        let makes_little = |law: &Option<(usize, f64)>| law.is_some_and(|(_, share)| share < THRESHOLDS.textbook_share);
        let names = self.answer.names.iter().zip(&textbook.laws);
        let doubted = names.filter(|(name, law)| self.answer.claimed.contains(name) && makes_little(law));
        let doubted: Vec<String> = doubted.map(|(name, _)| name.clone()).collect();
        doubted.iter().for_each(|name| self.answer.debug.push_str(&format!("\n{name} doubted")));
        doubted
    }

    /// Is a contribution larger than its effect can be beside what the machine takes anyway?
    fn is_too_large(&self, name: &str, contribution: &[f64]) -> bool {
        let cut = self.inputs.cut.as_deref().filter(|_| self.inputs.knows_cut);
        let load = |row: usize| cut.map_or(0.0, |cut| cut[row].abs());
        let bound = effect(name).map_or(Bound::Any, Effect::bound);
        let (times, basis): (f64, &dyn Fn(usize) -> f64) = match (bound, cut) {
            (Bound::NoLoad(times), _) => (times, &|row| (self.answer.after[row] - load(row)).abs()),
            (Bound::Cut(times), Some(_)) => (times, &load),
            _ => return false,
        };
        let top = self.inputs.taken(false).map(|row| contribution[row].abs()).fold(0.0, f64::max);
        let acting = || self.inputs.taken(false).filter(|row| contribution[*row].abs() > ACTING * top);
        let square = |of: &dyn Fn(usize) -> f64| acting().map(|row| of(row).powi(2)).sum::<f64>();
        square(&|row| contribution[row]) > times * times * square(basis)
    }

    /// The form of a kind whose law, the baseline beside it, comes nearest to a contribution.
    fn nearest(&self, kind: &str, contribution: &[f64]) -> Option<(Part, f64)> {
        let hypothesis = self.case.model.hypotheses.iter().find(|part| part.label() == kind);
        if let Some(part) = hypothesis {
            return Some((part.clone(), 1.0));
        }
        let effect = effect(kind)?;
        let scene = self.inputs.scene;
        let rows: Vec<usize> = self.inputs.taken(false).collect();
        let over = |column: &[f64]| rows.iter().map(|row| column[*row]).collect::<Vec<f64>>();
        let wanted = over(contribution);
        let tangents: Vec<Vec<f64>> = self.baseline.tangents.iter().map(|tangent| over(tangent)).collect();
        let whole = least_squares(&tangents, &wanted).rss;
        let mut best: Option<(f64, Part)> = None;
        for form in effect.forms(scene) {
            let Some(laws) = effect.columns(scene, &form) else { continue };
            let mut columns: Vec<Vec<f64>> = laws.iter().map(|(_, law)| over(law)).collect();
            let own = columns.len();
            columns.extend_from_slice(&tangents);
            let solution = least_squares(&columns, &wanted);
            if best.as_ref().is_none_or(|(left, _)| solution.rss < *left) {
                let names: Vec<&'static str> = laws.iter().map(|(name, _)| *name).collect();
                let part = with_values(effect, scene, &form, (&names, &solution.coefficients[..own]));
                best = Some((solution.rss, part));
            }
        }
        let share = |left: f64| 1.0 - left / whole.max(f64::MIN_POSITIVE);
        // A state that was read from the recording is not the law of a recorded column.
        let is_law = |left: f64| !effect.has_hidden_state() || share(left) >= THRESHOLDS.textbook_share;
        best.filter(|(left, _)| is_law(*left)).map(|(left, part)| (part, share(left)))
    }

    fn missing(&mut self, fits: &Fits, textbook: &Textbook) -> Vec<Missing> {
        let names = self.answer.names.clone();
        let mut all = Vec::new();
        for (at, name) in names.iter().enumerate() {
            let place = textbook.laws.get(at).copied().flatten().map(|(place, _)| place);
            let parameters: Vec<ParameterEstimate> = match (place, &textbook.fit) {
                (Some(place), Some(fit)) => self.estimates(fit, place),
                _ => self.curve_size(name),
            };
            let part = place.and_then(|place| textbook.fit.as_ref().map(|fit| &fit.parts[place]));
            let (statement, equation) = texts(name, part);
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

    fn estimates(&self, fit: &Fit, place: usize) -> Vec<ParameterEstimate> {
        let rows = &self.comparison.rows;
        let rows = FittedRows {
            scene: &self.case.scene,
            fit,
            recorded: self.recorded,
            whiten: &|column| self.comparison.whitened(column, self.noise),
            rows,
            unit: rows.iter().map(|row| self.inputs.unit[*row]).collect(),
            of_model: self.baseline.parts.len(),
        };
        rows.estimates(place)
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
        self.answer.rivals.iter().map(|rival| alternative(&rival.name, &rival.instead_of, 2.0 * rival.nats)).collect()
    }

    /// What separates what is left; always where the answer is not sure.
    fn experiment(&self, alternatives: &[Alternative], gone: &[String]) -> Option<Experiment> {
        if matches!(self.answer.verdict, Verdict::Explained | Verdict::NoMismatch) {
            return None;
        }
        let open = alternatives.iter().flat_map(|other| [other.effect.as_str(), other.instead_of.as_str()]);
        let kinds = open.chain(self.answer.names.iter().map(String::as_str)).chain(gone.iter().map(String::as_str));
        let gain = self.answer.information;
        of_effects(kinds, gain).or_else(|| Some(over_channel(self.answer.drawn_over.as_deref(), gain)))
    }

    /// One region for each name, the largest share first.
    fn regions(&self) -> Vec<Region> {
        let rows = self.inputs.rows;
        let whole: f64 = sum_of(&self.answer.remaining, rows).iter().map(|x| x * x).sum();
        let size = usual_size(&sum_of(&self.answer.contributions, rows));
        let places = PlaceSearch::new(self.recording, &self.case.model.output);
        let mut all: Vec<Region> = Vec::new();
        for (name, left) in &self.answer.remaining {
            if !self.answer.names.contains(name) {
                continue;
            }
            let own = self.answer.contributions.iter().find(|(known, _)| known == name).map_or(left, |(_, x)| x);
            let squares: Vec<f64> = left.iter().map(|x| x * x).collect();
            let of_all = active_rows(own, size);
            let active = if of_all.contains(&true) { of_all } else { active_rows(own, usual_size(own)) };
            let inside = active.iter().filter(|active| **active).count();
            let over = |x: &[f64]| x.iter().zip(&active).filter(|(_, active)| **active).map(|(x, _)| *x).sum::<f64>();
            all.push(Region {
                effect: name.clone(),
                share: over(&squares) / whole.max(f64::MIN_POSITIVE),
                mean: over(own) / count(inside.max(1)),
                conditions: places.conditions(&active),
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
            let shift = |(b, a): (&Parameter, &Parameter)| Shift {
                parameter: format!("{}.{}", before.label(), b.name),
                before: b.value,
                after: a.value,
            };
            parameters.map(shift).collect::<Vec<_>>()
        };
        pairs.flat_map(of).collect()
    }
}

/// Does a value stand at an end of its range?
fn is_at_end(value: f64, (low, high): (f64, f64)) -> bool {
    let near = |end: f64| if end.is_finite() { AT_END * end.abs() } else { 0.0 };
    value <= low + near(low) || value >= high - near(high)
}

/// Parameters of a part with their ranges, for engineers.
fn sizes_of(part: &Part) -> String {
    let of = |p: &Parameter| format!(" {} {:.4} in {:?}", p.name, p.value, p.range);
    part.parameters.iter().map(of).collect()
}

/// Is every size of a part at an end of its range? A share of one, of either sign, is a whole, and no end.
fn is_impossible(part: &Part) -> bool {
    let own = || part.parameters.iter().filter(|p| p.entry == Entry::Linear && !p.fixed);
    let is_share = |p: &Parameter| p.range.0 >= -1.0 && p.range.1 <= 1.0;
    let is_whole = |p: &Parameter| is_share(p) && p.value.abs() > 0.5;
    own().count() > 0 && own().all(|p| is_at_end(p.value, p.range) && !is_whole(p))
}

/// A candidate with these values of its linear parameters, within what is possible.
fn with_values(
    effect: &'static dyn Effect,
    scene: &Scene,
    form: &Form,
    (names, values): (&[&'static str], &[f64]),
) -> Part {
    let mut part = Part::candidate(effect, form, names);
    for parameter in &mut part.parameters {
        if let Some(doc) = effect.doc().parameter(&parameter.name) {
            parameter.range = effect.range(scene, doc);
        }
    }
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
