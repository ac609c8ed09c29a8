//! The whole diagnosis in plain words for standard output, in English or Chinese.

use super::diagnosis::{Alternative, Diagnosis, Fits, Missing, ParameterEstimate, Shift, Verdict};
use super::locate::{Condition, Region};
use super::words;
use physics::explain::Language;
use physics::find_effect;
use std::fmt::Write as _;

/// Spans that are listed; the JSON holds all of them.
const SPANS_SHOWN: usize = 6;
/// Odds beyond which a number says no more.
const ODDS_MAX: f64 = 1000.0;
/// Odds below which two explanations are told to be about as likely.
const ODDS_MIN: f64 = 1.5;

/// The report.
#[must_use]
pub fn report(diagnosis: &Diagnosis, language: Language) -> String {
    let say = Say { language, unit: &diagnosis.unit };
    let mut text = say.headline(diagnosis);
    let sections = [
        (("Where", "位置"), say.where_it_is(diagnosis)),
        (("What is missing", "缺少的物理效应"), say.missing(diagnosis)),
        (("How much better", "改进程度"), diagnosis.fit.as_ref().map(|fit| say.fit(fit)).unwrap_or_default()),
        (("How sure", "可信程度"), say.sure(diagnosis)),
        (("Parameters that had been bent", "被扭曲的参数"), say.shifts(diagnosis)),
        (("What to do next", "下一步"), say.next(diagnosis)),
        (("Quality of the recording", "数据质量"), say.quality(diagnosis)),
    ];
    for ((en, zh), lines) in sections {
        if !lines.is_empty() {
            let _ = writeln!(text, "\n{}", say.pick(en, zh));
            lines.iter().for_each(|line| text.push_str(&format!("  {line}\n")));
        }
    }
    text
}

/// A number with four significant digits, plain where it is readable.
#[must_use]
pub fn short(x: f64) -> String {
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

struct Say<'a> {
    language: Language,
    unit: &'a str,
}

