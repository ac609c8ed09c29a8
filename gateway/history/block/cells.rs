//! The bytes of one series in a block, before compression.
//!
//! Numbers: runs of (rows, reason) when any value is missing, then the values that are there, as scaled integers or,
//! when some value is no decimal that fits, as the eight byte planes of the doubles. Text: the distinct words, then
//! runs of (rows, word or reason).

use super::super::reason::PRESENT;
use super::super::rounding::{TEN, places_of, round_to_decimals, round_to_integer};
use super::super::rows::{Column, Word};
use super::integers;
use super::varint::{Bytes, append_varint, put_text};
use std::sync::Arc;

/// How the values of a series are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encoding {
    /// Integers of value times ten to this power.
    Scaled(u8),
    /// Byte planes of doubles.
    Planes,
    /// The distinct words, and runs of their numbers.
    Words,
}

/// Count, least, greatest and mean of the values that are there.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ValueSummary {
    /// How many values there are.
    pub count: u64,
    /// The least, in the unit of the series; 0 when there is none.
    pub min: f64,
    /// The greatest, in the unit of the series; 0 when there is none.
    pub max: f64,
    /// The mean, in the unit of the series; 0 when there is none.
    pub mean: f64,
}

impl ValueSummary {
    pub(crate) fn from_values(values: &[f64]) -> Self {
        if values.is_empty() {
            return Self::default();
        }
        let min = values.iter().copied().fold(f64::INFINITY, f64::min);
        let max = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        Self { count: values.len() as u64, min, max, mean: mean.clamp(min, max) }
    }

    /// Both together, the means weighted by their counts.
    #[must_use]
    pub fn merge_with(self, other: Self) -> Self {
        if self.count == 0 || other.count == 0 {
            return if self.count == 0 { other } else { self };
        }
        let count = self.count + other.count;
        let mean = (self.mean * self.count as f64 + other.mean * other.count as f64) / count as f64;
        Self { count, min: self.min.min(other.min), max: self.max.max(other.max), mean }
    }
}

/// What was written for one series.
pub(crate) struct SeriesWritten {
    pub(crate) encoding: Encoding,
    pub(crate) summary: ValueSummary,
    pub(crate) any_missing: bool,
}

/// Room that is used again for every series.
#[derive(Default)]
pub(crate) struct Scratch {
    present: Vec<f64>,
    integers: Vec<i64>,
}

/// Appends the cells of `column` to `out`; numbers are rounded to `decimals` places first unless that is `None`.
pub(crate) fn encode_column(
    column: &Column,
    rows: usize,
    decimals: Option<u8>,
    scratch: &mut Scratch,
    out: &mut Vec<u8>,
) -> SeriesWritten {
    match column {
        Column::Numbers { values, missing } => encode_numbers(values, missing, decimals, scratch, out),
        Column::Words(changes) => encode_words(changes, rows, out),
    }
}

fn encode_numbers(
    values: &[f64],
    missing: &[u8],
    decimals: Option<u8>,
    scratch: &mut Scratch,
    out: &mut Vec<u8>,
) -> SeriesWritten {
    debug_assert_eq!(values.len(), missing.len(), "every value has its code");
    let any_missing = missing.iter().any(|code| *code != PRESENT);
    let present = &mut scratch.present;
    present.clear();
    if any_missing {
        put_runs(missing, out);
        present.extend(values.iter().zip(missing).filter(|(_, code)| **code == PRESENT).map(|(value, _)| *value));
    } else {
        present.extend_from_slice(values);
    }
    if let Some(decimals) = decimals {
        present.iter_mut().for_each(|value| *value = round_to_decimals(*value, decimals));
    }
    let encoding = match places_of(present) {
        Some(places) => {
            let scale = TEN[usize::from(places)];
            scratch.integers.clear();
            scratch.integers.extend(present.iter().map(|value| round_to_integer(value * scale) as i64));
            integers::encode_integers(&scratch.integers, out);
            Encoding::Scaled(places)
        }
        None => {
            put_planes(present, out);
            Encoding::Planes
        }
    };
    SeriesWritten { encoding, summary: ValueSummary::from_values(present), any_missing }
}

fn put_runs(codes: &[u8], out: &mut Vec<u8>) {
    let runs = codes.chunk_by(|a, b| a == b);
    append_varint(out, runs.clone().count() as u64);
    for run in runs {
        append_varint(out, run.len() as u64);
        out.push(run[0]);
    }
}

fn put_planes(values: &[f64], out: &mut Vec<u8>) {
    for plane in 0..8 {
        out.extend(values.iter().map(|value| value.to_le_bytes()[plane]));
    }
}

