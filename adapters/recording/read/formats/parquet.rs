//! Recordings as Parquet: a flat table. Times with a zone are moments, those without one are of the clock on the wall.

use super::super::error::RecordingError;
use super::super::input::Input;
use super::super::limits::CELLS_MAX;
use super::super::note::{Note, NoteKind};
use super::super::table::{ColumnCells, ColumnTable, OwnedCell};
use ::parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type};
use ::parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use ::parquet::data_type::{ByteArray, DataType};
use ::parquet::errors::ParquetError;
use ::parquet::file::reader::{FileReader, SerializedFileReader};
use ::parquet::schema::types::ColumnDescriptor;
use adapter_core::clock::SECOND_NS;
use bytes::Bytes;

/// Cells that are taken at once.
const BATCH: usize = 8192;

pub(super) fn open(input: &Input) -> Result<ColumnTable, RecordingError> {
    let bad = |error: ParquetError| {
        RecordingError::with_format_reason(
            &input.file,
            format!("not a readable Parquet file: {error}"),
            format!("无法读取的Parquet文件：{error}"),
        )
    };
    let reader = SerializedFileReader::new(Bytes::from(super::read_whole(input)?)).map_err(bad)?;
    let schema = reader.metadata().file_metadata().schema_descr();
    let rows = reader.metadata().file_metadata().num_rows();
    let rows = usize::try_from(rows).map_err(|_| bad(ParquetError::General(format!("{rows} rows"))))?;
    if rows.saturating_mul(schema.num_columns()) > CELLS_MAX {
        let en = format!(
            "{rows} rows of {} columns are more than {CELLS_MAX} cells: write fewer columns, or parts",
            schema.num_columns()
        );
        return Err(RecordingError::with_format_reason(
            &input.file,
            en,
            format!("{rows}行{}列，超过{CELLS_MAX}个单元格：请减少列或分成几个文件", schema.num_columns()),
        ));
    }
    let mut table = ColumnTable::default();
    for (index, column) in schema.columns().iter().enumerate() {
        let is_nested = column.path().parts().len() != 1 || column.max_rep_level() > 0;
        let Some(mut cells) = build_empty_cells(column).filter(|_| !is_nested) else {
            let kind = if is_nested { "nested".to_owned() } else { column.physical_type().to_string() };
            table.notes.push(Note::new(
                NoteKind::Loss,
                format!(
                    "column {} is {kind} and is left out; use double, integer, decimal or text in a flat table",
                    column.path()
                ),
                format!("列{}为{kind}，未读取；请在平面表中使用双精度、整数、小数或文本", column.path()),
            ));
            continue;
        };
        for group in 0..reader.num_row_groups() {
            let group = reader.get_row_group(group).map_err(bad)?;
            append_cells(&mut cells, group.get_column_reader(index).map_err(bad)?, column).map_err(bad)?;
        }
        // The index that pandas writes without a name.
        let name = if column.name().starts_with("__index_level_") { "index" } else { column.name() };
        table.columns.push((name.to_owned(), cells));
    }
    if table.columns.is_empty() {
        return Err(bad(ParquetError::General("no column holds numbers, times or text".to_owned())));
    }
    Ok(table)
}

fn build_empty_cells(column: &ColumnDescriptor) -> Option<ColumnCells> {
    Some(match column.physical_type() {
        Type::BYTE_ARRAY | Type::FIXED_LEN_BYTE_ARRAY if find_scale(column).is_some() => {
            ColumnCells::Numbers(Vec::new())
        }
        Type::INT32 if is_date(column) => ColumnCells::Cells(Vec::new()),
        Type::INT96 => ColumnCells::Cells(Vec::new()),
        Type::BYTE_ARRAY => ColumnCells::Cells(Vec::new()),
        Type::INT64 if find_time_unit(column).is_some() => ColumnCells::Cells(Vec::new()),
        Type::BOOLEAN => ColumnCells::Cells(Vec::new()),
        Type::INT32 | Type::INT64 | Type::FLOAT | Type::DOUBLE => ColumnCells::Numbers(Vec::new()),
        _ => return None,
    })
}

/// The decimals of a number that is stored as a whole one.
fn find_scale(column: &ColumnDescriptor) -> Option<i32> {
    let is_decimal = matches!(column.logical_type_ref(), Some(LogicalType::Decimal(_)))
        || column.converted_type() == ConvertedType::DECIMAL;
    is_decimal.then(|| column.type_scale())
}

/// Does the column hold days since 1970?
fn is_date(column: &ColumnDescriptor) -> bool {
    matches!(column.logical_type_ref(), Some(LogicalType::Date)) || column.converted_type() == ConvertedType::DATE
}

/// A whole number of any length, the highest byte first, with so many decimals; NaN where it is longer than a number can be.
fn decode_decimal(bytes: &[u8], scale: i32) -> f64 {
    if bytes.is_empty() || bytes.len() > 16 {
        return f64::NAN;
    }
    let first = if bytes[0] & 0x80 == 0 { 0_i128 } else { -1 };
    let whole = bytes.iter().fold(first, |whole, byte| (whole << 8) | i128::from(*byte));
    scale_decimal(whole, scale)
}

/// Written out and read again, so that 12345 with two decimals is the double nearest to 123.45.
fn scale_decimal(whole: i128, scale: i32) -> f64 {
    format!("{whole}e{}", -scale).parse().unwrap_or(f64::NAN)
}