impl Say<'_> {
    fn pick<'t>(&self, en: &'t str, zh: &'t str) -> &'t str {
        if self.language == Language::En { en } else { zh }
    }

    /// A sentence in the language of the report.
    fn words(&self, en: String, zh: String) -> String {
        if self.language == Language::En { en } else { zh }
    }

    /// The name of an effect: its kind, which `effects show` takes, and what it is called.
    fn name(&self, kind: &str) -> String {
        let Some(effect) = find_effect(kind) else {
            return if kind.starts_with("unknown") {
                self.pick("unknown", "未知效应").to_owned()
            } else {
                kind.to_owned()
            };
        };
        format!("{} ({kind})", effect.doc().texts(self.language).name)
    }

    fn headline(&self, diagnosis: &Diagnosis) -> String {
        let summary = self.pick(&diagnosis.summary.en, &diagnosis.summary.zh);
        format!("{}{}{summary}\n", diagnosis.verdict.word(), self.pick(": ", "："))
    }

    fn where_it_is(&self, diagnosis: &Diagnosis) -> Vec<String> {
        diagnosis.mismatch.iter().flat_map(|region| self.region(region)).collect()
    }

    fn region(&self, region: &Region) -> Vec<String> {
        let (share, mean, unit) = (100.0 * region.share, short(region.mean), self.unit);
        let place: Vec<String> = region.conditions.iter().map(|condition| self.condition(condition)).collect();
        let place = match place.is_empty() {
            true => self.pick("everywhere", "所有工况").to_owned(),
            false => place.join(self.pick(" and ", "，且")),
        };
        let sign = if region.mean > 0.0 { "+" } else { "" };
        let mut lines = vec![self.words(
            format!("{place}: {share:.0} % of it, on average {sign}{mean} {unit}"),
            format!("{place}：占{share:.0} %，平均{sign}{mean} {unit}"),
        )];
        if let Some(onset) = &region.onset {
            let (run, at, low, high) = (&onset.run, onset.time_s, onset.low_s, onset.high_s);
            lines.push(self.words(
                format!("since run {run} at {at:.0} s (between {low:.0} and {high:.0} s)"),
                format!("始于批次{run}的{at:.0} s（{low:.0}至{high:.0} s之间）"),
            ));
        }
        lines.push(self.spans(region));
        lines
    }

    fn condition(&self, condition: &Condition) -> String {
        if self.language == Language::En { words::condition(condition) } else { words::condition_zh(condition) }
    }

    fn spans(&self, region: &Region) -> String {
        let shown: Vec<String> = region.spans.iter().take(SPANS_SHOWN).map(|span| self.span(span)).collect();
        let shown = shown.join(self.pick("; ", "；"));
        let more = region.spans.len().saturating_sub(SPANS_SHOWN);
        if more == 0 {
            return shown;
        }
        self.words(format!("{shown}; and {more} more stretches"), format!("{shown}；另有{more}段"))
    }

    fn span(&self, span: &super::locate::Span) -> String {
        let (run, from_s, to_s) = (&span.run, span.from_s, span.to_s);
        self.words(format!("run {run}, {from_s:.0} to {to_s:.0} s"), format!("批次{run}，{from_s:.0}至{to_s:.0} s"))
    }

    fn missing(&self, diagnosis: &Diagnosis) -> Vec<String> {
        diagnosis.missing.iter().flat_map(|missing| self.one_missing(missing)).collect()
    }

    fn one_missing(&self, missing: &Missing) -> Vec<String> {
        let statement = match (self.language, find_effect(&missing.effect)) {
            (Language::Zh, Some(effect)) => effect.doc().zh.statement,
            (Language::Zh, None) => "效应库中没有能解释它的效应，仅描述其形状",
            (Language::En, _) => missing.statement.as_str(),
        };
        let mut lines = vec![format!("{}: {statement}", self.name(&missing.effect))];
        lines.push(format!("  {}", missing.equation));
        lines.extend(missing.parameters.iter().map(|parameter| format!("  {}", self.estimate(parameter))));
        lines
    }

    fn estimate(&self, estimate: &ParameterEstimate) -> String {
        let (name, unit) = (&estimate.name, if estimate.unit == "1" { "" } else { &estimate.unit });
        let (value, low, high) = (short(estimate.value), short(estimate.low), short(estimate.high));
        self.words(
            format!("{name} = {value} {unit} (95 % between {low} and {high})"),
            format!("{name} = {value} {unit}（95 %区间{low}至{high}）"),
        )
    }

    fn fit(&self, fit: &Fits) -> Vec<String> {
        let unit = self.unit;
        let arrow = |before: f64, after: f64| format!("{} -> {} {unit}", short(before), short(after));
        let mut lines = Vec::new();
        if let (Some(before), Some(after)) = (fit.before.held_out_rmse, fit.after.held_out_rmse) {
            let (pair, runs) = (arrow(before, after), fit.held_out_runs.join(", "));
            lines.push(self.words(
                format!("error on runs that took no part in fitting ({runs}): {pair}"),
                format!("未参与拟合的批次（{runs}）的误差：{pair}"),
            ));
        }
        let pair = arrow(fit.before.rmse, fit.after.rmse);
        lines.push(self.words(format!("error on the fitted runs: {pair}"), format!("参与拟合批次的误差：{pair}")));
        let (floor, rows, runs) = (short(fit.noise_floor), fit.rows, fit.runs);
        lines.push(self.words(
            format!("ordinary noise: {floor} {unit}; {rows} rows in {runs} runs were compared"),
            format!("普通噪声：{floor} {unit}；共比较{runs}个批次{rows}行"),
        ));
        lines
    }

    fn sure(&self, diagnosis: &Diagnosis) -> Vec<String> {
        let mut lines: Vec<String> = diagnosis.missing.iter().map(|missing| self.evidence(missing)).collect();
        lines.extend(diagnosis.alternatives.iter().flat_map(|other| self.alternative(other)));
        if diagnosis.verdict == Verdict::Explained {
            lines.push(self.pick("no other explanation comes near", "没有其他接近的解释").to_owned());
        }
        lines
    }

    fn evidence(&self, missing: &Missing) -> String {
        let name = self.name(&missing.effect);
        let (information, p, absorbed) =
            (short(missing.delta_ic), short(missing.p_value), 100.0 * missing.absorbed_share);
        self.words(
            format!(
                "{name}: information {information}; noise alone does as well in at most {p} of cases; the refitted model \
                 had hidden {absorbed:.0} % of it"
            ),
            format!("{name}：信息量{information}；噪声达到同等程度的概率不超过{p}；重新拟合的模型掩盖了其{absorbed:.0} %"),
        )
    }

    fn alternative(&self, other: &Alternative) -> Vec<String> {
        let (name, instead) = (self.name(&other.effect), self.name(&other.instead_of));
        let experiment = self.experiment_of(other);
        vec![
            self.words(
                format!("it could also be {name} instead of {instead}, {}", less_likely(other.delta_ic)),
                format!("也可能是{name}而不是{instead}，{}", less_likely_zh(other.delta_ic)),
            ),
            self.words(format!("  what separates them: {experiment}"), format!("  区分方法：{experiment}")),
        ]
    }

    fn experiment_of(&self, other: &Alternative) -> String {
        if self.language == Language::En {
            return other.separating_experiment.clone();
        }
        let known = find_effect(&other.effect).or_else(|| find_effect(&other.instead_of));
        known.map_or_else(|| other.separating_experiment.clone(), |effect| effect.doc().zh.experiment.to_owned())
    }

    fn shifts(&self, diagnosis: &Diagnosis) -> Vec<String> {
        let moved = |shift: &&Shift| short(shift.before) != short(shift.after);
        let line = |shift: &Shift| {
            let unit = shift_unit(diagnosis, &shift.parameter).replace("output", self.unit);
            format!("{}: {} -> {} {unit}", shift.parameter, short(shift.before), short(shift.after))
                .trim_end()
                .to_owned()
        };
        diagnosis.baseline_shift.iter().filter(moved).map(line).collect()
    }

    fn next(&self, diagnosis: &Diagnosis) -> Vec<String> {
        let Some(experiment) = &diagnosis.next_experiment else { return Vec::new() };
        let statement = match (self.language, find_effect(&experiment.effect)) {
            (Language::Zh, Some(effect)) => effect.doc().zh.experiment,
            _ => experiment.statement.as_str(),
        };
        let (minutes, gain) = (short(experiment.minutes), short(experiment.expected_delta_ic));
        let mut lines =
            vec![self.words(format!("{statement} ({minutes} min)"), format!("{statement}（{minutes} min）"))];
        if experiment.expected_delta_ic > 0.0 {
            lines.push(self.words(
                format!("expected to separate the explanations by {gain} of information; `diagnose --experiment PLAN.csv` writes it as a plan"),
                format!("预计区分信息量{gain}；`diagnose --experiment PLAN.csv`可将试验写成计划文件"),
            ));
        }
        lines
    }

    fn quality(&self, diagnosis: &Diagnosis) -> Vec<String> {
        let faults = diagnosis.data_quality.iter();
        faults
            .map(|fault| {
                let (kind, column, rows) = (self.fault(fault.fault), &fault.column, fault.rows);
                self.words(format!("{kind} in {column}: {rows} rows"), format!("{column}：{kind}，{rows}行"))
            })
            .collect()
    }

    fn fault<'t>(&self, fault: &'t str) -> &'t str {
        let (en, zh) = match fault {
            "dropouts" => ("values missing, held or zero", "数据缺失、保持或为零"),
            "spikes" => ("isolated spikes", "孤立尖峰"),
            "quantisation" => ("coarse steps", "量化过粗"),
            "duplicate_time" => ("time that does not advance", "时间未递增"),
            "refused_rows" => ("refused rows", "被拒绝的行"),
            other => (other, other),
        };
        self.pick(en, zh)
    }
}

