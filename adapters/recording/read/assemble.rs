//! The second way through a table: rows become a block under the plan, and whatever is not used is counted by column and line.

use super::cell::{Cell, Decimal};
use super::column_builder::{ColumnBuilder, SeenText, parse_text_number};
use super::convert::{join_date_and_time, moment_of_cell, number_of, show_cell, to_nanoseconds, unix_ns, utc_or_local};
use super::error::{RecordingError, RowProblem};
use super::head::Head;
use super::limits::{CELLS_MAX, DESCRIBED_MAX, WORDS_BYTES_MAX};
use super::mapping::Mapping;
use super::note::{Note, NoteKind};
use super::plan::{BlockPlan, TimeKind};
use super::restart::name_runs;
use super::row_class::{RowClass, classify_row};
use super::row_times::{RawTime, RawTimes, RowLines};
use super::table::{Row, Table, VisitStep};
use super::time::resolve_times;
use crate::{Cells, Recording};
use adapter_core::clock::SECOND_NS;

/// Lines after the data that are taken for sums and remarks; more of them are refused rows.
const FOOTER_MAX: usize = 12;

/// What a table came to.
#[derive(Debug, Default)]
pub(super) struct Assembled {
    /// One recording for each clock.
    pub(super) blocks: Vec<Recording>,
    pub(super) problems: Vec<RowProblem>,
    pub(super) refused: u64,
    pub(super) notes: Vec<Note>,
}

impl Assembled {
    fn record_refusal(&mut self, problem: RowProblem) {
        self.refused += 1;
        if self.problems.len() < DESCRIBED_MAX {
            self.problems.push(problem);
        }
    }
}

/// Goes through the table once more.
pub(super) fn assemble_recordings(
    table: &dyn Table,
    head: &Head,
    blocks: &[BlockPlan],
    mapping: &Mapping,
    file: &str,
) -> Result<Assembled, RecordingError> {
    let mut assembler = Assembler::new(blocks, head, file);
    let short = table.may_be_short() || head.short;
    table.visit_rows(&mut |row| {
        assembler.take_row(row, classify_row(row, head, short), &[])?;
        Ok(VisitStep::Next)
    })?;
    Ok(assembler.finish_recordings(mapping))
}

/// Takes row after row.
pub(super) struct Assembler<'p> {
    head: &'p Head,
    file: &'p str,
    blocks: Vec<BlockBuilder<'p>>,
    repeats: u64,
    remarks: u64,
    done: Assembled,
}

impl<'p> Assembler<'p> {
    pub(super) fn new(blocks: &'p [BlockPlan], head: &'p Head, file: &'p str) -> Self {
        let blocks = blocks.iter().map(BlockBuilder::new).collect();
        Self { head, file, blocks, repeats: 0, remarks: 0, done: Assembled::default() }
    }

    /// Takes a row of this class. `plain`: the numbers of its cells as far as they are known already, see [`SeenText`].
    pub(super) fn take_row(
        &mut self,
        row: &Row<'_>,
        class: RowClass<'_>,
        plain: &[Option<f64>],
    ) -> Result<(), RecordingError> {
        if class == RowClass::Head || row.cells.iter().all(|cell| *cell == Cell::Empty) {
            return Ok(());
        }
        match class {
            RowClass::Head => {}
            RowClass::RepeatedHeader => self.repeats += 1,
            RowClass::Remark => self.remarks += 1,
            RowClass::Data(cells) => {
                let seen = SeenRow { line: row.line, cells, plain };
                for block in &mut self.blocks {
                    block.accept_row(&seen, &mut self.done);
                    block.within_limits(self.file)?;
                }
            }
            RowClass::OtherWidth => self.refuse_width(row),
        }
        Ok(())
    }

    fn refuse_width(&mut self, row: &Row<'_>) {
        let width = self.head.names.len();
        let one_more = row.cells.len() == width + 1;
        let hint = if one_more { "; a number with a decimal comma has to stand in quotes here" } else { "" };
        let reason = format!("{} cells where the header has {width}{hint}", row.cells.len());
        self.done.record_refusal(RowProblem { line: row.line, column: None, reason });
        self.blocks.iter_mut().for_each(|block| block.rows += 1);
    }

    pub(super) fn finish_recordings(mut self, mapping: &Mapping) -> Assembled {
        count_note(
            self.repeats,
            ("times the header stands again among the data; left out", "次列名行在数据中重复，未读取"),
            &mut self.done.notes,
        );
        count_note(self.remarks, ("lines of remarks among the data left out", "行注释未读取"), &mut self.done.notes);
        for block in self.blocks {
            let recording = block.finish_recording(self.file, mapping, &mut self.done);
            self.done.blocks.push(recording);
        }
        self.done.problems.sort_by_key(|problem| problem.line);
        self.done
    }
}

