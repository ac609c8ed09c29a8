//! Workbooks of Excel (xlsx, xlsb, xls) and OpenDocument (ods), by `calamine`.

use super::super::error::RecordingError;
use super::super::input::Input;
use super::super::limits::{CELLS_IN_MEMORY_MAX, COLUMNS_MAX, UNPACKED_BYTES_MAX};
use super::super::table::{MemoryTable, OwnedCell};
use super::opendocument;
use super::percent_cells::{PercentCells, find_percent_cells, has_percent_styles};
use super::sparse_sheet::{SparseSheet, build_size_error, note_formulas};
use adapter_core::bilingual::Bilingual;
use adapter_core::clock::{SECOND_NS, TimeNs};
use calamine::{Data, DataRef, ExcelDateTime, Reader, Sheets};
use std::io::{Cursor, Read};

/// Days from 1899-12-30 to 1970-01-01.
const EPOCH_DAYS: f64 = 25_569.0;
/// Days from the zero of a spreadsheet to that of one that counts from 1904.
const DAYS_1904: f64 = 1462.0;

pub(super) fn open(input: &Input, sheet: Option<&str>) -> Result<MemoryTable, RecordingError> {
    let bytes = super::read_whole(input)?;
    if bytes.starts_with(b"PK") {
        super::unread::refuse_archive(&bytes, input)?;
        unpacks_within_limit(&bytes, input)?;
    } else if has_encrypted_package(&bytes) {
        return Err(build_password_error(input));
    }
    let styled = has_percent_styles(&bytes).then(|| bytes.clone());
    let mut book =
        calamine::open_workbook_auto_from_rs(Cursor::new(bytes)).map_err(|error| build_broken_error(input, &error))?;
    let names = book.sheet_names();
    let chosen = choose_sheet(&mut book, &names, sheet, input)?;
    let percent = styled.map(|bytes| find_percent_cells(&bytes, &chosen)).unwrap_or_default();
    let mut table = read_sheet(&mut book, &chosen, percent, input)?;
    if names.len() > 1 {
        table.form.push(Bilingual::new(
            format!("sheet {chosen} of {}", names.len()),
            format!("{}个工作表中的{chosen}", names.len()),
        ));
    }
    Ok(table)
}

/// The cells of a sheet. The newer formats are read cell by cell, so that a stray cell far away costs nothing; the library makes a block of
/// the older ones, whose sheets are small.
fn read_sheet(
    book: &mut Book,
    chosen: &str,
    mut percent: PercentCells,
    input: &Input,
) -> Result<MemoryTable, RecordingError> {
    let (mut sheet, mut notes) = (SparseSheet::default(), Vec::new());
    let broken = |error: &dyn std::fmt::Display| build_broken_error(input, error);
    match book {
        Sheets::Xlsx(book) => {
            let mut cells = book.worksheet_cells_reader(chosen).map_err(|error| broken(&error))?;
            while let Some(cell) = cells.next_cell().map_err(|error| broken(&error))? {
                let own = convert_cell(&Data::from(cell.get_value().clone()));
                sheet.put_cell(cell.get_position(), percent.show_cell(cell.get_position(), own));
                sheet.check_size(chosen, input)?;
            }
            drop(cells);
            note_formulas(book, chosen, &sheet, &mut notes);
        }
        Sheets::Xlsb(book) => {
            let mut cells = book.worksheet_cells_reader(chosen).map_err(|error| broken(&error))?;
            while let Some(cell) = cells.next_cell().map_err(|error| broken(&error))? {
                sheet.put_cell(cell.get_position(), convert_cell(&Data::from(cell.get_value().clone())));
                sheet.check_size(chosen, input)?;
            }
        }
        Sheets::Xls(_) | Sheets::Ods(_) => return read_block(book, chosen, input),
    }
    let mut table = sheet.into_table(chosen, input)?;
    table.notes.append(&mut notes);
    Ok(table)
}

