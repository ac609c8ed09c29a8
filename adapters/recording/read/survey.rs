//! What stands in each column, counted over every row before anything is decided: one strange cell in the first row decides nothing.

use super::cell::{Cell, Decimal, Shape, is_absent, is_absent_number, parse_flag, written_number};
use super::compact_moment::{CompactKind, parse_compact};
use super::error::RecordingError;
use super::head::Head;
use super::moment::{OrderEvidence, written_moment};
use super::plain_number::scan_plain_number;
use super::row_class::{RowClass, classify_row};
use super::table::{Table, VisitStep};
use adapter_core::clock::SECOND_NS;
use std::collections::BTreeMap;

/// Words behind numbers that are told apart.
const SUFFIXES_MAX: usize = 16;
/// Examples kept of each strange kind.
const EXAMPLES: usize = 5;

/// A cell and where it stands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Example {
    pub(super) line: u64,
    pub(super) text: String,
}

/// Counts of one column. Absent cells are in none of them but `absent`.
#[derive(Debug, Clone, Default)]
pub(super) struct ColumnSurvey {
    pub(super) absent: u64,
    /// Numbers of a format that knows numbers.
    pub(super) typed: u64,
    /// Moments of such a format, with and without a zone.
    pub(super) instants: u64,
    pub(super) locals: u64,
    /// Numbers as text, by what they say of the decimal sign.
    pub(super) whole: u64,
    pub(super) point: u64,
    pub(super) comma: u64,
    pub(super) point_or_thousands: u64,
    pub(super) comma_or_thousands: u64,
    pub(super) point_example: Option<Example>,
    pub(super) comma_example: Option<Example>,
    /// What stands behind numbers, how often; of many only the first.
    pub(super) suffixes: BTreeMap<String, u64>,
    pub(super) suffixed: u64,
    /// Numbers that are a moment in digits as well: date and time, a date alone, a time alone.
    pub(super) compact_moments: u64,
    pub(super) compact_dates: u64,
    pub(super) compact_times: u64,
    /// Text that is a moment: with date, without one, with a zone.
    pub(super) moments: u64,
    pub(super) times_of_day: u64,
    pub(super) dates: u64,
    pub(super) zoned: u64,
    pub(super) order: OrderEvidence,
    /// Words of a pair for no and yes; which pair, where all are of one.
    pub(super) flags: u64,
    pub(super) pair: Option<usize>,
    pairs_differ: bool,
    /// Any other word.
    pub(super) words: u64,
    pub(super) word_examples: Vec<Example>,
    last_word: String,
    last_is_flag: bool,
    numbers: NumberSeries,
}

/// What the numbers of a column are, one after the other, under a decimal point.
#[derive(Debug, Clone, Copy)]
struct NumberSeries {
    count: u64,
    first: f64,
    last: f64,
    least: f64,
    greatest: f64,
    /// Each was the one before plus one.
    is_counting: bool,
}

impl Default for NumberSeries {
    fn default() -> Self {
        let (least, greatest) = (f64::INFINITY, f64::NEG_INFINITY);
        Self { count: 0, first: 0.0, last: 0.0, least, greatest, is_counting: true }
    }
}

impl NumberSeries {
    #[expect(clippy::float_cmp, reason = "a row number is a whole number, exactly")]
    fn record_number(&mut self, number: f64) {
        if self.count == 0 {
            self.first = number;
        } else if self.is_counting {
            self.is_counting = number == self.last + 1.0;
        }
        self.count += 1;
        self.last = number;
        self.least = self.least.min(number);
        self.greatest = self.greatest.max(number);
    }
}

impl ColumnSurvey {
    pub(super) fn count_numbers(&self) -> u64 {
        self.typed + self.whole + self.point + self.comma + self.point_or_thousands + self.comma_or_thousands
    }

    /// Cells that have something to say.
    pub(super) fn count_filled(&self) -> u64 {
        self.count_numbers() + self.instants + self.locals + self.moments + self.times_of_day + self.flags + self.words
    }

    /// Mean step from one number to the next.
    pub(super) fn mean_step(&self) -> Option<f64> {
        let NumberSeries { count, first, last, .. } = self.numbers;
        #[expect(clippy::cast_precision_loss, reason = "numbers of rows are far below 2^53")]
        (count > 1).then(|| (last - first) / (count - 1) as f64)
    }

    /// Least and greatest number.
    pub(super) fn find_range(&self) -> Option<(f64, f64)> {
        (self.numbers.count > 0).then_some((self.numbers.least, self.numbers.greatest))
    }

    /// Is each number the one before plus one?
    pub(super) fn counts_rows(&self) -> bool {
        self.numbers.count > 1 && self.numbers.is_counting
    }

    /// Counts a cell; its number, where it is a plain one under a decimal point.
    fn record_cell(&mut self, line: u64, cell: Cell<'_>) -> Option<f64> {
        match cell {
            Cell::Empty => self.absent += 1,
            Cell::Number(number) if number.is_finite() => {
                self.typed += 1;
                self.numbers.record_number(number);
                // Fourteen digits are exact in a double.
                if (1e13..1e14).contains(&number) || (1e7..1e8).contains(&number) {
                    self.see_digits(&number.to_string());
                }
            }
            Cell::Number(_) => self.absent += 1,
            Cell::Flag(_) => {
                self.flags += 1;
                self.see_pair(1);
            }
            Cell::Instant(_) => self.instants += 1,
            Cell::Local(at_ns) => {
                self.locals += 1;
                self.dates += u64::from(at_ns.rem_euclid(86_400 * SECOND_NS) == 0);
            }
            Cell::Text(text) => return self.see_text(line, text),
        }
        None
    }

