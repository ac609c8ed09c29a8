//! Text on its way, divided into rows and cells: quotes are understood, lines are counted, every row is bounded.

use super::cell::Cell;
use super::error::RecordingError;
use super::limits::{COLUMNS_MAX, ROW_BYTES_MAX};
use super::separator::Separator;
use super::table::VisitStep;
use csv_core::ReadRecordResult;

pub(super) enum SplitError {
    TooLong(u64),
    Visit(RecordingError),
}

pub(super) type SeeCells<'v> = dyn FnMut(u64, &[Cell<'_>]) -> Result<VisitStep, RecordingError> + 'v;

/// Divides text into rows and cells, piece by piece.
pub(super) struct Splitter {
    separator: Separator,
    csv: csv_core::Reader,
    /// Text of the cells of the running row, and their ends in it.
    text: Vec<u8>,
    ends: Vec<usize>,
    filled: (usize, usize),
    /// Ends of lines so far.
    newlines: u64,
    /// Of a table without a sign between its cells: the running line.
    spaced: Vec<u8>,
}

impl Splitter {
    pub(super) fn new(separator: Separator) -> Self {
        let mut builder = csv_core::ReaderBuilder::new();
        if let Separator::Sign(sign) = separator {
            builder.delimiter(sign);
        }
        let (text, ends) = match separator {
            Separator::Sign(_) => (vec![0; 64 << 10], vec![0; COLUMNS_MAX + 1]),
            Separator::Space => (Vec::new(), Vec::new()),
        };
        Self { separator, csv: builder.build(), text, ends, filled: (0, 0), newlines: 0, spaced: Vec::new() }
    }

    pub(super) fn feed_bytes(
        &mut self,
        bytes: &[u8],
        last: bool,
        see: &mut SeeCells<'_>,
    ) -> Result<VisitStep, SplitError> {
        match self.separator {
            Separator::Sign(_) => {
                let step = self.feed_csv(bytes, see)?;
                if last && matches!(step, VisitStep::Next) && !bytes.is_empty() {
                    self.feed_csv(&[], see)
                } else {
                    Ok(step)
                }
            }
            Separator::Space => self.feed_spaced(bytes, last, see),
        }
    }

    /// An empty slice is the end.
    fn feed_csv(&mut self, mut bytes: &[u8], see: &mut SeeCells<'_>) -> Result<VisitStep, SplitError> {
        let at_end = bytes.is_empty();
        loop {
            if self.filled == (0, 0) {
                let (left, step) = self.feed_plain_rows(bytes, see)?;
                bytes = left;
                if matches!(step, VisitStep::Enough) {
                    return Ok(VisitStep::Enough);
                }
                if bytes.is_empty() && !at_end {
                    return Ok(VisitStep::Next);
                }
            }
            let (text, ends) = self.filled;
            let (result, read, written, ended) =
                self.csv.read_record(bytes, &mut self.text[text..], &mut self.ends[ends..]);
            let taken = &bytes[..read];
            bytes = &bytes[read..];
            self.filled = (text + written, ends + ended);
            self.newlines += taken.iter().filter(|byte| **byte == b'\n').count() as u64;
            match result {
                ReadRecordResult::InputEmpty => return Ok(VisitStep::Next),
                ReadRecordResult::OutputFull if self.text.len() < ROW_BYTES_MAX => {
                    let longer = (2 * self.text.len()).min(ROW_BYTES_MAX);
                    self.text.resize(longer, 0);
                }
                ReadRecordResult::OutputFull | ReadRecordResult::OutputEndsFull => {
                    return Err(SplitError::TooLong(self.newlines + 1));
                }
                ReadRecordResult::Record => {
                    // Before `\r\n` a row ends with the first of both, and at the end of the file with neither.
                    let end = self.newlines + u64::from(at_end || !taken.ends_with(b"\n"));
                    let step = self.emit_row(end, see)?;
                    self.filled = (0, 0);
                    if matches!(step, VisitStep::Enough) {
                        return Ok(VisitStep::Enough);
                    }
                }
                ReadRecordResult::End => return Ok(VisitStep::Next),
            }
        }
    }

