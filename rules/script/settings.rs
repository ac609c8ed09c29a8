//! The settings of the estimators, as scripts give them in `fn settings()`.

use super::compile::{ScriptFile, position_of};
use super::declared::DeclarationPlace;
use super::problem::{ScriptProblem, describe_type};
use super::script_set::Script;
use estimators::loads::LoadCurves;
use estimators::{SettingError, Settings};
use rhai::{Array, Dynamic, Map, Position};
use std::sync::Arc;

/// One setting that a script chose.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ChosenSetting {
    name: String,
    value: ChosenValue,
    place: DeclarationPlace,
    line: Option<usize>,
    column: Option<usize>,
}

#[derive(Debug, Clone, PartialEq)]
enum ChosenValue {
    Number(f64),
    /// Gear stage, and pairs of rpm and W.
    NoLoad(usize, Vec<(f64, f64)>),
    /// Curves of the load over the feed.
    Curves(Box<LoadCurves>),
}

impl ChosenSetting {
    /// The same value of the same setting, wherever it holds?
    pub(super) fn says_the_same(&self, other: &Self) -> bool {
        self.name == other.name && self.value == other.value
    }
}

/// Reads what `fn settings()` returned, and tries every value.
pub(super) fn read_choices(
    file: &ScriptFile,
    map: &Map,
    place: &DeclarationPlace,
) -> Result<Vec<ChosenSetting>, Vec<ScriptProblem>> {
    let mut choices = Vec::new();
    let mut problems = Vec::new();
    let mut trial = Settings::default();
    for (name, value) in map {
        let at = position_of(&file.text, name);
        let read = read_value(name, value).and_then(|chosen| {
            let Some(chosen) = chosen else { return Ok(None) };
            let (line, column, place) = (at.line(), at.position(), place.clone());
            let choice = ChosenSetting { name: name.to_string(), value: chosen, place, line, column };
            apply_choice(&choice, &mut trial).map_err(|error| error.to_string())?;
            Ok(Some(choice))
        });
        match read {
            Ok(choice) => choices.extend(choice),
            Err(what) => problems.push(build_refusal(&file.name, at, what)),
        }
    }
    problems.sort_by_key(|problem| (problem.line, problem.column));
    if problems.is_empty() { Ok(choices) } else { Err(problems) }
}

fn build_refusal(file: &str, at: Position, what: String) -> ScriptProblem {
    match what.split_once("; did you mean ") {
        Some((what, near)) => ScriptProblem::new(file, at, what, format!("did you mean {near}")),
        None => {
            ScriptProblem::new(file, at, what, "`cnc-gateway check --vocabulary` lists the settings with their ranges")
        }
    }
}

/// `None` where nothing is chosen: curves without a row.
fn read_value(name: &str, value: &Dynamic) -> Result<Option<ChosenValue>, String> {
    if let Some(number) = as_number(value) {
        return Ok(Some(ChosenValue::Number(number)));
    }
    if name == LOAD_CURVES {
        return read_curves(value).map(|curves| curves.map(|curves| ChosenValue::Curves(Box::new(curves))));
    }
    let stage = name.strip_prefix("no_load_stage_").and_then(|stage| stage.parse().ok());
    match (stage, value.read_lock::<Array>()) {
        (Some(stage), Some(points)) => points
            .iter()
            .map(read_pair)
            .collect::<Option<Vec<_>>>()
            .map(|pairs| Some(ChosenValue::NoLoad(stage, pairs)))
            .ok_or_else(|| format!("{name} needs pairs of speed in rpm and power in W: [[500, 310.0], [1000, 420.0]]")),
        _ => Err(format!("the setting {name} needs a number, not {}", describe_type(value))),
    }
}

/// The name of the setting that takes curves.
const LOAD_CURVES: &str = "constant_load_curves";

