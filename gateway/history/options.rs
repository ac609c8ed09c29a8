//! How a history is kept: durability, limits, and the estimates that are stored beside the channels.

use super::outbox::Outbox;
use super::series_kind::{ExtraSeries, Fidelity};
use super::space::DiskRoom;
use adapter_core::clock::{SECOND_NS, TimeNs};
use gateway_base::clock::ClockMark;
use std::time::Duration;

/// One day in nanoseconds.
pub const DAY_NS: i64 = 86_400 * SECOND_NS;

/// What happens to a sample that finds the queue full.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WhenFull {
    /// It is dropped and counted: the tick of a live machine never waits for a disk.
    Drop,
    /// The caller waits: a recording is replayed as fast as the disk allows, and completely.
    Wait,
}

/// How long what is kept. Whatever the ages: when `max_bytes` is reached the oldest raw samples go first, then minute
/// summaries, then hours, states and parts, then events and diagnoses, and alarms, decisions and commands last.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Retention {
    /// Age at which raw samples are removed, days.
    pub raw_days: f64,
    /// Age at which summaries of minutes are removed, days.
    pub minutes_days: f64,
    /// Hour and day summaries, states, parts, events, models and diagnoses, days.
    pub records_days: f64,
    /// Alarms, decisions and commands, days.
    pub audit_days: f64,
    /// The database never grows beyond this, bytes.
    pub max_bytes: u64,
    /// The gateway stops growing the database when the disk has less than this free, bytes.
    pub keep_free_bytes: u64,
}

impl Default for Retention {
    fn default() -> Self {
        Self {
            raw_days: 366.0,
            minutes_days: 3.0 * 366.0,
            records_days: 5.0 * 366.0,
            audit_days: 10.0 * 366.0,
            max_bytes: 8_000_000_000,
            keep_free_bytes: 200_000_000,
        }
    }
}

impl Retention {
    /// How much of this disk stays free: a tenth of a small one.
    #[must_use]
    pub fn bytes_kept_free(&self, room: DiskRoom) -> u64 {
        self.keep_free_bytes.min(room.total / 10)
    }

    /// The oldest time that an age of `days` still keeps.
    #[must_use]
    pub fn horizon_ns(days: f64, now_ns: TimeNs) -> TimeNs {
        // An age beyond the range of the clock keeps everything: the cast saturates.
        #[allow(clippy::cast_possible_truncation, reason = "saturates, which is meant")]
        now_ns.saturating_sub((days * DAY_NS as f64) as i64)
    }
}

/// How a history is written.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// At most this long until what was handed in is durable; every commit ends in an fsync. 1 s unless configured.
    pub group_commit: Duration,
    /// Samples that may wait for the writer; about 200 bytes each with 20 channels.
    pub queue_rows: usize,
    /// Events, decisions and the like that may wait for the writer.
    pub queue_records: usize,
    /// What happens to a sample that finds the queue full.
    pub when_full: WhenFull,
    /// How exactly numbers are kept.
    pub fidelity: Fidelity,
    /// Ages and sizes at which rows are removed.
    pub retention: Retention,
    /// What is stored beside the channels of the table, in the order in which values are handed to `sample`.
    pub extras: Vec<ExtraSeries>,
    /// Why this history is opened, for the segment table: `live`, or the name of the recording that is replayed.
    pub origin: String,
    /// By which clock the rows are dated.
    pub clock: ClockMark,
    /// The rows that follow come right after those that the history holds of the same origin: the state that was left
    /// open stays open. For a recording whose replay was broken off; a live machine has moved on in the meantime.
    pub goes_on: bool,
    /// Room reserved on disk so that a full disk can still be tidied up, bytes.
    pub reserve_bytes: u64,
    /// What is on its way to other systems; `None` where no sink is configured.
    pub outbox: Option<Outbox>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            group_commit: Duration::from_secs(1),
            queue_rows: 16_384,
            queue_records: 16_384,
            when_full: WhenFull::Drop,
            fidelity: Fidelity::Resolution,
            retention: Retention::default(),
            extras: Vec::new(),
            origin: "live".to_owned(),
            clock: ClockMark::from_stepped_time(),
            goes_on: false,
            reserve_bytes: 8_192_000,
            outbox: None,
        }
    }
}
