//! The answer as a diagnosis: texts, textbook parameters with intervals, places, and what to record next.
//!
//! What was found is a curve; what is told beside it is the textbook law that comes nearest, refitted together with the
//! baseline, so that its parameters mean what the catalogue says and the extended model can be simulated. A name that no
//! textbook law bears out is taken back.

use super::answer::{EvidenceAnswer, sum_contributions};
use super::gram::Comparison;
use super::inputs::RecordingInputs;
use super::noise::NoiseModel;
use super::textbook::Textbook;
use super::written_model::WrittenModel;
use crate::departure::{DEPARTURE, Departure, is_of_departure};
use crate::diagnosis::{
    Alternative, Diagnosis, Experiment, Fits, Missing, ParameterEstimate, Quality, Rows, Shift, UNKNOWN, Verdict,
    find_output_unit,
};
use crate::fit::Fit;
use crate::inputs::mark_rows_with_inputs;
use crate::intervals::FittedRows;
use crate::model::{Model, Parameter, Part};
use crate::next_step::{
    build_alternative, build_channel_experiment, describe_drive_experiment, find_effect_experiment,
};
use crate::place_search::PlaceSearch;
use crate::plan::{Envelope, plan_within};
use crate::prepared_recording::Case;
use crate::region::{Condition, Region, compute_usual_size, list_spans, mark_active_rows, measure_both_signs};
use crate::summary;
use crate::text_report::{format_short_number, format_signed_number};
use adapter_core::bilingual::Bilingual;
use numerics::statistics::{count_to_f64, rms};
use physics::{Entry, FOLLOWED, find_effect};
use recording::Recording;
use std::cell::OnceCell;

/// Share of the rows in which a law acts that must lie in its place: the others are edges of it.
const ACTS_IN_PLACE: f64 = 0.98;

/// Everything that is told.
pub(super) struct EvidenceReport<'a, 'm> {
    pub(super) recording: &'a Recording,
    pub(super) case: &'a mut Case<'m>,
    pub(super) inputs: &'a RecordingInputs<'a>,
    pub(super) baseline: &'a Fit,
    pub(super) answer: EvidenceAnswer,
    pub(super) comparison: &'a Comparison<'a>,
    pub(super) noise: NoiseModel,
    /// The recorded output with outliers cut.
    pub(super) recorded: &'a [f64],
    /// Deviation of the ordinary noise.
    pub(super) ordinary: f64,
    /// What the baseline leaves of rows left out, once it was asked for.
    pub(super) baseline_square: OnceCell<f64>,
}

impl EvidenceReport<'_, '_> {
    pub(super) fn into_diagnosis(mut self) -> Diagnosis {
        let curve = self.answer.after.clone();
        let (textbook, written) = self.settle_names();
        let (textbook, written) = match written {
            Some(written) => {
                let (textbook, written) = self.settle_rivals(textbook, written);
                let (textbook, written) = self.search_beside_names(textbook, written);
                let written = self.tell_written_model(&textbook, written);
                (textbook, Some(written))
            }
            None => (textbook, None),
        };
        let fits = self.compare_fits(&curve);
        let missing = self.list_missing_effects(&fits, &textbook, written.as_ref());
        let open = self.list_undetermined_names(&missing, &textbook);
        if self.answer.verdict == Verdict::Explained && !open.is_empty() {
            self.answer.add_unknown_rivals(&open);
        }
        let alternatives: Vec<Alternative> = self.list_alternatives();
        let parts = match written {
            Some(written) => written.parts,
            None => self.refit_baseline().unwrap_or_else(|| self.case.model.parts.clone()),
        };
        let shift = if missing.is_empty() { Vec::new() } else { self.list_shifts(&parts) };
        let model = Model { parts, ..self.case.model.clone() };
        let withdrawn = self.answer.withdrawn.take();
        let mut diagnosis = Diagnosis {
            output: self.case.model.output.clone(),
            unit: find_output_unit(&self.case.model.output).to_owned(),
            verdict: self.answer.verdict,
            summary: Bilingual::default(),
            next_experiment: self.choose_experiment(&alternatives, withdrawn.as_ref().map_or(&[], |gone| &gone.found)),
            mismatch: self.locate_regions(&model.parts),
            rows: self.build_rows(),
            existence: Some(self.answer.existence),
            fit: Some(fits),
            baseline_shift: shift,
            missing,
            alternatives,
            data_quality: self.case.faults.clone(),
            remainder: self.list_remainder(),
            model,
            debug: self.answer.debug.clone(),
        };
        self.tell_next_experiment(&mut diagnosis);
        diagnosis.summary = match &withdrawn {
            Some(gone) => summary::describe_withdrawal(&gone.found, gone.among_fitted, gone.errors, &diagnosis.unit),
            None => summary::summarise_diagnosis(&diagnosis),
        };
        diagnosis
    }

