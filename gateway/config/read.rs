//! From text to checked values: walks the file by the table of keys and collects every problem on the way.

use super::channel_keys;
use super::check_value::{Scalar, check_scalar, check_written};
use super::keys::{Absent, ConfigKey, SECTIONS, Section, find_key, find_section, keys_of};
use super::problem::Problem;
use adapters::channel::find_nearest_name;
use std::collections::BTreeMap;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Where a value was written.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Origin {
    /// Byte offset in the file.
    File(usize),
    /// The environment variable of this name.
    Variable(String),
    /// The option of the command line with this name, such as `--listen`.
    CommandLine(&'static str),
    /// Nowhere: the default of the table.
    Default,
}

/// A value that an option of the command line gives to a key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OptionValue {
    /// The option as it is typed, such as `--listen`.
    pub option: &'static str,
    /// Section of the key, without brackets.
    pub section: &'static str,
    /// Name of the key.
    pub key: &'static str,
    /// What was typed behind it.
    pub value: String,
}

/// A checked value and where it was written.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LocatedValue {
    pub(super) value: Scalar,
    pub(super) origin: Origin,
}

/// One section as found: values by key name, and where it begins.
#[derive(Debug, Clone, Default)]
pub(super) struct SectionValues {
    pub(super) found: BTreeMap<&'static str, LocatedValue>,
    /// Sections written several times below this one.
    pub(super) inner: Vec<SectionValues>,
    offset: Option<usize>,
}

impl SectionValues {
    /// Where a key was written, or where its section begins.
    pub(super) fn find_origin(&self, key: &str) -> Origin {
        let section = self.offset.map_or(Origin::Default, Origin::File);
        let written = self.found.get(key).map(|found| found.origin.clone());
        written.filter(|origin| *origin != Origin::Default).unwrap_or(section)
    }
}

/// Everything found in the file and the environment.
#[derive(Debug, Default)]
pub(super) struct ConfigInput<'a> {
    file: &'a str,
    text: &'a str,
    single: BTreeMap<&'static str, SectionValues>,
    pub(super) sources: Vec<SectionValues>,
    pub(super) sinks: Vec<SectionValues>,
    pub(super) problems: Vec<Problem>,
    /// Keys that problems are about: whoever has misspelt one is not told that it is missing too.
    misread: Vec<MisreadKey>,
}

/// A key that a problem is about.
#[derive(Debug)]
struct MisreadKey {
    section: &'static str,
    /// Where its section begins in the file; a variable has none.
    begins: Option<usize>,
    /// As it was written.
    name: String,
    /// The line of the problem.
    line: Option<usize>,
}

impl<'a> ConfigInput<'a> {
    /// Reads `text`; `file` is its name in messages.
    pub(super) fn from_text(file: &'a str, text: &'a str) -> Self {
        let mut reading = Self { file, text, ..Self::default() };
        let (table, errors) = DeTable::parse_recoverable(text);
        for error in &errors {
            reading.add_syntax_problem(error);
        }
        let broken: Vec<_> = reading.problems.iter().map(|problem| problem.line).collect();
        for (name, value) in table.get_ref().iter() {
            reading.read_section(name, value);
        }
        let syntax = errors.len();
        let (found, semantic) = reading.problems.split_at(syntax);
        let semantic = semantic.iter().filter(|problem| !broken.contains(&problem.line));
        reading.problems = found.iter().chain(semantic).cloned().collect();
        reading.misread.retain(|key| !broken.contains(&key.line));
        reading
    }

    fn add_syntax_problem(&mut self, error: &toml::de::Error) {
        let what = format!("this is not TOML: {}", error.message());
        let next = "write one `key = value` per line; text stands in \"quotes\"";
        let problem = Problem::in_file(self.file, what, next);
        self.problems.push(problem.with_position(self.text, error.span().map_or(0, |span| span.start)));
    }

