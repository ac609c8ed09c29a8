//! `cnc-gateway history`: what the box remembers.

use super::installation::load_configuration;
use super::{CannotRun, CommandOutcome, CommandResult, print_json, print_text};
use crate::history::{DAY_NS, HistoryError, Query, Reader, SqlValue, day_of, plain_cell};
use crate::records::{RecordKind, RecordQuery, build_document, read_records};
use crate::{moment, samples};
use adapters::clock::{SECOND_NS, TimeNs};
use clap::{Args, Subcommand, ValueEnum};
use serde_json::{Map, Value, json};
use std::io::{BufWriter, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Duration;

#[derive(Debug, Args)]
pub(super) struct HistoryArguments {
    /// History database; without it that of the data directory.
    #[arg(long, global = true, value_name = "DB", conflicts_with = "data_dir")]
    history: Option<PathBuf>,
    /// Data directory of the gateway; without it that of the configuration.
    #[arg(long, global = true, value_name = "DIR")]
    data_dir: Option<PathBuf>,
    #[command(subcommand)]
    question: Question,
}

#[derive(Debug, Subcommand)]
enum Question {
    /// Samples, records or a statement of your own, as CSV or JSON.
    Query(QueryArguments),
    /// Samples into a file: .csv, .csv.gz or .parquet, a recording that replay and diagnose read.
    Export(ExportArguments),
    /// Whole days into a directory that DuckDB, ClickHouse or Spark read: machine=NAME/date=DAY.
    Partitions(PartitionArguments),
    /// The audit of the gate: every request, refusal, write and arming.
    Audit(super::audit::AuditArguments),
    /// Save everything that is whole from a damaged history into a new file.
    Repair(super::history_upkeep::RepairArguments),
    /// Move rows that are dated after now into a file of their own.
    SetApart(super::history_upkeep::SetApartArguments),
    /// How much there is, how fast it grows and how long the disk lasts.
    Info {
        /// Print as JSON.
        #[arg(long)]
        json: bool,
    },
}

#[derive(Debug, Args)]
struct Selection {
    /// Beginning: 2026-01-31T08:15:00Z, 2026-01-31, or a time before the newest sample such as -10m, -8h, -7d.
    #[arg(long, allow_hyphen_values = true, value_name = "TIME")]
    from: Option<String>,
    /// End (excluded), in the same notation.
    #[arg(long, allow_hyphen_values = true, value_name = "TIME")]
    to: Option<String>,
    /// Channels and estimates, separated by commas; all that were delivered when left out.
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    channels: Vec<String>,
    /// Only samples in this machine state.
    #[arg(long)]
    state: Option<String>,
    /// Only samples of this NC program.
    #[arg(long)]
    program: Option<String>,
    /// Only samples of this tool.
    #[arg(long)]
    tool: Option<String>,
}

#[derive(Debug, Args)]
struct QueryArguments {
    #[command(flatten)]
    selection: Selection,
    /// Length of a bucket in seconds, with mean, least and greatest value; without it every sample.
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    resolution: Option<f64>,
    /// Records instead of samples.
    #[arg(long, value_enum, value_name = "KIND", conflicts_with_all = ["resolution", "channels", "sql"])]
    records: Option<RecordKind>,
    /// One SELECT over the tables, the views and the virtual table `samples`.
    #[arg(long, value_name = "SELECT", conflicts_with_all = ["resolution", "channels"])]
    sql: Option<String>,
    /// The statement of --sql is given up after so long, seconds.
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds, default_value = "60")]
    limit_s: f64,
    /// Form of the answer.
    #[arg(long, value_enum, default_value_t = OutputFormat::Csv)]
    format: OutputFormat,
    /// The same as --format json.
    #[arg(long)]
    json: bool,
    /// At most so many records, the newest ones.
    #[arg(long, default_value_t = 10_000)]
    limit: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum OutputFormat {
    Csv,
    Json,
}

#[derive(Debug, Args)]
struct ExportArguments {
    /// The file; its ending decides the format.
    file: PathBuf,
    #[command(flatten)]
    selection: Selection,
}

#[derive(Debug, Args)]
struct PartitionArguments {
    /// The directory; it is made where it is missing.
    directory: PathBuf,
    /// Name of the machine in the path.
    #[arg(long, value_name = "NAME")]
    machine: String,
    /// First day: 2026-01-31, or a time before the newest sample such as -7d; the first of the history when left out.
    #[arg(long, allow_hyphen_values = true, value_name = "DAY")]
    from: Option<String>,
    /// Last day (included), in the same notation; the running day when left out, as far as it has got.
    #[arg(long, allow_hyphen_values = true, value_name = "DAY")]
    to: Option<String>,
}

