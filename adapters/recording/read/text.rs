//! A table written as text: the separator found, quotes understood, lines counted, every row bounded.

use super::cell::{Cell, flag, is_absent, written_number};
use super::encoding::{Decoded, TextEncoding, detect};
use super::error::RecordingError;
use super::input::Input;
use super::limits::{COLUMNS_MAX, HEAD_BYTES, ROW_BYTES_MAX};
use super::moment::written_moment;
use super::table::{Row, Step, Table, Visit};
use crate::bilingual::Bilingual;
use csv_core::ReadRecordResult;
use std::io::Read;

/// What stands between two cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Separator {
    /// This character.
    Sign(u8),
    /// Any number of spaces or tabs.
    Space,
}

/// Tried in this order; the first of equally good ones is taken.
const CANDIDATES: [Separator; 5] =
    [Separator::Sign(b','), Separator::Sign(b';'), Separator::Sign(b'\t'), Separator::Sign(b'|'), Separator::Space];

/// Rows that are judged for a separator.
const JUDGED_ROWS: usize = 400;

impl Separator {
    fn words(self) -> Bilingual {
        match self {
            Self::Sign(b',') => Bilingual::new("comma", "逗号分隔"),
            Self::Sign(b';') => Bilingual::new("semicolon", "分号分隔"),
            Self::Sign(b'\t') => Bilingual::new("tab", "制表符分隔"),
            Self::Sign(b'|') => Bilingual::new("bar |", "竖线分隔"),
            Self::Sign(other) => {
                let other = char::from(other);
                Bilingual::new(format!("separator {other}"), format!("分隔符{other}"))
            }
            Self::Space => Bilingual::new("spaces between the columns", "空格分隔"),
        }
    }

    /// From the text of a map; `None`: no separator.
    pub(super) fn named(text: &str) -> Option<Self> {
        match text {
            "space" | " " => Some(Self::Space),
            "tab" => Some(Self::Sign(b'\t')),
            _ => text
                .as_bytes()
                .first()
                .copied()
                .filter(|byte| text.len() == 1 && byte.is_ascii_punctuation() || *byte == b'\t')
                .map(Self::Sign),
        }
    }
}

/// See the [module](self).
#[derive(Debug)]
pub(super) struct TextTable {
    pub(super) input: Input,
    pub(super) encoding: TextEncoding,
    pub(super) separator: Separator,
    /// A line `sep=;` stands before everything.
    separator_line: bool,
    /// Rows may leave out cells at their end.
    pub(super) short: bool,
}

impl TextTable {
    /// Looks how the text is written; what is given is not looked for.
    pub(super) fn new(
        input: Input,
        encoding: Option<&'static encoding_rs::Encoding>,
        separator: Option<Separator>,
    ) -> Result<Self, RecordingError> {
        let encoding = match encoding {
            Some(encoding) => TextEncoding { encoding, has_mark: false },
            None => detect(&input)?,
        };
        let mut table = Self { input, encoding, separator: Separator::Sign(b','), separator_line: false, short: false };
        let head = table.head()?;
        let told = told_separator(&head);
        table.separator_line = told.is_some();
        table.separator = match separator.or(told) {
            Some(separator) => separator,
            None => best_separator(&head),
        };
        Ok(table)
    }

    /// The first characters, up to the end of a line.
    pub(super) fn head(&self) -> Result<String, RecordingError> {
        let mut head = Vec::new();
        let broken = |error| self.input.broken(error);
        Decoded::new(self.input.open()?, self.encoding)
            .take(HEAD_BYTES as u64)
            .read_to_end(&mut head)
            .map_err(broken)?;
        let is_all = head.len() < HEAD_BYTES;
        if let Some(end) = head.iter().rposition(|byte| *byte == b'\n').filter(|_| !is_all) {
            head.truncate(end + 1);
        }
        Ok(String::from_utf8_lossy(&head).into_owned())
    }

