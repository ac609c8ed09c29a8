//! The loop of `fleet ingest`: fetch, write, commit, acknowledge; after any failure again from the beginning.
//!
//! While a batch is written the next one is fetched. One reader takes the batches in the order of the stream: at which machine a box
//! stands, and what it is called, is known by what came before. An item that the database does not take is found by halving its batch, and kept in
//! the table `refused`; the others are written.

use super::database::DatabaseSettings;
use super::row::{FleetRow, RefusedMessage};
use super::write::{BatchResult, Database, RefusalRecord};
use crate::row::Arrived;
use gateway_base::log::{Notice, Severity};
use gateway_nats::{Connection, FetchLimits, Message, NatsError, NatsTarget, StreamSettings};
use std::time::{Duration, Instant};

/// A batch is one transaction of some megabytes: larger ones gain little, and are given out again when they take longer than the
/// stream waits.
const BATCH_MESSAGES: usize = 10_000;
const BATCH_BYTES: usize = 16_000_000;
/// A batch is written when it is full or this old: rows are in the database within about a second.
const PATIENCE: Duration = Duration::from_millis(500);
/// Pauses after a failure: the first, and the longest.
const PAUSE_FIRST: Duration = Duration::from_millis(250);
const PAUSE_MAX: Duration = Duration::from_secs(10);
/// How often it tells how far it is.
const TELL_EVERY: Duration = Duration::from_secs(60);
/// Letters of a refused message, of its subject and of the reason that are kept.
const REFUSED_KEPT: usize = 4000;
const REASON_KEPT: usize = 1000;

/// From where to where.
#[derive(Debug, Clone)]
pub struct IngestSettings {
    /// The NATS cluster that the boxes send to.
    pub target: NatsTarget,
    /// The stream; it is created if it is missing.
    pub stream: StreamSettings,
    /// Name of the durable consumer, which all that share the work have in common.
    pub consumer: String,
    /// The PostgreSQL database that is written into.
    pub database: DatabaseSettings,
    /// End when everything is written that was in the stream at the beginning, whatever comes meanwhile.
    pub once: bool,
}

/// What was done since the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Done {
    /// Rows that are new.
    pub new: u64,
    /// Rows that were there already: given out again after a failure.
    pub known: u64,
    /// Messages that are no items, or that the database does not take; see the table `refused`.
    pub refused: u64,
}

struct Ingest<'a> {
    settings: &'a IngestSettings,
    done: Done,
    last_report: Instant,
    /// The server with which the next connection begins.
    server: usize,
}

/// Runs until the future is dropped, or with `once` until nothing is left. Failures are told and tried again.
///
/// # Errors
/// With `once`, the failure that ended it.
pub async fn run(settings: &IngestSettings) -> Result<Done, NatsError> {
    let mut ingest = Ingest { settings, done: Done::default(), last_report: Instant::now(), server: 0 };
    let mut pause = PAUSE_FIRST;
    let mut last = String::new();
    loop {
        let before = ingest.done;
        match ingest.run_session().await {
            Ok(()) => return Ok(ingest.done),
            Err(error) if settings.once => return Err(error),
            Err(error) => {
                if ingest.done != before {
                    (pause, last) = (PAUSE_FIRST, String::new());
                }
                let text = error.to_string();
                if text != last {
                    Notice::new(Severity::Warning, "ingest_failed", text.clone()).write_to_logs();
                    last = text;
                }
                tokio::time::sleep(pause).await;
                pause = (2 * pause).min(PAUSE_MAX);
            }
        }
    }
}

