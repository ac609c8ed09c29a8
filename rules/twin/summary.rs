//! The diagnosis in plain words, in both languages.

use super::diagnosis::{Diagnosis, Existence, UNKNOWN, Verdict};
use super::text_report::{format_short_number, space_unit};
use adapter_core::bilingual::Bilingual;
use physics::explain::Language;
use physics::find_effect;

/// One or two sentences for the machinist.
#[must_use]
pub fn summarise_diagnosis(diagnosis: &Diagnosis) -> Bilingual {
    let names: Vec<Bilingual> = diagnosis.missing.iter().map(|missing| describe_kind(&missing.effect)).collect();
    let (names_en, names_zh) =
        (join_texts(&names, |name| &name.en, " and "), join_texts(&names, |name| &name.zh, "和"));
    let (fit, place) = (describe_improvement(diagnosis), describe_region(diagnosis));
    match diagnosis.verdict {
        Verdict::NoMismatch => describe_agreement(diagnosis),
        Verdict::CannotTell => diagnosis.summary.clone(),
        Verdict::Unexplained => Bilingual::new(
            format!("Something real is missing from the model, and no candidate explains it{}. {}", place.en, fit.en),
            format!("模型确实缺少某种影响，但没有任何已知效应能解释它{}。{}", place.zh, fit.zh),
        ),
        Verdict::Explained => Bilingual::new(
            format!("The model lacks {names_en}{}. {}", place.en, fit.en),
            format!("模型缺少{names_zh}{}。{}", place.zh, fit.zh),
        ),
        Verdict::Ambiguous => {
            let near = diagnosis.alternatives.iter().filter(|other| !other.is_remote());
            let mut others: Vec<Bilingual> = near.map(|other| describe_kind(&other.effect)).collect();
            others.dedup();
            if others.is_empty() {
                others.push(describe_kind(UNKNOWN));
            }
            let (others_en, others_zh) =
                (join_texts(&others, |it| &it.en, ", "), join_texts(&others, |it| &it.zh, "、"));
            Bilingual::new(
                format!(
                    "Something is missing from the model{}: most likely {names_en}, but this recording cannot rule out \
                     {others_en}. {}",
                    place.en, fit.en
                ),
                format!("模型缺少某种影响{}：最可能是{names_zh}，但此记录不能排除{others_zh}。{}", place.zh, fit.zh),
            )
        }
    }
}

fn join_texts(all: &[Bilingual], of: impl Fn(&Bilingual) -> &str, between: &str) -> String {
    all.iter().map(of).collect::<Vec<_>>().join(between)
}

/// A name in words; that there is none too.
fn describe_kind(kind: &str) -> Bilingual {
    if kind == UNKNOWN {
        return Bilingual::new("a cause that is not in the catalogue", "效应库之外的原因");
    }
    let zh = find_effect(kind).map_or(kind, |effect| effect.doc().zh.name);
    Bilingual::new(kind.replace('_', " "), zh)
}

/// That nothing is missing is an answer too, and tells how it is known.
fn describe_agreement(diagnosis: &Diagnosis) -> Bilingual {
    let mut text = match diagnosis.remainder.is_empty() {
        true => Bilingual::new(
            "The recording agrees with the model: nothing remains beyond the noise.",
            "记录与模型一致：除噪声外没有其他偏差。",
        ),
        false => {
            let left = |of: &dyn Fn(&Bilingual) -> &str| join_texts(&diagnosis.remainder, of, "; ");
            Bilingual::new(
                format!(
                    "No effect that is known is missing from the model. What is left is not noise alone, or cannot be told \
                     from it: {}.",
                    left(&|text| &text.en)
                ),
                format!("模型没有缺少已知效应。但剩余部分不全是噪声，或无法与噪声区分：{}。", left(&|text| &text.zh)),
            )
        }
    };
    if let Some(Existence { probability_of_nothing, effective_rows, .. }) = diagnosis.existence {
        text.en.push_str(&format!(
            " Probability that nothing is missing: {probability_of_nothing:.2}; the recording is worth \
             {effective_rows:.0} independent rows."
        ));
        text.zh.push_str(&format!(
            "什么都不缺的概率为{probability_of_nothing:.2}；此记录相当于{effective_rows:.0}个独立的行。"
        ));
    }
    text
}

