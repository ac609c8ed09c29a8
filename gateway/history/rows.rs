//! Rows on their way to a block, column by column. Buffers are recycled: pushing a tick allocates nothing once every
//! series has been seen.

use super::reason::{NOT_PROVIDED, OUT_OF_RANGE, PRESENT, Reasons, code_of};
use super::series::Series;
use super::series_kind::{ExtraValue, SeriesKind};
use adapter_core::clock::TimeNs;
use adapter_core::{Absence, ChannelId, Sample, Value};
use std::ops::Range;
use std::sync::Arc;

/// What happens to text from a row on.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Word {
    Is(Arc<str>),
    Missing(u8),
}

impl Word {
    fn is_text(&self, text: &str) -> bool {
        matches!(self, Self::Is(word) if **word == *text)
    }
}

/// The cells of one series. Empty until the series is first provided.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Column {
    /// One value and one reason code per row.
    Numbers { values: Vec<f64>, missing: Vec<u8> },
    /// Text holds from the row where it changed.
    Words(Vec<(usize, Word)>),
}

impl Column {
    fn new(kind: SeriesKind) -> Self {
        match kind {
            SeriesKind::Number => Self::Numbers { values: Vec::new(), missing: Vec::new() },
            SeriesKind::Text => Self::Words(Vec::new()),
        }
    }

    /// Has this series never been provided in these rows?
    pub(crate) fn is_unused(&self) -> bool {
        match self {
            Self::Numbers { values, .. } => values.is_empty(),
            Self::Words(changes) => changes.is_empty(),
        }
    }

    fn clear(&mut self) {
        match self {
            Self::Numbers { values, missing } => {
                values.clear();
                missing.clear();
            }
            Self::Words(changes) => changes.clear(),
        }
    }

    fn push_number(&mut self, row: usize, number: f64) {
        match self {
            Self::Numbers { values, missing } => {
                if values.len() < row {
                    values.resize(row, 0.0);
                    missing.resize(row, NOT_PROVIDED);
                }
                let fine = number.is_finite();
                values.push(if fine { number } else { 0.0 });
                missing.push(if fine { PRESENT } else { OUT_OF_RANGE });
            }
            Self::Words(_) => self.push_missing(row, code_of(Absence::NotSupported)),
        }
    }

    fn push_text(&mut self, row: usize, text: &str, shared: impl FnOnce() -> Arc<str>) {
        match self {
            Self::Words(changes) if changes.last().is_some_and(|(_, last)| last.is_text(text)) => {}
            Self::Words(_) => self.push_change(row, Word::Is(shared())),
            Self::Numbers { .. } => self.push_missing(row, code_of(Absence::NotSupported)),
        }
    }

    fn push_missing(&mut self, row: usize, code: u8) {
        match self {
            Self::Numbers { values, missing } => {
                if values.is_empty() && code == NOT_PROVIDED {
                    return;
                }
                values.resize(row + 1, 0.0);
                missing.resize(row, NOT_PROVIDED);
                missing.push(code);
            }
            Self::Words(changes) => {
                let last = changes.last().map_or(NOT_PROVIDED, |(_, last)| match last {
                    Word::Is(_) => PRESENT,
                    Word::Missing(code) => *code,
                });
                if last != code {
                    self.push_change(row, Word::Missing(code));
                }
            }
        }
    }

    fn push_change(&mut self, row: usize, word: Word) {
        if let Self::Words(changes) = self {
            if changes.is_empty() && row > 0 {
                changes.push((0, Word::Missing(NOT_PROVIDED)));
            }
            changes.push((row, word));
        }
    }

    fn append_cells(&mut self, have: usize, other: &Self, rows: &Range<usize>) {
        match (self, other) {
            (Self::Numbers { values, missing }, Self::Numbers { values: more, missing: codes }) => {
                if more.is_empty() && values.is_empty() {
                    return;
                }
                values.resize(have, 0.0);
                missing.resize(have, NOT_PROVIDED);
                // `more` ends early when the series was last provided before these rows began.
                let end = rows.end.min(more.len());
                let start = rows.start.min(end);
                values.extend_from_slice(&more[start..end]);
                missing.extend_from_slice(&codes[start..end]);
                values.resize(have + rows.len(), 0.0);
                missing.resize(have + rows.len(), NOT_PROVIDED);
            }
            (words @ Self::Words(_), Self::Words(more)) => append_words(words, have, more, rows),
            _ => {}
        }
    }
}

fn append_words(words: &mut Column, have: usize, more: &[(usize, Word)], rows: &Range<usize>) {
    let first = more.partition_point(|(row, _)| *row <= rows.start);
    let before = first.checked_sub(1).map(|index| &more[index].1);
    let inside = more[first..].iter().take_while(|(row, _)| *row < rows.end);
    let changes = inside.map(|(row, word)| (*row - rows.start, word));
    for (row, word) in before.map(|word| (0, word)).into_iter().chain(changes) {
        match word {
            Word::Is(text) => words.push_text(have + row, text, || text.clone()),
            Word::Missing(code) => words.push_missing(have + row, *code),
        }
    }
    if before.is_none() && first == more.len() {
        words.push_missing(have, NOT_PROVIDED);
    }
}