    fn too_long(&self, line: u64) -> RecordingError {
        let file = &self.input.file;
        RecordingError::Header {
            file: file.clone(),
            line,
            reason: Bilingual::new(
                format!(
                    "the row is longer than {} MB, or has more than {COLUMNS_MAX} columns; a quote that is never closed does that too: \
                     correct the row, or export fewer columns",
                    ROW_BYTES_MAX >> 20
                ),
                format!(
                    "该行超过{} MB或超过{COLUMNS_MAX}列；未闭合的引号也会造成这种情况：请改正该行，或减少导出的列",
                    ROW_BYTES_MAX >> 20
                ),
            ),
        }
    }
}

/// `sep=;`, as spreadsheets write it.
fn told_separator(head: &str) -> Option<Separator> {
    let line = head.lines().next()?.trim_matches('"');
    let sign = line.strip_prefix("sep=").or_else(|| line.strip_prefix("SEP="))?;
    Separator::named(sign)
}

fn best_separator(head: &str) -> Separator {
    let mut best = (0.0, Separator::Sign(b','));
    for separator in CANDIDATES {
        let score = score(head, separator);
        if score > best.0 + 0.02 {
            best = (score, separator);
        }
    }
    best.1
}

/// How well a separator divides the text: the share of rows with the usual number of cells, times the share of their cells that mean
/// something. Zero where no row is divided.
fn score(head: &str, separator: Separator) -> f64 {
    let mut rows: Vec<Vec<bool>> = Vec::new();
    let mut splitter = Splitter::new(separator);
    let done = splitter.feed(head.as_bytes(), true, &mut |_, cells| {
        rows.push(cells.iter().map(|cell| is_meant(cell)).collect());
        Ok(if rows.len() < JUDGED_ROWS { Step::Next } else { Step::Enough })
    });
    if done.is_err() || rows.is_empty() {
        return 0.0;
    }
    // The header may be anything; the data begin somewhere in the first half.
    let rows = &rows[rows.len() / 2..];
    let mut widths: Vec<usize> = rows.iter().map(Vec::len).collect();
    widths.sort_unstable();
    let usual = widths[widths.len() / 2];
    if usual < 2 {
        return 0.0;
    }
    let alike: Vec<&Vec<bool>> = rows.iter().filter(|row| row.len() == usual).collect();
    let meant = alike.iter().flat_map(|row| row.iter()).filter(|meant| **meant).count();
    #[expect(clippy::cast_precision_loss, reason = "some hundred rows")]
    let share = |part: usize, whole: usize| part as f64 / whole.max(1) as f64;
    share(alike.len(), rows.len()) * share(meant, alike.len() * usual)
}

/// Is this a number, a moment, a flag, nothing, or a word without any separator in it?
fn is_meant(cell: &str) -> bool {
    is_absent(cell)
        || written_number(cell).is_some()
        || written_moment(cell).is_some()
        || flag(cell).is_some()
        || !cell.contains([',', ';', '\t', '|'])
}

impl Table for TextTable {
    fn visit(&self, see: &mut Visit<'_>) -> Result<(), RecordingError> {
        let mut text = Decoded::new(self.input.open()?, self.encoding);
        let mut splitter = Splitter::new(self.separator);
        let mut chunk = vec![0; 64 << 10];
        let mut cells: Vec<Cell<'static>> = Vec::new();
        let mut skip = self.separator_line;
        loop {
            let length = text.read(&mut chunk).map_err(|error| self.input.broken(error))?;
            let fed = splitter.feed(&chunk[..length], length == 0, &mut |line, texts| {
                if std::mem::take(&mut skip) {
                    return Ok(Step::Next);
                }
                let mut row = recycled(std::mem::take(&mut cells));
                row.extend(texts.iter().map(|text| if text.is_empty() { Cell::Empty } else { Cell::Text(text) }));
                let step = see(&Row { line, cells: &row });
                cells = recycled(row);
                step
            });
            match fed {
                Ok(Step::Enough) => return Ok(()),
                Ok(Step::Next) if length == 0 => return Ok(()),
                Ok(Step::Next) => {}
                Err(SplitError::TooLong(line)) => return Err(self.too_long(line)),
                Err(SplitError::Visit(error)) => return Err(error),
            }
        }
    }