    /// The experiment of a kind in the words of this machine, and how long the plan takes that is carried out: one figure for every
    /// writer.
    fn tell_next_experiment(&self, diagnosis: &mut Diagnosis) {
        let envelope = Envelope::from_recording(self.recording, &self.case.model.output, &self.case.model.roles);
        let plan = plan_within(diagnosis, &envelope).ok();
        let Some(next) = diagnosis.next_experiment.as_mut().filter(|next| !next.effect.is_empty()) else { return };
        if let Some(plan) = plan {
            next.minutes = plan.duration_min().ceil();
        }
        if envelope.drive_alone {
            let (en, zh) = describe_drive_experiment(&next.effect);
            (next.statement, next.statement_zh) = (en.to_owned(), Some(zh));
        }
    }

    /// Root mean square error in the rows that are told: those held out, or the fitted ones where none were.
    pub(super) fn compute_told_rmse(&self, total: &[f64]) -> Option<f64> {
        let rows = if self.inputs.held_out.contains(&true) { &self.inputs.held_out } else { &self.inputs.fitted };
        self.compute_rmse(total, rows)
    }

    fn compute_rmse(&self, total: &[f64], rows: &[bool]) -> Option<f64> {
        let recorded = self.inputs.scene.recorded_output();
        let left: Vec<f64> = (0..rows.len()).filter(|row| rows[*row]).map(|row| recorded[row] - total[row]).collect();
        (!left.is_empty()).then(|| rms(&left))
    }

    fn compare_fits(&self, curve: &[f64]) -> Fits {
        let quality = |total: &[f64]| Quality {
            rmse: self.compute_rmse(total, &self.inputs.fitted).unwrap_or(0.0),
            held_out_rmse: self.compute_rmse(total, &self.inputs.held_out),
        };
        // A file that predicts better than the curve that its names were found by is the better curve.
        let after = &self.answer.after;
        let ceiling = if self.compute_told_rmse(after) < self.compute_told_rmse(curve) { after } else { curve };
        Fits {
            rows: self.inputs.comparable.iter().filter(|comparable| **comparable).count(),
            runs: self.case.units.len(),
            held_out_runs: self.case.held.iter().map(|unit| self.case.units[*unit].name.clone()).collect(),
            noise_floor: self.ordinary,
            before: quality(&self.inputs.simulated),
            after: quality(&self.answer.after),
            ceiling: (!self.answer.names.is_empty()).then(|| quality(ceiling)),
        }
    }

    fn list_missing_effects(
        &mut self,
        fits: &Fits,
        textbook: &Textbook,
        written: Option<&WrittenModel>,
    ) -> Vec<Missing> {
        let mut all = Vec::new();
        for (at, name) in self.answer.names.clone().iter().enumerate() {
            let place = textbook.laws.get(at).copied().flatten().map(|(place, _)| place).filter(|_| written.is_some());
            let fit = textbook.fit.as_ref();
            let own = fit.zip(place).and_then(|(fit, place)| self.measure_own_figures(fit, place));
            let parameters = fit.zip(place).map_or_else(Vec::new, |(fit, place)| self.estimate_parameters(fit, place));
            let part = written.zip(place).map(|(written, place)| &written.parts[place]);
            let (statement, equation) = describe_law(name, part);
            let told = place.is_some() || name == UNKNOWN;
            // Where it is the only one, its own figures are those of all.
            let is_alone = name == UNKNOWN && self.answer.names.len() == 1;
            all.push(Missing {
                effect: name.clone(),
                statement,
                equation,
                parameters,
                delta_ic: own.map(|own| own.information).or_else(|| is_alone.then_some(self.answer.information)),
                probability: self.answer.find_probability(name),
                held_out_rmse_before: own
                    .and_then(|own| own.error_without)
                    .or(fits.before.held_out_rmse.filter(|_| is_alone))
                    .filter(|_| told && fits.after.held_out_rmse.is_some()),
                held_out_rmse_after: fits.after.held_out_rmse.filter(|_| told),
                absorbed_share: self.compute_absorbed_share(name),
                not_predictable: part.and_then(describe_hindrance),
            });
        }
        all
    }

