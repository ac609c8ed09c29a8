//! Recordings as Parquet: a flat table. Times with a zone are moments, those without one are of the clock on the wall.

use super::super::error::RecordingError;
use super::super::input::Input;
use super::super::limits::CELLS_MAX;
use super::super::table::{ColumnCells, ColumnTable, OwnedCell};
use ::parquet::basic::{LogicalType, TimeUnit, Type};
use ::parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use ::parquet::data_type::{ByteArray, DataType};
use ::parquet::errors::ParquetError;
use ::parquet::file::reader::{FileReader, SerializedFileReader};
use ::parquet::schema::types::ColumnDescriptor;
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
        if column.path().parts().len() != 1 || column.max_rep_level() > 0 {
            let en = format!("column {} is nested; a recording is a flat table", column.path());
            return Err(RecordingError::with_format_reason(
                &input.file,
                en,
                format!("列{}是嵌套结构；记录应为平面表", column.path()),
            ));
        }
        let Some(mut cells) = build_empty_cells(column) else {
            let en = format!(
                "column {} has the type {}; use double, integer or text",
                column.name(),
                column.physical_type()
            );
            return Err(RecordingError::with_format_reason(
                &input.file,
                en,
                format!("列{}的类型{}不支持；请用双精度、整数或文本", column.name(), column.physical_type()),
            ));
        };
        for group in 0..reader.num_row_groups() {
            let group = reader.get_row_group(group).map_err(bad)?;
            append_cells(&mut cells, group.get_column_reader(index).map_err(bad)?, column).map_err(bad)?;
        }
        // The index that pandas writes without a name.
        let name = if column.name().starts_with("__index_level_") { "index" } else { column.name() };
        table.columns.push((name.to_owned(), cells));
    }
    Ok(table)
}

fn build_empty_cells(column: &ColumnDescriptor) -> Option<ColumnCells> {
    Some(match column.physical_type() {
        Type::BYTE_ARRAY => ColumnCells::Cells(Vec::new()),
        Type::INT64 if find_time_unit(column).is_some() => ColumnCells::Cells(Vec::new()),
        Type::BOOLEAN => ColumnCells::Cells(Vec::new()),
        Type::INT32 | Type::INT64 | Type::FLOAT | Type::DOUBLE => ColumnCells::Numbers(Vec::new()),
        _ => return None,
    })
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
    match (cells, from) {
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