/// That a recording does not suffice, with what it needs.
#[must_use]
pub(super) fn describe_needs(needed: &Bilingual) -> Bilingual {
    Bilingual::new(format!("Cannot tell: this needs {}.", needed.en), format!("需要{}。", needed.zh))
}

/// Why nothing is told although something is there: what was `found`, in which runs the error does not fall with it, and the
/// errors there without it and with it.
#[must_use]
pub(super) fn describe_withdrawal(
    found: &[String],
    among_fitted: bool,
    errors: Option<(f64, f64)>,
    unit: &str,
) -> Bilingual {
    let unnamed = Bilingual::new("something without a name", "某种没有名称的影响");
    let names: Vec<Bilingual> =
        found.iter().map(|kind| if kind == UNKNOWN { unnamed.clone() } else { describe_kind(kind) }).collect();
    let runs = match among_fitted {
        true => Bilingual::new("fitted runs that are predicted from the others", "由其他批次预测的拟合批次"),
        false => Bilingual::new("runs that took no part in fitting", "未参与拟合的批次"),
    };
    let unit = space_unit(unit);
    let errors = errors.map_or_else(Bilingual::default, |(before, after)| {
        let [before, after] = [before, after].map(format_short_number);
        Bilingual::new(
            format!(" ({before}{unit} without it, {after}{unit} with it)"),
            format!("（不含它{before}{unit}，含它{after}{unit}）"),
        )
    });
    Bilingual::new(
        format!(
            "Cannot tell: {} fits the runs it was fitted to, but the error on {} does not fall by more than chance{}.",
            join_texts(&names, |name| &name.en, " and "),
            runs.en,
            errors.en
        ),
        format!(
            "{}与参与拟合的批次吻合，但{}的误差下降不超过偶然{}。",
            join_texts(&names, |name| &name.zh, "和"),
            runs.zh,
            errors.zh
        ),
    )
}

fn describe_improvement(diagnosis: &Diagnosis) -> Bilingual {
    let Some(fit) = &diagnosis.fit else { return Bilingual::default() };
    let unit = space_unit(&diagnosis.unit);
    let shown = |before: f64, after: f64| [before, after, fit.noise_floor].map(format_short_number);
    match (fit.before.held_out_rmse, fit.after.held_out_rmse) {
        (Some(before), Some(after)) => {
            let [before, after, floor] = shown(before, after);
            Bilingual::new(
                format!(
                    "On runs that took no part in fitting the error falls from {before} to {after}{unit}; the noise is \
                     {floor}{unit}."
                ),
                format!("未参与拟合的批次的误差由{before}降至{after}{unit}；噪声为{floor}{unit}。"),
            )
        }
        _ => {
            let [before, after, _] = shown(fit.before.rmse, fit.after.rmse);
            Bilingual::new(
                format!("The error falls from {before} to {after}{unit}."),
                format!("误差由{before}降至{after}{unit}。"),
            )
        }
    }
}

fn describe_region(diagnosis: &Diagnosis) -> Bilingual {
    let Some(first) = diagnosis.mismatch.first() else { return Bilingual::default() };
    let [amount, amount_zh] =
        [Language::En, Language::Zh].map(|language| first.describe_amount(language, &diagnosis.unit));
    let joined = |language: Language, between: &str| {
        first.conditions.iter().map(|condition| condition.describe(language)).collect::<Vec<_>>().join(between)
    };
    let mut place = Bilingual::default();
    if !first.conditions.is_empty() {
        place.en = format!(", where {}", joined(Language::En, " and "));
        place.zh = format!("，位于{}处", joined(Language::Zh, "且"));
    }
    if let Some(onset) = &first.onset {
        place.en.push_str(&format!(", since run {} at {:.0} s", onset.run, onset.time_s));
        place.zh.push_str(&format!("，始于批次{}的{:.0} s", onset.run, onset.time_s));
    }
    place.en.push_str(&format!(" ({amount})"));
    place.zh.push_str(&format!("（{amount_zh}）"));
    place
}
