//! The payloads of a node: birth, data, death. Pure.
//!
//! A metric is a series under its own name, with the alias that stands for it in data; flags are Boolean, counts Int64, other numbers
//! Double. Properties say unit (`engUnit`, where there is one), range (`engLow`, `engHigh`, where somebody has said), descriptions and
//! whether it is inferred. A value that is missing is null, with the property
//! `Quality` (0 bad, 500 stale) and the reason as one word in `missing`. Records are metrics of type String that hold JSON.

use super::payload::{Metric, MetricValue, Payload, Property, PropertySet, datatype};
use adapter_core::channel::Form;
use adapter_core::clock::TimeNs;
use gateway_base::convert::clamp_to_unsigned;
use gateway_history::{Cell, Content, Item, Reading, SeriesInfo, SeriesKind};
use std::collections::BTreeSet;

/// Where metrics of the protocol itself stand (specification, 6.4.8).
pub(super) const REBIRTH: &str = "Node Control/Rebirth";
const BIRTH_DEATH: &str = "bdSeq";

/// The number of each item, so that a receiver knows one that comes twice.
const SEQUENCE: (&str, u64) = ("item/sequence", 1);
/// One metric for each kind of record, with its alias.
const RECORDS: [(&str, u64); 8] = [
    ("record/state", 2),
    ("record/part", 3),
    ("record/alarm", 4),
    ("record/alarm_clear", 5),
    ("record/decision", 6),
    ("record/diagnosis", 7),
    ("record/event", 8),
    // 9 to 12 are requests and their answers.
    ("record/fact", 13),
];
/// The alias of a series is its number in the history and this.
const SERIES_FROM: u64 = 100;

/// Qualities as Sparkplug hosts use them.
const BAD: u32 = 0;
const STALE: u32 = 500;

/// Milliseconds since 1970, as payloads have them.
pub(super) fn to_milliseconds(at_ns: TimeNs) -> u64 {
    clamp_to_unsigned(at_ns.div_euclid(1_000_000))
}

/// What stands behind the will: a death is matched to its birth by this number.
pub(super) fn birth_death(number: u8, at_ms: u64) -> Metric {
    Metric::with_name(BIRTH_DEATH, datatype::INT64, at_ms, MetricValue::Long(number.into()))
}

/// Death of the node: no sequence number, the number of its birth.
pub(super) fn build_death(number: u8, at_ms: u64) -> Payload {
    Payload { timestamp: Some(at_ms), metrics: vec![birth_death(number, at_ms)], seq: None }
}

/// What is only of the node: the number of its birth and the way to ask for another one.
pub(super) fn build_node_metrics(number: u8, at_ms: u64) -> Vec<Metric> {
    vec![birth_death(number, at_ms), Metric::with_name(REBIRTH, datatype::BOOLEAN, at_ms, MetricValue::Boolean(false))]
}

/// Every metric of the machine with its last value; `known` is filled with the series that have one.
pub(super) fn build_machine_metrics(latest: &[Reading], known: &mut BTreeSet<i64>, at_ms: u64) -> Vec<Metric> {
    let of_item = Metric {
        alias: Some(SEQUENCE.1),
        value: None,
        is_null: Some(true),
        ..Metric::with_name(SEQUENCE.0, datatype::UINT64, at_ms, MetricValue::Long(0))
    };
    let of_record = |(name, alias): &(&str, u64)| Metric {
        alias: Some(*alias),
        value: None,
        is_null: Some(true),
        ..Metric::with_name(name, datatype::STRING, at_ms, MetricValue::Text(String::new()))
    };
    let provided = |reading: &&Reading| known.contains(&reading.series.id) || !is_unprovided(&reading.value);
    let readings: Vec<&Reading> = latest.iter().filter(provided).collect();
    known.extend(readings.iter().map(|reading| reading.series.id));
    let of_series = readings.into_iter().map(|reading| build_birth_metric(reading, at_ms));
    std::iter::once(of_item).chain(RECORDS.iter().map(of_record)).chain(of_series).collect()
}

fn is_unprovided(value: &Cell) -> bool {
    matches!(value, Cell::Missing(reason) if **reason == *"not_provided")
}

/// A metric as a birth has it: name, alias, type, what it is, and the value.
fn build_birth_metric(reading: &Reading, at_ms: u64) -> Metric {
    let SeriesInfo { name, unit, range, en, zh, estimated, .. } = &*reading.series;
    let mut metric = build_data_metric(reading, at_ms);
    metric.datatype = Some(choose_datatype(&reading.series));
    metric.name = Some(name.to_string());
    let mut properties = PropertySet::default();
    if reading.series.kind == SeriesKind::Number && **unit != *"1" {
        properties.add_property("engUnit", Property::Text(unit.to_string()));
    }
    if let Some((least, greatest)) = range {
        properties.add_property("engLow", Property::Double(*least));
        properties.add_property("engHigh", Property::Double(*greatest));
    }
    properties.add_property("description", Property::Text(en.to_string()));
    properties.add_property("description_zh", Property::Text(zh.to_string()));
    properties.add_property("estimated", Property::Boolean(*estimated));
    let quality = metric.properties.take().unwrap_or_default();
    properties.keys.extend(quality.keys);
    properties.values.extend(quality.values);
    metric.properties = Some(properties);
    metric
}

