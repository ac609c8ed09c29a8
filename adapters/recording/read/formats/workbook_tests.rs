//! Workbooks as small as the format allows.

use super::super::super::cell::Cell;
use super::super::super::table::{Table, VisitStep};
use super::*;
use std::io::Write;

const KIND: &str = "http://schemas.openxmlformats.org";

/// A workbook of one sheet with these cells.
fn workbook(cells: &str) -> Input {
    workbook_of(&[("s", cells)], "", "")
}

/// A workbook of these sheets (name, cells), with what it says of itself and with styles.
fn workbook_of(sheets: &[(&str, &str)], properties: &str, styles: &str) -> Input {
    let numbers = || 1..=sheets.len();
    let office = format!("{KIND}/officeDocument/2006/relationships");
    let relations: String = numbers()
        .map(|number| {
            format!(
                "<Relationship Id=\"r{number}\" Type=\"{office}/worksheet\" Target=\"worksheets/sheet{number}.xml\"/>"
            )
        })
        .collect();
    let listed: String = numbers()
        .zip(sheets)
        .map(|(number, (name, _))| format!("<sheet name=\"{name}\" sheetId=\"{number}\" r:id=\"r{number}\"/>"))
        .collect();
    let package = format!("{KIND}/package/2006/relationships");
    let main = format!("{KIND}/spreadsheetml/2006/main");
    let mut parts = vec![
        (
            "_rels/.rels".to_owned(),
            format!(
                "<Relationships xmlns=\"{package}\"><Relationship Id=\"r1\" Type=\"{office}/officeDocument\" Target=\"xl/workbook.xml\"/></Relationships>"
            ),
        ),
        (
            "xl/_rels/workbook.xml.rels".to_owned(),
            format!("<Relationships xmlns=\"{package}\">{relations}</Relationships>"),
        ),
        (
            "xl/workbook.xml".to_owned(),
            format!("<workbook xmlns=\"{main}\" xmlns:r=\"{office}\">{properties}<sheets>{listed}</sheets></workbook>"),
        ),
        ("xl/styles.xml".to_owned(), format!("<styleSheet xmlns=\"{main}\">{styles}</styleSheet>")),
    ];
    for (number, (_, cells)) in numbers().zip(sheets) {
        let text = format!("<worksheet xmlns=\"{main}\"><sheetData>{cells}</sheetData></worksheet>");
        parts.push((format!("xl/worksheets/sheet{number}.xml"), text));
    }
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, text) in parts {
        let stored = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
        archive.start_file(name, stored).expect("a part");
        archive.write_all(text.as_bytes()).expect("written");
    }
    Input::from_memory(archive.finish().expect("an archive").into_inner(), "t.xlsx")
}

/// A line of names, and rows of numbers of these styles.
fn sheet_of(names: &[&str], styles: &[u8], rows: &[&[f64]]) -> String {
    let letter = |index: usize| char::from(b'A' + u8::try_from(index).expect("few columns"));
    let mut text = "<row r=\"1\">".to_owned();
    for (index, name) in names.iter().enumerate() {
        text += &format!("<c r=\"{}1\" t=\"str\"><v>{name}</v></c>", letter(index));
    }
    for (row, numbers) in rows.iter().enumerate() {
        text += &format!("</row><row r=\"{}\">", row + 2);
        for (index, number) in numbers.iter().enumerate() {
            text += &format!("<c r=\"{}{}\" s=\"{}\"><v>{number}</v></c>", letter(index), row + 2, styles[index]);
        }
    }
    text + "</row>"
}

fn read_workbook(input: Input) -> crate::read::ReadRecording {
    crate::read::read_input(input, &crate::Mapping::default()).expect("readable")
}

/// Style 1 shows percent, style 2 percent by a format of the workbook's own, style 3 date and time, style 0 nothing.
const STYLES: &str = "<numFmts><numFmt numFmtId=\"164\" formatCode=\"0.0%\"/></numFmts><cellStyleXfs><xf numFmtId=\"9\"/></cellStyleXfs>\
                      <cellXfs><xf numFmtId=\"0\"/><xf numFmtId=\"9\"/><xf numFmtId=\"164\"/><xf numFmtId=\"22\"/></cellXfs>";

