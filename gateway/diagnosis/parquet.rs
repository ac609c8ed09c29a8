//! Recordings in Parquet files: one flat column per quantity or text, time as in CSV.

use ::parquet::basic::{LogicalType, TimeUnit};
use ::parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use ::parquet::data_type::{ByteArray, DataType};
use ::parquet::errors::ParquetError;
use ::parquet::file::reader::{FileReader, SerializedFileReader};
use ::parquet::schema::types::ColumnDescriptor;
use adapters::Recording;
use adapters::channel::ChannelId;
use adapters::clock::{SECOND_NS, TimeNs};
use adapters::recording::{Cells, Numbers, ReadRecording, RowProblem, TEXT_COLUMNS, Words};
use std::fs::File;
use std::path::Path;

/// Values read at once.
const BATCH: usize = 8192;
/// Refused rows that are described.
const PROBLEMS_KEPT: usize = 100;

/// A column as read.
struct Read {
    name: String,
    values: ParquetValues,
}

enum ParquetValues {
    Numbers(Vec<Option<f64>>),
    /// Nanoseconds since 1970.
    Times(Vec<Option<TimeNs>>),
    Texts(Vec<Option<String>>),
}

/// Reads a Parquet file as a recording.
pub(super) fn read(path: &Path) -> Result<ReadRecording, String> {
    let file = path.display().to_string();
    let opened = File::open(path).map_err(|error| format!("{file}: {error}. Check the path and the permissions."))?;
    let bad = |error: ParquetError| format!("{file}: not a readable Parquet file: {error}");
    let reader = SerializedFileReader::new(opened).map_err(bad)?;
    let columns = columns(&reader).map_err(|problem| format!("{file}: {problem}"))?;
    assemble(columns, &file).map_err(|problem| format!("{file}: {problem}"))
}

fn columns(reader: &SerializedFileReader<File>) -> Result<Vec<Read>, String> {
    let schema = reader.metadata().file_metadata().schema_descr();
    let mut columns = Vec::new();
    for (index, column) in schema.columns().iter().enumerate() {
        if column.path().parts().len() != 1 || column.max_rep_level() > 0 {
            return Err(format!("column {} is nested; a recording is a flat table", column.path()));
        }
        let mut values = empty(column)?;
        for group in 0..reader.num_row_groups() {
            let group = reader.get_row_group(group).map_err(|error| error.to_string())?;
            let cells = group.get_column_reader(index).map_err(|error| error.to_string())?;
            values.append(cells, column).map_err(|error| format!("column {}: {error}", column.name()))?;
        }
        columns.push(Read { name: column.name().to_owned(), values });
    }
    Ok(columns)
}

fn empty(column: &ColumnDescriptor) -> Result<ParquetValues, String> {
    use ::parquet::basic::Type;
    Ok(match column.physical_type() {
        Type::BYTE_ARRAY => ParquetValues::Texts(Vec::new()),
        Type::INT64 if nanoseconds_per_unit(column).is_some() => ParquetValues::Times(Vec::new()),
        Type::BOOLEAN | Type::INT32 | Type::INT64 | Type::FLOAT | Type::DOUBLE => ParquetValues::Numbers(Vec::new()),
        other => return Err(format!("column {} has the type {other}; use double, integer or text", column.name())),
    })
}

fn nanoseconds_per_unit(column: &ColumnDescriptor) -> Option<i64> {
    match column.logical_type_ref() {
        Some(LogicalType::Timestamp(time)) => Some(match time.unit {
            TimeUnit::MILLIS => 1_000_000,
            TimeUnit::MICROS => 1000,
            TimeUnit::NANOS => 1,
        }),
        _ => None,
    }
}

impl ParquetValues {
    fn append(&mut self, cells: ColumnReader, column: &ColumnDescriptor) -> Result<(), ParquetError> {
        let depth = column.max_def_level();
        match (self, cells) {
            (Self::Numbers(to), ColumnReader::BoolColumnReader(from)) => {
                take(from, depth, to, |x| f64::from(u8::from(*x)))
            }
            (Self::Numbers(to), ColumnReader::Int32ColumnReader(from)) => take(from, depth, to, |x| f64::from(*x)),
            (Self::Numbers(to), ColumnReader::Int64ColumnReader(from)) => take(from, depth, to, |x| float(*x)),
            (Self::Numbers(to), ColumnReader::FloatColumnReader(from)) => take(from, depth, to, |x| f64::from(*x)),
            (Self::Numbers(to), ColumnReader::DoubleColumnReader(from)) => take(from, depth, to, |x| *x),
            (Self::Times(to), ColumnReader::Int64ColumnReader(from)) => {
                let unit = nanoseconds_per_unit(column).unwrap_or(1);
                take(from, depth, to, |x| x.saturating_mul(unit))
            }
            (Self::Texts(to), ColumnReader::ByteArrayColumnReader(from)) => take(from, depth, to, text),
            _ => Err(ParquetError::General("its type changes within the file".to_owned())),
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Numbers(values) => values.len(),
            Self::Times(values) => values.len(),
            Self::Texts(values) => values.len(),
        }
    }

    fn text(&self, row: usize) -> Option<String> {
        match self {
            Self::Numbers(values) => values[row].map(|number| number.to_string()),
            Self::Times(values) => values[row].map(crate::moment::utc),
            Self::Texts(values) => values[row].clone(),
        }
    }
}

#[expect(clippy::cast_precision_loss, reason = "counts and codes of a recording are far below 2^53")]
fn float(integer: i64) -> f64 {
    integer as f64
}

fn text(bytes: &ByteArray) -> String {
    String::from_utf8_lossy(bytes.data()).into_owned()
}

