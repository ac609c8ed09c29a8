//! What a recording tells of the parameters of a law: those that it does not tell are taken as known, and a name whose size it
//! does not tell is not sure.

use super::report::EvidenceReport;
use crate::departure::is_of_departure;
use crate::diagnosis::{Missing, ParameterEstimate};
use crate::fit::Fit;
use crate::model::{Part, simulate_parts};
use physics::Entry;

/// Rounds in which parameters are settled: each makes the intervals of the others narrower.
const ROUNDS: usize = 3;
/// Share by which the squares of rows left out may rise for a term that is left away: less than chance moves them.
const NO_LOSS: f64 = 2e-3;

/// Does its interval exclude zero?
fn excludes_zero(estimate: &ParameterEstimate) -> bool {
    matches!((estimate.low, estimate.high), (Some(low), Some(high)) if low > 0.0 || high < 0.0)
}

/// Is its interval no wider than the value, and away from zero?
pub(super) fn is_determined(estimate: &ParameterEstimate) -> bool {
    let width = estimate.low.zip(estimate.high).map_or(f64::INFINITY, |(low, high)| high - low);
    excludes_zero(estimate) && width <= estimate.value.abs()
}

impl EvidenceReport<'_, '_> {
    /// A fit in which shapes that the recording does not tell stay at the value they have, and terms that may be nothing are left
    /// away where another term of the law holds.
    pub(super) fn settle_parameters(&mut self, fit: Fit) -> Fit {
        let mut best = fit;
        for _ in 0..ROUNDS {
            let Some(parts) = self.fix_undetermined(&best) else { break };
            let Some(less) = self.refit_parts(&parts) else { break };
            let (before, after) =
                (self.prepare_left_out(&best).compute_square(), self.prepare_left_out(&less).compute_square());
            if after > (1.0 + NO_LOSS) * before {
                break;
            }
            best = less;
        }
        let _ = simulate_parts(&best.parts, &mut self.case.scene);
        best
    }

    /// The parts with what is not told of the laws fixed; `None` where everything is told.
    fn fix_undetermined(&self, fit: &Fit) -> Option<Vec<Part>> {
        let mut parts = fit.parts.clone();
        let mut changed = false;
        for place in self.baseline.parts.len()..parts.len() {
            let told = self.estimate_parameters(fit, place);
            let find = |name: &str| told.iter().find(|estimate| estimate.name == name);
            let holds = |name: &str| find(name).is_some_and(excludes_zero);
            let linear: Vec<String> = parts[place]
                .parameters
                .iter()
                .filter(|parameter| parameter.entry == Entry::Linear)
                .map(|parameter| parameter.name.clone())
                .collect();
            let any_holds = linear.iter().any(|name| holds(name));
            let whole = parts[place].parameters.iter().any(|p| p.entry == Entry::Linear && p.fixed && p.value != 0.0);
            for parameter in parts[place].parameters.iter_mut().filter(|p| !p.fixed && !is_of_departure(p)) {
                let Some(estimate) = find(&parameter.name) else { continue };
                let settled = match parameter.entry {
                    Entry::Shape => !whole && !is_determined(estimate),
                    Entry::Linear => any_holds && !excludes_zero(estimate),
                };
                if settled {
                    if parameter.entry == Entry::Linear {
                        parameter.value = 0.0_f64.clamp(parameter.range.0, parameter.range.1);
                    }
                    (parameter.fixed, changed) = (true, true);
                }
            }
        }
        changed.then_some(parts)
    }

    /// Names that are told as sure although the recording does not tell a size of theirs.
    pub(super) fn list_undetermined_names(&self, missing: &[Missing]) -> Vec<String> {
        let open = |missing: &&Missing| !missing.parameters.iter().all(is_determined);
        missing.iter().filter(open).map(|m| m.effect.clone()).collect()
    }
}
