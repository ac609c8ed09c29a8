//! Where the data of a table begin, and which of the lines before them names the columns and which holds their units.

use super::cell::{Cell, is_absent_number, written_number};
use super::error::RecordingError;
use super::head_form::{HeadForm, HeadRow, HeadTime, extract_texts, find_head_form, merge_group_line};
use super::limits::HEAD_ROWS;
use super::mapping::Mapping;
use super::moment::written_moment;
use super::names::ForeignName;
use super::table::{OwnedCell, Row, Table, VisitStep};
use adapter_core::bilingual::Bilingual;
use adapter_core::channel::unit::Unit;

/// Share of the filled cells of a row that must be of the kind of their columns, for a row of data.
const AGREEMENT: f64 = 0.7;

/// What stands before the data.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Head {
    /// The names of the columns, as written; empty where a column has none.
    pub(super) names: Vec<String>,
    /// The unit of each column, where a line says them.
    pub(super) units: Vec<Option<String>>,
    /// Line of the names.
    pub(super) line: u64,
    /// Line of the first row of data.
    pub(super) data_line: u64,
    /// Lines before the data that are neither names nor units.
    pub(super) other_lines: usize,
    /// Is there a line of units?
    pub(super) has_units: bool,
    /// The rows have one cell more than there are names: the first one numbers them, as R writes it.
    pub(super) numbered: bool,
    /// The columns end at different rows, and the rows with them.
    pub(super) short: bool,
    /// What the head says of time.
    pub(super) time: Option<HeadTime>,
}

/// What a map says of the head.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct GivenHead<'m> {
    /// Line of the names,
    pub(super) names: Option<u64>,
    /// that of the units of the columns,
    pub(super) units: Option<u64>,
    /// or the names themselves, where no line holds them.
    pub(super) list: &'m [String],
}

impl<'m> GivenHead<'m> {
    pub(super) fn from_mapping(mapping: &'m Mapping) -> Self {
        Self { names: mapping.header_line, units: mapping.units_line, list: &mapping.names }
    }
}

/// First cells of the lines that InfluxDB writes before every table of its annotated CSV.
const ANNOTATIONS: [&str; 3] = ["#group", "#datatype", "#default"];

/// Does the row say of what kind the columns of the next table are?
pub(super) fn is_annotation(row: &Row<'_>) -> bool {
    matches!(row.cells.first(), Some(Cell::Text(text)) if ANNOTATIONS.contains(text))
}

/// The first rows that are no annotation.
fn collect_head_rows(table: &dyn Table) -> Result<Vec<HeadRow>, RecordingError> {
    let mut rows: Vec<HeadRow> = Vec::new();
    let mut is_annotated = false;
    table.visit_rows(&mut |row| {
        let cells: Vec<OwnedCell> = row.cells.iter().map(to_owned_cell).collect();
        is_annotated |= is_annotation(row);
        // Where every table is annotated, every table has the names above it once more.
        let repeats = is_annotated && rows.first().is_some_and(|(_, first)| *first == cells);
        if cells.iter().any(|cell| *cell != OwnedCell::Empty) && !is_annotation(row) && !repeats {
            rows.push((row.line, cells));
        }
        Ok(if rows.len() < HEAD_ROWS { VisitStep::Next } else { VisitStep::Enough })
    })?;
    Ok(rows)
}

