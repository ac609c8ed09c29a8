//! Facts of production on their way in: one form, whatever door they come through.
//!
//! HTTP, CSV, MQTT and the page hand over a [`FactDocument`] each; [`FactDocument::check`] makes a [`Fact`] of it or says everything that is wrong.
//! A message with anything wrong in it is refused as a whole. The tick takes the others in their order ([`OrderSender::send_facts`](super::OrderSender::send_facts)).
//!
//! | `fact` | `value` | `parts` | `until` |
//! |---|---|---|---|
//! | `order` | number of the order; empty: none any more | parts that are planned, may be left out | |
//! | `scrap` | reason, may be empty | parts; negative takes back | |
//! | `stop_reason` | reason | | needed |
//! | `operator` | name; empty: nobody | | |
//! | `shift` | name; empty: none | | |
//! | `planned_time` | may be empty | | needed |
//!
//! `at` is when it happened or from when on it holds; without it, now. `id` is the sender's mark: a fact that comes again under the same mark
//! is taken once. Without `id` what the fact says is its mark, so that the same fact twice is one.

mod read;

pub use read::{FACTS_MAX, FactsError, read_facts_csv, read_facts_json};

use adapter_core::channel::find_nearest_name;
use adapter_core::clock::{SECOND_NS, TimeNs};
use gateway_base::moment;
use gateway_history::{Fact, FactKind};
use serde::Deserialize;
use sha2::{Digest, Sha256};
use std::fmt::Write;
use thiserror::Error;

/// Letters of a value, a mark and a name.
const WORDS_MAX: usize = 120;
/// Parts of one fact: more come from no machine in a year.
const PARTS_MAX: i64 = 1_000_000;
/// A fact is at most so old: what is older belongs to figures that nobody asks for any more.
const AGE_MAX_NS: i64 = 366 * 86_400 * SECOND_NS;
/// What is planned lies at most so far ahead. Everything else has happened; clocks of a plant differ by less than five minutes.
const AHEAD_MAX_NS: i64 = 366 * 86_400 * SECOND_NS;
const CLOCKS_DIFFER_NS: i64 = 300 * SECOND_NS;
/// Longest stretch of a reason or a plan.
const STRETCH_MAX_NS: i64 = 31 * 86_400 * SECOND_NS;

/// A fact as it is written.
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FactDocument {
    /// The word of its kind, as in the table above.
    pub fact: String,
    /// When it happened, or from when on it holds: RFC 3339, or a date.
    #[serde(default)]
    pub at: Option<String>,
    /// The end of a stretch, in the same notation.
    #[serde(default)]
    pub until: Option<String>,
    /// Number of the order, name, or reason.
    #[serde(default)]
    pub value: Option<String>,
    /// Scrap parts, or parts planned of an order.
    #[serde(default)]
    pub parts: Option<i64>,
    /// The mark by which the sender knows it.
    #[serde(default)]
    pub id: Option<String>,
}

/// Through which door facts came, and who says so.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FactSender {
    /// `http`, `csv`, `page`, or the name of a sink.
    pub way: String,
    /// A person who is signed in; empty where nobody is known.
    pub author: String,
}

/// What is wrong with a fact.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum FactError {
    /// No fact has this word.
    #[error("{word:?} is no fact; {}", name_facts(word))]
    Unknown {
        /// The word as it was written.
        word: String,
    },
    /// A field that the kind needs.
    #[error("{fact} needs `{field}`: {form}")]
    Missing {
        /// The word of the kind that it was to be.
        fact: &'static str,
        /// Name of the field in the document.
        field: &'static str,
        /// How such a field is written.
        form: &'static str,
    },
    /// A field that the kind has no meaning for.
    #[error("{fact} has no `{field}`: leave it out")]
    Surplus {
        /// The word of the kind that it was to be.
        fact: &'static str,
        /// Name of the field in the document.
        field: &'static str,
    },
    /// A time that cannot be read.
    #[error("`{field}` is {text:?}; write a time such as 2026-01-31T08:15:00Z or 2026-01-31T16:15:00+08:00")]
    Time {
        /// Name of the field in the document.
        field: &'static str,
        /// What was written there.
        text: String,
    },
    /// A time that no fact can have.
    #[error("`{field}` is {text:?}, outside {from} to {to} by the clock of this box")]
    TimeRange {
        /// Name of the field in the document.
        field: &'static str,
        /// What was written there.
        text: String,
        /// The earliest time that is taken.
        from: String,
        /// The latest time that is taken.
        to: String,
    },
    /// The end does not come after the beginning, or much too late.
    #[error("`until` is not after `at`, or more than 31 days after it")]
    Stretch,
    /// A count that no machine makes.
    #[error("`parts` is {parts}, outside {least} to {PARTS_MAX}{hint}")]
    Parts {
        /// What was written there.
        parts: i64,
        /// The least count that is taken.
        least: i64,
        /// What else there is to know.
        hint: &'static str,
    },
    /// A text that is too long or holds control characters.
    #[error("`{field}` has {letters} letters or a control character; write at most {WORDS_MAX} letters on one line")]
    Words {
        /// Name of the field in the document.
        field: &'static str,
        /// How many letters it has.
        letters: usize,
    },
}

fn name_facts(word: &str) -> String {
    let words = FactKind::ALL.map(FactKind::as_word);
    match find_nearest_name(word, words) {
        Some(near) => format!("did you mean {near}?"),
        None => format!("write one of {}", words.join(", ")),
    }
}