    /// Rows that end within these bytes and hold no quote and no lone return: most rows of most files. What is left begins with another one.
    fn feed_plain_rows<'b>(
        &mut self,
        mut bytes: &'b [u8],
        see: &mut SeeCells<'_>,
    ) -> Result<(&'b [u8], VisitStep), SplitError> {
        let Separator::Sign(sign) = self.separator else { return Ok((bytes, VisitStep::Next)) };
        let mut cells: Vec<Cell<'b>> = Vec::new();
        while let Some(end) = memchr::memchr(b'\n', bytes) {
            let line = bytes[..end].strip_suffix(b"\r").unwrap_or(&bytes[..end]);
            if memchr::memchr2(b'"', b'\r', line).is_some() {
                break;
            }
            // The decoder gives UTF-8; what is none is left to the slow way.
            let Ok(text) = std::str::from_utf8(line) else { break };
            bytes = &bytes[end + 1..];
            self.newlines += 1;
            if text.is_empty() {
                continue;
            }
            cells.clear();
            let mut start = 0;
            for at in memchr::memchr_iter(sign, line) {
                cells.push(build_cell(&text[start..at]));
                start = at + 1;
            }
            cells.push(build_cell(&text[start..]));
            if cells.len() > COLUMNS_MAX {
                return Err(SplitError::TooLong(self.newlines));
            }
            if matches!(see(self.newlines, &cells).map_err(SplitError::Visit)?, VisitStep::Enough) {
                return Ok((bytes, VisitStep::Enough));
            }
        }
        Ok((bytes, VisitStep::Next))
    }

    fn emit_row(&self, end: u64, see: &mut SeeCells<'_>) -> Result<VisitStep, SplitError> {
        let (length, count) = self.filled;
        let text = String::from_utf8_lossy(&self.text[..length]);
        // A cell of replaced characters would move the ends; the decoder gives UTF-8, so nothing is replaced.
        if text.len() != length {
            return Ok(VisitStep::Next);
        }
        let mut start = 0;
        let mut cells = Vec::with_capacity(count);
        for end in &self.ends[..count] {
            cells.push(build_cell(text.get(start..*end).unwrap_or("")));
            start = *end;
        }
        let inner = text.matches('\n').count() as u64;
        see(end.saturating_sub(inner).max(1), &cells).map_err(SplitError::Visit)
    }

    fn feed_spaced(&mut self, bytes: &[u8], last: bool, see: &mut SeeCells<'_>) -> Result<VisitStep, SplitError> {
        for byte in bytes {
            if *byte != b'\n' {
                if self.spaced.len() >= ROW_BYTES_MAX {
                    return Err(SplitError::TooLong(self.newlines + 1));
                }
                self.spaced.push(*byte);
            } else if matches!(self.spaced_row(see)?, VisitStep::Enough) {
                return Ok(VisitStep::Enough);
            }
        }
        if last && !self.spaced.is_empty() { self.spaced_row(see) } else { Ok(VisitStep::Next) }
    }

    fn spaced_row(&mut self, see: &mut SeeCells<'_>) -> Result<VisitStep, SplitError> {
        let line = std::mem::take(&mut self.spaced);
        let text = String::from_utf8_lossy(&line);
        let cells = spaced_cells(text.trim());
        self.newlines += 1;
        let number = self.newlines;
        if cells.len() > COLUMNS_MAX {
            return Err(SplitError::TooLong(number));
        }
        if cells.is_empty() { Ok(VisitStep::Next) } else { see(number, &cells).map_err(SplitError::Visit) }
    }
}

/// Without the spaces of any script around it.
fn trim_cell(text: &str) -> &str {
    let is_plain = |byte: Option<&u8>| byte.is_none_or(u8::is_ascii_graphic);
    if is_plain(text.as_bytes().first()) && is_plain(text.as_bytes().last()) {
        return text;
    }
    text.trim_matches(['\u{feff}', ' ', '\t', '\r', '\n', '\u{a0}', '\u{3000}'])
}

fn build_cell(text: &str) -> Cell<'_> {
    let text = trim_cell(text);
    if text.is_empty() { Cell::Empty } else { Cell::Text(text) }
}

/// Cells between spaces; a quoted cell may hold spaces.
fn spaced_cells(text: &str) -> Vec<Cell<'_>> {
    let mut cells = Vec::new();
    let mut rest = text.trim_start();
    while !rest.is_empty() {
        let quoted = rest.strip_prefix('"').and_then(|inner| Some((inner, inner.find('"')?)));
        let (cell, next) = match quoted {
            Some((inner, end)) => (&inner[..end], &inner[end + 1..]),
            None => rest.split_at(rest.find(char::is_whitespace).unwrap_or(rest.len())),
        };
        cells.push(if cell.is_empty() { Cell::Empty } else { Cell::Text(cell) });
        rest = next.trim_start();
    }
    cells
}
