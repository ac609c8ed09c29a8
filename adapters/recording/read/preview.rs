//! How a file is understood, before anything is done with it: each column with what it becomes, what else it may be, and its first values.

use super::error::RecordingError;
use super::head::Head;
use super::input::Input;
use super::mapping::Mapping;
use super::names::ForeignName;
use super::note::Note;
use super::plan::{BlockPlan, ReadPlan, TimePlan};
use super::survey::Survey;
use super::understand::build_plan;
use super::{ReadRecording, UnderstoodTable, join_notes, read_planned, understand_input};
use crate::{Cells, Column, Recording};
use adapter_core::bilingual::Bilingual;
use std::path::Path;

/// One column of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct ColumnPreview {
    /// How a map names it: its name in the file, or `#3` where it has none or stands there more than once.
    pub from: String,
    /// Its name in the file.
    pub name: String,
    /// Its unit there, where the file says one.
    pub unit: Option<String>,
    /// Its name in the recording, where it is part of it.
    pub to: Option<String>,
    /// Columns of ours that it may be, the likeliest first.
    pub candidates: Vec<&'static str>,
    /// It holds the time, or a part of it.
    pub is_time: bool,
}

/// Where the time of a file was found, as a map says it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TimePreview {
    /// The column of time,
    pub column: Option<String>,
    /// or that of the date
    pub date: Option<String>,
    /// and that of the time of day.
    pub clock: Option<String>,
}

/// How a file is understood.
#[derive(Debug)]
pub struct Preview {
    /// The columns in the order of the file.
    pub columns: Vec<ColumnPreview>,
    /// Where the time is.
    pub time: TimePreview,
    /// The file as read, or why it cannot be.
    pub read: Result<ReadRecording, RecordingError>,
    basis: Option<PreviewBasis>,
}

/// What the rows of a preview follow from: the cells that were counted, and what was made of them.
#[derive(Debug)]
struct PreviewBasis {
    file: String,
    mapping: Mapping,
    head: Head,
    survey: Survey,
    blocks: Vec<BlockPlan>,
    form: Vec<Note>,
    row_notes: Vec<Note>,
}

impl PreviewBasis {
    /// What is made of the counted cells under another map; `None` where its rows may be others.
    fn plan_same_rows(&self, mapping: &Mapping) -> Option<ReadPlan> {
        let opens_alike = self.mapping.without_plan() == mapping.without_plan();
        let plan = opens_alike.then(|| build_plan(&self.head, &self.survey, mapping, &self.file).ok())??;
        (plan.blocks == self.blocks).then_some(plan)
    }
}

impl Preview {
    /// The file under another map, without reading it again.
    ///
    /// # Errors
    /// The preview as it is, where another reading may come to other rows.
    pub fn keep_rows_under(mut self, mapping: &Mapping) -> Result<Self, Box<Self>> {
        let Some((basis, plan)) = self.basis.as_ref().and_then(|basis| Some((basis, basis.plan_same_rows(mapping)?)))
        else {
            return Err(Box::new(self));
        };
        if let Ok(read) = &mut self.read {
            read.notes = join_notes([&basis.form, &plan.notes, &basis.row_notes]);
        }
        Ok(self)
    }
}

/// Looks at a file under a map.
///
/// # Errors
/// Its columns cannot be told at all.
pub fn preview_recording(path: &Path, mapping: &Mapping) -> Result<Preview, RecordingError> {
    let input = Input::from_path(path);
    let file = input.file.clone();
    let UnderstoodTable { table, head, survey, plan, recordings } = understand_input(input, mapping)?;
    let plan = match plan {
        Ok(plan) => plan,
        Err(error) => return Ok(describe_columns(&head, &[], Err(error))),
    };
    let rows = read_planned(table.as_ref(), &head, &plan, recordings, mapping, &file);
    let said = rows.as_ref().map(|rows| (rows.form.clone(), rows.row_notes.clone())).ok();
    let preview = describe_columns(&head, &plan.blocks, rows.map(|rows| rows.with_notes(&plan.notes)));
    let basis = said.map(|(form, row_notes)| PreviewBasis {
        file,
        mapping: mapping.clone(),
        head,
        survey,
        blocks: plan.blocks,
        form,
        row_notes,
    });
    Ok(Preview { basis, ..preview })
}

fn describe_columns(head: &Head, blocks: &[BlockPlan], read: Result<ReadRecording, RecordingError>) -> Preview {
    let names = &head.names;
    let columns = (0..names.len())
        .map(|index| {
            let name = ForeignName::from_text(&names[index], head.units[index].as_deref());
            let planned = blocks.iter().flat_map(|block| &block.columns).find(|column| column.index == index);
            let is_time = blocks.iter().any(|block| block.time.uses_column(index));
            ColumnPreview {
                from: name_for_map(names, index, is_time),
                name: name.text.clone(),
                unit: name.unit.clone(),
                to: planned.map(|column| column.name.clone()),
                candidates: name.list_candidates(),
                is_time,
            }
        })
        .collect();
    let time = blocks.first().map_or_else(TimePreview::default, |block| preview_time(names, &block.time));
    Preview { columns, time, read, basis: None }
}