impl Ingest<'_> {
    /// From connecting to the first failure, or to the end of the work.
    async fn run_session(&mut self) -> Result<(), NatsError> {
        let IngestSettings { target: servers, stream, consumer, database, once } = self.settings;
        let first = self.server;
        self.server += 1;
        let mut database = Database::open(database).await?;
        let mut connection = Connection::open(servers, first, "cnc-gateway fleet ingest").await?;
        if let Some(bytes) = connection.create_stream(stream).await? {
            let text =
                format!("stream {} created for {}, at most {:.1} GB", stream.name, stream.subjects, bytes as f64 / 1e9);
            Notice::new(Severity::Info, "stream_created", text).write_to_logs();
        }
        connection.create_consumer(&stream.name, consumer).await?;
        Notice::new(Severity::Info, "ingest_running", format!("taking items from stream {}", stream.name))
            .write_to_logs();
        let last_number = if *once { Some(connection.read_last_number(&stream.name).await?) } else { None };
        let limits = FetchLimits { messages: BATCH_MESSAGES, bytes: BATCH_BYTES, patience: PATIENCE };
        let mut batch = connection.fetch_messages(&stream.name, consumer, limits).await?;
        loop {
            let fetching = connection.fetch_messages(&stream.name, consumer, limits);
            let (written, fetched) = tokio::join!(write(&mut database, &batch), fetching);
            self.count_written(written?);
            connection.acknowledge_messages(&batch);
            connection.flush().await?;
            let fetched = fetched?;
            let looks = last_number.filter(|number| [&batch, &fetched].into_iter().any(|of| may_be_last(of, *number)));
            batch = fetched;
            if let Some(last_number) = looks {
                let backlog = connection.read_backlog(&stream.name, consumer).await?;
                let nothing_left = batch.is_empty() && backlog.pending == 0 && backlog.under_way == 0;
                if nothing_left || backlog.acknowledged_to >= last_number {
                    // What has been given out meanwhile would be given to nobody else for a while.
                    self.count_written(write(&mut database, &batch).await?);
                    connection.acknowledge_messages(&batch);
                    return connection.flush().await;
                }
            }
            if self.last_report.elapsed() >= TELL_EVERY {
                self.last_report = Instant::now();
                let pending = connection.read_backlog(&stream.name, consumer).await?.pending;
                self.report_progress(pending);
            }
        }
    }

    fn count_written(&mut self, written: Written) {
        self.done.new += written.result.new;
        self.done.known += written.result.known;
        self.done.refused += written.refused.len() as u64;
        // One of them is enough to go and look.
        if let Some(RefusalRecord { subject, reason, .. }) = written.refused.first() {
            let text =
                format!("{} messages are kept in the table `refused`; {subject}: {reason}", written.refused.len());
            Notice::new(Severity::Warning, "refused", text).write_to_logs();
        }
    }

    fn report_progress(&self, pending: u64) {
        let Done { new, known, refused } = self.done;
        let text =
            format!("{new} rows written, {known} known already, {refused} refused; {pending} wait in the stream");
        Notice::new(Severity::Info, "ingest", text).write_to_logs();
    }
}

/// Is it worth asking the stream whether everything up to this number is done? Not before something from there on has come, or nothing.
fn may_be_last(batch: &[Message], last_number: u64) -> bool {
    let reached = |message: &Message| {
        message.stream_sequence().and_then(|number| u64::try_from(number).ok()) >= Some(last_number)
    };
    batch.is_empty() || batch.iter().any(reached)
}

/// What became of a batch.
#[derive(Debug, Default)]
struct Written {
    result: BatchResult,
    refused: Vec<RefusalRecord>,
}

/// Writes what are items, and notes what are none.
async fn write(database: &mut Database, messages: &[Message]) -> Result<Written, NatsError> {
    let mut written = Written::default();
    let mut items: Vec<(FleetRow<'_>, &Message)> = Vec::with_capacity(messages.len());
    for message in messages {
        match FleetRow::from_message(&message.subject, &message.payload) {
            Ok(row) => items.push((row, message)),
            Err(RefusedMessage(why)) => written.refused.push(build_refusal(message, &why)),
        }
    }
    // Stretches that are still to be written; one that the database does not take is halved.
    let mut stretches = vec![(0, items.len())];
    while let Some((from, to)) = stretches.pop() {
        database.settle_times(items[from..to].iter_mut().map(|(row, _)| row)).await.map_err(|error| error.said)?;
        let arrived = |(row, message): &'_ (FleetRow<'_>, &Message)| message.stored_us().unwrap_or(row.at_us());
        let rows: Vec<Arrived<'_>> =
            items[from..to].iter().map(|item| Arrived { row: &item.0, arrived_us: arrived(item) }).collect();
        match database.write(&rows).await {
            Ok(result) => {
                written.result.new += result.new;
                written.result.known += result.known;
            }
            Err(error) if error.of_the_data && to - from > 1 => {
                let middle = from + (to - from) / 2;
                stretches.extend([(middle, to), (from, middle)]);
            }
            Err(error) if error.of_the_data => {
                let message = items[from].1;
                written.refused.push(build_refusal(message, &error.said.what));
            }
            Err(error) => return Err(error.said),
        }
    }
    database.insert_refused(&written.refused).await?;
    Ok(written)
}

fn build_refusal(message: &Message, why: &str) -> RefusalRecord {
    let kept =
        |text: &str, letters: usize| text.chars().filter(|letter| *letter != '\0').take(letters).collect::<String>();
    // So many bytes hold so many letters.
    let start = &message.payload[..message.payload.len().min(4 * REFUSED_KEPT)];
    RefusalRecord {
        stream_sequence: message.stream_sequence().unwrap_or(0),
        subject: kept(&message.subject, REASON_KEPT),
        reason: kept(why, REASON_KEPT),
        payload: kept(&String::from_utf8_lossy(start), REFUSED_KEPT),
    }
}
