//! Recordings as CSV, plain or gzipped. A malformed row is refused with file, line, column and reason.

use super::{Cells, Numbers, Recording, TEXT_COLUMNS, Words};
use crate::clock::{SECOND_NS, TimeNs};
use std::fmt;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use thiserror::Error;

/// At most this many refused rows are described; the rest is counted.
const PROBLEMS_KEPT: usize = 100;

/// Why a row was refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RowProblem {
    /// Line of the file, the header being line 1.
    pub line: u64,
    /// Column, where one cell is to blame.
    pub column: Option<String>,
    /// What is wrong and what was expected.
    pub reason: String,
}

impl fmt::Display for RowProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}", self.line)?;
        if let Some(column) = &self.column {
            write!(f, ", column {column}")?;
        }
        write!(f, ": {}", self.reason)
    }
}

/// What to do about a file that cannot be read.
fn next_step(error: &std::io::Error) -> &'static str {
    use std::io::ErrorKind::{InvalidData, InvalidInput, IsADirectory, UnexpectedEof};
    match error.kind() {
        UnexpectedEof => "The file ends too early: copy it again.",
        InvalidData | InvalidInput => "The file is damaged, or neither CSV in UTF-8 nor gzip: copy or export it again.",
        IsADirectory => "Name a file in it.",
        _ => "Check the path and the permissions.",
    }
}

/// Why a recording cannot be read at all.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file cannot be opened or read.
    #[error("{file}: {error}. {}", next_step(.error))]
    Io {
        /// The file.
        file: String,
        /// What the system said.
        error: std::io::Error,
    },
    /// The header makes the whole file unusable.
    #[error("{file}, line 1: {reason}")]
    Header {
        /// The file.
        file: String,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// No usable row.
    #[error("{file}: no usable row{}", first(.problems))]
    Empty {
        /// The file.
        file: String,
        /// The refused rows.
        problems: Vec<RowProblem>,
    },
}

fn first(problems: &[RowProblem]) -> String {
    problems.first().map(|problem| format!("; first problem: {problem}")).unwrap_or_default()
}

/// What was read, and what was refused.
#[derive(Debug)]
pub struct ReadRecording {
    /// The accepted rows.
    pub recording: Recording,
    /// The refused rows, at most a hundred of them described.
    pub problems: Vec<RowProblem>,
    /// How many rows were refused.
    pub refused: u64,
}

/// Reads a recording from a `.csv` or `.csv.gz` file.
///
/// # Errors
/// See [`RecordingError`]; single bad rows are no error but listed beside the recording.
pub fn read_path(path: &Path) -> Result<ReadRecording, RecordingError> {
    let file = path.display().to_string();
    let opened = File::open(path).map_err(|error| RecordingError::Io { file: file.clone(), error })?;
    let mut buffered = BufReader::with_capacity(1 << 16, opened);
    let start = buffered.fill_buf().map_err(|error| RecordingError::Io { file: file.clone(), error })?;
    if start.starts_with(&[0x1f, 0x8b]) {
        read_csv(flate2::bufread::MultiGzDecoder::new(buffered), &file)
    } else {
        read_csv(buffered, &file)
    }
}

/// Reads a recording from CSV text; `file` is its name for messages.
///
/// # Errors
/// See [`RecordingError`].
pub fn read_csv(input: impl Read, file: &str) -> Result<ReadRecording, RecordingError> {
    let mut reader = csv::ReaderBuilder::new().flexible(true).trim(csv::Trim::All).from_reader(input);
    let header = reader.headers().map_err(|error| unreadable(file, &error))?.clone();
    let mut table =
        CsvLayout::new(&header).map_err(|reason| RecordingError::Header { file: file.to_owned(), reason })?;
    let mut record = csv::StringRecord::new();
    loop {
        match reader.read_record(&mut record) {
            Ok(false) => break,
            Ok(true) => table.push(&record),
            Err(error) if error.is_io_error() => return Err(unreadable(file, &error)),
            Err(error) => table.refuse(line_of(&error), None, format!("{error}. The file must be UTF-8 text.")),
        }
    }
    table.finish(file)
}

fn unreadable(file: &str, error: &csv::Error) -> RecordingError {
    RecordingError::Io { file: file.to_owned(), error: std::io::Error::other(error.to_string()) }
}

fn line_of(error: &csv::Error) -> u64 {
    error.position().map_or(0, csv::Position::line)
}