/// `#{ quantity: "cutting_power_w", feed: "feed_mm_min", speed_rpm: 1000.0, tool: "", material: "", rows: [[...], ...] }`; none where
/// there is no row.
fn read_curves(value: &Dynamic) -> Result<Option<LoadCurves>, String> {
    let wrong = |what: &str| format!("{LOAD_CURVES}: {what}");
    let map = value
        .read_lock::<Map>()
        .ok_or_else(|| wrong("needs a map with quantity, feed, speed_rpm, tool, material, rows"))?;
    let text = |key: &str| map.get(key).and_then(|it| it.clone().into_immutable_string().ok()).unwrap_or_default();
    let rows = map.get("rows").and_then(|rows| rows.read_lock::<Array>().map(|rows| rows.clone()));
    let Some(rows) = rows.filter(|rows| !rows.is_empty()) else { return Ok(None) };
    let row = |row: &Dynamic| {
        let numbers: Vec<f64> = row.read_lock::<Array>()?.iter().map(as_number).collect::<Option<_>>()?;
        <[f64; 8]>::try_from(numbers).ok()
    };
    let rows: Vec<[f64; 8]> = rows
        .iter()
        .map(row)
        .collect::<Option<_>>()
        .ok_or_else(|| wrong("each row is depth mm, feed from, feed to, c0, c1, c2, c3, standard deviation"))?;
    let speed_rpm = map.get("speed_rpm").and_then(as_number).unwrap_or(0.0);
    let (quantity, feed, tool, material) = (text("quantity"), text("feed"), text("tool"), text("material"));
    LoadCurves::new((&quantity, &feed), speed_rpm, (&tool, &material), &rows)
        .map(Some)
        .map_err(|what| wrong(&what.to_string()))
}

fn read_pair(value: &Dynamic) -> Option<(f64, f64)> {
    let pair = value.read_lock::<Array>()?;
    match pair.as_slice() {
        [speed_rpm, power_w] => Some((as_number(speed_rpm)?, as_number(power_w)?)),
        _ => None,
    }
}

fn as_number(value: &Dynamic) -> Option<f64> {
    value.as_float().ok().or_else(|| value.as_int().ok().map(|whole| whole as f64))
}

fn apply_choice(choice: &ChosenSetting, settings: &mut Settings) -> Result<(), SettingError> {
    let operation = matches!(choice.place, DeclarationPlace::Operation(_));
    match (&choice.value, &choice.place) {
        (ChosenValue::Number(number), DeclarationPlace::Machine) => settings.set_value(&choice.name, *number),
        (ChosenValue::Number(number), place) => settings.set_for((operation, place.name()), &choice.name, *number),
        (ChosenValue::NoLoad(stage, pairs), _) => settings.set_no_load_table(*stage, pairs),
        (ChosenValue::Curves(curves), _) => {
            settings.set_load_curves((**curves).clone());
            Ok(())
        }
    }
}

/// The settings of all scripts together. One setting given by two scripts, and settings that contradict each other,
/// are problems.
pub(super) fn merge_settings(scripts: &[Arc<Script>], problems: &mut Vec<ScriptProblem>) -> Settings {
    let mut settings = Settings::default();
    let mut given: Vec<(&str, &str)> = Vec::new();
    for script in scripts {
        for choice in &script.choices {
            let other = given.iter().find(|(name, file)| *name == choice.name && **file != *script.file);
            if let Some((_, other)) = other {
                problems.push(report_duplicate(script, choice, other));
            }
            given.push((&choice.name, &script.file));
            if let Err(error) = apply_choice(choice, &mut settings) {
                problems.push(build_refusal(&script.file, Position::NONE, error.to_string()));
            }
        }
    }
    let file = given.first().map_or("scripts", |(_, file)| *file);
    for contradiction in settings.find_contradictions() {
        problems.push(ScriptProblem::new(file, Position::NONE, contradiction.to_string(), ""));
    }
    settings
}

fn report_duplicate(script: &Script, choice: &ChosenSetting, other: &str) -> ScriptProblem {
    ScriptProblem {
        file: script.file.to_string(),
        line: choice.line,
        column: choice.column,
        what: format!("the setting {} is also given in {other}", choice.name),
        next: "keep one of the two".to_owned(),
    }
}
