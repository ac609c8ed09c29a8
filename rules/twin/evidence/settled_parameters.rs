//! What a recording tells of the parameters of a law: those that it does not tell are taken as known, and a name whose size it
//! does not tell is not sure.

use super::report::EvidenceReport;
use super::textbook::Textbook;
use super::written_model::WrittenModel;
use crate::departure::is_of_departure;
use crate::diagnosis::{Missing, ParameterEstimate, Verdict};
use crate::fit::{Fit, Free};
use crate::model::{Parameter, simulate_parts};
use physics::Entry;

/// Parameters of one fit that are settled, at most: a law of eight waves may keep one of them.
const STEPS_MAX: usize = 12;
/// Share by which the squares of rows left out may rise for a term that is left away: less than chance moves them.
const NO_LOSS: f64 = 2e-3;
/// Share of what the laws gain in rows left out that may be given up for laws whose every size the recording tells: a tenth is
/// half of what the ceiling leaves them. Larger: laws are written too simple; smaller: a name stays unsure for the sake of a bend.
const GAIN_FOR_TOLD: f64 = 0.1;

/// Does its interval exclude zero?
fn excludes_zero(estimate: &ParameterEstimate) -> bool {
    matches!((estimate.low, estimate.high), (Some(low), Some(high)) if low > 0.0 || high < 0.0)
}

/// Is its interval no wider than the value, and away from zero?
pub(super) fn is_determined(estimate: &ParameterEstimate) -> bool {
    let width = estimate.low.zip(estimate.high).map_or(f64::INFINITY, |(low, high)| high - low);
    excludes_zero(estimate) && width <= estimate.value.abs()
}

/// How many times half its interval a value is.
fn compute_certainty(estimate: &ParameterEstimate) -> f64 {
    let half = estimate.low.zip(estimate.high).map_or(f64::INFINITY, |(low, high)| 0.5 * (high - low));
    estimate.value.abs() / half.max(f64::MIN_POSITIVE)
}

/// Does an interval reach an end of what is possible?
fn reaches_end(estimate: &ParameterEstimate, parameter: &Parameter) -> bool {
    let (low, high) = parameter.range;
    estimate.low.is_some_and(|x| x <= low) || estimate.high.is_some_and(|x| x >= high)
}

impl EvidenceReport<'_, '_> {
    /// A fit in which shapes that the recording does not tell stay at the value they have, and terms that may be nothing are left
    /// away one by one where another term of the law remains: each makes the intervals of the others narrower.
    pub(super) fn settle_parameters(&mut self, fit: Fit) -> Fit {
        let mut best = fit;
        let most = self.compute_allowed_square(&best);
        let mut kept: Vec<Free> = Vec::new();
        for _ in 0..STEPS_MAX {
            let Some((at, value)) = self.find_undetermined(&best, &kept) else { break };
            let mut parts = best.parts.clone();
            let parameter = &mut parts[at.part].parameters[at.parameter];
            (parameter.value, parameter.fixed) = (value, true);
            let less = self.refit_parts(&parts);
            match less.filter(|less| self.prepare_left_out(less).compute_square() <= most) {
                Some(less) => best = less,
                None => kept.push(at),
            }
        }
        let _ = simulate_parts(&best.parts, &mut self.case.scene);
        best
    }

    /// Squares of rows left out up to which a simpler fit stands for this one.
    fn compute_allowed_square(&self, fit: &Fit) -> f64 {
        let least = self.prepare_left_out(fit).compute_square();
        let gain = self.prepare_left_out(self.baseline).compute_square() - least;
        least + (NO_LOSS * least).max(GAIN_FOR_TOLD * gain)
    }

    /// Without the names whose sizes the recording does not tell, where the other laws predict as well without them.
    pub(super) fn drop_undetermined_names(&mut self, told: (Textbook, WrittenModel)) -> (Textbook, WrittenModel) {
        let mut told = told;
        while self.answer.verdict == Verdict::Explained && self.answer.names.len() > 1 {
            let Some(fewer) = self.find_dispensable_name(&told.0) else { break };
            told = fewer;
        }
        told
    }