#[test]
fn a_cell_that_is_shown_as_percent_is_read_as_it_is_shown() {
    let names = ["time_s", "Spindle load", "feed_override_pct", "pump_v"];
    let rows: [&[f64]; 3] = [&[0.0, 0.07, 0.855, 0.5], &[1.0, 0.295, 1.0, 0.5], &[2.0, 1.1, 1.2, 0.5]];
    let got = read_workbook(workbook_of(&[("s", &sheet_of(&names, &[0, 1, 2, 0], &rows))], "", STYLES)).recording;
    let column = |name: &str| -> Vec<f64> {
        let known: Vec<&str> = got.columns().iter().map(|column| column.name.as_str()).collect();
        got.find_numbers(name).unwrap_or_else(|| panic!("no {name} in {known:?}")).present_values().collect()
    };
    assert_eq!(column("Spindle load"), [7.0, 29.5, 110.0]);
    assert_eq!(column("feed_override_pct"), [85.5, 100.0, 120.0]);
    assert_eq!(column("pump_v"), [0.5, 0.5, 0.5]);
}

#[test]
fn a_workbook_that_counts_from_1904_means_the_same_days() {
    let (since_1899, since_1904) = (46_098.5, 46_098.5 - 1462.0);
    let mut starts = Vec::new();
    for (first, properties) in [(since_1899, ""), (since_1904, "<workbookPr date1904=\"1\"/>")] {
        let rows: [&[f64]; 2] = [&[first, 1.5], &[first + 0.25, 2.5]];
        let cells = sheet_of(&["time_utc", "x_w"], &[3, 0], &rows);
        let got = read_workbook(workbook_of(&[("s", &cells)], properties, STYLES)).recording;
        assert_eq!(got.time_s, [0.0, 21_600.0], "{properties}");
        starts.push(got.start_ns);
    }
    assert!(starts[0].is_some());
    assert_eq!(starts[0], starts[1], "2026-03-17 at noon, in both");
}

#[test]
fn of_several_sheets_the_one_with_the_most_filled_cells_is_read() {
    let few = sheet_of(&["time_s", "x_w"], &[0, 0], &[&[0.0, 1.0]]);
    let many = sheet_of(&["time_s", "x_w"], &[0, 0], &[&[0.0, 5.0], &[1.0, 6.0]]);
    // Cells that hold nothing do not count.
    let blank: String = (1..20).map(|row| format!("<row r=\"{row}\"><c r=\"A{row}\"/></row>")).collect();
    let got = read_workbook(workbook_of(&[("few", &few), ("many", &many), ("blank", &blank)], "", ""));
    assert_eq!(got.recording.find_numbers("x_w").map(|x| x.present_values().collect()), Some(vec![5.0, 6.0]));
    assert!(got.describe_assumptions().en.contains("sheet many of 3"));
}

const TABLE: &str = "<row r=\"2\"><c r=\"B2\" t=\"str\"><v>time_s</v></c><c r=\"D2\" t=\"str\"><v>p</v></c></row>\
                     <row r=\"3\"><c r=\"B3\"><v>0</v></c><c r=\"D3\"><v>5</v></c></row>";

#[test]
fn a_stray_cell_far_away_costs_nothing() {
    let stray = "<row r=\"1048576\"><c r=\"XFD1048576\"><v>1</v></c></row>";
    for (cells, rows) in [(TABLE.to_owned(), 2), (format!("{TABLE}{stray}"), 2)] {
        let table = open(&workbook(&cells), None).expect("a table");
        let mut seen = Vec::new();
        table
            .visit_rows(&mut |row| {
                let filled = row.cells.iter().filter(|cell| !matches!(cell, Cell::Empty)).count();
                seen.push((row.line, row.cells.len(), filled));
                Ok(VisitStep::Next)
            })
            .expect("rows");
        assert_eq!(seen, [(2, 3, 2), (3, 3, 2)], "{rows} rows, from the first column on");
        let told = table.form.iter().any(|form| form.en.contains("1 cells further right"));
        assert_eq!(told, cells.contains("XFD"), "what is left out is told");
    }
}
