//! How a file is understood, before anything is done with it: each column with what it becomes, what else it may be, and its first values.

use super::error::RecordingError;
use super::formats;
use super::head::{self, GivenLines};
use super::input::Input;
use super::mapping::Mapping;
use super::names::ForeignName;
use super::{ReadRecording, read_input};
use crate::{Cells, Recording};
use std::path::Path;

/// One column of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct ColumnPreview {
    /// Its name in the file.
    pub from: String,
    /// Its unit there, where the file says one.
    pub unit: Option<String>,
    /// Its name in the recording, where it is part of it.
    pub to: Option<String>,
    /// Columns of ours that it may be, the likeliest first.
    pub candidates: Vec<&'static str>,
    /// It holds the time.
    pub is_time: bool,
}

/// How a file is understood.
#[derive(Debug)]
pub struct Preview {
    /// The columns in the order of the file.
    pub columns: Vec<ColumnPreview>,
    /// The file as read, or why it cannot be.
    pub read: Result<ReadRecording, RecordingError>,
}

/// Looks at a file under a map.
///
/// # Errors
/// Its columns cannot be told at all.
pub fn preview_recording(path: &Path, mapping: &Mapping) -> Result<Preview, RecordingError> {
    let input = Input::from_path(path);
    let file = input.file.clone();
    let table = formats::open_table(input.clone(), mapping)?;
    let head =
        head::find_head(table.as_ref(), GivenLines { names: mapping.header_line, units: mapping.units_line }, &file)?;
    let read = read_input(input, mapping);
    let recording = read.as_ref().ok().map(|read| &read.recording);
    let columns = head
        .names
        .iter()
        .zip(&head.units)
        .enumerate()
        .map(|(index, (text, unit))| {
            let name = ForeignName::from_text(text, unit.as_deref());
            let mapped = mapping.find_column(text, index);
            let to = match mapped {
                Some(mapped) => Some(mapped.to.clone()).filter(|to| !to.is_empty()),
                None => find_target_column(&name, recording),
            };
            let is_time = mapping.time.column.as_ref().map_or(to.is_none() && name.is_time(), |column| column == text);
            ColumnPreview {
                from: name.text.clone(),
                unit: name.unit.clone(),
                to,
                candidates: name.list_candidates(),
                is_time,
            }
        })
        .collect();
    Ok(Preview { columns, read })
}

/// The column of the recording that a name has become.
fn find_target_column(name: &ForeignName, recording: Option<&Recording>) -> Option<String> {
    let recording = recording?;
    let has = |name: &str| recording.columns().iter().any(|column| column.name == name);
    if has(&name.text) {
        return Some(name.text.clone());
    }
    name.find_meaning().filter(|ours| has(ours)).map(str::to_owned)
}

/// The names of the columns, time first, and the first rows as text.
#[must_use]
pub fn preview_rows(recording: &Recording, rows: usize) -> (Vec<String>, Vec<Vec<String>>) {
    let name = if recording.start_ns.is_some() { "time_utc" } else { "time_s" };
    let head =
        std::iter::once(name.to_owned()).chain(recording.columns().iter().map(|column| column.name.clone())).collect();
    let value = |cells: &Cells, row: usize| match cells {
        // As many digits as a measurement has, so that a converted 306.9 is not 306.90000000000003.
        Cells::Numbers(numbers) => numbers
            .get(row)
            .map_or_else(String::new, |number| format!("{number:.8e}").parse::<f64>().unwrap_or(number).to_string()),
        Cells::Words(words) => words.get(row).unwrap_or("").to_owned(),
    };
    let row = |row: usize| {
        let cells = recording.columns().iter().map(|column| value(&column.cells, row));
        std::iter::once(format_time(recording, row)).chain(cells).collect()
    };
    (head, (0..rows.min(recording.count_rows())).map(row).collect())
}

fn format_time(recording: &Recording, row: usize) -> String {
    let since_s = recording.time_s[row];
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    let stamp = recording
        .start_ns
        .and_then(|start_ns| jiff::Timestamp::from_nanosecond(i128::from(start_ns) + (since_s * 1e9) as i128).ok());
    stamp.map_or_else(|| since_s.to_string(), |stamp| stamp.to_string())
}
