//! The second way through a table: rows become a block under the plan, and whatever is not used is counted by column and line.

use super::cell::{Cell, Decimal, is_absent, parse_flag, written_number};
use super::cell_unit::CellUnits;
use super::convert::{
    is_nothing, join_date_and_time, moment_of_cell, number_of, show_cell, text_of, to_nanoseconds, unix_ns,
    utc_or_local,
};
use super::error::{RecordingError, RowProblem};
use super::head::Head;
use super::limits::{CELLS_MAX, DESCRIBED_MAX, WORDS_BYTES_MAX};
use super::mapping::Mapping;
use super::plain_number::scan_plain_number;
use super::plan::{BlockPlan, Note, NoteKind, PlannedColumn, PlannedKind, ReadPlan, TimeKind};
use super::restart::name_runs;
use super::survey::{fit_row, is_comment, repeats_header};
use super::table::{Table, VisitStep};
use super::time::{RawTime, resolve_times};
use crate::{Cells, Numbers, Recording, Words};
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
    plan: &ReadPlan,
    mapping: &Mapping,
    file: &str,
) -> Result<Assembled, RecordingError> {
    let mut done = Assembled::default();
    let mut blocks: Vec<BlockBuilder<'_>> = plan.blocks.iter().map(BlockBuilder::new).collect();
    let short = table.may_be_short() || head.short;
    let (mut repeated, mut comments) = (0_u64, 0_u64);
    table.visit_rows(&mut |row| {
        if row.line < head.data_line || row.cells.iter().all(|cell| *cell == Cell::Empty) {
            return Ok(VisitStep::Next);
        }
        if repeats_header(row, head) {
            repeated += 1;
            return Ok(VisitStep::Next);
        }
        if is_comment(row, head) {
            comments += 1;
            return Ok(VisitStep::Next);
        }
        match fit_row(row, head, short) {
            Some(cells) => blocks.iter_mut().for_each(|block| block.accept_row(row.line, cells, &mut done)),
            None => {
                let one_more = row.cells.len() == head.names.len() + 1;
                let hint = if one_more { "; a number with a decimal comma has to stand in quotes here" } else { "" };
                let reason = format!("{} cells where the header has {}{hint}", row.cells.len(), head.names.len());
                done.record_refusal(RowProblem { line: row.line, column: None, reason });
                blocks.iter_mut().for_each(|block| block.rows += 1);
            }
        }
        blocks.iter().try_for_each(|block| block.within_limits(file))?;
        Ok(VisitStep::Next)
    })?;
    count_note(
        repeated,
        ("times the header stands again among the data; left out", "次列名行在数据中重复，未读取"),
        &mut done.notes,
    );
    count_note(comments, ("lines of remarks among the data left out", "行注释未读取"), &mut done.notes);
    for block in blocks {
        let recording = block.finish_recording(file, mapping, &mut done);
        done.blocks.push(recording);
    }
    done.problems.sort_by_key(|problem| problem.line);
    Ok(done)
}

fn count_note(count: u64, (en, zh): (&str, &str), notes: &mut Vec<Note>) {
    if count > 0 {
        notes.push(Note::new(NoteKind::Loss, format!("{count} {en}"), format!("{count}{zh}")));
    }
}

/// Cells of one column that were not used.
#[derive(Debug, Default)]
struct Loss {
    count: u64,
    lines: Vec<u64>,
    example: String,
}

struct ColumnBuilder<'p> {
    plan: &'p PlannedColumn,
    numbers: Numbers,
    words: Words,
    words_bytes: usize,
    loss: Loss,
    /// The number of the row that is looked at.
    row_number: Option<f64>,
}

struct BlockBuilder<'p> {
    plan: &'p BlockPlan,
    /// Rows that came by, used or not.
    rows: u64,
    lines: Vec<u32>,
    times: Vec<RawTime>,
    columns: Vec<ColumnBuilder<'p>>,
    /// Rows without a time since the last one that had one: the end of the file says whether they are a footer.
    problems: Vec<RowProblem>,
}

