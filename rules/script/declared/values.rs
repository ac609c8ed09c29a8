//! The file with the values of settings, checked against what the scripts declare.

use super::{Declared, Per, SettingValue};
use crate::list_shipped_scripts;
use crate::problem::ScriptProblem;
use adapter_core::channel::find_nearest_name;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use toml::de::{DeTable, DeValue};

/// Bytes of the file with the values.
pub const SETTINGS_TEXT_MAX: usize = 256 * 1024;
/// Values of the file.
const VALUES_MAX: usize = 4096;

/// What a value is for.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DeclarationPlace {
    /// The machine, wherever nothing more special has a value.
    Machine,
    /// One tool, as the channel `tool` names it.
    Tool(String),
    /// One operation, as the channel `operation` names it. It goes before the tool.
    Operation(String),
}

impl DeclarationPlace {
    /// What it is a place of; `None` for the machine.
    #[must_use]
    pub fn per(&self) -> Option<Per> {
        match self {
            Self::Machine => None,
            Self::Tool(_) => Some(Per::Tool),
            Self::Operation(_) => Some(Per::Operation),
        }
    }

    /// The tool or the operation.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Machine => "",
            Self::Tool(name) | Self::Operation(name) => name,
        }
    }
}

impl fmt::Display for DeclarationPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Machine => f.write_str("this machine"),
            Self::Tool(name) => write!(f, "tool {name}"),
            Self::Operation(name) => write!(f, "operation {name}"),
        }
    }
}

/// A value, and where it is written.
#[derive(Debug, Clone, PartialEq)]
struct DeclaredValue {
    value: SettingValue,
    line: usize,
    column: usize,
}

type DeclarationKey = (String, String, DeclarationPlace);

/// Every value of the file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SettingValues {
    file: String,
    chosen: BTreeMap<DeclarationKey, DeclaredValue>,
}

impl SettingValues {
    /// Reads the file; `file` is its name in messages. An empty text chooses nothing.
    ///
    /// # Errors
    /// Everything that is no value of a setting, each with line and column.
    pub fn parse(file: &str, text: &str) -> Result<Self, Vec<ScriptProblem>> {
        let mut reader = DeclarationReader { file, text, problems: Vec::new(), chosen: BTreeMap::new() };
        reader.read();
        match reader.problems.is_empty() {
            true => Ok(Self { file: file.to_owned(), chosen: reader.chosen }),
            false => Err(reader.problems),
        }
    }

    /// Does the file choose nothing?
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.chosen.is_empty()
    }

    /// The value of a setting in this place, where the file has one.
    #[must_use]
    pub fn find_value(&self, section: &str, name: &str, place: &DeclarationPlace) -> Option<&SettingValue> {
        self.chosen.get(&(section.to_owned(), name.to_owned(), place.clone())).map(|chosen| &chosen.value)
    }

    /// Every value: section, name, place, value.
    pub fn list_values(&self) -> impl Iterator<Item = (&str, &str, &DeclarationPlace, &SettingValue)> {
        self.chosen.iter().map(|((section, name, place), chosen)| (&**section, &**name, place, &chosen.value))
    }

    /// The places of one section that have values of their own, besides the machine.
    #[must_use]
    pub fn list_places(&self, section: &str) -> Vec<DeclarationPlace> {
        let of = |key: &&DeclarationKey| key.0 == section && key.2 != DeclarationPlace::Machine;
        self.chosen.keys().filter(of).map(|key| key.2.clone()).collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// Puts a value into a place; `None` takes it out.
    pub fn set_value(&mut self, section: &str, name: &str, place: &DeclarationPlace, value: Option<SettingValue>) {
        let key = (section.to_owned(), name.to_owned(), place.clone());
        match value {
            Some(value) => drop(self.chosen.insert(key, DeclaredValue { value, line: 0, column: 0 })),
            None => drop(self.chosen.remove(&key)),
        }
    }

    /// The file as the gateway writes it: sections and names in the order of the alphabet.
    #[must_use]
    pub fn to_toml_text(&self) -> String {
        let mut text = String::new();
        let mut open = None;
        for ((section, name, place), chosen) in &self.sort_values() {
            let header = (section.clone(), place.clone());
            if open.as_ref() != Some(&header) {
                let below = place.per().map_or(String::new(), |per| format!(".{}.{:?}", per.as_word(), place.name()));
                text += &format!("{}[{section}{below}]\n", if open.is_some() { "\n" } else { "" });
                open = Some(header);
            }
            text += &format!("{name} = {}\n", chosen.value);
        }
        text
    }

    fn sort_values(&self) -> Vec<(DeclarationKey, DeclaredValue)> {
        let mut rows: Vec<(DeclarationKey, DeclaredValue)> =
            self.chosen.iter().map(|(key, it)| (key.clone(), it.clone())).collect();
        rows.sort_by(|(a, _), (b, _)| (&a.0, &a.2, &a.1).cmp(&(&b.0, &b.2, &b.1)));
        rows
    }

    /// Everything of the file that does not fit what is declared. `scripts` are all files, also those without settings.
    #[must_use]
    pub fn list_problems(&self, declared: &[&Declared], scripts: &[&str]) -> Vec<ScriptProblem> {
        let mut problems = Vec::new();
        for ((section, name, place), chosen) in &self.chosen {
            if let Some((what, next)) = describe_problem((section, name, place), &chosen.value, declared, scripts) {
                let (line, column) = (Some(chosen.line), Some(chosen.column));
                problems.push(ScriptProblem { file: self.file.clone(), line, column, what, next });
            }
        }
        problems.sort_by_key(|problem| problem.line);
        problems
    }
}

