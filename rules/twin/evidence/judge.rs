//! From explanations to an answer: what is reported, with which names, and what it contributes where.

use super::decision::THRESHOLDS;
use super::existence::ExistenceTest;
use super::gram::{Comparison, Gram};
use super::inner::Inner;
use super::inputs::RecordingInputs;
use super::naming::{Naming, StandIn};
use super::posterior::{Explanation, Group, NoiseSetting, grouped};
use super::second::SecondStage;
use crate::physics::effect;
use crate::statistics::count;
use crate::twin::diagnosis::{Existence, UNKNOWN, Verdict};
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
    pub(super) first: (&'a Comparison<'a>, &'a Gram),
    /// Whether anything is there.
    pub(super) test: ExistenceTest,
}

/// Another name, and what it would replace.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rival {
    pub(super) name: String,
    pub(super) instead_of: String,
    /// Nats by which it is less likely.
    pub(super) nats: f64,
}

/// Why something that is there is not told.
#[derive(Debug, Clone)]
pub(super) struct Withdrawn {
    /// Names of what was found in the fitted rows; `unknown` where it had none.
    pub(super) found: Vec<String>,
    /// Were they fitted runs that were predicted from the others, or those held out?
    pub(super) among_fitted: bool,
    /// Root mean square errors there without it and with it, where they were computed.
    pub(super) errors: Option<(f64, f64)>,
}