/// Appends every cell of a column of one row group; `depth` 0 is a column without absent values.
fn take<T: DataType, V>(
    mut from: ColumnReaderImpl<T>,
    depth: i16,
    to: &mut Vec<Option<V>>,
    convert: impl Fn(&T::T) -> V,
) -> Result<(), ParquetError> {
    loop {
        let (mut levels, mut values) = (Vec::new(), Vec::new());
        let (records, ..) = from.read_records(BATCH, Some(&mut levels), None, &mut values)?;
        if records == 0 {
            return Ok(());
        }
        let mut present = values.iter();
        let cell = |row: usize| (depth == 0 || levels.get(row) == Some(&depth)).then(|| present.next().map(&convert));
        to.extend((0..records).map(cell).map(Option::flatten));
    }
}

/// Rows are checked as those of a CSV file: time stands, and increases within a run.
fn assemble(columns: Vec<Read>, file: &str) -> Result<ReadRecording, String> {
    let rows = columns.first().map_or(0, |column| column.values.len());
    let find = |name: &str| columns.iter().position(|column| column.name == name);
    let time = find("time_utc").or_else(|| find("time_s"));
    let time = time.ok_or("no column time_s or time_utc; a recording needs one of them")?;
    let utc = columns[time].name == "time_utc";
    let (times, start_ns) = times(&columns[time].values, utc);
    let run = find("run").map(|index| &columns[index].values);
    let (kept, problems, refused) = accepted(&times, utc, run, &columns[time].name);
    if kept.is_empty() {
        let first = problems.first().map(|problem| format!("; first problem: {problem}")).unwrap_or_default();
        return Err(format!("no usable row among {rows}{first}"));
    }
    let time_s = kept.iter().filter_map(|row| times[*row].as_ref().ok().copied()).collect();
    let mut recording = Recording::new(file, time_s, start_ns);
    for column in columns.iter().filter(|column| !["time_s", "time_utc"].contains(&column.name.as_str())) {
        recording.set_column(&column.name, cells(column, &kept)?);
    }
    Ok(ReadRecording { recording, problems, refused })
}

/// Seconds per row, or what is wrong; and the time of the first row under `time_utc`.
fn times(values: &ParquetValues, utc: bool) -> (Vec<Result<f64, String>>, Option<TimeNs>) {
    if !utc {
        let of = |row: usize| match values {
            ParquetValues::Numbers(numbers) => numbers[row].filter(|time| time.is_finite()).ok_or("no time".to_owned()),
            _ => Err("time_s must hold numbers".to_owned()),
        };
        return ((0..values.len()).map(of).collect(), None);
    }
    let stamp = |row: usize| match values {
        ParquetValues::Times(times) => times[row].ok_or_else(|| "no time".to_owned()),
        ParquetValues::Texts(texts) => {
            let text = texts[row].as_deref().ok_or("no time")?;
            let stamp = text.parse::<jiff::Timestamp>().map_err(|_| format!("{text:?} is not a time (RFC 3339)"))?;
            i64::try_from(stamp.as_nanosecond()).map_err(|_| format!("{text} is outside the years 1678 to 2261"))
        }
        ParquetValues::Numbers(_) => Err("time_utc must hold timestamps or text (RFC 3339)".to_owned()),
    };
    let stamps: Vec<Result<TimeNs, String>> = (0..values.len()).map(stamp).collect();
    let start_ns = stamps.iter().flatten().next().copied();
    let since = |ns: TimeNs| float(ns - start_ns.unwrap_or(ns)) / float(SECOND_NS);
    (stamps.into_iter().map(|stamp| stamp.map(since)).collect(), start_ns)
}

fn accepted(
    times: &[Result<f64, String>],
    utc: bool,
    run: Option<&ParquetValues>,
    column: &str,
) -> (Vec<usize>, Vec<RowProblem>, u64) {
    let (mut kept, mut problems, mut refused) = (Vec::new(), Vec::new(), 0);
    let mut last: Option<(f64, Option<String>)> = None;
    for (row, time) in times.iter().enumerate() {
        let name = run.and_then(|run| run.text(row));
        let problem = match (time, &last) {
            (Err(reason), _) => Some(reason.clone()),
            (Ok(time), Some((before, same))) if (utc || *same == name) && time < before => {
                Some(format!("time goes back from {before} s to {time} s"))
            }
            _ => None,
        };
        match (problem, time) {
            (None, Ok(time)) => {
                kept.push(row);
                last = Some((*time, name));
            }
            (problem, _) => {
                refused += 1;
                if problems.len() < PROBLEMS_KEPT {
                    let reason = format!("row {}: {}", row + 1, problem.unwrap_or_default());
                    problems.push(RowProblem { line: row as u64 + 1, column: Some(column.to_owned()), reason });
                }
            }
        }
    }
    (kept, problems, refused)
}

fn cells(column: &Read, kept: &[usize]) -> Result<Cells, String> {
    let is_text = TEXT_COLUMNS.contains(&column.name.as_str()) || column.name.ends_with("_missing");
    let is_channel = ChannelId::of(&column.name).is_some();
    match &column.values {
        ParquetValues::Numbers(numbers) if !is_text => {
            Ok(Cells::Numbers(kept.iter().map(|row| numbers[*row]).collect::<Numbers>()))
        }
        ParquetValues::Texts(_) if is_channel && !is_text => {
            Err(format!("column {} holds text; this channel holds numbers", column.name))
        }
        values => {
            let mut words = Words::default();
            kept.iter().for_each(|row| words.push(values.text(*row).as_deref().unwrap_or("")));
            Ok(Cells::Words(words))
        }
    }
}
