//! The handle through which the box writes its history.

use super::commit::TailSlots;
use super::error::{HistoryError, add_path};
use super::lock::Lock;
use super::mailbox::{Mailbox, WriterJob};
use super::maintenance::Maintenance;
use super::minute_buffer::MinuteBuffer;
use super::options::Options;
use super::outbox::Gatherer;
use super::recover::recover_file;
use super::series::stored_series;
use super::series_kind::ExtraValue;
use super::status::{HistoryFigures, SharedStatus};
use super::thread::{CommitSchedule, Thread};
use super::{schema, segments};
use adapter_core::Sample;
use adapter_core::clock::TimeNs;
use gateway_records::Record;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

/// How long a flush waits when nobody says otherwise.
const FLUSH_LIMIT: Duration = Duration::from_secs(30);

/// Whether a [`Writer`] takes what is handed in, for whoever holds no writer. It outlives the writer, and says no from then on.
#[derive(Debug, Clone)]
pub struct WriterLife {
    mailbox: Arc<Mailbox>,
    status: Arc<SharedStatus>,
}

impl WriterLife {
    /// Is the thread there, is there room for a record, and does the disk take what is written?
    #[must_use]
    pub fn is_live(&self) -> bool {
        self.mailbox.takes_records() && !self.status.is_degraded()
    }
}

/// Writes one history. All methods take `&self` and may be called from any thread; dropping the handle makes what was
/// handed in durable and ends the writer thread.
#[derive(Debug)]
pub struct Writer {
    path: PathBuf,
    mailbox: Arc<Mailbox>,
    status: Arc<SharedStatus>,
    thread: Option<JoinHandle<()>>,
    _lock: Lock,
}

impl Writer {
    /// Opens or creates the history at `path` and starts its writer thread. What a crash left in the tail is brought
    /// into order first.
    ///
    /// # Errors
    /// [`HistoryError::InUse`] when another process writes it, [`HistoryError::NewerSchema`],
    /// [`HistoryError::NotAHistory`], [`HistoryError::ReadOnly`], or what `SQLite` says.
    pub fn open(path: &Path, options: Options) -> Result<Self, HistoryError> {
        if let Some(parent) = path.parent().filter(|parent| !parent.as_os_str().is_empty()) {
            std::fs::create_dir_all(parent).map_err(add_path(parent))?;
        }
        let lock = Lock::acquire_at(path)?;
        let mut db = schema::open_for_writing(path)?;
        let mut series = stored_series(options.fidelity, &options.extras)?;
        schema::register_series(&mut db, &mut series)?;
        schema::note_limit(&db, options.retention.max_bytes)?;
        let end = recover_file(&mut db, options.goes_on.then_some(options.origin.as_str()))?;
        let outbox =
            options.outbox.clone().map(|outbox| Gatherer::open(&mut db, outbox, &series, end.last_ns)).transpose()?;
        segments::begin_run(&db, &options.clock)?;
        let mailbox = Arc::new(Mailbox::new(&series, &options));
        let shared = Arc::new(SharedStatus::default());
        let maintenance = Maintenance::new(path, options.retention, options.reserve_bytes);
        maintenance.bound_log(&db)?;
        let thread = Thread {
            minute_buffer: MinuteBuffer::new(series, end, options.when_full)?,
            outbox,
            slots: TailSlots::load(&db)?,
            maintenance,
            db,
            mailbox: mailbox.clone(),
            shared: shared.clone(),
            options,
            schedule: CommitSchedule::default(),
        };
        let thread =
            std::thread::Builder::new().name("history".to_owned()).spawn(|| thread.run()).map_err(add_path(path))?;
        Ok(Self { path: path.to_owned(), mailbox, status: shared, thread: Some(thread), _lock: lock })
    }

