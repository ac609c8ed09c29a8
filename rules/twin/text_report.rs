//! The whole diagnosis in plain words for standard output, in English or Chinese.

use super::diagnosis::{Alternative, Diagnosis, Fits, Missing, ParameterEstimate, Shift, Verdict};
use super::plan::list_experiment_kinds;
use super::region::Region;
pub use adapter_core::channel::quantity::space_unit;
use physics::explain::Language;
use physics::find_effect;
use std::fmt::Write as _;

/// Spans that are listed; the JSON holds all of them.
const SPANS_SHOWN: usize = 6;
/// Odds beyond which a number says no more.
const ODDS_MAX: f64 = 1000.0;
/// Odds below which two explanations are told to be about as likely.
const ODDS_MIN: f64 = 1.5;

/// The report for a person, in one language.
#[must_use]
pub fn format_report(diagnosis: &Diagnosis, language: Language) -> String {
    let say = Say { language, unit: &diagnosis.unit };
    let mut text = say.format_headline(diagnosis);
    let sections = [
        (("Where", "位置"), say.list_regions(diagnosis)),
        (("What is missing", "缺少的物理效应"), say.list_missing_effects(diagnosis)),
        (("How much better", "改进程度"), diagnosis.fit.as_ref().map(|fit| say.describe_fit(fit)).unwrap_or_default()),
        (("How sure", "可信程度"), say.describe_certainty(diagnosis)),
        (("Parameters that had been bent", "被扭曲的参数"), say.list_shifts(diagnosis)),
        (("What to do next", "下一步"), say.describe_next_step(diagnosis)),
        (("Quality of the recording", "数据质量"), say.list_faults(diagnosis)),
    ];
    for ((en, zh), lines) in sections {
        if !lines.is_empty() {
            let _ = writeln!(text, "\n{}", language.select_text(en, zh));
            lines.iter().for_each(|line| text.push_str(&format!("  {line}\n")));
        }
    }
    text
}