/// Looks at the first rows.
pub(super) fn find_head(table: &dyn Table, given: GivenHead<'_>, file: &str) -> Result<Head, RecordingError> {
    let rows = collect_head_rows(table)?;
    if rows.is_empty() {
        return Err(RecordingError::Empty { file: file.to_owned(), problems: Vec::new() });
    }
    if !given.list.is_empty() {
        return Ok(head_of_names(&rows, given));
    }
    let given = GivenHead { names: given.names.or_else(|| table.find_names_line()), ..given };
    let header = |line: u64, reason: Bilingual| RecordingError::Header { file: file.to_owned(), line, reason };
    // Our own names say themselves which line they are.
    let ours = rows.iter().find(|(_, cells)| {
        extract_texts(cells).iter().any(|name| ["time_s", "time_utc"].contains(&name.trim_start_matches(['#', ' '])))
    });
    let given = match (given.names, ours) {
        (None, Some((line, _))) => {
            let next = rows.iter().find(|(at, _)| at > line).filter(|(_, cells)| is_units(cells));
            GivenHead { names: Some(*line), units: given.units.or(next.map(|(at, _)| *at)), ..given }
        }
        _ => given,
    };
    let first = match given.names {
        Some(line) => rows.iter().position(|(at, _)| *at > line.max(given.units.unwrap_or(0))).unwrap_or(rows.len()),
        None => first_data_row(&rows),
    };
    if first == 0 {
        return Err(header(rows[0].0, no_names()));
    }
    let units = match given.units {
        Some(line) => rows[..first].iter().position(|(at, _)| *at == line),
        None => (0..first).rev().find(|row| is_units(&rows[*row].1) && (first > 1)),
    };
    let form = find_head_form(&rows[..first]).filter(|_| given.names.is_none());
    if let Some(form) = form {
        return Ok(head_of_form(form, rows.get(first).map_or(u64::MAX, |row| row.0), first));
    }
    let names = match given.names {
        Some(line) => rows[..first].iter().position(|(at, _)| *at == line),
        None => names_row(&rows[..first], units),
    };
    let names = names.ok_or_else(|| header(rows[0].0, no_names()))?;
    let width = rows[first..].first().map_or(0, |(_, cells)| cells.len());
    let mut head =
        Head { line: rows[names].0, data_line: rows.get(first).map_or(u64::MAX, |row| row.0), ..Head::default() };
    head.names = extract_texts(&rows[names].1);
    let upper = names.checked_sub(1).filter(|upper| given.names.is_none() && rows[*upper].0 + 1 == rows[names].0);
    let merged = upper.and_then(|upper| merge_group_line(&extract_texts(&rows[upper].1), &head.names));
    let is_merged = merged.is_some();
    head.names = merged.unwrap_or(head.names);
    strip_comment_sign(&mut head.names);
    let filled = head.names.iter().rposition(|name| !name.is_empty()).map_or(0, |last| last + 1);
    head.names.truncate(filled.max(1));
    head.numbered = rows[names].1.len() + 1 == width
        && head.names.len() + 1 == width
        && rows[first..].iter().all(|(_, cells)| cells.len() == width)
        // Where the last cell is always empty, the rows end in a separator.
        && rows[first..].iter().any(|(_, cells)| cells.last().is_some_and(|cell| *cell != OwnedCell::Empty));
    if head.numbered {
        head.names.insert(0, String::new());
    }
    head.has_units = units.is_some_and(|row| row != names);
    if let Some(row) = units.filter(|row| *row != names) {
        head.units =
            extract_texts(&rows[row].1).into_iter().map(|unit| Some(unit).filter(|unit| !unit.is_empty())).collect();
    }
    head.units.resize(head.names.len(), None);
    head.other_lines = first - 1 - usize::from(head.has_units) - usize::from(is_merged);
    head.short = has_several_clocks(&head.names);
    Ok(head)
}

/// Names that a map gives stand above the first row that looks like data.
fn head_of_names(rows: &[HeadRow], given: GivenHead<'_>) -> Head {
    let names = given.list.to_vec();
    let first = match given.names {
        Some(line) => rows.iter().position(|(at, _)| *at > line).unwrap_or(rows.len()),
        None => first_data_row(rows),
    };
    let line = rows.get(first).map_or(u64::MAX, |row| row.0);
    let short = has_several_clocks(&names);
    Head { units: vec![None; names.len()], names, line, data_line: line, other_lines: first, short, ..Head::default() }
}

fn head_of_form(form: HeadForm, data_line: u64, lines: usize) -> Head {
    Head {
        other_lines: lines.saturating_sub(form.lines),
        has_units: form.units.iter().any(Option::is_some),
        names: form.names,
        units: form.units,
        line: form.line,
        data_line,
        numbered: false,
        short: form.short,
        time: form.time,
    }
}