    /// Hands in one tick: the channels of `sample`, and the values of the registered extras in their order. Takes well
    /// under a microsecond and never waits for the disk (unless [`WhenFull::Wait`](super::WhenFull::Wait) was chosen).
    /// Returns how many samples have been dropped so far because the queue was full.
    pub fn queue_sample(&self, sample: &Sample, extras: &[ExtraValue<'_>]) -> u64 {
        self.mailbox.queue_sample(sample, extras)
    }

    /// Hands in an event, alarm, state, part, decision, command, model or diagnosis. Returns its ticket, which is durable
    /// once [`Self::acknowledged_record`] reaches it; `None` when the queue was full and it was dropped.
    pub fn queue_record(&self, record: impl Into<Record>) -> Option<u64> {
        self.mailbox.queue_record(record.into())
    }

    /// Samples up to and including this time survive a power cut. `None` before the first commit.
    #[must_use]
    pub fn acknowledged_through_ns(&self) -> Option<TimeNs> {
        self.status.acknowledged_ns()
    }

    /// Records up to this ticket survive a power cut.
    #[must_use]
    pub fn acknowledged_record(&self) -> u64 {
        self.status.acknowledged_record.load(std::sync::atomic::Ordering::Acquire)
    }

    /// Returns when everything handed in so far is durable.
    ///
    /// # Errors
    /// [`HistoryError::NotDurable`] with the reason, after 30 s.
    pub fn flush(&self) -> Result<(), HistoryError> {
        self.await_job(WriterJob::Flush, FLUSH_LIMIT)
    }

    /// Begins compaction, and removal of what is too old at `now_ns`, piece by piece between commits. Without a time nothing
    /// is too old: give one only where the clock is confirmed. Call it once a night.
    pub fn request_maintenance(&self, now_ns: Option<TimeNs>) {
        self.mailbox.queue_job(WriterJob::Maintain(now_ns));
    }

    /// The clock of [`Options::clock`] is confirmed: the rows since opening are dated for good.
    pub fn confirm_clock(&self) {
        self.mailbox.queue_job(WriterJob::ConfirmClock);
    }

    /// As [`Self::request_maintenance`], and waits at most `limit` for the end of it.
    ///
    /// # Errors
    /// [`HistoryError::NotDurable`] with the reason.
    pub fn maintain_and_wait(&self, now_ns: TimeNs, limit: Duration) -> Result<(), HistoryError> {
        self.await_job(WriterJob::Maintain(Some(now_ns)), limit)
    }

    fn await_job(&self, job: WriterJob, limit: Duration) -> Result<(), HistoryError> {
        let number = self.mailbox.queue_job(job);
        if self.mailbox.await_job(number, limit) {
            return Ok(());
        }
        if self.thread.as_ref().is_none_or(JoinHandle::is_finished) {
            return Err(HistoryError::Stopped);
        }
        let reason = self.status.read_figures().degraded.unwrap_or_else(|| "the writer is still busy".to_owned());
        Err(HistoryError::NotDurable { seconds: limit.as_secs_f64(), reason })
    }

    /// How the writer is doing.
    #[must_use]
    pub fn status(&self) -> HistoryFigures {
        let waiting = self.mailbox.measure_queue();
        HistoryFigures {
            queued_samples: waiting.rows,
            queued_records: waiting.records,
            dropped_samples: waiting.dropped_samples,
            dropped_records: waiting.dropped_records,
            ..self.status.read_figures()
        }
    }

    /// Rounds of the thread. Whoever looks twice sees whether it moves.
    #[must_use]
    pub fn count_rounds(&self) -> u64 {
        self.status.rounds.load(std::sync::atomic::Ordering::Relaxed)
    }

    /// Whether it takes what is handed in, at any later moment.
    #[must_use]
    pub fn life(&self) -> WriterLife {
        WriterLife { mailbox: self.mailbox.clone(), status: self.status.clone() }
    }

    /// Has the thread ended, which it does by itself only when it breaks off?
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.mailbox.is_stopped()
    }

    /// Path of the database that is written.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Makes everything durable, ends the writer thread and returns the last figures. `degraded` tells when something
    /// could not be made durable.
    #[must_use]
    pub fn close(mut self) -> HistoryFigures {
        self.join_thread();
        self.status()
    }

    fn join_thread(&mut self) {
        self.mailbox.request_close();
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been printed by then; there is nobody left to tell.
            let _ = thread.join();
        }
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        self.join_thread();
    }
}
