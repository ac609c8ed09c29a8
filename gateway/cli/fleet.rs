//! `cnc-gateway fleet`: many boxes, one database.

use super::{CannotRun, CommandOutcome, CommandResult, fleet_resend, print_text};
use crate::fleet::ingest::{self, Done, IngestSettings};
use crate::fleet::questions::{QUESTIONS, of_name};
use crate::fleet::retention::{self, Going, KEEPING};
use crate::fleet::{DatabaseSettings, TABLES, VIEWS, parse_cluster};
use crate::nats::{Connection, NatsTarget, StreamSettings};
use crate::signals::{SignalRequest, Signals};
use clap::{Args, Subcommand};
use std::path::PathBuf;
use std::time::Duration;

/// What is asked for.
#[derive(Debug, Subcommand)]
pub(super) enum Fleet {
    /// Take what the boxes send from a NATS JetStream stream, and write it into PostgreSQL.
    Ingest(IngestArguments),
    /// Create the stream that takes what the boxes send, unless it is there.
    Stream(StreamArguments),
    /// Send a stretch of the history once more, to a sink that came later or whose receiver has lost it. On the box, which may run.
    Resend(fleet_resend::ResendArguments),
    /// Remove what is too old from the database.
    Retain(RetainArguments),
    /// Print the tables, or a question over all machines.
    Sql {
        /// `tables`, or the name of a question; without one, the names.
        name: Option<String>,
    },
}

#[derive(Debug, Args)]
pub(super) struct DatabaseArguments {
    /// The database: postgres://USER@HOST:5432/DATABASE; on another computer with ?sslmode=require&ca=/etc/cnc/ca.pem, which encrypts
    /// the line and checks the certificate.
    #[arg(long, value_name = "ADDRESS")]
    database: String,
    /// The file whose first line is the password of the database.
    #[arg(long, value_name = "FILE")]
    password_file: Option<PathBuf>,
}

impl DatabaseArguments {
    fn to_settings(&self) -> DatabaseSettings {
        DatabaseSettings { address: self.database.clone(), password_file: self.password_file.clone() }
    }
}

/// How long what is kept, days.
#[derive(Debug, Args)]
pub(super) struct RetainArguments {
    #[command(flatten)]
    database: DatabaseArguments,
    /// Raw items.
    #[arg(long, default_value_t = KEEPING[0].days, value_name = "DAYS")]
    items_d: u32,
    /// Means of minutes.
    #[arg(long, default_value_t = KEEPING[1].days, value_name = "DAYS")]
    minutes_d: u32,
    /// Means of hours and days.
    #[arg(long, default_value_t = KEEPING[2].days, value_name = "DAYS")]
    hours_d: u32,
    /// States, parts, operations, events, diagnoses, gaps and facts.
    #[arg(long, default_value_t = KEEPING[3].days, value_name = "DAYS")]
    records_d: u32,
    /// Alarms and decisions.
    #[arg(long, default_value_t = KEEPING[4].days, value_name = "DAYS")]
    alarms_d: u32,
    /// Refused messages.
    #[arg(long, default_value_t = KEEPING[5].days, value_name = "DAYS")]
    refused_d: u32,
    /// Say what would go, and change nothing.
    #[arg(long)]
    dry_run: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
pub(super) struct StreamArguments {
    /// The cluster and the beginning of the subjects: nats://SERVER:4222,SERVER:4222/PREFIX, the same as in the boxes' [[sink]].
    address: String,
    /// Name of the stream.
    #[arg(long, default_value = "CNC", value_name = "NAME")]
    stream: String,
    /// On how many servers it lies; with 3 one may fail.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=5))]
    replicas: u32,
    /// How long messages are kept, days.
    #[arg(long, default_value_t = 7, value_name = "DAYS", value_parser = clap::value_parser!(u32).range(1..=3660))]
    max_age_d: u32,
    /// Greatest size on each server, GB; beyond it new messages are refused and wait in the boxes. Without it 10, or less where the servers
    /// have no room for that.
    #[arg(long, value_name = "GB")]
    max_gb: Option<f64>,
}

/// From the stream into the database.
#[derive(Debug, Args)]
pub(super) struct IngestArguments {
    #[command(flatten)]
    stream: StreamArguments,
    #[command(flatten)]
    database: DatabaseArguments,
    /// Name of the durable consumer; all that share the work give the same.
    #[arg(long, default_value = "fleet", value_name = "NAME")]
    consumer: String,
    /// End when nothing is left to do, instead of waiting for more.
    #[arg(long)]
    once: bool,
}

/// Size of a stream where nobody says one, GB: a week of some ten machines.
const STREAM_GB: f64 = 10.0;
/// A second copy of a message within this time is not stored a second time; PostgreSQL recognises later ones.
const DUPLICATE_WINDOW: Duration = Duration::from_secs(120);

impl StreamArguments {
    fn parse_settings(&self) -> Result<(NatsTarget, StreamSettings), CannotRun> {
        let (servers, prefix) = parse_cluster(&self.address).map_err(CannotRun::from_error)?;
        let plain = |letter: char| letter.is_ascii_alphanumeric() || letter == '-' || letter == '_';
        if self.stream.is_empty() || !self.stream.chars().all(plain) {
            return Err(CannotRun::new(
                format!("{:?} is no name of a stream", self.stream),
                "use letters, digits, - and _",
            ));
        }
        let max_gb = self.max_gb.unwrap_or(STREAM_GB);
        if !(max_gb > 0.0 && max_gb <= 1e6) {
            return Err(CannotRun::new("--max-gb is out of range", "give a size above 0"));
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within the range that was checked"
        )]
        let max_bytes = (max_gb * 1e9) as u64;
        let settings = StreamSettings {
            name: self.stream.clone(),
            subjects: format!("{prefix}.>"),
            replicas: self.replicas,
            max_age: Duration::from_secs(86_400 * u64::from(self.max_age_d)),
            max_bytes,
            may_shrink: self.max_gb.is_none(),
            duplicate_window: DUPLICATE_WINDOW,
        };
        Ok((servers, settings))
    }
}

