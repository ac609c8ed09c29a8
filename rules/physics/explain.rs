//! The catalogue in words and as JSON: what `effects list` and `effects show` print.

use super::{CATALOGUE, EffectDoc, Entry, ParameterDoc, Texts, find_effect};
use adapter_core::channel::find_nearest_name;
use serde_json::{Value, json};
use std::fmt::Write as _;
use thiserror::Error;

/// Language in which an effect is described.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Language {
    /// English.
    #[default]
    En,
    /// Chinese.
    Zh,
}

impl Language {
    /// The one of two texts that is in this language.
    #[must_use]
    pub fn select_text<T>(self, en: T, zh: T) -> T {
        match self {
            Self::En => en,
            Self::Zh => zh,
        }
    }
}

/// An effect that the catalogue does not hold.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("there is no effect {kind}. {hint}")]
pub struct UnknownEffect {
    /// The name asked for.
    pub kind: String,
    /// What to do: the name that was probably meant, and where all names are listed.
    pub hint: String,
}

impl EffectDoc {
    /// The texts in this language.
    #[must_use]
    pub fn texts(&self, language: Language) -> &Texts {
        match language {
            Language::En => &self.en,
            Language::Zh => &self.zh,
        }
    }
}

/// The texts of the effect of this kind.
///
/// # Errors
/// [`UnknownEffect`] with the nearest name.
pub fn find_effect_doc(kind: &str) -> Result<&'static EffectDoc, UnknownEffect> {
    let kinds = || CATALOGUE.iter().map(|effect| effect.doc().kind);
    let near = || find_nearest_name(kind, kinds()).map(|near| format!("Did you mean {near}? "));
    find_effect(kind).map(|effect| effect.doc()).ok_or_else(|| UnknownEffect {
        kind: kind.to_owned(),
        hint: format!("{}`effects list` names all {}.", near().unwrap_or_default(), CATALOGUE.len()),
    })
}

/// One line per effect: kind, name and statement.
#[must_use]
pub fn format_effect_list(language: Language) -> String {
    let widest = CATALOGUE.iter().map(|effect| effect.doc().kind.len()).max().unwrap_or(0);
    let mut lines = String::new();
    let mut family = "";
    for doc in CATALOGUE.iter().map(|effect| effect.doc()) {
        if family != doc.family {
            family = doc.family;
            let _ = writeln!(lines, "{}", translate_family(family, language));
        }
        let texts = doc.texts(language);
        let _ = writeln!(lines, "  {:widest$}  {}", doc.kind, texts.statement);
    }
    lines
}

fn translate_family(family: &'static str, language: Language) -> &'static str {
    if language == Language::En {
        return family;
    }
    match family {
        "model" => "基本模型",
        "drive" => "电机与驱动",
        "spindle" => "主轴",
        "cutting" => "切削",
        "axis" => "进给轴",
        "auxiliary" => "辅助设备",
        "thermal" => "热误差",
        "measurement" => "测量",
        "control" => "控制",
        other => other,
    }
}

/// Everything about one effect, in plain text.
///
/// # Errors
/// [`UnknownEffect`] with the nearest name.
pub fn explain_effect(kind: &str, language: Language) -> Result<String, UnknownEffect> {
    let doc = find_effect_doc(kind)?;
    let texts = doc.texts(language);
    let words = select_labels(language);
    let mut text = format!("{} - {}\n{}\n\n", doc.kind, texts.name, texts.statement);
    let _ = writeln!(text, "{}\n  {}", words.law, doc.law);
    if !doc.parameters.is_empty() {
        let _ = writeln!(text, "{}", words.parameters);
        doc.parameters.iter().for_each(|parameter| text.push_str(&format_parameter_line(parameter, language)));
        list_placeholder_notes(doc, language).for_each(|note| text.push_str(&format!("  {note}\n")));
    }
    let minutes = format!("{} ({} min)", texts.experiment, doc.experiment_minutes);
    let needs = if doc.needs.is_empty() { "-".to_owned() } else { doc.needs.join("; ") };
    for (label, value) in [
        (words.needs, needs.as_str()),
        (words.absence, texts.absence),
        (words.confused, texts.confused_with),
        (words.experiment, minutes.as_str()),
        (words.rivals, doc.rivals.join(", ").as_str()),
        (words.source, doc.source),
    ] {
        let _ = writeln!(text, "{label}\n  {value}");
    }
    Ok(text)
}

struct Labels {
    law: &'static str,
    parameters: &'static str,
    needs: &'static str,
    absence: &'static str,
    confused: &'static str,
    experiment: &'static str,
    rivals: &'static str,
    source: &'static str,
    shape: &'static str,
}

fn select_labels(language: Language) -> &'static Labels {
    match language {
        Language::En => &Labels {
            law: "Law",
            parameters: "Parameters",
            needs: "Needs",
            absence: "When the simulation lacks it",
            confused: "Confused with",
            experiment: "Experiment that tells them apart",
            rivals: "Rivals",
            source: "Source",
            shape: "shape",
        },
        Language::Zh => &Labels {
            law: "公式",
            parameters: "参数",
            needs: "所需通道",
            absence: "仿真缺少它时",
            confused: "易混淆的原因",
            experiment: "区分试验",
            rivals: "竞争假设",
            source: "来源",
            shape: "形状参数",
        },
    }
}

