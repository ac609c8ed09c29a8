//! A map that a foreign file is proposed: what is sure is taken, what is not is a question, and the file says why.

use adapter_core::bilingual::Bilingual;
use adapter_core::channel::quantity::unit_of;
use recording::read::{ColumnPreview, Preview, TimePreview, find_difference, preview_recording, preview_rows};
use recording::{ColumnMapping, Mapping, Recording};
use rules::twin::format_toml_text;
use std::fmt::Write as _;
use std::path::Path;

/// One column of a proposal.
#[derive(Debug, Clone, PartialEq)]
pub struct ProposedColumn {
    /// How the map names it.
    pub from: String,
    /// Its name in the file.
    pub name: String,
    /// What it becomes; `None`: it keeps its name; empty: it is left out.
    pub to: Option<String>,
    /// Its unit, where the file does not say it or a person says another one.
    pub unit: Option<String>,
    /// What it may be, where that is not sure.
    pub candidates: Vec<&'static str>,
    /// It holds the time.
    pub is_time: bool,
}

/// Why a proposed map is not written.
#[derive(Debug, thiserror::Error)]
pub enum ProposalError {
    /// It is no map.
    #[error("the map would not be valid: {0}")]
    Invalid(#[from] recording::MappingError),
    /// The file reads otherwise under it than without it.
    #[error("no map is written: under it the file would be read otherwise ({0}); it is read without a map")]
    ReadsOtherwise(Bilingual),
}

/// Reads a file back under the map that is proposed for it, before it is kept. A map under which a file that can be read is read otherwise, in
/// rows, times or in any column of which a person has not said what it is, is refused.
///
/// # Errors
/// See [`ProposalError`].
pub fn verify_proposal(path: &Path, toml: &str, found: Preview, answered: &[String]) -> Result<Preview, ProposalError> {
    let mapping = Mapping::parse(toml, "map")?;
    // A map that makes the same of every column needs no second reading.
    let found = match found.keep_rows_under(&mapping) {
        Ok(after) => return Ok(after),
        Err(found) => found,
    };
    let otherwise = |error: &recording::RecordingError| {
        ProposalError::ReadsOtherwise(Bilingual::new(error.to_string(), error.describe_in_chinese()))
    };
    let after = preview_recording(path, &mapping).map_err(|error| otherwise(&error))?;
    match (&found.read, &after.read) {
        (Ok(before), Ok(read)) => match find_difference(before, read, answered) {
            Some(difference) => Err(ProposalError::ReadsOtherwise(difference)),
            None => Ok(after),
        },
        (Ok(_), Err(error)) => Err(otherwise(error)),
        // What cannot be read without a map is no worse with one.
        (Err(_), _) => Ok(after),
    }
}

/// How the columns of a file could be read, before a person has confirmed it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MapProposal {
    /// The columns in the order of the file.
    pub columns: Vec<ProposedColumn>,
    /// The column of time, where a person said it.
    pub time: Option<String>,
    /// Seconds from one row to the next, where a person said that there is no column of time.
    pub step: Option<f64>,
    /// Where the time was found.
    pub time_preview: TimePreview,
    /// The map under which the file was looked at: what it says stays.
    pub base: Mapping,
}

impl MapProposal {
    /// From how a file is understood.
    #[must_use]
    pub fn from_preview(preview: &Preview, base: &Mapping) -> Self {
        let column = |column: &ColumnPreview| {
            let sure = column
                .to
                .clone()
                .filter(|to| *to != column.name || unit_of(to).is_some() || column.candidates.is_empty());
            let keeps_name = sure.as_deref().is_none_or(|to| to.starts_with(column.name.as_str()));
            let candidates = if !keeps_name { Vec::new() } else { column.candidates.clone() };
            let to = sure.or_else(|| column.to.clone());
            ProposedColumn {
                from: column.from.clone(),
                name: column.name.clone(),
                to,
                unit: None,
                candidates,
                is_time: column.is_time,
            }
        };
        Self {
            columns: preview.columns.iter().filter(|column| !column.name.is_empty()).map(column).collect(),
            time: None,
            step: None,
            time_preview: preview.time.clone(),
            base: base.clone(),
        }
    }

    /// Columns that a person has to decide about.
    #[must_use]
    pub fn open_questions(&self) -> Vec<usize> {
        let is_question = |column: &ProposedColumn| {
            let kept = column.to.as_deref().is_none_or(|to| to.starts_with(column.name.as_str()));
            let is_said = self.base.column.iter().any(|said| said.from == column.from);
            !column.is_time && !is_said && kept && column.candidates.iter().any(|candidate| *candidate != column.name)
        };
        (0..self.columns.len()).filter(|index| is_question(&self.columns[*index])).collect()
    }