fn describe_problem(
    (section, name, place): (&str, &str, &DeclarationPlace),
    value: &SettingValue,
    declared: &[&Declared],
    scripts: &[&str],
) -> Option<(String, String)> {
    let own: Vec<&&Declared> = declared.iter().filter(|it| it.section() == section).collect();
    let Some(found) = own.iter().find(|it| it.name == name) else {
        let file = format!("{section}.rhai");
        if !scripts.contains(&&*file) && list_shipped_scripts().iter().any(|script| script.name == file) {
            return None; // A shipped script that was taken out: its settings wait for it.
        }
        if own.is_empty() {
            let sections = declared.iter().map(|it| it.section());
            let near = find_nearest_name(section, sections).map_or_else(
                || "`cnc-gateway check --keys` lists every setting of the scripts".to_owned(),
                |near| format!("did you mean [{near}]?"),
            );
            return Some((format!("no script {file} declares settings"), near));
        }
        let near = find_nearest_name(name, own.iter().map(|it| it.name.as_str()));
        let all = || own.iter().map(|it| it.name.as_str()).collect::<Vec<_>>().join(", ");
        let next = near.map_or_else(|| format!("{file} has {}", all()), |near| format!("did you mean {near}?"));
        return Some((format!("{file} has no setting {name}"), next));
    };
    if let Some(per) = place.per().filter(|per| !found.per.contains(per)) {
        let what = format!("{} has no values for a single {}", found.path(), per.as_word());
        return Some((what, format!("write it in [{section}]")));
    }
    found.explain_refusal(value)
}

struct DeclarationReader<'t> {
    file: &'t str,
    text: &'t str,
    problems: Vec<ScriptProblem>,
    chosen: BTreeMap<DeclarationKey, DeclaredValue>,
}

impl DeclarationReader<'_> {
    fn report_problem(&mut self, at: usize, what: impl Into<String>, next: &str) {
        let (line, column) = self.locate_offset(at);
        let (file, what, next) = (self.file.to_owned(), what.into(), next.to_owned());
        self.problems.push(ScriptProblem { file, line: Some(line), column: Some(column), what, next });
    }

    fn locate_offset(&self, at: usize) -> (usize, usize) {
        let before = self.text.get(..at).unwrap_or(self.text);
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }

    fn read(&mut self) {
        if self.text.len() > SETTINGS_TEXT_MAX {
            return self.report_problem(
                0,
                format!("the file is longer than {SETTINGS_TEXT_MAX} bytes"),
                "drop tools that are gone",
            );
        }
        let (table, errors) = DeTable::parse_recoverable(self.text);
        for error in &errors {
            let next = "write one `name = value` per line, below the section of its script: [constant_load]";
            self.report_problem(
                error.span().map_or(0, |span| span.start),
                format!("not TOML: {}", error.message()),
                next,
            );
        }
        if !errors.is_empty() {
            return;
        }
        for (key, value) in table.get_ref().iter() {
            match value.get_ref().as_table() {
                Some(section) => self.read_section(key.get_ref(), section),
                None => {
                    let what = format!("`{}` stands outside of every section", key.get_ref());
                    self.report_problem(
                        key.span().start,
                        what,
                        "write it below the section of its script, such as [constant_load]",
                    );
                }
            }
        }
        if self.chosen.len() > VALUES_MAX {
            self.report_problem(
                0,
                format!("{} values; at most {VALUES_MAX} are read", self.chosen.len()),
                "drop tools that are gone",
            );
        }
    }

    fn read_section(&mut self, section: &str, table: &DeTable<'_>) {
        for (key, value) in table.iter() {
            let per = Per::ALL.into_iter().find(|per| per.as_word() == key.get_ref().as_ref());
            match (per, value.get_ref().as_table()) {
                (Some(per), Some(names)) => self.read_names(section, per, names),
                _ => self.read_value(
                    section,
                    key.get_ref(),
                    DeclarationPlace::Machine,
                    (key.span().start, value.get_ref()),
                ),
            }
        }
    }

    fn read_names(&mut self, section: &str, per: Per, names: &DeTable<'_>) {
        for (name, values) in names.iter() {
            let Some(values) = values.get_ref().as_table() else {
                let what = format!("`{}` is no section", name.get_ref());
                self.report_problem(name.span().start, what, "write [constant_load.tool.T3] and the values below it");
                continue;
            };
            let name = name.get_ref().to_string();
            for (key, value) in values.iter() {
                let place = match per {
                    Per::Tool => DeclarationPlace::Tool(name.clone()),
                    Per::Operation => DeclarationPlace::Operation(name.clone()),
                };
                self.read_value(section, key.get_ref(), place, (key.span().start, value.get_ref()));
            }
        }
    }

    fn read_value(&mut self, section: &str, name: &str, place: DeclarationPlace, (at, value): (usize, &DeValue<'_>)) {
        let number = match value {
            DeValue::Float(number) => number.as_str().replace('_', "").parse::<f64>().ok(),
            DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix()).ok().map(|it| it as f64),
            DeValue::Boolean(flag) => Some(f64::from(u8::from(*flag))),
            _ => None,
        };
        let value = match (number.filter(|number| number.is_finite()), value.as_str()) {
            (Some(number), _) => SettingValue::Number(number),
            (None, Some(text)) => SettingValue::Text(text.to_owned()),
            (None, None) => {
                return self.report_problem(
                    at,
                    format!("{section}.{name} is neither a number nor a text"),
                    "write a number, or a text in \"quotes\"",
                );
            }
        };
        let (line, column) = self.locate_offset(at);
        self.chosen.insert((section.to_owned(), name.to_owned(), place), DeclaredValue { value, line, column });
    }
}
