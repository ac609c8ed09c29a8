//! From explanations to an answer: what is reported, with which names, and what it contributes where.

use super::decision::THRESHOLDS;
use super::gram::{Comparison, PARTS};
use super::inputs::Inputs;
use super::naming::Naming;
use super::posterior::{Explanation, Group, Setting, grouped};
use super::second::Second;
use super::bank::Since;
use crate::statistics::{count, rms};
use crate::twin::diagnosis::Verdict;
use std::collections::BTreeMap;

/// What has no name.
pub(super) const UNKNOWN: &str = "unknown";
/// Stretches over which errors are paired, s, and rows of one at least.
const PAIRED_S: f64 = 15.0;
const PAIRED_ROWS: f64 = 10.0;
/// Groups that are looked at.
const GROUPS: usize = 8;
/// Squared deviations gained from which a step is taken to have begun in a held-out run.
const BEGUN: f64 = 12.0;

/// Everything a judgement reads.
pub(super) struct Judge<'a> {
    pub(super) inputs: &'a Inputs<'a>,
    pub(super) comparison: &'a Comparison<'a>,
    pub(super) second: &'a Second,
    pub(super) settings: &'a [Setting],
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
pub(super) struct Answer {
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
    /// For engineers.
    pub(super) debug: String,
}

/// A contribution under a name.
type Named = (String, Vec<f64>);

