//! A table with one line for each value (time, name, value), as data loggers of OPC UA write it: turned into columns, each with its own clock.

use super::cell::{Cell, is_absent};
use super::error::RecordingError;
use super::head::Head;
use super::limits::{CELLS_IN_MEMORY_MAX, COLUMNS_MAX};
use super::names::squeeze_name;
use super::survey::{Survey, fit_row};
use super::table::{ColumnCells, ColumnTable, OwnedCell, Table, VisitStep};
use adapter_core::bilingual::Bilingual;
use std::collections::HashMap;

const NAME: &[&str] = &[
    "name",
    "displayname",
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
const VALUE: &[&str] = &["value", "wert", "messwert", "数值", "值", "测量值"];

/// The table turned; `None` where it is none of this kind.
pub(super) fn turn_table(
    table: &dyn Table,
    head: &Head,
    survey: &Survey,
    file: &str,
) -> Result<Option<ColumnTable>, RecordingError> {
    let position = |known: &[&str]| head.names.iter().position(|name| known.contains(&squeeze_name(name).as_str()));
    let (Some(name), Some(value)) = (position(NAME), position(VALUE)) else { return Ok(None) };
    let is_word = survey.columns[name].words * 2 > survey.columns[name].count_filled();
    let moments = |index: usize| {
        let column = &survey.columns[index];
        column.moments + column.instants + column.locals + column.count_numbers()
    };
    let time = (0..head.names.len()).find(|index| {
        ![name, value].contains(index)
            && super::names::ForeignName::from_text(&head.names[*index], None).is_time()
            && moments(*index) > 0
    });
    let Some(time) = time.filter(|_| is_word) else { return Ok(None) };
    let mut series: Vec<(String, Vec<OwnedCell>, Vec<OwnedCell>)> = Vec::new();
    let mut known: HashMap<String, usize> = HashMap::new();
    let mut cells = 0;
    table.visit_rows(&mut |row| {
        let Some(found) = fit_row(row, head, true).filter(|_| row.line >= head.data_line) else { return Ok(VisitStep::Next) };
        let at = |index: usize| found.get(index).copied().unwrap_or(Cell::Empty);
        let Cell::Text(text) = at(name) else { return Ok(VisitStep::Next) };
        let place = *known.entry(text.to_owned()).or_insert_with(|| {
            series.push((text.to_owned(), Vec::new(), Vec::new()));
            series.len() - 1
        });
        series[place].1.push(to_owned_cell(at(time)));
        series[place].2.push(to_owned_cell(at(value)));
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
    let columns = series
        .into_iter()
        .flat_map(|(name, times, values)| {
            [(label.clone(), ColumnCells::Cells(times)), (name, ColumnCells::Cells(values))]
        })
        .collect();
    Ok(Some(ColumnTable { columns, form }))
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
