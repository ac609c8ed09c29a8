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
struct Line {
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

/// Series by their numbers.
pub(super) type Known = HashMap<i64, Arc<SeriesInfo>>;

/// The item of a line; `None` for one that this version cannot read. Values of unknown series are left out.
pub(super) fn item(sequence: u64, text: &str, known: &Known) -> Option<Item> {
    let Line { t, s, r } = serde_json::from_str(text).ok()?;
    let content = match (s, r) {
        (Some(cells), _) => Content::Sample(cells.iter().filter_map(|(id, cell)| reading(id, cell, known)).collect()),
        (None, Some(record)) => Content::Record(Box::new(record)),
        (None, None) => return None,
    };
    Some(Item { sequence, at_ns: t, content })
}

/// Does the line name a series that is not among these?
pub(super) fn names_unknown(text: &str, known: &Known) -> bool {
    let line: Option<Line> = serde_json::from_str(text).ok();
    let cells = line.and_then(|line| line.s).unwrap_or_default();
    cells.keys().any(|id| id.parse().map_or(true, |id: i64| !known.contains_key(&id)))
}

fn reading(id: &str, cell: &Json, known: &Known) -> Option<Reading> {
    let series = known.get(&id.parse().ok()?)?.clone();
    let value = match cell {
        Json::Number(number) => Cell::Number(number.as_f64()?),
        Json::String(text) => Cell::Text(text.as_str().into()),
        other => Cell::Missing(other.get("m").and_then(Json::as_str).unwrap_or("not_provided").into()),
    };
    Some(Reading { series, value })
}
