//! Cells of an Excel workbook that are shown as percent: 0.85 is stored and 85 % is what a person sees, and what the same sheet holds when
//! it is saved as CSV. The library of the cells does not give their styles.

use super::super::limits::UNPACKED_BYTES_MAX;
use super::super::table::OwnedCell;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::io::{BufReader, Cursor, Read};
use zip::ZipArchive;

/// Percent without and with two decimals among the formats that every workbook has (ECMA-376 part 1, 18.8.30).
const BUILT_IN: [&str; 2] = ["9", "10"];

/// Places of cells that are shown as percent, in the order of the sheet.
#[derive(Debug, Default)]
pub(super) struct PercentCells {
    places: Vec<(u32, u32)>,
    next: usize,
}

impl PercentCells {
    /// The cell as it is shown; the cells have to come in the order of the sheet.
    pub(super) fn show_cell(&mut self, place: (u32, u32), cell: OwnedCell) -> OwnedCell {
        while self.places.get(self.next).is_some_and(|next| *next < place) {
            self.next += 1;
        }
        match cell {
            OwnedCell::Number(number) if self.places.get(self.next) == Some(&place) => {
                // Shifted as it is written, so that 0.07 is 7 and not 7.000000000000001.
                let percent = format!("{number}e2").parse().unwrap_or(100.0 * number);
                OwnedCell::from_text(&format!("{percent} %"))
            }
            cell => cell,
        }
    }
}

/// Does any style of the workbook show percent?
pub(super) fn has_percent_styles(bytes: &[u8]) -> bool {
    ZipArchive::new(Cursor::new(bytes)).is_ok_and(|mut archive| !list_percent_styles(&mut archive).is_empty())
}

/// The cells of a sheet that are shown as percent; none where the workbook is not put together as usual.
pub(super) fn find_percent_cells(bytes: &[u8], sheet: &str) -> PercentCells {
    let Ok(mut archive) = ZipArchive::new(Cursor::new(bytes)) else { return PercentCells::default() };
    let styles = list_percent_styles(&mut archive);
    let Some(part) = find_part_of_sheet(&mut archive, sheet) else { return PercentCells::default() };
    let mut places = Vec::new();
    visit_elements(&mut archive, &part, &mut |name, attribute| {
        if name == "c" && attribute("s").is_some_and(|style| styles.contains(&style)) {
            places.extend(attribute("r").as_deref().and_then(parse_place));
        }
    });
    PercentCells { places, next: 0 }
}

/// Numbers of the styles of cells whose format has a percent sign.
fn list_percent_styles(archive: &mut Archive<'_>) -> BTreeSet<String> {
    let mut formats: BTreeSet<String> = BUILT_IN.map(str::to_owned).into();
    let (mut styles, mut in_cell_styles, mut number) = (BTreeSet::new(), false, 0_u32);
    visit_elements(archive, "xl/styles.xml", &mut |name, attribute| match name {
        "numFmt" if attribute("formatCode").is_some_and(|code| code.contains('%')) => {
            formats.extend(attribute("numFmtId"));
        }
        "cellXfs" => in_cell_styles = true,
        "cellStyles" | "dxfs" => in_cell_styles = false,
        "xf" if in_cell_styles => {
            if attribute("numFmtId").is_some_and(|id| formats.contains(&id)) {
                styles.insert(number.to_string());
            }
            number += 1;
        }
        _ => {}
    });
    styles
}

/// The part of the archive that holds a sheet: its number in the workbook, and what that stands for.
fn find_part_of_sheet(archive: &mut Archive<'_>, sheet: &str) -> Option<String> {
    let (mut id, mut target) = (None, None);
    visit_elements(archive, "xl/workbook.xml", &mut |name, attribute| {
        if name == "sheet" && attribute("name").as_deref() == Some(sheet) {
            id = attribute("r:id");
        }
    });
    let id = id?;
    visit_elements(archive, "xl/_rels/workbook.xml.rels", &mut |name, attribute| {
        if name == "Relationship" && attribute("Id").as_ref() == Some(&id) {
            target = attribute("Target");
        }
    });
    let target = target?;
    Some(target.strip_prefix('/').map_or_else(|| format!("xl/{target}"), str::to_owned))
}

type Archive<'b> = ZipArchive<Cursor<&'b [u8]>>;

/// Takes the name of an element, and what gives its attributes.
type SeeElement<'s> = dyn FnMut(&str, &dyn Fn(&str) -> Option<String>) + 's;

/// Goes through the elements of a part; what is broken is a matter of who reads the cells.
fn visit_elements(archive: &mut Archive<'_>, part: &str, see: &mut SeeElement<'_>) {
    let Ok(content) = archive.by_name(part) else { return };
    let mut reader = Reader::from_reader(BufReader::new(content.take(UNPACKED_BYTES_MAX)));
    let mut buffer = Vec::new();
    loop {
        match reader.read_event_into(&mut buffer) {
            Ok(Event::Start(element) | Event::Empty(element)) => {
                see(element.local_name().as_ref(), &|name| find_attribute(&element, name))
            }
            Ok(Event::Eof) | Err(_) => return,
            Ok(_) => {}
        }
        buffer.clear();
    }
}

fn find_attribute(element: &BytesStart<'_>, name: &str) -> Option<String> {
    let found = element.attributes().with_checks(false).flatten().find(|attribute| attribute.key.as_ref() == name)?;
    quick_xml::escape::unescape(&found.value).ok().map(Cow::into_owned)
}

/// `B3` as row and column, both from 0.
fn parse_place(text: &str) -> Option<(u32, u32)> {
    let letters = text.bytes().take_while(u8::is_ascii_uppercase).count();
    let (column, row) = text.split_at(letters);
    if column.is_empty() || column.len() > 3 {
        return None;
    }
    let column = column.bytes().fold(0, |number, letter| 26 * number + u32::from(letter - b'A') + 1);
    Some((row.parse::<u32>().ok()?.checked_sub(1)?, column - 1))
}
