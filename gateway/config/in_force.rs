//! The configuration as it is in force: every key with its value, where that was written, and what it means. What could be a
//! secret is masked.

use super::channel_keys;
use super::check_value::Scalar;
use super::keys::{SECTIONS, keys_of};
use super::read::{ConfigInput, Origin, SectionValues};
use adapters::address::mask_secrets;
use serde::Serialize;

/// Where a value that is in force was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ValueOrigin {
    /// Nowhere: it is the default that stands in the table of keys.
    Default,
    /// In the configuration that comes with the program, where no file is given.
    BuiltIn,
    /// In the configuration file.
    File,
    /// In a variable of the environment.
    Environment,
    /// In an option of the command line.
    CommandLine,
}

/// A key of the configuration with the value that holds and where it was written.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct InForce {
    /// `[section] key`, or `[[section]] 1 key` where a section may stand several times.
    pub key: String,
    /// The value; `None`: it is not set, and the gateway does without.
    pub value: Option<String>,
    /// Where the value was written.
    pub from: ValueOrigin,
    /// What it does, in English.
    pub en: &'static str,
    /// What it does, in Chinese.
    pub zh: &'static str,
}

pub(super) fn in_force(reading: &ConfigInput<'_>) -> Vec<InForce> {
    let mut all = Vec::new();
    for section in SECTIONS.iter().filter(|section| section.name != channel_keys::SECTION) {
        if !section.repeated {
            let get = |key: &str| reading.get(section.name, key).map(|found| (&found.value, &found.origin));
            append_rows(&mut all, section.name, &format!("[{}]", section.name), reading.is_built_in(), get);
            continue;
        }
        let list: &[SectionValues] = if section.name == "sink" { &reading.sinks } else { &reading.sources };
        for (index, values) in list.iter().enumerate() {
            let get = |key: &str| values.found.get(key).map(|found| (&found.value, &found.origin));
            let title = format!("[[{}]] {}", section.name, index + 1);
            append_rows(&mut all, section.name, &title, reading.is_built_in(), get);
            for (number, values) in values.inner.iter().enumerate() {
                let get = |key: &str| values.found.get(key).map(|found| (&found.value, &found.origin));
                let title = format!("{title} [[{}]] {}", channel_keys::SECTION, number + 1);
                append_rows(&mut all, channel_keys::SECTION, &title, reading.is_built_in(), get);
            }
        }
    }
    all
}

impl super::Config {
    /// Tells of a key that the program itself has set after the text was read: what the demonstration brings along.
    pub fn note_built_in(&mut self, key: &str, value: &std::path::Path) {
        for row in self.in_force.iter_mut().filter(|row| row.key == key) {
            (row.value, row.from) = (Some(value.display().to_string()), ValueOrigin::BuiltIn);
        }
    }
}

fn append_rows<'a>(
    all: &mut Vec<InForce>,
    section: &str,
    title: &str,
    is_built_in: bool,
    get: impl Fn(&str) -> Option<(&'a Scalar, &'a Origin)>,
) {
    for key in keys_of(section) {
        let found = get(key.name);
        let from = match found {
            Some((_, Origin::File(_))) if is_built_in => ValueOrigin::BuiltIn,
            Some((_, Origin::File(_))) => ValueOrigin::File,
            Some((_, Origin::Variable(_))) => ValueOrigin::Environment,
            Some((_, Origin::CommandLine(_))) => ValueOrigin::CommandLine,
            Some((_, Origin::Default)) | None => ValueOrigin::Default,
        };
        let value = found.map(|(value, _)| match value {
            Scalar::Text(text) => mask_secrets(text),
            Scalar::Number(number) => number.to_string(),
            Scalar::Flag(flag) => flag.to_string(),
        });
        all.push(InForce { key: format!("{title} {}", key.name), value, from, en: key.en, zh: key.zh });
    }
}

#[cfg(test)]
mod tests {
    use super::super::keys::{Absent, KEYS, SECTIONS, keys_of};
    use super::super::{BUILT_IN, Config, OptionValue, parse, parse_with};
    use super::ValueOrigin;
    use std::path::Path;

    fn told(config: &Config, key: &str) -> (Option<String>, ValueOrigin) {
        let mut rows = config.in_force.iter().filter(|row| row.key == key);
        let row = rows.next().unwrap_or_else(|| panic!("{key} is not told"));
        assert!(rows.next().is_none(), "{key} stands twice");
        (row.value.clone(), row.from)
    }

