//! The table of keys as a reader sees it: what `check --keys` and `check --example` print.

use super::keys::Absent::{self, Default, Optional, Required};
use super::keys::{ConfigKey, KEYS, NAME_MAX, SECTIONS, ValueKind, find_section, keys_of};
use gateway_base::machine_path::WORD_FORM;

impl ValueKind {
    /// What is accepted, as a reader of the table needs it.
    #[must_use]
    pub fn describe_range(&self) -> String {
        match self {
            Self::Text => "text".to_string(),
            Self::Name => format!("text of at most {NAME_MAX} letters"),
            Self::OneOf(words) => words.join(", "),
            Self::Number(min, max) => format!("{min} to {max}"),
            Self::Flag => "true, false".to_string(),
            Self::Path => "path".to_string(),
            Self::Listen => "HOST:PORT".to_string(),
            Self::Address | Self::SinkAddress => "address".to_string(),
            Self::PlantPath => format!("1 to 4 words with / between, each {WORD_FORM}"),
            Self::PathWord => WORD_FORM.to_string(),
        }
    }
}

impl Absent {
    fn describe_default(self) -> &'static str {
        match self {
            Required => "required",
            Optional => "-",
            Default(value) => value,
        }
    }
}

/// The table as Markdown, one row per key: what `check --keys` prints.
#[must_use]
pub fn format_table() -> String {
    let mut text = String::from("| key | default | accepts | what |\n|---|---|---|---|\n");
    for key in KEYS {
        let section = find_section(key.section).filter(|section| section.repeated);
        let path = if section.is_some() { format!("[[{}]] {}", key.section, key.name) } else { key.dotted_path() };
        text +=
            &format!("| `{path}` | {} | {} | {} |\n", key.absent.describe_default(), key.kind.describe_range(), key.en);
    }
    text
}

/// A complete commented file with every default: what `check --example` prints.
#[must_use]
pub fn format_example() -> String {
    let mut text =
        String::from("# cnc-gateway.toml: every key with its default; a line that starts with # may be left out.\n");
    for section in SECTIONS {
        let (open, close) = if section.repeated { ("[[", "]]") } else { ("[", "]") };
        // The gateway runs without a sink, and without channels of one's own below a source, but not without a source.
        let begin = if section.repeated && section.name != "source" { "# " } else { "" };
        text += &format!("\n{begin}{open}{}{close}{}# {}\n", section.name, " ", section.en);
        for key in keys_of(section.name) {
            text += &example_line(key, !begin.is_empty());
        }
    }
    text
}

/// A key as it is written in the example. A line of a section that need not stand there is a comment.
fn example_line(key: &ConfigKey, commented: bool) -> String {
    let value = match (key.absent, key.kind) {
        (Default(value), _) => value,
        (Required, ValueKind::Address) => "\"simulated://lathe\"",
        (Required, ValueKind::SinkAddress) => "\"mqtts://broker:8883/plant\"",
        (Required | Optional, _) => "...",
    };
    let mark = if commented || key.absent != Required { "# " } else { "" };
    let written = format!("{mark}{} = {value}", key.name);
    format!("{written:40} # {} ({})\n", key.en, key.kind.describe_range())
}