fn encode_words(changes: &[(usize, Word)], rows: usize, out: &mut Vec<u8>) -> SeriesWritten {
    debug_assert!(changes.is_sorted_by(|a, b| a.0 < b.0), "changes come in the order of their rows");
    debug_assert!(changes.last().is_none_or(|(row, _)| *row < rows), "a change is one of the rows");
    let mut words: Vec<&str> = Vec::new();
    let mut runs: Vec<u8> = Vec::new();
    let mut count = 0u64;
    for (index, (row, word)) in changes.iter().enumerate() {
        let end = changes.get(index + 1).map_or(rows, |(next, _)| *next);
        append_varint(&mut runs, end.saturating_sub(*row) as u64);
        match word {
            Word::Missing(code) => runs.extend([0, *code]),
            Word::Is(text) => {
                count += end.saturating_sub(*row) as u64;
                append_varint(&mut runs, 1 + intern_word(&mut words, text) as u64);
            }
        }
    }
    append_varint(out, words.len() as u64);
    words.iter().for_each(|word| put_text(out, word));
    append_varint(out, changes.len() as u64);
    out.extend_from_slice(&runs);
    let any_missing = count < rows as u64;
    SeriesWritten { encoding: Encoding::Words, summary: ValueSummary { count, ..ValueSummary::default() }, any_missing }
}

fn intern_word<'a>(words: &mut Vec<&'a str>, text: &'a str) -> usize {
    words.iter().rposition(|word| *word == text).unwrap_or_else(|| {
        words.push(text);
        words.len() - 1
    })
}

/// Decoded numbers: `values[row]` counts only where `missing[row]` is 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NumberCells {
    /// In the unit of the series; 0 where missing.
    pub values: Vec<f64>,
    /// Code of the reason, 0 where there is a value.
    pub missing: Vec<u8>,
}

/// Decoded text: `words[codes[row]]` counts only where `missing[row]` is 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct WordCells {
    /// The distinct words of the column; `codes` are indices of it.
    pub words: Vec<Arc<str>>,
    /// Which word; 0 where missing.
    pub codes: Vec<u32>,
    /// Code of the reason, 0 where there is a word.
    pub missing: Vec<u8>,
}

/// The decoded cells of one series.
#[derive(Debug, Clone, PartialEq)]
pub enum Cells {
    /// The values of a quantity in its unit.
    Numbers(NumberCells),
    /// The words of a text series.
    Words(WordCells),
}

/// Reads what [`encode_column`] wrote; `None` when the bytes do not fit.
pub(crate) fn decode_cells(
    bytes: &[u8],
    rows: usize,
    encoding: Encoding,
    any_missing: bool,
    present: usize,
) -> Option<Cells> {
    let mut bytes = Bytes(bytes);
    if encoding == Encoding::Words {
        return decode_words(&mut bytes, rows).map(Cells::Words);
    }
    let missing = if any_missing { take_runs(&mut bytes, rows)? } else { vec![PRESENT; rows] };
    let values = match encoding {
        Encoding::Scaled(places) => {
            let scale = *TEN.get(usize::from(places))?;
            integers::decode_integers(&mut bytes, present)?.into_iter().map(|value| value as f64 / scale).collect()
        }
        _ => take_planes(&mut bytes, present)?,
    };
    if !any_missing {
        return (values.len() == rows).then_some(Cells::Numbers(NumberCells { values, missing }));
    }
    let mut left = values.into_iter();
    let spread = missing.iter().map(|code| if *code == PRESENT { left.next() } else { Some(0.0) });
    Some(Cells::Numbers(NumberCells { values: spread.collect::<Option<_>>()?, missing }))
}

fn take_runs(bytes: &mut Bytes<'_>, rows: usize) -> Option<Vec<u8>> {
    let mut codes = Vec::with_capacity(rows);
    for _ in 0..bytes.read_count()? {
        let end = codes.len().checked_add(bytes.read_count()?).filter(|end| *end <= rows)?;
        codes.resize(end, bytes.read_byte()?);
    }
    (codes.len() == rows).then_some(codes)
}

fn take_planes(bytes: &mut Bytes<'_>, count: usize) -> Option<Vec<f64>> {
    let planes = bytes.read_bytes(count.checked_mul(8)?)?;
    let value = |row: usize| f64::from_le_bytes(std::array::from_fn(|plane| planes[plane * count + row]));
    Some((0..count).map(value).collect())
}

fn decode_words(bytes: &mut Bytes<'_>, rows: usize) -> Option<WordCells> {
    let count = bytes.read_count()?;
    let words: Vec<Arc<str>> = (0..count).map(|_| bytes.read_text().map(Arc::from)).collect::<Option<_>>()?;
    let mut cells = WordCells { words, codes: Vec::with_capacity(rows), missing: Vec::with_capacity(rows) };
    for _ in 0..bytes.read_count()? {
        let end = cells.codes.len().checked_add(bytes.read_count()?).filter(|end| *end <= rows)?;
        let (code, missing) = match bytes.read_count()? {
            0 => (0, bytes.read_byte()?),
            word if word <= cells.words.len() => (u32::try_from(word - 1).ok()?, PRESENT),
            _ => return None,
        };
        cells.codes.resize(end, code);
        cells.missing.resize(end, missing);
    }
    (cells.codes.len() == rows).then_some(cells)
}
