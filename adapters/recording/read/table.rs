//! A foreign table: rows of cells that can be gone through as often as needed.

use super::cell::Cell;
use super::error::RecordingError;
use super::note::Note;
use adapter_core::bilingual::Bilingual;
use adapter_core::clock::TimeNs;

/// One row on its way past.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row<'a> {
    /// Line of the file, from 1.
    pub(super) line: u64,
    pub(super) cells: &'a [Cell<'a>],
}

/// What becomes of going through a table.
pub(super) enum VisitStep {
    Next,
    Enough,
}

/// Takes a row; an error ends the reading.
pub(super) type Visit<'v> = dyn FnMut(&Row<'_>) -> Result<VisitStep, RecordingError> + 'v;

pub(super) trait Table {
    /// Every row in order.
    fn visit_rows(&self, see: &mut Visit<'_>) -> Result<(), RecordingError>;

    /// How the file is written, for the statement: separator, encoding, sheet.
    fn describe_form(&self) -> Vec<Bilingual>;

    /// The line that holds the names, where the format says it.
    fn find_names_line(&self) -> Option<u64> {
        None
    }

    /// What of the file is not used or may be wrong, for the user.
    fn list_notes(&self) -> Vec<Note> {
        Vec::new()
    }

    /// May a row be shorter than the header, because the format leaves out what is empty?
    fn may_be_short(&self) -> bool {
        false
    }
}

/// A cell that owns its text.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum OwnedCell {
    Empty,
    Text(Box<str>),
    Number(f64),
    Flag(bool),
    Instant(TimeNs),
    Local(TimeNs),
}

impl OwnedCell {
    pub(super) fn as_cell(&self) -> Cell<'_> {
        match self {
            Self::Empty => Cell::Empty,
            Self::Text(text) => Cell::Text(text),
            Self::Number(number) => Cell::Number(*number),
            Self::Flag(flag) => Cell::Flag(*flag),
            Self::Instant(at_ns) => Cell::Instant(*at_ns),
            Self::Local(at_ns) => Cell::Local(*at_ns),
        }
    }

    pub(super) fn from_text(text: &str) -> Self {
        if text.is_empty() { Self::Empty } else { Self::Text(text.into()) }
    }
}

/// A table that a format reader has put into memory, row by row.
#[derive(Debug, Default)]
pub(super) struct MemoryTable {
    /// Line and cells of each row.
    pub(super) rows: Vec<(u64, Vec<OwnedCell>)>,
    pub(super) form: Vec<Bilingual>,
    pub(super) notes: Vec<Note>,
}

impl Table for MemoryTable {
    fn visit_rows(&self, see: &mut Visit<'_>) -> Result<(), RecordingError> {
        let mut cells = Vec::new();
        for (line, owned) in &self.rows {
            cells.clear();
            cells.extend(owned.iter().map(OwnedCell::as_cell));
            if matches!(see(&Row { line: *line, cells: &cells })?, VisitStep::Enough) {
                return Ok(());
            }
        }
        Ok(())
    }

    fn describe_form(&self) -> Vec<Bilingual> {
        self.form.clone()
    }

    fn list_notes(&self) -> Vec<Note> {
        self.notes.clone()
    }

    fn may_be_short(&self) -> bool {
        true
    }
}

/// A table that a format reader has put into memory column by column, under one header line.
#[derive(Debug, Default)]
pub(super) struct ColumnTable {
    /// Name and cells of each column.
    pub(super) columns: Vec<(String, ColumnCells)>,
    pub(super) form: Vec<Bilingual>,
    pub(super) notes: Vec<Note>,
}

/// The cells of a column in memory.
#[derive(Debug, Clone)]
pub(super) enum ColumnCells {
    Numbers(Vec<f64>),
    Instants(Vec<TimeNs>),
    Cells(Vec<OwnedCell>),
}

impl ColumnCells {
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Numbers(numbers) => numbers.len(),
            Self::Instants(instants) => instants.len(),
            Self::Cells(cells) => cells.len(),
        }
    }

    fn read_cell(&self, row: usize) -> Cell<'_> {
        match self {
            Self::Numbers(numbers) => {
                numbers.get(row).filter(|number| number.is_finite()).map_or(Cell::Empty, |number| Cell::Number(*number))
            }
            Self::Instants(instants) => instants.get(row).map_or(Cell::Empty, |at_ns| Cell::Instant(*at_ns)),
            Self::Cells(cells) => cells.get(row).map_or(Cell::Empty, OwnedCell::as_cell),
        }
    }
}

impl Table for ColumnTable {
    fn visit_rows(&self, see: &mut Visit<'_>) -> Result<(), RecordingError> {
        let names: Vec<Cell<'_>> = self.columns.iter().map(|(name, _)| Cell::Text(name)).collect();
        if matches!(see(&Row { line: 1, cells: &names })?, VisitStep::Enough) {
            return Ok(());
        }
        let rows = self.columns.iter().map(|(_, cells)| cells.len()).max().unwrap_or(0);
        let mut cells = Vec::with_capacity(names.len());
        for row in 0..rows {
            cells.clear();
            cells.extend(self.columns.iter().map(|(_, column)| column.read_cell(row)));
            if matches!(see(&Row { line: row as u64 + 2, cells: &cells })?, VisitStep::Enough) {
                return Ok(());
            }
        }
        Ok(())
    }

    fn describe_form(&self) -> Vec<Bilingual> {
        self.form.clone()
    }

    fn find_names_line(&self) -> Option<u64> {
        Some(1)
    }

    fn list_notes(&self) -> Vec<Note> {
        self.notes.clone()
    }
}