fn read_block(book: &mut Book, chosen: &str, input: &Input) -> Result<MemoryTable, RecordingError> {
    let range = book.worksheet_range(chosen).map_err(|error| build_broken_error(input, &error))?;
    let (rows, columns) = range.get_size();
    if columns > COLUMNS_MAX || rows.saturating_mul(columns) > CELLS_IN_MEMORY_MAX {
        return Err(RecordingError::with_format_reason(
            &input.file,
            format!(
                "sheet {chosen} has {rows} rows of {columns} columns, more than are read: save it as CSV, or in parts"
            ),
            format!("工作表{chosen}有{rows}行{columns}列，超出限制：请另存为CSV，或分成几个文件"),
        ));
    }
    let first = range.start().map_or(0, |(row, _)| u64::from(row));
    let mut table = MemoryTable::default();
    for (index, cells) in range.rows().enumerate() {
        table.rows.push((first + index as u64 + 1, cells.iter().map(convert_cell).collect()));
    }
    Ok(table)
}

type Book = Sheets<Cursor<Vec<u8>>>;

/// The sheet that is asked for; else the one with the most cells.
fn choose_sheet(
    book: &mut Book,
    names: &[String],
    asked: Option<&str>,
    input: &Input,
) -> Result<String, RecordingError> {
    if let Some(asked) = asked {
        let known = || names.join(", ");
        return names.iter().find(|name| *name == asked).cloned().ok_or_else(|| {
            RecordingError::with_format_reason(
                &input.file,
                format!("there is no sheet {asked}; there are {}", known()),
                format!("没有工作表{asked}；现有：{}", known()),
            )
        });
    }
    if let [only] = names {
        return Ok(only.clone());
    }
    let mut best: Option<(usize, String)> = None;
    for name in names {
        let cells = count_filled_cells(book, name);
        if best.as_ref().is_none_or(|(most, _)| cells > *most) {
            best = Some((cells, name.clone()));
        }
    }
    best.filter(|(cells, _)| *cells > 0)
        .map(|(_, name)| name)
        .ok_or_else(|| RecordingError::with_format_reason(&input.file, "the workbook is empty", "工作簿为空"))
}

/// How many cells of a sheet hold something; of a sheet that breaks off, those before. Nothing is converted or kept.
fn count_filled_cells(book: &mut Book, name: &str) -> usize {
    match book {
        Sheets::Xlsx(book) => book.worksheet_cells_reader(name).map_or(0, |mut cells| {
            std::iter::from_fn(|| cells.next_cell().ok().flatten().map(|cell| is_filled(cell.get_value())))
                .filter(|filled| *filled)
                .count()
        }),
        Sheets::Xlsb(book) => book.worksheet_cells_reader(name).map_or(0, |mut cells| {
            std::iter::from_fn(|| cells.next_cell().ok().flatten().map(|cell| is_filled(cell.get_value())))
                .filter(|filled| *filled)
                .count()
        }),
        Sheets::Xls(_) | Sheets::Ods(_) => book.worksheet_range(name).map_or(0, |range| range.used_cells().count()),
    }
}

fn is_filled(value: &DataRef<'_>) -> bool {
    match value {
        DataRef::Empty | DataRef::Error(_) => false,
        DataRef::String(text) => !text.trim().is_empty(),
        DataRef::SharedString(text) => !text.trim().is_empty(),
        _ => true,
    }
}

fn convert_cell(data: &Data) -> OwnedCell {
    match data {
        Data::Empty | Data::Error(_) => OwnedCell::Empty,
        #[expect(clippy::cast_precision_loss, reason = "a cell of a workbook holds 15 digits")]
        Data::Int(number) => OwnedCell::Number(*number as f64),
        Data::Float(number) => OwnedCell::Number(*number),
        Data::String(text) | Data::DurationIso(text) => OwnedCell::from_text(strip_quotes(text.trim())),
        Data::Bool(flag) => OwnedCell::Flag(*flag),
        Data::DateTime(at) => convert_moment(*at),
        Data::DateTimeIso(text) => text.parse::<jiff::civil::DateTime>().map_or_else(
            |_| OwnedCell::from_text(text),
            |at| {
                at.to_zoned(jiff::tz::TimeZone::UTC)
                    .ok()
                    .and_then(|at| TimeNs::try_from(at.timestamp().as_nanosecond()).ok())
                    .map_or(OwnedCell::Empty, OwnedCell::Local)
            },
        ),
    }
}

