//! Why there is no number.

use serde::Serialize;
use std::fmt;

/// What kind of obstacle it is; the word is stable, for programs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RefusalKind {
    /// A number that is no number, or is missing.
    NotFinite,
    /// Columns or rows that do not belong together.
    Mismatch,
    /// Too few rows, points, speeds or passes.
    TooFew,
    /// Something that must vary does not.
    Constant,
    /// Two or more columns say the same.
    Collinear,
    /// The data cannot tell this quantity from another.
    NotIdentifiable,
    /// The unit is another than the name says.
    Unit,
    /// Outside the range in which the law holds.
    OutOfRange,
    /// More than one answer fits.
    Ambiguous,
    /// The data contradict the law.
    Contradiction,
    /// A column or piece of information is not there.
    Missing,
}

impl RefusalKind {
    /// The word used in JSON, scripts and SQL.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::NotFinite => "not_finite",
            Self::Mismatch => "mismatch",
            Self::TooFew => "too_few",
            Self::Constant => "constant",
            Self::Collinear => "collinear",
            Self::NotIdentifiable => "not_identifiable",
            Self::Unit => "unit",
            Self::OutOfRange => "out_of_range",
            Self::Ambiguous => "ambiguous",
            Self::Contradiction => "contradiction",
            Self::Missing => "missing",
        }
    }
}

/// No number, and why: what stands in the way, where, and what to do or to record instead.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Refusal {
    /// The kind of obstacle, for programs.
    pub kind: RefusalKind,
    /// What is wrong, in words, with the numbers that show it.
    pub what: String,
    /// Where: a column, a gear stage, a speed; may be empty.
    pub place: String,
    /// What to do or to record instead.
    pub next: String,
}

impl Refusal {
    /// An obstacle and the way around it.
    #[must_use]
    pub fn new(kind: RefusalKind, what: impl Into<String>, next: impl Into<String>) -> Self {
        Self { kind, what: what.into(), place: String::new(), next: next.into() }
    }

    /// The same with the place; an outer place stands before an inner one.
    #[must_use]
    pub fn with_place(mut self, place: impl Into<String>) -> Self {
        let place = place.into();
        self.place = if self.place.is_empty() { place } else { format!("{place}, {}", self.place) };
        self
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.place.is_empty() {
            write!(f, "{}: ", self.place)?;
        }
        f.write_str(&self.what)?;
        if self.next.is_empty() { Ok(()) } else { write!(f, "; {}", self.next) }
    }
}

impl std::error::Error for Refusal {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_reads_as_a_sentence() {
        let refusal = Refusal::new(RefusalKind::TooFew, "2 speeds", "record at 3 speeds")
            .with_place("gear stage 1")
            .with_place("lathe");
        assert_eq!(refusal.to_string(), "lathe, gear stage 1: 2 speeds; record at 3 speeds");
        let json = serde_json::to_value(&refusal).expect("JSON");
        assert_eq!(json["kind"], refusal.kind.as_word());
    }
}
