//! What something that holds is called: one name, several that cannot be told apart, or none.

use super::answer::{EvidenceAnswer, Named, Rival, sum_contributions};
use super::naming::StandIn;
use super::posterior::{Explanation, Group};
use super::thresholds::THRESHOLDS;
use super::validation::Judge;
use crate::diagnosis::{UNKNOWN, Verdict};
use numerics::statistics::count_to_f64;
use physics::find_effect;
use std::collections::BTreeMap;

impl Judge<'_> {
    /// Verdict and names of a group that holds.
    pub(super) fn decide_names(
        &self,
        silent: EvidenceAnswer,
        best: &Explanation,
        groups: &[Group<'_>],
        information: f64,
    ) -> EvidenceAnswer {
        let ln = groups.iter().find(|group| *group.names == best.names).map_or(best.ln, |group| group.ln);
        let (after, contributions) = self.compute_contributions(best);
        let remaining: Vec<Named> =
            contributions.iter().map(|(name, x)| (name.clone(), self.project_out_baseline(x))).collect();
        let energy = |x: &[f64]| self.inputs.fitted_rows(false).map(|row| x[row] * x[row]).sum::<f64>();
        let sum = sum_contributions(&remaining, self.inputs.rows);
        let whole = energy(&sum).max(f64::MIN_POSITIVE);
        let share: BTreeMap<&str, f64> = remaining.iter().map(|(name, x)| (name.as_str(), energy(x) / whole)).collect();
        let rows = count_to_f64(self.comparison.rows.len());
        let small = |x: &[f64]| {
            let size = (energy(x) / rows).sqrt();
            size < THRESHOLDS.size_noise * self.ordinary && size < THRESHOLDS.size_output * self.comparison.size
        };
        let mut kept: Vec<&Named> =
            remaining.iter().filter(|(name, x)| share[name.as_str()] > THRESHOLDS.name_energy && !small(x)).collect();
        kept.sort_by(|a, b| share[b.0.as_str()].total_cmp(&share[a.0.as_str()]));
        if kept.is_empty() {
            let debug = format!("{}; too small", silent.debug);
            return EvidenceAnswer { verdict: Verdict::NoMismatch, withdrawn: None, debug, ..silent };
        }
        let names: Vec<String> = kept.iter().map(|(name, _)| name.clone()).filter(|name| name != UNKNOWN).collect();
        let unknown = share.get(UNKNOWN).copied().unwrap_or(0.0);
        let mut answer = EvidenceAnswer {
            verdict: Verdict::Unexplained,
            names,
            after,
            contributions,
            remaining,
            information,
            probabilities: sum_name_probabilities(groups),
            withdrawn: None,
            claimed: self.list_claimed_kinds(best),
            drawn_over: self.find_curve_channel(best),
            noise: best.noise,
            ..silent
        };
        if answer.names.is_empty() || unknown > THRESHOLDS.unknown_share {
            answer.mark_unexplained(groups, best.ln);
            return answer;
        }
        self.judge_names(&mut answer, (best, ln), groups);
        answer
    }

    fn list_claimed_kinds(&self, best: &Explanation) -> Vec<String> {
        let laws = best.claims.iter().flatten().flat_map(|claim| &claim.laws);
        laws.filter_map(|(law, _)| self.naming.kind(*law)).collect()
    }

    fn find_curve_channel(&self, best: &Explanation) -> Option<String> {
        let mut drawn =
            best.members.iter().filter_map(|(variant, _)| self.second.bank.variants[*variant].nameless_curve());
        drawn.next().map(|drawn| drawn.over.clone())
    }

    /// Explained or ambiguous, and what stands beside the names.
    fn judge_names(&self, answer: &mut EvidenceAnswer, (best, ln): (&Explanation, f64), groups: &[Group<'_>]) {
        let probabilities = sum_name_probabilities(groups);
        let mass = |name: &str| probabilities.get(name).copied().unwrap_or(0.0);
        let alone = |name: &String| mass(name) >= THRESHOLDS.alone;
        let mut beside: Vec<(String, f64)> = Vec::new();
        for other in groups.iter().filter(|other| other.ln > ln - THRESHOLDS.beside) {
            for name in other.names.iter().flatten().filter(|name| !answer.names.contains(name)) {
                if !beside.iter().any(|(known, _)| known == name) {
                    beside.push((name.clone(), (ln - other.ln).max(0.0)));
                }
            }
        }
        let sure_of_something = answer.existence.probability_of_nothing < THRESHOLDS.nothing_sure;
        let sure = sure_of_something && answer.names.iter().all(alone);
        answer.verdict = if sure { Verdict::Explained } else { Verdict::Ambiguous };
        let mut unnamed: Vec<Rival> = Vec::new();
        if sure {
            // What stands in other sets beside these names replaces none of them.
            beside.clear();
        } else if beside.is_empty() {
            // Nothing but a curve without a name, or nothing at all, stands where a name is not sure.
            let kept: Vec<String> =
                answer.names.iter().filter(|name| sure_of_something && alone(name)).cloned().collect();
            let says_more = |g: &&Group<'_>| g.names.iter().any(|n| n.as_ref().is_none_or(|name| !kept.contains(name)));
            let more = groups.iter().filter(says_more).map(|g| g.ln.exp()).sum::<f64>();
            let unsure = || answer.names.iter().filter(|name| !kept.contains(name));
            let likely = unsure().all(|name| mass(name) > 0.5);
            if likely && more >= 1.0 - THRESHOLDS.nothing_max {
                let odds = |name: &str| mass(name) / (1.0 - mass(name)).max(1e-12);
                unnamed = unsure().map(|name| Rival::new_unknown(name, odds(name).ln())).collect();
            } else if kept.is_empty() {
                answer.mark_unexplained(groups, ln);
                return;
            } else {
                answer.names = kept;
                answer.verdict = Verdict::Explained;
            }
        }
        let class = self.list_equivalent_laws(answer, best);
        if !class.is_empty() {
            answer.verdict = Verdict::Ambiguous;
        }
        if answer.verdict == Verdict::Ambiguous {
            let unsure = answer.names.iter().find(|name| !alone(name)).or(answer.names.first()).cloned();
            let instead_of = unsure.unwrap_or_default();
            let rival = |(name, nats)| Rival { name, instead_of: instead_of.clone(), nats };
            answer.rivals = beside.into_iter().map(rival).chain(unnamed).collect();
            for other in class {
                if !answer.rivals.iter().any(|known| known.name == other.name) {
                    answer.rivals.push(other);
                }
            }
        }
    }

    /// Names whose law costs little in the place of a member.
    fn list_equivalent_laws(&self, answer: &mut EvidenceAnswer, best: &Explanation) -> Vec<Rival> {
        let (comparison, gram) = self.first_stage;
        let variance = self.settings[best.noise].saturated.variance;
        let nats = 0.5 * comparison.tempering / variance;
        let mut class = Vec::new();
        let told = answer.contributions.iter().filter(|(name, _)| answer.names.contains(name));
        for (name, contribution) in &told.cloned().collect::<Vec<Named>>() {
            let (along, square) = self.naming.compute_whitened_products(comparison, gram, contribution);
            let all = self.naming.list_stand_ins(&along, square, nats);
            answer.debug.push_str(&format_nearest_stand_ins(name, &all));
            let itself = all.iter().find(|other| other.kind == *name);
            let own = itself.map_or(0.0, |own| own.nats.min(1.0));
            let left = itself.map(|own| own.nats);
            let is_like_itself = |other: &StandIn| itself.is_some_and(|itself| has_similar_form(itself, other));
            // The form of a curve that got its name by projection is not known better than to a tenth.
            let claimed = answer.claimed.contains(name);
            let near = |other: &StandIn| {
                let makes_curve = claimed && other.share >= THRESHOLDS.rival_share;
                // What a law leaves of its own curve for its form is forgiven its rival too, up to the same odds.
                let own_nats = left.filter(|_| other.share >= THRESHOLDS.of_each).unwrap_or(own);
                let own_nats = own_nats.min(THRESHOLDS.rival_nats);
                let is_confused = are_confused(name, &other.kind) && other.nats < own_nats + THRESHOLDS.rival_nats;
                let is_near = other.nats < own + THRESHOLDS.class_nats || is_confused;
                is_near || makes_curve || is_like_itself(other)
            };
            let others = all.iter().filter(|other| !answer.names.contains(&other.kind) && near(other));
            class.extend(others.map(|other| Rival {
                name: other.kind.clone(),
                instead_of: name.clone(),
                nats: (other.nats - own).max(0.0),
            }));
        }
        class.sort_by(|a, b| a.nats.total_cmp(&b.nats).then_with(|| a.name.cmp(&b.name)));
        class
    }
}

/// Probability of each name: that of all sets which hold it.
fn sum_name_probabilities(groups: &[Group<'_>]) -> BTreeMap<String, f64> {
    let mut all: BTreeMap<String, f64> = BTreeMap::new();
    for group in groups {
        for name in group.names.iter().flatten() {
            *all.entry(name.clone()).or_default() += group.ln.exp();
        }
    }
    all.values_mut().for_each(|probability| *probability = probability.min(1.0));
    all
}

/// Does another law make nearly as much of a contribution as the law that gave it its name?
///
/// However many rows there are, they tell no more of a form than its freedom: what a law leaves of a curve is a departure of the
/// machine from the textbook in so many directions, of a deviation that is not known; the law's own bends take directions away.
/// Summed over all deviations the odds of two laws are the ratio of what they leave for each direction, half a nat of noise for
/// each with it, to half the power of their number.
fn has_similar_form(named: &StandIn, other: &StandIn) -> bool {
    let half = 0.5 * THRESHOLDS.form_freedom;
    let of_each = |law: &StandIn| (law.nats + half) / (THRESHOLDS.form_freedom - law.bends).max(1.0);
    let nats = half * (of_each(other) / of_each(named)).ln();
    other.share >= THRESHOLDS.of_each && nats < THRESHOLDS.class_nats
}

/// Does the catalogue say of one of two laws that it is confused with the other?
pub(super) fn are_confused(a: &str, b: &str) -> bool {
    let says = |a: &str, b: &str| find_effect(a).is_some_and(|effect| effect.doc().rivals.contains(&b));
    says(a, b) || says(b, a)
}

/// The laws that come nearest to a contribution, for engineers.
fn format_nearest_stand_ins(name: &str, all: &[StandIn]) -> String {
    let mut near: Vec<&StandIn> = all.iter().collect();
    near.sort_by(|a, b| a.nats.total_cmp(&b.nats));
    let near = near.iter().take(6).map(|other| format!("{} {:.1} {:.2}", other.kind, other.nats, other.share));
    format!("\n{name}: {}", near.collect::<Vec<_>>().join(", "))
}