/// A text that was quoted once more when it was saved.
fn strip_quotes(text: &str) -> &str {
    let inner = text.strip_prefix('"').and_then(|text| text.strip_suffix('"'));
    inner.filter(|inner| !inner.contains('"')).unwrap_or(text)
}

/// A day with a time is a moment on the wall, a time alone a time of day, and a duration a number of seconds.
fn convert_moment(at: ExcelDateTime) -> OwnedCell {
    let days = at.as_f64();
    if at.is_duration() {
        return OwnedCell::Number(days * 86_400.0);
    }
    // A workbook counts in days; milliseconds are what its digits hold.
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    let milliseconds = |days: f64| (days * 86_400e3).round() as i64;
    if (0.0..1.0).contains(&days) {
        let ms = milliseconds(days).min(86_400_000 - 1);
        let (s, m, h) = (ms / 1000, ms / 60_000, ms / 3_600_000);
        return OwnedCell::from_text(&format!("{h:02}:{:02}:{:02}.{:03}", m % 60, s % 60, ms % 1000));
    }
    // A workbook that counts from 1904 says so; the library then adds its 1,462 days in the date and not in the number.
    let (year, month, day, ..) = at.to_ymd_hms_milli();
    let (month, day) = (i8::try_from(month).ok(), i8::try_from(day).ok());
    let parts = i16::try_from(year).ok().zip(month).zip(day);
    let date = parts.and_then(|((year, month), day)| jiff::civil::Date::new(year, month, day).ok());
    let shift_days = date.map_or(0.0, |date| {
        let counted =
            f64::from((date - jiff::civil::Date::constant(1970, 1, 1)).get_days()) - (days - EPOCH_DAYS).floor();
        if counted > 1400.0 { DAYS_1904 } else { 0.0 }
    });
    OwnedCell::Local(milliseconds(days + shift_days - EPOCH_DAYS).saturating_mul(SECOND_NS / 1000))
}

/// Counts what the parts of the archive really come to: what they claim may be a lie.
fn unpacks_within_limit(bytes: &[u8], input: &Input) -> Result<(), RecordingError> {
    let wrong = |error: zip::result::ZipError| build_broken_error(input, &error);
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).map_err(wrong)?;
    let mut left = UNPACKED_BYTES_MAX;
    for index in 0..archive.len() {
        let part = archive.by_index(index).map_err(wrong)?;
        let taken = std::io::copy(&mut part.take(left + 1), &mut std::io::sink())
            .map_err(|error| input.build_io_error(error))?;
        if taken > left {
            let mb = UNPACKED_BYTES_MAX >> 20;
            return Err(RecordingError::with_format_reason(
                &input.file,
                format!("unpacked it is larger than {mb} MB: save it as CSV, or in parts"),
                format!("解压后超过{mb} MB：请另存为CSV，或分成几个文件"),
            ));
        }
        left -= taken;
    }
    let content = archive.by_name("content.xml").is_ok_and(opendocument::is_too_large);
    if content { Err(build_size_error("content.xml", input)) } else { Ok(()) }
}

/// The stream of an encrypted workbook, by its name in UTF-16.
fn has_encrypted_package(bytes: &[u8]) -> bool {
    let name: Vec<u8> = "EncryptedPackage".bytes().flat_map(|byte| [byte, 0]).collect();
    bytes.windows(name.len()).any(|part| part == name)
}

fn build_password_error(input: &Input) -> RecordingError {
    RecordingError::with_format_reason(
        &input.file,
        "the workbook is protected by a password: open it, save it without one, and try again",
        "工作簿有密码保护：请打开后去掉密码另存，再试",
    )
}

fn build_broken_error(input: &Input, error: &dyn std::fmt::Display) -> RecordingError {
    let text = error.to_string();
    if text.to_lowercase().contains("password") {
        return build_password_error(input);
    }
    RecordingError::with_format_reason(
        &input.file,
        format!("not a readable workbook: {text}; save it again, or as CSV"),
        format!("无法读取的工作簿：{text}；请重新保存或另存为CSV"),
    )
}

#[cfg(test)]
#[path = "workbook_tests.rs"]
mod tests;