/// Rows of every stored series.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SeriesRows {
    pub(crate) at_ns: Vec<TimeNs>,
    pub(crate) columns: Vec<Column>,
    /// How many of the columns, from the first on, are channels.
    channels: usize,
}

impl SeriesRows {
    /// No rows yet of these series.
    pub(crate) fn for_series(series: &[Series]) -> Self {
        let channels = series.iter().take_while(|series| !series.estimated).count();
        Self { channels, at_ns: Vec::new(), columns: series.iter().map(|series| Column::new(series.kind)).collect() }
    }

    /// No rows yet of the same series.
    pub(crate) fn empty_like(&self) -> Self {
        let columns = self.columns.iter().map(|column| match column {
            Column::Numbers { .. } => Column::Numbers { values: Vec::new(), missing: Vec::new() },
            Column::Words(_) => Column::Words(Vec::new()),
        });
        Self { channels: self.channels, at_ns: Vec::new(), columns: columns.collect() }
    }

    pub(crate) fn len(&self) -> usize {
        self.at_ns.len()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.at_ns.is_empty()
    }

    /// Forgets the rows and keeps the memory.
    pub(crate) fn clear(&mut self) {
        self.at_ns.clear();
        self.columns.iter_mut().for_each(Column::clear);
    }

    /// Appends one tick: the channels of `sample`, then `extras`; missing extras count as not provided.
    pub(crate) fn push(&mut self, sample: &Sample, extras: &[ExtraValue<'_>], reasons: &mut Reasons) {
        let row = self.at_ns.len();
        self.at_ns.push(sample.at_ns);
        let channels = self.channels.min(self.columns.len());
        let (channels, estimates) = self.columns.split_at_mut(channels);
        for (channel, column) in ChannelId::list_all().zip(channels) {
            match &sample.slot(channel).value {
                Ok(Value::Number(number)) => column.push_number(row, *number),
                Ok(Value::Text(text)) => column.push_text(row, text, || text.clone()),
                Err(Absence::NotProvided) if column.is_unused() => {}
                Err(absence) => column.push_missing(row, code_of(*absence)),
            }
        }
        for (index, column) in estimates.iter_mut().enumerate() {
            match extras.get(index) {
                Some(ExtraValue::Number(number)) => column.push_number(row, *number),
                Some(ExtraValue::Text(text)) => column.push_text(row, text, || (*text).into()),
                Some(ExtraValue::Missing(word)) => column.push_missing(row, reasons.intern_word(word)),
                None => column.push_missing(row, NOT_PROVIDED),
            }
        }
    }

    /// Appends a stretch of other rows of the same series.
    pub(crate) fn append_rows(&mut self, other: &Self, rows: Range<usize>) {
        let have = self.at_ns.len();
        self.at_ns.extend_from_slice(&other.at_ns[rows.clone()]);
        for (column, more) in self.columns.iter_mut().zip(&other.columns) {
            column.append_cells(have, more, &rows);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::series::stored_series;
    use super::super::series_kind::{ExtraSeries, Fidelity};
    use super::*;
    use adapter_core::Slot;

    fn series() -> Vec<Series> {
        let extras = vec![ExtraSeries::new_number("a_w", "W", "", ""), ExtraSeries::new_text("state", "", "")];
        stored_series(Fidelity::Resolution, &extras).expect("fine")
    }

    fn rows(count: usize) -> SeriesRows {
        let mut rows = SeriesRows::for_series(&series());
        let mut reasons = Reasons::default();
        let power = ChannelId::from_name("spindle_power_w").expect("in the table");
        for row in 0..count {
            let mut sample = Sample::new_empty(row as i64);
            if row % 5 > 1 {
                sample.set_slot(power, Slot { value: Ok(Value::Number(row as f64)), age_ns: 0 });
            }
            let state = if row % 7 < 3 { ExtraValue::Text("idle") } else { ExtraValue::Missing("unsure") };
            rows.push(&sample, &[ExtraValue::Missing("not_learned"), state], &mut reasons);
        }
        rows
    }

    #[test]
    fn appending_in_pieces_is_the_same_as_pushing() {
        let whole = rows(40);
        for cut in 0..=40 {
            let mut pieces = SeriesRows::for_series(&series());
            pieces.append_rows(&whole, 0..cut);
            pieces.append_rows(&whole, cut..40);
            assert_eq!(pieces, whole, "cut at {cut}");
        }
    }

    #[test]
    fn a_series_nobody_provides_takes_no_room() {
        let rows = rows(40);
        assert_eq!(rows.columns.iter().filter(|column| !column.is_unused()).count(), 3);
    }
}
