//! The settings of the scripts: what they declare, what is in force on this machine, who has changed it.
//!
//! The values stand in `settings.toml` in the data directory. A person may edit it; the box reads it again within a second. The page
//! and the interface change it through [`change_setting`], which tries every script with the new values first and writes the name of the person
//! into the first line, with a digest of the rest: a file that somebody has edited by hand afterwards is not taken for theirs.
//!
//! Two persons may change one setting: each change names the value that it began from, and who comes second is told ([`Refused`]).

use adapter_core::channel::quantity::space_unit;
use gateway_base::files::compute_digest;
use gateway_base::files::{read_text, replace_file};
use gateway_history::Event;
use rules::script::{
    DeclarationPlace, Declared, SETTINGS_TEXT_MAX, ScriptFile, ScriptProblem, SettingValue, SettingValues, prepare_with,
};
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Name of the file in the data directory.
pub const FILE: &str = "settings.toml";
/// Kind of the events that tell a change.
pub const KIND: &str = "setting_changed";
/// Who has changed a file that no person was signed in for.
const BY_HAND: &str = "the file settings.toml";
/// Changes of one setting that the document tells, the newest first.
const CHANGES_MAX: usize = 5;
/// Events that are looked through for them, the newest: more changes than a shop makes in years.
pub const EVENTS_MAX: u32 = 2000;
/// One change at a time: from reading the file to writing it, nobody else changes it.
static CHANGING: Mutex<()> = Mutex::new(());

/// Where the values stand.
#[must_use]
pub fn values_path(data_dir: &Path) -> PathBuf {
    data_dir.join(FILE)
}

/// The text of the file; empty where it is not there.
///
/// # Errors
/// It is there and cannot be read.
pub fn read_values_text(path: &Path) -> Result<String, Vec<ScriptProblem>> {
    match read_text(path, SETTINGS_TEXT_MAX) {
        Ok(text) => Ok(text),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(String::new()),
        Err(error) => {
            let (file, what) = (path.display().to_string(), format!("the settings cannot be read: {error}"));
            let next = "save it as UTF-8 text, or take it away: then every setting has its default".to_owned();
            Err(vec![ScriptProblem { file, line: None, column: None, what, next }])
        }
    }
}

/// The values of the file; none where it is not there.
///
/// # Errors
/// Everything in it that is no value.
pub fn read(path: &Path) -> Result<SettingValues, Vec<ScriptProblem>> {
    SettingValues::parse(FILE, &read_values_text(path)?)
}

/// One setting that is to have another value.
#[derive(Debug, Clone, PartialEq)]
pub struct NewSetting {
    /// Section: the name of the script without its ending.
    pub script: String,
    /// Name of the setting.
    pub name: String,
    /// For which tool or operation, or the machine.
    pub place: DeclarationPlace,
    /// The value; `None`: as everywhere else again, or the default.
    pub value: Option<SettingValue>,
    /// What stood in the file when the person began, as the document gives it in `written`; `None`: whatever stands there.
    pub began_from: Option<String>,
}

/// Why a setting was not changed.
#[derive(Debug, Clone, PartialEq)]
pub enum Refused {
    /// Somebody else has changed it since the person began.
    Meanwhile {
        /// Section and setting with a dot between them, as in `constant_load.target_w`.
        path: String,
        /// What stands in the file now; empty where nothing is chosen.
        now: String,
        /// Who has written the file.
        by: String,
    },
    /// The value cannot be used.
    Problems(Vec<ScriptProblem>),
}

impl From<Vec<ScriptProblem>> for Refused {
    fn from(problems: Vec<ScriptProblem>) -> Self {
        Self::Problems(problems)
    }
}

/// A value as the file has it; empty where it has none.
fn format_value(value: Option<&SettingValue>) -> String {
    value.map(ToString::to_string).unwrap_or_default()
}

