//! A time range as Parquet: one column per series, values optional, zstd.

use super::super::error::{HistoryError, add_path};
use super::super::query::{Chunk, Query};
use super::super::reader::Reader;
use super::super::series_kind::SeriesKind;
use super::{ColumnPlan, RUN, run_text};
use ::parquet::basic::{Compression, LogicalType, Repetition, TimeUnit, Type as Physical, ZstdLevel};
use ::parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use ::parquet::errors::ParquetError;
use ::parquet::file::metadata::KeyValue;
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use ::parquet::schema::types::{Type, TypePtr};
use gateway_records::Diagnosis;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

/// Rows of a row group: bounds the memory of an export of any length.
const GROUP_ROWS: usize = 65_536;

/// Values of one column of the running row group.
enum ColumnValues {
    Times(Vec<i64>),
    Numbers(Vec<f64>, Vec<i16>),
    Texts(Vec<ByteArray>, Vec<i16>),
}

pub(super) fn write(
    reader: &Reader,
    query: &Query,
    plan: &ColumnPlan,
    about: &[(String, String)],
    out: impl Write + Send,
    path: &Path,
) -> Result<u64, HistoryError> {
    let say = |error: ParquetError| add_path(path)(std::io::Error::other(error));
    let mut group = Group::new(plan);
    let numbers = plan.series.iter().filter(|(series, _)| series.kind == SeriesKind::Number);
    let units = numbers.map(|(series, _)| (format!("unit.{}", series.name), series.unit.to_string()));
    let schema = build_schema(plan).map_err(say)?;
    let properties = build_properties(about.iter().cloned().chain(units));
    let mut file = SerializedFileWriter::new(out, schema, properties).map_err(say)?;
    let mut problem = None;
    let mut rows = 0;
    reader.for_each_chunk(&Query { series: plan.series_names(), ..query.clone() }, |chunk| {
        group.add(chunk);
        rows += chunk.at_ns.len() as u64;
        if group.rows >= GROUP_ROWS {
            problem = group.write(&mut file).err();
        }
        if problem.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    match problem {
        Some(error) => return Err(say(error)),
        None if group.rows > 0 => group.write(&mut file).map_err(say)?,
        None => {}
    }
    file.finish().map_err(say)?;
    file.inner_mut().flush().map_err(add_path(path))?;
    Ok(rows)
}

/// Compressed, with these pairs in the metadata of the file.
fn build_properties(pairs: impl Iterator<Item = (String, String)>) -> Arc<WriterProperties> {
    let pairs = pairs.map(|(key, value)| KeyValue::new(key, value)).collect();
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_key_value_metadata(Some(pairs))
        .set_created_by(concat!("cnc-gateway ", env!("CARGO_PKG_VERSION")).to_owned());
    Arc::new(properties.build())
}

/// Writes diagnoses: `time_utc`, `from_utc`, `to_utc`, `verdict`, `summary`, `diagnosis` (JSON).
pub(super) fn write_diagnoses(
    rows: &[Diagnosis],
    machine: &str,
    out: impl Write + Send,
    path: &Path,
) -> Result<u64, HistoryError> {
    let say = |error: ParquetError| add_path(path)(std::io::Error::other(error));
    let fields = || -> Result<Vec<TypePtr>, ParquetError> {
        let times = ["time_utc", "from_utc", "to_utc"].map(utc_field);
        let texts = ["verdict", "summary", "diagnosis"].map(text_field);
        times.into_iter().chain(texts).collect()
    };
    let schema = fields().and_then(|fields| Type::group_type_builder("diagnoses").with_fields(fields).build());
    let about = [("machine".to_owned(), machine.to_owned())];
    let properties = build_properties(about.into_iter());
    let mut file = SerializedFileWriter::new(out, Arc::new(schema.map_err(say)?), properties).map_err(say)?;
    let mut group = file.next_row_group().map_err(say)?;
    let mut index = 0;
    while let Some(column) = group.next_column().map_err(say)? {
        if index < 3 {
            let times: Vec<i64> = rows.iter().map(|row| [row.at_ns, row.from_ns, row.to_ns][index]).collect();
            write_column::<Int64Type>(column, &times, None).map_err(say)?;
        } else {
            let texts: Vec<ByteArray> =
                rows.iter().map(|row| [&row.verdict, &row.summary, &row.json][index - 3].as_str().into()).collect();
            write_column::<ByteArrayType>(column, &texts, Some(&vec![1; rows.len()])).map_err(say)?;
        }
        index += 1;
    }
    group.close().map_err(say)?;
    file.finish().map_err(say)?;
    file.inner_mut().flush().map_err(add_path(path))?;
    Ok(rows.len() as u64)
}

fn utc_field(name: &str) -> Result<TypePtr, ParquetError> {
    let utc = LogicalType::timestamp(true, TimeUnit::NANOS);
    let field = Type::primitive_type_builder(name, Physical::INT64).with_logical_type(Some(utc));
    field.with_repetition(Repetition::REQUIRED).build().map(Arc::new)
}

fn build_schema(plan: &ColumnPlan) -> Result<TypePtr, ParquetError> {
    let mut fields = vec![time_field(plan)?];
    if !plan.monotone && !plan.has_run() {
        fields.push(text_field(RUN)?);
    }
    for (series, missing) in &plan.series {
        fields.push(match series.kind {
            SeriesKind::Number => number_field(&series.name)?,
            SeriesKind::Text => text_field(&series.name)?,
        });
        if *missing {
            fields.push(text_field(&format!("{}_missing", series.name))?);
        }
    }
    Type::group_type_builder("recording").with_fields(fields).build().map(Arc::new)
}

fn time_field(plan: &ColumnPlan) -> Result<TypePtr, ParquetError> {
    let field = if plan.monotone {
        let utc = LogicalType::timestamp(true, TimeUnit::NANOS);
        Type::primitive_type_builder("time_utc", Physical::INT64).with_logical_type(Some(utc))
    } else {
        Type::primitive_type_builder("time_s", Physical::DOUBLE)
    };
    field.with_repetition(Repetition::REQUIRED).build().map(Arc::new)
}

fn number_field(name: &str) -> Result<TypePtr, ParquetError> {
    Type::primitive_type_builder(name, Physical::DOUBLE).with_repetition(Repetition::OPTIONAL).build().map(Arc::new)
}

fn text_field(name: &str) -> Result<TypePtr, ParquetError> {
    Type::primitive_type_builder(name, Physical::BYTE_ARRAY)
        .with_logical_type(Some(LogicalType::String))
        .with_repetition(Repetition::OPTIONAL)
        .build()
        .map(Arc::new)
}

/// The running row group.
struct Group<'a> {
    plan: &'a ColumnPlan,
    columns: Vec<ColumnValues>,
    rows: usize,
}

impl<'a> Group<'a> {
    fn new(plan: &'a ColumnPlan) -> Self {
        Self { plan, columns: build_empty_columns(plan), rows: 0 }
    }

    fn add(&mut self, chunk: &Chunk<'_>) {
        self.rows += chunk.at_ns.len();
        let mut columns = self.columns.iter_mut();
        // The columns stand in the order of the schema, so each series finds its own next.
        let mut fill = |cell: &dyn Fn(usize) -> ParquetCell| {
            if let Some(values) = columns.next() {
                (0..chunk.at_ns.len()).for_each(|row| values.push(cell(row)));
            }
        };
        let plan = self.plan;
        if plan.monotone {
            fill(&|row| ParquetCell::Time(chunk.at_ns[row]));
        } else {
            fill(&|row| ParquetCell::Number(Some(plan.seconds_since_start(chunk.at_ns[row]))));
        }
        if !plan.monotone && !plan.has_run() {
            fill(&|_| ParquetCell::Text(Some(run_text(chunk.segment, None))));
        }
        for (index, (series, missing)) in plan.series.iter().enumerate() {
            let column = &chunk.columns[index];
            match series.kind {
                SeriesKind::Number => fill(&|row| ParquetCell::Number(column.number_at(row))),
                SeriesKind::Text if !plan.monotone && &*series.name == RUN => {
                    fill(&|row| ParquetCell::Text(Some(run_text(chunk.segment, column.word_at(row)))));
                }
                SeriesKind::Text => fill(&|row| ParquetCell::Text(column.word_at(row).map(str::to_owned))),
            }
            if *missing {
                let reason = |row| chunk.missing_reason(index, row).filter(|word| *word != "not_provided");
                fill(&|row| ParquetCell::Text(reason(row).map(str::to_owned)));
            }
        }
    }

    fn write<W: Write + Send>(&mut self, file: &mut SerializedFileWriter<W>) -> Result<(), ParquetError> {
        let mut group = file.next_row_group()?;
        for values in &self.columns {
            let Some(column) = group.next_column()? else { break };
            match values {
                ColumnValues::Times(times) => write_column::<Int64Type>(column, times, None)?,
                ColumnValues::Numbers(numbers, levels) => {
                    write_column::<DoubleType>(column, numbers, self.levels_if_optional(levels))?
                }
                ColumnValues::Texts(texts, levels) => {
                    write_column::<ByteArrayType>(column, texts, self.levels_if_optional(levels))?
                }
            }
        }
        group.close()?;
        (self.columns, self.rows) = (build_empty_columns(self.plan), 0);
        Ok(())
    }

    /// The levels of an optional column; the required `time_s` keeps none.
    fn levels_if_optional<'b>(&self, levels: &'b [i16]) -> Option<&'b [i16]> {
        (!levels.is_empty()).then_some(levels)
    }
}

