//! Tables from outcomes.

use std::collections::BTreeMap;

use crate::concealed::least_squares::quantile;
use crate::concealed::score::outcome::Outcome;

/// A share of `of`, as a whole percentage; a dash when there is nothing to take a share of.
fn percent(part: usize, of: usize) -> String {
    if of == 0 { "-".into() } else { format!("{:.0}", 100.0 * part as f64 / of as f64) }
}

fn number(values: &[f64], fraction: f64, decimals: usize) -> String {
    if values.is_empty() { "-".into() } else { format!("{:.decimals$}", quantile(values, fraction)) }
}

/// Outcomes by group, in the order of the names.
pub(crate) fn by_group(outcomes: &[Outcome]) -> BTreeMap<&str, Vec<&Outcome>> {
    let mut groups: BTreeMap<&str, Vec<&Outcome>> = BTreeMap::new();
    for outcome in outcomes {
        groups.entry(&outcome.group).or_default().push(outcome);
    }
    groups
}

/// Counts of one set of outcomes.
pub(crate) struct Tally<'a>(pub(crate) &'a [&'a Outcome]);

impl Tally<'_> {
    pub(crate) fn count(&self, test: impl Fn(&Outcome) -> bool) -> usize {
        self.0.iter().filter(|o| test(o)).count()
    }

    /// Share for which `test` holds; 0 for no outcomes.
    pub(crate) fn share(&self, test: impl Fn(&Outcome) -> bool) -> f64 {
        self.count(test) as f64 / self.0.len().max(1) as f64
    }

    pub(crate) fn values(&self, value: impl Fn(&Outcome) -> Option<f64>) -> Vec<f64> {
        self.0.iter().filter_map(|o| value(o)).collect()
    }

    fn row(&self, name: &str) -> String {
        let n = self.0.len();
        let named = self.count(|o| o.gave_names);
        let removed = self.values(|o| o.removed);
        let seconds = self.values(|o| Some(o.seconds));
        let onset = self.values(|o| o.onset_error_s);
        format!(
            "| {name} | {n} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
            percent(self.count(|o| o.right), n),
            percent(self.count(|o| o.named && o.gave_names), n),
            percent(self.count(|o| o.gave_names && o.in_class), named),
            percent(self.count(|o| o.certain && !o.named), n),
            percent(self.count(|o| !o.reported), n),
            self.count(|o| o.broken),
            self.0.iter().map(|o| o.extra).sum::<usize>(),
            number(&self.values(|o| o.auc), 0.5, 2),
            number(&self.values(|o| o.auc_orthogonal), 0.5, 2),
            number(&onset, 0.5, 0),
            number(&self.values(|o| o.before), 0.5, 2),
            number(&self.values(|o| o.after), 0.5, 2),
            number(&removed, 0.5, 3),
            number(&removed, 0.25, 3),
            number(&seconds, 0.5, 2),
        ) + format!(" {} |", number(&seconds, 1.0, 2)).as_str()
    }
}

/// The table of all groups.
pub(crate) fn table(outcomes: &[Outcome]) -> String {
    let mut text = String::from(
        "| group | n | right % | named % | truth in class % of named | sure and wrong % | silent % | failed | extra names | \
         AUC | AUC orth. | onset rows | error before / noise | after | removed p50 | p25 | s p50 | s max |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for (group, outcomes) in by_group(outcomes) {
        text += &Tally(&outcomes).row(group);
        text.push('\n');
    }
    text
}

/// Naming by hidden effect over all groups that expect a name.
pub(crate) fn by_effect(outcomes: &[Outcome]) -> String {
    let mut effects: BTreeMap<String, Vec<&Outcome>> = BTreeMap::new();
    for outcome in outcomes.iter().filter(|o| o.group.contains("single") || o.group.starts_with("drive-rho")) {
        let form = outcome.truth.split(';').next().unwrap_or_default().to_string() + "]";
        effects.entry(form).or_default().push(outcome);
    }
    let mut text = String::from(
        "| effect and form | n | named % | in class % of named | silent % | sure and wrong % | removed p50 |\n|---|---|---|---|---|---|---|\n",
    );
    for (effect, outcomes) in effects {
        let tally = Tally(&outcomes);
        let (n, gave) = (outcomes.len(), tally.count(|o| o.gave_names));
        text += &format!(
            "| {effect} | {n} | {} | {} | {} | {} | {} |\n",
            percent(tally.count(|o| o.named && o.gave_names), n),
            percent(tally.count(|o| o.gave_names && o.in_class), gave),
            percent(tally.count(|o| !o.reported), n),
            percent(tally.count(|o| o.certain && !o.named), n),
            number(&tally.values(|o| o.removed), 0.5, 3),
        );
    }
    text
}

/// Every answer that was not right: truth, what was said, and how to have the case again.
pub(crate) fn failures(outcomes: &[Outcome]) -> String {
    let mut wrong: Vec<&Outcome> = outcomes.iter().filter(|o| !o.right).collect();
    wrong.sort_by(|a, b| a.label.cmp(&b.label));
    wrong.iter().map(|o| format!("{} ({}): {} -> {}\n", o.label, o.noise, o.truth, o.said)).collect()
}