impl FactDocument {
    /// The fact, as of `now_ns`.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn check(&self, sender: &FactSender, now_ns: TimeNs) -> Result<Fact, Vec<FactError>> {
        let Some(kind) = FactKind::from_word(self.fact.trim()) else {
            return Err(vec![FactError::Unknown { word: self.fact.chars().take(WORDS_MAX).collect() }]);
        };
        let mut wrong = Vec::new();
        let mut keep =
            |found: Result<Option<TimeNs>, FactError>| found.map_err(|error| wrong.push(error)).ok().flatten();
        let ahead_ns = if kind == FactKind::PlannedTime { AHEAD_MAX_NS } else { CLOCKS_DIFFER_NS };
        let range_ns = (now_ns.saturating_sub(AGE_MAX_NS), now_ns.saturating_add(ahead_ns));
        let from_ns = keep(read_time("at", self.at.as_deref(), range_ns)).unwrap_or(now_ns);
        let end_range_ns = (range_ns.0, range_ns.1.saturating_add(STRETCH_MAX_NS));
        let until_ns = keep(read_time("until", self.until.as_deref(), end_range_ns));
        let until_written = self.until.as_deref().is_some_and(|text| !text.trim().is_empty());
        wrong.extend(check_stretch(kind, from_ns, until_ns, until_written));
        wrong.extend(self.check_parts(kind));
        wrong.extend(self.check_words(kind));
        if !wrong.is_empty() {
            return Err(wrong);
        }
        let value = self.value.as_deref().unwrap_or_default().trim().to_owned();
        let fact = Fact {
            at_ns: now_ns,
            from_ns,
            until_ns,
            fact: kind,
            value,
            parts: self.parts,
            mark: String::new(),
            way: sender.way.clone(),
            author: clean_words(&sender.author),
        };
        let own = self.id.as_deref().map(str::trim).filter(|id| !id.is_empty()).map(str::to_owned);
        Ok(Fact { mark: own.unwrap_or_else(|| digest_of(&fact)), ..fact })
    }

    fn check_parts(&self, kind: FactKind) -> Option<FactError> {
        let fact = kind.as_word();
        match (kind, self.parts) {
            (FactKind::Scrap, None | Some(0)) => Some(FactError::Missing {
                fact,
                field: "parts",
                form: "how many, or a negative number to take some back",
            }),
            (FactKind::Scrap, Some(parts)) if !(-PARTS_MAX..=PARTS_MAX).contains(&parts) => {
                Some(FactError::Parts { parts, least: -PARTS_MAX, hint: "" })
            }
            (FactKind::Order, Some(parts)) if !(1..=PARTS_MAX).contains(&parts) => {
                Some(FactError::Parts { parts, least: 1, hint: "; leave it out where nobody has planned a number" })
            }
            (FactKind::Scrap | FactKind::Order, _) | (_, None) => None,
            (_, Some(_)) => Some(FactError::Surplus { fact, field: "parts" }),
        }
    }

    fn check_words(&self, kind: FactKind) -> impl Iterator<Item = FactError> {
        let missing = kind == FactKind::StopReason && self.value.as_deref().is_none_or(|value| value.trim().is_empty());
        let missing = missing.then_some(FactError::Missing {
            fact: kind.as_word(),
            field: "value",
            form: "the reason, such as \"setup\" or \"no material\"",
        });
        let words = [("value", &self.value), ("id", &self.id)];
        let too_long = words.into_iter().filter_map(|(field, text)| {
            let text = text.as_deref()?.trim();
            let letters = text.chars().count();
            (letters > WORDS_MAX || text.contains(char::is_control)).then_some(FactError::Words { field, letters })
        });
        missing.into_iter().chain(too_long.collect::<Vec<_>>())
    }
}

fn check_stretch(kind: FactKind, from_ns: TimeNs, until_ns: Option<TimeNs>, written: bool) -> Option<FactError> {
    let fact = kind.as_word();
    match (kind.has_end(), until_ns) {
        (true, None) if !written => Some(FactError::Missing { fact, field: "until", form: "the end of the stretch" }),
        (true, Some(until_ns)) if until_ns <= from_ns || until_ns - from_ns > STRETCH_MAX_NS => {
            Some(FactError::Stretch)
        }
        (false, _) if written => Some(FactError::Surplus { fact, field: "until" }),
        _ => None,
    }
}

fn read_time(field: &'static str, text: Option<&str>, range_ns: (TimeNs, TimeNs)) -> Result<Option<TimeNs>, FactError> {
    let Some(text) = text.map(str::trim).filter(|text| !text.is_empty()) else { return Ok(None) };
    let written = || text.chars().take(WORDS_MAX).collect::<String>();
    // A time that is relative to now is none that somebody has noted.
    let is_absolute = text.starts_with(|first: char| first.is_ascii_digit());
    let at_ns = is_absolute.then(|| moment::parse(text, 0).ok()).flatten();
    let at_ns = at_ns.ok_or_else(|| FactError::Time { field, text: written() })?;
    if at_ns >= range_ns.0 && at_ns <= range_ns.1 {
        return Ok(Some(at_ns));
    }
    let (from, to) = (moment::format_utc(range_ns.0), moment::format_utc(range_ns.1));
    Err(FactError::TimeRange { field, text: written(), from, to })
}

fn clean_words(text: &str) -> String {
    text.chars().filter(|letter| !letter.is_control()).take(WORDS_MAX).collect()
}

/// What a fact says, as its mark: neither its door nor when it was told is part of it.
fn digest_of(fact: &Fact) -> String {
    let said = serde_json::json!([fact.fact.as_word(), fact.from_ns, fact.until_ns, fact.value, fact.parts]);
    Sha256::digest(said.to_string().as_bytes()).iter().take(12).fold(String::from("said-"), |mut mark, byte| {
        // Writing to a string cannot fail.
        let _ = write!(mark, "{byte:02x}");
        mark
    })
}
