//! The loop of `fleet ingest`: fetch, write, commit, acknowledge; after any failure again from the beginning.

use super::database::{Database, DatabaseSettings};
use super::row::{FleetRow, RefusedMessage};
use crate::log::{Notice, Severity};
use crate::nats::{Connection, NatsError, NatsTarget, StreamSettings};
use std::time::{Duration, Instant};

/// Messages in one batch: a transaction of some hundred kilobytes.
const BATCH: usize = 1000;
/// A batch is written when it is full or this old: rows are in the database within about a second.
const PATIENCE: Duration = Duration::from_millis(500);
/// Pauses after a failure: the first, and the longest.
const PAUSE_FIRST: Duration = Duration::from_millis(250);
const PAUSE_MAX: Duration = Duration::from_secs(10);
/// How often it tells how far it is.
const TELL_EVERY: Duration = Duration::from_secs(60);
/// Letters of a refused message that are kept.
const REFUSED_KEPT: usize = 4000;

/// From where to where.
#[derive(Debug, Clone)]
pub struct IngestSettings {
    /// The cluster.
    pub servers: NatsTarget,
    /// The stream; it is created if it is missing.
    pub stream: StreamSettings,
    /// Name of the durable consumer, which all that share the work have in common.
    pub consumer: String,
    /// The database.
    pub database: DatabaseSettings,
    /// End when nothing is left to do.
    pub once: bool,
}

/// What was done since the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Done {
    /// Rows that are new.
    pub new: u64,
    /// Rows that were there already: given out again after a failure.
    pub known: u64,
    /// Messages that are no items; see the table `refused`.
    pub refused: u64,
}

struct Ingest<'a> {
    settings: &'a IngestSettings,
    done: Done,
    told: Instant,
    /// The server with which the next connection begins.
    server: usize,
}

/// Runs until the future is dropped, or with `once` until nothing is left. Failures are told and tried again.
///
/// # Errors
/// With `once`, the failure that ended it.
pub async fn run(settings: &IngestSettings) -> Result<Done, NatsError> {
    let mut ingest = Ingest { settings, done: Done::default(), told: Instant::now(), server: 0 };
    let mut pause = PAUSE_FIRST;
    let mut last = String::new();
    loop {
        let before = ingest.done;
        match ingest.session().await {
            Ok(()) => return Ok(ingest.done),
            Err(error) if settings.once => return Err(error),
            Err(error) => {
                if ingest.done != before {
                    (pause, last) = (PAUSE_FIRST, String::new());
                }
                let text = error.to_string();
                if text != last {
                    Notice::new(Severity::Warning, "ingest_failed", text.clone()).say();
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
    async fn session(&mut self) -> Result<(), NatsError> {
        let IngestSettings { servers, stream, consumer, database, once } = self.settings;
        let first = self.server;
        self.server += 1;
        let mut database = Database::open(database).await?;
        let mut connection = Connection::open(servers, first, "cnc-gateway fleet ingest").await?;
        if connection.create_stream(stream).await? {
            let text = format!("stream {} created for {}", stream.name, stream.subjects);
            Notice::new(Severity::Info, "stream_created", text).say();
        }
        connection.create_consumer(&stream.name, consumer).await?;
        Notice::new(Severity::Info, "ingest_running", format!("taking items from stream {}", stream.name)).say();
        loop {
            let messages = connection.fetch(&stream.name, consumer, BATCH, PATIENCE).await?;
            if messages.is_empty() {
                let backlog = connection.backlog(&stream.name, consumer).await?;
                if *once && backlog.pending == 0 && backlog.under_way == 0 {
                    return Ok(());
                }
            } else {
                let (mut rows, mut refused) = (Vec::with_capacity(messages.len()), Vec::new());
                for message in &messages {
                    match FleetRow::of(&message.subject, &message.payload) {
                        Ok(row) => rows.push(row),
                        Err(RefusedMessage(why)) => {
                            let payload = String::from_utf8_lossy(&message.payload).replace('\0', "");
                            refused.push((message.subject.clone(), why, payload.chars().take(REFUSED_KEPT).collect()));
                        }
                    }
                }
                let written = database.write(&rows, &refused).await?;
                connection.acknowledge(&messages);
                connection.flush().await?;
                self.done.new += written.new;
                self.done.known += written.known;
                self.done.refused += refused.len() as u64;
            }
            if self.told.elapsed() >= TELL_EVERY {
                self.told = Instant::now();
                let Done { new, known, refused } = self.done;
                let pending = connection.backlog(&stream.name, consumer).await?.pending;
                let text = format!(
                    "{new} rows written, {known} known already, {refused} refused; {pending} wait in the stream"
                );
                Notice::new(Severity::Info, "ingest", text).say();
            }
        }
    }
}
