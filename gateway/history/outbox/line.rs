//! An item as one line of JSON, without its number: what the rows of the table `outbox` hold, compressed.
//!
//! `{"t":at_ns,"s":{"<series>":cell}}` is a sample, `{"t":at_ns,"r":{"<kind>":{...}}}` a record, `{"t":at_ns,"g":{"u":until_ns,
//! "r":"reason"}}` a gap, `{"t":start_ns,"w":width_s,"m":{"<series>":[seconds,mean,least,greatest]}}` the means of a minute, hour
//! or day. A cell is a number, a text, or `{"m":"reason"}`. Where the time was moved since, `"d"` says by how much, ns.

use super::item::{Cell, Content, Gap, Item, Reading, SeriesInfo, SeriesMean};
use crate::tail::{append_comma, put_number};
use adapter_core::clock::TimeNs;
use gateway_records::Record;
use serde::Deserialize;
use serde_json::{Map, Value as Json, json};
use std::collections::{BTreeMap, HashMap};
use std::fmt::Write;
use std::sync::Arc;

/// The JSON of a diagnosis beyond this is left out: it can be asked for on the box, and brokers refuse larger messages.
const DIAGNOSIS_BYTES_MAX: usize = 200_000;

/// Why there is a gap before the first sample of a run.
pub const NOT_RUNNING: &str = "not_running";

#[derive(Debug, Deserialize)]
struct OutboxLine {
    t: TimeNs,
    #[serde(default)]
    d: i64,
    #[serde(default)]
    s: Option<Map<String, Json>>,
    #[serde(default)]
    r: Option<Record>,
    #[serde(default)]
    g: Option<GapLine>,
    #[serde(default)]
    w: u32,
    #[serde(default)]
    m: Option<BTreeMap<i64, [f64; 4]>>,
}

#[derive(Debug, Deserialize)]
struct GapLine {
    u: Option<TimeNs>,
    r: String,
}

impl OutboxLine {
    fn holds_something(&self) -> bool {
        self.s.is_some() || self.r.is_some() || self.g.is_some() || self.m.is_some()
    }
}

/// The line of a gap.
pub(super) fn of_gap(from_ns: TimeNs, until_ns: Option<TimeNs>, reason: &str) -> String {
    json!({"t": from_ns, "g": {"u": until_ns, "r": reason}}).to_string()
}

/// The line of means: of each series its number, and seconds, mean, least and greatest value.
pub(super) fn of_means(start_ns: TimeNs, width_s: u32, means: &[(i64, [f64; 4])]) -> String {
    let mut text = format!("{{\"t\":{start_ns},\"w\":{width_s},\"m\":{{");
    for (index, (series, numbers)) in means.iter().enumerate() {
        append_comma(&mut text, index);
        // Writing to a string cannot fail.
        let _ = write!(text, "\"{series}\":[");
        for (index, number) in numbers.iter().enumerate() {
            append_comma(&mut text, index);
            put_number(&mut text, *number);
        }
        text.push(']');
    }
    text + "}}"
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

/// The same line, so much later; one that this version cannot read stays as it is. Means of a wrong time are of other minutes than those
/// of the right one: they become an empty line, which keeps its number and is passed over.
pub(super) fn shift_line(text: &str, by_ns: i64) -> String {
    let Some(Parsed(line)) = parse(text) else { return text.to_owned() };
    let OutboxLine { t, d, s, r, g, .. } = line;
    let moved_ns = d.saturating_add(by_ns);
    match (s, r, g) {
        (_, Some(mut record), _) => {
            record.shift_times(by_ns);
            json!({"t": record.at_ns(), "d": moved_ns, "r": record}).to_string()
        }
        (Some(cells), ..) => json!({"t": t.saturating_add(by_ns), "d": moved_ns, "s": cells}).to_string(),
        (.., Some(gap)) => shift_gap(t, gap, by_ns, moved_ns),
        _ => String::new(),
    }
}

/// A gap before the first sample of a run begins with the run before, which another clock may have dated: only its end moves. One whose
/// end comes to lie before its beginning is none.
fn shift_gap(from_ns: TimeNs, GapLine { u, r }: GapLine, by_ns: i64, moved_ns: i64) -> String {
    let from_ns = if r == NOT_RUNNING { from_ns } else { from_ns.saturating_add(by_ns) };
    let until_ns = u.map(|until_ns| until_ns.saturating_add(by_ns));
    match until_ns {
        Some(until_ns) if until_ns <= from_ns => String::new(),
        _ => json!({"t": from_ns, "d": moved_ns, "g": {"u": until_ns, "r": r}}).to_string(),
    }
}

/// Series by their numbers.
pub(super) type SeriesByNumber = HashMap<i64, Arc<SeriesInfo>>;

#[derive(Debug)]
pub(super) struct Parsed(OutboxLine);

/// Reads a line; `None` for one that this version cannot read.
pub(super) fn parse(text: &str) -> Option<Parsed> {
    serde_json::from_str(text).ok().filter(OutboxLine::holds_something).map(Parsed)
}

impl Parsed {
    /// Does it name a series that is not among these?
    pub(super) fn names_unknown(&self, known: &SeriesByNumber) -> bool {
        let is_unknown = |id: &String| id.parse().map_or(true, |id: i64| !known.contains_key(&id));
        self.0.s.as_ref().is_some_and(|cells| cells.keys().any(is_unknown))
            || self.0.m.as_ref().is_some_and(|means| means.keys().any(|id| !known.contains_key(id)))
    }

    /// The item; values of unknown series are left out.
    pub(super) fn into_item(self, sequence: u64, epoch: u64, known: &SeriesByNumber) -> Item {
        let OutboxLine { t, d, s, r, g, w, m } = self.0;
        let readings =
            |cells: Map<String, Json>| cells.iter().filter_map(|(id, cell)| parse_reading(id, cell, known)).collect();
        let content = match (r, g, m) {
            (Some(record), ..) => Content::Record(Box::new(record)),
            (_, Some(GapLine { u, r }), _) => Content::Gap(Gap { until_ns: u, reason: r.into() }),
            (.., Some(numbers)) => {
                let mean = |(id, numbers)| build_mean(id, numbers, known);
                Content::Means { width_s: w, means: numbers.into_iter().filter_map(mean).collect() }
            }
            _ => Content::Sample(s.map(readings).unwrap_or_default()),
        };
        Item { sequence, epoch, redated_ns: d, at_ns: t, content }
    }
}

fn build_mean(id: i64, [seconds, mean, least, greatest]: [f64; 4], known: &SeriesByNumber) -> Option<SeriesMean> {
    Some(SeriesMean { series: known.get(&id)?.clone(), seconds, mean, least, greatest })
}

fn parse_reading(id: &str, cell: &Json, known: &SeriesByNumber) -> Option<Reading> {
    let series = known.get(&id.parse().ok()?)?.clone();
    let value = match cell {
        Json::Number(number) => Cell::Number(number.as_f64()?),
        Json::String(text) => Cell::Text(text.as_str().into()),
        other => Cell::Missing(other.get("m").and_then(Json::as_str).unwrap_or("not_provided").into()),
    };
    Some(Reading { series, value })
}
