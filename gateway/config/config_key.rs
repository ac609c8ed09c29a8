//! What a row of the table of keys is: a key, what it accepts, and what holds without it.

/// Most letters of a name.
pub const NAME_MAX: usize = 100;

/// What a key accepts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ValueKind {
    /// Any text that is not empty.
    Text,
    /// A text of at most [`NAME_MAX`] letters: it is an index in databases, and stands in titles.
    Name,
    /// One of these words.
    OneOf(&'static [&'static str]),
    /// A number from the first to the second limit, both included.
    Number(f64, f64),
    /// A switch, written `true` or `false`.
    Flag,
    /// A file or directory.
    Path,
    /// `HOST:PORT` to listen on.
    Listen,
    /// The address of a source, as listed in the table of sources.
    Address,
    /// The address of a sink.
    SinkAddress,
    /// The levels of the plant before the machine, with slashes between them.
    PlantPath,
    /// One word of such a path.
    PathWord,
}

/// What happens when a key is not written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Absent {
    /// The file is refused.
    Required,
    /// The gateway does without, or decides by itself as the text of the key says.
    Optional,
    /// This value, written as in the file.
    Default(&'static str),
}

/// One row of the table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConfigKey {
    /// The section it belongs to.
    pub section: &'static str,
    /// Its name in that section; the unit comes last.
    pub name: &'static str,
    /// Form and range of its values.
    pub kind: ValueKind,
    /// What holds when it is absent.
    pub absent: Absent,
    /// What it does, in English.
    pub en: &'static str,
    /// What it does, in Chinese.
    pub zh: &'static str,
}

impl ConfigKey {
    /// Section and name with a dot between them, as in `history.max_gb`.
    #[must_use]
    pub fn dotted_path(&self) -> String {
        format!("{}.{}", self.section, self.name)
    }
}

pub(super) const fn new_key(
    path: (&'static str, &'static str),
    kind: ValueKind,
    absent: Absent,
    en: &'static str,
    zh: &'static str,
) -> ConfigKey {
    ConfigKey { section: path.0, name: path.1, kind, absent, en, zh }
}
