//! A sentence to the user about how a file was read. Every part of the reading may add one, so it knows none of them.

use adapter_core::bilingual::Bilingual;

/// What a sentence about the reading is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoteKind {
    /// How the file was taken to be written.
    Assumption,
    /// A foreign column and what it became.
    Column,
    /// Cells or lines that are not used.
    Loss,
    /// Something that may be wrong, with what to do.
    Doubt,
}

/// A sentence about the reading, for the user.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// What sort of note it is.
    pub kind: NoteKind,
    /// The sentence in both languages.
    pub text: Bilingual,
}

impl Note {
    pub(super) fn new(kind: NoteKind, en: impl Into<String>, zh: impl Into<String>) -> Self {
        Self { kind, text: Bilingual::new(en, zh) }
    }
}
