//! The declarations of a text, and the text with values in their place.

use super::scan::{find_calls, to_position};
use super::{Declared, Per, SettingValue};
use crate::compile::ScriptFile;
use crate::problem::{self, ScriptProblem, describe_type};
use adapter_core::channel::find_nearest_name;
use rhai::{Array, Dynamic, Engine, Expr, ImmutableString, Map, Position, Stmt};
use std::ops::Range;

/// At most so many settings in one script.
const SETTINGS_MAX: usize = 48;
const NAME_MAX: usize = 48;
const KEYS: [&str; 8] = ["unit", "min", "max", "whole", "one_of", "per", "en", "zh"];
const EXAMPLE: &str =
    "write setting(\"target_w\", 0.0, #{ unit: \"W\", min: 0, max: 50000, en: \"what it does\", zh: \"...\" })";

/// A declaration and where it stands.
#[derive(Debug, Clone)]
pub(crate) struct FoundDeclaration {
    pub(crate) declared: Declared,
    span: Range<usize>,
    /// The constant that it alone is the value of.
    pub(crate) constant: Option<String>,
}

/// Every declaration of a file, in the order of the text.
///
/// # Errors
/// Everything that is wrong with them.
pub(crate) fn find_declarations(
    file: &ScriptFile,
    engine: &Engine,
) -> Result<Vec<FoundDeclaration>, Vec<ScriptProblem>> {
    let (mut found, mut problems): (Vec<FoundDeclaration>, Vec<ScriptProblem>) = (Vec::new(), Vec::new());
    for call in find_calls(&file.text, "setting") {
        let at = to_position(&file.text, call.span.start);
        let wrong = |what: String, next: String| ScriptProblem::new(&file.name, at, what, next);
        let read = read(&file.text[call.span.clone()], engine).and_then(|mut declared| {
            if found.iter().any(|known| known.declared.name == declared.name) {
                let what = format!("the setting {} is declared twice", declared.name);
                return Err((what, "give it to a constant once, and use the constant".to_owned()));
            }
            (declared.script, declared.line) = (file.name.clone(), at.line().unwrap_or_default());
            Ok(declared)
        });
        match read {
            Ok(declared) => {
                let constant = find_constant(&file.text, &call.span);
                found.push(FoundDeclaration { declared, span: call.span, constant });
            }
            Err((what, next)) => problems.push(wrong(what, next)),
        }
    }
    if found.len() > SETTINGS_MAX {
        let what = format!("{} settings; a script has at most {SETTINGS_MAX}", found.len());
        problems.push(ScriptProblem::new(&file.name, Position::NONE, what, "split it into several files"));
    }
    if problems.is_empty() { Ok(found) } else { Err(problems) }
}

/// The text with these values, each in the place of its declaration. Lines and columns of everything else stay; `None` stands
/// for a value that is looked up when the script runs.
pub(crate) fn with_values(text: &str, found: &[FoundDeclaration], values: &[Option<SettingValue>]) -> String {
    let mut filled = String::with_capacity(text.len());
    let mut from = 0;
    for (index, (it, value)) in found.iter().zip(values).enumerate() {
        filled.push_str(&text[from..it.span.start]);
        let value = match value {
            Some(SettingValue::Number(number)) => super::format_literal(*number),
            Some(SettingValue::Text(text)) => format!("{text:?}"),
            None => format!("setting_now({index})"),
        };
        filled.push_str(&value);
        // What is left of the declaration becomes blank; a declaration is longer than any number of a range that people write.
        let gone = text[it.span.clone()].chars();
        let rest = gone.skip(value.chars().count()).map(|c| if c == '\n' { '\n' } else { ' ' });
        filled.extend(rest);
        from = it.span.end;
    }
    filled.push_str(&text[from..]);
    filled
}

/// The constant before `= setting(...);`.
fn find_constant(text: &str, span: &Range<usize>) -> Option<String> {
    let before = text[..span.start].trim_end().strip_suffix('=')?.trim_end();
    let name = before.rsplit(|c: char| !(c.is_alphanumeric() || c == '_')).next()?;
    let word = before[..before.len() - name.len()].trim_end();
    (word.ends_with("const") && text[span.end..].trim_start().starts_with(';')).then(|| name.to_owned())
}

type Wrong = (String, String);