    /// Drops the first name that can be done without; gives what is told then.
    fn find_dispensable_name(&mut self, textbook: &Textbook) -> Option<(Textbook, WrittenModel)> {
        let fit = textbook.fit.as_ref()?;
        let most = self.compute_allowed_square(fit);
        for (number, name) in self.answer.names.clone().into_iter().enumerate() {
            let Some((place, _)) = textbook.laws.get(number).copied().flatten() else { continue };
            if self.estimate_parameters(fit, place).iter().all(is_determined) {
                continue;
            }
            let Some(without) = self.fit_without(fit, place) else { continue };
            if self.prepare_left_out(&without).compute_square() > most {
                continue;
            }
            let Some(written) = self.write_fit(&without) else { continue };
            let mut laws = textbook.laws.clone();
            laws.remove(number);
            let behind = laws.iter_mut().flatten().filter(|(other, _)| *other > place);
            behind.for_each(|(other, _)| *other -= 1);
            self.answer.drop_name(&name);
            return Some((Textbook { laws, fit: Some(without) }, written));
        }
        None
    }

    /// The parameter of a law that the recording tells least, and the value it gets; `None` where everything is told.
    fn find_undetermined(&self, fit: &Fit, kept: &[Free]) -> Option<(Free, f64)> {
        let laws = self.baseline.parts.len()..fit.parts.len();
        let told: Vec<Vec<ParameterEstimate>> =
            laws.clone().map(|place| self.estimate_parameters(fit, place)).collect();
        let free = || fit.free.iter().filter(|at| laws.contains(&at.part) && !kept.contains(at));
        let parameter = |at: &Free| &fit.parts[at.part].parameters[at.parameter];
        let is_of = |at: &Free, entry: Entry| parameter(at).entry == entry && !is_of_departure(parameter(at));
        let find = |at: &Free| {
            let own = told.get(at.part - laws.start)?;
            own.iter().find(|estimate| estimate.name == parameter(at).name)
        };
        let is_whole = |at: &Free| {
            fit.parts[at.part].parameters.iter().any(|p| p.entry == Entry::Linear && p.fixed && p.value != 0.0)
        };
        let open_shape = |at: &&Free| {
            let open = |estimate: &ParameterEstimate| !is_determined(estimate) || reaches_end(estimate, parameter(at));
            is_of(at, Entry::Shape) && !is_whole(at) && find(at).is_some_and(open)
        };
        if let Some(at) = free().find(open_shape) {
            return Some((*at, parameter(at).value));
        }
        let count_sizes =
            |part: usize| fit.free.iter().filter(|at| at.part == part && is_of(at, Entry::Linear)).count();
        let may_be_nothing = |at: &&Free| {
            let (low, high) = parameter(at).range;
            is_of(at, Entry::Linear)
                && (low..=high).contains(&0.0)
                && count_sizes(at.part) > 1
                && find(at).is_some_and(|estimate| !excludes_zero(estimate))
        };
        let certainty = |at: &Free| find(at).map_or(f64::INFINITY, compute_certainty);
        if let Some(at) = free().filter(may_be_nothing).min_by(|a, b| certainty(a).total_cmp(&certainty(b))) {
            return Some((*at, 0.0));
        }
        // A size per unit of a power of something is open as long as the power is: it holds for the power that is told.
        let is_open = |at: &Free| is_of(at, Entry::Linear) && find(at).is_some_and(|estimate| !is_determined(estimate));
        let shape = free().find(|shape| {
            is_of(shape, Entry::Shape)
                && !is_whole(shape)
                && fit.free.iter().any(|at| at.part == shape.part && is_open(at))
        });
        if let Some(shape) = shape {
            return Some((*shape, parameter(shape).value));
        }
        // The rest of the law stands without the term whose size is known least.
        let may_go = |at: &&Free| {
            let (low, high) = parameter(at).range;
            is_open(at) && (low..=high).contains(&0.0) && count_sizes(at.part) > 1
        };
        free().filter(may_go).min_by(|a, b| certainty(a).total_cmp(&certainty(b))).map(|at| (*at, 0.0))
    }

    /// Names that are told as sure although the recording does not tell a size of theirs.
    pub(super) fn list_undetermined_names(&self, missing: &[Missing]) -> Vec<String> {
        let open = |missing: &&Missing| !missing.parameters.iter().all(is_determined);
        missing.iter().filter(open).map(|m| m.effect.clone()).collect()
    }
}
