//! Stored samples as JSON and CSV: the same for the API and the command line.

use adapters::clock::{SECOND_NS, TimeNs};
use gateway_base::convert::clamp_to_length;
use gateway_base::moment;
use gateway_history::{Buckets, Chunk, HistoryError, Overview, Query, Reader, Series, plain_cell};
use serde_json::{Value, json};
use std::io::Write;
use std::ops::ControlFlow;

/// The answer as a document (`samples/1`).
#[must_use]
pub fn build_document((from_ns, to_ns): (TimeNs, TimeNs), resolution_s: f64, series: Value) -> Value {
    json!({
        "schema": "samples/1",
        "from_ms": from_ns.div_euclid(1_000_000),
        "to_ms": to_ns.div_euclid(1_000_000),
        "resolution_s": resolution_s,
        "series": series,
    })
}

fn too_many(points_max: usize) -> HistoryError {
    HistoryError::Question(format!(
        "more than {points_max} points in one answer: ask for fewer channels, a shorter time or a coarser resolution; \
         `cnc-gateway history export` writes everything"
    ))
}

/// A width in nanoseconds.
fn width_ns(resolution_s: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "saturates, which is meant")]
    let width_ns = (resolution_s * SECOND_NS as f64) as i64;
    width_ns.max(1)
}

/// One series per channel, in buckets: time, mean, least, greatest, count.
///
/// # Errors
/// More than `points_max` points, or what the history says.
pub fn read_bucketed(
    reader: &Reader,
    query: &Query,
    resolution_s: f64,
    points_max: usize,
) -> Result<Value, HistoryError> {
    let width_ns = width_ns(resolution_s);
    let length_ns = query.to_ns.unwrap_or(0).saturating_sub(query.from_ns.unwrap_or(0));
    let buckets = clamp_to_length((length_ns / width_ns).unsigned_abs());
    if buckets.saturating_mul(query.series.len()) > points_max {
        return Err(too_many(points_max));
    }
    let overview = reader.read_overview(query, width_ns)?;
    let each = overview.series.iter().zip(&overview.columns);
    Ok(each.map(|(series, column)| build_series(&series.name, &series.unit, points_of(&overview, column))).collect())
}

fn build_series(channel: &str, unit: &str, points: Vec<Value>) -> Value {
    json!({ "channel": channel, "unit": unit, "points": points })
}

fn points_of(overview: &Overview, column: &Buckets) -> Vec<Value> {
    let times = overview.start_ns.iter().map(|start_ns| start_ns.div_euclid(1_000_000));
    match column {
        Buckets::Numbers(summaries) => times
            .zip(summaries)
            .map(|(at, s)| if s.count == 0 { json!([at, null]) } else { json!([at, s.mean, s.min, s.max, s.count]) })
            .collect(),
        Buckets::Words(words) => times.zip(words).map(|(at, word)| json!([at, word.as_deref()])).collect(),
    }
}

/// One series per channel, sample by sample: time, value, or null and the reason.
///
/// # Errors
/// More than `points_max` points, or what the history says.
pub fn read_raw(reader: &Reader, query: &Query, points_max: usize) -> Result<Value, HistoryError> {
    let mut list: Vec<(Series, Vec<Value>)> = Vec::new();
    let mut points = 0;
    reader.for_each_chunk(query, |chunk| {
        points += chunk.at_ns.len() * chunk.columns.len();
        if points > points_max {
            return ControlFlow::Break(());
        }
        append_chunk(&mut list, chunk);
        ControlFlow::Continue(())
    })?;
    if points > points_max {
        return Err(too_many(points_max));
    }
    Ok(list.into_iter().map(|(series, points)| build_series(&series.name, &series.unit, points)).collect())
}

fn append_chunk(list: &mut Vec<(Series, Vec<Value>)>, chunk: &Chunk<'_>) {
    if list.is_empty() {
        list.extend(chunk.series.iter().map(|series| (series.clone(), Vec::new())));
    }
    for (column, (cells, (_, points))) in chunk.columns.iter().zip(list).enumerate() {
        for (row, at_ns) in chunk.at_ns.iter().enumerate() {
            let at = at_ns.div_euclid(1_000_000);
            let value = cells.number_at(row).map(Value::from).or_else(|| cells.word_at(row).map(Value::from));
            let missing = || json!([at, null, chunk.missing_reason(column, row)]);
            points.push(value.map_or_else(missing, |value| json!([at, value])));
        }
    }
}

/// Buckets as CSV: mean, least, greatest and count of every quantity, the last word of every text.
///
/// # Errors
/// What the history or the output says.
pub fn bucketed_csv(reader: &Reader, query: &Query, resolution_s: f64, out: impl Write) -> Result<(), HistoryError> {
    let overview = reader.read_overview(query, width_ns(resolution_s))?;
    let written = write_csv(&overview, out);
    written.map_err(|error| HistoryError::Io { path: "the output".into(), error: std::io::Error::other(error) })
}

fn write_csv(overview: &Overview, out: impl Write) -> Result<(), csv::Error> {
    let mut csv = csv::Writer::from_writer(out);
    let mut header = vec!["time_utc".to_owned()];
    for (series, column) in overview.series.iter().zip(&overview.columns) {
        match column {
            Buckets::Numbers(_) => {
                header.extend(["", "_min", "_max", "_count"].map(|end| format!("{}{end}", series.name)))
            }
            Buckets::Words(_) => header.push(series.name.to_string()),
        }
    }
    csv.write_record(&header)?;
    for (row, start_ns) in overview.start_ns.iter().enumerate() {
        let mut cells = vec![moment::format_utc(*start_ns)];
        overview.columns.iter().for_each(|column| cells.extend(cells_of(column, row)));
        csv.write_record(&cells)?;
    }
    csv.flush().map_err(csv::Error::from)
}

fn cells_of(column: &Buckets, row: usize) -> Vec<String> {
    match column {
        Buckets::Numbers(summaries) => match summaries[row] {
            s if s.count == 0 => vec![String::new(), String::new(), String::new(), "0".to_owned()],
            s => vec![s.mean.to_string(), s.min.to_string(), s.max.to_string(), s.count.to_string()],
        },
        Buckets::Words(words) => vec![plain_cell(words[row].as_deref().unwrap_or_default())],
    }
}