fn read(call: &str, engine: &Engine) -> Result<Declared, Wrong> {
    let example = || EXAMPLE.to_owned();
    let ast = engine.compile_expression(call).map_err(|error| {
        let problem = problem::of_parse("", &error);
        (format!("the declaration of a setting cannot be read: {}", problem.what), example())
    })?;
    let Some(Stmt::Expr(expression)) = ast.statements().first() else {
        return Err(("the declaration of a setting cannot be read".to_owned(), example()));
    };
    let Expr::FnCall(call, _) = &**expression else {
        return Err(("the declaration of a setting cannot be read".to_owned(), example()));
    };
    let literal = |at: usize| call.args.get(at).and_then(|argument| argument.get_literal_value(None));
    let (Some(name), Some(default), Some(map), 3) = (literal(0), literal(1), literal(2), call.args.len()) else {
        let what = "a setting is declared with its name, its default and what is said of it, all written out";
        return Err((what.to_owned(), example()));
    };
    let Some(map) = map.read_lock::<Map>().map(|map| map.clone()) else {
        return Err((format!("what is said of a setting is a map, not {}", describe_type(&map)), example()));
    };
    read_declared(name_of(&name)?, &default, &map)
}

fn name_of(name: &Dynamic) -> Result<String, Wrong> {
    let name = name.read_lock::<ImmutableString>().map(|name| name.to_string()).unwrap_or_default();
    let fits = name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        && name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.len() <= NAME_MAX
        && !Per::ALL.iter().any(|per| per.as_word() == name);
    let next =
        format!("use a to z, 0 to 9 and _, beginning with a letter, at most {NAME_MAX}, not `tool` or `operation`");
    if fits { Ok(name) } else { Err((format!("{name:?} cannot be the name of a setting"), next)) }
}

fn read_declared(name: String, default: &Dynamic, map: &Map) -> Result<Declared, Wrong> {
    if let Some(key) = map.keys().find(|key| !KEYS.contains(&key.as_str())) {
        let near = find_nearest_name(key, KEYS)
            .map_or_else(|| format!("these are: {}", KEYS.join(", ")), |near| format!("did you mean {near}?"));
        return Err((format!("`{key}` says nothing of a setting"), near));
    }
    let missing = |key: &str| (format!("the setting {name} has no {key}"), EXAMPLE.to_owned());
    let text = |key: &str| read_text(map.get(key)).filter(|text| !text.is_empty());
    let (en, zh) = (text("en").ok_or_else(|| missing("en"))?, text("zh").ok_or_else(|| missing("zh"))?);
    let number = read_number(default);
    let (default, unit, range) = match number {
        Some(number) => {
            let limit = |key: &str| {
                map.get(key).and_then(self::read_number).filter(|it| it.is_finite()).ok_or_else(|| missing(key))
            };
            let range = (limit("min")?, limit("max")?);
            (SettingValue::Number(number), text("unit").ok_or_else(|| missing("unit"))?, Some(range))
        }
        None => {
            let written = self::read_text(Some(default));
            let kind = || {
                (
                    format!("the default of {name} is {}; it is a number or a text", describe_type(default)),
                    EXAMPLE.to_owned(),
                )
            };
            (SettingValue::Text(written.ok_or_else(kind)?), String::new(), None)
        }
    };
    let whole = map.get("whole").is_some_and(|it| it.as_bool().unwrap_or(false));
    let per = read_words(map.get("per")).iter().map(|word| read_per(&name, word)).collect::<Result<_, _>>()?;
    let (script, one_of) = (String::new(), read_words(map.get("one_of")));
    let declared = Declared { script, name, default, unit, range, whole, one_of, en, zh, per, line: 0 };
    if let Some((least, greatest)) = declared.range.filter(|(least, greatest)| least >= greatest) {
        return Err((format!("the range of {} is empty: {least} to {greatest}", declared.name), EXAMPLE.to_owned()));
    }
    match declared.explain_refusal(&declared.default) {
        Some((what, _)) => {
            Err((format!("the default is not allowed: {}", what.trim_start_matches('.')), EXAMPLE.to_owned()))
        }
        None => Ok(declared),
    }
}

fn read_per(name: &str, word: &str) -> Result<Per, Wrong> {
    let known = Per::ALL.into_iter().find(|per| per.as_word() == word);
    known.ok_or_else(|| {
        (format!("{name}: {word:?} has no settings of its own"), "write per: [\"tool\", \"operation\"]".to_owned())
    })
}

fn read_number(value: &Dynamic) -> Option<f64> {
    value.as_float().ok().or_else(|| value.as_int().ok().map(|whole| whole as f64))
}

fn read_text(value: Option<&Dynamic>) -> Option<String> {
    value?.read_lock::<ImmutableString>().map(|text| text.to_string())
}

fn read_words(value: Option<&Dynamic>) -> Vec<String> {
    let list = value.and_then(|value| value.read_lock::<Array>());
    list.map(|list| list.iter().filter_map(|word| read_text(Some(word))).collect()).unwrap_or_default()
}
