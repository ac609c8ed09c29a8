//! One answer against one truth.

use crate::concealed::case::{Case, Expect, Hiding};
use crate::concealed::least_squares::{Basis, quantile};
use crate::concealed::score::answer::Answer;

/// What came of one case.
#[derive(Clone, Debug, Default)]
pub(crate) struct Outcome {
    pub(crate) group: String,
    pub(crate) label: String,
    pub(crate) truth: String,
    pub(crate) said: String,
    pub(crate) noise: String,
    /// The tool failed or broke the contract.
    pub(crate) broken: bool,
    pub(crate) reported: bool,
    /// It gave names, alone or as a class.
    pub(crate) gave_names: bool,
    /// One explanation, given as certain.
    pub(crate) certain: bool,
    /// First missing effect is the truth; with several hidden, all of them are among the missing.
    pub(crate) named: bool,
    /// Every hidden effect is among the missing and the alternatives.
    pub(crate) in_class: bool,
    /// Reported effects beyond the hidden ones.
    pub(crate) extra: usize,
    pub(crate) right: bool,
    /// Area under the curve for the 20 % most affected rows: as reported, and with both sides orthogonal to the model.
    pub(crate) auc: Option<f64>,
    pub(crate) auc_orthogonal: Option<f64>,
    pub(crate) onset_error_s: Option<f64>,
    pub(crate) onset_covered: Option<bool>,
    /// Share of the removable squared error on held-out rows that the new model removes.
    pub(crate) removed: Option<f64>,
    /// Error against the clean output on held-out rows, before and after, over the noise.
    pub(crate) before: Option<f64>,
    pub(crate) after: Option<f64>,
    /// Intervals that hold the true value, of those that can be checked.
    pub(crate) covered: (usize, usize),
    pub(crate) seconds: f64,
}

impl Outcome {
    /// Scores `answer`; an error of the tool counts as a wrong answer to everything.
    pub(crate) fn of(case: &Case, answer: &Result<Answer, String>) -> Self {
        let mut outcome = Self {
            group: case.group.clone(),
            label: format!("{}/{}", case.group, case.name),
            truth: truth(case),
            noise: case.noise.clone(),
            ..Self::default()
        };
        match answer {
            Err(error) => {
                outcome.broken = true;
                outcome.said = format!("FAILED {error}");
            }
            Ok(answer) => outcome.judge(case, answer),
        }
        outcome
    }

    fn judge(&mut self, case: &Case, answer: &Answer) {
        self.said = answer.summary();
        self.seconds = answer.seconds;
        self.reported = answer.reports();
        self.gave_names = answer.names();
        self.certain = answer.verdict == "explained";
        self.judge_names(case, answer);
        self.right = match case.expect {
            Expect::Named => self.named && self.gave_names,
            Expect::Class => !self.reported || (self.gave_names && self.in_class),
            Expect::Nothing => !self.reported,
            Expect::Unknown => answer.verdict == "unexplained",
            Expect::Near => !self.certain || answer.missing.iter().all(|m| near(case, &m.effect)),
        };
        self.judge_place(case, answer);
        self.judge_fit(case, answer);
        self.covered = coverage(case, answer);
    }

    fn judge_names(&mut self, case: &Case, answer: &Answer) {
        let missing: Vec<&str> = answer.missing.iter().map(|m| m.effect.as_str()).collect();
        let class = |h: &Hiding| {
            missing.iter().copied().chain(answer.alternatives.iter().map(String::as_str)).any(|name| accepts(h, name))
        };
        self.named = match case.hidden.as_slice() {
            [] => false,
            [one] if !case.injected() => missing.first().is_some_and(|name| accepts(one, name)),
            many => many.iter().all(|h| missing.iter().any(|name| accepts(h, name))),
        };
        self.in_class = !case.hidden.is_empty() && case.hidden.iter().all(class);
        self.extra = missing.iter().filter(|name| !case.hidden.iter().any(|h| accepts(h, name))).count();
    }

    fn judge_place(&mut self, case: &Case, answer: &Answer) {
        let claimed = match case.hidden.first().filter(|_| case.injected()) {
            Some(one) => answer.rows.filled(&format!("effect_{}", one.name)).unwrap_or_default(),
            None => answer.rows.effects(),
        };
        if !self.reported || case.hidden.iter().any(|h| h.contribution.len() != claimed.len()) || case.hidden.is_empty()
        {
            return;
        }
        let total = |part: fn(&Hiding) -> &Vec<f64>| sum(case.hidden.iter().map(part), claimed.len());
        self.auc = area(&claimed, &total(|h| &h.contribution));
        let left = Basis::of(&case.tangent).remainder(&claimed);
        self.auc_orthogonal = area(&left, &total(|h| &h.remainder));
        self.judge_onset(case, answer);
    }

    fn judge_onset(&mut self, case: &Case, answer: &Answer) {
        let Some(begin) = case.hidden.iter().find_map(|h| h.onset_row) else { return };
        let (rows, place) = (&answer.rows, |row: usize| row as f64);
        let error = |onset: &super::answer::Onset| {
            let found = nearest(rows, &onset.run, onset.time_s)?;
            let (low, high) = (nearest(rows, &onset.run, onset.low_s)?, nearest(rows, &onset.run, onset.high_s)?);
            Some(((place(found) - place(begin)).abs(), low <= begin + 1 && begin <= high + 1))
        };
        let best = answer.onsets.iter().filter_map(error).min_by(|a, b| a.0.total_cmp(&b.0));
        (self.onset_error_s, self.onset_covered) = (best.map(|b| b.0), best.map(|b| b.1));
    }