    pub(super) fn estimate_parameters(&self, fit: &Fit, place: usize) -> Vec<ParameterEstimate> {
        let rows = &self.comparison.rows;
        let rows = FittedRows {
            scene: &self.case.scene,
            fit,
            recorded: self.recorded,
            whiten: &|column| self.comparison.whiten_column(column, self.noise),
            rows,
            unit: rows.iter().map(|row| self.inputs.unit[*row]).collect(),
            of_model: self.baseline.parts.len(),
        };
        let mut all = rows.estimate_parameters(place);
        all.retain(|estimate| !estimate.name.starts_with(DEPARTURE));
        all
    }

    /// Share of a contribution's square that the baseline can imitate.
    fn compute_absorbed_share(&self, name: &str) -> f64 {
        let of = |all: &[(String, Vec<f64>)]| {
            let own = all.iter().find(|(known, _)| known == name);
            own.map_or(0.0, |(_, x)| self.inputs.fitted_rows(false).map(|row| x[row] * x[row]).sum::<f64>())
        };
        let (whole, left) = (of(&self.answer.contributions), of(&self.answer.remaining));
        if whole > 0.0 { (1.0 - left / whole).clamp(0.0, 1.0) } else { 0.0 }
    }

    fn list_alternatives(&self) -> Vec<Alternative> {
        self.answer
            .rivals
            .iter()
            .map(|rival| build_alternative(&rival.name, &rival.instead_of, 2.0 * rival.nats))
            .collect()
    }

    /// What separates what is left; always where the answer is not sure.
    fn choose_experiment(&self, alternatives: &[Alternative], gone: &[String]) -> Option<Experiment> {
        if matches!(self.answer.verdict, Verdict::Explained | Verdict::NoMismatch) {
            return None;
        }
        let open = alternatives.iter().flat_map(|other| [other.effect.as_str(), other.instead_of.as_str()]);
        let kinds = open.chain(self.answer.names.iter().map(String::as_str)).chain(gone.iter().map(String::as_str));
        find_effect_experiment(kinds).or_else(|| Some(build_channel_experiment(self.answer.drawn_over.as_deref())))
    }

    /// One region for each name, the largest share first.
    fn locate_regions(&self, parts: &[Part]) -> Vec<Region> {
        let rows = self.inputs.rows;
        // Contributions of two signs would cancel in a sum: a share is one of all squares.
        let whole: f64 = self.answer.remaining.iter().flat_map(|(_, x)| x).map(|x| x * x).sum();
        let size = compute_usual_size(&sum_contributions(&self.answer.contributions, rows));
        let places = PlaceSearch::new(self.recording, &self.case.model.output);
        let mut all: Vec<Region> = Vec::new();
        for (name, left) in &self.answer.remaining {
            if !self.answer.names.contains(name) {
                continue;
            }
            let own = self.answer.contributions.iter().find(|(known, _)| known == name).map_or(left, |(_, x)| x);
            let squares: Vec<f64> = left.iter().map(|x| x * x).collect();
            let of_all = mark_active_rows(own, size);
            let active = if of_all.contains(&true) { of_all } else { mark_active_rows(own, compute_usual_size(own)) };
            let inside = active.iter().filter(|active| **active).count();
            let over = |x: &[f64]| x.iter().zip(&active).filter(|(_, active)| **active).map(|(x, _)| *x).sum::<f64>();
            all.push(Region {
                effect: name.clone(),
                share: over(&squares) / whole.max(f64::MIN_POSITIVE),
                mean: over(own) / count_to_f64(inside.max(1)),
                both_signs: measure_both_signs(own, &active),
                conditions: self
                    .find_place_of_law(name, parts, &active)
                    .unwrap_or_else(|| places.find_conditions(&active)),
                spans: list_spans(self.inputs.scene, &active),
                onset: None,
            });
        }
        all.retain(|region| !region.spans.is_empty());
        all.sort_by(|a, b| b.share.total_cmp(&a.share));
        all
    }

