//! From explanations to an answer: what is reported, with which names, and what it contributes where.

use super::decision::THRESHOLDS;
use super::gram::Comparison;
use super::inner::Inner;
use super::inputs::RecordingInputs;
use super::naming::Naming;
use super::posterior::{Explanation, Group, NoiseSetting, grouped};
use super::second::SecondStage;
use crate::statistics::count;
use crate::twin::diagnosis::{UNKNOWN, Verdict};
use crate::twin::outcome::{FailedHoldout, or_unknown};
use std::collections::BTreeMap;

/// Groups that are looked at.
const GROUPS: usize = 8;

/// Everything a judgement reads.
pub(super) struct Judge<'a> {
    pub(super) inputs: &'a RecordingInputs<'a>,
    pub(super) comparison: &'a Comparison<'a>,
    pub(super) second: &'a SecondStage,
    pub(super) settings: &'a [NoiseSetting],
    pub(super) naming: &'a Naming<'a>,
    /// The recorded output with outliers cut.
    pub(super) recorded: &'a [f64],
    /// Tangents of the baseline, full length.
    pub(super) tangents: &'a [Vec<f64>],
    /// Deviation of the ordinary noise.
    pub(super) ordinary: f64,
    /// The first-stage comparison, whose laws stand in for one another, with the Gram matrix of the likeliest noise.
    pub(super) first: (&'a Comparison<'a>, &'a super::gram::Gram),
}

/// The answer.
#[derive(Debug)]
pub(super) struct EvidenceAnswer {
    pub(super) verdict: Verdict,
    /// Names, the most important first.
    pub(super) names: Vec<String>,
    /// Other names with the one they would replace.
    pub(super) alternatives: Vec<(String, String)>,
    /// The output with what is missing.
    pub(super) after: Vec<f64>,
    /// Contribution of each name.
    pub(super) contributions: Vec<(String, Vec<f64>)>,
    /// What each leaves once the baseline has been refitted.
    pub(super) remaining: Vec<(String, Vec<f64>)>,
    /// Twice the logarithm of the evidence over nothing.
    pub(super) information: f64,
    /// What rows held out did not confirm, where that is why nothing is told.
    pub(super) withdrawn: Option<FailedHoldout>,
    /// For engineers.
    pub(super) debug: String,
}

/// A contribution under a name.
pub(super) type Named = (String, Vec<f64>);

