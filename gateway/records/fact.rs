//! Facts of production that nobody but the plant knows: which order runs, what was scrap, why the machine stood, who worked, when production
//! was planned. A box cannot measure them; the figures of a shift need them.
//!
//! A fact is one typed record whatever door it came through, and is never changed: a wrong count is put right by a second fact with a negative
//! one. Its [`Fact::mark`] makes a fact that comes twice known, here and in every receiver. Its times are those of whoever told it: where the
//! clock of the box turns out to have been wrong they stay as they are.

use adapter_core::clock::TimeNs;
use serde::{Deserialize, Serialize};

/// What a fact tells of production.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FactKind {
    /// From now on parts are made for this order; an empty value: for none.
    #[default]
    Order,
    /// So many parts were scrap; a negative count takes back what was too much.
    Scrap,
    /// Why the machine stood in this stretch.
    StopReason,
    /// Who works at the machine from now on; an empty value: nobody.
    Operator,
    /// Which shift works from now on.
    Shift,
    /// Production was planned in this stretch.
    PlannedTime,
}

impl FactKind {
    /// All kinds, in the order of the handbook.
    pub const ALL: [Self; 6] =
        [Self::Order, Self::Scrap, Self::StopReason, Self::Operator, Self::Shift, Self::PlannedTime];

    /// The word in documents and tables.
    #[must_use]
    pub const fn as_word(self) -> &'static str {
        match self {
            Self::Order => "order",
            Self::Scrap => "scrap",
            Self::StopReason => "stop_reason",
            Self::Operator => "operator",
            Self::Shift => "shift",
            Self::PlannedTime => "planned_time",
        }
    }

    /// The kind of this word.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.as_word() == word)
    }

    /// Does it hold for a stretch with an end?
    #[must_use]
    pub const fn has_end(self) -> bool {
        matches!(self, Self::StopReason | Self::PlannedTime)
    }
}

/// A fact as it is stored.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Fact {
    /// When the box was told it.
    pub at_ns: TimeNs,
    /// When it happened, or from when on it holds.
    pub from_ns: TimeNs,
    /// Until when it holds; `None` for what holds until another fact of its kind, and for scrap.
    pub until_ns: Option<TimeNs>,
    /// What it tells of production.
    pub fact: FactKind,
    /// Number of the order, name, or reason; may be empty where the kind says so.
    pub value: String,
    /// Scrap parts, or parts that are planned of an order.
    pub parts: Option<i64>,
    /// By this a fact that comes twice is known.
    pub mark: String,
    /// Through which door it came: `http`, `csv`, `page`, or the name of a sink.
    pub way: String,
    /// The person who is signed in, or what the message calls its sender.
    pub author: String,
}
