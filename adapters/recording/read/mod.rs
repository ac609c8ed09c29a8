//! Reading a recording from any file that people have.
//!
//! Every cell of a file is counted (`survey`); then it is decided, with all of the file known, what each column is (`understand`, `clock`,
//! `names`). The rows are taken (`assemble`) in the same pass, under a guess from the first of them (`one_pass`); where another plan is
//! decided than was guessed, they are taken a second time. So no single cell can change what a column is, and nothing is decided without a
//! sentence in [`ReadRecording::notes`]. A file that is written as `recording/1` says is read as it stands
//! there. A [`Mapping`] overrides every assumption.
//!
//! | file | what |
//! |---|---|
//! | `input`, `encoding`, `separator`, `splitter`, `text` | bytes, characters, rows of cells |
//! | `formats` | workbooks, LabVIEW, MATLAB, MTConnect, Parquet as the same rows of cells |
//! | `head`, `head_form` | where the data begin, which line names the columns, which holds units; heads of known programs |
//! | `long` | one line for each value, turned into columns |
//! | `cell`, `plain_number`, `cell_unit`, `moment`, `compact_moment` | what one cell may be |
//! | `survey`, `understand`, `targets`, `clock`, `numeric_time`, `names` | what a column is |
//! | `row_class`, `one_pass`, `assemble`, `column_builder`, `row_times`, `time`, `restart`, `merge` | rows, time, tests one after the other, several clocks in one file |
//! | `preview` | how a file is understood, for a person and for a map |
//! | `limits`, `note` | how much is taken at most; a sentence to the user |

mod assemble;
pub mod cell;
mod cell_unit;
mod clock;
mod column_builder;
mod compact_moment;
mod convert;
pub(super) mod encoding;
pub(super) mod error;
mod formats;
mod head;
mod head_form;
pub(super) mod input;
pub(super) mod limits;
mod long;
pub(super) mod mapping;
mod merge;
mod moment;
pub mod names;
pub(super) mod note;
mod numeric_time;
mod one_pass;
mod plain_number;
mod plan;
mod preview;
mod repeated_stamps;
mod restart;
mod row_class;
mod row_times;
mod separator;
mod splitter;
mod survey;
pub(super) mod table;
mod targets;
pub(super) mod text;
mod time;
mod understand;

pub use error::{RecordingError, RowProblem};
pub use preview::{ColumnPreview, Preview, TimePreview, find_difference, preview_recording, preview_rows};

use super::Recording;

use adapter_core::bilingual::Bilingual;
use assemble::Assembled;
use head::Head;
use input::Input;
use mapping::Mapping;
use note::{Note, NoteKind};
use one_pass::{CountedTable, count_cells};
use plan::ReadPlan;
use std::io::Read;
use std::path::Path;
use survey::Survey;
use table::Table;

/// What was read, and what was refused.
#[derive(Debug)]
pub struct ReadRecording {
    /// The rows that were accepted.
    pub recording: Recording,
    /// The refused rows, at most a hundred of them described.
    pub problems: Vec<RowProblem>,
    /// How many rows were refused.
    pub refused: u64,
    /// How the file was understood, and what of it was not used. Empty for a file that is written as the contract says.
    pub notes: Vec<Note>,
}

impl ReadRecording {
    /// How the file was taken to be written, in one line; empty where nothing had to be assumed.
    #[must_use]
    pub fn describe_assumptions(&self) -> Bilingual {
        let of = |pick: fn(&Bilingual) -> &str, between: &str| {
            let assumed = self.notes.iter().filter(|note| note.kind == NoteKind::Assumption);
            assumed.map(|note| pick(&note.text).to_owned()).collect::<Vec<_>>().join(between)
        };
        Bilingual::new(of(|text| &text.en, ", "), of(|text| &text.zh, "，"))
    }
}

/// Reads a recording from a file of any format that is known, under the map beside it (`FILE.map.toml`) where there is one.
///
/// # Errors
/// See [`RecordingError`]; single bad rows are no error but listed beside the recording.
pub fn read_path(path: &Path) -> Result<ReadRecording, RecordingError> {
    let beside = Mapping::build_path_beside(path);
    if !beside.is_file() {
        return read_path_as(path, &Mapping::default());
    }
    let mapping = Mapping::read(&beside).map_err(|wrong| RecordingError::Format {
        file: wrong.file,
        reason: Bilingual::new(wrong.reason.clone(), wrong.reason),
    })?;
    let mut read = read_path_as(path, &mapping)?;
    let name = beside.file_name().unwrap_or_default().to_string_lossy();
    read.notes.insert(0, Note::new(NoteKind::Assumption, format!("map {name}"), format!("映射文件{name}")));
    Ok(read)
}