impl Judge<'_> {
    /// The answer.
    pub(super) fn answer(&self, all: &[Explanation]) -> EvidenceAnswer {
        let groups = grouped(all);
        let nothing = groups.iter().find(|group| group.names.is_empty()).map_or(-60.0, |group| group.ln);
        let debug = self.debug(&groups);
        let Some(first) = groups.first().filter(|group| !group.names.is_empty()) else { return self.nothing(debug) };
        if nothing.exp() >= THRESHOLDS.nothing_max {
            return self.nothing(debug);
        }
        let near = groups.iter().take(GROUPS).filter(|group| !group.names.is_empty());
        let mut debug = debug;
        for group in near.take_while(|group| group.ln > first.ln - THRESHOLDS.looked_at) {
            let mut of = group.best;
            let (mut kept, mut gain) = self.carried_over(of);
            let falls_short = kept.len() < of.members.len() || gain <= THRESHOLDS.inner_gain;
            if let Some(by_law) = group.by_law.filter(|_| falls_short) {
                let (law_kept, law_gain) = self.carried_over(by_law);
                if law_kept.len() == by_law.members.len() && law_gain > THRESHOLDS.inner_gain {
                    (of, kept, gain) = (by_law, law_kept, law_gain);
                }
            }
            debug.push_str(&format!("\ninner {gain:.2} keeps {} of {}", kept.len(), of.members.len()));
            if kept.is_empty() || gain <= THRESHOLDS.inner_gain {
                continue;
            }
            let information = 2.0 * (group.ln - nothing);
            let best = match self.not_withdrawn(self.less(of, &kept), information) {
                Ok(best) => best,
                Err(withdrawn) => {
                    let silent = self.nothing(format!("{debug}; withdrawn: the held-out error does not fall"));
                    return EvidenceAnswer { verdict: Verdict::CannotTell, withdrawn: Some(withdrawn), ..silent };
                }
            };
            let mut answer = self.named(&best, &groups, information, debug);
            if best.members.len() < kept.len() && answer.verdict == Verdict::Explained {
                // What explained most did not carry over: what is left of it has no sure name.
                answer.debug.push_str("; withdrawn in part");
                answer.leave_unnamed(&groups, best.ln);
            }
            return answer;
        }
        self.nothing(format!("{debug}; inner parts gain nothing"))
    }

    /// The members that carry over to fitted units which took no part in their sizes, and what they gain there together.
    fn carried_over(&self, of: &Explanation) -> (Vec<usize>, f64) {
        let inner = Inner::new(self.inputs, self.comparison, &self.settings[of.noise], &of.members);
        let all: Vec<usize> = (0..of.members.len()).collect();
        let without = |gone: usize| all.iter().copied().filter(|member| *member != gone).collect::<Vec<_>>();
        let costs = |member: &usize| inner.gain(&all, &without(*member)).0 < THRESHOLDS.member_loss;
        let kept = if all.iter().any(costs) { best_of(&inner, &all) } else { all };
        let gain = inner.gain(&kept, &[]).0;
        (kept, gain)
    }

    /// Rows that took no part only withdraw: as long as their error does not fall, the member goes whose absence leaves the
    /// least. An error where nothing is left.
    fn not_withdrawn(&self, mut best: Explanation, information: f64) -> Result<Explanation, FailedHoldout> {
        let before = self.held_out_square(&self.inputs.simulated);
        let after = |of: &Explanation| self.held_out_square(&self.contributions(of).0);
        if before <= 0.0 {
            return Ok(best);
        }
        let kinds = |of: &Explanation| of.names.iter().flatten().cloned().collect::<Vec<String>>();
        let found = or_unknown(&kinds(&best));
        let mut left = after(&best);
        while left >= before {
            let size = best.members.len();
            let without = |gone: usize| {
                let kept: Vec<usize> = (0..size).filter(|member| *member != gone).collect();
                let less = self.less(&best, &kept);
                (after(&less), less)
            };
            let all = (0..size).filter(|_| size > 1).map(without);
            let Some(fewer) = all.min_by(|a, b| a.0.total_cmp(&b.0)) else {
                let rows = count(self.inputs.left_out().count());
                let errors = ((before / rows).sqrt(), (left / rows).sqrt());
                let (kinds, added) = (kinds(&best), Vec::new());
                return Err(FailedHoldout { kinds, found, among_fitted: false, errors, information, added });
            };
            (left, best) = fewer;
        }
        Ok(best)
    }

    fn held_out_square(&self, total: &[f64]) -> f64 {
        let recorded = self.inputs.scene.recorded();
        self.inputs.left_out().map(|row| (recorded[row] - total[row]).powi(2)).sum()
    }

    /// An explanation with some of its members only.
    pub(super) fn less(&self, of: &Explanation, kept: &[usize]) -> Explanation {
        let mut less = Explanation {
            members: kept.iter().map(|member| of.members[*member]).collect(),
            noise: of.noise,
            ln: of.ln,
            claims: kept.iter().map(|member| of.claims[*member].clone()).collect(),
            names: Vec::new(),
        };
        less.names = super::posterior::names(self.second, &less, self.naming);
        less
    }

    fn nothing(&self, debug: String) -> EvidenceAnswer {
        EvidenceAnswer {
            verdict: Verdict::NoMismatch,
            names: Vec::new(),
            alternatives: Vec::new(),
            after: self.inputs.simulated.clone(),
            contributions: Vec::new(),
            remaining: Vec::new(),
            information: 0.0,
            withdrawn: None,
            debug,
        }
    }

    /// Verdict and names of a group that holds.
    fn named(&self, best: &Explanation, groups: &[Group<'_>], information: f64, debug: String) -> EvidenceAnswer {
        let ln = groups.iter().find(|group| *group.names == best.names).map_or(best.ln, |group| group.ln);
        let (after, contributions) = self.contributions(best);
        let remaining: Vec<Named> = contributions.iter().map(|(name, x)| (name.clone(), self.remaining(x))).collect();
        let energy = |x: &[f64]| self.inputs.taken(false).map(|row| x[row] * x[row]).sum::<f64>();
        let sum = sum_of(&remaining, self.inputs.rows);
        let whole = energy(&sum).max(f64::MIN_POSITIVE);
        let share: BTreeMap<&str, f64> = remaining.iter().map(|(name, x)| (name.as_str(), energy(x) / whole)).collect();
        let rows = count(self.comparison.rows.len());
        let small = |x: &[f64]| {
            let size = (energy(x) / rows).sqrt();
            size < THRESHOLDS.size_noise * self.ordinary && size < THRESHOLDS.size_output * self.comparison.size
        };
        let mut kept: Vec<&Named> =
            remaining.iter().filter(|(name, x)| share[name.as_str()] > THRESHOLDS.name_energy && !small(x)).collect();
        kept.sort_by(|a, b| share[b.0.as_str()].total_cmp(&share[a.0.as_str()]));
        if kept.is_empty() {
            return self.nothing(format!("{debug}; too small"));
        }
        let names: Vec<String> = kept.iter().map(|(name, _)| name.clone()).filter(|name| name != UNKNOWN).collect();
        let unknown = share.get(UNKNOWN).copied().unwrap_or(0.0);
        let mut answer = EvidenceAnswer {
            verdict: Verdict::Unexplained,
            names,
            alternatives: Vec::new(),
            after,
            contributions,
            remaining,
            information,
            withdrawn: None,
            debug,
        };
        if answer.names.is_empty() || unknown > THRESHOLDS.unknown_share {
            answer.leave_unnamed(groups, best.ln);
            return answer;
        }
        self.judge_names(&mut answer, (best, ln), groups);
        answer
    }

    /// Explained or ambiguous, and what stands beside the names.
    fn judge_names(&self, answer: &mut EvidenceAnswer, (best, ln): (&Explanation, f64), groups: &[Group<'_>]) {
        let mass = |name: &str| {
            let of = |g: &&Group<'_>| g.names.iter().any(|n| n.as_deref() == Some(name));
            groups.iter().filter(of).map(|g| g.ln.exp()).sum::<f64>()
        };
        let alone = |name: &String| mass(name) >= THRESHOLDS.alone;
        let mut beside: Vec<String> = Vec::new();
        for other in groups.iter().filter(|other| other.ln > ln - THRESHOLDS.beside) {
            for name in other.names.iter().flatten().filter(|name| !answer.names.contains(name)) {
                if !beside.contains(name) {
                    beside.push(name.clone());
                }
            }
        }
        answer.verdict = if answer.names.iter().all(alone) { Verdict::Explained } else { Verdict::Ambiguous };
        if answer.verdict == Verdict::Explained {
            beside.retain(|name| mass(name) > 0.1);
        } else if beside.is_empty() {
            let sure: Vec<String> = answer.names.iter().filter(|name| alone(name)).cloned().collect();
            if sure.is_empty() {
                answer.leave_unnamed(groups, ln);
                return;
            }
            answer.names = sure;
            answer.verdict = Verdict::Explained;
        }
        let class = self.class(answer, best);
        if !class.is_empty() {
            answer.verdict = Verdict::Ambiguous;
        }
        if answer.verdict == Verdict::Ambiguous {
            let unsure = answer.names.iter().find(|name| !alone(name)).or(answer.names.first()).cloned();
            let instead = unsure.unwrap_or_default();
            answer.alternatives = beside.into_iter().map(|name| (name, instead.clone())).collect();
            for (other, instead) in class {
                if !answer.alternatives.iter().any(|(known, _)| *known == other) {
                    answer.alternatives.push((other, instead));
                }
            }
        }
    }

    /// Names whose law costs little in the place of a member.
    fn class(&self, answer: &EvidenceAnswer, best: &Explanation) -> Vec<(String, String)> {
        let (comparison, gram) = self.first;
        let variance = self.settings[best.noise].saturated.variance;
        let nats = 0.5 * comparison.tempering / variance;
        let mut class = Vec::new();
        for (name, contribution) in &answer.contributions {
            if !answer.names.contains(name) {
                continue;
            }
            let (along, square) = self.naming.products(comparison, gram, contribution);
            let all = self.naming.stand_ins(&along, square, nats);
            let own = all.iter().find(|(kind, _)| kind == name).map_or(0.0, |(_, loss)| loss.min(1.0));
            let others = all
                .into_iter()
                .filter(|(kind, loss)| !answer.names.contains(kind) && *loss < own + THRESHOLDS.class_nats);
            class.extend(others.map(|(kind, _)| (kind, name.clone())));
        }
        class.sort();
        class
    }

    fn debug(&self, groups: &[Group<'_>]) -> String {
        let member = |(variant, size): &(usize, usize)| {
            let of = &self.second.bank.variants[*variant];
            format!("{} [{}] {}", of.kind().unwrap_or("?"), of.label, super::marginal::SIZES[*size])
        };
        let of = |group: &Group<'_>| {
            let members: Vec<String> = group.best.members.iter().map(member).collect();
            let names: Vec<&str> = group.names.iter().map(|name| name.as_deref().unwrap_or("?")).collect();
            let claims = group.best.claims.iter().flatten().map(|claim| format!("{:.2}", claim.share));
            format!(
                "\n{:.4} {:.1} {} | {} | claims {}",
                group.ln.exp(),
                group.ln,
                names.join("+"),
                members.join(", "),
                claims.collect::<Vec<_>>().join(" ")
            )
        };
        let noises: Vec<String> =
            self.settings.iter().map(|s| format!("{:.2}/{:.3}", s.gram.noise.share, s.gram.noise.phi)).collect();
        let all: Vec<String> = groups.iter().take(GROUPS).map(of).collect();
        format!("noise {} ordinary {:.4}{}", noises.join(" "), self.ordinary, all.join(""))
    }
}

impl EvidenceAnswer {
    /// Something real that no name explains; names that come near stand beside it.
    fn leave_unnamed(&mut self, groups: &[Group<'_>], ln: f64) {
        self.verdict = Verdict::Unexplained;
        let mut near: Vec<String> = std::mem::take(&mut self.names);
        for other in groups.iter().filter(|other| other.ln > ln - THRESHOLDS.beside) {
            for name in other.names.iter().flatten() {
                if !near.contains(name) {
                    near.push(name.clone());
                }
            }
        }
        self.alternatives = near.into_iter().map(|name| (name, UNKNOWN.to_owned())).collect();
        self.names = vec![UNKNOWN.to_owned()];
        for all in [&mut self.contributions, &mut self.remaining] {
            let rows = all.first().map_or(0, |(_, x)| x.len());
            *all = vec![(UNKNOWN.to_owned(), sum_of(all, rows))];
        }
    }
}

/// The sum of all contributions.
pub(super) fn sum_of(all: &[Named], rows: usize) -> Vec<f64> {
    let mut sum = vec![0.0; rows];
    for (_, x) in all {
        sum.iter_mut().zip(x).for_each(|(sum, x)| *sum += x);
    }
    sum
}

/// Of all sets of members the one that gains most in units that took no part in its sizes.
fn best_of(inner: &Inner<'_>, all: &[usize]) -> Vec<usize> {
    let sets = (1_usize..1 << all.len())
        .map(|bits| all.iter().copied().filter(|member| bits >> member & 1 == 1).collect::<Vec<_>>());
    let gained = sets.map(|set| (inner.gain(&set, &[]).1, set));
    gained.max_by(|a, b| a.0.total_cmp(&b.0)).map_or_else(Vec::new, |(_, set)| set)
}