    /// Adds a problem at an origin.
    pub(super) fn add_problem(&mut self, origin: &Origin, what: impl Into<String>, next: impl Into<String>) {
        let problem = match origin {
            Origin::File(offset) => Problem::in_file(self.file, what, next).with_position(self.text, *offset),
            Origin::Variable(name) => Problem::in_file(name.clone(), what, next),
            Origin::CommandLine(option) => Problem::in_file(*option, what, next),
            Origin::Default => Problem::in_file(self.file, what, next),
        };
        self.problems.push(problem);
    }

    /// Notes that a problem is about this key of a section.
    fn note_misread(&mut self, section: &'static Section, begins: Option<usize>, name: &str) {
        let line = self.problems.last().and_then(|problem| problem.line);
        self.misread.push(MisreadKey { section: section.name, begins, name: name.to_owned(), line });
    }

    fn read_section(&mut self, name: &Spanned<std::borrow::Cow<'_, str>>, value: &Spanned<DeValue<'_>>) {
        let at = Origin::File(name.span().start);
        let Some(section) = find_section(name.get_ref()) else {
            let outside = !matches!(value.get_ref(), DeValue::Table(_) | DeValue::Array(_));
            let stands = format!("`{}` stands outside every section", name.get_ref());
            let what = if outside { stands } else { unknown_section(name.get_ref()) };
            return self.add_problem(&at, what, section_hint(name.get_ref()));
        };
        match (section.repeated, value.get_ref()) {
            (false, DeValue::Table(table)) => {
                let values = self.read_values(section, table, name.span().start);
                self.single.insert(section.name, values);
            }
            (true, DeValue::Array(items)) => {
                for item in items.iter() {
                    self.read_repeated_section(section, item);
                }
            }
            (true, DeValue::Table(_)) => self.add_problem(
                &at,
                format!("[{0}] can stand there several times and is written with two brackets", section.name),
                format!("write [[{}]]", section.name),
            ),
            _ => self.add_problem(&at, format!("{} is a section", section.name), format!("write [{}]", section.name)),
        }
    }

    fn read_repeated_section(&mut self, section: &'static Section, item: &Spanned<DeValue<'_>>) {
        let start = item.span().start;
        match item.get_ref() {
            DeValue::Table(table) => {
                let values = self.read_values(section, table, start);
                self.repeated_sections_mut(section).push(values);
            }
            other => self.add_problem(
                &Origin::File(start),
                format!("{} holds a {}", section.name, other.type_str()),
                format!("write each one as a section [[{}]]", section.name),
            ),
        }
    }

    /// A section below another one; those that can stand there several times belong to the one above.
    fn read_inner_section(
        &mut self,
        section: &'static Section,
        value: &Spanned<DeValue<'_>>,
        offset: usize,
    ) -> Vec<SectionValues> {
        match (section.repeated, value.get_ref()) {
            (false, DeValue::Table(table)) => {
                let found = self.read_values(section, table, offset);
                self.single.insert(section.name, found);
                Vec::new()
            }
            (true, DeValue::Array(items)) if items.iter().all(|item| matches!(item.get_ref(), DeValue::Table(_))) => {
                let tables = items.iter().filter_map(|item| match item.get_ref() {
                    DeValue::Table(table) => Some((table, item.span().start)),
                    _ => None,
                });
                tables.map(|(table, start)| self.read_values(section, table, start)).collect()
            }
            (repeated, _) => {
                let (open, close) = if repeated { ("[[", "]]") } else { ("[", "]") };
                let next = format!("write {open}{}{close}", section.name);
                self.add_problem(&Origin::File(offset), format!("{} is a section", section.name), next);
                Vec::new()
            }
        }
    }

