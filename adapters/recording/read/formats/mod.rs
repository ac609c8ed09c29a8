//! The formats of files, told by their first bytes and not by their names; each becomes rows of cells (`Table`). What is not read is refused
//! by its name, with what to do instead.

mod bytes;
mod labview;
mod matlab;
mod mtconnect;
mod opendocument;
mod parquet;
mod percent_cells;
mod shdr;
mod sparse_sheet;
mod tdms;
mod tdms_channel;
mod tdms_scaling;
mod unread;
mod workbook;

use super::encoding::Decoded;
use super::error::RecordingError;
use super::input::Input;
use super::limits::{TEXT_IN_MEMORY_MAX, UNPACKED_BYTES_MAX};
use super::mapping::Mapping;
use super::separator::Separator;
use super::table::Table;
use super::text::TextTable;

/// Reads by a library of others. A damaged file may break off inside it, which is an answer about the file and not the end of
/// this program (calamine 0.38 indexes into what an xls file says of itself).
fn catch_damage<T>(input: &Input, read: impl FnOnce() -> Result<T, RecordingError>) -> Result<T, RecordingError> {
    let damaged = |_| {
        Err(RecordingError::with_format_reason(
            &input.file,
            "the file is damaged: its parts do not fit together; save it anew, or as CSV",
            "文件已损坏：内部结构不一致；请重新保存，或另存为CSV",
        ))
    };
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(read)).unwrap_or_else(damaged)
}

/// Opens a file as a table.
pub(super) fn open_table(input: Input, mapping: &Mapping) -> Result<Box<dyn Table>, RecordingError> {
    open_table_within(input, mapping, TEXT_IN_MEMORY_MAX)
}

/// Opens a file as a table; a text of more than so many bytes is not put into memory.
pub(super) fn open_table_within(
    mut input: Input,
    mapping: &Mapping,
    most: u64,
) -> Result<Box<dyn Table>, RecordingError> {
    let head = input.read_head(1024)?;
    unread::refuse_by_name(&head, &input)?;
    if head.starts_with(b"PAR1") {
        return Ok(Box::new(catch_damage(&input, || parquet::open(&input))?));
    }
    if head.starts_with(b"PK\x03\x04") || head.starts_with(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1") {
        let table = catch_damage(&input, || workbook::open(&input, mapping.sheet.as_deref()))?;
        return Ok(Box::new(table));
    }
    if head.starts_with(b"TDSm") {
        return Ok(Box::new(tdms::open(&input, mapping.sheet.as_deref())?));
    }
    if matlab::is_mat(&head) {
        return Ok(Box::new(matlab::open(&input, mapping.sheet.as_deref())?));
    }
    let encoding = mapping.encoding.as_deref().and_then(|name| encoding_rs::Encoding::for_label(name.as_bytes()));
    let separator = mapping.separator.as_deref().and_then(Separator::from_text);
    input.keep_in_memory(most)?;
    let text = TextTable::new(input, encoding, separator)?;
    let start = text.read_head()?;
    let start = start.trim_start();
    if start.starts_with('<') {
        return Ok(Box::new(mtconnect::open(&text.input)?));
    }
    if start.starts_with('{') || start.starts_with('[') {
        return Err(RecordingError::with_format_reason(
            &text.input.file,
            "this is JSON, which is not read: write CSV or Parquet (pandas: to_csv, to_parquet)",
            "该文件是JSON，无法读取：请导出为CSV或Parquet（pandas：to_csv、to_parquet）",
        ));
    }
    if shdr::is_shdr(start) {
        let decoded = Decoded::new(text.input.open()?, text.encoding);
        return Ok(Box::new(shdr::open(decoded, &text.input.file)?));
    }
    if start.starts_with("LabVIEW Measurement") {
        return Ok(Box::new(labview::open(text.input)?));
    }
    if head.iter().take(512).filter(|byte| **byte == 0).count() > 8 && text.encoding.encoding == encoding_rs::UTF_8 {
        return Err(RecordingError::with_format_reason(
            &text.input.file,
            "this is no text and no format that is known (CSV, Excel, OpenDocument, LabVIEW lvm and tdms, MATLAB up to version 7, Parquet, MTConnect)",
            "该文件不是文本，也不是已知格式（CSV、Excel、OpenDocument、LabVIEW lvm与tdms、MATLAB 7及以下、Parquet、MTConnect）",
        ));
    }
    Ok(Box::new(text))
}

/// Everything of a file, for formats that jump about in it.
fn read_whole(input: &Input) -> Result<Vec<u8>, RecordingError> {
    let too_big = || {
        let mb = UNPACKED_BYTES_MAX >> 20;
        RecordingError::with_format_reason(
            &input.file,
            format!("larger than {mb} MB: export it as CSV, or in parts"),
            format!("超过{mb} MB：请导出为CSV，或分成几个文件"),
        )
    };
    input.read_whole(UNPACKED_BYTES_MAX)?.ok_or_else(too_big)
}