/// What the cells of a column turned out to be.
enum CellType {
    /// Not seen a filled cell yet.
    Undecided,
    Numbers,
    Words,
}

struct Building {
    name: String,
    kind: CellType,
    numbers: Numbers,
    words: Words,
}

struct CsvLayout {
    time: usize,
    utc: bool,
    run: Option<usize>,
    columns: Vec<Building>,
    time_s: Vec<f64>,
    start_ns: Option<TimeNs>,
    last_run: String,
    problems: Vec<RowProblem>,
    refused: u64,
}

impl CsvLayout {
    fn new(header: &csv::StringRecord) -> Result<Self, String> {
        let names: Vec<&str> = header.iter().map(|name| name.trim_start_matches('\u{feff}')).collect();
        let position = |wanted: &str| names.iter().position(|name| *name == wanted);
        let (time, utc) = match (position("time_s"), position("time_utc")) {
            (_, Some(index)) => (index, true),
            (Some(index), None) => (index, false),
            (None, None) => return Err("no column time_s or time_utc; a recording needs one of them".to_owned()),
        };
        for (index, name) in names.iter().enumerate() {
            if name.is_empty() {
                return Err(format!("column {} has no name", index + 1));
            }
            if names[..index].contains(name) {
                return Err(format!("column {name} appears twice"));
            }
        }
        let columns = names.iter().map(|name| Building::new(name)).collect();
        let run = position("run");
        Ok(Self {
            time,
            utc,
            run,
            columns,
            time_s: Vec::new(),
            start_ns: None,
            last_run: String::new(),
            problems: Vec::new(),
            refused: 0,
        })
    }

    fn push(&mut self, record: &csv::StringRecord) {
        let line = record.position().map_or(0, csv::Position::line);
        if let Err((column, reason)) = self.accept(record) {
            self.refuse(line, column, reason);
        }
    }

    fn refuse(&mut self, line: u64, column: Option<String>, reason: String) {
        self.refused += 1;
        if self.problems.len() < PROBLEMS_KEPT {
            self.problems.push(RowProblem { line, column, reason });
        }
    }

    /// Takes the row as a whole or not at all.
    fn accept(&mut self, record: &csv::StringRecord) -> Result<(), (Option<String>, String)> {
        if record.len() != self.columns.len() {
            let reason = format!("{} cells where the header has {}", record.len(), self.columns.len());
            return Err((None, reason));
        }
        let time_s =
            self.time_of(&record[self.time]).map_err(|reason| (Some(self.columns[self.time].name.clone()), reason))?;
        let run = self.run.map_or("", |index| &record[index]);
        if let Some(last) = self.time_s.last().filter(|_| self.utc || run == self.last_run)
            && time_s < *last
        {
            return Err((
                Some(self.columns[self.time].name.clone()),
                format!("time goes back from {last} s to {time_s} s"),
            ));
        }
        for (building, cell) in self.columns.iter_mut().zip(record) {
            building.check(cell).map_err(|reason| (Some(building.name.clone()), reason))?;
        }
        self.columns.iter_mut().zip(record).for_each(|(building, cell)| building.push(cell));
        self.last_run.clear();
        self.last_run.push_str(run);
        self.time_s.push(time_s);
        Ok(())
    }

    fn time_of(&mut self, cell: &str) -> Result<f64, String> {
        if !self.utc {
            let time = cell.parse::<f64>().ok().filter(|time| time.is_finite());
            return time.ok_or_else(|| format!("{cell:?} is not a time in seconds"));
        }
        let stamp: jiff::Timestamp =
            cell.parse().map_err(|_| format!("{cell:?} is not a time like 2026-01-31T08:15:00.5Z (RFC 3339)"))?;
        let ns =
            i64::try_from(stamp.as_nanosecond()).map_err(|_| format!("{cell} is outside the years 1678 to 2261"))?;
        let start = *self.start_ns.get_or_insert(ns);
        #[expect(
            clippy::cast_precision_loss,
            reason = "a recording spans less than the 104 days a double counts exactly in ns; beyond that microseconds suffice"
        )]
        Ok((ns - start) as f64 / SECOND_NS as f64)
    }

    fn finish(self, file: &str) -> Result<ReadRecording, RecordingError> {
        if self.time_s.is_empty() {
            return Err(RecordingError::Empty { file: file.to_owned(), problems: self.problems });
        }
        let mut recording = Recording::new(file, self.time_s, self.start_ns);
        for (index, building) in self.columns.into_iter().enumerate() {
            if index != self.time && building.name != "time_s" {
                let (name, cells) = building.finish();
                recording.set_column(&name, cells);
            }
        }
        Ok(ReadRecording { recording, problems: self.problems, refused: self.refused })
    }
}

