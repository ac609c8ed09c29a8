//! Logs of an MTConnect adapter (SHDR): `time|name|value|name|value`, one line for each change. Every name is a column with a clock of its own.

use super::super::cell::written_number;
use super::super::error::RecordingError;
use super::super::limits::{CELLS_IN_MEMORY_MAX, COLUMNS_MAX};
use super::super::moment::written_moment;
use super::super::table::{ColumnCells, ColumnTable, OwnedCell};
use adapter_core::bilingual::Bilingual;
use std::collections::HashMap;
use std::io::{BufRead, BufReader, Read};

/// Lines that are looked at.
const JUDGED_LINES: usize = 20;
/// Words of a condition, behind which stand its code, severity, qualifier and text.
const LEVELS: [&str; 4] = ["NORMAL", "WARNING", "FAULT", "UNAVAILABLE"];
/// Cells of a condition.
const CONDITION_CELLS: usize = 7;

/// Does every one of the first lines begin with a time and a name?
pub(super) fn is_shdr(head: &str) -> bool {
    let lines = || head.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('*'));
    lines().next().is_some() && lines().take(JUDGED_LINES).all(is_entry)
}

fn is_entry(line: &str) -> bool {
    let mut cells = line.split('|');
    let has_time = cells.next().and_then(written_moment).is_some_and(|moment| moment.date.is_some());
    let is_name = |name: &str| !name.trim().is_empty() && written_number(name.trim()).is_none();
    has_time && cells.next().is_some_and(is_name) && cells.next().is_some()
}

#[derive(Default)]
struct LoggedItem {
    times: Vec<OwnedCell>,
    values: Vec<OwnedCell>,
}

/// Reads every line of a text that is decoded.
pub(super) fn open(text: impl Read, file: &str) -> Result<ColumnTable, RecordingError> {
    let mut items: Vec<(String, LoggedItem)> = Vec::new();
    let mut known: HashMap<String, usize> = HashMap::new();
    let mut cells = 0;
    for line in BufReader::new(text).lines() {
        let line = line.map_err(|error| RecordingError::Io { file: file.to_owned(), error })?;
        let mut parts: Vec<&str> = line.trim().split('|').map(str::trim).collect();
        if !is_entry(&line) {
            continue;
        }
        let is_condition = parts.len() == CONDITION_CELLS && LEVELS.contains(&parts[2].to_uppercase().as_str());
        parts.truncate(if is_condition { 3 } else { parts.len() });
        for pair in parts[1..].chunks_exact(2) {
            let place = *known.entry(pair[0].to_owned()).or_insert_with(|| {
                items.push((pair[0].to_owned(), LoggedItem::default()));
                items.len() - 1
            });
            let is_absent = pair[1].eq_ignore_ascii_case("UNAVAILABLE");
            items[place].1.times.push(OwnedCell::from_text(parts[0]));
            items[place].1.values.push(if is_absent { OwnedCell::Empty } else { OwnedCell::from_text(pair[1]) });
            cells += 2;
        }
        if cells > CELLS_IN_MEMORY_MAX || items.len() > COLUMNS_MAX {
            let en = "more entries than are read at once: give the log in parts";
            return Err(RecordingError::with_format_reason(file, en, "记录过多：请分成几个文件"));
        }
    }
    items.retain(|(_, item)| item.values.iter().any(|value| *value != OwnedCell::Empty));
    let columns = items.into_iter().flat_map(|(name, item)| {
        [("Time".to_owned(), ColumnCells::Cells(item.times)), (name, ColumnCells::Cells(item.values))]
    });
    let form = vec![Bilingual::new("log of an MTConnect adapter (SHDR)", "MTConnect适配器日志（SHDR）")];
    Ok(ColumnTable { columns: columns.collect(), form, ..ColumnTable::default() })
}