    fn judge_fit(&mut self, case: &Case, answer: &Answer) {
        let rows = &answer.rows;
        let (Some(before), Some(after)) = (rows.columns.get("simulated_before"), rows.columns.get("simulated_after"))
        else {
            return;
        };
        let wanted = |row: usize| answer.held_out_runs.contains(&rows.run[row]);
        let error = |column: &[Option<f64>]| {
            let rows = (0..case.clean.len().min(column.len())).filter(|row| wanted(*row));
            let errors: Vec<f64> = rows.filter_map(|row| column[row].map(|v| v - case.clean[row])).collect();
            (!errors.is_empty()).then(|| crate::concealed::least_squares::rms(&errors))
        };
        if let (Some(before), Some(after)) = (error(before), error(after)) {
            self.before = Some(before / case.noise_sd);
            self.after = Some(after / case.noise_sd);
            self.removed = (!case.hidden.is_empty()).then(|| 1.0 - (after / before).powi(2));
        }
    }
}

fn truth(case: &Case) -> String {
    let names: Vec<String> = case
        .hidden
        .iter()
        .map(|h| format!("{} [{}; rho {:.2}, absorbed {:.2}]", h.name, h.form, h.rho, h.absorbed))
        .collect();
    if names.is_empty() { "nothing".into() } else { names.join(" + ") }
}

/// Whether `name` follows the hidden effect as closely as the noise allows.
fn near(case: &Case, name: &str) -> bool {
    case.rivals.iter().any(|rival| rival.name == name && rival.evidence < crate::concealed::nearest::ENOUGH)
}

fn accepts(hidden: &Hiding, name: &str) -> bool {
    hidden.name == name || hidden.also.iter().any(|also| also == name)
}

fn sum<'a>(parts: impl Iterator<Item = &'a Vec<f64>>, len: usize) -> Vec<f64> {
    parts.fold(vec![0.0; len], |mut sum, part| {
        sum.iter_mut().zip(part).for_each(|(s, p)| *s += p);
        sum
    })
}

/// Row of the given run nearest to a time.
fn nearest(rows: &super::answer::Rows, run: &str, time_s: f64) -> Option<usize> {
    let of_run = (0..rows.run.len()).filter(|row| rows.run[*row] == run);
    of_run.min_by(|a, b| (rows.time_s[*a] - time_s).abs().total_cmp(&(rows.time_s[*b] - time_s).abs()))
}

/// Probability that a row among the 20 % most affected is claimed more strongly than another; ties count half.
pub(crate) fn area(claimed: &[f64], truth: &[f64]) -> Option<f64> {
    let size: Vec<f64> = truth.iter().map(|v| v.abs()).collect();
    let limit = quantile(&size, 0.8);
    let mut order: Vec<usize> = (0..claimed.len()).collect();
    order.sort_by(|a, b| claimed[*a].abs().total_cmp(&claimed[*b].abs()));
    let affected = |row: usize| size[row] > limit;
    let (mut ranks, mut count, mut start) = (0.0, 0usize, 0);
    while start < order.len() {
        let level = claimed[order[start]].abs();
        let end = start + order[start..].iter().take_while(|row| claimed[**row].abs() <= level).count().max(1);
        let hits = order[start..end].iter().filter(|row| affected(**row)).count();
        ranks += hits as f64 * ((start + end - 1) as f64 / 2.0);
        count += hits;
        start = end;
    }
    let others = claimed.len() - count;
    let least = count as f64 * (count as f64 - 1.0) / 2.0;
    (count > 0 && others > 0).then(|| (ranks - least) / (count as f64 * others as f64))
}

/// Parameters of the truth, and the estimates of the same effect that state the same quantity.
const SAME: [(&str, &[&str]); 8] = [
    ("inertia_kg_m2", &["inertia_kg_m2"]),
    ("lag_s", &["lag_s", "delay_s"]),
    ("delay_s", &["delay_s"]),
    ("level", &["level"]),
    ("weight", &["weight"]),
    ("gain", &["gain"]),
    ("exponent", &["exponent"]),
    ("mass_kg", &["mass_kg", "per_m_s2"]),
];

/// Intervals that hold the true value, of all that can be compared.
fn coverage(case: &Case, answer: &Answer) -> (usize, usize) {
    let mut covered = (0, 0);
    for hidden in &case.hidden {
        let Some(found) = answer.missing.iter().find(|m| accepts(hidden, &m.effect)) else { continue };
        for (name, value) in &hidden.parameters {
            let names = SAME.iter().find(|(own, _)| own == name).map_or(&[][..], |(_, names)| names);
            if let Some(e) = found.parameters.iter().find(|e| names.contains(&e.name.as_str())) {
                covered.1 += 1;
                covered.0 += usize::from(e.low <= *value && *value <= e.high);
            }
        }
    }
    covered
}