impl Building {
    fn new(name: &str) -> Self {
        let text = TEXT_COLUMNS.contains(&name) || name.ends_with("_missing") || name == "time_utc";
        let known = crate::channel::ChannelId::of(name).is_some();
        let kind = match (text, known) {
            (true, _) => CellType::Words,
            (false, true) => CellType::Numbers,
            (false, false) => CellType::Undecided,
        };
        Self { name: name.to_owned(), kind, numbers: Numbers::default(), words: Words::default() }
    }

    /// Would this cell fit? The first filled cell of an unknown column decides whether it holds numbers.
    fn check(&self, cell: &str) -> Result<(), String> {
        match self.kind {
            CellType::Numbers if !cell.is_empty() && number(cell).is_none() => Err(format!(
                "{cell:?} is not a finite number with a decimal point; leave the cell empty where there is no value"
            )),
            _ => Ok(()),
        }
    }

    fn push(&mut self, cell: &str) {
        if matches!(self.kind, CellType::Undecided) && !cell.is_empty() {
            self.kind = if number(cell).is_some() { CellType::Numbers } else { CellType::Words };
            // Every row so far was empty in both forms, so the other form can be dropped now.
        }
        match self.kind {
            CellType::Numbers => self.numbers.push(number(cell)),
            CellType::Words => self.words.push(cell),
            CellType::Undecided => {
                self.numbers.push(None);
                self.words.push("");
            }
        }
    }

    fn finish(self) -> (String, Cells) {
        let cells = match self.kind {
            CellType::Words => Cells::Words(self.words),
            CellType::Numbers | CellType::Undecided => Cells::Numbers(self.numbers),
        };
        (self.name, cells)
    }
}

fn number(cell: &str) -> Option<f64> {
    cell.parse::<f64>().ok().filter(|number| number.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<ReadRecording, RecordingError> {
        read_csv(text.as_bytes(), "t.csv")
    }

    #[test]
    fn a_bad_cell_refuses_its_row_with_line_and_column() {
        let got = read("time_s,spindle_power_w\n0,1\n1,abc\n2,\n").expect("readable");
        assert_eq!(got.recording.rows(), 2);
        assert_eq!(got.refused, 1);
        let problem = got.problems[0].to_string();
        assert!(problem.starts_with("line 3, column spindle_power_w: \"abc\""), "{problem}");
        assert_eq!(got.recording.numbers("spindle_power_w").map(|n| n.get(1)), Some(None));
    }

    #[test]
    fn time_may_restart_only_at_a_new_run() {
        let got = read("time_s,run,engaged\n0,a,1\n1,a,1\n0,a,1\n0,b,1\n").expect("readable");
        assert_eq!((got.recording.rows(), got.refused), (3, 1));
        assert_eq!(got.recording.runs().len(), 2);
        assert!(!got.recording.pauses_known());
    }

    #[test]
    fn utc_times_are_seconds_since_the_first_row() {
        let got = read("time_utc,x_v\n2026-01-31T08:15:00Z,1\n2026-01-31T08:15:02.5Z,2\n").expect("readable");
        assert_eq!(got.recording.time_s, vec![0.0, 2.5]);
        assert!(got.recording.start_ns.is_some() && got.recording.pauses_known());
    }

    #[test]
    fn numbers_in_text_columns_stay_text_and_unknown_columns_are_kept() {
        let got = read("time_s,run,pump_v,note\n0,1,,\n1,1,3.5,door open\n").expect("readable");
        let recording = got.recording;
        assert_eq!(recording.words("run").and_then(|words| words.get(0)), Some("1"));
        assert_eq!(recording.numbers("pump_v").and_then(|numbers| numbers.get(1)), Some(3.5));
        assert_eq!(recording.words("note").and_then(|words| words.get(1)), Some("door open"));
    }

    #[test]
    fn a_header_without_time_is_refused() {
        let error = read("a,b\n1,2\n").expect_err("no time").to_string();
        assert!(error.contains("time_s"), "{error}");
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_it_panic(text in "(time_s|time_utc|run|,|\n|[0-9.\"-]|\\PC){0,80}") {
            let _ = read(&text);
        }
    }
}
