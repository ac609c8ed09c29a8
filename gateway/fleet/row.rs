//! A message of the stream as a row. Pure.

use super::field::{FieldValue, ValueInItem};
use adapters::clock::TimeNs;
use gateway_base::machine_path::MachinePath;
use gateway_history::{NOT_RUNNING, parse_nested_json};
use serde::Deserialize;
use serde_json::Value as Json;
use std::borrow::Cow;

/// Years outside these are a clock that was never set, and would only make partitions.
const YEARS: std::ops::RangeInclusive<i16> = 1990..=2100;
/// A longer message is no item: a diagnosis, the longest, is cut at 200 kB by the box.
const BYTES_MAX: usize = 1_000_000;
/// Letters of a name: an index of PostgreSQL takes 2,700 bytes.
const NAME_MAX: usize = 200;
/// Letters of a text.
const TEXT_MAX: usize = 10_000;
/// Values of one item: a box has some hundred series.
const VALUES_MAX: usize = 5_000;

/// Fields of records that are times.
const TIMES: [&str; 6] = ["at_ns", "began_ns", "ended_ns", "from_ns", "to_ns", "until_ns"];

/// One item, ready to be written.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FleetRow<'a> {
    pub(super) box_name: Cow<'a, str>,
    pub(super) machine: Cow<'a, str>,
    /// Where the machine stands, as its box says; `None`: the machine is its box.
    pub(super) path: Option<MachinePath>,
    /// From 1 to the greatest `i64`.
    pub(super) sequence: i64,
    /// Which life of the box has numbered it; 0 for boxes of before.
    pub(super) epoch: i64,
    pub(super) at_ns: TimeNs,
    /// By how much the box has moved its time already, ns.
    pub(super) redated_ns: i64,
    pub(super) kind: Cow<'a, str>,
    pub(super) historical: bool,
    /// The cells of a sample.
    pub(super) numbers: Vec<(SeriesName<'a>, f64)>,
    pub(super) texts: Vec<(SeriesName<'a>, Cow<'a, str>)>,
    pub(super) missing: Vec<(SeriesName<'a>, Cow<'a, str>)>,
    /// The means of a minute, hour or day.
    pub(super) means: Vec<(SeriesName<'a>, [f64; 4])>,
    pub(super) record: Option<Json>,
}

/// A series, as a box names it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SeriesName<'a> {
    pub(super) name: Cow<'a, str>,
    pub(super) unit: Cow<'a, str>,
}

/// A message that is no item: why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RefusedMessage(pub String);

#[derive(Deserialize)]
struct ItemDocument<'a> {
    #[serde(borrow)]
    schema: Cow<'a, str>,
    sequence: u64,
    #[serde(default)]
    epoch: u64,
    #[serde(default)]
    redated_ns: i64,
    at_ns: TimeNs,
    #[serde(borrow)]
    kind: Cow<'a, str>,
    #[serde(default, borrow)]
    values: Vec<FieldValue<'a>>,
    #[serde(default)]
    record: Option<Json>,
    #[serde(borrow)]
    machine: Cow<'a, str>,
    #[serde(rename = "box", borrow)]
    box_name: Cow<'a, str>,
    #[serde(default, borrow)]
    path: Option<Cow<'a, str>>,
    historical: bool,
}

fn refuse_message<T>(what: impl Into<String>) -> Result<T, RefusedMessage> {
    Err(RefusedMessage(what.into()))
}

/// Names become rows of their own and titles of charts.
fn check_name<'a>(what: &str, name: Cow<'a, str>) -> Result<Cow<'a, str>, RefusedMessage> {
    // Most names are plain, and each value has one.
    if (1..=NAME_MAX).contains(&name.len()) && name.bytes().all(|letter| matches!(letter, b' '..=b'~')) {
        return Ok(name);
    }
    if name.is_empty() || name.contains(char::is_control) {
        return refuse_message(format!("the name of the {what} is empty or holds a control character"));
    }
    match name.chars().count() {
        0..=NAME_MAX => Ok(name),
        letters => {
            refuse_message(format!("the name of the {what} has {letters} letters, at most {NAME_MAX} are taken"))
        }
    }
}