/// A number with four significant digits, plain where it is readable.
#[must_use]
pub fn format_short_number(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return x.to_string();
    }
    let magnitude = x.abs().log10().floor();
    if !(-4.0..6.0).contains(&magnitude) {
        return format!("{x:.3e}");
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and 7")]
    let decimals = (3.0 - magnitude).clamp(0.0, 7.0) as usize;
    let text = format!("{x:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// The same with a plus before a positive number.
#[must_use]
pub fn format_signed_number(x: f64) -> String {
    let sign = if x > 0.0 { "+" } else { "" };
    format!("{sign}{}", format_short_number(x))
}

struct Say<'a> {
    language: Language,
    unit: &'a str,
}

impl Say<'_> {
    /// The name of an effect: its kind, which `effects show` takes, and what it is called.
    fn describe_effect(&self, kind: &str) -> String {
        let Some(effect) = find_effect(kind) else {
            return if kind.starts_with("unknown") {
                self.language.select_text("unknown", "未知效应").to_owned()
            } else {
                kind.to_owned()
            };
        };
        format!("{} ({kind})", effect.doc().texts(self.language).name)
    }

    fn format_headline(&self, diagnosis: &Diagnosis) -> String {
        let summary = self.language.select_text(&diagnosis.summary.en, &diagnosis.summary.zh);
        format!("{}{}{summary}\n", diagnosis.verdict.describe(self.language), self.language.select_text(": ", "："))
    }

    fn list_regions(&self, diagnosis: &Diagnosis) -> Vec<String> {
        diagnosis.mismatch.iter().flat_map(|region| self.describe_region(region)).collect()
    }

    fn describe_region(&self, region: &Region) -> Vec<String> {
        let (share, amount) = (100.0 * region.share, region.describe_amount(self.language, self.unit));
        let place: Vec<String> = region.conditions.iter().map(|condition| condition.describe(self.language)).collect();
        let place = match place.is_empty() {
            true => self.language.select_text("everywhere", "所有工况").to_owned(),
            false => place.join(self.language.select_text(" and ", "，且")),
        };
        let mut lines = vec![self.language.select_text(
            format!("{place}: {share:.0} % of it, {amount}"),
            format!("{place}：占{share:.0} %，{amount}"),
        )];
        if let Some(onset) = &region.onset {
            let (run, at, low, high) = (&onset.run, onset.time_s, onset.low_s, onset.high_s);
            lines.push(self.language.select_text(
                format!("since run {run} at {at:.0} s (between {low:.0} and {high:.0} s)"),
                format!("始于批次{run}的{at:.0} s（{low:.0}至{high:.0} s之间）"),
            ));
        }
        lines.push(self.describe_spans(region));
        lines
    }

    fn describe_spans(&self, region: &Region) -> String {
        let shown: Vec<String> = region.spans.iter().take(SPANS_SHOWN).map(|span| self.describe_span(span)).collect();
        let shown = shown.join(self.language.select_text("; ", "；"));
        let more = region.spans.len().saturating_sub(SPANS_SHOWN);
        if more == 0 {
            return shown;
        }
        self.language.select_text(format!("{shown}; and {more} more stretches"), format!("{shown}；另有{more}段"))
    }

    fn describe_span(&self, span: &super::region::Span) -> String {
        let (run, from_s, to_s) = (&span.run, span.from_s, span.to_s);
        self.language.select_text(
            format!("run {run}, {from_s:.0} to {to_s:.0} s"),
            format!("批次{run}，{from_s:.0}至{to_s:.0} s"),
        )
    }

    fn list_missing_effects(&self, diagnosis: &Diagnosis) -> Vec<String> {
        diagnosis.missing.iter().flat_map(|missing| self.describe_missing_effect(missing)).collect()
    }

    fn describe_missing_effect(&self, missing: &Missing) -> Vec<String> {
        let statement = match (self.language, find_effect(&missing.effect)) {
            (Language::Zh, Some(effect)) => effect.doc().zh.statement,
            (Language::Zh, None) => "效应库中没有能解释它的效应，仅描述其形状",
            (Language::En, _) => missing.statement.as_str(),
        };
        let mut lines = vec![format!("{}: {statement}", self.describe_effect(&missing.effect))];
        lines.push(format!("  {}", missing.equation));
        if let Some(reason) = &missing.not_predictable {
            lines.push(format!("  {}", self.language.select_text(&reason.en, &reason.zh)));
        }
        lines.extend(missing.parameters.iter().map(|parameter| format!("  {}", self.describe_estimate(parameter))));
        lines
    }

    fn describe_estimate(&self, estimate: &ParameterEstimate) -> String {
        let (name, unit) = (&estimate.name, space_unit(&estimate.unit));
        let value = format_short_number(estimate.value);
        let (Some(low), Some(high)) = (estimate.low.map(format_short_number), estimate.high.map(format_short_number))
        else {
            return self.language.select_text(
                format!("{name} = {value}{unit} (interval not computed)"),
                format!("{name} = {value}{unit}（未计算区间）"),
            );
        };
        self.language.select_text(
            format!("{name} = {value}{unit} (95 % between {low} and {high})"),
            format!("{name} = {value}{unit}（95 %区间{low}至{high}）"),
        )
    }

    fn describe_fit(&self, fit: &Fits) -> Vec<String> {
        let unit = space_unit(self.unit);
        let arrow = |before: f64, after: f64| {
            format!("{} -> {}{unit}", format_short_number(before), format_short_number(after))
        };
        let mut lines = Vec::new();
        if let (Some(before), Some(after)) = (fit.before.held_out_rmse, fit.after.held_out_rmse) {
            let (pair, runs) = (arrow(before, after), fit.held_out_runs.join(", "));
            lines.push(self.language.select_text(
                format!("error on runs that took no part in fitting ({runs}): {pair}"),
                format!("未参与拟合的批次（{runs}）的误差：{pair}"),
            ));
        }
        let pair = arrow(fit.before.rmse, fit.after.rmse);
        lines.push(
            self.language
                .select_text(format!("error on the fitted runs: {pair}"), format!("参与拟合批次的误差：{pair}")),
        );
        if let Some(ceiling) = &fit.ceiling {
            let error = format_short_number(ceiling.held_out_rmse.unwrap_or(ceiling.rmse));
            lines.push(self.language.select_text(
                format!("error of the free curve in its place: {error}{unit}"),
                format!("自由曲线的误差：{error}{unit}"),
            ));
        }
        let (floor, rows, runs) = (format_short_number(fit.noise_floor), fit.rows, fit.runs);
        lines.push(self.language.select_text(
            format!("ordinary noise: {floor}{unit}; {rows} rows in {runs} runs were compared"),
            format!("普通噪声：{floor}{unit}；共比较{runs}个批次{rows}行"),
        ));
        lines
    }

    fn describe_certainty(&self, diagnosis: &Diagnosis) -> Vec<String> {
        let mut lines: Vec<String> = diagnosis.missing.iter().map(|missing| self.describe_evidence(missing)).collect();
        lines.extend(diagnosis.alternatives.iter().flat_map(|other| self.describe_alternative(other)));
        if diagnosis.verdict == Verdict::Explained {
            lines.push(self.language.select_text("no other explanation comes near", "没有其他接近的解释").to_owned());
        }
        lines
    }

    fn describe_evidence(&self, missing: &Missing) -> String {
        let name = self.describe_effect(&missing.effect);
        let mut en = vec![];
        let mut zh = vec![];
        if let Some(probability) = missing.probability {
            en.push(format!("probability {probability:.2}"));
            zh.push(format!("概率{probability:.2}"));
        }
        if let Some(information) = missing.delta_ic.map(format_short_number) {
            en.push(format!("without it the model loses {information} of information"));
            zh.push(format!("去掉它，模型损失信息量{information}"));
        }
        let absorbed = 100.0 * missing.absorbed_share;
        en.push(format!("the refitted model had hidden {absorbed:.0} % of it"));
        zh.push(format!("重新拟合的模型掩盖了其{absorbed:.0} %"));
        self.language.select_text(format!("{name}: {}", en.join("; ")), format!("{name}：{}", zh.join("；")))
    }

    fn describe_alternative(&self, other: &Alternative) -> Vec<String> {
        let (name, instead) = (self.describe_effect(&other.effect), self.describe_effect(&other.instead_of));
        let experiment = self.select_experiment_text(other);
        // What is told as nearly ruled out is not told as possible in the same breath.
        let (could, could_zh) = match other.is_remote() {
            true => ("least likely of what is listed is", "列出的解释中可能性最小的是"),
            false => ("it could also be", "也可能是"),
        };
        vec![
            self.language.select_text(
                format!("{could} {name} instead of {instead}, {}", describe_odds(other.delta_ic)),
                format!("{could_zh}{name}而不是{instead}，{}", describe_odds_zh(other.delta_ic)),
            ),
            self.language
                .select_text(format!("  what separates them: {experiment}"), format!("  区分方法：{experiment}")),
        ]
    }

    fn select_experiment_text(&self, other: &Alternative) -> String {
        if self.language == Language::En {
            return other.separating_experiment.clone();
        }
        let known = find_effect(&other.effect).or_else(|| find_effect(&other.instead_of));
        known.map_or_else(|| other.separating_experiment.clone(), |effect| effect.doc().zh.experiment.to_owned())
    }

    fn list_shifts(&self, diagnosis: &Diagnosis) -> Vec<String> {
        let moved = |shift: &&Shift| format_short_number(shift.before) != format_short_number(shift.after);
        let line = |shift: &Shift| {
            let unit = space_unit(&diagnosis.find_parameter_unit(&shift.parameter).unwrap_or_default());
            format!(
                "{}: {} -> {}{unit}",
                shift.parameter,
                format_short_number(shift.before),
                format_short_number(shift.after)
            )
        };
        diagnosis.baseline_shift.iter().filter(moved).map(line).collect()
    }

    fn describe_next_step(&self, diagnosis: &Diagnosis) -> Vec<String> {
        let Some(experiment) = &diagnosis.next_experiment else { return Vec::new() };
        let statement = match (self.language, find_effect(&experiment.effect)) {
            (Language::Zh, _) if experiment.statement_zh.is_some() => experiment.statement_zh.unwrap_or_default(),
            (Language::Zh, Some(effect)) => effect.doc().zh.experiment,
            _ => experiment.statement.as_str(),
        };
        let minutes = format_short_number(experiment.minutes);
        let mut lines = vec![
            self.language.select_text(format!("{statement} ({minutes} min)"), format!("{statement}（{minutes} min）")),
        ];
        if !list_experiment_kinds(diagnosis).is_empty() {
            let (en, zh) = (
                "`diagnose --experiment PLAN.csv` writes it as a plan",
                "`diagnose --experiment PLAN.csv`可将试验写成计划文件",
            );
            lines.push(self.language.select_text(en, zh).to_owned());
        }
        lines
    }

    fn list_faults(&self, diagnosis: &Diagnosis) -> Vec<String> {
        let faults = diagnosis.data_quality.iter();
        faults
            .map(|fault| {
                let (kind, column, rows) = (fault.kind.describe(self.language), &fault.column, fault.rows);
                self.language
                    .select_text(format!("{kind} in {column}: {rows} rows"), format!("{column}：{kind}，{rows}行"))
            })
            .collect()
    }
}