/// Changes one setting when every script compiles and every trial passes with it. Tells what was changed, from what to what.
///
/// # Errors
/// Why the value cannot be used, or that somebody else was quicker; nothing has been changed then.
pub fn change_setting(data_dir: &Path, files: &[ScriptFile], wanted: &NewSetting, by: &str) -> Result<String, Refused> {
    let _one_at_a_time = CHANGING.lock().unwrap_or_else(PoisonError::into_inner);
    let path = values_path(data_dir);
    let before_text = read_values_text(&path)?;
    let before = SettingValues::parse(FILE, &before_text)?;
    let mut after = before.clone();
    let NewSetting { script, name, place, value, began_from } = wanted;
    let now = format_value(before.find_value(script, name, place));
    if began_from.as_ref().is_some_and(|began| *began != now) {
        return Err(Refused::Meanwhile { path: format!("{script}.{name}"), now, by: find_author(&before_text) });
    }
    after.set_value(script, name, place, value.clone());
    // Read again, so that a message names the line on which the value would stand.
    let body = after.to_toml_text();
    let after = SettingValues::parse(FILE, &body)?;
    let set = prepare_with(files, &after)?;
    let declared: Vec<&Declared> = set.declared_settings().collect();
    let words = list_changes(&before, &after, &declared)
        .iter()
        .map(SettingChange::describe_change)
        .collect::<Vec<_>>()
        .join(", ");
    replace_file(&path, &sign_text(&body, by)).map_err(|error| {
        let (file, what) = (path.display().to_string(), format!("the settings cannot be written: {error}"));
        vec![ScriptProblem { file, line: None, column: None, what, next: "look at the data directory".to_owned() }]
    })?;
    Ok(if words.is_empty() { format!("{script}.{name} stays as it is") } else { words })
}

/// The text of the file with the name of whoever has written it, in the place of any other name.
#[must_use]
pub fn sign_text(text: &str, by: &str) -> String {
    let body = text.split_once('\n').filter(|(first, _)| first.starts_with("# set by ")).map_or(text, |(_, body)| body);
    let digest = compute_digest(body.as_bytes());
    format!("# set by {by:?} {digest:016x}\n{body}")
}

/// Who has written this text: the person whom the first line names, where the rest is still what that person has left.
#[must_use]
pub fn find_author(text: &str) -> String {
    let named = || {
        let (first, body) = text.split_once('\n')?;
        let (by, its) = first.strip_prefix("# set by \"")?.rsplit_once("\" ")?;
        (its == format!("{:016x}", compute_digest(body.as_bytes()))).then(|| by.to_owned())
    };
    named().unwrap_or_else(|| BY_HAND.to_owned())
}

/// A setting that has another value than before.
#[derive(Debug, Clone, PartialEq)]
pub struct SettingChange {
    /// Section and setting with a dot between them, as in `constant_load.target_w`.
    pub path: String,
    /// Machine, tool or operation that it holds for.
    pub place: DeclarationPlace,
    /// Unit symbol of both values.
    pub unit: String,
    /// The value before; of the machine the default where none was set.
    pub before: String,
    /// The value now; `as the machine` where a tool or operation has none.
    pub after: String,
}

impl SettingChange {
    /// In words, for the audit and the history.
    #[must_use]
    pub fn describe_change(&self) -> String {
        let Self { path, place, unit, before, after } = self;
        let place = if *place == DeclarationPlace::Machine { String::new() } else { format!(" for {place}") };
        format!("{path}{place}: {before} -> {after}{}", space_unit(unit))
    }

    /// The detail of its event.
    #[must_use]
    pub fn build_detail(&self, by: &str) -> Value {
        json!({ "setting": self.path, "place": self.place.to_string(), "unit": self.unit, "before": self.before,
            "after": self.after, "by": by })
    }
}

