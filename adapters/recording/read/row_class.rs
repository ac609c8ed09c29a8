//! What a row of a table is: data, or one of the things that stand between data.

use super::cell::Cell;
use super::head::{Head, is_annotation};
use super::table::Row;

/// What a row is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum RowClass<'a> {
    /// A line before the data.
    Head,
    /// The header once more.
    RepeatedHeader,
    /// A line of remarks.
    Remark,
    /// Wider or narrower than the header, beyond empty cells at its end.
    OtherWidth,
    /// The cells that belong to columns with a name.
    Data(&'a [Cell<'a>]),
}

/// Looks at a row; `may_be_short`: the format leaves out what is empty at the end.
pub(super) fn classify_row<'a>(row: &Row<'a>, head: &Head, may_be_short: bool) -> RowClass<'a> {
    if row.line < head.data_line {
        RowClass::Head
    } else if repeats_header(row, head) {
        RowClass::RepeatedHeader
    } else if is_remark(row, head) {
        RowClass::Remark
    } else {
        fit_row(row, head, may_be_short).map_or(RowClass::OtherWidth, RowClass::Data)
    }
}

/// Is this row the header once more?
fn repeats_header(row: &Row<'_>, head: &Head) -> bool {
    let same = |(cell, name): (&Cell<'_>, &String)| match cell {
        Cell::Text(text) => text == name || text.trim_start_matches('#').trim() == name,
        Cell::Empty => name.is_empty(),
        _ => false,
    };
    row.cells.len() >= head.names.len() && row.cells.iter().zip(&head.names).all(same)
}

/// A line of remarks among the data: a sign before it, and not as many cells as there are columns.
fn is_remark(row: &Row<'_>, head: &Head) -> bool {
    matches!(row.cells.first(), Some(Cell::Text(text)) if text.starts_with('#') || text.starts_with("//"))
        && (is_annotation(row) || row.cells.iter().filter(|cell| **cell != Cell::Empty).count() < head.names.len())
}

fn fit_row<'a>(row: &Row<'a>, head: &Head, may_be_short: bool) -> Option<&'a [Cell<'a>]> {
    let width = head.names.len();
    if row.cells.len() >= width {
        row.cells[width..].iter().all(|cell| *cell == Cell::Empty).then(|| &row.cells[..width])
    } else {
        may_be_short.then_some(row.cells)
    }
}