    fn form(&self) -> Vec<Bilingual> {
        let mut form = Vec::new();
        let encoding = self.encoding.encoding;
        if encoding != encoding_rs::UTF_8 {
            form.push(Bilingual::new(format!("encoding {}", encoding.name()), format!("编码{}", encoding.name())));
        }
        if self.separator != Separator::Sign(b',') {
            form.push(self.separator.words());
        }
        form
    }

    fn may_be_short(&self) -> bool {
        self.short
    }
}

/// The same allocation for cells of another life.
fn recycled<'a>(mut cells: Vec<Cell<'_>>) -> Vec<Cell<'a>> {
    cells.clear();
    cells.into_iter().map(|_| Cell::Empty).collect()
}

enum SplitError {
    TooLong(u64),
    Visit(RecordingError),
}

type SeeTexts<'v> = dyn FnMut(u64, &[&str]) -> Result<Step, RecordingError> + 'v;

/// Divides text into rows and cells, piece by piece.
struct Splitter {
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
    fn new(separator: Separator) -> Self {
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

    fn feed(&mut self, bytes: &[u8], last: bool, see: &mut SeeTexts<'_>) -> Result<Step, SplitError> {
        match self.separator {
            Separator::Sign(_) => {
                let step = self.feed_csv(bytes, see)?;
                if last && matches!(step, Step::Next) && !bytes.is_empty() { self.feed_csv(&[], see) } else { Ok(step) }
            }
            Separator::Space => self.feed_spaced(bytes, last, see),
        }
    }

    /// An empty slice is the end.
    fn feed_csv(&mut self, mut bytes: &[u8], see: &mut SeeTexts<'_>) -> Result<Step, SplitError> {
        let at_end = bytes.is_empty();
        loop {
            let (text, ends) = self.filled;
            let (result, read, written, ended) =
                self.csv.read_record(bytes, &mut self.text[text..], &mut self.ends[ends..]);
            let taken = &bytes[..read];
            bytes = &bytes[read..];
            self.filled = (text + written, ends + ended);
            self.newlines += taken.iter().filter(|byte| **byte == b'\n').count() as u64;
            match result {
                ReadRecordResult::InputEmpty => return Ok(Step::Next),
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
                    let step = self.row(end, see)?;
                    self.filled = (0, 0);
                    if matches!(step, Step::Enough) {
                        return Ok(Step::Enough);
                    }
                }
                ReadRecordResult::End => return Ok(Step::Next),
            }
        }
    }

    fn row(&self, end: u64, see: &mut SeeTexts<'_>) -> Result<Step, SplitError> {
        let (length, cells) = self.filled;
        let text = String::from_utf8_lossy(&self.text[..length]);
        // A cell of replaced characters would move the ends; the decoder gives UTF-8, so nothing is replaced.
        if text.len() != length {
            return Ok(Step::Next);
        }
        let mut start = 0;
        let mut texts = Vec::with_capacity(cells);
        for end in &self.ends[..cells] {
            texts.push(
                text.get(start..*end)
                    .unwrap_or("")
                    .trim_matches(['\u{feff}', ' ', '\t', '\r', '\n', '\u{a0}', '\u{3000}']),
            );
            start = *end;
        }
        let inner = text.matches('\n').count() as u64;
        see(end.saturating_sub(inner).max(1), &texts).map_err(SplitError::Visit)
    }

    fn feed_spaced(&mut self, bytes: &[u8], last: bool, see: &mut SeeTexts<'_>) -> Result<Step, SplitError> {
        for byte in bytes {
            if *byte != b'\n' {
                if self.spaced.len() >= ROW_BYTES_MAX {
                    return Err(SplitError::TooLong(self.newlines + 1));
                }
                self.spaced.push(*byte);
            } else if matches!(self.spaced_row(see)?, Step::Enough) {
                return Ok(Step::Enough);
            }
        }
        if last && !self.spaced.is_empty() { self.spaced_row(see) } else { Ok(Step::Next) }
    }

