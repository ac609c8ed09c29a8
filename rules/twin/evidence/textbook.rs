//! The textbook law that comes nearest to what was found, refitted together with the baseline: its parameters mean what the
//! catalogue says, and the extended model can be simulated.

use super::latent_law::{CONSUMER, build_latent_part, read_two_level_state};
use super::report::EvidenceReport;
use super::thresholds::THRESHOLDS;
use crate::departure::is_of_departure;
use crate::fit::{Fit, Metric, fit_parts};
use crate::model::{Parameter, Part};
use numerics::linear::columns::least_squares;
use physics::{Bound, Effect, Entry, Form, Scene, find_effect};

/// Share of the end of a range within which a value stands at it.
const AT_END: f64 = 1e-6;

/// Share of the greatest contribution from which a row counts as acted upon.
const ACTING: f64 = 0.1;

/// Textbook laws of what was found.
pub(super) struct Textbook {
    /// The part of each name, and the share of its contribution that the textbook law makes; `None` of one without a law.
    pub(super) laws: Vec<Option<(usize, f64)>>,
    /// Those parts beside the model's, refitted; `None` where nothing was found.
    pub(super) fit: Option<Fit>,
}

impl EvidenceReport<'_, '_> {
    /// The law of the catalogue for each name, and all of them fitted with the baseline as they would be written.
    pub(super) fn fit_textbook_laws(&mut self) -> Textbook {
        let mut near: Vec<(String, Part)> = Vec::new();
        let mut laws = Vec::new();
        for name in self.answer.names.clone() {
            let own = self.answer.contributions.iter().find(|(known, _)| *known == name).map(|(_, x)| x.clone());
            let law = own.and_then(|x| self.find_nearest_law(&name, &x).or_else(|| self.find_latent_law(&name, &x)));
            laws.push(law.as_ref().map(|(_, share)| (self.baseline.parts.len() + near.len(), *share)));
            near.extend(law.map(|(part, _)| (name, part)));
        }
        let fit = if near.is_empty() { None } else { self.fit_named_laws(&near) };
        Textbook { laws, fit }
    }

    /// A consumer that nobody records, where a contribution is on or off; its state is kept while laws are fitted.
    fn find_latent_law(&mut self, name: &str, contribution: &[f64]) -> Option<(Part, f64)> {
        if name != CONSUMER {
            return None;
        }
        let on = read_two_level_state(self.inputs, contribution)?;
        let mean = |wanted: bool| {
            let rows = self.inputs.fitted_rows(false).filter(|row| (on[*row] > 0.5) == wanted);
            numerics::statistics::mean(&rows.map(|row| contribution[row]).collect::<Vec<_>>())
        };
        let level = mean(true) - mean(false);
        let part = build_latent_part(level)?;
        self.case.scene.set_unrecorded_state(Some(on));
        Some((part, 1.0))
    }

    /// The parts refitted in the metric of the likeliest noise; a shape that runs to the end of its range says nothing, and
    /// stays as it was.
    pub(super) fn refit_parts(&mut self, parts: &[Part]) -> Option<Fit> {
        let fitted = self.fit_in_noise_metric(parts)?;
        let mut held = parts.to_vec();
        let mut ran_away = false;
        for (part, fitted) in held.iter_mut().zip(&fitted.parts).skip(self.baseline.parts.len()) {
            for (parameter, fitted) in part.parameters.iter_mut().zip(&fitted.parameters) {
                let is_of_law = parameter.entry == Entry::Shape && !is_of_departure(parameter);
                if !parameter.fixed && is_of_law && is_at_limit(fitted.value, fitted.range) {
                    parameter.fixed = true;
                    ran_away = true;
                }
            }
        }
        if ran_away { self.fit_in_noise_metric(&held) } else { Some(fitted) }
    }

    fn fit_in_noise_metric(&mut self, parts: &[Part]) -> Option<Fit> {
        let weigh = |column: &[f64]| self.comparison.whiten_column(column, self.noise);
        fit_parts(&mut self.case.scene, parts, &Metric { recorded: self.recorded, weigh: &weigh, has_bounds: true })
    }

