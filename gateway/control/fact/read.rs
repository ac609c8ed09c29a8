//! Facts of a message: one document, several, or a table.

use super::{FactDocument, FactError, FactSender};
use adapter_core::channel::find_nearest_name;
use adapter_core::clock::TimeNs;
use gateway_history::Fact;
use serde::Deserialize;
use thiserror::Error;

/// Facts that one message may hold.
pub const FACTS_MAX: usize = 500;

/// Why a message holds no facts: each with the place, counted from 1.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum FactsError {
    /// It is no document of facts.
    #[error(
        "no facts: {0}; write {{\"fact\":\"scrap\",\"parts\":2,\"at\":\"2026-01-31T08:15:00Z\"}} or {{\"facts\":[..]}}"
    )]
    Unreadable(String),
    /// It is no table of facts.
    #[error("line {line}: {what}; the first line names the columns: fact,at,until,value,parts,id")]
    Table {
        /// Line of the text, from 1.
        line: u64,
        /// What is wrong with that line.
        what: String,
    },
    /// It holds nothing, or too much.
    #[error("{found} facts in one message; send 1 to {FACTS_MAX}")]
    Count {
        /// How many the message holds.
        found: usize,
    },
    /// Some of its facts are wrong, each with its place. None is taken.
    #[error("{}", name_wrong(.0))]
    Wrong(Vec<(String, FactError)>),
}

fn name_wrong(wrong: &[(String, FactError)]) -> String {
    wrong.iter().map(|(place, error)| format!("{place}: {error}")).collect::<Vec<_>>().join("\n")
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct SeveralFacts {
    facts: Vec<FactDocument>,
}

/// The facts of a JSON document: one, or `{"facts":[..]}`.
///
/// # Errors
/// Everything that is wrong with it.
pub fn read_facts_json(bytes: &[u8], sender: &FactSender, now_ns: TimeNs) -> Result<Vec<Fact>, FactsError> {
    let unreadable = |error: serde_json::Error| FactsError::Unreadable(error.to_string());
    let value: serde_json::Value = serde_json::from_slice(bytes).map_err(unreadable)?;
    let documents = if value.get("facts").is_some() {
        serde_json::from_value::<SeveralFacts>(value).map_err(unreadable)?.facts
    } else {
        vec![serde_json::from_value::<FactDocument>(value).map_err(unreadable)?]
    };
    check_all(
        documents.iter().enumerate().map(|(place, document)| (format!("fact {}", place + 1), document)),
        sender,
        now_ns,
    )
}

/// The columns of a table of facts, in any order.
const COLUMNS: [&str; 6] = ["fact", "at", "until", "value", "parts", "id"];

/// The facts of a CSV table whose first line names the columns.
///
/// # Errors
/// Everything that is wrong with it.
pub fn read_facts_csv(bytes: &[u8], sender: &FactSender, now_ns: TimeNs) -> Result<Vec<Fact>, FactsError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut table = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
    let broken = |error: &csv::Error| FactsError::Table {
        line: error.position().map_or(1, csv::Position::line),
        what: error.to_string(),
    };
    let head = table.headers().map_err(|error| broken(&error))?.clone();
    if let Some(column) = head.iter().find(|column| !COLUMNS.contains(column)) {
        let near = find_nearest_name(column, COLUMNS).map(|near| format!(", did you mean {near}?")).unwrap_or_default();
        return Err(FactsError::Table { line: 1, what: format!("there is no column {column:?}{near}") });
    }
    let mut documents = Vec::new();
    for row in table.records() {
        let row = row.map_err(|error| broken(&error))?;
        if documents.len() == FACTS_MAX {
            return Err(FactsError::Count { found: FACTS_MAX + 1 });
        }
        let line = row.position().map_or(0, csv::Position::line);
        documents.push((format!("line {line}"), read_row(&head, &row, line)?));
    }
    check_all(documents.iter().map(|(place, document)| (place.clone(), document)), sender, now_ns)
}

fn read_row(head: &csv::StringRecord, row: &csv::StringRecord, line: u64) -> Result<FactDocument, FactsError> {
    let cell = |name: &str| {
        let place = head.iter().position(|column| column == name)?;
        row.get(place).filter(|cell| !cell.is_empty()).map(str::to_owned)
    };
    let parts = cell("parts").map(|text| {
        text.parse()
            .map_err(|_| FactsError::Table { line, what: format!("`parts` is {text:?}, which is no whole number") })
    });
    Ok(FactDocument {
        fact: cell("fact").unwrap_or_default(),
        at: cell("at"),
        until: cell("until"),
        value: cell("value"),
        parts: parts.transpose()?,
        id: cell("id"),
    })
}

