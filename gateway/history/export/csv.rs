//! A time range as CSV.

use super::super::error::{HistoryError, add_path};
use super::super::query::{Chunk, Query};
use super::super::readable_time::format_utc;
use super::super::reader::Reader;
use super::{ColumnPlan, RUN, run_text};
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;

pub(super) fn write_gzip(
    reader: &Reader,
    query: &Query,
    plan: &ColumnPlan,
    out: impl Write,
    path: &Path,
) -> Result<u64, HistoryError> {
    let mut gzip = GzEncoder::new(out, Compression::default());
    let rows = write(reader, query, plan, &mut gzip, path)?;
    gzip.finish().and_then(|mut out| out.flush()).map_err(add_path(path))?;
    Ok(rows)
}

pub(super) fn write(
    reader: &Reader,
    query: &Query,
    plan: &ColumnPlan,
    out: impl Write,
    path: &Path,
) -> Result<u64, HistoryError> {
    let mut out = ::csv::Writer::from_writer(out);
    let mut problem = out.write_record(format_header(plan)).err();
    let mut rows = 0;
    let all = Query { series: plan.series_names(), ..query.clone() };
    reader.for_each_chunk(&all, |chunk| {
        for row in 0..chunk.at_ns.len() {
            problem = problem.take().or(out.write_record(format_cells(plan, chunk, row)).err());
            if problem.is_some() {
                return ControlFlow::Break(());
            }
            rows += 1;
        }
        ControlFlow::Continue(())
    })?;
    match problem {
        Some(error) => Err(add_path(path)(std::io::Error::other(error))),
        None => out.flush().map(|()| rows).map_err(add_path(path)),
    }
}

/// Text of somebody else as a cell: a spreadsheet takes one that begins like a formula for a formula and runs it. An apostrophe
/// before it is the usual remedy (OWASP, *CSV Injection*).
#[must_use]
pub fn plain_cell(text: &str) -> String {
    let formula = text.starts_with(['=', '+', '-', '@', '\t', '\r', '＝', '＋', '－', '＠']);
    if formula { format!("'{text}") } else { text.to_owned() }
}

fn format_header(plan: &ColumnPlan) -> Vec<String> {
    let mut names = vec![if plan.monotone { "time_utc" } else { "time_s" }.to_owned()];
    if !plan.monotone && !plan.has_run() {
        names.push(RUN.to_owned());
    }
    for (series, missing) in &plan.series {
        names.push(series.name.to_string());
        if *missing {
            names.push(format!("{}_missing", series.name));
        }
    }
    names
}

fn format_cells(plan: &ColumnPlan, chunk: &Chunk<'_>, row: usize) -> Vec<String> {
    let at_ns = chunk.at_ns[row];
    let mut cells = vec![if plan.monotone { format_utc(at_ns) } else { plan.seconds_since_start(at_ns).to_string() }];
    if !plan.monotone && !plan.has_run() {
        cells.push(run_text(chunk.segment, None));
    }
    for (index, (series, missing)) in plan.series.iter().enumerate() {
        let column = &chunk.columns[index];
        let number = column.number_at(row).map(|number| number.to_string());
        let text = number.or_else(|| column.word_at(row).map(plain_cell));
        let run = !plan.monotone && &*series.name == RUN;
        cells.push(if run { run_text(chunk.segment, text.as_deref()) } else { text.unwrap_or_default() });
        if *missing {
            let reason = chunk.missing_reason(index, row).filter(|word| *word != "not_provided");
            cells.push(reason.unwrap_or_default().to_owned());
        }
    }
    cells
}
