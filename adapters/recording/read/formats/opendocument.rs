//! How large the sheets of an OpenDocument workbook become when what is repeated in them is written out, found before the library does that:
//! one row of some bytes may stand for a million.

use super::super::limits::CELLS_IN_MEMORY_MAX;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::io::{BufReader, Read};

/// Rows and columns up to the last cell that holds something.
#[derive(Default)]
struct SheetSize {
    rows: usize,
    /// Rows up to the last one with a value.
    filled_rows: usize,
    columns: usize,
    /// Of the row that is being read: how often it stands, columns so far, columns up to the last one with a value.
    repeats: usize,
    place: usize,
    filled_width: usize,
}

impl SheetSize {
    fn begin_row(&mut self, row: &BytesStart<'_>) {
        (self.repeats, self.place, self.filled_width) = (count_repeats(row, "table:number-rows-repeated"), 0, 0);
    }

    fn add_cell(&mut self, cell: &BytesStart<'_>) {
        self.place = self.place.saturating_add(count_repeats(cell, "table:number-columns-repeated"));
        if cell.attributes().with_checks(false).flatten().any(|attribute| attribute.key.as_ref() == "office:value-type")
        {
            self.filled_width = self.place;
        }
    }

    fn end_row(&mut self) {
        self.rows = self.rows.saturating_add(self.repeats);
        if self.filled_width > 0 {
            self.filled_rows = self.rows;
            self.columns = self.columns.max(self.filled_width);
        }
    }

    fn count_cells(&self) -> usize {
        self.filled_rows.saturating_mul(self.columns)
    }
}

fn count_repeats(element: &BytesStart<'_>, name: &str) -> usize {
    let found = element.attributes().with_checks(false).flatten().find(|attribute| attribute.key.as_ref() == name);
    found.map_or(1, |attribute| attribute.value.parse().unwrap_or(usize::MAX))
}

/// Does the content of the archive come to more cells than are read? XML that is broken is a matter of who reads it next.
pub(super) fn is_too_large(content: impl Read) -> bool {
    let mut reader = Reader::from_reader(BufReader::new(content));
    let (mut buffer, mut sheet, mut all) = (Vec::new(), SheetSize::default(), 0_usize);
    loop {
        let Ok(event) = reader.read_event_into(&mut buffer) else { return false };
        match event {
            Event::Start(element) if element.name().as_ref() == "table:table" => sheet = SheetSize::default(),
            Event::End(element) if element.name().as_ref() == "table:table" => {
                all = all.saturating_add(sheet.count_cells())
            }
            Event::Start(element) if element.name().as_ref() == "table:table-row" => sheet.begin_row(&element),
            Event::End(element) if element.name().as_ref() == "table:table-row" => sheet.end_row(),
            Event::Start(element) | Event::Empty(element) if element.name().as_ref() == "table:table-cell" => {
                sheet.add_cell(&element);
            }
            Event::Eof => return all > CELLS_IN_MEMORY_MAX,
            _ => {}
        }
        if all.saturating_add(sheet.count_cells()) > CELLS_IN_MEMORY_MAX {
            return true;
        }
        buffer.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sheet(rows: &str, columns: &str) -> String {
        format!(
            "<table:table><table:table-row table:number-rows-repeated=\"{rows}\"><table:table-cell office:value-type=\"float\" \
             table:number-columns-repeated=\"{columns}\"/></table:table-row><table:table-row \
             table:number-rows-repeated=\"1048576\"><table:table-cell table:number-columns-repeated=\"16384\"/></table:table-row></table:table>"
        )
    }

    #[test]
    fn what_is_repeated_counts_and_what_is_empty_at_the_end_does_not() {
        assert!(!is_too_large(sheet("100", "20").as_bytes()));
        assert!(is_too_large(sheet("1048576", "20").as_bytes()));
        assert!(is_too_large(sheet("1", "99999999999999999999").as_bytes()));
    }
}
