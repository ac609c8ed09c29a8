//! How the writer is doing, for the page, metrics and the health check.

use adapter_core::clock::TimeNs;
use serde::Serialize;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// What the writer has done and what waits for it, at one moment.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct HistoryFigures {
    /// Samples up to and including this time survive a power cut; `None` before the first commit.
    pub acknowledged_through_ns: Option<TimeNs>,
    /// Records up to this ticket survive a power cut.
    pub acknowledged_record: u64,
    /// Samples made durable since opening.
    pub rows: u64,
    /// Pages in use in the database, bytes.
    pub bytes: u64,
    /// Samples waiting for the writer.
    pub queued_samples: usize,
    /// Records waiting to become durable.
    pub queued_records: usize,
    /// Samples refused because the queue was full.
    pub dropped_samples: u64,
    /// Records refused because the queue was full.
    pub dropped_records: u64,
    /// Samples that waited too long for a disk that took nothing, oldest first.
    pub lost_samples: u64,
    /// Samples removed by age or size since opening.
    pub retired_samples: u64,
    /// Commits since the history was opened.
    pub commits: u64,
    /// Duration of the last commit, fsync included, milliseconds.
    pub last_commit_ms: f64,
    /// Bytes of the log beside the file. It stays below a few megabytes unless somebody reads without an end.
    pub log_bytes: u64,
    /// The disk is short of room: every new sample takes the place of the oldest raw one.
    pub short_of_room: bool,
    /// Why nothing is becoming durable at the moment, in words; `None` when all is well.
    pub degraded: Option<String>,
    /// The disk has changed the file, so that nothing more can be written to it: what was found.
    pub damaged: Option<String>,
    /// The last error, also when it is over.
    pub last_error: Option<String>,
}

/// The figures as the writer thread keeps them.
#[derive(Debug)]
pub(crate) struct SharedStatus {
    pub(crate) acknowledged_ns: AtomicI64,
    pub(crate) acknowledged_record: AtomicU64,
    pub(crate) rows: AtomicU64,
    pub(crate) bytes: AtomicU64,
    pub(crate) lost: AtomicU64,
    pub(crate) retired: AtomicU64,
    pub(crate) log_bytes: AtomicU64,
    pub(crate) commits: AtomicU64,
    pub(crate) commit_us: AtomicU64,
    pub(crate) short_of_room: AtomicBool,
    /// Rounds of the thread: it grows unless the thread hangs.
    pub(crate) rounds: AtomicU64,
    texts: Mutex<StatusTexts>,
}

#[derive(Debug, Default)]
struct StatusTexts {
    degraded: Option<String>,
    damaged: Option<String>,
    last_error: Option<String>,
}

/// No row is durable yet.
pub(crate) const NOTHING_NS: i64 = i64::MIN;

impl Default for SharedStatus {
    fn default() -> Self {
        Self {
            acknowledged_ns: AtomicI64::new(NOTHING_NS),
            acknowledged_record: AtomicU64::new(0),
            rows: AtomicU64::new(0),
            bytes: AtomicU64::new(0),
            lost: AtomicU64::new(0),
            retired: AtomicU64::new(0),
            log_bytes: AtomicU64::new(0),
            commits: AtomicU64::new(0),
            commit_us: AtomicU64::new(0),
            short_of_room: AtomicBool::new(false),
            rounds: AtomicU64::new(0),
            texts: Mutex::new(StatusTexts::default()),
        }
    }
}

impl SharedStatus {
    pub(crate) fn acknowledged_ns(&self) -> Option<TimeNs> {
        let at_ns = self.acknowledged_ns.load(Ordering::Acquire);
        (at_ns != NOTHING_NS).then_some(at_ns)
    }

    /// All is well again.
    pub(crate) fn mark_recovered(&self) {
        self.texts.lock().unwrap_or_else(PoisonError::into_inner).degraded = None;
    }

    /// Is nothing becoming durable?
    pub(crate) fn is_degraded(&self) -> bool {
        self.texts.lock().unwrap_or_else(PoisonError::into_inner).degraded.is_some()
    }

    /// Nothing is becoming durable, because of `error`.
    pub(crate) fn mark_degraded(&self, error: &str) {
        let mut words = self.texts.lock().unwrap_or_else(PoisonError::into_inner);
        words.degraded = Some(error.to_owned());
        words.last_error = Some(error.to_owned());
    }

    /// The file is not as it was written.
    pub(crate) fn mark_damaged(&self, error: &str) {
        self.texts.lock().unwrap_or_else(PoisonError::into_inner).damaged = Some(error.to_owned());
    }

    /// Everything but the queue.
    pub(crate) fn read_figures(&self) -> HistoryFigures {
        let words = self.texts.lock().unwrap_or_else(PoisonError::into_inner);
        HistoryFigures {
            acknowledged_through_ns: self.acknowledged_ns(),
            acknowledged_record: self.acknowledged_record.load(Ordering::Acquire),
            rows: self.rows.load(Ordering::Relaxed),
            bytes: self.bytes.load(Ordering::Relaxed),
            lost_samples: self.lost.load(Ordering::Relaxed),
            retired_samples: self.retired.load(Ordering::Relaxed),
            log_bytes: self.log_bytes.load(Ordering::Relaxed),
            commits: self.commits.load(Ordering::Relaxed),
            last_commit_ms: self.commit_us.load(Ordering::Relaxed) as f64 / 1000.0,
            short_of_room: self.short_of_room.load(Ordering::Relaxed),
            degraded: words.degraded.clone(),
            damaged: words.damaged.clone(),
            last_error: words.last_error.clone(),
            ..HistoryFigures::default()
        }
    }
}