enum ParquetCell {
    Time(i64),
    Number(Option<f64>),
    Text(Option<String>),
}

impl ColumnValues {
    fn push(&mut self, cell: ParquetCell) {
        match (self, cell) {
            (Self::Times(times), ParquetCell::Time(at_ns)) => times.push(at_ns),
            (Self::Numbers(numbers, levels), ParquetCell::Number(number)) => {
                levels.push(i16::from(number.is_some()));
                numbers.extend(number);
            }
            (Self::Texts(texts, levels), ParquetCell::Text(text)) => {
                levels.push(i16::from(text.is_some()));
                texts.extend(text.as_deref().map(ByteArray::from));
            }
            _ => {}
        }
    }
}

fn build_empty_columns(plan: &ColumnPlan) -> Vec<ColumnValues> {
    let texts = || ColumnValues::Texts(Vec::new(), Vec::new());
    let numbers = || ColumnValues::Numbers(Vec::new(), Vec::new());
    let mut columns = vec![if plan.monotone { ColumnValues::Times(Vec::new()) } else { numbers() }];
    if !plan.monotone && !plan.has_run() {
        columns.push(texts());
    }
    for (series, missing) in &plan.series {
        columns.push(if series.kind == SeriesKind::Number { numbers() } else { texts() });
        if *missing {
            columns.push(texts());
        }
    }
    columns
}

fn write_column<T: DataType>(
    mut column: SerializedColumnWriter<'_>,
    values: &[T::T],
    levels: Option<&[i16]>,
) -> Result<(), ParquetError> {
    column.typed::<T>().write_batch(values, levels, None)?;
    column.close()
}