    fn see_text(&mut self, line: u64, text: &str) -> Option<f64> {
        if let Some(number) = scan_plain_number(text, Decimal::Point) {
            match number.shape {
                Shape::Whole => {
                    self.whole += 1;
                    self.see_digits(text);
                }
                Shape::PointOrThousands => self.point_or_thousands += 1,
                _ => {
                    self.point += 1;
                    self.point_example.get_or_insert_with(|| Example { line, text: text.to_owned() });
                }
            }
            self.numbers.record_number(number.value);
            return Some(number.value);
        }
        if self.last_word == text && !text.is_empty() {
            // As the row before: most columns of words go on for a while.
            self.words += u64::from(!self.last_is_flag);
            self.flags += u64::from(self.last_is_flag);
        } else {
            self.see_other_text(line, text);
        }
        None
    }

    /// A text that is no plain number.
    fn see_other_text(&mut self, line: u64, text: &str) {
        if is_absent(text) {
            self.absent += 1;
        } else if let Some(number) = written_number(text) {
            let example = || Example { line, text: text.to_owned() };
            match number.shape {
                Shape::Whole => self.whole += 1,
                Shape::Point => {
                    self.point += 1;
                    self.point_example.get_or_insert_with(example);
                }
                Shape::Comma => {
                    self.comma += 1;
                    self.comma_example.get_or_insert_with(example);
                }
                Shape::PointOrThousands => self.point_or_thousands += 1,
                Shape::CommaOrThousands => self.comma_or_thousands += 1,
            }
            self.see_suffix(number.suffix);
            self.see_digits(text);
            if let Some(number) = number.parse_value(Decimal::Point) {
                self.numbers.record_number(number);
            }
        } else if let Some(moment) = written_moment(text) {
            match (moment.date, moment.time_of_day_ns) {
                (None, _) => self.times_of_day += 1,
                (Some(date), time) => {
                    self.moments += 1;
                    self.dates += u64::from(time.is_none());
                    self.order.record_date(date);
                }
            }
            self.zoned += u64::from(moment.offset_s.is_some());
        } else if let Some((pair, _)) = parse_flag(text) {
            self.flags += 1;
            self.see_pair(pair);
            self.remember_word(text, true);
        } else if is_absent_number(text) {
            self.absent += 1;
        } else {
            self.words += 1;
            self.remember_word(text, false);
            if self.word_examples.len() < EXAMPLES {
                self.word_examples.push(Example { line, text: text.chars().take(40).collect() });
            }
        }
    }

    fn remember_word(&mut self, text: &str, is_flag: bool) {
        text.clone_into(&mut self.last_word);
        self.last_is_flag = is_flag;
    }

    fn see_suffix(&mut self, suffix: &str) {
        if suffix.is_empty() {
            return;
        }
        self.suffixed += 1;
        if let Some(count) = self.suffixes.get_mut(suffix) {
            *count += 1;
        } else if self.suffixes.len() < SUFFIXES_MAX {
            self.suffixes.insert(suffix.to_owned(), 1);
        }
    }

    fn see_digits(&mut self, text: &str) {
        if !matches!(text.len(), 6 | 8 | 12 | 14..) {
            return;
        }
        match parse_compact(text) {
            Some((CompactKind::Moment, _)) => self.compact_moments += 1,
            Some((CompactKind::Date, _)) => self.compact_dates += 1,
            Some((CompactKind::TimeOfDay, _)) => self.compact_times += 1,
            None => {}
        }
    }

    fn see_pair(&mut self, pair: usize) {
        match self.pair {
            None if !self.pairs_differ => self.pair = Some(pair),
            Some(known) if known != pair => {
                self.pairs_differ = true;
                self.pair = None;
            }
            _ => {}
        }
    }
}

/// The survey of a table.
#[derive(Debug)]
pub(super) struct Survey {
    pub(super) columns: Vec<ColumnSurvey>,
}

impl Survey {
    /// Of a table under this head, before its first row.
    pub(super) fn new(head: &Head) -> Self {
        Self { columns: vec![ColumnSurvey::default(); head.names.len()] }
    }

    /// Counts the cells of a row of data; `plain` takes the number of each cell that is a plain one under a decimal point.
    pub(super) fn record_row(&mut self, line: u64, cells: &[Cell<'_>], plain: &mut Vec<Option<f64>>) {
        plain.clear();
        plain.extend(self.columns.iter_mut().zip(cells).map(|(column, cell)| column.record_cell(line, *cell)));
    }
}

/// Goes through the whole table.
pub(super) fn survey_table(table: &dyn Table, head: &Head) -> Result<Survey, RecordingError> {
    let mut found = Survey::new(head);
    let short = table.may_be_short() || head.short;
    let mut plain = Vec::new();
    table.visit_rows(&mut |row| {
        if let RowClass::Data(cells) = classify_row(row, head, short) {
            found.record_row(row.line, cells, &mut plain);
        }
        Ok(VisitStep::Next)
    })?;
    Ok(found)
}
