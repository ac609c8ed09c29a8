//! The history of a running box: opened at the start, or again and again while the disk does not let it.

pub(super) mod upkeep;

use super::recent::{self, Recent};
use adapters::Sample;
use adapters::clock::TimeNs;
use gateway_base::clock::{ClockMark, Trust};
use gateway_base::log::{Notice, Severity};
use gateway_config as config;
use gateway_gate::AuditPath;
use gateway_history::{
    self as history, AlarmClear, Audit, DiskRoom, ExtraSeries, HistoryError, Options, Outbox, Reader, Record,
    RecordSpan, Retention, Writer, WriterLife, disk_room,
};
use gateway_pipeline::Store;
use gateway_status::HistoryStatus;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Pause between two tries to open a history that cannot be opened.
const RETRY: Duration = Duration::from_secs(10);
/// So many alarms are looked through for some that stand.
const ALARMS_MAX: u32 = 10_000;
/// Longest time between two commits while there are sinks: live data arrives within a second then.
const COMMIT_WITH_SINKS: Duration = Duration::from_millis(500);
/// A rate of growth is told after this much machine time.
const RATE_AFTER_S: f64 = 600.0;

/// Said while the disk is short of room.
const SHORT: &str = "The disk is all but full: each new sample takes the place of the oldest raw one. Free some room on the disk \
                     of the history.";

/// Said when the thread that writes is gone.
const BROKE_OFF: &str =
    "nothing is being stored: the thread that writes the history broke off; it is begun anew within ten seconds";

/// Is what is written now stored? Follows the history through every opening of its file.
#[derive(Debug, Clone, Default)]
pub struct StoredAudit(Arc<Mutex<Option<WriterLife>>>);

impl StoredAudit {
    fn follow_writer(&self, writer: &Writer) {
        // It is complete whenever the lock is free.
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(writer.life());
    }
}

impl AuditPath for StoredAudit {
    fn is_live(&self) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).as_ref().is_some_and(WriterLife::is_live)
    }
}

/// The history, open or not.
#[derive(Debug)]
pub struct HistoryStore {
    path: PathBuf,
    audit: StoredAudit,
    options: Options,
    writer: Option<Writer>,
    /// The newest rows of the audit, for a start after a kill.
    recent: Option<Recent>,
    /// Why there is no writer, and when to try again.
    closed: Option<(String, Instant)>,
    /// Rows in the file when it was opened.
    rows_before: u64,
    bytes_before: u64,
    first_ns: Option<TimeNs>,
    last_ns: TimeNs,
    lost: u64,
    /// Samples handed to the writer since it was opened.
    handed: u64,
    last_problem: Option<String>,
    /// The file that the writer has open.
    file: Option<FileIdentity>,
    /// The log beside it has been told to be long.
    long_log: bool,
    set_aside: Vec<String>,
}

/// Which file lies under a name: device and number on it.
type FileIdentity = (u64, u64);

fn read_identity(path: &Path) -> Option<FileIdentity> {
    std::fs::metadata(path).ok().map(|file| (file.dev(), file.ino()))
}

impl HistoryStore {
    /// Opens the history of the configuration, or goes on without it where the disk does not let it. `beside` is stored
    /// beside the channels, `outbox` is what leaves the box, `clock` what its
    /// rows are dated by.
    ///
    /// # Errors
    /// A history that belongs to somebody else: another gateway, a newer version, another program.
    pub fn open(
        config: &config::HistoryConfig,
        beside: Vec<ExtraSeries>,
        outbox: Option<Outbox>,
        clock: ClockMark,
    ) -> Result<Self, HistoryError> {
        let mut history_store = Self {
            path: config.path.clone(),
            audit: StoredAudit::default(),
            options: Options { clock, ..build_options(config, beside, outbox) },
            writer: None,
            recent: None,
            closed: None,
            rows_before: 0,
            bytes_before: 0,
            first_ns: None,
            last_ns: 0,
            lost: 0,
            handed: 0,
            last_problem: None,
            file: None,
            long_log: false,
            set_aside: Vec::new(),
        };
        history_store.finish_going_back();
        recent::forget_without(&history_store.path);
        match history_store.try_open() {
            Ok(()) => {}
            Err(error @ HistoryError::NewerSchema { .. }) => history_store.go_back(error)?,
            Err(error) if is_foreign_file(&error) => return Err(error),
            Err(error) => history_store.opening_failed(&error),
        }
        history_store.set_aside = history::damaged_files(&history_store.path);
        Ok(history_store)
    }

    fn try_open(&mut self) -> Result<(), HistoryError> {
        let writer = Writer::open(&self.path, self.options.clone())?;
        self.file = read_identity(&self.path);
        self.handed = 0;
        let rows = recent::recover_rows(&self.path, &writer);
        if rows > 0 {
            let text = format!("{rows} rows of the audit that the last end had cut off are in the history now");
            Notice::new(Severity::Info, "audit_recovered", text).write_to_logs();
        }
        self.recent = Some(Recent::start(&self.path));
        self.rows_before = rows_in(&self.path);
        end_alarms(&self.path, &writer);
        self.bytes_before = file_size_bytes(&self.path);
        self.audit.follow_writer(&writer);
        self.writer = Some(writer);
        self.closed = None;
        Ok(())
    }