fn choose_datatype(series: &SeriesInfo) -> u32 {
    match (series.kind, series.form) {
        (SeriesKind::Text, _) => datatype::STRING,
        (SeriesKind::Number, Form::Flag) => datatype::BOOLEAN,
        (SeriesKind::Number, Form::Whole) => datatype::INT64,
        (SeriesKind::Number, Form::Real) => datatype::DOUBLE,
    }
}

/// A number as the type of its series has it.
fn to_metric_value(series: &SeriesInfo, number: f64) -> MetricValue {
    match series.form {
        Form::Flag => MetricValue::Boolean(number != 0.0),
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "an Int64 stands as its two's complement; saturates"
        )]
        Form::Whole => MetricValue::Long(number.round() as i64 as u64),
        Form::Real => MetricValue::Double(number),
    }
}

/// A metric as data has it: alias and value. Its type stands in the birth.
fn build_data_metric(reading: &Reading, at_ms: u64) -> Metric {
    let mut metric = Metric { alias: Some(to_alias(&reading.series)), timestamp: Some(at_ms), ..Metric::default() };
    match &reading.value {
        Cell::Number(number) => metric.value = Some(to_metric_value(&reading.series, *number)),
        Cell::Text(text) => metric.value = Some(MetricValue::Text(text.to_string())),
        Cell::Missing(reason) => {
            let mut quality = PropertySet::default();
            quality.add_property("Quality", Property::Int(if **reason == *"stale" { STALE } else { BAD }));
            quality.add_property("missing", Property::Text(reason.to_string()));
            (metric.is_null, metric.properties) = (Some(true), Some(quality));
        }
    }
    metric
}

fn to_alias(series: &SeriesInfo) -> u64 {
    // Series are numbered from 1; whatever their numbers are, no two of them share an alias.
    SERIES_FROM.wrapping_add(series.id.cast_unsigned())
}

/// The metrics of an item.
pub(super) fn build_item_metrics(item: &Item, historical: bool) -> Vec<Metric> {
    let at_ms = to_milliseconds(item.at_ns);
    let sequence = Metric {
        alias: Some(SEQUENCE.1),
        timestamp: Some(at_ms),
        value: Some(MetricValue::Long(item.sequence)),
        ..Metric::default()
    };
    let mut metrics = vec![sequence];
    match &item.content {
        Content::Sample(readings) => metrics.extend(readings.iter().map(|reading| build_data_metric(reading, at_ms))),
        Content::Record(_) => metrics.extend(build_record_metric(item, at_ms)),
        // Sparkplug has no word for them; the number of the item tells that nothing is missing.
        Content::Gap(_) | Content::Means { .. } => {}
    }
    if historical {
        metrics.iter_mut().for_each(|metric| metric.is_historical = Some(true));
    }
    metrics
}

fn build_record_metric(item: &Item, at_ms: u64) -> Option<Metric> {
    let (_, alias) = RECORDS.iter().find(|(name, _)| name.strip_prefix("record/") == Some(item.kind()))?;
    Some(Metric {
        alias: Some(*alias),
        timestamp: Some(at_ms),
        value: Some(MetricValue::Text(item.to_json()["record"].to_string())),
        ..Metric::default()
    })
}

/// Does the item tell anything of the device while that is dead: a value, or a record?
pub(super) fn is_of_living(item: &Item) -> bool {
    match &item.content {
        Content::Sample(readings) => readings.iter().any(is_read),
        Content::Record(_) => true,
        Content::Gap(_) | Content::Means { .. } => false,
    }
}

/// A value that was read, not inferred.
pub(super) fn is_read(reading: &Reading) -> bool {
    !reading.series.estimated && !matches!(reading.value, Cell::Missing(_))
}

/// Does the item tell of a series that no birth has named?
pub(super) fn is_unknown(item: &Item, known: &BTreeSet<i64>) -> bool {
    match &item.content {
        Content::Sample(readings) => readings.iter().any(|reading| !known.contains(&reading.series.id)),
        Content::Record(_) | Content::Gap(_) | Content::Means { .. } => false,
    }
}

/// Does a command of the network ask for another birth?
pub(super) fn asks_rebirth(payload: &Payload) -> bool {
    let asks =
        |metric: &Metric| metric.name.as_deref() == Some(REBIRTH) && metric.value == Some(MetricValue::Boolean(true));
    payload.metrics.iter().any(asks)
}
