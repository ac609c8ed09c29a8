//! The crash tail: the rows of the running minute, one small JSON text per commit, so that any SQLite client can read
//! them (view `recent_samples`) and the next start can put them into a block.
//!
//! Form: `{"t":[times],"s":{"<series>":[cells] or cell},"c":sum}`; a cell alone holds for every row. A cell is a number, a
//! text, or `{"m":"reason"}`. The sum is the CRC-32 of the text before its comma; older versions wrote none.

use super::reason::{NOT_PROVIDED, PRESENT, Reasons};
use super::rounding::round_to_decimals;
use super::rows::{Column, SeriesRows, Word};
use super::series::Series;
use super::series_kind::SeriesKind;
use serde_json::Value as Json;
use std::fmt::Write;
use std::ops::Range;
use std::sync::Arc;

/// The text of rows `range`.
pub(crate) fn to_text(rows: &SeriesRows, range: Range<usize>, series: &[Series], reasons: &Reasons) -> String {
    let mut out = String::from("{\"t\":[");
    for (index, at_ns) in rows.at_ns[range.clone()].iter().enumerate() {
        append_comma(&mut out, index);
        // Writing to a string cannot fail, here and below.
        let _ = write!(out, "{at_ns}");
    }
    out.push_str("],\"s\":{");
    let used = series.iter().zip(&rows.columns).filter(|(_, column)| !column.is_unused());
    for (index, (series, column)) in used.enumerate() {
        append_comma(&mut out, index);
        let _ = write!(out, "\"{}\":", series.id);
        match column {
            Column::Numbers { values, missing } => {
                put_numbers(&mut out, &values[range.clone()], &missing[range.clone()], series.decimals, reasons);
            }
            Column::Words(changes) => put_words(&mut out, changes, &range, reasons),
        }
    }
    out.push('}');
    let sum = crc32fast::hash(out.as_bytes());
    let _ = write!(out, "{SUM}{sum}}}");
    out
}

/// What stands before the checksum.
const SUM: &str = ",\"c\":";

/// Is the text as it was written, as far as it says?
fn is_whole(text: &str) -> bool {
    let Some((summed, sum)) = text.rsplit_once(SUM) else { return true };
    sum.trim_end().strip_suffix('}').and_then(|sum| sum.parse().ok()) == Some(crc32fast::hash(summed.as_bytes()))
}

pub(super) fn append_comma(out: &mut String, index: usize) {
    if index > 0 {
        out.push(',');
    }
}

fn put_numbers(out: &mut String, values: &[f64], missing: &[u8], decimals: Option<u8>, reasons: &Reasons) {
    let cell = |out: &mut String, row: usize| match missing[row] {
        PRESENT => put_number(out, decimals.map_or(values[row], |decimals| round_to_decimals(values[row], decimals))),
        code => put_missing(out, code, reasons),
    };
    let same = (1..values.len()).all(|row| missing[row] == missing[0] && values[row].to_bits() == values[0].to_bits());
    if same {
        return cell(out, 0);
    }
    out.push('[');
    for row in 0..values.len() {
        append_comma(out, row);
        cell(out, row);
    }
    out.push(']');
}

pub(super) fn put_number(out: &mut String, number: f64) {
    // Both forms are the shortest text that reads back to the same number; this one spares the ".0".
    let _ =
        if number.fract() == 0.0 && number.abs() < 1e15 { write!(out, "{number}") } else { write!(out, "{number:?}") };
}

pub(super) fn put_missing(out: &mut String, code: u8, reasons: &Reasons) {
    let _ = write!(out, "{{\"m\":{}}}", Json::from(reasons.find_word(code)));
}

fn put_words(out: &mut String, changes: &[(usize, Word)], range: &Range<usize>, reasons: &Reasons) {
    let cell = |out: &mut String, word: Option<&Word>| match word {
        Some(Word::Is(text)) => {
            let _ = write!(out, "{}", Json::from(&**text));
        }
        Some(Word::Missing(code)) => put_missing(out, *code, reasons),
        None => put_missing(out, NOT_PROVIDED, reasons),
    };
    let at = |row: usize| changes.partition_point(|(from, _)| *from <= row).checked_sub(1);
    if at(range.start) == at(range.end.saturating_sub(1)) {
        return cell(out, at(range.start).map(|index| &changes[index].1));
    }
    out.push('[');
    for (index, row) in range.clone().enumerate() {
        append_comma(out, index);
        cell(out, at(row).map(|index| &changes[index].1));
    }
    out.push(']');
}

