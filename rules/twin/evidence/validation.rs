//! From explanations to an answer: what is reported, with which names, and what it contributes where.

use super::answer::{EvidenceAnswer, Withdrawn, sum_contributions};
use super::cross_validation::{Inner, sum_paired_gains};
use super::existence::ExistenceTest;
use super::gram::{Comparison, Gram};
use super::inputs::RecordingInputs;
use super::naming::Naming;
use super::posterior::{Explanation, Group, NoiseSetting, group_by_names};
use super::second_stage::SecondStage;
use super::thresholds::THRESHOLDS;
use crate::diagnosis::{Existence, UNKNOWN, Verdict};
use numerics::statistics::count_to_f64;
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
    /// Noise of each row relative to the ordinary one.
    pub(super) scale: &'a [f64],
    /// Deviation of the ordinary noise.
    pub(super) ordinary: f64,
    /// The first-stage comparison, whose laws stand in for one another, with the Gram matrix of the likeliest noise.
    pub(super) first_stage: (&'a Comparison<'a>, &'a Gram),
    /// Whether anything is there.
    pub(super) test: ExistenceTest,
}

/// What an explanation gains in rows that took no part in its sizes, in deviations of the gain.
struct Prediction {
    held_out: f64,
    together: f64,
}

impl Judge<'_> {
    pub(super) fn decide_answer(&self, all: &[Explanation]) -> EvidenceAnswer {
        let groups = group_by_names(all);
        let nothing = groups.iter().find(|group| group.names.is_empty()).map_or(-60.0, |group| group.ln);
        let mut answer = self.build_null_answer(nothing, self.format_debug_text(&groups));
        if self.test.chance > THRESHOLDS.chance_max {
            return answer;
        }
        let named = || groups.iter().filter(|group| !group.names.is_empty());
        let Some(first) = named().next() else { return answer };
        let near = named().take(GROUPS).take_while(|group| group.ln > first.ln - THRESHOLDS.looked_at);
        answer.verdict = Verdict::CannotTell;
        let found = list_names(first.best);
        answer.withdrawn = Some(Withdrawn { found, among_fitted: true, errors: None });
        if nothing.exp() >= THRESHOLDS.nothing_max {
            answer.debug.push_str("\nnothing is not improbable");
            return answer;
        }
        for group in near {
            let (of, kept, gain) = self.cross_validate_group(group);
            answer.debug.push_str(&format!("\ninner {gain:.2} keeps {} of {}", kept.len(), of.members.len()));
            if kept.is_empty() || gain <= THRESHOLDS.inner_gain {
                continue;
            }
            let held = self.restrict_explanation(of, &kept);
            let own = self.compute_unabsorbed_share(&held);
            if own < THRESHOLDS.own_share {
                answer.debug.push_str(&format!("\nthe baseline leaves {own:.5}"));
                continue;
            }
            match self.check_held_out_error(held.clone()) {
                Ok(best) => {
                    let lost = best.members.len() < kept.len();
                    return self.report_explanation(answer, &best, &groups, lost);
                }
                Err(withdrawn) => {
                    let told = self.measure_prediction(&held);
                    answer.debug.push_str(&format!("\npredicts {:.2} held out {:.2}", told.together, told.held_out));
                    answer.debug.push_str(&self.format_held_out_errors(&held));
                    answer.withdrawn = Some(withdrawn);
                }
            }
            break;
        }
        answer
    }

    /// What is told of an explanation that holds; `lost` where rows held out took a part of it away.
    fn report_explanation(
        &self,
        silent: EvidenceAnswer,
        best: &Explanation,
        groups: &[Group<'_>],
        lost: bool,
    ) -> EvidenceAnswer {
        let mut answer = self.decide_names(silent, best, groups, 2.0 * best.over_nothing);
        if lost && answer.verdict == Verdict::Explained {
            // What explained most did not carry over: what is left of it has no sure name.
            answer.debug.push_str("; withdrawn in part");
            answer.mark_unexplained(groups, best.ln);
        }
        answer
    }

    /// Share of the energy of all contributions that the baseline cannot imitate.
    fn compute_unabsorbed_share(&self, of: &Explanation) -> f64 {
        let energy = |x: &[f64]| self.inputs.fitted_rows(false).map(|row| x[row] * x[row]).sum::<f64>();
        let contributions = self.compute_contributions(of).1;
        let each: f64 = contributions.iter().map(|(_, x)| energy(x)).sum();
        energy(&self.project_out_baseline(&sum_contributions(&contributions, self.inputs.rows)))
            / each.max(f64::MIN_POSITIVE)
    }

    /// Of a group the explanation that carries over better, with drawn curves or by laws alone; its members that do, and what
    /// they gain.
    fn cross_validate_group<'g>(&self, group: &Group<'g>) -> (&'g Explanation, Vec<usize>, f64) {
        let (kept, gain) = self.cross_validate_members(group.best);
        if let Some(by_law) = group.by_law {
            let (law_kept, law_gain) = self.cross_validate_members(by_law);
            let whole = law_kept.len() == by_law.members.len();
            if whole && (law_gain > gain || kept.len() < group.best.members.len()) {
                return (by_law, law_kept, law_gain);
            }
        }
        (group.best, kept, gain)
    }

    /// The members that carry over to fitted units which took no part in their sizes, and what they gain there together.
    fn cross_validate_members(&self, of: &Explanation) -> (Vec<usize>, f64) {
        let inner = Inner::new(self.inputs, self.comparison, &self.settings[of.noise], &of.members);
        let all: Vec<usize> = (0..of.members.len()).collect();
        let without = |gone: usize| all.iter().copied().filter(|member| *member != gone).collect::<Vec<_>>();
        let costs = |member: &usize| inner.compute_gain(&all, &without(*member)).0 < THRESHOLDS.member_loss;
        let kept = if all.iter().any(costs) { find_best_subset(&inner, &all) } else { all };
        let gain = inner.compute_gain(&kept, &[]).0;
        (kept, gain)
    }

    /// Rows that took no part only withdraw: as long as their error does not fall noticeably, the member goes whose absence leaves the
    /// least. An error where nothing is left.
    fn check_held_out_error(&self, mut best: Explanation) -> Result<Explanation, Withdrawn> {
        let before = self.sum_held_out_squares(&self.inputs.simulated);
        let after = |of: &Explanation| self.sum_held_out_squares(&self.compute_contributions(of).0);
        if before <= 0.0 {
            return Ok(best);
        }
        let found = list_names(&best);
        let mut left = after(&best);
        let enough = (1.0 - THRESHOLDS.held_out_square) * before;
        while left >= enough || self.measure_prediction(&best).together < THRESHOLDS.predicted {
            let size = best.members.len();
            let without = |gone: usize| {
                let kept: Vec<usize> = (0..size).filter(|member| *member != gone).collect();
                let less = self.restrict_explanation(&best, &kept);
                (after(&less), less)
            };
            let all = (0..size).filter(|_| size > 1).map(without);
            let Some(fewer) = all.min_by(|a, b| a.0.total_cmp(&b.0)) else {
                let rows = count_to_f64(self.inputs.held_out_rows().count());
                let errors = Some(((before / rows).sqrt(), (left / rows).sqrt()));
                return Err(Withdrawn { found, among_fitted: false, errors });
            };
            (left, best) = fewer;
        }
        Ok(best)
    }

    /// Does an explanation predict rows that took no part in its sizes better than chance does: those of the inner parts and
    /// those held out together, each in deviations of its own gain (Stouffer's sum)?
    fn measure_prediction(&self, of: &Explanation) -> Prediction {
        let inner = Inner::new(self.inputs, self.comparison, &self.settings[of.noise], &of.members);
        let all: Vec<usize> = (0..of.members.len()).collect();
        let among_fitted = inner.compute_gain(&all, &[]).0;
        let held_out = self.compute_held_out_gain(of);
        Prediction { held_out, together: (among_fitted + held_out) / std::f64::consts::SQRT_2 }
    }

    /// Paired deviation of what an explanation gains in rows that are held out, in the metric of the noise.
    fn compute_held_out_gain(&self, of: &Explanation) -> f64 {
        let rows: Vec<usize> = self.inputs.held_out_rows().collect();
        let blocks = self.inputs.list_unbroken_stretches(&rows);
        let noise = self.comparison.convert_noise_to_rows(self.settings[of.noise].gram.noise);
        let white = |total: &[f64]| {
            let mut left: Vec<f64> =
                rows.iter().map(|row| (self.recorded[*row] - total[*row]) / self.scale[*row]).collect();
            noise.whiten_column(&mut left, &blocks);
            left
        };
        let (before, after) = (white(&self.inputs.simulated), white(&self.compute_contributions(of).0));
        let gains = before.iter().zip(&after).map(|(before, after)| before * before - after * after);
        sum_paired_gains(self.inputs.period_s, rows.iter().copied().zip(gains)).0
    }

    fn sum_held_out_squares(&self, total: &[f64]) -> f64 {
        let recorded = self.inputs.scene.recorded_output();
        self.inputs.held_out_rows().map(|row| (recorded[row] - total[row]).powi(2)).sum()
    }

    /// Errors in each unit that is held out, without an explanation and with it, for engineers.
    fn format_held_out_errors(&self, of: &Explanation) -> String {
        let after = self.compute_contributions(of).0;
        let recorded = self.inputs.scene.recorded_output();
        let mut units: BTreeMap<usize, (f64, f64, f64)> = BTreeMap::new();
        for row in self.inputs.held_out_rows() {
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
    pub(super) fn restrict_explanation(&self, of: &Explanation, kept: &[usize]) -> Explanation {
        let mut less = Explanation {
            members: kept.iter().map(|member| of.members[*member]).collect(),
            noise: of.noise,
            ln: of.ln,
            over_nothing: of.over_nothing,
            claims: kept.iter().map(|member| of.claims[*member].clone()).collect(),
            names: Vec::new(),
        };
        less.names = super::posterior::derive_names(self.second, &less, self.naming);
        less
    }

    fn build_null_answer(&self, ln: f64, debug: String) -> EvidenceAnswer {
        EvidenceAnswer {
            verdict: Verdict::NoMismatch,
            names: Vec::new(),
            rivals: Vec::new(),
            after: self.inputs.simulated.clone(),
            contributions: Vec::new(),
            remaining: Vec::new(),
            information: 0.0,
            probabilities: BTreeMap::new(),
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

    fn format_debug_text(&self, groups: &[Group<'_>]) -> String {
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

/// Names of an explanation; `unknown` where it has none.
fn list_names(of: &Explanation) -> Vec<String> {
    let names: Vec<String> = of.names.iter().flatten().cloned().collect();
    if names.is_empty() { vec![UNKNOWN.to_owned()] } else { names }
}

/// Of all sets of members the one that gains most in units that took no part in its sizes.
fn find_best_subset(inner: &Inner<'_>, all: &[usize]) -> Vec<usize> {
    let sets = (1_usize..1 << all.len())
        .map(|bits| all.iter().copied().filter(|member| bits >> member & 1 == 1).collect::<Vec<_>>());
    let gained = sets.map(|set| (inner.compute_gain(&set, &[]).1, set));
    gained.max_by(|a, b| a.0.total_cmp(&b.0)).map_or_else(Vec::new, |(_, set)| set)
}