    fn read_values(&mut self, section: &'static Section, table: &DeTable<'_>, offset: usize) -> SectionValues {
        let mut values = SectionValues { offset: Some(offset), ..SectionValues::default() };
        for (name, value) in table.iter() {
            let within = find_section(&format!("{}.{}", section.name, name.get_ref()));
            if let Some(within) = within {
                let found = self.read_inner_section(within, value, name.span().start);
                values.inner.extend(found);
                continue;
            }
            let Some(key) = find_key(section.name, name.get_ref()) else {
                let at = Origin::File(name.span().start);
                let what = format!("[{}] has no key `{}`", section.name, name.get_ref());
                self.add_problem(&at, what, key_hint(section.name, name.get_ref()));
                self.note_misread(section, Some(offset), name.get_ref());
                continue;
            };
            let origin = Origin::File(value.span().start);
            match check_written(key, value.get_ref()) {
                Ok(value) => drop(values.found.insert(key.name, LocatedValue { value, origin })),
                Err((what, next)) => {
                    self.add_problem(&origin, what, next);
                    self.note_misread(section, Some(offset), key.name);
                }
            }
        }
        values
    }

    /// Overlays an option of the command line, which goes before everything else.
    pub(super) fn overlay_option(&mut self, given: &OptionValue) {
        let origin = Origin::CommandLine(given.option);
        let (Some(section), Some(key)) = (find_section(given.section), find_key(given.section, given.key)) else {
            return self.add_problem(&origin, "this option names no key", "");
        };
        match check_scalar(key, &given.value) {
            Ok(value) => {
                drop(self.section_values_mut(section, None).found.insert(key.name, LocatedValue { value, origin }))
            }
            Err((what, next)) => self.add_problem(&origin, what, next),
        }
    }

    /// Is this the configuration that comes with the program?
    pub(super) fn is_built_in(&self) -> bool {
        self.file == super::BUILT_IN
    }

    /// Overlays an environment variable whose name begins with the prefix.
    pub(super) fn overlay_variable(&mut self, name: &str, prefix: &str, text: &str) {
        let origin = Origin::Variable(name.to_owned());
        let path = name[prefix.len()..].to_lowercase();
        let parts: Vec<&str> = path.split("__").collect();
        let within = parts.get(..2).map(|outer| outer.join(".")).filter(|name| find_section(name).is_some());
        let (section, index, key_name) = match parts[..] {
            [section, key] => (section, None, key),
            [.., key] if within.is_some() && parts.len() == 3 => (within.as_deref().unwrap_or_default(), None, key),
            [section, index, key] => (section, index.parse::<usize>().ok(), key),
            _ => return self.add_problem(&origin, "this variable names no key", variable_form(prefix)),
        };
        let Some(known) = find_section(section) else {
            return self.add_problem(&origin, unknown_section(section), section_hint(section));
        };
        let count = self.repeated_sections_mut(known).len();
        if known.repeated != index.is_some() || index.is_some_and(|index| index > count) {
            return self.add_problem(&origin, "this variable names no key", variable_form(prefix));
        }
        let Some(key) = find_key(known.name, key_name) else {
            let what = format!("[{section}] has no key `{key_name}`");
            self.note_misread(known, None, key_name);
            return self.add_problem(&origin, what, key_hint(known.name, key_name));
        };
        match check_scalar(key, text) {
            Ok(value) => {
                drop(self.section_values_mut(known, index).found.insert(key.name, LocatedValue { value, origin }))
            }
            Err((what, next)) => {
                self.add_problem(&origin, what, next);
                self.note_misread(known, None, key.name);
            }
        }
    }

    fn section_values_mut(&mut self, section: &'static Section, index: Option<usize>) -> &mut SectionValues {
        match index {
            Some(index) => {
                let list = self.repeated_sections_mut(section);
                if index >= list.len() {
                    list.push(SectionValues::default());
                }
                let last = list.len() - 1;
                &mut list[index.min(last)]
            }
            None => self.single.entry(section.name).or_default(),
        }
    }