fn check_all<'d>(
    documents: impl ExactSizeIterator<Item = (String, &'d FactDocument)>,
    sender: &FactSender,
    now_ns: TimeNs,
) -> Result<Vec<Fact>, FactsError> {
    let found = documents.len();
    if !(1..=FACTS_MAX).contains(&found) {
        return Err(FactsError::Count { found });
    }
    let (mut facts, mut wrong) = (Vec::new(), Vec::new());
    for (place, document) in documents {
        match document.check(sender, now_ns) {
            Ok(fact) => facts.push(fact),
            Err(errors) => wrong.extend(errors.into_iter().map(|error| (place.clone(), error))),
        }
    }
    if wrong.is_empty() { Ok(facts) } else { Err(FactsError::Wrong(wrong)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gateway_history::FactKind;
    use proptest::prelude::*;

    /// 2026-01-31T12:00:00Z.
    const NOW_NS: TimeNs = 1_769_860_800_000_000_000;

    fn sender() -> FactSender {
        FactSender { way: "http".to_owned(), author: "Li Wei".to_owned() }
    }

    fn read(text: &str) -> Result<Vec<Fact>, FactsError> {
        read_facts_json(text.as_bytes(), &sender(), NOW_NS)
    }

    #[test]
    fn every_door_makes_the_same_fact_of_the_same_words() {
        let json = read(r#"{"fact":"scrap","parts":2,"value":"chatter","at":"2026-01-31T08:15:00Z"}"#).expect("a fact");
        let table = "at,fact,value,parts\r\n2026-01-31T16:15:00+08:00,scrap, chatter ,2\r\n";
        let csv = read_facts_csv(table.as_bytes(), &sender(), NOW_NS).expect("a fact");
        assert_eq!(json, csv, "the mark too");
        assert_eq!(
            (json[0].fact, json[0].parts, json[0].from_ns),
            (FactKind::Scrap, Some(2), 1_769_847_300_000_000_000)
        );
        assert!(json[0].mark.starts_with("said-") && json[0].author == "Li Wei");
        let own = read(r#"{"fact":"scrap","parts":2,"id":" m-7 "}"#).expect("a fact");
        assert_eq!((own[0].mark.as_str(), own[0].from_ns), ("m-7", NOW_NS));
    }

    #[test]
    fn everything_that_is_wrong_is_told_with_its_place() {
        let said = |text: &str| read(text).expect_err("refused").to_string();
        assert!(said(r#"{"fact":"scrab","parts":2}"#).contains("did you mean scrap?"));
        assert_eq!(
            said(r#"{"facts":[{"fact":"order","value":"A"},{"fact":"scrap"},{"fact":"shift","parts":1}]}"#),
            "fact 2: scrap needs `parts`: how many, or a negative number to take some back\nfact 3: shift has no `parts`: leave it out"
        );
        assert!(said(r#"{"fact":"planned_time","at":"2026-01-31T06:00:00Z"}"#).contains("needs `until`"));
        let backwards =
            r#"{"fact":"stop_reason","value":"setup","at":"2026-01-31T08:00:00Z","until":"2026-01-31T07:00:00Z"}"#;
        assert!(said(backwards).contains("not after `at`"));
        assert!(
            said(r#"{"fact":"scrap","parts":1,"at":"2026-02-01T00:00:00Z"}"#).contains("outside 2025-01-30"),
            "of the future"
        );
        assert!(said(r#"{"fact":"scrap","parts":1,"at":"-1h"}"#).contains("write a time such as"));
        assert!(said(r#"{"fact":"scrap","parts":1000001}"#).contains("outside -1000000 to 1000000"));
        assert!(said(r#"{"fact":"order","value":"a\nb"}"#).contains("on one line"));
        assert!(said(r#"{"fact":"scrap","part":1}"#).contains("unknown field `part`"));
        assert!(said(r#"{"facts":[]}"#).contains("send 1 to 500"));
        let of_table =
            |text: &str| read_facts_csv(text.as_bytes(), &sender(), NOW_NS).expect_err("refused").to_string();
        assert!(of_table("fact,patrs\nscrap,1\n").contains("did you mean parts?"));
        assert!(of_table("fact,parts\nscrap,1\nscrap,two\n").starts_with("line 3: `parts` is \"two\""));
        assert!(of_table("fact,parts\nscrap,1\nscrap,\n").starts_with("line 3: scrap needs `parts`"));
    }

    proptest! {
        #[test]
        fn any_bytes_are_facts_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            let _either = read_facts_json(&bytes, &sender(), NOW_NS);
            let _either = read_facts_csv(&bytes, &sender(), NOW_NS);
        }
    }
}
