//! What is to be made of a table: which columns, under which names, in which units, by which clock; and every assumption in words.

use super::cell::Decimal;
use super::cell_unit::CellUnits;
use super::moment::DateOrder;
use super::note::Note;
use super::row_times::RawTime;

/// How the cells of a column become numbers or words.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum PlannedKind {
    /// `factor * x + offset`; a cell that brings its own unit is converted by `PlannedColumn::cell_units` before.
    Numbers {
        decimal: Decimal,
        factor: f64,
        offset: f64,
    },
    /// Words for no and yes become 0 and 1.
    Flags,
    Words,
}

/// One column to be read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlannedColumn {
    /// Its place in the table.
    pub(super) index: usize,
    /// Its name in the recording.
    pub(super) name: String,
    /// Its name in the file.
    pub(super) source: String,
    pub(super) kind: PlannedKind,
    /// A cell that is no number refuses its row; otherwise it is absent, and counted.
    pub(super) strict: bool,
    /// What turns a cell with a unit behind its number into the unit of the column.
    pub(super) cell_units: Option<CellUnits>,
}

/// How the cells of time become time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum TimeKind {
    /// `factor * x + offset_s` on a clock that begins anywhere.
    Seconds { decimal: Decimal, factor: f64, offset_s: f64 },
    /// Seconds after the factor; 1970 began so many seconds after the zero of the clock.
    Unix { decimal: Decimal, factor: f64, epoch_s: i64 },
    /// Days after the factor since 1899-12-30, on the clock of the place.
    Days { decimal: Decimal, factor: f64 },
    /// No column: the rows follow one another at this step.
    Step { step_s: f64, start: Option<RawTime> },
    /// Dates with times.
    Moments { order: DateOrder },
    /// Times of day without a date.
    TimesOfDay,
}

/// The clock of a block.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TimePlan {
    /// Its column; `None`: the rows are counted.
    pub(super) index: Option<usize>,
    /// A column with the date, where the other holds the time of day.
    pub(super) date: Option<usize>,
    /// A column with the milliseconds beside them.
    pub(super) milliseconds: Option<usize>,
    pub(super) kind: TimeKind,
    /// What turns a cell with a unit behind its number into the unit of the column.
    pub(super) cell_units: Option<CellUnits>,
    /// Its name in the file.
    pub(super) source: String,
}

/// Columns of one clock.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct BlockPlan {
    pub(super) time: TimePlan,
    pub(super) columns: Vec<PlannedColumn>,
}

impl TimePlan {
    /// Is this the column of the time, of its date or of its milliseconds?
    pub(super) fn uses_column(&self, index: usize) -> bool {
        [self.index, self.date, self.milliseconds].contains(&Some(index))
    }
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct ReadPlan {
    pub(super) blocks: Vec<BlockPlan>,
    /// The file is written as our contract says: nothing of it was renamed.
    pub(super) is_contract: bool,
    pub(super) notes: Vec<Note>,
}