/// Reads a recording under a map.
///
/// # Errors
/// See [`RecordingError`].
pub fn read_path_as(path: &Path, mapping: &Mapping) -> Result<ReadRecording, RecordingError> {
    read_input(Input::from_path(path), mapping)
}

/// Reads a recording from CSV text; `file` is its name for messages.
///
/// # Errors
/// See [`RecordingError`].
pub fn read_csv(mut input: impl Read, file: &str) -> Result<ReadRecording, RecordingError> {
    let mut bytes = Vec::new();
    input.read_to_end(&mut bytes).map_err(|error| RecordingError::Io { file: file.to_owned(), error })?;
    read_input(Input::from_memory(bytes, file), &Mapping::default())
}

fn read_input(input: Input, mapping: &Mapping) -> Result<ReadRecording, RecordingError> {
    let file = input.file.clone();
    let UnderstoodTable { table, head, plan, recordings, .. } = understand_input(input, mapping)?;
    let plan = plan?;
    let rows = read_planned(table.as_ref(), &head, &plan, recordings, mapping, &file)?;
    Ok(rows.with_notes(&plan.notes))
}

/// A table and how it is to be read.
struct UnderstoodTable {
    table: Box<dyn Table>,
    head: Head,
    survey: Survey,
    plan: Result<ReadPlan, RecordingError>,
    /// Its rows under this plan, where they have been taken already.
    recordings: Option<Assembled>,
}

impl UnderstoodTable {
    fn new(table: Box<dyn Table>, head: Head, counted: CountedTable, mapping: &Mapping, file: &str) -> Self {
        let plan = understand::build_plan(&head, &counted.survey, mapping, file);
        let CountedTable { survey, rows } = counted;
        let recordings = plan.as_ref().ok().and_then(|plan| rows?.take_under(&plan.blocks));
        Self { table, head, survey, plan, recordings }
    }
}

/// Head and plan of a file; a table that has a line for each value is turned first.
fn understand_input(input: Input, mapping: &Mapping) -> Result<UnderstoodTable, RecordingError> {
    let file = input.file.clone();
    let table = formats::open_table(input, mapping)?;
    let head = head::find_head(table.as_ref(), head::GivenHead::from_mapping(mapping), &file)?;
    let counted = count_cells(table.as_ref(), &head, mapping, &file)?;
    if let Some(turned) = long::turn_table(table.as_ref(), &head, &counted.survey, &file)? {
        let head = head::find_head(&turned, head::GivenHead::default(), &file)?;
        let counted = count_cells(&turned, &head, mapping, &file)?;
        return Ok(UnderstoodTable::new(Box::new(turned), head, counted, mapping, &file));
    }
    Ok(UnderstoodTable::new(table, head, counted, mapping, &file))
}

/// The rows of a table under a plan, and what is to be said of them besides the notes of the plan.
#[derive(Debug)]
struct PlannedRows {
    recording: Recording,
    problems: Vec<RowProblem>,
    refused_rows: u64,
    /// How the table is written,
    form: Vec<Note>,
    /// and what was met among its rows.
    row_notes: Vec<Note>,
}

impl PlannedRows {
    fn with_notes(self, of_plan: &[Note]) -> ReadRecording {
        let notes = join_notes([&self.form, of_plan, &self.row_notes]);
        ReadRecording { recording: self.recording, problems: self.problems, refused: self.refused_rows, notes }
    }
}

/// Notes about the form of a file, its columns and its rows. The same of every clock of the file is said once.
fn join_notes(parts: [&[Note]; 3]) -> Vec<Note> {
    let mut notes: Vec<Note> = Vec::new();
    for note in parts.into_iter().flatten() {
        if !notes.contains(note) {
            notes.push(note.clone());
        }
    }
    notes
}

/// Rows of a table under its plan.
fn read_planned(
    table: &dyn Table,
    head: &Head,
    plan: &ReadPlan,
    assembled: Option<Assembled>,
    mapping: &Mapping,
    file: &str,
) -> Result<PlannedRows, RecordingError> {
    let mut done = match assembled {
        Some(done) => done,
        None => assemble::assemble_recordings(table, head, &plan.blocks, mapping, file)?,
    };
    let together = mapping.time.clocks.as_deref() == Some("rows");
    let mut form: Vec<Note> =
        table.describe_form().into_iter().map(|text| Note { kind: NoteKind::Assumption, text }).collect();
    form.extend(table.list_notes());
    let recording = merge::merge_blocks(std::mem::take(&mut done.blocks), together, &mut done.notes);
    if recording.count_rows() == 0 {
        return Err(RecordingError::Empty { file: file.to_owned(), problems: done.problems });
    }
    Ok(PlannedRows { recording, problems: done.problems, refused_rows: done.refused, form, row_notes: done.notes })
}

#[cfg(test)]
mod one_pass_tests;
#[cfg(test)]
mod stranger_tests;
#[cfg(test)]
mod tests;