    fn spaced_row(&mut self, see: &mut SeeTexts<'_>) -> Result<Step, SplitError> {
        let line = std::mem::take(&mut self.spaced);
        let text = String::from_utf8_lossy(&line);
        let cells = spaced_cells(text.trim());
        self.newlines += 1;
        let number = self.newlines;
        if cells.len() > COLUMNS_MAX {
            return Err(SplitError::TooLong(number));
        }
        if cells.is_empty() { Ok(Step::Next) } else { see(number, &cells).map_err(SplitError::Visit) }
    }
}

/// Cells between spaces; a quoted cell may hold spaces.
fn spaced_cells(text: &str) -> Vec<&str> {
    let mut cells = Vec::new();
    let mut rest = text.trim_start();
    while !rest.is_empty() {
        let quoted = rest.strip_prefix('"').and_then(|inner| Some((inner, inner.find('"')?)));
        let (cell, next) = match quoted {
            Some((inner, end)) => (&inner[..end], &inner[end + 1..]),
            None => rest.split_at(rest.find(char::is_whitespace).unwrap_or(rest.len())),
        };
        cells.push(cell);
        rest = next.trim_start();
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(text: &str) -> (Separator, Vec<(u64, Vec<String>)>) {
        let table = TextTable::new(Input::memory(text.as_bytes().to_vec(), "t.csv"), None, None).expect("text");
        let mut rows = Vec::new();
        table
            .visit(&mut |row| {
                let cells = row
                    .cells
                    .iter()
                    .map(|cell| if let Cell::Text(text) = cell { (*text).to_owned() } else { String::new() });
                rows.push((row.line, cells.collect()));
                Ok(Step::Next)
            })
            .expect("read");
        (table.separator, rows)
    }

    #[test]
    fn the_separator_follows_from_the_data() {
        assert_eq!(rows("time_s,a\n0,1.5\n1,2.5\n").0, Separator::Sign(b','));
        assert_eq!(rows("time_s;a\n0,0;1,5\n1,0;2,5\n").0, Separator::Sign(b';'));
        assert_eq!(rows("t\ta\n0,0\t1,5\n1,0\t2,5\n").0, Separator::Sign(b'\t'));
        assert_eq!(rows("# t a\n0.0 1.5\n1.0 2.5\n").0, Separator::Space);
        assert_eq!(rows("sep=;\na;b,c\n1;2\n").0, Separator::Sign(b';'));
        assert_eq!(rows("time_s,run\n0,a b\n1,a b\n").0, Separator::Sign(b','));
    }

    #[test]
    fn lines_are_counted_through_blank_lines_and_quotes() {
        let (_, rows) = rows("a,b\n\n1,\"x\ny\"\n2,3\n\n\n4,5");
        let lines: Vec<u64> = rows.iter().map(|(line, _)| *line).collect();
        assert_eq!(lines, [1, 3, 5, 8]);
        assert_eq!(rows[1].1, ["1", "x\ny"]);
    }

    #[test]
    fn no_row_fills_the_memory() {
        let endless = format!("time_s,a\n0,\"{}", "x".repeat(ROW_BYTES_MAX + 10));
        let wide = format!("time_s{}\n", ",a".repeat(COLUMNS_MAX + 5));
        for (text, line) in [(endless, "line 2"), (wide, "line 1")] {
            let input = Input::memory(text.into_bytes(), "t.csv");
            let table = TextTable::new(input, None, Some(Separator::Sign(b','))).expect("text");
            let error = table.visit(&mut |_| Ok(Step::Next)).expect_err("too long").to_string();
            assert!(error.contains(line) && error.contains("4 MB"), "{error}");
        }
    }
}
