//! Settings that scripts declare: numbers and words that a shop chooses without touching the text of a script.
//!
//! A script writes `setting("target_w", 0.0, #{ unit: "W", min: 0, max: 50000, en: "...", zh: "..." })` where it would write the
//! number itself. The declaration and the default stand in the script; the value of this machine stands in one TOML file,
//! in a section with the name of the script, and where the declaration says `per: ["tool"]` also for one tool or operation:
//!
//! ```toml
//! [constant_load]
//! target_w = 2400.0
//!
//! [constant_load.tool.T3]
//! target_w = 1800.0
//! ```
//!
//! A value is put into the text in the place of its declaration before the text is compiled: a branch that a setting closes costs
//! nothing at run time. Only where a tool or an operation has a value of its own is it looked up, when one of the two changes.
//!
//! | file | what |
//! |---|---|
//! | `scan` | where something stands in a text, outside of texts and comments |
//! | `find` | the declarations of a text, and the text with values in their place |
//! | `values` | the file with the values, checked against the declarations |
//! | `values_in_force` | the values in force for one script |

mod find;
pub(super) mod scan;
mod values;
mod values_in_force;

pub(super) use find::{FoundDeclaration, find_declarations, with_values};
pub use values::{DeclarationPlace, SETTINGS_TEXT_MAX, SettingValues};
pub(super) use values_in_force::{Force, LiveValues, Now};

use adapter_core::channel::find_nearest_name;
use std::fmt;

/// Longest text that a setting takes, characters.
const TEXT_MAX: usize = 80;

/// The value of a setting.
#[derive(Debug, Clone, PartialEq)]
pub enum SettingValue {
    /// A number in the unit of the setting.
    Number(f64),
    /// A word or a name.
    Text(String),
}

impl fmt::Display for SettingValue {
    /// As it is written in the file of values.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => f.write_str(&format_literal(*number)),
            Self::Text(text) => write!(f, "{text:?}"),
        }
    }
}

/// A number as scripts and TOML read it: with a point, without an exponent, and the same number when it is read again.
fn format_literal(number: f64) -> String {
    let text = format!("{number}");
    if text.contains('.') { text } else { text + ".0" }
}

/// What a setting may have a value of its own for, besides the machine as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Per {
    /// The tool in use, channel `tool`.
    Tool,
    /// The operation, channel `operation`.
    Operation,
}

impl Per {
    /// Every kind of place, for tables of words.
    pub const ALL: [Self; 2] = [Self::Tool, Self::Operation];

    /// The word in declarations and in the file of values; also the name of the channel.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::Tool => "tool",
            Self::Operation => "operation",
        }
    }
}

/// A setting that a script declares at its top.
#[derive(Debug, Clone, PartialEq)]
pub struct Declared {
    /// File of the script, `constant_load.rhai`.
    pub script: String,
    /// Its name; ends in the unit where it has one.
    pub name: String,
    /// What holds where nothing else is chosen.
    pub default: SettingValue,
    /// Unit symbol; `1` for pure numbers, empty for texts.
    pub unit: String,
    /// Least and greatest value of a number, both allowed.
    pub range: Option<(f64, f64)>,
    /// Is it a whole number?
    pub whole: bool,
    /// The words that a text may be; empty: any name.
    pub one_of: Vec<String>,
    /// What it does, in English.
    pub en: String,
    /// What it does, in Chinese.
    pub zh: String,
    /// May a tool or an operation have a value of its own?
    pub per: Vec<Per>,
    /// Line of the declaration, from 1.
    pub line: usize,
}

impl Declared {
    /// The section of the file of values: the name of the script without its ending.
    #[must_use]
    pub fn section(&self) -> &str {
        self.script.strip_suffix(".rhai").unwrap_or(&self.script)
    }

    /// How the setting is named where several scripts are meant: `constant_load.target_w`.
    #[must_use]
    pub fn path(&self) -> String {
        format!("{}.{}", self.section(), self.name)
    }

    /// The range in words: `0 to 50000 W`, `"x", "y", "z"`.
    #[must_use]
    pub fn describe_range(&self) -> String {
        let words = || self.one_of.iter().map(|word| format!("{word:?}")).collect::<Vec<_>>().join(", ");
        match self.range {
            Some((least, greatest)) => {
                let unit = if self.unit == "1" { String::new() } else { format!(" {}", self.unit) };
                let whole = if self.whole { ", whole numbers" } else { "" };
                format!("{least} to {greatest}{unit}{whole}")
            }
            None if self.one_of.is_empty() => format!("a text of at most {TEXT_MAX} characters"),
            None => words(),
        }
    }

    /// Why this value cannot be used, and what to do; `None` where it can.
    #[must_use]
    pub fn explain_refusal(&self, value: &SettingValue) -> Option<(String, String)> {
        let path = self.path();
        let next = format!("{}; it takes {}, by default {}", self.en, self.describe_range(), self.default);
        match (value, self.range) {
            (SettingValue::Number(number), Some((least, greatest))) => {
                let unit = if self.unit == "1" { String::new() } else { format!(" {}", self.unit) };
                if !(least..=greatest).contains(number) {
                    return Some((format!("{path} = {number} is outside {least} to {greatest}{unit}"), next));
                }
                (self.whole && number.fract() != 0.0).then(|| (format!("{path} = {number} is no whole number"), next))
            }
            (SettingValue::Number(_), None) => Some((format!("{path} needs a text, not a number"), next)),
            (SettingValue::Text(_), Some(_)) => Some((format!("{path} needs a number, not a text"), next)),
            (SettingValue::Text(text), None) => self.refuse_text(&path, text, next),
        }
    }

    fn refuse_text(&self, path: &str, text: &str, next: String) -> Option<(String, String)> {
        if text.chars().count() > TEXT_MAX || text.chars().any(char::is_control) {
            return Some((format!("{path} is longer than {TEXT_MAX} characters, or not on one line"), next));
        }
        if self.one_of.is_empty() || self.one_of.iter().any(|word| word == text) {
            return None;
        }
        let near = find_nearest_name(text, self.one_of.iter().map(String::as_str));
        let next = near.map_or(next, |near| format!("did you mean {near:?}?"));
        Some((format!("{path} = {text:?} is none of {}", self.describe_range()), next))
    }
}
