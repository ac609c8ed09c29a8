//! The settings of the estimators, as scripts give them in `fn settings()`.

use super::compile::{ScriptFile, position_of};
use super::compiled::Script;
use super::problem::{ScriptProblem, spoken};
use crate::estimators::{SettingError, Settings};
use rhai::{Array, Dynamic, Map, Position};
use std::sync::Arc;

/// One setting that a script chose.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ChosenSetting {
    name: String,
    value: ChosenValue,
    line: Option<usize>,
    column: Option<usize>,
}

#[derive(Debug, Clone, PartialEq)]
enum ChosenValue {
    Number(f64),
    /// Gear stage, and pairs of rpm and W.
    NoLoad(usize, Vec<(f64, f64)>),
}

/// Reads what `fn settings()` returned, and tries every value.
pub(super) fn read_choices(file: &ScriptFile, map: &Map) -> Result<Vec<ChosenSetting>, Vec<ScriptProblem>> {
    let mut choices = Vec::new();
    let mut problems = Vec::new();
    let mut trial = Settings::default();
    for (name, value) in map {
        let at = position_of(&file.text, name);
        let read = read_value(name, value).and_then(|chosen| {
            let choice =
                ChosenSetting { name: name.to_string(), value: chosen, line: at.line(), column: at.position() };
            apply(&choice, &mut trial).map_err(|error| described(&error))?;
            Ok(choice)
        });
        match read {
            Ok(choice) => choices.push(choice),
            Err(what) => problems.push(refusal(&file.name, at, what)),
        }
    }
    problems.sort_by_key(|problem| (problem.line, problem.column));
    if problems.is_empty() { Ok(choices) } else { Err(problems) }
}

/// The message of the estimators, without the unit of a pure number.
fn described(error: &SettingError) -> String {
    match error {
        SettingError::Range { name, value, unit: "1", least, greatest, whole: false } => {
            format!("{name} = {value} is outside {least} to {greatest}")
        }
        _ => error.to_string(),
    }
}

fn refusal(file: &str, at: Position, what: String) -> ScriptProblem {
    match what.split_once("; did you mean ") {
        Some((what, near)) => ScriptProblem::new(file, at, what, format!("did you mean {near}")),
        None => {
            ScriptProblem::new(file, at, what, "`cnc-gateway check --vocabulary` lists the settings with their ranges")
        }
    }
}

fn read_value(name: &str, value: &Dynamic) -> Result<ChosenValue, String> {
    if let Some(number) = as_number(value) {
        return Ok(ChosenValue::Number(number));
    }
    let stage = name.strip_prefix("no_load_stage_").and_then(|stage| stage.parse().ok());
    match (stage, value.read_lock::<Array>()) {
        (Some(stage), Some(points)) => points
            .iter()
            .map(pair)
            .collect::<Option<Vec<_>>>()
            .map(|pairs| ChosenValue::NoLoad(stage, pairs))
            .ok_or_else(|| format!("{name} needs pairs of speed in rpm and power in W: [[500, 310.0], [1000, 420.0]]")),
        _ => Err(format!("the setting {name} needs a number, not {}", spoken(value))),
    }
}

fn pair(value: &Dynamic) -> Option<(f64, f64)> {
    let pair = value.read_lock::<Array>()?;
    match pair.as_slice() {
        [speed_rpm, power_w] => Some((as_number(speed_rpm)?, as_number(power_w)?)),
        _ => None,
    }
}

fn as_number(value: &Dynamic) -> Option<f64> {
    value.as_float().ok().or_else(|| value.as_int().ok().map(|whole| whole as f64))
}

fn apply(choice: &ChosenSetting, settings: &mut Settings) -> Result<(), SettingError> {
    match &choice.value {
        ChosenValue::Number(number) => settings.set(&choice.name, *number),
        ChosenValue::NoLoad(stage, pairs) => settings.set_no_load_table(*stage, pairs),
    }
}

/// The settings of all scripts together. One setting given by two scripts, and settings that contradict each other,
/// are problems.
pub(super) fn merge(scripts: &[Arc<Script>], problems: &mut Vec<ScriptProblem>) -> Settings {
    let mut settings = Settings::default();
    let mut given: Vec<(&str, &str)> = Vec::new();
    for script in scripts {
        for choice in &script.choices {
            if let Some((_, other)) = given.iter().find(|(name, _)| *name == choice.name) {
                problems.push(twice(script, choice, other));
            }
            given.push((&choice.name, &script.file));
            if let Err(error) = apply(choice, &mut settings) {
                problems.push(refusal(&script.file, Position::NONE, described(&error)));
            }
        }
    }
    let file = given.first().map_or("scripts", |(_, file)| *file);
    for contradiction in settings.contradictions() {
        problems.push(ScriptProblem::new(file, Position::NONE, contradiction.to_string(), ""));
    }
    settings
}

fn twice(script: &Script, choice: &ChosenSetting, other: &str) -> ScriptProblem {
    ScriptProblem {
        file: script.file.to_string(),
        line: choice.line,
        column: choice.column,
        what: format!("the setting {} is also given in {other}", choice.name),
        next: "keep one of the two".to_owned(),
    }
}