/// The answer.
#[derive(Debug)]
pub(super) struct EvidenceAnswer {
    pub(super) verdict: Verdict,
    /// Names, the most important first.
    pub(super) names: Vec<String>,
    pub(super) rivals: Vec<Rival>,
    /// The output with what is missing.
    pub(super) after: Vec<f64>,
    /// Contribution of each name.
    pub(super) contributions: Vec<(String, Vec<f64>)>,
    /// What each leaves once the baseline has been refitted.
    pub(super) remaining: Vec<(String, Vec<f64>)>,
    /// Twice the logarithm of the evidence over nothing.
    pub(super) information: f64,
    pub(super) existence: Existence,
    /// What is there and not told.
    pub(super) withdrawn: Option<Withdrawn>,
    /// Names that a curve got by projection.
    pub(super) claimed: Vec<String>,
    /// Channel of the largest nameless curve.
    pub(super) drawn_over: Option<String>,
    /// Number of the likeliest noise.
    pub(super) noise: usize,
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
        let mut answer = self.nothing(nothing, self.debug(&groups));
        if self.test.chance > THRESHOLDS.chance_max {
            return answer;
        }
        let named = || groups.iter().filter(|group| !group.names.is_empty());
        let Some(first) = named().next() else { return answer };
        let near = named().take(GROUPS).take_while(|group| group.ln > first.ln - THRESHOLDS.looked_at);
        answer.verdict = Verdict::CannotTell;
        let found = names_of(first.best);
        answer.withdrawn = Some(Withdrawn { found, among_fitted: true, errors: None });
        if nothing.exp() >= THRESHOLDS.nothing_max {
            answer.debug.push_str("\nnothing is not improbable");
            return answer;
        }
        for group in near {
            let (of, kept, gain) = self.carried_over_best(group);
            answer.debug.push_str(&format!("\ninner {gain:.2} keeps {} of {}", kept.len(), of.members.len()));
            if kept.is_empty() || gain <= THRESHOLDS.inner_gain {
                continue;
            }
            let own = self.own_share(&self.less(of, &kept));
            if own < THRESHOLDS.own_share {
                answer.debug.push_str(&format!("\nthe baseline leaves {own:.5}"));
                continue;
            }
            match self.not_withdrawn(self.less(of, &kept)) {
                Ok(best) => {
                    let lost = best.members.len() < kept.len();
                    return self.told(answer, &best, &groups, lost);
                }
                Err(withdrawn) => {
                    answer.debug.push_str(&self.held_out_errors(&self.less(of, &kept)));
                    answer.withdrawn = Some(withdrawn);
                }
            }
            break;
        }
        answer
    }

    /// What is told of an explanation that holds; `lost` where rows held out took a part of it away.
    fn told(&self, silent: EvidenceAnswer, best: &Explanation, groups: &[Group<'_>], lost: bool) -> EvidenceAnswer {
        let nothing = silent.existence.probability_of_nothing.max(1e-300).ln();
        let information = 2.0 * (best.ln - nothing);
        let mut answer = self.named(silent, best, groups, information);
        if lost && answer.verdict == Verdict::Explained {
            // What explained most did not carry over: what is left of it has no sure name.
            answer.debug.push_str("; withdrawn in part");
            answer.leave_unnamed(groups, best.ln);
        }
        answer
    }

    /// Share of the energy of all contributions that the baseline cannot imitate.
    fn own_share(&self, of: &Explanation) -> f64 {
        let energy = |x: &[f64]| self.inputs.taken(false).map(|row| x[row] * x[row]).sum::<f64>();
        let contributions = self.contributions(of).1;
        let each: f64 = contributions.iter().map(|(_, x)| energy(x)).sum();
        energy(&self.remaining(&sum_of(&contributions, self.inputs.rows))) / each.max(f64::MIN_POSITIVE)
    }

    /// Of a group the explanation that carries over better, with drawn curves or by laws alone; its members that do, and what
    /// they gain.
    fn carried_over_best<'g>(&self, group: &Group<'g>) -> (&'g Explanation, Vec<usize>, f64) {
        let (kept, gain) = self.carried_over(group.best);
        if let Some(by_law) = group.by_law {
            let (law_kept, law_gain) = self.carried_over(by_law);
            let whole = law_kept.len() == by_law.members.len();
            if whole && (law_gain > gain || kept.len() < group.best.members.len()) {
                return (by_law, law_kept, law_gain);
            }
        }
        (group.best, kept, gain)
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
    fn not_withdrawn(&self, mut best: Explanation) -> Result<Explanation, Withdrawn> {
        let before = self.held_out_square(&self.inputs.simulated);
        let after = |of: &Explanation| self.held_out_square(&self.contributions(of).0);
        if before <= 0.0 {
            return Ok(best);
        }
        let found = names_of(&best);
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
                let errors = Some(((before / rows).sqrt(), (left / rows).sqrt()));
                return Err(Withdrawn { found, among_fitted: false, errors });
            };
            (left, best) = fewer;
        }
        Ok(best)
    }

    fn held_out_square(&self, total: &[f64]) -> f64 {
        let recorded = self.inputs.scene.recorded();
        self.inputs.left_out().map(|row| (recorded[row] - total[row]).powi(2)).sum()
    }

    /// Errors in each unit that is held out, without an explanation and with it, for engineers.
    fn held_out_errors(&self, of: &Explanation) -> String {
        let after = self.contributions(of).0;
        let recorded = self.inputs.scene.recorded();
        let mut units: BTreeMap<usize, (f64, f64, f64)> = BTreeMap::new();
        for row in self.inputs.left_out() {
            let sums = units.entry(self.inputs.unit[row]).or_default();
            sums.0 += 1.0;
            sums.1 += (recorded[row] - self.inputs.simulated[row]).powi(2);
            sums.2 += (recorded[row] - after[row]).powi(2);
        }
        let of_unit = |(unit, (rows, before, after)): (&usize, &(f64, f64, f64))| {
            format!("\nunit {unit}: {:.4} -> {:.4}", (before / rows).sqrt(), (after / rows).sqrt())
        };
        units.iter().map(of_unit).collect()
    }

    /// An explanation with some of its members only.
    pub(super) fn less(&self, of: &Explanation, kept: &[usize]) -> Explanation {
        let mut less = Explanation {
            members: kept.iter().map(|member| of.members[*member]).collect(),
            noise: of.noise,
            ln: of.ln,
            over_nothing: of.over_nothing,
            claims: kept.iter().map(|member| of.claims[*member].clone()).collect(),
            names: Vec::new(),
        };
        less.names = super::posterior::names(self.second, &less, self.naming);
        less
    }

    fn nothing(&self, ln: f64, debug: String) -> EvidenceAnswer {
        EvidenceAnswer {
            verdict: Verdict::NoMismatch,
            names: Vec::new(),
            rivals: Vec::new(),
            after: self.inputs.simulated.clone(),
            contributions: Vec::new(),
            remaining: Vec::new(),
            information: 0.0,
            existence: Existence {
                probability_of_nothing: ln.exp(),
                effective_rows: self.test.effective_rows,
                false_alarm_rate: THRESHOLDS.chance_max,
            },
            withdrawn: None,
            claimed: Vec::new(),
            drawn_over: None,
            noise: 0,
            debug,
        }
    }

    /// Verdict and names of a group that holds.
    fn named(
        &self,
        silent: EvidenceAnswer,
        best: &Explanation,
        groups: &[Group<'_>],
        information: f64,
    ) -> EvidenceAnswer {
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
            withdrawn: None,
            claimed: self.claimed(best),
            drawn_over: self.drawn_over(best),
            noise: best.noise,
            ..silent
        };
        if answer.names.is_empty() || unknown > THRESHOLDS.unknown_share {
            answer.leave_unnamed(groups, best.ln);
            return answer;
        }
        self.judge_names(&mut answer, (best, ln), groups);
        answer
    }

    fn claimed(&self, best: &Explanation) -> Vec<String> {
        let laws = best.claims.iter().flatten().flat_map(|claim| &claim.laws);
        laws.filter_map(|(law, _)| self.naming.kind(*law)).collect()
    }

    fn drawn_over(&self, best: &Explanation) -> Option<String> {
        let mut drawn = best.members.iter().filter_map(|(variant, _)| self.second.bank.variants[*variant].drawn());
        drawn.next().map(|drawn| drawn.over.clone())
    }

    /// Explained or ambiguous, and what stands beside the names.
    fn judge_names(&self, answer: &mut EvidenceAnswer, (best, ln): (&Explanation, f64), groups: &[Group<'_>]) {
        let mass = |name: &str| {
            let of = |g: &&Group<'_>| g.names.iter().any(|n| n.as_deref() == Some(name));
            groups.iter().filter(of).map(|g| g.ln.exp()).sum::<f64>()
        };
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
        if answer.verdict == Verdict::Explained {
            beside.retain(|(name, _)| mass(name) > 0.1);
        } else if beside.is_empty() {
            let sure: Vec<String> = answer.names.iter().filter(|name| sure_of_something && alone(name)).cloned().collect();
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
            let instead_of = unsure.unwrap_or_default();
            let rival = |(name, nats)| Rival { name, instead_of: instead_of.clone(), nats };
            answer.rivals = beside.into_iter().map(rival).collect();
            for other in class {
                if !answer.rivals.iter().any(|known| known.name == other.name) {
                    answer.rivals.push(other);
                }
            }
        }
    }

    /// Names whose law costs little in the place of a member.
    fn class(&self, answer: &mut EvidenceAnswer, best: &Explanation) -> Vec<Rival> {
        let (comparison, gram) = self.first;
        let variance = self.settings[best.noise].saturated.variance;
        let nats = 0.5 * comparison.tempering / variance;
        let mut class = Vec::new();
        let told = answer.contributions.iter().filter(|(name, _)| answer.names.contains(name));
        for (name, contribution) in &told.cloned().collect::<Vec<Named>>() {
            let (along, square) = self.naming.products(comparison, gram, contribution);
            let all = self.naming.stand_ins(&along, square, nats);
            answer.debug.push_str(&nearest_stand_ins(name, &all));
            let own = all.iter().find(|other| other.kind == *name).map_or(0.0, |own| own.nats.min(1.0));
            // The form of a curve that got its name by projection is not known better than to a tenth.
            let claimed = answer.claimed.contains(name);
            let near = |other: &StandIn| {
                let makes_curve = claimed && other.share >= THRESHOLDS.rival_share;
                let confused = are_confused(name, &other.kind);
                let nats = if confused { THRESHOLDS.rival_nats } else { THRESHOLDS.class_nats };
                other.nats < own + nats || makes_curve
            };
            let others = all.into_iter().filter(|other| !answer.names.contains(&other.kind) && near(other));
            class.extend(others.map(|other| Rival {
                name: other.kind,
                instead_of: name.clone(),
                nats: (other.nats - own).max(0.0),
            }));
        }
        class.sort_by(|a, b| a.nats.total_cmp(&b.nats).then_with(|| a.name.cmp(&b.name)));
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
        format!(
            "chance {:.3} effective rows {:.0} of {} noise {} ordinary {:.4}{}",
            self.test.chance,
            self.test.effective_rows,
            self.comparison.rows.len(),
            noises.join(" "),
            self.ordinary,
            all.join("")
        )
    }
}

