//! Stretch by stretch through a time range: the blocks, then what the crash tail holds beyond them.

use super::block::{BLOCK_COLUMNS, Cells, Decoder, Directory, NumberCells, StoredBlock, WordCells};
use super::compact::{COMPACT_NS, own_codes};
use super::damage::DamagedRows;
use super::error::{Doing, HistoryError, is_of_disk};
use super::reason::{NOT_PROVIDED, PRESENT, Reasons};
use super::recover::read_unsealed;
use super::rows::{Column, SeriesRows, Word};
use super::series::Series;
use super::tail;
use adapter_core::clock::TimeNs;
use rusqlite::{Connection, OptionalExtension, params};
use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;

/// Consecutive rows of one segment, series decoded when they are asked for.
pub(crate) struct SegmentStretch {
    pub(crate) segment: i64,
    pub(crate) first_row: i64,
    pub(crate) at_ns: Vec<TimeNs>,
    form: StretchForm,
}

enum StretchForm {
    Block { directory: Directory, columns: Vec<u8>, codes: Box<[u8; 256]> },
    Tail(SeriesRows),
}

/// Where to go on, and what is needed on the way.
pub(crate) struct Walk {
    blocks: VecDeque<i64>,
    tail_from: Option<i64>,
    tail: VecDeque<SegmentStretch>,
    range: Range<TimeNs>,
    series: Arc<[Series]>,
    decoder: Decoder,
    pub(crate) reasons: Reasons,
    /// What was left out because the disk has changed it.
    pub(crate) damaged: Vec<DamagedRows>,
}

/// The keys of the blocks that may have rows in `range`, in the order of recording.
pub(crate) fn blocks_in(db: &Connection, range: &Range<TimeNs>) -> Result<VecDeque<i64>, HistoryError> {
    let mut statement = db
        .prepare_cached(
            "SELECT first_row FROM blocks WHERE start_ns >= ?1 AND start_ns < ?2 AND end_ns >= ?3 ORDER BY first_row",
        )
        .with_activity("looking for blocks")?;
    // No block is longer than a compacted one and the minute that was the last of its parts, so an earlier start cannot reach
    // into the range.
    let earliest_ns = range.start.saturating_sub(2 * COMPACT_NS);
    let keys = statement.query_map(params![earliest_ns, range.end, range.start], |row| row.get(0));
    keys.and_then(Iterator::collect).with_activity("looking for blocks")
}

impl Walk {
    /// Through the rows at or after `range.start` and before `range.end`. `series` are all the file knows. Call inside a
    /// read transaction, so that a block sealed meanwhile is not seen twice.
    pub(crate) fn new(db: &Connection, range: Range<TimeNs>, series: Arc<[Series]>) -> Result<Self, HistoryError> {
        debug_assert!(!db.is_autocommit(), "a block that is compacted meanwhile is gone: read within a view");
        let blocks = blocks_in(db, &range)?;
        let sealed: Option<i64> = db
            .query_row("SELECT first_row + rows FROM blocks ORDER BY first_row DESC LIMIT 1", [], |row| row.get(0))
            .optional()
            .with_activity("looking for the last block")?;
        let decoder = Decoder::new().map_err(|error| HistoryError::Io { path: "zstd".into(), error })?;
        Ok(Self {
            blocks,
            tail_from: Some(sealed.unwrap_or(0)),
            tail: VecDeque::new(),
            range,
            series,
            decoder,
            reasons: Reasons::default(),
            damaged: Vec::new(),
        })
    }

    /// Through the blocks alone.
    pub(crate) fn of_blocks(
        db: &Connection,
        range: Range<TimeNs>,
        series: Arc<[Series]>,
    ) -> Result<Self, HistoryError> {
        Ok(Self { tail_from: None, ..Self::new(db, range, series)? })
    }

    /// Through what no block holds yet.
    pub(crate) fn of_tail(db: &Connection, range: Range<TimeNs>, series: Arc<[Series]>) -> Result<Self, HistoryError> {
        let nothing = TimeNs::MAX..TimeNs::MAX;
        Ok(Self { range, ..Self::new(db, nothing, series)? })
    }

