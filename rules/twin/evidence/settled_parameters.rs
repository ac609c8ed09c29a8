//! What a recording tells of the parameters of a law: those that it does not tell are taken as known, and a name whose size it
//! does not tell is not sure.

use super::law_starts::StartSearch;
use super::report::EvidenceReport;
use super::textbook::Textbook;
use crate::departure::is_of_departure;
use crate::diagnosis::{Missing, ParameterEstimate};
use crate::fit::{Fit, Free};
use crate::model::{Parameter, Part, simulate_parts};
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
    excludes_zero(estimate) && compute_width(estimate) <= estimate.value.abs()
}

/// Does the recording tell the sizes of a law? The terms of edges and lots are measured by the largest of them: a lot that is like the first
/// one is known as well as any other.
fn is_told(part: &Part, estimates: &[ParameterEstimate]) -> bool {
    if !has_term_per_unit(part) {
        return estimates.iter().all(is_determined);
    }
    let is_size = |estimate: &&ParameterEstimate| {
        part.find_parameter(&estimate.name).is_some_and(|parameter| parameter.entry == Entry::Linear)
    };
    let largest = estimates.iter().filter(is_size).map(|estimate| estimate.value.abs()).fold(0.0, f64::max);
    let is_narrow = |estimate: &ParameterEstimate| compute_width(estimate) <= largest;
    let is_known = |estimate: &ParameterEstimate| is_determined(estimate) || is_size(&estimate) && is_narrow(estimate);
    estimates.iter().any(is_determined) && estimates.iter().all(is_known)
}

fn has_term_per_unit(part: &Part) -> bool {
    part.effect_and_form().is_some_and(|(effect, form)| effect.has_term_per_unit(&form))
}

fn compute_width(estimate: &ParameterEstimate) -> f64 {
    estimate.low.zip(estimate.high).map_or(f64::INFINITY, |(low, high)| high - low)
}

/// How many times half its interval a value is.
fn compute_certainty(estimate: &ParameterEstimate) -> f64 {
    estimate.value.abs() / (0.5 * compute_width(estimate)).max(f64::MIN_POSITIVE)
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

    /// A fit in which a law with a size that the recording does not tell has another form, where one is told and predicts as well.
    pub(super) fn replace_open_forms(&mut self, near: &[(String, Part)], search: &StartSearch, fit: Fit) -> Fit {
        let mut best = fit;
        let most = self.compute_allowed_square(&best);
        for (number, (name, _)) in near.iter().enumerate() {
            let place = self.baseline.parts.len() + number;
            // The scene holds load and output of whatever was fitted last.
            let _ = simulate_parts(&best.parts, &mut self.case.scene);
            if self.is_law_told(&best, place) {
                continue;
            }
            let mut told: Option<(f64, Fit)> = None;
            for start in search.list_start_sets(&[self.list_law_starts(name, search)]) {
                let mut parts = best.parts.clone();
                parts.splice(place..=place, start);
                let Some(other) = self.refit_parts(&parts) else { continue };
                let other = self.settle_parameters(other);
                let square = self.prepare_left_out(&other).compute_square();
                let is_better = square <= told.as_ref().map_or(most, |(square, _)| *square);
                if is_better && self.is_law_told(&other, place) {
                    told = Some((square, other));
                }
            }
            best = told.map_or(best, |(_, fit)| fit);
        }
        let _ = simulate_parts(&best.parts, &mut self.case.scene);
        best
    }

    /// Does the recording tell every size of the law at a place?
    fn is_law_told(&self, fit: &Fit, place: usize) -> bool {
        is_told(&fit.parts[place], &self.estimate_parameters(fit, place))
    }

    /// Squares of rows left out up to which a simpler fit stands for this one.
    fn compute_allowed_square(&self, fit: &Fit) -> f64 {
        let least = self.prepare_left_out(fit).compute_square();
        let baseline = self.baseline_square.get_or_init(|| self.prepare_left_out(self.baseline).compute_square());
        let gain = baseline - least;
        least + (NO_LOSS * least).max(GAIN_FOR_TOLD * gain)
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
                && !has_term_per_unit(&fit.parts[at.part])
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
            let is_term = (low..=high).contains(&0.0) && count_sizes(at.part) > 1;
            is_term && is_open(at) && !has_term_per_unit(&fit.parts[at.part])
        };
        free().filter(may_go).min_by(|a, b| certainty(a).total_cmp(&certainty(b))).map(|at| (*at, 0.0))
    }

    /// Names that are told as sure although the recording does not tell a size of theirs.
    pub(super) fn list_undetermined_names(&self, missing: &[Missing], textbook: &Textbook) -> Vec<String> {
        let part = |place: usize| textbook.fit.as_ref().and_then(|fit| fit.parts.get(place));
        let parts = textbook.laws.iter().map(|law| law.and_then(|(place, _)| part(place)));
        let is_open = |(missing, part): &(&Missing, Option<&Part>)| match part {
            Some(part) => !is_told(part, &missing.parameters),
            None => !missing.parameters.iter().all(is_determined),
        };
        missing
            .iter()
            .zip(parts.chain(std::iter::repeat(None)))
            .filter(is_open)
            .map(|(m, _)| m.effect.clone())
            .collect()
    }
}