impl Alternative {
    /// Is it so much less likely that a number says no more?
    #[must_use]
    pub fn is_remote(&self) -> bool {
        (0.5 * self.delta_ic).exp() > ODDS_MAX
    }
}

/// How many times less likely an explanation with so much less information is; nothing where it is about as likely.
fn format_odds(delta_ic: f64) -> Option<String> {
    let odds = (0.5 * delta_ic).exp();
    if odds > ODDS_MAX {
        return Some(format!("over {ODDS_MAX}"));
    }
    (odds >= ODDS_MIN).then(|| format!("{odds:.1}"))
}

fn describe_odds(delta_ic: f64) -> String {
    format_odds(delta_ic).map_or_else(|| "about as likely".to_owned(), |odds| format!("{odds} times less likely"))
}

fn describe_odds_zh(delta_ic: f64) -> String {
    let odds = format_odds(delta_ic).map(|odds| odds.replace("over ", "超过"));
    odds.map_or_else(|| "可能性大致相同".to_owned(), |odds| format!("可能性为其{odds}分之一"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_readable() {
        let shown: Vec<String> =
            [0.0, 1810.0, 0.23, 48.9, 1234567.0, 2.5e-5, -61.04, 123456.0].map(format_short_number).to_vec();
        assert_eq!(shown, ["0", "1810", "0.23", "48.9", "1.235e6", "2.500e-5", "-61.04", "123456"]);
    }

    #[test]
    fn odds_are_those_of_the_information() {
        let told = [0.0, 6.0, 60.0].map(describe_odds);
        assert_eq!(told, ["about as likely", "20.1 times less likely", "over 1000 times less likely"]);
        assert_eq!(
            [0.0, 6.0, 60.0].map(describe_odds_zh),
            ["可能性大致相同", "可能性为其20.1分之一", "可能性为其超过1000分之一"]
        );
    }
}