    /// The next stretch that has a row in the range. What is damaged is passed over, and noted in `damaged`.
    pub(crate) fn next(&mut self, db: &Connection) -> Result<Option<SegmentStretch>, HistoryError> {
        while let Some(first_row) = self.blocks.pop_front() {
            match self.load_block(db, first_row)? {
                Some(stretch) if !self.rows_of(&stretch).is_empty() => return Ok(Some(stretch)),
                Some(_) => {}
                None => self.damaged.push(DamagedRows::of_block(db, first_row)),
            }
        }
        if let Some(from_row) = self.tail_from.take() {
            self.tail = self.load_tail(db, from_row)?;
        }
        while let Some(stretch) = self.tail.pop_front() {
            if !self.rows_of(&stretch).is_empty() {
                return Ok(Some(stretch));
            }
        }
        Ok(None)
    }

    /// The rows of `stretch` that lie in the range. Time never decreases within a stretch.
    pub(crate) fn rows_of(&self, stretch: &SegmentStretch) -> Range<usize> {
        let from = stretch.at_ns.partition_point(|at_ns| *at_ns < self.range.start);
        let to = stretch.at_ns.partition_point(|at_ns| *at_ns < self.range.end);
        from..to.max(from)
    }

    /// The cells of one series in all rows of `stretch`; `None` when nothing delivered it there.
    pub(crate) fn read_cells(&mut self, stretch: &SegmentStretch, series: i64) -> Result<Option<Cells>, HistoryError> {
        match &stretch.form {
            StretchForm::Block { directory, columns, codes } => {
                let Some(entry) = directory.find_entry(series) else { return Ok(None) };
                let damaged = damage_error(stretch.first_row);
                let mut cells = self.decoder.decode_cells(directory, entry, columns).ok_or(damaged)?;
                if entry.any_missing && !directory.words.is_empty() {
                    let missing = cells.missing_mut();
                    missing.iter_mut().for_each(|code| *code = codes[usize::from(*code)]);
                }
                Ok(Some(cells))
            }
            StretchForm::Tail(rows) => {
                let index = self.series.iter().position(|known| known.id == series);
                let column = index.and_then(|index| rows.columns.get(index));
                Ok(column.filter(|column| !column.is_unused()).map(|column| cells_of(column, rows.len())))
            }
        }
    }

    /// The block of this key; `None` when the disk has changed it.
    fn load_block(&mut self, db: &Connection, first_row: i64) -> Result<Option<SegmentStretch>, HistoryError> {
        let stored = db
            .prepare_cached(&format!("SELECT {BLOCK_COLUMNS} FROM blocks WHERE first_row = ?1"))
            .and_then(|mut statement| statement.query_row([first_row], StoredBlock::of_row));
        let stored = match stored {
            Err(error) if is_of_disk(&error) => return Ok(None),
            stored => stored.with_activity("reading a block")?,
        };
        let Some(directory) = stored.verify_directory() else { return Ok(None) };
        let Some(at_ns) = self.decoder.decode_times(&directory, &stored.columns) else { return Ok(None) };
        let codes = Box::new(own_codes(&directory, &mut self.reasons));
        let (segment, columns) = (stored.key.segment, stored.columns);
        Ok(Some(SegmentStretch { segment, first_row, at_ns, form: StretchForm::Block { directory, columns, codes } }))
    }

    fn load_tail(&mut self, db: &Connection, from_row: i64) -> Result<VecDeque<SegmentStretch>, HistoryError> {
        let mut stretches = VecDeque::new();
        let entries = read_unsealed(db, from_row)?;
        for group in entries.chunk_by(|a, b| a.segment == b.segment && b.first_row == a.first_row + a.rows) {
            let mut rows = SeriesRows::for_series(&self.series);
            for entry in group {
                if tail::parse_rows_into(&entry.body, &mut rows, &self.series, &mut self.reasons).is_none() {
                    self.damaged.push(entry.to_damaged_rows());
                }
            }
            let (segment, first_row) = (group[0].segment, group[0].first_row);
            stretches.push_back(SegmentStretch {
                segment,
                first_row,
                at_ns: rows.at_ns.clone(),
                form: StretchForm::Tail(rows),
            });
        }
        Ok(stretches)
    }
}

