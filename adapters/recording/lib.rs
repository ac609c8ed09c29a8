//! Samples over time: a table with one row per sample (`recording/1`).
//!
//! Columns are numbers or text; an empty cell has no value and, where the recording says so, a reason. Rows stand in
//! the order they were measured.

mod derive;
mod numbers;
pub mod read;

pub use derive::{DERIVABLE, OF_OTHER_ROWS, derive_quantity, with_derived};
pub use numbers::Numbers;
pub use read::mapping::{ColumnMapping, Mapping, MappingError, TimeMapping};
pub use read::note::{Note, NoteKind};
pub use read::{ReadRecording, RecordingError, RowProblem, read_csv, read_path, read_path_as};

use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::integer::convert_bounded;
use std::collections::HashMap;

/// Columns that hold text even when their cells look like numbers.
pub const TEXT_COLUMNS: [&str; 14] = [
    "run",
    "pass",
    "part",
    "tool",
    "lot",
    "program",
    "block",
    "operation",
    "mode",
    "execution",
    "alarm",
    "motion",
    "work_material",
    "recipe",
];

/// In the place of a word that is not there.
const ABSENT: u32 = 0;

/// Text, stored once per distinct word.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Words {
    /// One more than the number of the word of a row; [`ABSENT`] where there is none.
    codes: Vec<u32>,
    words: Vec<String>,
    numbers: HashMap<String, u32>,
}

impl Words {
    /// Appends a row; empty text counts as absent.
    pub fn push(&mut self, text: &str) {
        let code = if text.is_empty() { ABSENT } else { self.code_of(text) };
        self.codes.push(code);
    }

    fn code_of(&mut self, text: &str) -> u32 {
        // The word of the row before is the likeliest to come again.
        if let Some(last) = self.codes.last()
            && *last != ABSENT
            && self.words[*last as usize - 1] == text
        {
            return *last;
        }
        if let Some(known) = self.numbers.get(text) {
            return *known;
        }
        self.words.push(text.to_owned());
        let code = convert_bounded(self.words.len(), u32::MAX);
        self.numbers.insert(text.to_owned(), code);
        code
    }

    /// The word in `row`, if there is one.
    #[must_use]
    pub fn get(&self, row: usize) -> Option<&str> {
        self.find_code(row).map(|code| self.words[code as usize].as_str())
    }

    /// The number of the word in `row` within [`Words::words`].
    #[must_use]
    pub fn find_code(&self, row: usize) -> Option<u32> {
        self.codes.get(row)?.checked_sub(1)
    }

    /// The words of these rows, with the same numbers.
    #[must_use]
    pub fn at_rows(&self, rows: impl Iterator<Item = usize>) -> Self {
        let codes = rows.map(|row| self.codes.get(row).copied().unwrap_or(ABSENT)).collect();
        Self { codes, words: self.words.clone(), numbers: self.numbers.clone() }
    }

    /// The distinct words, in the order of first appearance.
    #[must_use]
    pub fn words(&self) -> &[String] {
        &self.words
    }

    /// How many rows, absent cells included.
    #[must_use]
    pub fn len(&self) -> usize {
        self.codes.len()
    }

    /// No rows at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.codes.is_empty()
    }
}

impl<'a> FromIterator<&'a str> for Words {
    fn from_iter<I: IntoIterator<Item = &'a str>>(iter: I) -> Self {
        let mut words = Self::default();
        iter.into_iter().for_each(|text| words.push(text));
        words
    }
}

/// The cells of one column.
#[derive(Debug, Clone, PartialEq)]
pub enum Cells {
    /// A quantity; the unit ends the column's name.
    Numbers(Numbers),
    /// A grouping or state word.
    Words(Words),
}

impl Cells {
    /// The cells of the rows that are kept.
    #[must_use]
    pub(crate) fn select_rows(&self, kept: &[bool]) -> Self {
        self.take_rows(&(0..kept.len()).filter(|row| kept[*row]).collect::<Vec<_>>())
    }

    /// The cells of these rows, in this order.
    #[must_use]
    pub fn take_rows(&self, rows: &[usize]) -> Self {
        match self {
            Self::Numbers(numbers) => Self::Numbers(rows.iter().map(|row| numbers.get(*row)).collect()),
            Self::Words(words) => Self::Words(words.at_rows(rows.iter().copied())),
        }
    }
}

fn convert_seconds(seconds: f64) -> TimeNs {
    #[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "seconds of a recording")]
    let ns = (seconds * SECOND_NS as f64).round() as TimeNs;
    ns
}

/// A column of a recording with its name.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Name, ending in its unit for quantities.
    pub name: String,
    /// One cell per row.
    pub cells: Cells,
}

/// A stretch of consecutive rows of one run: the unit of hold-out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Run {
    /// Text of the `run` column; `1` where the recording has none.
    pub name: String,
    /// Rows of this run.
    pub rows: std::ops::Range<usize>,
}

/// Rows without the name of a run, one after the other, beyond which they are a stretch of their own.
const NAMELESS_ROWS_MAX: usize = 3;