impl PartitionArguments {
    fn write(&self, reader: &Reader) -> CommandResult {
        let span = reader.read_present_span().map_err(CannotRun::from_error)?;
        let Some((first_ns, newest_ns)) = span else {
            return Err(CannotRun::new("the history holds no samples", "let the gateway run first"));
        };
        let day = |text: &Option<String>, otherwise| match text {
            Some(text) => moment::parse(text, newest_ns).map(day_of).map_err(CannotRun::from_error),
            None => Ok(day_of(otherwise)),
        };
        let (from_ns, to_ns) = (day(&self.from, first_ns)?, day(&self.to, newest_ns)?);
        let mut day_ns = from_ns.max(day_of(first_ns));
        while day_ns <= to_ns.min(newest_ns) {
            let written = reader.export_day(&self.directory, &self.machine, day_ns).map_err(CannotRun::from_error)?;
            let date: String = moment::format_utc(day_ns).chars().take(10).collect();
            print_text(&format!("{date}: {} samples, {} diagnoses\n", written.samples, written.diagnoses));
            day_ns += DAY_NS;
        }
        Ok(CommandOutcome::Fine)
    }
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds <= 31_622_400.0 => Ok(seconds),
        _ => Err("give a number of seconds above 0, at most a year".to_owned()),
    }
}

pub(super) fn run(arguments: HistoryArguments) -> CommandResult {
    let of_directory = arguments.data_dir.map(|directory| directory.join("history.db"));
    let path = &match arguments.history.or(of_directory) {
        Some(path) => path,
        // As every other command: the installed box, else the built-in configuration.
        None => load_configuration(None)?.history.path,
    };
    let open = || Reader::open(path).map_err(CannotRun::from_error);
    let reader = match arguments.question {
        Question::Repair(repair) => return super::history_upkeep::repair_history(&repair, path),
        Question::SetApart(apart) => return super::history_upkeep::set_apart(&apart, path),
        _ => open()?,
    };
    let answered = answer_question(arguments.question, &reader, path)?;
    let damaged = reader.damaged_rows();
    for rows in &damaged {
        eprintln!(
            "cnc-gateway: {rows} were changed by the disk and are left out; `cnc-gateway history repair NEW` saves the others"
        );
    }
    Ok(if damaged.is_empty() { answered } else { CommandOutcome::No })
}

fn answer_question(question: Question, reader: &Reader, path: &Path) -> CommandResult {
    match question {
        Question::Repair(_) | Question::SetApart(_) => Ok(CommandOutcome::Fine),
        Question::Info { json } => print_info(reader, json),
        Question::Export(export) => {
            let (query, _) = export.selection.build_query(reader)?;
            let rows = reader.export_to_file(&query, &export.file).map_err(CannotRun::from_error)?;
            print_text(&format!("{rows} rows written to {}\n", export.file.display()));
            Ok(CommandOutcome::Fine)
        }
        Question::Query(query) => query.answer_query(reader, path),
        Question::Partitions(partitions) => partitions.write(reader),
        Question::Audit(audit) => super::audit::answer_audit(&audit, reader),
    }
}

fn print_info(reader: &Reader, json: bool) -> CommandResult {
    let info = reader.read_info().map_err(CannotRun::from_error)?;
    if json {
        let mut document = json!({ "schema": "history-info/1" });
        if let (Value::Object(document), Ok(Value::Object(fields))) = (&mut document, serde_json::to_value(&info)) {
            document.extend(fields);
        }
        print_json(&document);
    } else {
        print_text(&info.to_string());
    }
    Ok(CommandOutcome::Fine)
}

/// Samples trail the clock by what the merge waits for the slowest source: 0.4 s at ordinary periods, 20 times as much at
/// `--speed 20`. Records are dated by the clock. A minute is more than that, and less than a wrong clock is worth.
const SAMPLES_BEHIND_NS: TimeNs = 60 * SECOND_NS;

impl Selection {
    /// The question, and its range with both ends named.
    fn build_query(&self, reader: &Reader) -> Result<(Query, (TimeNs, TimeNs)), CannotRun> {
        let span = reader.read_present_span().map_err(CannotRun::from_error)?;
        let (first_ns, newest_ns) = span.unwrap_or((0, 0));
        let moment = |text: &Option<String>| {
            text.as_ref().map(|text| moment::parse(text, newest_ns).map_err(CannotRun::from_error)).transpose()
        };
        let from_ns = moment(&self.from)?.unwrap_or(first_ns);
        let to_ns = moment(&self.to)?.unwrap_or(newest_ns.saturating_add(1));
        let query = Query {
            from_ns: Some(from_ns),
            to_ns: Some(to_ns),
            series: self.channels.clone(),
            state: self.state.clone(),
            program: self.program.clone(),
            tool: self.tool.clone(),
        };
        Ok((query, (from_ns, to_ns)))
    }
}

