//! An item as one line of JSON, without its number: what the rows of the table `outbox` hold, compressed.
//!
//! `{"t":at_ns,"s":{"<series>":cell}}` is a sample, `{"t":at_ns,"r":{"<kind>":{...}}}` a record. A cell is a number, a
//! text, or `{"m":"reason"}`.

use super::item::{Cell, Content, Item, Reading, SeriesInfo};
use crate::history::record::Record;
use adapters::clock::TimeNs;
use serde::Deserialize;
use serde_json::{Map, Value as Json, json};
use std::collections::HashMap;
use std::sync::Arc;

/// The JSON of a diagnosis beyond this is left out: it can be asked for on the box, and brokers refuse larger messages.
const DIAGNOSIS_BYTES_MAX: usize = 200_000;

#[derive(Debug, Deserialize)]
struct OutboxLine {
    t: TimeNs,
    #[serde(default)]
    s: Option<Map<String, Json>>,
    #[serde(default)]
    r: Option<Record>,
}

/// The line of a record.
pub(super) fn of_record(record: &Record) -> String {
    let mut record = record.clone();
    if let Record::Diagnosis(diagnosis) = &mut record
        && diagnosis.json.len() > DIAGNOSIS_BYTES_MAX
    {
        diagnosis.json =
            json!({"left_out": "the whole diagnosis is on the box", "bytes": diagnosis.json.len()}).to_string();
    }
    json!({ "t": record.at_ns(), "r": record }).to_string()
}

/// The same line, so much later; one that this version cannot read stays as it is.
pub(super) fn moved(text: &str, by_ns: i64) -> String {
    let Some(Parsed(line)) = parse(text) else { return text.to_owned() };
    if let Some(mut record) = line.r {
        record.shift(by_ns);
        return of_record(&record);
    }
    json!({ "t": line.t.saturating_add(by_ns), "s": line.s }).to_string()
}

/// Series by their numbers.
pub(super) type SeriesByNumber = HashMap<i64, Arc<SeriesInfo>>;

/// A line, parsed.
#[derive(Debug)]
pub(super) struct Parsed(OutboxLine);

/// Reads a line; `None` for one that this version cannot read.
pub(super) fn parse(text: &str) -> Option<Parsed> {
    serde_json::from_str(text).ok().filter(|line: &OutboxLine| line.s.is_some() || line.r.is_some()).map(Parsed)
}

impl Parsed {
    /// Does it name a series that is not among these?
    pub(super) fn names_unknown(&self, known: &SeriesByNumber) -> bool {
        let is_unknown = |id: &String| id.parse().map_or(true, |id: i64| !known.contains_key(&id));
        self.0.s.as_ref().is_some_and(|cells| cells.keys().any(is_unknown))
    }

    /// The item; values of unknown series are left out.
    pub(super) fn item(self, sequence: u64, known: &SeriesByNumber) -> Item {
        let OutboxLine { t, s, r } = self.0;
        let readings =
            |cells: Map<String, Json>| cells.iter().filter_map(|(id, cell)| reading(id, cell, known)).collect();
        let content = match r {
            Some(record) => Content::Record(Box::new(record)),
            None => Content::Sample(s.map(readings).unwrap_or_default()),
        };
        Item { sequence, at_ns: t, content }
    }
}

fn reading(id: &str, cell: &Json, known: &SeriesByNumber) -> Option<Reading> {
    let series = known.get(&id.parse().ok()?)?.clone();
    let value = match cell {
        Json::Number(number) => Cell::Number(number.as_f64()?),
        Json::String(text) => Cell::Text(text.as_str().into()),
        other => Cell::Missing(other.get("m").and_then(Json::as_str).unwrap_or("not_provided").into()),
    };
    Some(Reading { series, value })
}
