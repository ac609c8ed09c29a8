//! One thing that leaves the box.

use crate::levels::LEVELS;
use crate::{Series, SeriesKind};
use adapter_core::ChannelId;
use adapter_core::channel::{Channel, Form};
use adapter_core::clock::TimeNs;
use gateway_base::moment;
use gateway_records::Record;
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
    /// Whether the values are numbers or words.
    pub kind: SeriesKind,
    /// Least and greatest value of this machine, in the unit; `None` where nobody has said.
    pub range: Option<(f64, f64)>,
    /// Which numbers it can have.
    pub form: Form,
    /// What it is, in English.
    pub en: Arc<str>,
    /// What it is, in Chinese.
    pub zh: Arc<str>,
    /// Inferred by the gateway rather than read from a source.
    pub estimated: bool,
}

impl From<&Series> for SeriesInfo {
    fn from(series: &Series) -> Self {
        let channel = ChannelId::from_name(&series.name).filter(|_| !series.estimated).map(ChannelId::channel);
        Self {
            id: series.id,
            name: series.name.clone(),
            unit: series.unit.clone(),
            kind: series.kind,
            range: channel.and_then(natural_range),
            form: channel.map_or(Form::Real, |channel| channel.form),
            en: series.en.clone(),
            zh: series.zh.clone(),
            estimated: series.estimated,
        }
    }
}

/// The range of a channel where that is one of its nature: a share of what is programmed, a flag. The table of channels holds what is physically
/// possible on any machine, which says nothing of this one.
fn natural_range(channel: &Channel) -> Option<(f64, f64)> {
    (channel.form == Form::Flag).then_some(channel.range)
}

/// A series and its value.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// What was read or inferred.
    pub series: Arc<SeriesInfo>,
    /// The value, or the reason for none.
    pub value: Cell,
}

/// A stretch of time in which the box had no samples: no value is known in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Gap {
    /// When samples begin again; `None`: not yet.
    pub until_ns: Option<TimeNs>,
    /// Why, as one word: `stopped`, `not_running`, `no_samples`.
    pub reason: Arc<str>,
}

/// One series over one minute, hour or day.
#[derive(Debug, Clone, PartialEq)]
pub struct SeriesMean {
    /// What was read or inferred.
    pub series: Arc<SeriesInfo>,
    /// For how long there was a value, s.
    pub seconds: f64,
    /// Mean over that time, in the unit of the series.
    pub mean: f64,
    /// Least value over that time, in the unit of the series.
    pub least: f64,
    /// Greatest value over that time, in the unit of the series.
    pub greatest: f64,
}

/// What an item tells.
#[derive(Debug, Clone, PartialEq)]
pub enum Content {
    /// The values of one tick that changed.
    Sample(Vec<Reading>),
    /// [`Record::State`], [`Record::Part`], [`Record::Alarm`], [`Record::AlarmClear`], [`Record::Decision`],
    /// [`Record::Diagnosis`], [`Record::Event`] or [`Record::Fact`].
    Record(Box<Record>),
    /// There are no samples from the time of the item on.
    Gap(Gap),
    /// The summaries of a minute, hour or day that begins at the time of the item, as the history holds them by now. A later item
    /// of the same time replaces it.
    Means {
        /// Length of the stretch, s: 60, 3600 or 86400.
        width_s: u32,
        /// Every series that had a value.
        means: Vec<SeriesMean>,
    },
}

/// One thing that leaves the box.
#[derive(Debug, Clone, PartialEq)]
pub struct Item {
    /// From 1, without holes over the life of the history database.
    pub sequence: u64,
    /// Which opening of the history has numbered it: a copy that is put back numbers other items with the same numbers.
    pub epoch: u64,
    /// By how much its time was moved since it was made, because the clock turned out to have been wrong, ns.
    pub redated_ns: i64,
    /// When it was true, nanoseconds since 1970-01-01 UTC.
    pub at_ns: TimeNs,
    /// The values, record, gap or summaries that the item carries.
    pub content: Content,
}