/// How many times less likely an explanation with so much less information is; nothing where it is about as likely.
fn odds(delta_ic: f64) -> Option<String> {
    let odds = (0.5 * delta_ic).exp();
    if odds > ODDS_MAX {
        return Some(format!("over {ODDS_MAX}"));
    }
    (odds >= ODDS_MIN).then(|| format!("{odds:.1}"))
}

fn less_likely(delta_ic: f64) -> String {
    odds(delta_ic).map_or_else(|| "about as likely".to_owned(), |odds| format!("{odds} times less likely"))
}

fn less_likely_zh(delta_ic: f64) -> String {
    let odds = odds(delta_ic).map(|odds| odds.replace("over ", "超过"));
    odds.map_or_else(|| "可能性大致相同".to_owned(), |odds| format!("可能性为其{odds}分之一"))
}

/// The unit of `label.parameter`; empty for pure numbers.
fn shift_unit(diagnosis: &Diagnosis, name: &str) -> String {
    let parts = diagnosis.model.parts.iter();
    let unit = parts.filter_map(|part| {
        let parameter = name.strip_prefix(part.label())?.strip_prefix('.')?;
        part.parameter(parameter).map(|parameter| parameter.unit.clone())
    });
    unit.into_iter().next().filter(|unit| unit != "1").unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_readable() {
        let shown: Vec<String> = [0.0, 1810.0, 0.23, 48.9, 1234567.0, 2.5e-5, -61.04, 123456.0].map(short).to_vec();
        assert_eq!(shown, ["0", "1810", "0.23", "48.9", "1.235e6", "2.500e-5", "-61.04", "123456"]);
    }

    #[test]
    fn odds_are_those_of_the_information() {
        let told = [0.0, 6.0, 60.0].map(less_likely);
        assert_eq!(told, ["about as likely", "20.1 times less likely", "over 1000 times less likely"]);
        assert_eq!(
            [0.0, 6.0, 60.0].map(less_likely_zh),
            ["可能性大致相同", "可能性为其20.1分之一", "可能性为其超过1000分之一"]
        );
    }
}