    /// Names that are taken back: their sizes are impossible.
    pub(super) fn list_refused_names(&mut self, textbook: &Textbook) -> Vec<String> {
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
            let sizes = part.map_or_else(String::new, format_parameters);
            self.answer.debug.push_str(&format!("\n{name} refused: {why} ({share:.2}){sizes}"));
            refused.push(name.clone());
        }
        refused
    }

    /// Is a contribution larger than its effect can be beside what the machine takes anyway?
    fn is_too_large(&self, name: &str, contribution: &[f64]) -> bool {
        let cut = self.inputs.cut.as_deref().filter(|_| self.inputs.knows_cut);
        let load = |row: usize| cut.map_or(0.0, |cut| cut[row].abs());
        let bound = find_effect(name).map_or(Bound::Any, Effect::bound);
        let (times, basis): (f64, &dyn Fn(usize) -> f64) = match (bound, cut) {
            (Bound::NoLoad(times), _) => (times, &|row| (self.answer.after[row] - load(row)).abs()),
            (Bound::Cut(times), Some(_)) => (times, &load),
            _ => return false,
        };
        let top = self.inputs.fitted_rows(false).map(|row| contribution[row].abs()).fold(0.0, f64::max);
        let acting = || self.inputs.fitted_rows(false).filter(|row| contribution[*row].abs() > ACTING * top);
        let square = |of: &dyn Fn(usize) -> f64| acting().map(|row| of(row).powi(2)).sum::<f64>();
        square(&|row| contribution[row]) > times * times * square(basis)
    }

    /// The form of a kind whose law, the baseline beside it, comes nearest to a contribution.
    pub(super) fn find_nearest_law(&self, kind: &str, contribution: &[f64]) -> Option<(Part, f64)> {
        let hypothesis = self.case.model.hypotheses.iter().find(|part| part.label() == kind);
        if let Some(part) = hypothesis {
            return Some((part.clone(), 1.0));
        }
        let effect = find_effect(kind)?;
        let scene = self.inputs.scene;
        let rows: Vec<usize> = self.inputs.fitted_rows(false).collect();
        let over = |column: &[f64]| rows.iter().map(|row| column[*row]).collect::<Vec<f64>>();
        let wanted = over(contribution);
        let tangents: Vec<Vec<f64>> = self.baseline.tangents.iter().map(|tangent| over(tangent)).collect();
        let whole = least_squares(&tangents, &wanted).rss;
        let mut best: Option<(f64, Part)> = None;
        for form in self.propose_met_forms(effect) {
            let Some(laws) = effect.compute_columns(scene, &form) else { continue };
            let mut columns: Vec<Vec<f64>> = laws.iter().map(|(_, law)| over(law)).collect();
            let own = columns.len();
            columns.extend_from_slice(&tangents);
            let solution = least_squares(&columns, &wanted);
            if best.as_ref().is_none_or(|(left, _)| solution.rss < *left) {
                let names: Vec<&'static str> = laws.iter().map(|(name, _)| *name).collect();
                let part = build_candidate(effect, scene, &form, (&names, &solution.coefficients[..own]));
                best = Some((solution.rss, part));
            }
        }
        let share = |left: f64| 1.0 - left / whole.max(f64::MIN_POSITIVE);
        // A state that was read from the recording is not the law of a recorded column.
        let is_law = |left: f64| !effect.has_hidden_state() || share(left) >= THRESHOLDS.textbook_share;
        best.filter(|(left, _)| is_law(*left)).map(|(left, part)| (part, share(left)))
    }
}

/// Does a value stand at an end of its range?
fn is_at_limit(value: f64, (low, high): (f64, f64)) -> bool {
    let near = |end: f64| if end.is_finite() { AT_END * end.abs() } else { 0.0 };
    value <= low + near(low) || value >= high - near(high)
}

/// Parameters of a part with their ranges, for engineers.
fn format_parameters(part: &Part) -> String {
    let of = |p: &Parameter| format!(" {} {:.4} in {:?}", p.name, p.value, p.range);
    part.parameters.iter().map(of).collect()
}

/// Is every size of a part at an end of its range? A share of one, of either sign, is a whole, and no end.
fn is_impossible(part: &Part) -> bool {
    let own = || part.parameters.iter().filter(|p| p.entry == Entry::Linear && !p.fixed);
    let is_share = |p: &Parameter| p.range.0 >= -1.0 && p.range.1 <= 1.0;
    let is_whole = |p: &Parameter| is_share(p) && p.value.abs() > 0.5;
    own().count() > 0 && own().all(|p| is_at_limit(p.value, p.range) && !is_whole(p))
}

/// A candidate with these values of its linear parameters, within what is possible.
pub(super) fn build_candidate(
    effect: &'static dyn Effect,
    scene: &Scene,
    form: &Form,
    (names, values): (&[&'static str], &[f64]),
) -> Part {
    let mut part = Part::from_effect(effect, form, names);
    for parameter in &mut part.parameters {
        if let Some(doc) = effect.doc().find_parameter(&parameter.name) {
            // What a file may hold bounds what is possible for this output.
            let (low, high) = effect.parameter_range(scene, doc);
            parameter.range = (low.max(doc.range.0), high.min(doc.range.1));
            parameter.value = parameter.value.clamp(parameter.range.0, parameter.range.1);
        }
    }
    for (name, value) in names.iter().zip(values) {
        if let Some(parameter) = part.parameters.iter_mut().find(|p| p.name == *name && !p.fixed) {
            parameter.value = value.clamp(parameter.range.0, parameter.range.1);
        }
    }
    part
}
