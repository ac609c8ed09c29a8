//! The cells of a sheet as a workbook gives them, one by one: a stray cell far away costs nothing. Also the formulas in them whose
//! results nobody has stored.

use super::super::error::RecordingError;
use super::super::input::Input;
use super::super::limits::{CELLS_IN_MEMORY_MAX, COLUMNS_MAX};
use super::super::note::{Note, NoteKind};
use super::super::table::{MemoryTable, OwnedCell};
use adapter_core::bilingual::Bilingual;
use calamine::Xlsx;
use std::collections::BTreeMap;
use std::io::Cursor;

/// A column with a name and nothing, or next to nothing, below it.
struct BareColumn {
    name: String,
    /// Rows in which it has a value.
    rows: Vec<u32>,
}

/// The most filled cells of a column that still counts as empty: a title, a name and a unit.
const BARE_CELLS_MAX: usize = 4;

fn describe_cell(cell: &OwnedCell) -> String {
    match cell {
        OwnedCell::Text(text) => text.to_string(),
        OwnedCell::Number(number) => number.to_string(),
        _ => String::new(),
    }
}

/// The cells of a sheet as they come: row, column, value.
#[derive(Default)]
pub(super) struct SparseSheet {
    cells: Vec<(u32, u32, OwnedCell)>,
}

impl SparseSheet {
    pub(super) fn put_cell(&mut self, (row, column): (u32, u32), cell: OwnedCell) {
        if cell != OwnedCell::Empty {
            self.cells.push((row, column, cell));
        }
    }

    /// Columns that have at most a few values, in a sheet with more than twice as many rows.
    fn list_bare_columns(&self) -> BTreeMap<u32, BareColumn> {
        let mut columns: BTreeMap<u32, BareColumn> = BTreeMap::new();
        for (row, column, cell) in &self.cells {
            let known =
                columns.entry(*column).or_insert_with(|| BareColumn { name: describe_cell(cell), rows: Vec::new() });
            if known.rows.len() <= BARE_CELLS_MAX {
                known.rows.push(*row);
            }
        }
        let bounds = self.cells.iter().map(|(row, _, _)| *row);
        let rows = bounds.clone().max().unwrap_or(0) - bounds.min().unwrap_or(0);
        columns.retain(|_, known| known.rows.len() <= BARE_CELLS_MAX && rows as usize > 2 * known.rows.len());
        columns
    }

    /// Refuses a sheet with more cells than are kept in memory.
    pub(super) fn check_size(&self, chosen: &str, input: &Input) -> Result<(), RecordingError> {
        if self.cells.len() <= CELLS_IN_MEMORY_MAX { Ok(()) } else { Err(build_size_error(chosen, input)) }
    }

    /// Rows from the first column on; what lies further right than tables go is left out, and told.
    pub(super) fn into_table(mut self, chosen: &str, input: &Input) -> Result<MemoryTable, RecordingError> {
        self.cells.sort_by_key(|(row, column, _)| (*row, *column));
        let first = self.cells.iter().map(|(_, column, _)| *column).min().unwrap_or(0);
        let (mut table, mut width, mut stray) = (MemoryTable::default(), 0, 0_usize);
        for (row, column, cell) in self.cells {
            let place = (column - first) as usize;
            if place >= COLUMNS_MAX {
                stray += 1;
                continue;
            }
            let line = u64::from(row) + 1;
            if table.rows.last().is_none_or(|(last, _)| *last != line) {
                table.rows.push((line, Vec::new()));
            }
            let Some((_, cells)) = table.rows.last_mut() else { continue };
            width += place + 1 - cells.len().min(place + 1);
            if width > CELLS_IN_MEMORY_MAX {
                return Err(build_size_error(chosen, input));
            }
            cells.resize(place, OwnedCell::Empty);
            cells.push(cell);
        }
        if stray > 0 {
            table.form.push(Bilingual::new(
                format!("{stray} cells further right than column {COLUMNS_MAX} are not read"),
                format!("第{COLUMNS_MAX}列以右的{stray}个单元格未读取"),
            ));
        }
        Ok(table)
    }
}

/// A sheet, or a part of the archive, holds more than is kept in memory.
pub(super) fn build_size_error(chosen: &str, input: &Input) -> RecordingError {
    RecordingError::with_format_reason(
        &input.file,
        format!("sheet {chosen} has more cells than are read: save it as CSV, or in parts"),
        format!("工作表{chosen}的单元格超出限制：请另存为CSV，或分成几个文件"),
    )
}

/// Formulas whose results were never computed, by column: a program wrote the workbook and no spreadsheet has opened it since. Looked for
/// only where a column has nothing below its name.
pub(super) fn note_formulas(
    book: &mut Xlsx<Cursor<Vec<u8>>>,
    chosen: &str,
    sheet: &SparseSheet,
    notes: &mut Vec<Note>,
) {
    let bare = sheet.list_bare_columns();
    let Some(mut cells) =
        Some(()).filter(|()| !bare.is_empty()).and_then(|()| book.worksheet_cells_reader(chosen).ok())
    else {
        return;
    };
    let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
    while let Ok(Some(cell)) = cells.next_formula() {
        let (row, column) = cell.get_position();
        let without_result = bare.get(&column).is_some_and(|known| !known.rows.contains(&row));
        if without_result && !cell.get_value().is_empty() {
            *counts.entry(column).or_default() += 1;
        }
    }
    for (column, count) in counts {
        let name = bare.get(&column).map_or("", |known| known.name.as_str());
        notes.push(Note::new(
            NoteKind::Doubt,
            format!("{name}: {count} formulas without a stored result: open the workbook in a spreadsheet and save it"),
            format!("{name}：{count}个公式没有保存结果：请用电子表格软件打开并保存"),
        ));
    }
}