/// Does what is asked for.
pub(super) fn run(fleet: Fleet) -> CommandResult {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| CannotRun::new(format!("no threads: {error}"), ""))?;
    match fleet {
        Fleet::Ingest(arguments) => runtime.block_on(ingest_stream(&arguments)),
        Fleet::Stream(arguments) => runtime.block_on(create_stream(&arguments)),
        Fleet::Resend(arguments) => runtime.block_on(fleet_resend::resend_stretch(&arguments)),
        Fleet::Retain(arguments) => runtime.block_on(apply_retention(&arguments)),
        Fleet::Sql { name } => print_sql(name.as_deref()),
    }
}

fn print_sql(name: Option<&str>) -> CommandResult {
    let names = || QUESTIONS.iter().map(|question| question.name).collect::<Vec<_>>().join(", ");
    match name {
        None => print_text(&format!("tables, {}\n", names())),
        Some("tables") => print_text(&format!("{TABLES}{VIEWS}")),
        Some(name) => match of_name(name) {
            Some(question) => print_text(question.sql),
            None => return Err(CannotRun::new(format!("{name} is no question"), format!("write tables, {}", names()))),
        },
    }
    Ok(CommandOutcome::Fine)
}

async fn apply_retention(arguments: &RetainArguments) -> CommandResult {
    let RetainArguments { items_d, minutes_d, hours_d, records_d, alarms_d, refused_d, dry_run, .. } = *arguments;
    let days = [items_d, minutes_d, hours_d, records_d, alarms_d, refused_d];
    let going = retention::remove_expired(&arguments.database.to_settings(), &days, dry_run).await?;
    if arguments.json {
        print_text(&format!("{}\n", serde_json::json!({"schema": "retain/1", "dry_run": dry_run, "removed": going})));
        return Ok(CommandOutcome::Fine);
    }
    let line = |Going { table, before, rows, bytes }: &Going| {
        format!("{table}: {rows} rows before {before} UTC, {:.1} MB\n", *bytes as f64 / 1e6)
    };
    let said = match (going.is_empty(), dry_run) {
        (true, _) => "nothing is too old\n",
        (false, true) => "nothing was removed: this was a dry run\n",
        (false, false) => "removed\n",
    };
    print_text(&(going.iter().map(line).collect::<String>() + said));
    Ok(CommandOutcome::Fine)
}

async fn create_stream(arguments: &StreamArguments) -> CommandResult {
    let (servers, settings) = arguments.parse_settings()?;
    let mut connection = Connection::open(&servers, 0, "cnc-gateway fleet stream").await?;
    let created = connection.create_stream(&settings).await?;
    let (messages, bytes) = connection.stream_size(&settings.name).await?;
    let StreamSettings { name, subjects, replicas, .. } = &settings;
    print_text(&match created {
        Some(most) => format!(
            "stream {name} created for {subjects}, on {replicas} server(s), at most {:.1} GB on each\n",
            most as f64 / 1e9
        ),
        None => format!("stream {name} is there: {messages} messages, {:.1} MB\n", bytes as f64 / 1e6),
    });
    Ok(CommandOutcome::Fine)
}

async fn ingest_stream(arguments: &IngestArguments) -> CommandResult {
    let (servers, stream) = arguments.stream.parse_settings()?;
    let settings = IngestSettings {
        target: servers,
        stream,
        consumer: arguments.consumer.clone(),
        database: arguments.database.to_settings(),
        once: arguments.once,
    };
    let mut signals =
        Signals::start_listening().map_err(|error| CannotRun::new(format!("signals cannot be heard: {error}"), ""))?;
    let stopped = async { while signals.next().await != SignalRequest::Stop {} };
    tokio::select! {
        ended = ingest::run(&settings) => {
            let Done { new, known, refused } = ended?;
            print_text(&format!("{new} rows written, {known} known already, {refused} refused\n"));
        }
        // What was not committed was not acknowledged: it is given out again.
        () = stopped => {}
    }
    Ok(CommandOutcome::Fine)
}