impl QueryArguments {
    fn answer_query(&self, reader: &Reader, path: &Path) -> CommandResult {
        let (query, range) = self.selection.build_query(reader)?;
        let json = self.json || self.format == OutputFormat::Json;
        let out = BufWriter::new(std::io::stdout().lock());
        let done = match (&self.records, &self.sql, self.resolution) {
            (Some(kind), ..) => self.answer_records(reader, *kind, range, json, out),
            (None, Some(sql), _) => answer_sql(reader, (sql, Duration::from_secs_f64(self.limit_s)), json, out),
            (None, None, Some(resolution_s)) if json => {
                samples::read_bucketed(reader, &query, resolution_s, usize::MAX)
                    .map(|series| print_json(&samples::build_document(range, resolution_s, series)))
            }
            (None, None, Some(resolution_s)) => samples::bucketed_csv(reader, &query, resolution_s, out),
            (None, None, None) if json => samples::read_raw(reader, &query, usize::MAX)
                .map(|series| print_json(&samples::build_document(range, 0.0, series))),
            (None, None, None) => reader.export_csv(&query, out, path).map(drop),
        };
        done.map(|()| CommandOutcome::Fine).map_err(CannotRun::from_error)
    }

    fn answer_records(
        &self,
        reader: &Reader,
        kind: RecordKind,
        (from_ns, to_ns): (TimeNs, TimeNs),
        json: bool,
        out: impl Write,
    ) -> Result<(), HistoryError> {
        // Without an end, everything up to the end is meant, and a record may be newer than the newest sample.
        let to_ns = if self.selection.to.is_some() { to_ns } else { to_ns.saturating_add(SAMPLES_BEHIND_NS) };
        let query = RecordQuery { from_ns, to_ns, state: self.selection.state.clone(), limit: self.limit };
        let found = read_records(reader, kind, &query)?;
        if json {
            print_json(&build_document(kind, &query, found));
            return Ok(());
        }
        let mut table = CsvTable::new(out);
        found
            .rows
            .iter()
            .filter_map(Value::as_object)
            .try_for_each(|row| table.write_row(row))
            .map_err(to_history_error)
    }
}

fn to_history_error(error: csv::Error) -> HistoryError {
    HistoryError::Io { path: "the output".into(), error: std::io::Error::other(error) }
}

/// Objects as lines of CSV.
struct CsvTable<W: Write> {
    csv: csv::Writer<W>,
    headed: bool,
}

impl<W: Write> CsvTable<W> {
    fn new(out: W) -> Self {
        Self { csv: csv::Writer::from_writer(out), headed: false }
    }

    fn write_row(&mut self, row: &Map<String, Value>) -> Result<(), csv::Error> {
        if !self.headed {
            self.csv.write_record(row.keys())?;
            self.headed = true;
        }
        self.csv.write_record(row.values().map(|value| match value {
            Value::String(text) => plain_cell(text),
            Value::Null => String::new(),
            other => other.to_string(),
        }))
    }
}

/// Rows of one document of JSON, which is made as a whole.
const JSON_ROWS_MAX: usize = 1_000_000;

fn answer_sql(
    reader: &Reader,
    (sql, limit): (&str, Duration),
    json: bool,
    out: impl Write,
) -> Result<(), HistoryError> {
    let mut rows = Vec::new();
    let mut table = CsvTable::new(out);
    let (mut failed, mut too_many) = (None, false);
    reader.run_sql(sql, limit, |names, values| {
        let row: Map<String, Value> = names.iter().cloned().zip(values.iter().map(json_of)).collect();
        if json && rows.len() >= JSON_ROWS_MAX {
            too_many = true;
            return ControlFlow::Break(());
        }
        if json {
            rows.push(Value::Object(row));
        } else if let Err(error) = table.write_row(&row) {
            failed = Some(error);
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    })?;
    if too_many {
        return Err(HistoryError::Question(format!("more than {JSON_ROWS_MAX} rows: ask for CSV, or for less")));
    }
    if json {
        print_json(&json!({ "schema": "sql/1", "rows": rows }));
    }
    failed.map_or(Ok(()), |error| Err(to_history_error(error)))
}

fn json_of(value: &SqlValue) -> Value {
    match value {
        SqlValue::Null => Value::Null,
        SqlValue::Integer(number) => json!(number),
        SqlValue::Real(number) => json!(number),
        SqlValue::Text(text) => json!(text),
        SqlValue::Blob(bytes) => json!(format!("{} bytes", bytes.len())),
    }
}