    #[test]
    fn every_key_is_told_with_where_it_comes_from() {
        let text = "[gateway]\ntick_hz = 20\n[[source]]\naddress = \"simulated://lathe\"\n";
        let variables = [("CNC_GATEWAY__GATEWAY__NAME".to_owned(), "Seven".to_owned())];
        let config = parse("box.toml", text, Path::new(""), variables).expect("sound");
        assert_eq!(told(&config, "[gateway] tick_hz"), (Some("20".to_owned()), ValueOrigin::File));
        assert_eq!(told(&config, "[gateway] name"), (Some("Seven".to_owned()), ValueOrigin::Environment));
        assert_eq!(told(&config, "[http] tls"), (Some("false".to_owned()), ValueOrigin::Default));
        assert_eq!(told(&config, "[[source]] 1 address"), (Some("simulated://lathe".to_owned()), ValueOrigin::File));
        assert_eq!(told(&config, "[twin] model"), (None, ValueOrigin::Default));
    }

    /// What stands in no file is told too, each key once.
    #[test]
    fn every_default_of_the_table_is_told_as_built_in() {
        let text = "[[source]]\naddress = \"simulated://lathe\"\n";
        let config = parse("box.toml", text, Path::new(""), []).expect("sound");
        for section in SECTIONS.iter().filter(|section| !section.repeated) {
            for key in keys_of(section.name) {
                let (value, from) = told(&config, &format!("[{}] {}", section.name, key.name));
                assert_eq!(from, ValueOrigin::Default, "{}", key.dotted_path());
                assert_eq!(value.is_some(), matches!(key.absent, Absent::Default(_)), "{}", key.dotted_path());
            }
        }
    }

    /// The same value by each way: a file, the configuration of the program, a variable, an option.
    #[test]
    fn every_way_of_setting_a_key_is_told() {
        let source = "[[source]]\naddress = \"simulated://lathe\"\n";
        let mut tried = 0;
        for key in KEYS.iter().filter(|key| !SECTIONS.iter().any(|it| it.repeated && it.name == key.section)) {
            let Absent::Default(value) = key.absent else { continue };
            let text = format!("[{}]\n{} = {value}\n{source}", key.section, key.name);
            let plain = value.trim_matches('"').to_owned();
            let variable = format!("CNC_GATEWAY__{}__{}", key.section.replace('.', "__"), key.name).to_uppercase();
            let option = OptionValue { option: "--option", section: key.section, key: key.name, value: plain.clone() };
            let name = format!("[{}] {}", key.section, key.name);
            let here = Path::new("");
            for (config, from) in [
                (parse("box.toml", &text, here, []), ValueOrigin::File),
                (parse(BUILT_IN, &text, here, []), ValueOrigin::BuiltIn),
                (parse("box.toml", &text, here, [(variable.clone(), plain.clone())]), ValueOrigin::Environment),
                (
                    parse_with("box.toml", &text, here, [(variable.clone(), plain.clone())], &[option]),
                    ValueOrigin::CommandLine,
                ),
            ] {
                let config = config.unwrap_or_else(|problems| panic!("{name}: {problems:?}"));
                assert_eq!(told(&config, &name).1, from, "{name}");
            }
            tried += 1;
        }
        assert!(tried > 40, "{tried} keys");
    }

    #[test]
    fn channels_of_ones_own_and_what_the_program_sets_are_told() {
        let text = "[[source]]\naddress = \"fanuc://10.0.0.5\"\n[[source.channel]]\nname = \"clamping_pressure_bar\"\n\
                    read = \"pmc D20 word\"\n";
        let keys = keys_of("source.channel").count();
        assert!(keys > 5, "{keys} keys of a channel");
        let config = parse("box.toml", text, Path::new(""), []).expect("sound");
        let rows = config.in_force.iter().filter(|row| row.key.starts_with("[[source]] 1 [[source.channel]] 1 "));
        assert_eq!(rows.count(), keys);
        let mut config = parse(BUILT_IN, super::super::BUILT_IN_TEXT, Path::new(""), []).expect("sound");
        config.note_built_in("[twin] model", Path::new("demo-lathe.toml"));
        assert_eq!(told(&config, "[twin] model"), (Some("demo-lathe.toml".to_owned()), ValueOrigin::BuiltIn));
    }
}
