//! The configuration as it is in force: every key with its value, where that was written, and what it means. What could be a
//! secret is masked.

use super::channel_keys;
use super::check_value::Scalar;
use super::keys::{SECTIONS, keys_of};
use super::read::{ConfigInput, Origin, SectionValues};
use adapters::address::mask_secrets;
use serde::Serialize;

/// A key of the configuration with the value that holds and where it was written.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct InForce {
    /// `[section] key`, or `[[section]] 1 key` where a section may stand several times.
    pub key: String,
    /// The value; `None`: it is not set, and the gateway does without.
    pub value: Option<String>,
    /// `default`, `file` or `environment`.
    pub from: &'static str,
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
            append_rows(&mut all, section.name, &format!("[{}]", section.name), get);
            continue;
        }
        let list: &[SectionValues] = if section.name == "sink" { &reading.sinks } else { &reading.sources };
        for (index, values) in list.iter().enumerate() {
            let get = |key: &str| values.found.get(key).map(|found| (&found.value, &found.origin));
            append_rows(&mut all, section.name, &format!("[[{}]] {}", section.name, index + 1), get);
        }
    }
    all
}

fn append_rows<'a>(
    all: &mut Vec<InForce>,
    section: &str,
    title: &str,
    get: impl Fn(&str) -> Option<(&'a Scalar, &'a Origin)>,
) {
    for key in keys_of(section) {
        let found = get(key.name);
        let from = match found {
            Some((_, Origin::File(_))) => "file",
            Some((_, Origin::Variable(_))) => "environment",
            _ => "default",
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
    use std::path::Path;

    #[test]
    fn every_key_is_told_with_where_it_comes_from() {
        let text = "[gateway]\ntick_hz = 20\n[[source]]\naddress = \"simulated://lathe\"\n";
        let variables = [("CNC_GATEWAY__GATEWAY__NAME".to_owned(), "Seven".to_owned())];
        let config = super::super::parse("box.toml", text, Path::new(""), variables).expect("sound");
        let told = |key: &str| {
            let row = config.in_force.iter().find(|row| row.key == key).expect(key);
            (row.value.clone(), row.from)
        };
        assert_eq!(told("[gateway] tick_hz"), (Some("20".to_owned()), "file"));
        assert_eq!(told("[gateway] name"), (Some("Seven".to_owned()), "environment"));
        assert_eq!(told("[http] tls"), (Some("false".to_owned()), "default"));
        assert_eq!(told("[[source]] 1 address"), (Some("simulated://lathe".to_owned()), "file"));
        assert_eq!(told("[twin] model"), (None, "default"));
    }
}