/// Nanoseconds per unit of a time, and whether it is UTC.
fn find_time_unit(column: &ColumnDescriptor) -> Option<(i64, bool)> {
    match column.logical_type_ref() {
        Some(LogicalType::Timestamp(time)) => {
            let unit = match time.unit {
                TimeUnit::MILLIS => 1_000_000,
                TimeUnit::MICROS => 1000,
                TimeUnit::NANOS => 1,
            };
            Some((unit, time.is_adjusted_to_u_t_c))
        }
        _ => None,
    }
}

fn append_cells(cells: &mut ColumnCells, from: ColumnReader, column: &ColumnDescriptor) -> Result<(), ParquetError> {
    let depth = column.max_def_level();
    #[expect(clippy::cast_precision_loss, reason = "counts and codes of a recording are far below 2^53")]
    let float = |integer: &i64| *integer as f64;
    if let Some(scale) = find_scale(column)
        && let ColumnCells::Numbers(to) = cells
    {
        return match from {
            ColumnReader::Int32ColumnReader(from) => {
                append_column(from, depth, to, f64::NAN, |x| scale_decimal(i128::from(*x), scale))
            }
            ColumnReader::Int64ColumnReader(from) => {
                append_column(from, depth, to, f64::NAN, |x| scale_decimal(i128::from(*x), scale))
            }
            ColumnReader::ByteArrayColumnReader(from) => {
                append_column(from, depth, to, f64::NAN, |x| decode_decimal(x.data(), scale))
            }
            ColumnReader::FixedLenByteArrayColumnReader(from) => {
                append_column(from, depth, to, f64::NAN, |x| decode_decimal(x.data(), scale))
            }
            _ => Err(ParquetError::General("its type changes within the file".to_owned())),
        };
    }
    match (cells, from) {
        (ColumnCells::Cells(to), ColumnReader::Int32ColumnReader(from)) => {
            let day = |x: &i32| OwnedCell::Local(i64::from(*x).saturating_mul(86_400 * SECOND_NS));
            append_column(from, depth, to, OwnedCell::Empty, day)
        }
        (ColumnCells::Cells(to), ColumnReader::Int96ColumnReader(from)) => {
            append_column(from, depth, to, OwnedCell::Empty, |x| OwnedCell::Instant(x.to_nanos()))
        }
        (ColumnCells::Numbers(to), ColumnReader::Int32ColumnReader(from)) => {
            append_column(from, depth, to, f64::NAN, |x| f64::from(*x))
        }
        (ColumnCells::Numbers(to), ColumnReader::Int64ColumnReader(from)) => {
            append_column(from, depth, to, f64::NAN, float)
        }
        (ColumnCells::Numbers(to), ColumnReader::FloatColumnReader(from)) => {
            append_column(from, depth, to, f64::NAN, |x| f64::from(*x))
        }
        (ColumnCells::Numbers(to), ColumnReader::DoubleColumnReader(from)) => {
            append_column(from, depth, to, f64::NAN, |x| *x)
        }
        (ColumnCells::Cells(to), ColumnReader::BoolColumnReader(from)) => {
            append_column(from, depth, to, OwnedCell::Empty, |x| OwnedCell::Flag(*x))
        }
        (ColumnCells::Cells(to), ColumnReader::Int64ColumnReader(from)) => {
            let (unit, is_utc) = find_time_unit(column).unwrap_or((1, true));
            let moment = |x: &i64| {
                let at_ns = x.saturating_mul(unit);
                if is_utc { OwnedCell::Instant(at_ns) } else { OwnedCell::Local(at_ns) }
            };
            append_column(from, depth, to, OwnedCell::Empty, moment)
        }
        (ColumnCells::Cells(to), ColumnReader::ByteArrayColumnReader(from)) => {
            append_column(from, depth, to, OwnedCell::Empty, decode_text)
        }
        _ => Err(ParquetError::General("its type changes within the file".to_owned())),
    }
}

fn decode_text(bytes: &ByteArray) -> OwnedCell {
    OwnedCell::from_text(&String::from_utf8_lossy(bytes.data()))
}

/// Appends every cell of a column of one row group; `depth` 0 is a column without absent values.
fn append_column<T: DataType, V: Clone>(
    mut from: ColumnReaderImpl<T>,
    depth: i16,
    to: &mut Vec<V>,
    absent: V,
    convert: impl Fn(&T::T) -> V,
) -> Result<(), ParquetError> {
    loop {
        let (mut levels, mut values) = (Vec::new(), Vec::new());
        let (records, ..) = from.read_records(BATCH, Some(&mut levels), None, &mut values)?;
        if records == 0 {
            return Ok(());
        }
        let mut present = values.iter();
        for row in 0..records {
            let is_present = depth == 0 || levels.get(row) == Some(&depth);
            to.push(if is_present { present.next().map_or_else(|| absent.clone(), &convert) } else { absent.clone() });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(clippy::float_cmp, reason = "the nearest double, exactly")]
    fn a_decimal_is_the_double_nearest_to_it() {
        assert_eq!(decode_decimal(&[0x30, 0x39], 2), 123.45);
        assert_eq!(decode_decimal(&[0xff, 0xfe], 1), -0.2);
        assert_eq!(decode_decimal(&[0, 0, 0, 7], 0), 7.0);
        assert!(decode_decimal(&[1; 17], 2).is_nan());
    }
}
