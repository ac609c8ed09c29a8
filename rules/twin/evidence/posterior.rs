//! The posterior: sets of the second stage summed over the likely noises, and by what they say.

use super::gram::{Comparison, Gram};
use super::marginal::{Ground, Saturated, log_sum_exp};
use super::naming::{Claim, Naming};
use super::resampling::{Bag, Candidate};
use super::search::{Members, SetEvidence, SetSearch};
use super::second_stage::SecondStage;
use std::collections::BTreeMap;

/// Sets that are evaluated for every noise, and those whose curves are offered names.
const SETS: usize = 40;
const OFFERED: usize = 25;
/// Noises under which the posterior is averaged.
const NOISES: usize = 2;

/// A set of variants with its posterior probability.
#[derive(Clone)]
pub(super) struct Explanation {
    /// Its members with the sizes they have in the likeliest noise.
    pub(super) members: Members,
    /// Number of the likeliest noise.
    pub(super) noise: usize,
    /// Logarithm of its probability.
    pub(super) ln: f64,
    /// Logarithm of its evidence over that of nothing, from all rows as they are and under its likeliest noise.
    pub(super) over_nothing: f64,
    /// The claim on each nameless member.
    pub(super) claims: Vec<Option<Claim>>,
    /// The names it comes to, sorted; `None` of what has none.
    pub(super) names: Vec<Option<String>>,
}

/// A noise with its Gram matrix and the state that every hypothesis starts from.
pub(super) struct NoiseSetting {
    pub(super) gram: Gram,
    pub(super) saturated: Saturated,
    pub(super) ground: Ground,
    pub(super) ln: f64,
}

impl Comparison<'_> {
    /// What a set leaves of the output, full length.
    pub(super) fn compute_residual(&self, setting: &NoiseSetting, members: &Members) -> Vec<f64> {
        let solved = self.solve_posterior_means(&setting.gram.whole, setting.saturated.variance, members);
        let (_, output) = self.fixed_and_output();
        let mut left = output.to_vec();
        for (index, w) in solved.tangents.iter().enumerate() {
            left.iter_mut().zip(self.tangent(index)).for_each(|(left, t)| *left -= w * t);
        }
        for ((variant, _), w) in members.iter().zip(&solved.members) {
            let x = self.bank.compute_contribution(&self.bank.variants[*variant], w);
            left.iter_mut().zip(&x).for_each(|(left, x)| *left -= x);
        }
        left
    }
}

impl NoiseSetting {
    pub(super) fn new(comparison: &Comparison<'_>, gram: Gram, saturated: Saturated) -> Self {
        let (ground, ln) = comparison.prepare_baseline(&gram, saturated);
        Self { gram, saturated, ground, ln }
    }
}

/// Every explanation, the likeliest first.
pub(super) fn rank_explanations(
    search: &SetSearch<'_>,
    settings: &[NoiseSetting],
    found: &SetEvidence,
    second: &SecondStage,
    naming: &Naming<'_>,
) -> Vec<Explanation> {
    let mut sets: Vec<(&Members, f64)> = found.iter().map(|(members, ln)| (members, *ln)).collect();
    sets.sort_by(|a, b| b.1.total_cmp(&a.1));
    let empty = Vec::new();
    let mut top: Vec<&Members> = sets.iter().take(SETS).map(|(members, _)| *members).collect();
    if !top.iter().any(|members| members.is_empty()) {
        top.push(&empty);
    }
    let mut evaluated: BTreeMap<Vec<usize>, Vec<EvaluatedSet>> = BTreeMap::new();
    for (number, setting) in settings.iter().enumerate() {
        for members in &top {
            let (ln, sized) = search.evaluate_set(&setting.ground, setting.ln, members);
            let key = sized.iter().map(|(variant, _)| *variant).collect();
            evaluated.entry(key).or_default().push((ln, number, sized));
        }
    }
    let sets: Vec<Vec<EvaluatedSet>> = evaluated.into_values().collect();
    let averaged = average_set_posterior(search, settings, &sets);
    let mut all: Vec<Explanation> = sets
        .iter()
        .zip(averaged)
        .filter_map(|(evaluated, ln)| {
            let best = evaluated.iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
            let claims = vec![None; best.2.len()];
            let over_nothing = best.0 - settings[best.1].ln;
            Some(Explanation { members: best.2.clone(), noise: best.1, ln, over_nothing, claims, names: Vec::new() })
        })
        .collect();
    all.sort_by(|a, b| b.ln.total_cmp(&a.ln));
    for (number, explanation) in all.iter_mut().enumerate() {
        if number < OFFERED {
            let setting = &settings[explanation.noise];
            explanation.claims = find_claims(search.comparison, setting, explanation, second, naming);
        }
        explanation.names = derive_names(second, explanation, naming);
    }
    all
}

/// Logarithm of the evidence of a set under a noise, the number of the noise, and its members with their sizes there.
type EvaluatedSet = (f64, usize, Members);