impl EvidenceAnswer {
    /// Something real that no name explains; names that come near stand beside it.
    fn leave_unnamed(&mut self, groups: &[Group<'_>], ln: f64) {
        let mut near: Vec<(String, f64)> = self.names.iter().map(|name| (name.clone(), 0.0)).collect();
        for other in groups.iter().filter(|other| other.ln > ln - THRESHOLDS.beside) {
            for name in other.names.iter().flatten() {
                if !near.iter().any(|(known, _)| known == name) {
                    near.push((name.clone(), (ln - other.ln).max(0.0)));
                }
            }
        }
        self.rivals = Vec::new();
        self.names = Vec::new();
        self.unname(near);
    }

    /// Takes some names back: what they contribute has no name. Where little is left under names, or none, all are taken back.
    pub(super) fn refuse(&mut self, refused: &[String], energy: impl Fn(&[f64]) -> f64) {
        for all in [&mut self.contributions, &mut self.remaining] {
            let (gone, mut kept): (Vec<Named>, Vec<Named>) =
                std::mem::take(all).into_iter().partition(|(name, _)| refused.contains(name) || name == UNKNOWN);
            let rows = gone.first().map_or(0, |(_, x)| x.len());
            kept.push((UNKNOWN.to_owned(), sum_of(&gone, rows)));
            *all = kept;
        }
        let rows = self.remaining.first().map_or(0, |(_, x)| x.len());
        let whole = energy(&sum_of(&self.remaining, rows)).max(f64::MIN_POSITIVE);
        let unknown = self.remaining.iter().find(|(name, _)| name == UNKNOWN).map_or(0.0, |(_, x)| energy(x));
        self.names.retain(|name| !refused.contains(name));
        if self.names.is_empty() || unknown > THRESHOLDS.unknown_share * whole {
            self.unname(Vec::new());
        }
    }

    /// Takes the names back: they and these others stand beside something without a name.
    pub(super) fn unname(&mut self, others: Vec<(String, f64)>) {
        let names = std::mem::take(&mut self.names).into_iter().map(|name| (name, 0.0));
        let rivals = std::mem::take(&mut self.rivals).into_iter().map(|rival| (rival.name, rival.nats));
        let mut near: Vec<(String, f64)> = Vec::new();
        for (name, nats) in names.chain(rivals).chain(others).filter(|(name, _)| name != UNKNOWN) {
            if !near.iter().any(|(known, _)| *known == name) {
                near.push((name, nats));
            }
        }
        let rival = |(name, nats)| Rival { name, instead_of: UNKNOWN.to_owned(), nats };
        self.rivals = near.into_iter().map(rival).collect();
        self.names = vec![UNKNOWN.to_owned()];
        self.verdict = Verdict::Unexplained;
        for all in [&mut self.contributions, &mut self.remaining] {
            let rows = all.first().map_or(0, |(_, x)| x.len());
            *all = vec![(UNKNOWN.to_owned(), sum_of(all, rows))];
        }
    }
}

/// Does the catalogue say of one of two laws that it is confused with the other?
fn are_confused(a: &str, b: &str) -> bool {
    let says = |a: &str, b: &str| effect(a).is_some_and(|effect| effect.doc().rivals.contains(&b));
    says(a, b) || says(b, a)
}

/// The laws that come nearest to a contribution, for engineers.
fn nearest_stand_ins(name: &str, all: &[StandIn]) -> String {
    let mut near: Vec<&StandIn> = all.iter().collect();
    near.sort_by(|a, b| a.nats.total_cmp(&b.nats));
    let near = near.iter().take(6).map(|other| format!("{} {:.1} {:.2}", other.kind, other.nats, other.share));
    format!("\n{name}: {}", near.collect::<Vec<_>>().join(", "))
}

/// Names of an explanation; `unknown` where it has none.
fn names_of(of: &Explanation) -> Vec<String> {
    let names: Vec<String> = of.names.iter().flatten().cloned().collect();
    if names.is_empty() { vec![UNKNOWN.to_owned()] } else { names }
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