/// A machine that has a path sends under it: `PATH.BOX.KIND`. So the rights of the servers over subjects hold for machines, too.
fn check_path(path: Option<&str>, subject: &str, box_name: &str) -> Result<Option<MachinePath>, RefusedMessage> {
    let Some(text) = path else { return Ok(None) };
    let path: MachinePath =
        text.parse().map_err(|error| RefusedMessage(format!("the path of the machine cannot be used: {error}")))?;
    let place = subject.rsplit_once('.').and_then(|(before, _kind)| before.strip_suffix(box_name));
    let expected = format!(".{}.", path.format_dotted());
    match place.is_some_and(|place| place.ends_with(&expected)) {
        true => Ok(Some(path)),
        false => refuse_message("the subject belongs to another machine than the path in the document says"),
    }
}

/// PostgreSQL has no NUL in texts.
fn clean_text(text: Cow<'_, str>) -> Cow<'_, str> {
    match text.contains('\0') || text.len() > TEXT_MAX {
        true => text.chars().filter(|letter| *letter != '\0').take(TEXT_MAX).collect::<String>().into(),
        false => text,
    }
}

/// The same within JSON.
fn without_nul(json: &mut Json) {
    match json {
        Json::String(text) if text.contains('\0') => text.retain(|letter| letter != '\0'),
        Json::Array(items) => items.iter_mut().for_each(without_nul),
        Json::Object(fields) => {
            if fields.keys().any(|key| key.contains('\0')) {
                fields.retain(|key, _| !key.contains('\0'));
            }
            fields.values_mut().for_each(without_nul);
        }
        _ => {}
    }
}

impl<'a> FleetRow<'a> {
    /// Reads a message. Its subject must end in `BOX.KIND` of its own document: then the rights of the servers over subjects
    /// hold for what stands in the table, too.
    pub(super) fn from_message(subject: &str, payload: &'a [u8]) -> Result<Self, RefusedMessage> {
        if payload.len() > BYTES_MAX {
            return refuse_message(format!("a message of {} bytes is no item: at most {BYTES_MAX}", payload.len()));
        }
        let document: ItemDocument<'a> = serde_json::from_slice(payload)
            .map_err(|error| RefusedMessage(format!("no document of an item: {error}")))?;
        if document.schema != "item/1" {
            let version: String = document.schema.chars().take(40).collect();
            return refuse_message(format!("an item of another version: {version:?}"));
        }
        let mut ends = subject.rsplit('.');
        if ends.next() != Some(&document.kind) || ends.next() != Some(&document.box_name) {
            return refuse_message("the subject belongs to another box or kind than the document says");
        }
        let path = check_path(document.path.as_deref(), subject, &document.box_name)?;
        let sequence = match i64::try_from(document.sequence) {
            Ok(sequence) if sequence > 0 => sequence,
            _ => return refuse_message("the number of the item is out of range"),
        };
        let Ok(epoch) = i64::try_from(document.epoch) else {
            return refuse_message("the epoch of the item is out of range");
        };
        let at = jiff::Timestamp::from_nanosecond(i128::from(document.at_ns));
        let year = at.map(|at| at.to_zoned(jiff::tz::TimeZone::UTC).year());
        if !year.is_ok_and(|year| YEARS.contains(&year)) {
            return refuse_message("the time lies outside the years 1990 to 2100: set the clock of the box");
        }
        if document.values.len() > VALUES_MAX {
            return refuse_message(format!("{} values in one item: at most {VALUES_MAX}", document.values.len()));
        }
        let mut row = Self {
            box_name: check_name("box", document.box_name)?,
            machine: check_name("machine", document.machine)?,
            path,
            sequence,
            epoch,
            redated_ns: document.redated_ns,
            at_ns: document.at_ns,
            kind: check_name("kind", document.kind)?,
            historical: document.historical,
            numbers: Vec::new(),
            texts: Vec::new(),
            missing: Vec::new(),
            means: Vec::new(),
            record: document.record.map(parse_nested_json),
        };
        row.record.iter_mut().for_each(without_nul);
        document.values.into_iter().try_for_each(|value| row.add(value))?;
        Ok(row)
    }

    fn add(&mut self, value: FieldValue<'a>) -> Result<(), RefusedMessage> {
        let unit = if value.unit.is_empty() { value.unit } else { check_name("unit", value.unit)? };
        let series = SeriesName { name: check_name("series", value.name)?, unit };
        if let (Some(mean), Some(seconds)) = (value.mean, value.seconds) {
            let (least, greatest) = (value.least.unwrap_or(mean), value.greatest.unwrap_or(mean));
            self.means.push((series, [mean, least, greatest, seconds]));
            return Ok(());
        }
        match value.value {
            ValueInItem::Number(number) => self.numbers.push((series, number)),
            ValueInItem::Text(words) => self.texts.push((series, clean_text(words))),
            ValueInItem::Missing => {
                self.missing.push((series, value.missing.map_or("not_provided".into(), clean_text)))
            }
        }
        Ok(())
    }

    /// Its time is so much later: the clock of the box had been wrong when it was sent. Means are of other minutes then, and the box tells
    /// those anew; a gap before the first sample of a run begins with the run before.
    pub(super) fn shift_time(&mut self, by_ns: i64) {
        // The times of a fact are those of whoever told it.
        if self.kind == "fact" {
            return;
        }
        self.redated_ns = self.redated_ns.saturating_add(by_ns);
        if !self.means.is_empty() {
            self.means.clear();
            return;
        }
        if self.record.as_ref().is_none_or(|record| record["reason"] != NOT_RUNNING || self.kind != "gap") {
            self.at_ns = self.at_ns.saturating_add(by_ns);
        }
        let Some(Json::Object(fields)) = &mut self.record else { return };
        for name in TIMES {
            if let Some(time) = fields.get_mut(name)
                && let Some(at_ns) = time.as_i64()
            {
                *time = Json::from(at_ns.saturating_add(by_ns));
            }
        }
    }

    /// Microseconds since 1970; what is below a microsecond is cut off.
    pub(super) fn at_us(&self) -> i64 {
        self.at_ns.div_euclid(1000)
    }

    /// Every series that it names.
    pub(super) fn series_names(&self) -> impl Iterator<Item = &SeriesName<'a>> {
        let cells = self.texts.iter().chain(&self.missing).map(|(series, _)| series);
        self.numbers.iter().map(|(series, _)| series).chain(cells).chain(self.means.iter().map(|(series, _)| series))
    }
}