/// A row of data, and the numbers of its cells as far as they are known already.
struct SeenRow<'a> {
    line: u64,
    cells: &'a [Cell<'a>],
    plain: &'a [Option<f64>],
}

impl<'a> SeenRow<'a> {
    fn cell_at(&self, index: usize) -> Cell<'a> {
        self.cells.get(index).copied().unwrap_or(Cell::Empty)
    }

    fn plain_at(&self, index: usize) -> Option<f64> {
        self.plain.get(index).copied().flatten()
    }
}

fn count_note(count: u64, (en, zh): (&str, &str), notes: &mut Vec<Note>) {
    if count > 0 {
        notes.push(Note::new(NoteKind::Loss, format!("{count} {en}"), format!("{count}{zh}")));
    }
}

struct BlockBuilder<'p> {
    plan: &'p BlockPlan,
    /// Rows that came by, used or not.
    rows: u64,
    lines: RowLines,
    times: RawTimes,
    columns: Vec<ColumnBuilder<'p>>,
    /// Rows without a time since the last one that had one: the end of the file says whether they are a footer.
    problems: Vec<RowProblem>,
    has_new_word: bool,
}

impl<'p> BlockBuilder<'p> {
    fn new(plan: &'p BlockPlan) -> Self {
        Self {
            plan,
            rows: 0,
            lines: RowLines::default(),
            times: RawTimes::default(),
            columns: plan.columns.iter().map(ColumnBuilder::new).collect(),
            problems: Vec::new(),
            has_new_word: false,
        }
    }

    /// Takes the row as a whole or not at all.
    fn accept_row(&mut self, row: &SeenRow<'_>, done: &mut Assembled) {
        let line = row.line;
        let has_time = self.plan.time.index.is_some_and(|index| row.cell_at(index) != Cell::Empty);
        self.rows += 1;
        // Of several clocks the shorter ones end earlier.
        if !has_time && self.plan.columns.iter().all(|column| row.cell_at(column.index) == Cell::Empty) {
            return;
        }
        let time = match self.parse_time(row) {
            Ok(time) => time,
            Err(reason) => {
                let column = Some(self.plan.time.source.clone());
                return self.problems.push(RowProblem { line, column, reason });
            }
        };
        std::mem::take(&mut self.problems).into_iter().for_each(|problem| done.record_refusal(problem));
        for builder in &mut self.columns {
            let index = builder.plan.index;
            if let Err(reason) = builder.look_at(row.cell_at(index), row.plain_at(index)) {
                return done.record_refusal(RowProblem { line, column: Some(builder.plan.source.clone()), reason });
            }
        }
        for builder in &mut self.columns {
            self.has_new_word |= builder.push(line, row.cell_at(builder.plan.index));
        }
        self.lines.push(line);
        self.times.push(time);
    }

    fn within_limits(&mut self, file: &str) -> Result<(), RecordingError> {
        let cells = self.times.len() * (self.columns.len() + 1);
        if cells > CELLS_MAX {
            let rows = self.times.len();
            return Err(RecordingError::with_format_reason(
                file,
                format!(
                    "more than {CELLS_MAX} cells ({rows} rows so far): leave columns out in a map, or give the file in parts"
                ),
                format!("超过{CELLS_MAX}个单元格（已读{rows}行）：请在映射文件中去掉一些列，或分成几个文件"),
            ));
        }
        if !std::mem::take(&mut self.has_new_word) {
            return Ok(());
        }
        match self.columns.iter().find(|column| column.words_bytes > WORDS_BYTES_MAX) {
            Some(column) => Err(RecordingError::with_format_reason(
                file,
                format!(
                    "column {}: more than {} MB of different words: leave it out in a map",
                    column.plan.source,
                    WORDS_BYTES_MAX >> 20
                ),
                format!("列{}：不同的文字超过{} MB：请在映射文件中去掉该列", column.plan.source, WORDS_BYTES_MAX >> 20),
            )),
            None => Ok(()),
        }
    }