/// What the words that stand for a unit mean, where the effect's parameters use them.
fn list_placeholder_notes(doc: &EffectDoc, language: Language) -> impl Iterator<Item = &'static str> {
    let notes = [
        ("output", "output: the unit of the simulated output", "output：仿真输出的单位"),
        ("velocity", "velocity: m/s, of a spindle rad/s", "velocity：m/s，主轴为rad/s"),
        (
            "friction",
            "friction: the unit of the output, over a velocity where the output is a power",
            "friction：输出的单位；输出为功率时再除以速度",
        ),
    ];
    let used = |word: &str| doc.parameters.iter().any(|parameter| parameter.unit.contains(word));
    let note = move |(_, en, zh): (&str, &'static str, &'static str)| language.select_text(en, zh);
    notes.into_iter().filter(move |(word, _, _)| used(word)).map(note)
}

fn format_parameter_line(parameter: &ParameterDoc, language: Language) -> String {
    let shape = match parameter.entry {
        Entry::Linear => String::new(),
        Entry::Shape => format!(" ({})", select_labels(language).shape),
    };
    let meaning = language.select_text(parameter.en, parameter.zh);
    format!("  {} [{}] {}{shape}: {meaning}\n", parameter.name, parameter.unit, format_range(parameter.range))
}

fn format_range((low, high): (f64, f64)) -> String {
    match (low.is_finite(), high.is_finite()) {
        (true, true) => format!("{low} .. {high}"),
        (true, false) => format!(">= {low}"),
        (false, true) => format!("<= {high}"),
        (false, false) => "any".to_owned(),
    }
}

/// Everything about one effect as JSON; a range without an end has `null` there.
///
/// # Errors
/// [`UnknownEffect`] with the nearest name.
pub fn explain_json(kind: &str) -> Result<Value, UnknownEffect> {
    find_effect_doc(kind).map(encode_doc)
}

/// The whole catalogue as JSON.
#[must_use]
pub fn list_json() -> Value {
    Value::Array(CATALOGUE.iter().map(|effect| encode_doc(effect.doc())).collect())
}

fn encode_doc(doc: &EffectDoc) -> Value {
    json!({
        "kind": doc.kind,
        "family": doc.family,
        "law": doc.law,
        "parameters": doc.parameters.iter().map(encode_parameter).collect::<Vec<_>>(),
        "needs": doc.needs,
        "rivals": doc.rivals,
        "experiment_minutes": doc.experiment_minutes,
        "source": doc.source,
        "en": encode_texts(&doc.en),
        "zh": encode_texts(&doc.zh),
    })
}

fn encode_parameter(parameter: &ParameterDoc) -> Value {
    let end = |value: f64| value.is_finite().then_some(value);
    json!({
        "name": parameter.name,
        "unit": parameter.unit,
        "entry": match parameter.entry { Entry::Linear => "linear", Entry::Shape => "shape" },
        "min": end(parameter.range.0),
        "max": end(parameter.range.1),
        "en": parameter.en,
        "zh": parameter.zh,
    })
}

fn encode_texts(texts: &Texts) -> Value {
    json!({
        "name": texts.name,
        "statement": texts.statement,
        "absence": texts.absence,
        "confused_with": texts.confused_with,
        "experiment": texts.experiment,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_is_explained_in_both_languages() {
        for doc in CATALOGUE.iter().map(|effect| effect.doc()) {
            for language in [Language::En, Language::Zh] {
                let text = explain_effect(doc.kind, language).expect("known");
                let texts = doc.texts(language);
                for part in [doc.law, doc.source, texts.statement, texts.absence, texts.experiment] {
                    assert!(text.contains(part), "{} lacks {part}", doc.kind);
                }
                doc.parameters.iter().for_each(|parameter| assert!(text.contains(parameter.name)));
                let stands_in = doc.parameters.iter().any(|parameter| parameter.unit.contains("output"));
                let note = language.select_text("output: ", "output：");
                assert_eq!(text.contains(note), stands_in, "{}", doc.kind);
                assert!(format_effect_list(language).contains(texts.statement));
            }
        }
    }

    #[test]
    fn the_json_names_units_and_open_ranges() {
        let json = explain_json("flank_wear").expect("known");
        assert_eq!(json["parameters"][0]["name"], "k");
        assert_eq!(json["parameters"][0]["min"], 0.0);
        assert!(json["parameters"][0]["max"].is_null());
        assert_eq!(list_json().as_array().map(Vec::len), Some(CATALOGUE.len()));
    }

    #[test]
    fn a_misspelt_effect_finds_its_neighbour() {
        let error = explain_effect("flank_ware", Language::En).expect_err("unknown");
        assert!(error.to_string().contains("Did you mean flank_wear?"), "{error}");
    }
}
