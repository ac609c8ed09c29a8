//! A table written as text: the separator found, quotes understood, lines counted, every row bounded.

use super::cell::{Cell, is_absent, parse_flag, written_number};
use super::encoding::{Decoded, DetectedEncoding, detect_encoding};
use super::error::RecordingError;
use super::input::Input;
use super::limits::{COLUMNS_MAX, HEAD_BYTES, ROW_BYTES_MAX};
use super::moment::written_moment;
use super::note::{Note, NoteKind};
use super::separator::Separator;
use super::splitter::{SplitError, Splitter};
use super::table::{Row, Table, Visit, VisitStep};
use adapter_core::bilingual::Bilingual;
use std::io::Read;

/// What may stand before a text in UTF-8.
const UTF_8_MARK: &[u8] = b"\xef\xbb\xbf";

/// Tried in this order; the first of equally good ones is taken.
const CANDIDATES: [Separator; 5] =
    [Separator::Sign(b','), Separator::Sign(b';'), Separator::Sign(b'\t'), Separator::Sign(b'|'), Separator::Space];

/// Rows that are judged for a separator.
const JUDGED_ROWS: usize = 400;

#[derive(Debug)]
pub(super) struct TextTable {
    pub(super) input: Input,
    pub(super) encoding: DetectedEncoding,
    pub(super) separator: Separator,
    /// The encoding was said, not found.
    is_given: bool,
    /// A line `sep=;` stands before everything.
    separator_line: bool,
    /// Rows may leave out cells at their end.
    pub(super) short: bool,
    /// It stands in memory and is UTF-8 throughout.
    needs_no_decoding: bool,
}

impl TextTable {
    /// Looks how the text is written; what is given is not looked for.
    pub(super) fn new(
        input: Input,
        encoding: Option<&'static encoding_rs::Encoding>,
        separator: Option<Separator>,
    ) -> Result<Self, RecordingError> {
        let is_given = encoding.is_some();
        let encoding = match encoding {
            Some(encoding) => DetectedEncoding { encoding, has_mark: false },
            None => detect_encoding(&input)?,
        };
        let needs_no_decoding = encoding.encoding == encoding_rs::UTF_8
            && input.bytes_in_memory().is_some_and(|bytes| std::str::from_utf8(bytes).is_ok());
        let mut table = Self {
            input,
            encoding,
            separator: Separator::Sign(b','),
            is_given,
            separator_line: false,
            short: false,
            needs_no_decoding,
        };
        let head = table.read_head()?;
        let told = told_separator(&head);
        table.separator_line = told.is_some();
        table.separator = match separator.or(told) {
            Some(separator) => separator,
            None => best_separator(&head),
        };
        Ok(table)
    }

    /// The first characters, up to the end of a line.
    pub(super) fn read_head(&self) -> Result<String, RecordingError> {
        let mut head = Vec::new();
        let broken = |error| self.input.build_io_error(error);
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

    /// The text as it stands in memory, where nothing has to be decoded.
    fn text_in_memory(&self) -> Option<&[u8]> {
        let bytes = self.input.bytes_in_memory().filter(|_| self.needs_no_decoding)?;
        Some(bytes.strip_prefix(UTF_8_MARK).unwrap_or(bytes))
    }

    fn build_split_error(&self, error: SplitError) -> RecordingError {
        let line = match error {
            SplitError::TooLong(line) => line,
            SplitError::Visit(error) => return error,
        };
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
    Separator::from_text(sign)
}

fn best_separator(head: &str) -> Separator {
    let mut best = (0.0, Separator::Sign(b','));
    for separator in CANDIDATES {
        let score = score_separator(head, separator);
        if score > best.0 + 0.02 {
            best = (score, separator);
        }
    }
    best.1
}

/// How well a separator divides the text: the share of rows with the usual number of cells, times the share of their cells that mean
/// something. Zero where no row is divided.
fn score_separator(head: &str, separator: Separator) -> f64 {
    let mut rows: Vec<Vec<bool>> = Vec::new();
    let mut splitter = Splitter::new(separator);
    let done = splitter.feed_bytes(head.as_bytes(), true, &mut |_, cells| {
        rows.push(cells.iter().map(|cell| is_meant(*cell)).collect());
        Ok(if rows.len() < JUDGED_ROWS { VisitStep::Next } else { VisitStep::Enough })
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
fn is_meant(cell: Cell<'_>) -> bool {
    let Cell::Text(cell) = cell else { return true };
    is_absent(cell)
        || written_number(cell).is_some()
        || written_moment(cell).is_some()
        || parse_flag(cell).is_some()
        || !cell.contains([',', ';', '\t', '|'])
}

impl Table for TextTable {
    fn visit_rows(&self, see: &mut Visit<'_>) -> Result<(), RecordingError> {
        let mut splitter = Splitter::new(self.separator);
        let mut skip = self.separator_line;
        let mut see_row = |line: u64, cells: &[Cell<'_>]| {
            if std::mem::take(&mut skip) { Ok(VisitStep::Next) } else { see(&Row { line, cells }) }
        };
        if let Some(text) = self.text_in_memory() {
            splitter.feed_bytes(text, true, &mut see_row).map_err(|error| self.build_split_error(error))?;
            return Ok(());
        }
        let mut text = Decoded::new(self.input.open()?, self.encoding);
        let mut chunk = vec![0; 64 << 10];
        loop {
            let length = text.read(&mut chunk).map_err(|error| self.input.build_io_error(error))?;
            let step = splitter
                .feed_bytes(&chunk[..length], length == 0, &mut see_row)
                .map_err(|error| self.build_split_error(error))?;
            if length == 0 || matches!(step, VisitStep::Enough) {
                return Ok(());
            }
        }
    }

    fn describe_form(&self) -> Vec<Bilingual> {
        let mut form = Vec::new();
        let encoding = self.encoding.encoding;
        if encoding != encoding_rs::UTF_8 {
            form.push(Bilingual::new(format!("encoding {}", encoding.name()), format!("编码{}", encoding.name())));
        }
        if self.separator != Separator::Sign(b',') {
            form.push(self.separator.to_bilingual());
        }
        form
    }

    fn may_be_short(&self) -> bool {
        self.short
    }

    fn list_notes(&self) -> Vec<Note> {
        let encoding = self.encoding.encoding;
        if self.is_given || encoding != encoding_rs::SHIFT_JIS {
            return Vec::new();
        }
        let name = encoding.name();
        vec![Note::new(
            NoteKind::Doubt,
            format!(
                "the characters are read as {name}; if the names look wrong, say the encoding in a map (encoding = \"GBK\")"
            ),
            format!("字符按{name}读取；如列名有误，请在映射文件中指定编码（encoding = \"GBK\"）"),
        )]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(text: &str) -> (Separator, Vec<(u64, Vec<String>)>) {
        let table = TextTable::new(Input::from_memory(text.as_bytes().to_vec(), "t.csv"), None, None).expect("text");
        let mut rows = Vec::new();
        table
            .visit_rows(&mut |row| {
                let cells = row
                    .cells
                    .iter()
                    .map(|cell| if let Cell::Text(text) = cell { (*text).to_owned() } else { String::new() });
                rows.push((row.line, cells.collect()));
                Ok(VisitStep::Next)
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
            let input = Input::from_memory(text.into_bytes(), "t.csv");
            let table = TextTable::new(input, None, Some(Separator::Sign(b','))).expect("text");
            let error = table.visit_rows(&mut |_| Ok(VisitStep::Next)).expect_err("too long").to_string();
            assert!(error.contains(line) && error.contains("4 MB"), "{error}");
        }
    }
}
