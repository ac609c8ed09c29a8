//! A table with one line for each value (time, name, value), as data loggers of OPC UA write it: turned into columns, each with its own clock.

use super::cell::{Cell, is_absent};
use super::convert::text_of;
use super::error::RecordingError;
use super::head::Head;
use super::limits::{CELLS_IN_MEMORY_MAX, COLUMNS_MAX};
use super::names::{ForeignName, squeeze_name};
use super::row_class::{RowClass, classify_row};
use super::survey::Survey;
use super::table::{ColumnCells, ColumnTable, OwnedCell, Table, VisitStep};
use adapter_core::bilingual::Bilingual;
use std::collections::HashMap;

const NAME: &[&str] = &[
    "name",
    "displayname",
    "varname",
    "field",
    "tag",
    "tagname",
    "variable",
    "item",
    "signal",
    "channel",
    "sensor",
    "nodeid",
    "symbol",
    "messgroesse",
    "kanal",
    "变量",
    "变量名",
    "名称",
    "测点",
    "信号",
    "通道",
];
const VALUE: &[&str] = &["value", "varvalue", "wert", "messwert", "数值", "值", "测量值"];

/// The table turned; `None` where it is none of this kind.
pub(super) fn turn_table(
    table: &dyn Table,
    head: &Head,
    survey: &Survey,
    file: &str,
) -> Result<Option<ColumnTable>, RecordingError> {
    let position = |known: &[&str]| head.names.iter().position(|name| known.contains(&squeeze_name(name).as_str()));
    let (Some(name), Some(value)) = (position(NAME), position(VALUE)) else { return Ok(None) };
    // A name may look like a flag: `n`, `on`.
    let words = survey.columns[name].words + survey.columns[name].flags;
    let is_word = words * 2 > survey.columns[name].count_filled();
    let is_time =
        |index: &usize| ![name, value].contains(index) && ForeignName::from_text(&head.names[*index], None).is_time();
    let moments = |index: &usize| {
        let column = &survey.columns[*index];
        column.moments + column.instants + column.locals > 0
    };
    let all = || (0..head.names.len()).filter(is_time);
    let time = all().find(moments).or_else(|| all().find(|index| survey.columns[*index].count_numbers() > 0));
    let Some(time) = time.filter(|_| is_word) else { return Ok(None) };
    // InfluxDB numbers its tables: a field stands in several where a tag differs.
    let table_number = head.names.iter().position(|name| name == "table");
    let mut series: Vec<Series> = Vec::new();
    let mut known: HashMap<(String, String), usize> = HashMap::new();
    let mut cells = 0;
    table.visit_rows(&mut |row| {
        let RowClass::Data(found) = classify_row(row, head, true) else { return Ok(VisitStep::Next) };
        let at = |index: usize| found.get(index).copied().unwrap_or(Cell::Empty);
        let Cell::Text(text) = at(name) else { return Ok(VisitStep::Next) };
        let part = table_number.map_or_else(String::new, |index| text_of(at(index)));
        let place = *known.entry((text.to_owned(), part.clone())).or_insert_with(|| {
            series.push(Series { name: text.to_owned(), part, times: Vec::new(), values: Vec::new() });
            series.len() - 1
        });
        series[place].times.push(to_owned_cell(at(time)));
        series[place].values.push(to_owned_cell(at(value)));
        cells += 2;
        if cells > CELLS_IN_MEMORY_MAX || series.len() > COLUMNS_MAX {
            let en = format!("more than {CELLS_IN_MEMORY_MAX} values or {COLUMNS_MAX} names, one line for each: export them as columns");
            return Err(RecordingError::with_format_reason(file, en, format!("每行一个值，超过{CELLS_IN_MEMORY_MAX}个值或{COLUMNS_MAX}个名称：请按列导出")));
        }
        Ok(VisitStep::Next)
    })?;
    let label = head.names[time].clone();
    let mut form = table.describe_form();
    form.push(Bilingual::new("one line for each value, turned into columns", "每行一个值，已转换为列"));
    let repeats: Vec<bool> =
        series.iter().map(|one| series.iter().filter(|other| other.name == one.name).count() > 1).collect();
    let columns = series
        .into_iter()
        .zip(repeats)
        .flat_map(|(series, repeats)| {
            let name = if repeats { format!("{} table {}", series.name, series.part) } else { series.name };
            [(label.clone(), ColumnCells::Cells(series.times)), (name, ColumnCells::Cells(series.values))]
        })
        .collect();
    Ok(Some(ColumnTable { columns, form, notes: table.list_notes() }))
}

/// The values of one name.
struct Series {
    name: String,
    /// The table in which they stand, where the file numbers them.
    part: String,
    times: Vec<OwnedCell>,
    values: Vec<OwnedCell>,
}

fn to_owned_cell(cell: Cell<'_>) -> OwnedCell {
    match cell {
        Cell::Text(text) if !is_absent(text) => OwnedCell::from_text(text),
        Cell::Text(_) | Cell::Empty => OwnedCell::Empty,
        Cell::Number(number) => OwnedCell::Number(number),
        Cell::Flag(flag) => OwnedCell::Flag(flag),
        Cell::Instant(at_ns) => OwnedCell::Instant(at_ns),
        Cell::Local(at_ns) => OwnedCell::Local(at_ns),
    }
}
