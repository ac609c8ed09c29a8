//! The search: sets of variants by their evidence, a few at a time, up to three together.

use super::gram::Comparison;
use super::marginal::{Ground, MarginalState};
use super::variant_bank::VariantBank;
use std::collections::BTreeMap;

/// Logarithms of the prior probability of a named kind, shared by its variants, and of a nameless curve: 1 in 100 and 1 in
/// 500, so that a curve must be five times likelier than a law to stand in its place.
pub(super) const NAMED: f64 = -4.6;
pub(super) const NAMELESS: f64 = -6.2;
/// Members of a set at most, and nameless ones among them.
const DEPTH: usize = 3;
const NAMELESS_MAX: usize = 2;
/// Sets that are kept per signature, and how far behind the best they may be.
const PER_SIGNATURE: usize = 4;
const KEPT_WITHIN: f64 = 40.0;
const FOLLOWED_WITHIN: f64 = 25.0;

/// Members: variant and size of each, in rising order.
pub(super) type Members = Vec<(usize, usize)>;
/// Sets with the logarithm of their evidence and prior.
pub(super) type SetEvidence = BTreeMap<Members, f64>;

/// Searches among variants with these priors.
pub(super) struct SetSearch<'a> {
    pub(super) comparison: &'a Comparison<'a>,
    /// Logarithm of the prior of each variant.
    pub(super) priors: &'a [f64],
    /// Sets that are followed from one depth to the next.
    pub(super) beam: usize,
}

struct CandidateSet {
    ln: f64,
    members: Members,
    parent: usize,
    added: (usize, usize),
}

/// The prior of every variant of a bank: of its kind, of the variant in it.
pub(super) fn compute_ln_priors(bank: &VariantBank) -> Vec<f64> {
    let of = |variant: &super::variant_bank::Variant| if variant.kind().is_some() { NAMED } else { NAMELESS };
    bank.variants.iter().zip(bank.count_kind_variants()).map(|(v, share)| of(v) + v.ln_prior - share.ln()).collect()
}

impl SetSearch<'_> {
    /// Every set worth keeping, the empty one among them.
    pub(super) fn search_sets(&self, ground: &Ground, ln: f64) -> SetEvidence {
        let mut found = SetEvidence::from([(Vec::new(), ln)]);
        let mut level: Vec<(Members, MarginalState<'_>, f64)> = vec![(Vec::new(), ground.build_initial_state(), ln)];
        for depth in 0..DEPTH {
            let candidates = self.extend_sets(&level);
            let Some(best) = candidates.first().map(|candidate| candidate.ln) else { break };
            let followed = self.prune_candidates(candidates, best, &mut found);
            let top = found.values().copied().fold(f64::NEG_INFINITY, f64::max);
            if depth + 1 == DEPTH || followed.is_empty() || best < top - 1e-9 && depth > 0 {
                break;
            }
            level = followed
                .into_iter()
                .map(|candidate| {
                    let (variant, size) = candidate.added;
                    let state = self.comparison.condition_on_variant(&level[candidate.parent].1, variant, size);
                    (candidate.members, state, candidate.ln)
                })
                .collect();
        }
        found
    }

    /// Every set of a level with one more member, the likeliest first, each once.
    fn extend_sets(&self, level: &[(Members, MarginalState<'_>, f64)]) -> Vec<CandidateSet> {
        let variants = &self.comparison.bank.variants;
        let mut best: BTreeMap<Vec<usize>, CandidateSet> = BTreeMap::new();
        for (parent, (members, state, ln)) in level.iter().enumerate() {
            for variant in 0..variants.len() {
                if state.is_variant_hidden(variant) || !self.can_join_set(members, variant) {
                    continue;
                }
                let gain = self.comparison.compute_evidence_gain(state, variant);
                let ln = ln + gain.ln + self.priors[variant];
                let mut joined = members.clone();
                joined.push((variant, gain.size));
                joined.sort_unstable();
                let key = joined.iter().map(|(variant, _)| *variant).collect();
                let better = best.get(&key).is_none_or(|known| ln > known.ln);
                if better {
                    best.insert(key, CandidateSet { ln, members: joined, parent, added: (variant, gain.size) });
                }
            }
        }
        let mut all: Vec<CandidateSet> = best.into_values().collect();
        all.sort_by(|a, b| b.ln.total_cmp(&a.ln));
        all
    }

    fn can_join_set(&self, members: &Members, variant: usize) -> bool {
        let variants = &self.comparison.bank.variants;
        let joining = &variants[variant];
        let nameless = members.iter().filter(|(member, _)| variants[*member].kind().is_none()).count();
        if joining
            .nameless_curve()
            .is_some_and(|drawn| drawn.over == "run" && drawn.times == "1" || nameless >= NAMELESS_MAX)
        {
            return false;
        }
        members.iter().all(|(member, _)| *member != variant && !variants[*member].is_redundant_with(joining))
    }

    /// Keeps the likeliest few sets of every signature; what is followed further.
    fn prune_candidates(&self, candidates: Vec<CandidateSet>, best: f64, found: &mut SetEvidence) -> Vec<CandidateSet> {
        let mut seen: BTreeMap<Vec<String>, usize> = BTreeMap::new();
        let mut followed = Vec::new();
        for candidate in candidates {
            let count = seen.entry(self.build_signature(&candidate.members)).or_default();
            if *count < PER_SIGNATURE && candidate.ln > best - KEPT_WITHIN {
                found.insert(candidate.members.clone(), candidate.ln);
            }
            *count += 1;
            if *count == 1 && followed.len() < self.beam && candidate.ln > best - FOLLOWED_WITHIN {
                followed.push(candidate);
            }
        }
        followed
    }

    fn build_signature(&self, members: &Members) -> Vec<String> {
        let variants = &self.comparison.bank.variants;
        let name = |member: &(usize, usize)| {
            let variant = &variants[member.0];
            variant.kind().map_or_else(|| variant.label.clone(), str::to_owned)
        };
        let mut names: Vec<String> = members.iter().map(name).collect();
        names.sort();
        names
    }

    /// The evidence of a set for another noise, its sizes adapted one after the other.
    pub(super) fn evaluate_set(&self, ground: &Ground, ln: f64, members: &Members) -> (f64, Members) {
        let ground = self.comparison.select_members(ground, members);
        let start = ground.build_initial_state();
        let mut current = members.clone();
        let mut total = ln;
        let passes = if members.len() == 1 { 1 } else { 2 };
        for _ in 0..passes {
            for turn in 0..current.len() {
                let mut sum = ln;
                let mut state: Option<MarginalState<'_>> = None;
                for (_, (variant, size)) in current.iter().enumerate().filter(|(other, _)| *other != turn) {
                    let here = state.as_ref().unwrap_or(&start);
                    sum += self.comparison.compute_gain_at_size(here, *variant, *size) + self.priors[*variant];
                    state = Some(self.comparison.condition_on_variant(here, *variant, *size));
                }
                let variant = current[turn].0;
                let gain = self.comparison.compute_evidence_gain(state.as_ref().unwrap_or(&start), variant);
                total = sum + gain.ln + self.priors[variant];
                current[turn] = (variant, gain.size);
            }
        }
        (total, current)
    }
}
