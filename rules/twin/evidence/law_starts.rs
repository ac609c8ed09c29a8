//! Where the fit of a law begins: every form of a kind, its sizes from least squares beside the baseline, within what is possible.
//!
//! A form that comes nearest to a drawn curve may be far from the output: the curve holds what the baseline had to give for it.
//! So the forms are compared by what they leave of the output as well, and the nonlinear fit starts from both.

use super::report::EvidenceReport;
use super::textbook::build_candidate;
use crate::candidates::compute_law_columns;
use crate::model::Part;
use numerics::linear::columns::{dot, extend_basis, least_squares, project_out};
use numerics::statistics::rms;
use physics::{Effect, Entry, Form, find_effect, keep_met_units};

/// Forms of one kind from which a fit starts: more of them were measured to help 3 of 33 laws that were stuck.
const STARTS_MAX: usize = 3;
/// Passes over the names of a set in which each form is chosen anew: the first is blind to the later names.
const PASSES: usize = 2;
/// Share of its size over all rows that a column must have in the fitted rows to get a size from them. Chosen by hand, not measured: it
/// stands well above the rounding of sums; lower gives a size to rounding, higher to no law that acts in few rows.
const SEEN: f64 = 1e-6;
/// Share of a column that the baseline must leave of it, as in the search: lower gives a size to what is rounding, higher
/// refuses a law that is nearly the baseline.
const OWN: f64 = 1e-6;

/// A form of a law, as a part, with its columns whitened and clear of the baseline.
pub(super) struct LawStart {
    part: Part,
    columns: Vec<Vec<f64>>,
    /// Does each column act in the fitted rows, and is it more than the baseline makes?
    acts: Vec<bool>,
}

impl LawStart {
    /// Positions of the parameters that its columns belong to.
    fn list_linear(&self) -> Vec<usize> {
        let parameters = &self.part.parameters;
        (0..parameters.len()).filter(|index| parameters[*index].entry == Entry::Linear).collect()
    }
}

/// What some forms leave of the output, and themselves with their sizes.
struct Solved {
    rss: f64,
    parts: Vec<Part>,
}

/// The output and a basis of what the baseline makes, whitened.
pub(super) struct StartSearch {
    basis: Vec<Vec<f64>>,
    left: Vec<f64>,
}

impl StartSearch {
    /// Sets of forms to start from, one for each name, the best first.
    pub(super) fn list_start_sets(&self, all: &[Vec<LawStart>]) -> Vec<Vec<Part>> {
        match all {
            [] => Vec::new(),
            [one] => self.list_single_starts(one),
            several => self.choose_forms_in_turn(several).into_iter().collect(),
        }
    }

    /// The best of each form, then the next best.
    fn list_single_starts(&self, all: &[LawStart]) -> Vec<Vec<Part>> {
        let mut ranked: Vec<Solved> = all.iter().map(|start| self.solve_sizes(&[start])).collect();
        ranked.sort_by(|a, b| a.rss.total_cmp(&b.rss));
        let form = |solved: &Solved| solved.parts[0].effect_and_form().map(|(_, form)| form.name);
        let mut starts: Vec<Vec<Part>> = Vec::new();
        let mut forms = Vec::new();
        let mut rest = Vec::new();
        for solved in ranked {
            let own = form(&solved);
            let list = if forms.contains(&own) { &mut rest } else { &mut starts };
            forms.push(own);
            list.push(solved.parts);
        }
        starts.extend(rest);
        starts.truncate(STARTS_MAX);
        starts
    }