impl Item {
    /// One word: `sample`, `state`, `part`, `alarm`, `alarm_clear`, `decision`, `diagnosis`, `event`, `fact`, `gap`, `minute`, `hour`,
    /// `day`.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match &self.content {
            Content::Sample(_) => "sample",
            Content::Record(record) => kind_of(record),
            Content::Gap(_) => "gap",
            Content::Means { width_s, .. } => {
                LEVELS.iter().find(|level| level.width_s == *width_s).map_or("minute", |level| level.key)
            }
        }
    }

    /// Does its time say how far the receiver is? What is told of a time that is over does not.
    #[must_use]
    pub fn is_live(&self) -> bool {
        matches!(self.content, Content::Sample(_) | Content::Record(_))
    }

    /// The item as a document (`item/1`): `sequence`, `epoch`, `time_utc`, `at_ns`, `kind`, and `values` (each with its unit) or
    /// `record`; of means also `width_s`; `redated_ns` where its time was moved.
    #[must_use]
    pub fn to_json(&self) -> Json {
        let mut document = json!({
            "schema": "item/1",
            "sequence": self.sequence,
            "epoch": self.epoch,
            "time_utc": moment::format_utc(self.at_ns),
            "at_ns": self.at_ns,
            "kind": self.kind(),
        });
        let (key, value) = match &self.content {
            Content::Sample(readings) => ("values", readings.iter().map(Reading::to_json).collect()),
            Content::Record(record) => ("record", record_json(record)),
            Content::Gap(Gap { until_ns, reason }) => ("record", json!({"until_ns": until_ns, "reason": &**reason})),
            Content::Means { width_s, means } => {
                document["width_s"] = Json::from(*width_s);
                ("values", means.iter().map(SeriesMean::to_json).collect())
            }
        };
        document[key] = value;
        if self.redated_ns != 0 {
            document["redated_ns"] = Json::from(self.redated_ns);
        }
        document
    }
}

impl Reading {
    /// `{"name", "value", "unit"}`, with `missing` where the value is null.
    #[must_use]
    pub fn to_json(&self) -> Json {
        let name = &*self.series.name;
        match &self.value {
            Cell::Number(number) => json!({"name": name, "value": number, "unit": &*self.series.unit}),
            Cell::Text(text) => json!({"name": name, "value": &**text, "unit": ""}),
            Cell::Missing(reason) => {
                json!({"name": name, "value": null, "unit": &*self.series.unit, "missing": &**reason})
            }
        }
    }
}

impl SeriesMean {
    fn to_json(&self) -> Json {
        let Self { series, seconds, mean, least, greatest } = self;
        json!({"name": &*series.name, "unit": &*series.unit, "mean": mean, "least": least, "greatest": greatest, "seconds": seconds})
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
        Record::Fact(_) => "fact",
    }
}

/// Fields of a record that hold JSON as a text; they are empty where there is nothing to add.
const NESTED: [&str; 2] = ["detail", "json"];

/// The fields of the record alone, with what is JSON in a text as JSON.
fn record_json(record: &Record) -> Json {
    let tagged = serde_json::to_value(record).unwrap_or(Json::Null);
    let Json::Object(tagged) = tagged else { return tagged };
    tagged.into_iter().next().map_or(Json::Null, |(_, fields)| parse_nested_json(fields))
}

/// The fields of a record with what is JSON in a text as JSON. A detail that is plain words stays a text.
pub fn parse_nested_json(mut fields: Json) -> Json {
    for name in NESTED {
        let Some(Json::String(text)) = fields.get(name) else { continue };
        let nested = if text.is_empty() { Some(Json::Null) } else { serde_json::from_str(text).ok() };
        if let Some(nested) = nested {
            fields[name] = unwrap_text(nested);
        }
    }
    fields
}

/// The object or list in a text that holds one: earlier versions put the JSON of a notice into a text once more.
fn unwrap_text(value: Json) -> Json {
    let Json::String(text) = &value else { return value };
    let inner: Option<Json> = serde_json::from_str(text).ok();
    inner.filter(|it| it.is_object() || it.is_array()).unwrap_or(value)
}

/// Is this a record that leaves the box? The audit, commands and models stay where they can be verified.
pub(super) fn is_deliverable(record: &Record) -> bool {
    matches!(
        record,
        Record::Event(_)
            | Record::Alarm(_)
            | Record::AlarmClear(_)
            | Record::State(_)
            | Record::Part(_)
            | Record::Decision(_)
            | Record::Diagnosis(_)
            | Record::Fact(_)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_in_a_text_is_json_even_where_it_was_put_into_a_text_twice() {
        let told = json!({ "moves": [1] });
        for detail in [told.to_string(), json!(told.to_string()).to_string()] {
            assert_eq!(parse_nested_json(json!({ "detail": detail }))["detail"], told);
        }
        let words = json!("look at the cable").to_string();
        assert_eq!(parse_nested_json(json!({ "detail": words }))["detail"], "look at the cable");
    }
}