    /// A damaged file is set aside; anything else is tried again later.
    fn opening_failed(&mut self, error: &HistoryError) {
        if error.is_damage() { self.begin_anew(error) } else { self.put_off(error) }
    }

    fn put_off(&mut self, error: &HistoryError) {
        let text = error.to_string();
        if self.closed.is_none() {
            let operator =
                format!("nothing is being stored: {text} Polling goes on; trying again every {} s", RETRY.as_secs());
            Notice::new(Severity::Error, "history_closed", operator).with_detail(format!("{error:?}")).write_to_logs();
        }
        self.closed = Some((text, Instant::now() + RETRY));
    }

    /// Time of the newest sample in the file.
    #[must_use]
    pub fn newest_ns(&self) -> Option<TimeNs> {
        Reader::open(&self.path).ok()?.read_span().ok()?.map(|(_, newest_ns)| newest_ns)
    }

    /// Tries again to open, and tells what the writer has to say. Call it about once per second.
    pub fn look_at_condition(&mut self) {
        if self.closed.as_ref().is_some_and(|(_, again)| Instant::now() >= *again) {
            match self.try_open() {
                Ok(()) => {
                    let text =
                        format!("storing again in {}; {} samples were not stored", self.path.display(), self.lost);
                    Notice::new(Severity::Info, "history_open", text).write_to_logs();
                }
                Err(error) => self.opening_failed(&error),
            }
        }
        self.look_at_thread();
        self.look_at_file();
        self.look_at_damage();
        self.look_at_log();
        let trouble = self.writer.as_ref().and_then(|writer| describe_trouble(&writer.status()));
        if trouble != self.last_problem {
            match &trouble {
                Some(text) => Notice::new(Severity::Error, "history_degraded", text.clone()).write_to_logs(),
                None => Notice::new(Severity::Info, "history_recovered", "the history is being written as usual")
                    .write_to_logs(),
            }
            self.last_problem = trouble;
        }
    }

    /// Does it take what is handed in, and make it durable?
    #[must_use]
    pub fn is_storing(&self) -> bool {
        self.writer.as_ref().is_some_and(|writer| writer.life().is_live())
    }

    /// For the thread that writes to the machine: is what is written now stored?
    #[must_use]
    pub fn stored_audit(&self) -> StoredAudit {
        self.audit.clone()
    }

    /// A thread that broke off writes nothing any more: the file is opened anew, by another thread.
    fn look_at_thread(&mut self) {
        let Some(writer) = self.writer.take_if(|writer| writer.is_stopped()) else { return };
        self.recent = None;
        let status = writer.close();
        self.lost += status.dropped_samples + self.handed.saturating_sub(status.rows);
        self.rows_before += status.rows;
        let text =
            format!("{BROKE_OFF}; {} samples since its last commit are lost", self.handed.saturating_sub(status.rows));
        Notice::new(Severity::Error, "history_broke_off", text).write_to_logs();
        self.closed = Some((BROKE_OFF.to_owned(), Instant::now() + RETRY));
    }

    /// Rounds of the thread that writes; `None` where the history is not open.
    #[must_use]
    pub fn count_rounds(&self) -> Option<u64> {
        self.writer.as_ref().map(Writer::count_rounds)
    }

    /// Hands in a row of the audit; false when it will not be stored.
    pub fn append_audit(&mut self, row: Audit) -> bool {
        let stored = self.writer.as_ref().is_some_and(|writer| writer.queue_record(row.clone()).is_some());
        // What a thread that broke off does not take any more is recovered from there, as after a kill.
        let is_recovered = stored || self.writer.as_ref().is_some_and(Writer::is_stopped);
        if let Some(recent) = self.recent.as_ref().filter(|_| is_recovered) {
            recent.keep_row(row);
        }
        stored
    }

    /// Compacts and removes what is too old at this time, which a confirmed clock says, in the background.
    pub fn maintain_file(&self, now_ns: TimeNs) {
        if let Some(writer) = &self.writer {
            writer.request_maintenance(Some(now_ns));
        }
        history::remove_old_copies(&self.path, now_ns);
    }

    /// The clock of the rows since opening is confirmed.
    pub fn confirm_clock(&mut self) {
        self.options.clock.trust = Trust::Confirmed.as_word();
        if let Some(writer) = &self.writer {
            writer.confirm_clock();
        }
    }

