//! One thing that leaves the box.

use crate::history::record::Record;
use crate::history::{Series, SeriesKind};
use crate::moment;
use adapters::channel::CHANNELS;
use adapters::clock::TimeNs;
use serde_json::{Value as Json, json};
use std::sync::Arc;

/// A value, or the reason for none.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// In the unit of the series, with the digits that `history query` shows.
    Number(f64),
    /// A state word or name.
    Text(Arc<str>),
    /// No value, with the reason as one word: `not_provided`, `stale`, `timeout`, `not_learned`, ...
    Missing(Arc<str>),
}

/// A series as receivers need to know it.
#[derive(Debug, Clone, PartialEq)]
pub struct SeriesInfo {
    /// Number in the database; stable for the life of the file.
    pub id: i64,
    /// Name, ending in the unit for quantities.
    pub name: Arc<str>,
    /// Unit symbol; `1` for pure numbers, empty for text.
    pub unit: Arc<str>,
    /// Number or text.
    pub kind: SeriesKind,
    /// Least and greatest value that is physically possible, in the unit; `None` for text and for what is inferred.
    pub range: Option<(f64, f64)>,
    /// What it is, in English.
    pub en: Arc<str>,
    /// What it is, in Chinese.
    pub zh: Arc<str>,
    /// Inferred by the gateway rather than read from a source.
    pub estimated: bool,
}

impl From<&Series> for SeriesInfo {
    fn from(series: &Series) -> Self {
        let channel = CHANNELS.iter().find(|channel| !series.estimated && *channel.name == *series.name);
        Self {
            id: series.id,
            name: series.name.clone(),
            unit: series.unit.clone(),
            kind: series.kind,
            range: channel.map(|channel| channel.range).filter(|_| series.kind == SeriesKind::Number),
            en: series.en.clone(),
            zh: series.zh.clone(),
            estimated: series.estimated,
        }
    }
}

/// A series and its value.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// What was read or inferred.
    pub series: Arc<SeriesInfo>,
    /// What it is.
    pub value: Cell,
}

/// What an item tells.
#[derive(Debug, Clone, PartialEq)]
pub enum Content {
    /// The values of one tick that changed.
    Sample(Vec<Reading>),
    /// [`Record::State`], [`Record::Part`], [`Record::Alarm`], [`Record::AlarmClear`], [`Record::Decision`],
    /// [`Record::Diagnosis`] or [`Record::Event`].
    Record(Box<Record>),
}

/// One thing that leaves the box.
#[derive(Debug, Clone, PartialEq)]
pub struct Item {
    /// From 1, without holes over the life of the history database.
    pub sequence: u64,
    /// When it was true, nanoseconds since 1970-01-01 UTC.
    pub at_ns: TimeNs,
    /// What it tells.
    pub content: Content,
}

impl Item {
    /// One word: `sample`, `state`, `part`, `alarm`, `alarm_clear`, `decision`, `diagnosis`, `event`.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match &self.content {
            Content::Sample(_) => "sample",
            Content::Record(record) => kind_of(record),
        }
    }

    /// The item as a document (`item/1`): `sequence`, `time_utc`, `at_ns`, `kind`, and `values` (each with its unit) or
    /// `record`.
    #[must_use]
    pub fn json(&self) -> Json {
        let mut document = json!({
            "schema": "item/1",
            "sequence": self.sequence,
            "time_utc": moment::utc(self.at_ns),
            "at_ns": self.at_ns,
            "kind": self.kind(),
        });
        let (key, value) = match &self.content {
            Content::Sample(readings) => ("values", readings.iter().map(Reading::json).collect()),
            Content::Record(record) => ("record", record_json(record)),
        };
        document[key] = value;
        document
    }
}

impl Reading {
    /// `{"name", "value", "unit"}`, or with `missing` in place of the value.
    #[must_use]
    pub fn json(&self) -> Json {
        let name = &*self.series.name;
        match &self.value {
            Cell::Number(number) => json!({"name": name, "value": number, "unit": &*self.series.unit}),
            Cell::Text(text) => json!({"name": name, "value": &**text, "unit": ""}),
            Cell::Missing(reason) => json!({"name": name, "value": null, "missing": &**reason}),
        }
    }
}

fn kind_of(record: &Record) -> &'static str {
    match record {
        Record::Event(_) => "event",
        Record::Alarm(_) => "alarm",
        Record::AlarmClear(_) => "alarm_clear",
        Record::State(_) => "state",
        Record::Part(_) => "part",
        Record::Decision(_) => "decision",
        Record::Command(_) => "command",
        Record::Model(_) => "model",
        Record::Diagnosis(_) => "diagnosis",
        Record::Audit(_) => "audit",
        Record::Reaction(_) => "reaction",
    }
}

/// The fields of the record alone.
fn record_json(record: &Record) -> Json {
    let tagged = serde_json::to_value(record).unwrap_or(Json::Null);
    match tagged {
        Json::Object(fields) => fields.into_iter().next().map_or(Json::Null, |(_, fields)| fields),
        other => other,
    }
}

/// Is this a record that leaves the box? The audit, commands and models stay where they can be verified.
pub(super) fn leaves(record: &Record) -> bool {
    matches!(
        record,
        Record::Event(_)
            | Record::Alarm(_)
            | Record::AlarmClear(_)
            | Record::State(_)
            | Record::Part(_)
            | Record::Decision(_)
            | Record::Diagnosis(_)
    )
}
