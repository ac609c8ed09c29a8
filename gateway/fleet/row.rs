//! A message of the stream as a row of the table `items`. Pure.

use adapters::clock::TimeNs;
use serde::Deserialize;
use serde_json::{Map, Value as Json};

/// Years outside these are a clock that was never set, and would only make partitions.
const YEARS: std::ops::RangeInclusive<i16> = 1990..=2100;

/// One item, ready to be written.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FleetRow {
    pub(super) box_name: String,
    pub(super) machine: String,
    pub(super) sequence: u64,
    pub(super) at: jiff::Timestamp,
    pub(super) kind: String,
    pub(super) historical: bool,
    /// Name, unit, number.
    pub(super) numbers: Vec<(String, String, f64)>,
    pub(super) texts: Map<String, Json>,
    pub(super) missing: Map<String, Json>,
    pub(super) record: Option<Json>,
}

/// A message that is no item: why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RefusedMessage(pub String);

#[derive(Deserialize)]
struct ItemDocument {
    schema: String,
    sequence: u64,
    at_ns: TimeNs,
    kind: String,
    #[serde(default)]
    values: Vec<FieldValue>,
    #[serde(default)]
    record: Option<Json>,
    machine: String,
    #[serde(rename = "box")]
    box_name: String,
    historical: bool,
}

#[derive(Deserialize)]
struct FieldValue {
    name: String,
    #[serde(default)]
    value: Json,
    #[serde(default)]
    unit: String,
    #[serde(default)]
    missing: Option<String>,
}

impl FleetRow {
    /// Reads a message. Its subject must end in `BOX.KIND` of its own document: then the rights of the servers over subjects
    /// hold for what stands in the table, too.
    pub(super) fn of(subject: &str, payload: &[u8]) -> Result<Self, RefusedMessage> {
        let refused = |what: &str| RefusedMessage(what.to_owned());
        let document: ItemDocument = serde_json::from_slice(payload)
            .map_err(|error| RefusedMessage(format!("no document of an item: {error}")))?;
        if document.schema != "item/1" {
            return Err(RefusedMessage(format!("an item of another version: {}", document.schema)));
        }
        let mut ends = subject.rsplit('.');
        if ends.next() != Some(&document.kind) || ends.next() != Some(&document.box_name) {
            return Err(refused("the subject belongs to another box or kind than the document says"));
        }
        if document.sequence == 0 || i64::try_from(document.sequence).is_err() {
            return Err(refused("the number of the item is out of range"));
        }
        let at = jiff::Timestamp::from_nanosecond(i128::from(document.at_ns)).map_err(|_| refused("no time"))?;
        if !YEARS.contains(&at.to_zoned(jiff::tz::TimeZone::UTC).year()) {
            return Err(refused("the time lies outside the years 1990 to 2100: set the clock of the box"));
        }
        let mut row = Self {
            box_name: document.box_name,
            machine: document.machine,
            sequence: document.sequence,
            at,
            kind: document.kind,
            historical: document.historical,
            numbers: Vec::new(),
            texts: Map::new(),
            missing: Map::new(),
            record: document.record,
        };
        document.values.into_iter().for_each(|value| row.add(value));
        Ok(row)
    }

    fn add(&mut self, FieldValue { name, value, unit, missing }: FieldValue) {
        match (value.as_f64(), value) {
            (Some(number), _) => self.numbers.push((name, unit, number)),
            (None, Json::String(text)) => drop(self.texts.insert(name, Json::String(text))),
            _ => drop(self.missing.insert(name, missing.unwrap_or_else(|| "not_provided".to_owned()).into())),
        }
    }

    /// The line of this row for `COPY`, with the numbers that box and series have in the database.
    pub(super) fn line(&self, box_id: i32, series: &[i32]) -> String {
        let list = |items: Vec<String>| format!("{{{}}}", items.join(","));
        let object = |map: &Map<String, Json>| match map.is_empty() {
            true => "\\N".to_owned(),
            false => copied(&Json::Object(map.clone()).to_string()),
        };
        let fields = [
            box_id.to_string(),
            self.sequence.to_string(),
            self.at.to_string(),
            copied(&self.kind),
            self.historical.to_string(),
            list(series.iter().map(i32::to_string).collect()),
            list(self.numbers.iter().map(|(_, _, number)| number.to_string()).collect()),
            object(&self.texts),
            object(&self.missing),
            self.record.as_ref().map_or("\\N".to_owned(), |record| copied(&record.to_string())),
        ];
        fields.join("\t") + "\n"
    }
}

/// The text format of `COPY`: a backslash before what would end a field or a line. PostgreSQL has no NUL in texts.
fn copied(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for letter in text.replace("\\u0000", "").chars() {
        match letter {
            '\\' => out.push_str("\\\\"),
            '\t' => out.push_str("\\t"),
            '\n' => out.push_str("\\n"),
            '\r' => out.push_str("\\r"),
            '\0' => {}
            other => out.push(other),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    fn sample() -> Json {
        json!({"schema": "item/1", "sequence": 7, "at_ns": 1_769_847_300_100_000_000_i64, "kind": "sample", "machine": "Lathe 7",
            "box": "Lathe-7-3fa9c1", "historical": false, "values": [
                {"name": "spindle_power_w", "value": 2249.5, "unit": "W"}, {"name": "program", "value": "O1\t\\", "unit": ""},
                {"name": "coolant_temperature_c", "value": null, "missing": "stale"}]})
    }

    #[test]
    fn a_sample_becomes_a_line() {
        let row = FleetRow::of("cnc.Lathe-7-3fa9c1.sample", sample().to_string().as_bytes()).expect("an item");
        let line = row.line(3, &[12]);
        let expected = "3\t7\t2026-01-31T08:15:00.1Z\tsample\tfalse\t{12}\t{2249.5}\t{\"program\":\"O1\\\\t\\\\\\\\\"}\t{\"coolant_temperature_c\":\"stale\"}\t\\N\n";
        assert_eq!(line, expected);
    }

    #[test]
    fn what_is_no_item_says_why() {
        let refused = |subject: &str, change: &dyn Fn(&mut Json)| {
            let mut document = sample();
            change(&mut document);
            FleetRow::of(subject, document.to_string().as_bytes()).expect_err("refused").0
        };
        assert!(refused("cnc.Mill-1-000000.sample", &|_| {}).contains("another box"));
        assert!(refused("cnc.Lathe-7-3fa9c1.sample", &|d| d["at_ns"] = json!(0)).contains("clock"));
        assert!(refused("cnc.Lathe-7-3fa9c1.sample", &|d| d["schema"] = json!("item/2")).contains("item/2"));
        assert!(refused("cnc.Lathe-7-3fa9c1.sample", &|d| d["sequence"] = json!(0)).contains("number"));
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_row_or_refused(subject in ".{0,40}", payload in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _either = FleetRow::of(&subject, &payload);
        }

        #[test]
        fn no_text_breaks_a_line(text in "\\PC{0,40}|[\t\n\r\\\\\0]{0,20}") {
            let line = copied(&text);
            prop_assert!(!line.contains(['\t', '\n', '\r', '\0']));
        }
    }
}