    /// Fills in the defaults and reports required keys that are missing.
    pub(super) fn complete_sections(&mut self) {
        for section in SECTIONS.iter().filter(|section| !section.repeated) {
            let mut values = self.single.remove(section.name).unwrap_or_default();
            self.fill_section(section, &mut values);
            self.single.insert(section.name, values);
        }
        for section in SECTIONS.iter().filter(|section| section.repeated && section.name != channel_keys::SECTION) {
            let mut list = std::mem::take(self.repeated_sections_mut(section));
            list.iter_mut().for_each(|values| self.fill_with_channels(section, values));
            *self.repeated_sections_mut(section) = list;
        }
    }

    /// What is collected of a section that may stand there several times.
    fn repeated_sections_mut(&mut self, section: &Section) -> &mut Vec<SectionValues> {
        if section.name == "sink" { &mut self.sinks } else { &mut self.sources }
    }

    fn fill_with_channels(&mut self, section: &'static Section, values: &mut SectionValues) {
        self.fill_section(section, values);
        for channel in &mut values.inner {
            find_section(channel_keys::SECTION).into_iter().for_each(|section| self.fill_section(section, channel));
        }
    }

    fn fill_section(&mut self, section: &'static Section, values: &mut SectionValues) {
        for key in keys_of(section.name) {
            match key.absent {
                Absent::Default(text) => fill_default(key, text, values),
                Absent::Required if !values.found.contains_key(key.name) => {
                    self.report_missing_key(section, key, values.offset)
                }
                Absent::Required | Absent::Optional => {}
            }
        }
    }

    fn report_missing_key(&mut self, section: &'static Section, key: &ConfigKey, offset: Option<usize>) {
        // A longer name that holds this one, such as `addresses`, is a misspelt one.
        let misread = |it: &MisreadKey| it.section == section.name && it.begins == offset && it.name.contains(key.name);
        if !self.misread.iter().any(misread) {
            let origin = offset.map_or(Origin::Default, Origin::File);
            self.add_problem(&origin, format!("[[{}]] needs the key `{}`", section.name, key.name), key.en);
            self.note_misread(section, offset, key.name);
        }
    }

    /// A value of a section that is written once.
    pub(super) fn get(&self, section: &str, key: &str) -> Option<&LocatedValue> {
        self.single.get(section).and_then(|values| values.found.get(key))
    }
}

fn fill_default(key: &'static ConfigKey, text: &str, values: &mut SectionValues) {
    if let Ok(value) = check_scalar(key, text.trim_matches('"')) {
        values.found.entry(key.name).or_insert(LocatedValue { value, origin: Origin::Default });
    }
}

fn unknown_section(name: &str) -> String {
    format!("there is no section [{name}]")
}

fn section_hint(name: &str) -> String {
    let homes: Vec<String> = SECTIONS
        .iter()
        .filter(|section| find_key(section.name, name).is_some())
        .map(|section| format!("[{}]", section.name))
        .collect();
    if !homes.is_empty() {
        return format!("`{name}` belongs under {}", homes.join(" or "));
    }
    let names = SECTIONS.iter().map(|section| section.name);
    match find_nearest_name(name, names.clone()) {
        Some(near) => format!("did you mean [{near}]?"),
        None => format!("the sections are {}", names.collect::<Vec<_>>().join(", ")),
    }
}

fn key_hint(section: &str, name: &str) -> String {
    let names: Vec<&str> = keys_of(section).map(|key| key.name).collect();
    let begins = || names.iter().copied().find(|key| key.starts_with(name));
    if let Some(near) = find_nearest_name(name, names.iter().copied()).or_else(begins) {
        return format!("did you mean `{near}`?");
    }
    match SECTIONS.iter().find(|other| find_key(other.name, name).is_some()) {
        Some(other) => format!("`{name}` belongs under [{}]", other.name),
        None => format!("the keys here are {}", names.join(", ")),
    }
}

fn variable_form(prefix: &str) -> String {
    format!("write {prefix}SECTION__KEY, for sources {prefix}SOURCE__0__ADDRESS; sources and sinks count from 0")
}