/// A column of time stands there more than once: columns of the slower clocks end earlier, and so do their rows.
fn has_several_clocks(names: &[String]) -> bool {
    let is_clock = |name: &&String| !name.is_empty() && ForeignName::from_text(name, None).is_time();
    (1..names.len()).any(|index| names[..index].contains(&names[index]) && is_clock(&&names[index]))
}

fn no_names() -> Bilingual {
    Bilingual::new(
        "no line names the columns before the data begin. Put one above them, or say in a map which line it is (header_line), or how they are \
         called (names = [\"time_s\", \"spindle_speed_rpm\"])",
        "数据之前没有列名行。请在数据上方加一行列名，或在映射文件中指定该行（header_line）或列名（names = [\"time_s\", \"spindle_speed_rpm\"]）",
    )
}

fn to_owned_cell(cell: &Cell<'_>) -> OwnedCell {
    match cell {
        Cell::Empty => OwnedCell::Empty,
        Cell::Text(text) => OwnedCell::from_text(text),
        Cell::Number(number) => OwnedCell::Number(*number),
        Cell::Flag(flag) => OwnedCell::Flag(*flag),
        Cell::Instant(at_ns) => OwnedCell::Instant(*at_ns),
        Cell::Local(at_ns) => OwnedCell::Local(*at_ns),
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum CellKind {
    Nothing,
    Value,
    Word,
}

fn kind_of_cell(cell: &OwnedCell) -> CellKind {
    match cell {
        OwnedCell::Empty => CellKind::Nothing,
        OwnedCell::Text(text) if is_absent_number(text) => CellKind::Nothing,
        OwnedCell::Text(text) => {
            let is_value = written_number(text).is_some() || written_moment(text).is_some();
            if is_value { CellKind::Value } else { CellKind::Word }
        }
        _ => CellKind::Value,
    }
}

/// The first row that looks as the rows further down do; 0 where the first one does, the number of rows where none does.
fn first_data_row(rows: &[HeadRow]) -> usize {
    let kinds: Vec<Vec<CellKind>> = rows.iter().map(|(_, cells)| cells.iter().map(kind_of_cell).collect()).collect();
    let further = &kinds[kinds.len() / 2..];
    let width = further.iter().map(Vec::len).max().unwrap_or(0);
    let usual: Vec<CellKind> = (0..width)
        .map(|column| {
            let count = |kind: CellKind| further.iter().filter(|row| row.get(column) == Some(&kind)).count();
            let (values, words) = (count(CellKind::Value), count(CellKind::Word));
            if values == 0 && words == 0 {
                CellKind::Nothing
            } else if values >= words {
                CellKind::Value
            } else {
                CellKind::Word
            }
        })
        .collect();
    let is_data = |row: &Vec<CellKind>| {
        let filled = row.iter().zip(&usual).filter(|(kind, _)| **kind != CellKind::Nothing).count();
        let alike = row.iter().zip(&usual).filter(|(kind, usual)| **kind != CellKind::Nothing && kind == usual).count();
        let has_value = row.iter().zip(&usual).any(|(kind, usual)| *kind == CellKind::Value && kind == usual);
        let expected = usual.iter().filter(|kind| **kind != CellKind::Nothing).count();
        #[expect(clippy::cast_precision_loss, reason = "some thousand columns")]
        let agrees = alike as f64 >= AGREEMENT * filled as f64;
        has_value && agrees && 3 * filled >= expected
    };
    let data: Vec<bool> = kinds.iter().map(is_data).collect();
    (0..rows.len())
        .find(|row| data[*row] && data.iter().skip(row + 1).take(2).all(|next| *next))
        .unwrap_or(rows.len().min(1))
}

/// Does a line hold units? A word before them may say so.
fn is_units(cells: &[OwnedCell]) -> bool {
    let texts: Vec<String> = extract_texts(cells);
    let says_so = |text: &str| {
        matches!(text.to_lowercase().as_str(), "unit" | "units" | "einheit" | "einheiten" | "单位" | "y_unit_label")
    };
    let rest = if texts.first().is_some_and(|text| says_so(text)) { &texts[1..] } else { &texts[..] };
    let filled: Vec<&String> = rest.iter().filter(|text| !text.is_empty()).collect();
    let bare = |text: &str| text.trim_matches(['(', ')', '[', ']', '（', '）']).trim().to_owned();
    !filled.is_empty() && filled.iter().all(|text| Unit::from_symbol(&bare(text)).is_some())
}

/// The last line with two words or more that is not the line of units and no comment; else the last comment.
fn names_row(rows: &[HeadRow], units: Option<usize>) -> Option<usize> {
    let words = |row: usize| rows[row].1.iter().filter(|cell| matches!(cell, OwnedCell::Text(_))).count();
    let is_comment = |row: usize| matches!(rows[row].1.first(), Some(OwnedCell::Text(text)) if text.starts_with('#'));
    let candidates = || (0..rows.len()).rev().filter(|row| Some(*row) != units);
    candidates()
        .find(|row| words(*row) >= 2 && !is_comment(*row))
        .or_else(|| candidates().find(|row| words(*row) >= 2))
        .or(units.filter(|_| rows.len() == 1))
}

fn strip_comment_sign(names: &mut Vec<String>) {
    let Some(rest) = names.first().and_then(|first| first.strip_prefix('#')) else { return };
    let rest = rest.trim().to_owned();
    if rest.is_empty() && names.len() > 1 {
        names.remove(0);
    } else {
        names[0] = rest;
    }
}

#[cfg(test)]
mod tests {
    use super::super::input::Input;
    use super::super::text::TextTable;
    use super::*;

    fn head(text: &str) -> Head {
        let table = TextTable::new(Input::from_memory(text.as_bytes().to_vec(), "t.csv"), None, None).expect("text");
        find_head(&table, GivenHead::default(), "t.csv").expect("a head")
    }

    #[test]
    fn names_and_units_are_found_under_titles() {
        let found = head("Report;7\n;\nZeit;Drehzahl;Leistung\ns;1/min;kW\n0,0;800;0,31\n1,0;800;0,32\n2,0;800;0,31\n");
        assert_eq!((found.line, found.data_line), (3, 5));
        assert_eq!(found.names, ["Zeit", "Drehzahl", "Leistung"]);
        assert_eq!(found.units[2].as_deref(), Some("kW"));
        let pico = head("Time,Channel A\n(ms),(V)\n\n0,1.5\n1,1.5\n2,1.5\n");
        assert_eq!((pico.names.len(), pico.units[0].as_deref(), pico.data_line), (2, Some("(ms)"), 4));
    }

    #[test]
    fn a_plain_header_is_one_line() {
        let found = head("time_s,run,tool\n0,a,T1\n1,a,T1\n");
        assert_eq!((found.line, found.data_line, found.other_lines, found.has_units), (1, 2, 0, false));
        assert_eq!(head("# time_s n p\n0 1 2\n1 2 3\n").names, ["time_s", "n", "p"]);
        assert_eq!(head("# by logger 2\ntime_s,n\n0,1\n1,2\n").line, 2);
    }

    #[test]
    fn row_numbers_of_r_and_pairs_of_twincat() {
        let found = head("\"n\" \"p\"\n\"1\" 800 310\n\"2\" 800 311\n");
        assert_eq!((found.names, found.numbered), (vec![String::new(), "n".to_owned(), "p".to_owned()], true));
        let text = "Name\tScope\n\nName\tn\tName\tp\nSampleTime[ms]\t10\tSampleTime[ms]\t5\n\n0\t1\t0\t2\n10\t1\t5\t2\n20\t1\t10\t2\n";
        assert_eq!(head(text).names, ["Time [ms]", "n", "Time [ms]", "p"]);
    }

    #[test]
    fn data_without_names_are_refused() {
        let table = TextTable::new(Input::from_memory(b"0,1\n1,2\n2,3\n".to_vec(), "t.csv"), None, None).expect("text");
        let error = find_head(&table, GivenHead::default(), "t.csv").expect_err("no names").to_string();
        assert!(error.contains("line 1") && error.contains("header_line"), "{error}");
    }
}