/// A few rows without a name belong to the run before them, at the head of a recording to the one after.
fn bridge_gaps(runs: Vec<Run>) -> Vec<Run> {
    let is_gap = |run: &Run| run.name.is_empty() && run.rows.len() <= NAMELESS_ROWS_MAX;
    let mut bridged: Vec<Run> = Vec::with_capacity(runs.len());
    for run in runs {
        match bridged.last_mut() {
            Some(last) if is_gap(&run) || last.name == run.name => last.rows.end = run.rows.end,
            Some(head) if is_gap(head) => *head = Run { rows: head.rows.start..run.rows.end, name: run.name },
            _ => bridged.push(run),
        }
    }
    bridged
}

/// A table of samples over time, all columns of one length.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recording {
    /// Where it came from, for messages.
    pub source: String,
    /// Seconds: `time_s` as given, or seconds since the first row where the recording has `time_utc`.
    pub time_s: Vec<f64>,
    /// Time of the first row where the recording has `time_utc`.
    pub start_ns: Option<TimeNs>,
    columns: Vec<Column>,
    /// Recordings that do not share a clock were put together: the pauses between them are unknown.
    joined: bool,
}

impl Recording {
    /// A recording of these times and no columns yet.
    #[must_use]
    pub fn new(source: impl Into<String>, time_s: Vec<f64>, start_ns: Option<TimeNs>) -> Self {
        Self { source: source.into(), time_s, start_ns, columns: Vec::new(), joined: false }
    }

    /// Adds or replaces a column. Cells beyond the last row are cut, missing ones are absent.
    pub fn set_column(&mut self, name: &str, mut cells: Cells) {
        match &mut cells {
            Cells::Numbers(numbers) => numbers.resize(self.count_rows()),
            Cells::Words(words) => words.codes.resize(self.count_rows(), ABSENT),
        }
        match self.columns.iter_mut().find(|column| column.name == name) {
            Some(column) => column.cells = cells,
            None => self.columns.push(Column { name: name.to_owned(), cells }),
        }
    }

    /// How many rows every column has.
    #[must_use]
    pub fn count_rows(&self) -> usize {
        self.time_s.len()
    }

    /// The rows that are kept.
    #[must_use]
    pub fn select_rows(&self, kept: &[bool]) -> Self {
        let times = self.time_s.iter().zip(kept).filter(|(_, kept)| **kept).map(|(time_s, _)| *time_s).collect();
        let columns = self
            .columns
            .iter()
            .map(|column| Column { name: column.name.clone(), cells: column.cells.select_rows(kept) });
        Self {
            source: self.source.clone(),
            time_s: times,
            start_ns: self.start_ns,
            columns: columns.collect(),
            joined: self.joined,
        }
    }

    /// These rows, in this order.
    #[must_use]
    pub fn take_rows(&self, rows: &[usize]) -> Self {
        let columns =
            self.columns.iter().map(|column| Column { name: column.name.clone(), cells: column.cells.take_rows(rows) });
        let first_s = rows.first().map_or(0.0, |row| self.time_s[*row]);
        // Where the time of day is known, seconds count from the first row.
        let (origin_s, start_ns) = match self.start_ns {
            Some(start_ns) => (first_s, Some(start_ns + convert_seconds(first_s))),
            None => (0.0, None),
        };
        Self {
            source: self.source.clone(),
            time_s: rows.iter().map(|row| self.time_s[*row] - origin_s).collect(),
            start_ns,
            columns: columns.collect(),
            joined: self.joined,
        }
    }

    /// The columns besides time, in the order of the recording.
    #[must_use]
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The quantity of this name.
    #[must_use]
    pub fn find_numbers(&self, name: &str) -> Option<&Numbers> {
        self.columns.iter().find(|column| column.name == name).and_then(|column| match &column.cells {
            Cells::Numbers(numbers) => Some(numbers),
            Cells::Words(_) => None,
        })
    }

    /// The text column of this name.
    #[must_use]
    pub fn find_words(&self, name: &str) -> Option<&Words> {
        self.columns.iter().find(|column| column.name == name).and_then(|column| match &column.cells {
            Cells::Words(words) => Some(words),
            Cells::Numbers(_) => None,
        })
    }

    /// Stretches of rows with the same `run`, in order. A run that returns later is a second stretch; a cell or a few that are
    /// empty within a run, at its begin or at its end do not end it.
    #[must_use]
    pub fn list_runs(&self) -> Vec<Run> {
        let words = self.find_words("run");
        let name = |row: usize| words.map_or("1", |words| words.get(row).unwrap_or(""));
        let mut runs: Vec<Run> = Vec::new();
        for row in 0..self.count_rows() {
            match runs.last_mut() {
                Some(run) if run.name == name(row) => run.rows.end = row + 1,
                _ => runs.push(Run { name: name(row).to_owned(), rows: row..row + 1 }),
            }
        }
        if runs.iter().any(|run| !run.name.is_empty()) { bridge_gaps(runs) } else { runs }
    }

    /// Says that this is put together from recordings that do not share a clock.
    pub fn forget_pauses(&mut self) {
        self.joined = true;
    }

    /// Is the pause between one run and the next known? It is with `time_utc`, and when `time_s` goes on increasing.
    #[must_use]
    pub fn pauses_known(&self) -> bool {
        if self.joined {
            return false;
        }
        self.start_ns.is_some() || self.time_s.windows(2).all(|pair| pair[1] >= pair[0])
    }
}