/// Every setting that has another value.
#[must_use]
pub fn list_changes(before: &SettingValues, after: &SettingValues, declared: &[&Declared]) -> Vec<SettingChange> {
    let mut found = Vec::new();
    for it in declared {
        let mut places = vec![DeclarationPlace::Machine];
        places.extend(before.list_places(it.section()).into_iter().chain(after.list_places(it.section())));
        places.sort();
        places.dedup();
        for place in places {
            let of = |values: &SettingValues| values.find_value(it.section(), &it.name, &place).cloned();
            let (old, new) = (of(before), of(after));
            if old == new {
                continue;
            }
            let usual =
                if place == DeclarationPlace::Machine { it.default.to_string() } else { "as the machine".to_owned() };
            let word = |value: Option<SettingValue>| value.map_or_else(|| usual.clone(), |value| value.to_string());
            let (before, after) = (word(old), word(new));
            found.push(SettingChange { path: it.path(), place, unit: it.unit.clone(), before, after });
        }
    }
    found
}

/// What events of [`KIND`] tell, the newest first: when, which setting, for what, from what to what, by whom.
#[must_use]
pub fn told_changes(events: &[Event]) -> Vec<Value> {
    let mut newest_first: Vec<&Event> = events.iter().collect();
    newest_first.sort_by_key(|it| std::cmp::Reverse(it.at_ns));
    let change = |it: &&Event| {
        let told: Value = serde_json::from_str(&it.detail).ok()?;
        // Earlier versions put the JSON of a notice into a text once more.
        let told = if let Value::String(text) = told { serde_json::from_str(&text).ok()? } else { told };
        let Value::Object(mut detail) = told else { return None };
        detail.insert("at_ms".to_owned(), json!(it.at_ns / 1_000_000));
        Some(Value::Object(detail))
    };
    newest_first.iter().filter_map(change).collect()
}

/// Every declared setting with what is in force, and who changed it last: `settings/1`. `told` is of [`told_changes`].
#[must_use]
pub fn build_document<'a>(
    declared: impl Iterator<Item = &'a Declared>,
    values: &SettingValues,
    told: &[Value],
) -> Value {
    let rows: Vec<Value> = declared.map(|it| build_row(it, values, told)).collect();
    json!({ "schema": "settings/1", "settings": rows })
}

fn json_of(value: &SettingValue) -> Value {
    match value {
        SettingValue::Number(number) => json!(number),
        SettingValue::Text(text) => json!(text),
    }
}

fn build_row(it: &Declared, values: &SettingValues, told: &[Value]) -> Value {
    let path = it.path();
    let changes: Vec<&Value> = told.iter().filter(|change| change["setting"] == path).take(CHANGES_MAX).collect();
    let of = |place: &DeclarationPlace| values.find_value(it.section(), &it.name, place);
    let special: Vec<Value> = values
        .list_places(it.section())
        .iter()
        .filter_map(|place| {
            let mut row = Map::new();
            row.insert(place.per()?.as_word().to_owned(), json!(place.name()));
            row.insert("value".to_owned(), json_of(of(place)?));
            row.insert("written".to_owned(), json!(format_value(of(place))));
            Some(Value::Object(row))
        })
        .collect();
    json!({
        "script": it.section(), "name": it.name, "value": json_of(of(&DeclarationPlace::Machine).unwrap_or(&it.default)),
        "chosen": of(&DeclarationPlace::Machine).is_some(), "written": format_value(of(&DeclarationPlace::Machine)),
        "default": json_of(&it.default), "unit": it.unit,
        "least": it.range.map(|range| range.0), "greatest": it.range.map(|range| range.1), "whole": it.whole,
        "one_of": it.one_of, "per": it.per.iter().map(|per| per.as_word()).collect::<Vec<_>>(), "special": special,
        "en": it.en, "zh": it.zh, "changes": changes,
    })
}