/// A name that stands there once says which column is meant; a column of time that is repeated is a clock of its own each time.
fn name_for_map(names: &[String], index: usize, is_time: bool) -> String {
    let stands_again = names.iter().filter(|name| **name == names[index]).count() > 1;
    let is_first = names.iter().position(|name| *name == names[index]) == Some(index);
    let is_plain = !names[index].is_empty() && (!stands_again || is_time && is_first);
    if is_plain { names[index].clone() } else { format!("#{}", index + 1) }
}

fn preview_time(names: &[String], time: &TimePlan) -> TimePreview {
    let name = |index: Option<usize>| index.map(|index| name_for_map(names, index, true));
    match time.date {
        Some(_) => TimePreview { column: None, date: name(time.date), clock: name(time.index) },
        None => TimePreview { column: name(time.index), ..TimePreview::default() },
    }
}

/// How two readings of one file differ, in words; `None` where they are the same. Columns that `changed` names are not compared.
#[must_use]
pub fn find_difference(before: &ReadRecording, after: &ReadRecording, changed: &[String]) -> Option<Bilingual> {
    let (a, b) = (&before.recording, &after.recording);
    let has_other_rows = a.count_rows() != b.count_rows() || before.refused != after.refused;
    if has_other_rows && !changed.is_empty() {
        // A column that a person has named may refuse rows, and what is left is not the same.
        return None;
    }
    if has_other_rows {
        let en = format!(
            "{} rows and {} refused instead of {} and {}",
            b.count_rows(),
            after.refused,
            a.count_rows(),
            before.refused
        );
        let zh =
            format!("{}行、拒绝{}行，而原为{}行、{}行", b.count_rows(), after.refused, a.count_rows(), before.refused);
        return Some(Bilingual::new(en, zh));
    }
    if a.start_ns != b.start_ns || a.time_s != b.time_s {
        let row = (0..a.count_rows()).find(|row| a.time_s[*row].total_cmp(&b.time_s[*row]).is_ne()).unwrap_or(0);
        let (was, is) = (format_time(a, row), format_time(b, row));
        let en = format!("data row {} is at {is} instead of {was}", row + 1);
        return Some(Bilingual::new(en, format!("第{}个数据行的时间为{is}，而原为{was}", row + 1)));
    }
    let is_compared = |column: &&Column| !changed.contains(&column.name);
    for (one, other) in [(a, b), (b, a)] {
        for column in one.columns().iter().filter(is_compared) {
            let found = other.columns().iter().find(|found| found.name == column.name);
            if found.is_none_or(|found| found.cells != column.cells) {
                let what = if found.is_none() {
                    ("is in one reading only", "只在一种读法中存在")
                } else {
                    ("has other values", "数值不同")
                };
                return Some(Bilingual::new(
                    format!("column {} {}", column.name, what.0),
                    format!("列{}{}", column.name, what.1),
                ));
            }
        }
    }
    None
}

/// The names of the columns, time first, and the first rows as text.
#[must_use]
pub fn preview_rows(recording: &Recording, rows: usize) -> (Vec<String>, Vec<Vec<String>>) {
    let name = if recording.start_ns.is_some() { "time_utc" } else { "time_s" };
    let head =
        std::iter::once(name.to_owned()).chain(recording.columns().iter().map(|column| column.name.clone())).collect();
    let value = |cells: &Cells, row: usize| match cells {
        // As many digits as a measurement has, so that a converted 306.9 is not 306.90000000000003.
        Cells::Numbers(numbers) => numbers
            .get(row)
            .map_or_else(String::new, |number| format!("{number:.8e}").parse::<f64>().unwrap_or(number).to_string()),
        Cells::Words(words) => words.get(row).unwrap_or("").to_owned(),
    };
    let row = |row: usize| {
        let cells = recording.columns().iter().map(|column| value(&column.cells, row));
        std::iter::once(format_time(recording, row)).chain(cells).collect()
    };
    (head, (0..rows.min(recording.count_rows())).map(row).collect())
}

fn format_time(recording: &Recording, row: usize) -> String {
    let since_s = recording.time_s[row];
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    let stamp = recording
        .start_ns
        .and_then(|start_ns| jiff::Timestamp::from_nanosecond(i128::from(start_ns) + (since_s * 1e9) as i128).ok());
    stamp.map_or_else(|| since_s.to_string(), |stamp| stamp.to_string())
}