/// A row, and when the stream had it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Arrived<'a> {
    pub(super) row: &'a FleetRow<'a>,
    /// When the stream had the row, microseconds since 1970.
    pub(super) arrived_us: i64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    const SUBJECT: &str = "cnc.Lathe-7-3fa9c1.sample";

    fn sample() -> Json {
        json!({"schema": "item/1", "sequence": 7, "at_ns": 1_769_847_300_100_000_999_i64, "kind": "sample", "machine": "Lathe 7",
            "box": "Lathe-7-3fa9c1", "historical": false, "values": [
                {"name": "spindle_power_w", "value": 2249.5, "unit": "W"}, {"name": "program", "value": "O1\t\\", "unit": ""},
                {"name": "coolant_temperature_c", "value": null, "unit": "°C", "missing": "stale"}]})
    }

    #[test]
    fn a_sample_is_numbers_texts_and_reasons() {
        let payload = sample().to_string();
        let row = FleetRow::from_message(SUBJECT, payload.as_bytes()).expect("an item");
        assert_eq!((row.sequence, row.at_us(), row.at_ns % 1000), (7, 1_769_847_300_100_000, 999));
        assert_eq!((row.numbers[0].1, &*row.numbers[0].0.unit), (2249.5, "W"));
        assert_eq!((&*row.texts[0].0.name, &*row.texts[0].1), ("program", "O1\t\\"));
        assert_eq!((&*row.missing[0].0.unit, &*row.missing[0].1), ("°C", "stale"));
    }

    #[test]
    fn what_is_no_item_says_why() {
        let said = |subject: &str, change: &dyn Fn(&mut Json)| {
            let mut document = sample();
            change(&mut document);
            FleetRow::from_message(subject, document.to_string().as_bytes()).expect_err("refused").0
        };
        assert!(said("cnc.Mill-1-000000.sample", &|_| {}).contains("another box"));
        assert!(said(SUBJECT, &|d| d["at_ns"] = json!(0)).contains("clock"));
        assert!(said(SUBJECT, &|d| d["at_ns"] = json!(9_000_000_000_000_000_000_i64)).contains("clock"), "2255");
        assert!(said(SUBJECT, &|d| d["schema"] = json!("item/2")).contains("item/2"));
        assert!(said(SUBJECT, &|d| d["sequence"] = json!(0)).contains("number"));
        assert!(said(SUBJECT, &|d| d["sequence"] = json!(u64::MAX)).contains("number"));
        assert!(said(SUBJECT, &|d| d["machine"] = json!("a\0b")).contains("machine"));
        assert!(said(SUBJECT, &|d| d["values"][0]["name"] = json!("p\0w")).contains("series"));
        assert!(said(SUBJECT, &|d| d["values"][0]["name"] = json!("n".repeat(9000))).contains("9000 letters"));
        assert!(said(SUBJECT, &|d| d["machine"] = json!("x".repeat(2_000_000))).contains("bytes"));
        assert!(
            FleetRow::from_message(SUBJECT, b"{\"schema\":\"item/1\xff\"}")
                .expect_err("refused")
                .0
                .contains("no document")
        );
    }

    #[test]
    fn a_machine_with_a_path_sends_under_it() {
        let mut document = sample();
        document["path"] = json!("shanghai/line-2/lathe-7");
        let payload = document.to_string();
        let read = |subject: &str| FleetRow::from_message(subject, payload.as_bytes()).map(|row| row.path);
        let path = "shanghai/line-2/lathe-7".parse().expect("a path");
        assert_eq!(read("cnc.shanghai.line-2.lathe-7.Lathe-7-3fa9c1.sample"), Ok(Some(path)));
        for other in
            [SUBJECT, "cnc.shanghai.line-2.lathe-8.Lathe-7-3fa9c1.sample", "cnc.line-2.lathe-7.Lathe-7-3fa9c1.sample"]
        {
            assert!(read(other).expect_err("refused").0.contains("another machine"), "{other}");
        }
        document["path"] = json!("lathe 7");
        let payload = document.to_string();
        assert!(FleetRow::from_message(SUBJECT, payload.as_bytes()).expect_err("refused").0.contains("cannot be used"));
    }

    #[test]
    fn a_nul_in_a_text_is_left_out_and_a_backslash_before_its_name_is_not() {
        let mut document = sample();
        document["values"][1]["value"] = json!("a\0b\\u0000");
        document["record"] = json!({"text": "c\0\\u0000", "d\0": 1, "detail": "{\"tools\":[]}", "list": ["\0"]});
        let payload = document.to_string();
        let row = FleetRow::from_message(SUBJECT, payload.as_bytes()).expect("an item");
        assert_eq!(&*row.texts[0].1, "ab\\u0000");
        assert_eq!(row.record, Some(json!({"text": "c\\u0000", "detail": {"tools": []}, "list": [""]})));
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_row_or_refused(subject in ".{0,40}", payload in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _either = FleetRow::from_message(&subject, &payload);
        }
    }
}