/// The settings as a table, as `check --keys` prints it.
#[must_use]
pub fn format_table(declared: &[Declared]) -> String {
    let mut text = String::from("\nSettings of the scripts: settings.toml in the data directory\n");
    let mut section = "";
    for it in declared {
        if it.section() != section {
            section = it.section();
            text += &format!("\n[{section}]\n");
        }
        let per: Vec<&str> = it.per.iter().map(|per| per.as_word()).collect();
        let per = if per.is_empty() { String::new() } else { format!("; also per {}", per.join(" and ")) };
        text += &format!("{} = {}\n    {}{per}. {}\n", it.name, it.default, it.describe_range(), it.en);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCRIPT: &str = "const X = setting(\"x_w\", 5.0, #{ unit: \"W\", min: 0, max: 10, per: [\"tool\"], en: \"a\", zh: \"b\" });\n\
        alarm_when(\"over\", (cutting_power_w ?? 0.0) > X, 0.0, \"over\");";

    #[test]
    fn a_change_of_a_pure_number_carries_no_one() {
        let change = |unit: &str| SettingChange {
            path: "tool_wear.limit_parts".to_owned(),
            place: DeclarationPlace::Machine,
            unit: unit.to_owned(),
            before: "3.0".to_owned(),
            after: "4.0".to_owned(),
        };
        assert_eq!(change("1").describe_change(), "tool_wear.limit_parts: 3.0 -> 4.0");
        assert_eq!(change("").describe_change(), "tool_wear.limit_parts: 3.0 -> 4.0");
        assert_eq!(change("W").describe_change(), "tool_wear.limit_parts: 3.0 -> 4.0 W");
    }

    #[test]
    fn a_setting_is_tried_written_and_told_with_its_author() {
        let directory = tempfile::tempdir().expect("a directory");
        let files = [ScriptFile { name: "one.rhai".to_owned(), text: SCRIPT.to_owned() }];
        let mut wanted = NewSetting {
            script: "one".to_owned(),
            name: "x_w".to_owned(),
            place: DeclarationPlace::Machine,
            value: Some(SettingValue::Number(7.0)),
            began_from: Some(String::new()),
        };
        assert_eq!(change_setting(directory.path(), &files, &wanted, "Li").as_deref(), Ok("one.x_w: 5.0 -> 7.0 W"));
        let written = std::fs::read_to_string(values_path(directory.path())).expect("written");
        assert_eq!(find_author(&written), "Li", "{written}");
        assert_eq!(find_author(&written.replace("7.0", "8.0")), BY_HAND);
        wanted.value = Some(SettingValue::Number(6.0));
        let meanwhile = Refused::Meanwhile { path: "one.x_w".to_owned(), now: "7.0".to_owned(), by: "Li".to_owned() };
        assert_eq!(
            change_setting(directory.path(), &files, &wanted, "Wu"),
            Err(meanwhile),
            "Wu began before Li was done"
        );
        assert_eq!(std::fs::read_to_string(values_path(directory.path())).expect("kept"), written, "nothing is lost");
        (wanted.value, wanted.began_from) = (Some(SettingValue::Number(7.0)), None);
        wanted.place = DeclarationPlace::Tool("T 1".to_owned());
        assert_eq!(
            change_setting(directory.path(), &files, &wanted, "Wu").as_deref(),
            Ok("one.x_w for tool T 1: as the machine -> 7.0 W")
        );
        wanted.value = Some(SettingValue::Number(11.0));
        let refused = change_setting(directory.path(), &files, &wanted, "Wu").expect_err("out of range");
        let Refused::Problems(refused) = refused else { panic!("{refused:?}") };
        assert!(refused[0].what.contains("outside 0 to 10 W"), "{refused:?}");
        let values = read(&values_path(directory.path())).expect("readable");
        let declared = rules::script::list_declarations(&files).expect("readable");
        let told = |at_ns, after: &str| Event {
            at_ns,
            kind: KIND.to_owned(),
            source: "scripts".to_owned(),
            text: String::new(),
            detail: json!(
                json!({ "setting": "one.x_w", "place": "this machine", "before": "5.0", "after": after, "by": "Li" })
                    .to_string()
            )
            .to_string(),
        };
        let changes = told_changes(&[told(1_000_000, "6.0"), told(2_000_000, "7.0")]);
        let document = build_document(declared.iter(), &values, &changes);
        assert_eq!(document["settings"][0]["changes"][0]["after"], "7.0", "the newest first");
        assert_eq!(document["settings"][0]["written"], "7.0");
        assert_eq!(document["settings"][0]["special"][0]["tool"], "T 1");
        assert_eq!((&document["settings"][0]["value"], &document["settings"][0]["least"]), (&json!(7.0), &json!(0.0)));
    }
}