    /// Makes everything durable and ends the writer.
    pub fn close(&mut self) {
        let Some(writer) = self.writer.take() else { return };
        self.recent = None;
        let status = writer.close();
        let rows = self.rows_before + status.rows;
        match status.degraded {
            None => {
                let text = format!("history closed: {rows} samples in {}", self.path.display());
                Notice::new(Severity::Info, "history_closed", text).write_to_logs();
            }
            Some(reason) => {
                let text = format!("the last samples could not be stored: {reason}");
                Notice::new(Severity::Error, "history_closed", text).write_to_logs();
            }
        }
    }

    /// Path, size, losses and error of the history, for the status document.
    #[must_use]
    pub fn build_status(&self) -> HistoryStatus {
        let writer = self.writer.as_ref().map(Writer::status).unwrap_or_default();
        let closed = self.closed.as_ref().map(|(text, _)| text.clone());
        HistoryStatus {
            path: self.path.display().to_string(),
            rows: self.rows_before + writer.rows,
            bytes: writer.bytes,
            lasts_days: self.lasts_days(writer.bytes),
            lost: self.lost + writer.dropped_samples + writer.lost_samples,
            error: closed.or_else(|| self.describe_end()).or_else(|| describe_trouble(&writer)),
            log_bytes: writer.log_bytes,
            set_aside: self.set_aside.clone(),
        }
    }

    /// The thread is gone, and nobody has noticed yet.
    fn describe_end(&self) -> Option<String> {
        self.writer.as_ref().filter(|writer| writer.is_stopped()).map(|_| BROKE_OFF.to_owned())
    }

    /// Until the limit or the disk is full at the rate since the start.
    #[expect(clippy::cast_precision_loss, reason = "an estimate")]
    fn lasts_days(&self, bytes: u64) -> Option<f64> {
        let seconds = (self.last_ns - self.first_ns?) as f64 / 1e9;
        let grown = bytes.checked_sub(self.bytes_before)? as f64;
        let room = usable_bytes(&self.path, &self.options.retention, bytes)? as f64;
        (seconds >= RATE_AFTER_S && grown > 0.0).then(|| room / (grown / seconds) / 86_400.0)
    }
}

impl Store for HistoryStore {
    fn store_sample(&mut self, sample: &Sample, extras: &[gateway_history::ExtraValue<'_>]) {
        self.first_ns.get_or_insert(sample.at_ns);
        self.last_ns = sample.at_ns;
        match &self.writer {
            Some(writer) => {
                self.handed += 1;
                writer.queue_sample(sample, extras);
            }
            None => self.lost += 1,
        }
    }

    fn store_record(&mut self, record: Record) {
        if let Some(writer) = &self.writer {
            writer.queue_record(record);
        }
    }
}

/// What the writer has to tell: nothing becomes durable, or only at the cost of what is old.
fn describe_trouble(status: &history::HistoryFigures) -> Option<String> {
    let short = || status.short_of_room.then(|| SHORT.to_owned());
    status.degraded.clone().or_else(short)
}

/// Alarms that stood when the box stopped end then; what still holds is raised again.
fn end_alarms(path: &Path, writer: &Writer) {
    let Ok(reader) = Reader::open(path) else { return };
    let Ok(Some((_, newest_ns))) = reader.read_present_span() else { return };
    for alarm in reader.read_alarms(RecordSpan::newest(ALARMS_MAX)).unwrap_or_default() {
        if alarm.cleared_ns.is_none() {
            writer.queue_record(AlarmClear { at_ns: newest_ns, code: alarm.code, source: alarm.source });
        }
    }
}

/// Does the file belong to somebody else? Then nothing may be written to it, now or later.
fn is_foreign_file(error: &HistoryError) -> bool {
    matches!(error, HistoryError::InUse { .. } | HistoryError::NewerSchema { .. } | HistoryError::NotAHistory { .. })
}

fn build_options(config: &config::HistoryConfig, beside: Vec<ExtraSeries>, outbox: Option<Outbox>) -> Options {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the configuration holds 0.01 to 10000"
    )]
    let max_bytes = (config.max_gb * 1e9) as u64;
    let retention = Retention { raw_days: config.retention_days, max_bytes, ..Retention::default() };
    // What is sent is durable first, so the pace of the commits is part of the delay of live data.
    let group_commit = if outbox.is_some() { config.commit.min(COMMIT_WITH_SINKS) } else { config.commit };
    Options { group_commit, retention, extras: beside, outbox, ..Options::default() }
}

/// Bytes that may still be used.
fn usable_bytes(path: &Path, retention: &Retention, bytes: u64) -> Option<u64> {
    let DiskRoom { free, .. } = disk_room(path)?;
    Some(free.saturating_sub(retention.keep_free_bytes).min(retention.max_bytes.saturating_sub(bytes)))
}

fn file_size_bytes(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |metadata| metadata.len())
}

/// Samples in the file.
fn rows_in(path: &Path) -> u64 {
    let info = Reader::open(path).and_then(|reader| reader.read_info());
    info.ok().and_then(|info| u64::try_from(info.samples).ok()).unwrap_or(0)
}