    /// The place of a law that is written with one, such as an operation: nothing else is told of it, as long as it is there that
    /// its contribution acts.
    fn find_place_of_law(&self, name: &str, parts: &[Part], active: &[bool]) -> Option<Vec<Condition>> {
        let part = parts.iter().find(|part| part.label() == name)?;
        let (column, word) = part.effect_and_form()?.1.place?;
        let words = self.recording.find_words(&column)?;
        let acts = || (0..active.len()).filter(|row| active[*row]);
        let inside = acts().filter(|row| words.get(*row) == Some(word.as_str())).count();
        let all = count_to_f64(acts().count().max(1));
        (count_to_f64(inside) > ACTS_IN_PLACE * all).then(|| vec![Condition::Equals { column, words: vec![word] }])
    }

    fn build_rows(&self) -> Rows {
        let known = mark_rows_with_inputs(self.inputs.scene, &self.case.parts);
        let visible = |total: &[f64]| total.iter().zip(&known).map(|(x, known)| known.then_some(*x)).collect();
        Rows {
            simulated_before: visible(&self.inputs.simulated),
            simulated_after: visible(&self.answer.after),
            compared: self.inputs.comparable.clone(),
            effects: self.answer.contributions.clone(),
        }
    }

    fn list_shifts(&self, parts: &[Part]) -> Vec<Shift> {
        let pairs = self.baseline.parts.iter().zip(parts);
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

fn describe_law(name: &str, part: Option<&Part>) -> (String, String) {
    if name == UNKNOWN {
        let statement = "Something real that no effect of the catalogue explains; described by its shape only";
        return (statement.to_owned(), "a curve over the inputs, as drawn".to_owned());
    }
    let place = part.and_then(Part::effect_and_form).and_then(|(_, form)| form.place);
    let place = place.map(|(column, word)| format!(" ({column} {word})")).unwrap_or_default();
    let departs =
        part.map(|part| format!("{}{}", describe_departures(part), describe_held_shapes(part))).unwrap_or_default();
    find_effect(name).map_or_else(
        || ("The user's hypothesis".to_owned(), format!("{name}{departs}")),
        |effect| (format!("{}{place}", effect.doc().en.statement), format!("{}{departs}", effect.doc().law)),
    )
}

/// How the machine departs from the law, as a line of text; empty where it does not.
fn describe_departures(part: &Part) -> String {
    let of = |(number, departure): (usize, &Departure)| {
        let knots = departure.x.iter().zip(part.list_knot_values(number));
        let knots = knots.map(|(x, y)| format!("{} at {}", format_signed_number(y), format_short_number(*x)));
        format!("; times 1 + d over {}: {}", departure.over, knots.collect::<Vec<_>>().join(", "))
    };
    part.departures.iter().enumerate().map(of).collect()
}

/// Shapes of the law that this recording does not tell, as a line of text: the intervals of the others hold for these values.
fn describe_held_shapes(part: &Part) -> String {
    let held = part.parameters.iter().filter(|p| p.entry == Entry::Shape && p.fixed && !is_of_departure(p));
    held.map(|p| format!("; {} held at {}", p.name, format_short_number(p.value))).collect()
}

/// Why a part cannot be simulated ahead.
fn describe_hindrance(part: &Part) -> Option<Bilingual> {
    if part.is_followed() && part.has_form(FOLLOWED) {
        return Some(Bilingual::new(
            "The run in which this change begins is not known: it is followed from earlier rows of the same run and cannot be simulated ahead",
            "不知该变化从哪次运行开始：只能由同一次运行的先前各行跟踪，无法预先仿真",
        ));
    }
    if part.is_followed() {
        return Some(Bilingual::new(
            "Nobody records when it is on: it is followed from earlier rows of the same run and cannot be simulated ahead",
            "没有记录其何时运行：只能由同一批次的先前各行跟踪，无法预先仿真",
        ));
    }
    (part.kind == "zero_drift").then(|| {
        Bilingual::new(
            "It describes this recording: how the zero will drift in the next one is not known",
            "仅描述此记录：下一次记录的零点如何漂移未知",
        )
    })
}
