//! Where a machine stands in its plant: the equipment levels of ISA-95, and what each output makes of them.
//!
//! A path is `ENTERPRISE/SITE/AREA/LINE/MACHINE`, or the same without some of the levels before the machine:
//!
//! | words before the machine | levels |
//! |---|---|
//! | 1 | site |
//! | 2 | site, line |
//! | 3 | site, area, line |
//! | 4 | enterprise, site, area, line |
//!
//! The machine is known by its path, the box beside it by the name that was made with its history. A box that takes the place of
//! another one gets the same path: topics, identifiers and tables of the machine go on, and each item still names the box that has made it.
//!
//! Every output asks this type for its text and knows no level by itself: [`MachinePath::format_topic`], [`MachinePath::format_dotted`],
//! [`MachinePath::format_group`], [`MachinePath::list_levels`]. A box without a path tells what it told before there were paths.

use serde::{Serialize, Serializer};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// Words of a path, with that of the machine.
const WORDS: std::ops::RangeInclusive<usize> = 2..=5;
/// The most letters that a word of the path may have.
const WORD_MAX: usize = 40;

/// What a word is made of: what topics, subjects, identifiers of XML and names of groups all take.
pub const WORD_FORM: &str = "1 to 40 of the letters a-z, A-Z, 0-9, - and _, the first no - or _";

/// The levels before the machine, by how many of them are written.
const LEVELS: [&[&str]; 4] =
    [&["site"], &["site", "line"], &["site", "area", "line"], &["enterprise", "site", "area", "line"]];

/// The level of the machine itself.
const MACHINE: &str = "machine";

/// Where a machine stands, down to the machine.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MachinePath {
    /// From the greatest level down; as many as [`WORDS`] allow.
    words: Vec<String>,
}

/// Why a text is no path of a machine.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum MachinePathError {
    /// Too few levels, or too many.
    #[error(
        "{found} words; write 1 to 4 before the machine: SITE, SITE/LINE, SITE/AREA/LINE or ENTERPRISE/SITE/AREA/LINE"
    )]
    Count {
        /// Words before that of the machine.
        found: usize,
    },
    /// A word that some output could not carry.
    #[error("{word:?} is no word of a path: {WORD_FORM}")]
    Word {
        /// The word as it was written.
        word: String,
    },
}

/// Can every output carry this word?
#[must_use]
pub fn is_path_word(word: &str) -> bool {
    word.len() <= WORD_MAX
        && word.starts_with(|first: char| first.is_ascii_alphanumeric())
        && word.chars().all(|letter| letter.is_ascii_alphanumeric() || "-_".contains(letter))
}

impl MachinePath {
    /// The path of a machine below these levels: `shanghai/line-2` and `lathe-7`.
    ///
    /// # Errors
    /// Which word is wrong, or how many there may be.
    pub fn new(above: &str, machine: &str) -> Result<Self, MachinePathError> {
        let words: Vec<String> = above.split('/').chain([machine]).map(str::to_owned).collect();
        if let Some(word) = words.iter().find(|word| !is_path_word(word)) {
            return Err(MachinePathError::Word { word: word.clone() });
        }
        match WORDS.contains(&words.len()) {
            true => Ok(Self { words }),
            false => Err(MachinePathError::Count { found: words.len() - 1 }),
        }
    }

    fn split_machine(&self) -> (&str, &[String]) {
        // `new` makes none without a machine.
        self.words.split_last().map_or(("", &[]), |(machine, above)| (machine, above))
    }

    /// With slashes, for topics and documents: `shanghai/line-2/lathe-7`.
    #[must_use]
    pub fn format_topic(&self) -> String {
        self.words.join("/")
    }

    /// With points, for subjects, identifiers and names: `shanghai.line-2.lathe-7`. No word holds a point, so that it can be divided again.
    #[must_use]
    pub fn format_dotted(&self) -> String {
        self.words.join(".")
    }

    /// For identifiers that take neither slash nor point: `shanghai_line-2_lathe-7`. An underscore of a word is doubled, and no word begins with
    /// one, so that two paths never have the same.
    #[must_use]
    pub fn format_underscored(&self) -> String {
        self.words.iter().map(|word| word.replace('_', "__")).collect::<Vec<_>>().join("_")
    }

    /// The levels before the machine with points: `shanghai.line-2`.
    #[must_use]
    pub fn format_group(&self) -> String {
        self.split_machine().1.join(".")
    }

    /// The word of the machine alone: `lathe-7`.
    #[must_use]
    pub fn machine_word(&self) -> &str {
        self.split_machine().0
    }

    /// Each level that is written, by its name: `enterprise`, `site`, `area`, `line`, `machine`.
    pub fn list_levels(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let (machine, above) = self.split_machine();
        let names = above.len().checked_sub(1).and_then(|place| LEVELS.get(place)).copied().unwrap_or_default();
        names.iter().copied().zip(above.iter().map(String::as_str)).chain([(MACHINE, machine)])
    }
}

impl fmt::Display for MachinePath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.format_topic())
    }
}

impl Serialize for MachinePath {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl FromStr for MachinePath {
    type Err = MachinePathError;

    /// Reads what [`MachinePath::format_topic`] writes.
    fn from_str(text: &str) -> Result<Self, MachinePathError> {
        let (above, machine) = text.rsplit_once('/').ok_or(MachinePathError::Count { found: 0 })?;
        Self::new(above, machine)
    }
}

/// Name of a machine for people, and its path in the plant for programs, where somebody has written one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedMachine {
    /// Name of the machine as configured, in any letters.
    pub name: String,
    /// Where it stands; `None`: the machine is known by its box alone.
    pub path: Option<MachinePath>,
}

impl From<&str> for NamedMachine {
    fn from(name: &str) -> Self {
        Self { name: name.to_owned(), path: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_output_has_its_text_and_every_level_its_name() {
        let path = MachinePath::new("shanghai/line-2", "lathe-7").expect("a path");
        assert_eq!(path.format_topic(), "shanghai/line-2/lathe-7");
        assert_eq!(
            (path.format_dotted(), path.format_group()),
            ("shanghai.line-2.lathe-7".to_owned(), "shanghai.line-2".to_owned())
        );
        assert_eq!(
            path.list_levels().collect::<Vec<_>>(),
            [("site", "shanghai"), ("line", "line-2"), ("machine", "lathe-7")]
        );
        assert_eq!(path.format_topic().parse(), Ok(path));
        let names = |above: &str| {
            let path = MachinePath::new(above, "m").expect("a path");
            path.list_levels().map(|(level, word)| format!("{level}={word}")).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(names("a"), "site=a machine=m");
        assert_eq!(names("a/b/c"), "site=a area=b line=c machine=m");
        assert_eq!(names("a/b/c/d"), "enterprise=a site=b area=c line=d machine=m");
    }

    #[test]
    fn what_some_output_could_not_carry_is_refused() {
        for word in ["", "+", "a b", "a.b", "#", "$a", "-a", "_a", "线", "a\0", &"a".repeat(41)] {
            assert_eq!(MachinePath::new(word, "m"), Err(MachinePathError::Word { word: word.to_owned() }), "{word:?}");
            assert!(MachinePath::new("a", word).is_err(), "{word:?}");
        }
        assert_eq!(MachinePath::new("a/b/c/d/e", "m"), Err(MachinePathError::Count { found: 5 }));
        assert!(MachinePath::new("a//b", "m").is_err() && "m".parse::<MachinePath>().is_err());
        assert!(MachinePath::new(&"a".repeat(40), "m").is_ok());
    }
}