/// Logarithm of the probability of each set, averaged over resamples, under the noises that hold most of it.
fn average_set_posterior(search: &SetSearch<'_>, settings: &[NoiseSetting], sets: &[Vec<EvaluatedSet>]) -> Vec<f64> {
    let mut by_noise: Vec<(f64, usize)> = (0..settings.len())
        .map(|noise| (log_sum_exp(sets.iter().flatten().filter(|of| of.1 == noise).map(|of| of.0)), noise))
        .collect();
    by_noise.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut candidates = Vec::new();
    for (set, all) in sets.iter().enumerate() {
        for (_, noise) in by_noise.iter().take(NOISES) {
            // Of a set that was met in several sizes the likeliest.
            let best = all.iter().filter(|of| of.1 == *noise).max_by(|a, b| a.0.total_cmp(&b.0));
            candidates.extend(best.map(|best| Candidate { set, noise: *noise, members: &best.2 }));
        }
    }
    Bag::new(search.comparison, settings, search.priors, &candidates).average_posterior(&candidates, sets.len())
}

/// The claims on the nameless members of a set: each by itself, then those that are left together.
fn find_claims(
    comparison: &Comparison<'_>,
    setting: &NoiseSetting,
    explanation: &Explanation,
    second: &SecondStage,
    naming: &Naming<'_>,
) -> Vec<Option<Claim>> {
    let variant = |member: usize| &second.bank.variants[explanation.members[member].0];
    let source = |member: usize| second.source[explanation.members[member].0];
    let mut claims = vec![None; explanation.members.len()];
    let offered: Vec<usize> =
        (0..claims.len()).filter(|member| variant(*member).kind().is_none() && source(*member).is_some()).collect();
    if offered.is_empty() {
        return claims;
    }
    let solved =
        comparison.solve_posterior_means(&setting.gram.whole, setting.saturated.variance, &explanation.members);
    if offered.len() > 1 {
        let parts: Vec<(usize, &[f64])> = offered
            .iter()
            .filter_map(|member| source(*member).map(|of| (of, solved.members[*member].as_slice())))
            .collect();
        if let Some(claim) = naming.find_common_law(&parts) {
            offered.iter().for_each(|member| claims[*member] = Some(claim.clone()));
            return claims;
        }
    }
    let mut left = Vec::new();
    for member in offered {
        let Some(of) = source(member) else { continue };
        claims[member] = naming.find_best_claim(&[(of, &solved.members[member])]);
        if claims[member].is_none() {
            left.push((member, of));
        }
    }
    if left.len() > 1 {
        let parts: Vec<(usize, &[f64])> =
            left.iter().map(|(member, of)| (*of, solved.members[*member].as_slice())).collect();
        let claim = naming.find_best_claim(&parts);
        left.iter().for_each(|(member, _)| claims[*member] = claim.clone());
    }
    claims
}

/// The names of a set.
pub(super) fn derive_names(
    second: &SecondStage,
    explanation: &Explanation,
    naming: &Naming<'_>,
) -> Vec<Option<String>> {
    let mut names: Vec<Option<String>> = Vec::new();
    for ((variant, _), claim) in explanation.members.iter().zip(&explanation.claims) {
        match (second.bank.variants[*variant].kind(), claim) {
            (Some(kind), _) => names.push(Some(kind.to_owned())),
            (None, Some(claim)) => names.extend(claim.laws.iter().map(|(law, _)| naming.kind(*law))),
            (None, None) => names.push(None),
        }
    }
    names.sort();
    names.dedup();
    names
}

/// Explanations that say the same, the likeliest group first: their names, the logarithm of their probability together,
/// and the likeliest of them.
pub(super) fn group_by_names(all: &[Explanation]) -> Vec<Group<'_>> {
    let mut by_names: BTreeMap<&Vec<Option<String>>, Vec<&Explanation>> = BTreeMap::new();
    for explanation in all {
        by_names.entry(&explanation.names).or_default().push(explanation);
    }
    let mut groups: Vec<Group<'_>> = by_names
        .into_iter()
        .filter_map(|(names, of)| {
            let best = of.iter().copied().max_by(|a, b| a.ln.total_cmp(&b.ln))?;
            let ln = log_sum_exp(of.iter().map(|of| of.ln).collect::<Vec<_>>());
            let by_law = of.into_iter().filter(|of| of.claims.iter().all(Option::is_none));
            let by_law =
                by_law.max_by(|a, b| a.ln.total_cmp(&b.ln)).filter(|_| best.claims.iter().any(Option::is_some));
            Some(Group { names, ln, best, by_law })
        })
        .collect();
    groups.sort_by(|a, b| b.ln.total_cmp(&a.ln));
    groups
}

/// Explanations that say the same.
pub(super) struct Group<'a> {
    pub(super) names: &'a Vec<Option<String>>,
    pub(super) ln: f64,
    pub(super) best: &'a Explanation,
    /// The likeliest that says the same by laws alone, where the likeliest of all has a curve that was named: a law holds
    /// where a curve was never drawn.
    pub(super) by_law: Option<&'a Explanation>,
}
