//! Everything that a script can see, call and set, as Markdown and as JSON: what `cnc-gateway rules api` prints.

use super::functions::{Method, SUBJECTS, Subject};
use super::vocabulary::format_vocabulary;
use super::{FUNCTIONS, HANDLERS, RECORDS, list_words};
use estimators::SETTINGS;
use serde_json::{Value, json};

/// The methods by subject, then variables, functions and settings, as Markdown.
#[must_use]
pub fn format_api_reference(chinese: bool) -> String {
    let pick = |en: &'static str, zh: &'static str| if chinese { zh } else { en };
    let mut text = String::from("## Methods\n\n");
    text += pick(
        "Pure functions; without an answer they return `()` and `why(\"name\")` tells the reason.\n",
        "纯函数；无结果时返回 `()`，原因由 `why(\"name\")` 给出。\n",
    );
    for subject in SUBJECTS {
        text += &format!(
            "\n### {}\n\n| method | takes | returns | what |\n|---|---|---|---|\n",
            pick(subject.en, subject.zh)
        );
        for method in subject.methods {
            let what = pick(method.en, method.zh);
            text += &format!(
                "| `{}` | {} | {} | {what} |\n",
                method.signature(),
                format_parameter_units(method),
                method.returns
            );
        }
    }
    text.push('\n');
    text.push_str(&format_vocabulary(chinese));
    text
}

fn format_parameter_units(method: &Method) -> String {
    let units: Vec<&str> = method.parameters.iter().map(|parameter| parameter.unit).collect();
    units.join("; ")
}

/// The same as JSON, with the texts in both languages.
#[must_use]
pub fn api_json() -> Value {
    let words = list_words().iter().map(
        |word| json!({ "name": word.name, "unit": word.unit, "one_of": word.one_of, "en": word.en, "zh": word.zh }),
    );
    let functions = FUNCTIONS.iter().map(|it| json!({ "signature": it.signature, "en": it.en, "zh": it.zh }));
    let settings = SETTINGS.iter().map(|row| {
        json!({ "name": row.name, "unit": row.unit, "default": row.default, "range": [row.range.0, row.range.1],
            "whole": row.whole, "en": row.en })
    });
    json!({
        "schema": "rules-api/1",
        "methods": SUBJECTS.iter().flat_map(|subject| subject_json(subject)).collect::<Vec<Value>>(),
        "functions": functions.collect::<Vec<Value>>(),
        "handlers": HANDLERS.iter().map(|it| json!({ "signature": it.signature, "en": it.en, "zh": it.zh })).collect::<Vec<_>>(),
        "records": RECORDS.iter().map(|it| json!({ "name": it.name, "example": it.example, "en": it.en, "zh": it.zh }))
            .collect::<Vec<_>>(),
        "variables": words.collect::<Vec<Value>>(),
        "settings": settings.collect::<Vec<Value>>(),
    })
}

fn subject_json(subject: &Subject) -> Vec<Value> {
    let one = |method: &Method| {
        let parameters = method.parameters.iter().map(|it| json!({ "name": it.name, "unit": it.unit }));
        json!({ "name": method.name, "signature": method.signature(), "subject": subject.en,
            "parameters": parameters.collect::<Vec<Value>>(), "returns": method.returns,
            "en": method.en, "zh": method.zh })
    };
    subject.methods.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::functions::list_methods;
    use std::collections::BTreeSet;

    #[test]
    fn every_method_is_told_in_both_languages_and_no_name_means_two_things() {
        let (english, chinese) = (format_api_reference(false), format_api_reference(true));
        for method in list_methods() {
            assert!(english.contains(&format!("`{}`", method.signature())) && chinese.contains(method.zh));
            assert!(!method.en.is_empty() && !method.zh.is_empty() && !method.returns.is_empty());
            assert!(method.parameters.iter().all(|parameter| !parameter.unit.is_empty()));
        }
        let host = FUNCTIONS.iter().filter_map(crate::Function::name);
        let taken: BTreeSet<&str> = list_words().iter().map(|it| it.name).chain(host).collect();
        let names: BTreeSet<&str> = list_methods().map(|it| it.name).collect();
        assert!(names.is_disjoint(&taken) && names.len() == list_methods().count());
    }

    #[test]
    fn the_document_holds_every_table() {
        let json = api_json();
        assert_eq!(json["methods"].as_array().map(Vec::len), Some(list_methods().count()));
        assert_eq!(json["settings"].as_array().map(Vec::len), Some(SETTINGS.len()));
        assert_eq!(json["methods"][0]["parameters"][1]["unit"], "rpm");
    }
}
