//! The cells of one column as its plan wants them; what is not used is counted, with lines and an example.

use super::cell::{Cell, Decimal, is_absent, parse_flag, written_number};
use super::cell_unit::CellUnits;
use super::convert::{is_nothing, show_cell, text_of};
use super::note::{Note, NoteKind};
use super::plain_number::scan_plain_number;
use super::plan::{PlannedColumn, PlannedKind};
use crate::{Cells, Numbers, Words};

/// The text of a cell, and its number where a survey has found it to be a plain one under a decimal point.
#[derive(Debug, Clone, Copy)]
pub(super) struct SeenText<'a> {
    pub(super) text: &'a str,
    pub(super) plain: Option<f64>,
}

/// A number as text under a decimal sign, in the unit of its column where its cells bring their own.
pub(super) fn parse_text_number(seen: SeenText<'_>, decimal: Decimal, units: Option<&CellUnits>) -> Option<f64> {
    let SeenText { text, plain } = seen;
    let plain = match decimal {
        Decimal::Point if plain.is_some() => plain,
        _ => scan_plain_number(text, decimal).map(|number| number.value),
    };
    if let Some(value) = plain {
        return units.map_or(Some(value), |units| units.convert_number(value, ""));
    }
    let number = written_number(text)?;
    let value = number.parse_value(decimal)?;
    units.map_or(Some(value), |units| units.convert_number(value, number.suffix))
}

/// Cells of one column that were not used.
#[derive(Debug, Default)]
struct Loss {
    count: u64,
    lines: Vec<u64>,
    example: String,
}

/// The cells of one column under its plan.
pub(super) struct ColumnBuilder<'p> {
    pub(super) plan: &'p PlannedColumn,
    numbers: Numbers,
    pub(super) words: Words,
    pub(super) words_bytes: usize,
    loss: Loss,
    /// The number of the row that is looked at.
    row_number: Option<f64>,
    /// What a number under a decimal point becomes, where that is all that is asked of a plain one.
    plain: Option<PlainConversion>,
    is_words: bool,
}

/// `factor * x + offset`
#[derive(Debug, Clone, Copy)]
struct PlainConversion {
    factor: f64,
    offset: f64,
}

impl<'p> ColumnBuilder<'p> {
    pub(super) fn new(plan: &'p PlannedColumn) -> Self {
        let plain = match plan.kind {
            PlannedKind::Numbers { decimal: Decimal::Point, factor, offset } if plan.cell_units.is_none() => {
                Some(PlainConversion { factor, offset })
            }
            _ => None,
        };
        Self {
            plan,
            numbers: Numbers::default(),
            words: Words::default(),
            words_bytes: 0,
            loss: Loss::default(),
            row_number: None,
            plain,
            is_words: plan.kind == PlannedKind::Words,
        }
    }

    /// Takes the number of a cell; a cell of a strict column that holds none and is not absent refuses its row.
    pub(super) fn look_at(&mut self, cell: Cell<'_>, plain: Option<f64>) -> Result<(), String> {
        if self.is_words {
            return Ok(());
        }
        if let (Some(number), Some(PlainConversion { factor, offset })) = (plain, self.plain) {
            self.row_number = Some(number * factor + offset);
            return Ok(());
        }
        self.row_number = self.parse_number(cell, plain);
        match (self.plan.kind, cell, self.row_number) {
            (PlannedKind::Numbers { .. }, Cell::Text(text), None) if self.plan.strict && !is_absent(text) => {
                Err(format!(
                    "{text:?} is not a finite number with a decimal point; leave the cell empty where there is no value"
                ))
            }
            _ => Ok(()),
        }
    }

    fn parse_number(&self, cell: Cell<'_>, plain: Option<f64>) -> Option<f64> {
        match (self.plan.kind, cell) {
            (PlannedKind::Flags, Cell::Text(text)) => parse_flag(text)
                .map(|(_, yes)| f64::from(u8::from(yes)))
                .or_else(|| text.parse().ok().filter(|x: &f64| x.is_finite())),
            (PlannedKind::Flags, Cell::Number(number)) => Some(number),
            (PlannedKind::Numbers { decimal, factor, offset }, Cell::Text(text)) => {
                let seen = SeenText { text, plain };
                let value = parse_text_number(seen, decimal, self.plan.cell_units.as_ref());
                let value = value.or_else(|| parse_flag(text).map(|(_, yes)| f64::from(u8::from(yes))));
                value.map(|value| value * factor + offset)
            }
            (PlannedKind::Numbers { factor, offset, .. }, Cell::Number(number)) => Some(number * factor + offset),
            (_, Cell::Flag(flag)) => Some(f64::from(u8::from(flag))),
            _ => None,
        }
    }

    /// Takes the cell that was looked at; true where it is a new word.
    pub(super) fn push(&mut self, line: u64, cell: Cell<'_>) -> bool {
        if self.is_words {
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
            let is_new = self.words.words().len() > before;
            self.words_bytes += if is_new { text.len() + 64 } else { 0 };
            return is_new;
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
        false
    }

    pub(super) fn loss_note(&self, notes: &mut Vec<Note>) {
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

    pub(super) fn into_cells(self) -> Cells {
        if self.is_words { Cells::Words(self.words) } else { Cells::Numbers(self.numbers) }
    }
}