/// Appends the rows of `text` to `rows`; `None`, and nothing appended, when it is not what [`to_text`] writes.
pub(crate) fn parse_rows_into(
    text: &str,
    rows: &mut SeriesRows,
    series: &[Series],
    reasons: &mut Reasons,
) -> Option<()> {
    let body: Json = serde_json::from_str(text).ok().filter(|_| is_whole(text))?;
    let times: Vec<i64> = body.get("t")?.as_array()?.iter().map(Json::as_i64).collect::<Option<_>>()?;
    let cells = body.get("s")?.as_object()?;
    let mut more = rows.empty_like();
    more.at_ns = times;
    for (series, column) in series.iter().zip(&mut more.columns) {
        if let Some(cell) = cells.get(&series.id.to_string()) {
            *column = column_of(cell, more.at_ns.len(), series.kind, reasons);
        }
    }
    let count = more.len();
    rows.append_rows(&more, 0..count);
    Some(())
}

fn column_of(cell: &Json, count: usize, kind: SeriesKind, reasons: &mut Reasons) -> Column {
    let cells: Vec<&Json> = match cell {
        Json::Array(cells) => cells.iter().take(count).collect(),
        alone => vec![alone; count],
    };
    let mut reason =
        |cell: &Json| cell.get("m").and_then(Json::as_str).map_or(NOT_PROVIDED, |word| reasons.intern_word(word));
    match kind {
        SeriesKind::Number => Column::Numbers {
            values: cells.iter().map(|cell| cell.as_f64().unwrap_or(0.0)).collect(),
            missing: cells.iter().map(|cell| if cell.is_number() { PRESENT } else { reason(cell) }).collect(),
        },
        SeriesKind::Text => {
            let word = |cell: &&Json| match cell {
                Json::String(text) => Word::Is(Arc::from(text.as_str())),
                other => Word::Missing(reason(other)),
            };
            let mut changes: Vec<(usize, Word)> = (0..).zip(cells.iter().map(word)).collect();
            changes.dedup_by(|later, earlier| later.1 == earlier.1);
            Column::Words(changes)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::series::stored_series;
    use super::super::series_kind::{ExtraSeries, ExtraValue, Fidelity};
    use super::*;
    use adapter_core::{Absence, ChannelId, Sample, Slot, Value};

    #[test]
    fn the_tail_gives_back_every_row() {
        let extras = vec![ExtraSeries::new_number("a_w", "W", "", ""), ExtraSeries::new_text("state", "", "")];
        let mut series = stored_series(Fidelity::Resolution, &extras).expect("fine");
        (1..).zip(&mut series).for_each(|(id, series)| series.id = id);
        let mut reasons = Reasons::default();
        let mut rows = SeriesRows::for_series(&series);
        let channel = |name| ChannelId::from_name(name).expect("in the table");
        for row in 0..30 {
            let mut sample = Sample::new_empty(1_700_000_000_000_000_000 + row);
            sample.set_slot(channel("spindle_power_w"), Slot { value: Ok(Value::Number(row as f64 * 0.1)), age_ns: 0 });
            sample.set_slot(channel("program"), Slot { value: Ok(Value::Text("O1 \"a\"".into())), age_ns: 0 });
            sample.set_slot(channel("total_power_w"), Slot::from_absence(Absence::Stale));
            let state = if row % 4 == 0 { "idle" } else { "cutting" };
            rows.push(&sample, &[ExtraValue::Missing("not_learned"), ExtraValue::Text(state)], &mut reasons);
        }
        let mut back = rows.empty_like();
        for part in [0..7, 7..8, 8..30] {
            let text = to_text(&rows, part, &series, &reasons);
            parse_rows_into(&text, &mut back, &series, &mut reasons).expect("readable");
        }
        let exact: Vec<f64> = (0..30).map(|row| round_to_decimals(f64::from(row) * 0.1, 1)).collect();
        let power = series.iter().position(|series| &*series.name == "spindle_power_w").expect("there");
        assert!(matches!(&back.columns[power], Column::Numbers { values, .. } if *values == exact));
        for (index, (back, rows)) in back.columns.iter().zip(&rows.columns).enumerate() {
            assert!(index == power || back == rows, "{}", series[index].name);
        }
    }

    #[test]
    fn a_damaged_tail_is_refused() {
        let series = stored_series(Fidelity::Resolution, &[]).expect("fine");
        for text in ["", "{}", "{\"t\":[1.5],\"s\":{}}", "{\"t\":[1],\"s\":3}"] {
            let mut rows = SeriesRows::for_series(&series);
            assert_eq!(parse_rows_into(text, &mut rows, &series, &mut Reasons::default()), None, "{text}");
            assert!(rows.is_empty());
        }
    }
}