    /// One form for each name, each chosen beside those of the others.
    fn choose_forms_in_turn(&self, all: &[Vec<LawStart>]) -> Option<Vec<Part>> {
        let mut chosen: Vec<Option<usize>> = vec![None; all.len()];
        for pass in 0..PASSES * all.len() {
            let turn = pass % all.len();
            let with = |number: usize| -> Vec<&LawStart> {
                let own = |at: usize| if at == turn { Some(number) } else { chosen[at] };
                (0..all.len()).filter_map(|at| own(at).map(|number| &all[at][number])).collect()
            };
            let left = |number: &usize| self.solve_sizes(&with(*number)).rss;
            let ranked = (0..all[turn].len()).map(|number| (left(&number), number));
            chosen[turn] = ranked.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, number)| number);
        }
        let with: Vec<&LawStart> = all
            .iter()
            .zip(chosen)
            .map(|(starts, chosen)| chosen.map(|number| &starts[number]))
            .collect::<Option<_>>()?;
        Some(self.solve_sizes(&with).parts)
    }

    /// Sizes by least squares beside the baseline, then within what is possible; what bounds forbid is not counted as explained.
    fn solve_sizes(&self, chosen: &[&LawStart]) -> Solved {
        let mut left = self.left.clone();
        let mut free: Vec<Vec<f64>> = Vec::new();
        for start in chosen {
            for ((column, index), acts) in start.columns.iter().zip(start.list_linear()).zip(&start.acts) {
                let parameter = &start.part.parameters[index];
                if parameter.fixed {
                    left.iter_mut().zip(column).for_each(|(left, x)| *left -= parameter.value * x);
                } else if *acts {
                    free.push(column.clone());
                }
            }
        }
        let mut sizes = least_squares(&free, &left).coefficients.into_iter().zip(&free);
        let mut parts = Vec::new();
        let mut rest = left.clone();
        for start in chosen {
            let mut part = start.part.clone();
            for (index, acts) in start.list_linear().into_iter().zip(&start.acts) {
                let parameter = &mut part.parameters[index];
                if parameter.fixed {
                    continue;
                }
                let solved = if *acts { sizes.next() } else { None };
                parameter.value = solved.map_or(0.0, |(size, _)| size).clamp(parameter.range.0, parameter.range.1);
                if let Some((_, column)) = solved {
                    rest.iter_mut().zip(column).for_each(|(rest, x)| *rest -= parameter.value * x);
                }
            }
            parts.push(part);
        }
        Solved { rss: dot(&rest, &rest), parts }
    }
}

impl EvidenceReport<'_, '_> {
    /// The search for starts in the metric of the likeliest noise.
    pub(super) fn prepare_starts(&self) -> StartSearch {
        let mut basis = Vec::new();
        for tangent in &self.baseline.tangents {
            let _ = extend_basis(&mut basis, self.whiten(tangent), 1e-8);
        }
        let rest: Vec<f64> = self.recorded.iter().zip(&self.inputs.simulated).map(|(y, f)| y - f).collect();
        let mut left = self.whiten(&rest);
        project_out(&basis, &mut left);
        StartSearch { basis, left }
    }

    /// A column as innovations of the fitted rows, for the likeliest noise.
    pub(super) fn whiten(&self, column: &[f64]) -> Vec<f64> {
        self.comparison.whiten_column(column, self.noise)
    }

    /// Every form of a kind that this recording can tell.
    pub(super) fn list_law_starts(&self, kind: &str, search: &StartSearch) -> Vec<LawStart> {
        let scene = self.inputs.scene;
        if let Some(part) = self.case.model.hypotheses.iter().find(|part| part.label() == kind) {
            let columns = compute_law_columns(part, scene).unwrap_or_default();
            return vec![self.build_start(part.clone(), &columns, search)];
        }
        let Some(effect) = find_effect(kind) else { return Vec::new() };
        let forms = self.propose_met_forms(effect);
        forms.iter().filter_map(|form| self.build_form_start(effect, form, search)).collect()
    }

    /// The forms of a kind; one with a term for each unit has those of the units that the fitted rows have met.
    pub(super) fn propose_met_forms(&self, effect: &dyn Effect) -> Vec<Form> {
        let scene = self.inputs.scene;
        let keep = |form: Form| {
            let words = effect.unit_column(&form).and_then(|column| scene.text_column(column));
            let is_met =
                |unit: &str| words.is_some_and(|w| self.inputs.fitted_rows(false).any(|row| w.get(row) == Some(unit)));
            if words.is_some() { keep_met_units(form, is_met) } else { form }
        };
        effect.propose_forms(scene).into_iter().map(keep).collect()
    }

    fn build_form_start(&self, effect: &'static dyn Effect, form: &Form, search: &StartSearch) -> Option<LawStart> {
        let scene = self.inputs.scene;
        let columns = effect.compute_columns(scene, form)?;
        let names: Vec<&'static str> = columns.iter().map(|(name, _)| *name).collect();
        let part = build_candidate(effect, scene, form, (&names, &vec![0.0; names.len()]));
        let columns: Vec<Vec<f64>> = columns.into_iter().map(|(_, column)| column).collect();
        columns.iter().flatten().all(|x| x.is_finite()).then(|| self.build_start(part, &columns, search))
    }

    /// A part as a start.
    pub(super) fn build_start(&self, part: Part, columns: &[Vec<f64>], search: &StartSearch) -> LawStart {
        let (mut clear, mut acts) = (Vec::new(), Vec::new());
        for column in columns {
            let mut white = self.whiten(column);
            let size = rms(&white);
            project_out(&search.basis, &mut white);
            acts.push(size > SEEN * rms(column) && rms(&white) > OWN * size);
            clear.push(white);
        }
        LawStart { part, columns: clear, acts }
    }
}