    fn parse_time(&self, row: &SeenRow<'_>) -> Result<RawTime, String> {
        let plan = &self.plan.time;
        let cell = plan.index.map_or(Cell::Empty, |index| row.cell_at(index));
        let plain = plan.index.and_then(|index| row.plain_at(index));
        let part = plan.milliseconds.and_then(|index| number_of(row.cell_at(index)));
        let part_ns = part.map_or(0, |ms| to_nanoseconds(ms / 1e3));
        let time = match plan.kind {
            TimeKind::Step { step_s, start } => Some(step_time(self.rows - 1, step_s, start)),
            TimeKind::Seconds { decimal, factor, offset_s } => {
                self.parse_number(cell, plain, decimal).map(|number| RawTime::Seconds(number * factor + offset_s))
            }
            TimeKind::Unix { decimal, factor, epoch_s } => unix_ns(cell, factor)
                .or_else(|| self.parse_number(cell, plain, decimal).map(|number| to_nanoseconds(number * factor)))
                .map(|at_ns| RawTime::Utc(at_ns.saturating_sub(epoch_s.saturating_mul(SECOND_NS)))),
            TimeKind::Days { decimal, factor } => self
                .parse_number(cell, plain, decimal)
                .map(|days| RawTime::Local(to_nanoseconds((days * factor - 25_569.0) * 86_400.0))),
            TimeKind::TimesOfDay => {
                moment_of_cell(cell).and_then(|moment| moment.time_of_day_ns).map(|ns| RawTime::OfDay(ns + part_ns))
            }
            TimeKind::Moments { order } => match (cell, plan.date) {
                (Cell::Instant(at_ns), _) => Some(RawTime::Utc(at_ns)),
                (Cell::Local(at_ns), None) => Some(RawTime::Local(at_ns)),
                (_, None) => moment_of_cell(cell)
                    .filter(|moment| moment.date.is_some())
                    .and_then(|moment| utc_or_local(moment, order)),
                (_, Some(date)) => {
                    join_date_and_time(row.cell_at(date), cell, order).map(|at_ns| RawTime::Local(at_ns + part_ns))
                }
            },
        };
        time.ok_or_else(|| match (cell, plan.source.as_str()) {
            (Cell::Empty, _) => "no time".to_owned(),
            (cell, "time_utc") => format!("{} is not a time like 2026-01-31T08:15:00.5Z (RFC 3339)", show_cell(cell)),
            (cell, "time_s") => format!("{} is not a time in seconds", show_cell(cell)),
            (cell, _) => format!("{} is not a time as in the other rows", show_cell(cell)),
        })
    }

    fn parse_number(&self, cell: Cell<'_>, plain: Option<f64>, decimal: Decimal) -> Option<f64> {
        let units = self.plan.time.cell_units.as_ref();
        match cell {
            Cell::Number(number) => Some(number),
            Cell::Text(text) => parse_text_number(SeenText { text, plain }, decimal, units),
            _ => None,
        }
    }

    fn finish_recording(self, file: &str, mapping: &Mapping, done: &mut Assembled) -> Recording {
        if self.problems.len() <= FOOTER_MAX && !self.problems.is_empty() && self.times.len() > 0 {
            let (lines, first) = (self.problems.len(), self.problems[0].line);
            done.notes.push(Note::new(
                NoteKind::Loss,
                format!("{lines} lines after the data left out (from line {first})"),
                format!("数据之后的{lines}行未读取（自第{first}行起）"),
            ));
        } else {
            self.problems.into_iter().for_each(|problem| done.record_refusal(problem));
        }
        let runs = self.columns.iter().find(|column| column.plan.name == "run").map(|column| &column.words);
        let mut kept = vec![true; self.times.len()];
        let timed = resolve_times(self.times, runs, &mapping.time, &mut done.notes);
        let restarts = timed.restarts;
        for (row, reason) in timed.out_of_order {
            kept[row] = false;
            let line = self.lines.line_of(row);
            done.record_refusal(RowProblem { line, column: Some(self.plan.time.source.clone()), reason });
        }
        let all = kept.iter().all(|kept| *kept);
        let first = kept.iter().position(|kept| *kept).unwrap_or(0);
        // Seconds count from the first row that is kept, where the day is known.
        let (start_ns, shift_s) = match (timed.start_ns, timed.time_s.get(first)) {
            (Some(start_ns), Some(first_s)) => (Some(start_ns + to_nanoseconds(*first_s)), *first_s),
            (start_ns, _) => (start_ns, 0.0),
        };
        let mut time_s = timed.time_s;
        let mut is_kept = kept.iter();
        time_s.retain(|_| is_kept.next().is_none_or(|kept| *kept));
        time_s.iter_mut().for_each(|time_s| *time_s -= shift_s);
        let mut recording = Recording::new(file, time_s, start_ns);
        for column in self.columns {
            column.loss_note(&mut done.notes);
            let name = column.plan.name.clone();
            let cells = column.into_cells();
            recording.set_column(&name, if all { cells } else { cells.select_rows(&kept) });
        }
        if !restarts.is_empty() {
            let runs = name_runs(recording.find_words("run"), &restarts, &kept);
            recording.set_column("run", Cells::Words(runs));
            recording.forget_pauses();
        }
        recording
    }
}

/// The time of a row that is counted.
#[expect(clippy::cast_precision_loss, reason = "numbers of rows are far below 2^53")]
fn step_time(row: u64, step_s: f64, start: Option<RawTime>) -> RawTime {
    let since_s = row as f64 * step_s;
    match start {
        Some(RawTime::Utc(at_ns)) => RawTime::Utc(at_ns.saturating_add(to_nanoseconds(since_s))),
        Some(RawTime::Local(at_ns)) => RawTime::Local(at_ns.saturating_add(to_nanoseconds(since_s))),
        _ => RawTime::Seconds(since_s),
    }
}