impl<'p> BlockBuilder<'p> {
    fn new(plan: &'p BlockPlan) -> Self {
        let column = |plan| ColumnBuilder {
            plan,
            numbers: Numbers::default(),
            words: Words::default(),
            words_bytes: 0,
            loss: Loss::default(),
            row_number: None,
        };
        Self {
            plan,
            rows: 0,
            lines: Vec::new(),
            times: Vec::new(),
            columns: plan.columns.iter().map(column).collect(),
            problems: Vec::new(),
        }
    }

    /// Takes the row as a whole or not at all.
    fn accept_row(&mut self, line: u64, cells: &[Cell<'_>], done: &mut Assembled) {
        let at = |index: usize| cells.get(index).copied().unwrap_or(Cell::Empty);
        let has_time = self.plan.time.index.is_some_and(|index| at(index) != Cell::Empty);
        self.rows += 1;
        // Of several clocks the shorter ones end earlier.
        if !has_time && self.plan.columns.iter().all(|column| at(column.index) == Cell::Empty) {
            return;
        }
        let column = Some(self.plan.time.source.clone());
        let time = match self.parse_time(cells) {
            Ok(time) => time,
            Err(reason) => return self.problems.push(RowProblem { line, column, reason }),
        };
        let Ok(stored_line) = u32::try_from(line) else {
            let reason = format!("only the first {} lines of a file are read", u32::MAX);
            return done.record_refusal(RowProblem { line, column: None, reason });
        };
        std::mem::take(&mut self.problems).into_iter().for_each(|problem| done.record_refusal(problem));
        for builder in &mut self.columns {
            if let Err(reason) = builder.look_at(at(builder.plan.index)) {
                return done.record_refusal(RowProblem { line, column: Some(builder.plan.source.clone()), reason });
            }
        }
        self.columns.iter_mut().for_each(|builder| builder.push(line, at(builder.plan.index)));
        self.lines.push(stored_line);
        self.times.push(time);
    }

    fn within_limits(&self, file: &str) -> Result<(), RecordingError> {
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

    fn parse_time(&self, cells: &[Cell<'_>]) -> Result<RawTime, String> {
        let plan = &self.plan.time;
        let at = |index: usize| cells.get(index).copied().unwrap_or(Cell::Empty);
        let cell = plan.index.map_or(Cell::Empty, at);
        let part_ns = plan.milliseconds.and_then(|index| number_of(at(index))).map_or(0, |ms| to_nanoseconds(ms / 1e3));
        let time = match plan.kind {
            TimeKind::Step { step_s, start } => Some(step_time(self.rows - 1, step_s, start)),
            TimeKind::Seconds { decimal, factor, offset_s } => {
                self.parse_number(cell, decimal).map(|number| RawTime::Seconds(number * factor + offset_s))
            }
            TimeKind::Unix { decimal, factor, epoch_s } => unix_ns(cell, factor)
                .or_else(|| self.parse_number(cell, decimal).map(|number| to_nanoseconds(number * factor)))
                .map(|at_ns| RawTime::Utc(at_ns.saturating_sub(epoch_s.saturating_mul(SECOND_NS)))),
            TimeKind::Days { decimal, factor } => self
                .parse_number(cell, decimal)
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
                    join_date_and_time(at(date), cell, order).map(|at_ns| RawTime::Local(at_ns + part_ns))
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

    fn parse_number(&self, cell: Cell<'_>, decimal: Decimal) -> Option<f64> {
        match cell {
            Cell::Number(number) => Some(number),
            Cell::Text(text) => parse_text_number(text, decimal, self.plan.time.cell_units.as_ref()),
            _ => None,
        }
    }

    fn finish_recording(self, file: &str, mapping: &Mapping, done: &mut Assembled) -> Recording {
        if self.problems.len() <= FOOTER_MAX && !self.problems.is_empty() && !self.times.is_empty() {
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
        let timed = resolve_times(&self.times, runs, &mapping.time, &mut done.notes);
        let restarts = timed.restarts;
        let mut kept = vec![true; self.times.len()];
        for (row, reason) in timed.out_of_order {
            kept[row] = false;
            let line = u64::from(self.lines[row]);
            done.record_refusal(RowProblem { line, column: Some(self.plan.time.source.clone()), reason });
        }
        let all = kept.iter().all(|kept| *kept);
        let first = kept.iter().position(|kept| *kept).unwrap_or(0);
        // Seconds count from the first row that is kept, where the day is known.
        let (start_ns, shift_s) = match (timed.start_ns, timed.time_s.get(first)) {
            (Some(start_ns), Some(first_s)) => (Some(start_ns + to_nanoseconds(*first_s)), *first_s),
            (start_ns, _) => (start_ns, 0.0),
        };
        let time_s =
            timed.time_s.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(time_s, _)| time_s - shift_s).collect();
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

/// A number as text under a decimal sign, in the unit of its column where its cells bring their own.
fn parse_text_number(text: &str, decimal: Decimal, units: Option<&CellUnits>) -> Option<f64> {
    if let Some(number) = scan_plain_number(text, decimal) {
        return units.map_or(Some(number.value), |units| units.convert_number(number.value, ""));
    }
    let number = written_number(text)?;
    let value = number.parse_value(decimal)?;
    units.map_or(Some(value), |units| units.convert_number(value, number.suffix))
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

impl ColumnBuilder<'_> {
    /// Takes the number of a cell; a cell of a strict column that holds none and is not absent refuses its row.
    fn look_at(&mut self, cell: Cell<'_>) -> Result<(), String> {
        if self.plan.kind == PlannedKind::Words {
            return Ok(());
        }
        self.row_number = self.parse_number(cell);
        match (self.plan.kind, cell, self.row_number) {
            (PlannedKind::Numbers { .. }, Cell::Text(text), None) if self.plan.strict && !is_absent(text) => {
                Err(format!(
                    "{text:?} is not a finite number with a decimal point; leave the cell empty where there is no value"
                ))
            }
            _ => Ok(()),
        }
    }

    fn parse_number(&self, cell: Cell<'_>) -> Option<f64> {
        match (self.plan.kind, cell) {
            (PlannedKind::Flags, Cell::Text(text)) => parse_flag(text)
                .map(|(_, yes)| f64::from(u8::from(yes)))
                .or_else(|| text.parse().ok().filter(|x: &f64| x.is_finite())),
            (PlannedKind::Flags, Cell::Number(number)) => Some(number),
            (PlannedKind::Numbers { decimal, factor, offset }, Cell::Text(text)) => {
                let value = parse_text_number(text, decimal, self.plan.cell_units.as_ref());
                let value = value.or_else(|| parse_flag(text).map(|(_, yes)| f64::from(u8::from(yes))));
                value.map(|value| value * factor + offset)
            }
            (PlannedKind::Numbers { factor, offset, .. }, Cell::Number(number)) => Some(number * factor + offset),
            (_, Cell::Flag(flag)) => Some(f64::from(u8::from(flag))),
            _ => None,
        }
    }

    fn push(&mut self, line: u64, cell: Cell<'_>) {
        if self.plan.kind == PlannedKind::Words {
            let owned;
            let text = match cell {
                Cell::Text(text) if is_absent(text) => "",
                Cell::Text(text) => text,
                cell => {
                    owned = text_of(cell);
                    owned.as_str()
                }
            };
            let before = self.words.words().len();
            self.words.push(text);
            if self.words.words().len() > before {
                self.words_bytes += text.len() + 64;
            }
            return;
        }
        let number = self.row_number;
        if number.is_none() && !is_nothing(cell) {
            self.loss.count += 1;
            if self.loss.lines.len() < 5 {
                self.loss.lines.push(line);
            }
            if self.loss.example.is_empty() {
                self.loss.example = show_cell(cell);
            }
        }
        self.numbers.push(number);
    }

    fn loss_note(&self, notes: &mut Vec<Note>) {
        let Loss { count, lines, example } = &self.loss;
        if *count == 0 {
            return;
        }
        let lines: Vec<String> = lines.iter().map(u64::to_string).collect();
        let (name, lines) = (&self.plan.source, lines.join(", "));
        notes.push(Note::new(
            NoteKind::Loss,
            format!("{name}: {count} cells are no numbers and count as absent, such as {example} (lines {lines})"),
            format!("{name}：{count}个单元格不是数字，按缺失处理，例如{example}（第{lines}行）"),
        ));
    }

    fn into_cells(self) -> Cells {
        if self.plan.kind == PlannedKind::Words { Cells::Words(self.words) } else { Cells::Numbers(self.numbers) }
    }
}