fn damage_error(first_row: i64) -> HistoryError {
    HistoryError::Damaged { first_row, what: "the samples do not decode" }
}

impl SegmentStretch {
    /// The series delivered here, and whether a value of it is missing anywhere.
    pub(crate) fn delivered_series(&self, series: &[Series]) -> Vec<(i64, bool)> {
        match &self.form {
            StretchForm::Block { directory, .. } => {
                directory.entries.iter().map(|entry| (entry.series, entry.any_missing)).collect()
            }
            StretchForm::Tail(rows) => {
                let used = series.iter().zip(&rows.columns).filter(|(_, column)| !column.is_unused());
                used.map(|(series, column)| (series.id, any_missing(column))).collect()
            }
        }
    }
}

fn any_missing(column: &Column) -> bool {
    match column {
        Column::Numbers { missing, .. } => missing.iter().any(|code| *code != PRESENT),
        Column::Words(changes) => changes.iter().any(|(_, word)| matches!(word, Word::Missing(_))),
    }
}

fn cells_of(column: &Column, rows: usize) -> Cells {
    match column {
        Column::Numbers { values, missing } => {
            Cells::Numbers(NumberCells { values: values.clone(), missing: missing.clone() })
        }
        Column::Words(changes) => {
            let mut cells = WordCells::default();
            for (index, (row, word)) in changes.iter().enumerate() {
                let end = changes.get(index + 1).map_or(rows, |(next, _)| *next);
                cells.push_run(end.saturating_sub(*row), word);
            }
            Cells::Words(cells)
        }
    }
}

impl WordCells {
    fn push_run(&mut self, count: usize, word: &Word) {
        let (code, missing) = match word {
            Word::Missing(code) => (0, *code),
            Word::Is(text) => {
                let position = self.words.iter().position(|known| known == text).unwrap_or_else(|| {
                    self.words.push(text.clone());
                    self.words.len() - 1
                });
                // A word whose place does not fit is none: another word would be a wrong answer.
                u32::try_from(position).map_or((0, NOT_PROVIDED), |position| (position, PRESENT))
            }
        };
        self.codes.resize(self.codes.len() + count, code);
        self.missing.resize(self.missing.len() + count, missing);
    }
}

impl Cells {
    /// Cells of a series that nothing delivered.
    pub(crate) fn not_provided(rows: usize) -> Self {
        Self::Numbers(NumberCells { values: vec![0.0; rows], missing: vec![NOT_PROVIDED; rows] })
    }

    fn missing_mut(&mut self) -> &mut [u8] {
        match self {
            Self::Numbers(cells) => &mut cells.missing,
            Self::Words(cells) => &mut cells.missing,
        }
    }

    /// The code of the reason in `row`, 0 when there is a value.
    #[must_use]
    pub fn missing_code(&self, row: usize) -> u8 {
        match self {
            Self::Numbers(cells) => cells.missing[row],
            Self::Words(cells) => cells.missing[row],
        }
    }

    /// The number in `row`; `None` when it is missing or the series is text.
    #[must_use]
    pub fn number_at(&self, row: usize) -> Option<f64> {
        match self {
            Self::Numbers(cells) if cells.missing[row] == PRESENT => Some(cells.values[row]),
            _ => None,
        }
    }

    /// The word in `row`; `None` when it is missing or the series is a quantity.
    #[must_use]
    pub fn word_at(&self, row: usize) -> Option<&str> {
        match self {
            Self::Words(cells) if cells.missing[row] == PRESENT => {
                cells.words.get(cells.codes[row] as usize).map(|word| &**word)
            }
            _ => None,
        }
    }

    /// Only these rows, in order.
    pub(crate) fn select_rows(&self, rows: &[usize]) -> Self {
        match self {
            Self::Numbers(cells) => Self::Numbers(NumberCells {
                values: rows.iter().map(|row| cells.values[*row]).collect(),
                missing: rows.iter().map(|row| cells.missing[*row]).collect(),
            }),
            Self::Words(cells) => Self::Words(WordCells {
                words: cells.words.clone(),
                codes: rows.iter().map(|row| cells.codes[*row]).collect(),
                missing: rows.iter().map(|row| cells.missing[*row]).collect(),
            }),
        }
    }
}