impl Judge<'_> {
    /// The answer.
    pub(super) fn answer(&self, all: &[Explanation]) -> Answer {
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
            let gain = self.inner_gain(group.best);
            debug.push_str(&format!("\ninner {gain:.2}"));
            if gain > THRESHOLDS.inner_gain {
                return self.named(group, &groups, 2.0 * (group.ln - nothing), debug);
            }
        }
        self.nothing(format!("{debug}; inner parts gain nothing"))
    }

    fn nothing(&self, debug: String) -> Answer {
        Answer {
            verdict: Verdict::NoMismatch,
            names: Vec::new(),
            alternatives: Vec::new(),
            after: self.inputs.simulated.clone(),
            contributions: Vec::new(),
            remaining: Vec::new(),
            information: 0.0,
            debug,
        }
    }

    /// Verdict and names of a group that holds.
    fn named(&self, group: &Group<'_>, groups: &[Group<'_>], information: f64, debug: String) -> Answer {
        let (after, contributions) = self.contributions(group.best);
        let remaining: Vec<Named> =
            contributions.iter().map(|(name, x)| (name.clone(), self.remaining(x))).collect();
        let energy = |x: &[f64]| self.inputs.taken(false).map(|row| x[row] * x[row]).sum::<f64>();
        let sum = sum_of(&remaining, self.inputs.rows);
        let whole = energy(&sum).max(f64::MIN_POSITIVE);
        let share: BTreeMap<&str, f64> =
            remaining.iter().map(|(name, x)| (name.as_str(), energy(x) / whole)).collect();
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
        let mut answer = Answer {
            verdict: Verdict::Unexplained,
            names,
            alternatives: Vec::new(),
            after,
            contributions,
            remaining,
            information,
            debug,
        };
        if answer.names.is_empty() || unknown > THRESHOLDS.unknown_share {
            answer.leave_unnamed(groups, group.ln);
            return answer;
        }
        self.judge_names(&mut answer, group, groups);
        answer
    }

    /// Explained or ambiguous, and what stands beside the names.
    fn judge_names(&self, answer: &mut Answer, group: &Group<'_>, groups: &[Group<'_>]) {
        let mass = |name: &str| {
            let of = |g: &&Group<'_>| g.names.iter().any(|n| n.as_deref() == Some(name));
            groups.iter().filter(of).map(|g| g.ln.exp()).sum::<f64>()
        };
        let alone = |name: &String| mass(name) >= THRESHOLDS.alone;
        let mut beside: Vec<String> = Vec::new();
        for other in groups.iter().filter(|other| other.ln > group.ln - THRESHOLDS.beside) {
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
                answer.leave_unnamed(groups, group.ln);
                return;
            }
            answer.names = sure;
            answer.verdict = Verdict::Explained;
        }
        let class = self.class(answer, group);
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
    fn class(&self, answer: &Answer, group: &Group<'_>) -> Vec<(String, String)> {
        let (comparison, gram) = self.first;
        let variance = self.settings[group.best.noise].saturated.variance;
        let nats = 0.5 * comparison.tempering / variance;
        let mut class = Vec::new();
        for (name, contribution) in &answer.contributions {
            if !answer.names.contains(name) {
                continue;
            }
            let (along, square) = self.naming.products(comparison, gram, contribution);
            let all = self.naming.stand_ins(&along, square, nats);
            let own = all.iter().find(|(kind, _)| kind == name).map_or(0.0, |(_, loss)| loss.min(1.0));
            let others = all.into_iter().filter(|(kind, loss)| {
                !answer.names.contains(kind) && *loss < own + THRESHOLDS.class_nats
            });
            class.extend(others.map(|(kind, _)| (kind, name.clone())));
        }
        class.sort();
        class
    }

    /// The output with what an explanation adds, and each name's contribution.
    pub(super) fn contributions(&self, of: &Explanation) -> (Vec<f64>, Vec<Named>) {
        let setting = &self.settings[of.noise];
        let solved = self.comparison.solve(&setting.gram.whole, setting.saturated.variance, &of.members);
        let mut after = self.inputs.simulated.clone();
        for (index, w) in solved.tangents.iter().enumerate() {
            let tangent = self.comparison.tangent(index);
            after.iter_mut().zip(tangent).for_each(|(sum, x)| *sum += w * x);
        }
        let mut all: Vec<Named> = Vec::new();
        let mut put = |name: String, x: Vec<f64>| match all.iter_mut().find(|(known, _)| *known == name) {
            Some((_, sum)) => sum.iter_mut().zip(&x).for_each(|(sum, x)| *sum += x),
            None => all.push((name, x)),
        };
        let mut steps = Vec::new();
        let mut shared: Vec<(usize, Vec<f64>)> = Vec::new();
        for (at, (variant, _)) in of.members.iter().enumerate() {
            let variant = &self.second.bank.variants[*variant];
            let x = self.second.bank.contribution(variant, &solved.members[at]);
            match (variant.kind(), &of.claims[at]) {
                (Some(kind), _) => {
                    if let Some(Since::Run(run)) = variant.since {
                        steps.push((kind.to_owned(), run));
                    }
                    put(kind.to_owned(), x);
                }
                (None, None) => put(UNKNOWN.to_owned(), x),
                (None, Some(_)) => shared.push((at, x)),
            }
        }
        self.put_claimed(of, shared, &mut put);
        after = self.sum_with(after, &all);
        for (kind, run) in steps {
            self.begin_earlier(&kind, run, &mut after, &mut all);
        }
        (after, all)
    }

    fn sum_with(&self, mut after: Vec<f64>, all: &[Named]) -> Vec<f64> {
        for (_, x) in all {
            after.iter_mut().zip(x).for_each(|(sum, x)| *sum += x);
        }
        after
    }

    /// A claimed curve goes to its names by the regression; what that leaves of it goes to the larger.
    fn put_claimed(&self, of: &Explanation, shared: Vec<(usize, Vec<f64>)>, put: &mut impl FnMut(String, Vec<f64>)) {
        let mut done: Vec<usize> = Vec::new();
        for (at, _) in &shared {
            let Some(claim) = of.claims[*at].as_ref().filter(|_| !done.contains(at)) else { continue };
            // Curves that were claimed together are split together.
            let same = |other: &usize| of.claims[*other].as_ref().is_some_and(|c| c.laws == claim.laws);
            let together: Vec<&(usize, Vec<f64>)> = shared.iter().filter(|(other, _)| same(other)).collect();
            let mut left = vec![0.0; self.inputs.rows];
            for (other, x) in together {
                done.push(*other);
                left.iter_mut().zip(x).for_each(|(sum, x)| *sum += x);
            }
            let parts: Vec<Vec<f64>> = claim.laws.iter().map(|law| self.naming.contribution(law)).collect();
            for part in &parts {
                left.iter_mut().zip(part).for_each(|(left, x)| *left -= x);
            }
            let largest = (0..parts.len()).max_by(|a, b| rms(&parts[*a]).total_cmp(&rms(&parts[*b])));
            for (number, mut part) in parts.into_iter().enumerate() {
                if Some(number) == largest {
                    part.iter_mut().zip(&left).for_each(|(sum, x)| *sum += x);
                }
                put(self.naming.kind(claim.laws[number].0).unwrap_or_default(), part);
            }
        }
    }

    /// A level that begins with a run may have begun in the held-out runs before it: their own earlier rows tell.
    fn begin_earlier(&self, kind: &str, run: usize, after: &mut [f64], all: &mut [Named]) {
        let inputs = self.inputs;
        let law = if kind == "hardness_batch" { inputs.cut.as_ref() } else { Some(&inputs.simulated) };
        let (Some(law), Some((_, own))) = (law, all.iter_mut().find(|(name, _)| name == kind)) else { return };
        let later = || (0..inputs.rows).filter(|row| inputs.run[*row] >= run);
        let height = later().map(|row| own[row]).sum::<f64>() / (later().map(|row| law[row]).sum::<f64>() + 1e-30);
        for earlier in (0..run).rev() {
            let rows = inputs.scene.runs()[earlier].clone();
            if rows.clone().any(|row| inputs.fitted[row]) {
                break;
            }
            let mut gained = 0.0;
            for row in rows {
                let step = height * law[row];
                let before = after[row];
                if gained > BEGUN {
                    own[row] += step;
                    after[row] += step;
                }
                if inputs.comparable[row] {
                    let error = self.recorded[row] - before;
                    gained += (error * error - (error - step).powi(2)) / self.ordinary.powi(2);
                }
            }
        }
    }

    /// What the baseline cannot imitate of a contribution.
    pub(super) fn remaining(&self, x: &[f64]) -> Vec<f64> {
        let rows: Vec<usize> = self.inputs.taken(false).collect();
        let sizes: Vec<f64> = self.tangents.iter().map(|t| rms(t) + 1e-30).collect();
        let scaled = self.tangents.iter().zip(&sizes);
        let columns: Vec<Vec<f64>> = scaled.map(|(t, size)| rows.iter().map(|row| t[*row] / size).collect()).collect();
        let wanted: Vec<f64> = rows.iter().map(|row| x[*row]).collect();
        let w = crate::twin::linear::least_squares(&columns, &wanted).coefficients;
        let mut left = x.to_vec();
        for ((tangent, size), w) in self.tangents.iter().zip(&sizes).zip(&w) {
            left.iter_mut().zip(tangent).for_each(|(left, t)| *left -= w * t / size);
        }
        left
    }

    /// By how much an explanation whose sizes come from the other inner parts lowers the error in each, in the metric of
    /// the noise: the paired sum over stretches in units of its own deviation.
    fn inner_gain(&self, of: &Explanation) -> f64 {
        let setting = &self.settings[of.noise];
        let variance = setting.saturated.variance;
        let mut before = vec![0.0; self.inputs.rows];
        let mut after = vec![0.0; self.inputs.rows];
        for part in 0..PARTS {
            let others = &setting.gram.whole - &setting.gram.parts[part];
            let with = self.comparison.solve(&others, variance, &of.members);
            let without = self.comparison.solve(&others, variance, &[]);
            for row in self.comparison.part_rows(part) {
                let base = |w: &[f64]| {
                    let tangents = w.iter().enumerate().map(|(index, w)| w * self.comparison.tangent(index)[row]);
                    self.inputs.simulated[row] + tangents.sum::<f64>()
                };
                let members = of.members.iter().zip(&with.members);
                let added: f64 = members.map(|((variant, _), w)| self.value(*variant, w, row)).sum();
                before[row] = self.recorded[row] - base(&without.tangents);
                after[row] = self.recorded[row] - base(&with.tangents) - added;
            }
        }
        self.paired(&before, &after, setting.gram.noise)
    }

    /// The paired gain of one residual over another.
    fn paired(&self, before: &[f64], after: &[f64], noise: super::noise::Noise) -> f64 {
        let (before, after) = (self.comparison.whitened(before, noise), self.comparison.whitened(after, noise));
        let stretch = (PAIRED_S / self.inputs.period_s).round().max(PAIRED_ROWS);
        let mut gained: BTreeMap<usize, f64> = BTreeMap::new();
        for ((row, before), after) in self.comparison.rows.iter().zip(&before).zip(&after) {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a count of rows")]
            let number = (count(*row) / stretch) as usize;
            *gained.entry(number).or_default() += before * before - after * after;
        }
        let sum: f64 = gained.values().sum();
        let squares: f64 = gained.values().map(|x| x * x).sum();
        sum / (squares.sqrt() + 1e-30)
    }

    fn value(&self, variant: usize, w: &[f64], row: usize) -> f64 {
        let columns = &self.second.bank.columns[self.second.bank.variants[variant].columns.clone()];
        columns.iter().zip(w).map(|(column, w)| w * column[row]).sum()
    }

    fn debug(&self, groups: &[Group<'_>]) -> String {
        let member = |(variant, size): &(usize, usize)| {
            let of = &self.second.bank.variants[*variant];
            format!("{} [{}] {}", of.kind().unwrap_or("?"), of.label, super::evidence::SIZES[*size])
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

impl Answer {
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