    /// The map as TOML, with a word about each line in both languages.
    #[must_use]
    pub fn to_toml(&self, statement: &Bilingual, file: &str) -> String {
        let mut text = format!(
            "# Map of {file}: how it is read. What stands here is not guessed.\n# {file}的映射：如何读取该文件。此处写明的内容不再猜测。\n"
        );
        if !statement.en.is_empty() {
            let _ = write!(text, "# Assumed: {}\n# 假设：{}\n", statement.en, statement.zh);
        }
        text.push_str(
            "# encoding = \"GBK\"      separator = \";\"      decimal = \",\"      header_line = 3      units_line = 4      sheet = \"Data\"\n\
             # names = [\"time_s\", \"spindle_speed_rpm\"]\nschema = \"map/1\"\n",
        );
        text.push_str(&form_toml(&self.base));
        text.push_str(
            "\n[time]\n# unit = \"ms\"      zone = \"Europe/Berlin\"      order = \"dmy\"      clocks = \"rows\"      set_back = \"join\"      step = 0.1\n",
        );
        text.push_str(&self.time_toml());
        let is_time = |column: &ProposedColumn| column.is_time || Some(&column.from) == self.time.as_ref();
        for column in self.columns.iter().filter(|column| !is_time(column)) {
            text.push_str(&column_toml(column, self.base.column.iter().find(|said| said.from == column.from)));
        }
        for clock in &self.base.clock {
            let columns: Vec<String> = clock.columns.iter().map(|name| format_toml_text(name)).collect();
            let _ = write!(text, "\n[[clock]]\ncolumns = [{}]\n", columns.join(", "));
            push_text(&mut text, "time", clock.time.as_deref());
            push_number(&mut text, "step", clock.step);
        }
        text
    }

    /// What a person said, else what the map said under which the file was looked at, else what was found.
    fn time_toml(&self) -> String {
        let said = &self.base.time;
        let mut text = String::new();
        let step = self.step.or(said.step).filter(|_| self.time.is_none());
        if let Some(step_s) = step {
            push_number(&mut text, "step", Some(step_s));
            push_text(&mut text, "start", said.start.as_deref());
        } else if let Some(time) = &self.time {
            push_text(&mut text, "column", Some(time));
        } else {
            push_text(&mut text, "column", self.time_preview.column.as_deref());
            push_text(&mut text, "date", self.time_preview.date.as_deref());
            push_text(&mut text, "clock", self.time_preview.clock.as_deref());
        }
        for (key, value) in [
            ("unit", &said.unit),
            ("zone", &said.zone),
            ("order", &said.order),
            ("clocks", &said.clocks),
            ("set_back", &said.set_back),
        ] {
            push_text(&mut text, key, value.as_deref());
        }
        text
    }
}

/// What a map says of how the file is written.
fn form_toml(base: &Mapping) -> String {
    let mut text = String::new();
    push_text(&mut text, "encoding", base.encoding.as_deref());
    push_text(&mut text, "separator", base.separator.as_deref());
    push_text(&mut text, "decimal", base.decimal.map(String::from).as_deref());
    for (key, line) in [("header_line", base.header_line), ("units_line", base.units_line)] {
        if let Some(line) = line {
            let _ = writeln!(text, "{key} = {line}");
        }
    }
    push_text(&mut text, "sheet", base.sheet.as_deref());
    if !base.names.is_empty() {
        let names: Vec<String> = base.names.iter().map(|name| format_toml_text(name)).collect();
        let _ = writeln!(text, "names = [{}]", names.join(", "));
    }
    text
}

fn push_text(text: &mut String, key: &str, value: Option<&str>) {
    if let Some(value) = value {
        let _ = writeln!(text, "{key} = {}", format_toml_text(value));
    }
}

/// A number in full: Rust writes the shortest text that reads back as the same number, and TOML wants a point in it.
fn push_number(text: &mut String, key: &str, value: Option<f64>) {
    if let Some(value) = value {
        let _ = writeln!(text, "{key} = {value:?}");
    }
}

fn column_toml(column: &ProposedColumn, said: Option<&ColumnMapping>) -> String {
    let to = column.to.as_deref().unwrap_or(&column.name);
    let mut text = format!("\n[[column]]\nfrom = {}\nto = {}\n", format_toml_text(&column.from), format_toml_text(to));
    push_text(&mut text, "unit", column.unit.as_deref().or_else(|| said?.unit.as_deref()));
    push_number(&mut text, "scale", said.and_then(|said| said.scale));
    push_number(&mut text, "offset", said.and_then(|said| said.offset));
    let others: Vec<&str> = column.candidates.iter().copied().filter(|candidate| *candidate != to).collect();
    if !others.is_empty() {
        let _ = writeln!(text, "# may be / 可能是: {}", others.join(", "));
    }
    text
}

/// The first rows as understood: a table of at most so many columns.
#[must_use]
pub fn first_rows(recording: &Recording, rows: usize, columns: usize) -> String {
    let (head, rows) = preview_rows(recording, rows);
    let mut lines: Vec<Vec<String>> = std::iter::once(head).chain(rows).collect();
    lines.iter_mut().for_each(|line| line.truncate(columns + 1));
    let width = |index: usize| lines.iter().map(|line| line[index].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..lines[0].len()).map(width).collect();
    let mut text = String::new();
    for line in &lines {
        for (cell, width) in line.iter().zip(&widths) {
            let room = width.saturating_sub(cell.chars().count());
            let _ = write!(text, "  {cell}{}", " ".repeat(room));
        }
        text.push('\n');
    }
    text
}
