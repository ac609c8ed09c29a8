//! Between the threads that hand samples in and the one that writes them: bounded, and locked only for moments.

use super::options::{Options, WhenFull};
use super::reason::Reasons;
use super::rows::SeriesRows;
use super::series::Series;
use super::series_kind::ExtraValue;
use adapter_core::Sample;
use adapter_core::clock::TimeNs;
use gateway_records::Record;
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Rows that travel together.
pub(crate) const BATCH_ROWS: usize = 256;
/// Emptied batches kept for reuse.
const FREE_MAX: usize = 8;

/// Something the writer is asked to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum WriterJob {
    /// Make everything handed in so far durable.
    Flush,
    /// Compact, and retire what is too old at this time; without a time nothing is too old.
    Maintain(Option<TimeNs>),
    /// The clock by which the rows since opening are dated is confirmed.
    ConfirmClock,
}

/// A record on its way to the disk.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct QueuedRecord {
    pub(crate) record: Record,
    /// Counts the records that were handed in; zero for one that the writer made itself.
    pub(crate) ticket: u64,
    /// So many rows had been taken on before it: it becomes durable with the last of them, not before, not after.
    pub(crate) after_rows: u64,
}

#[derive(Debug)]
struct MailboxState {
    current: SeriesRows,
    full: VecDeque<SeriesRows>,
    free: Vec<SeriesRows>,
    queued_rows: usize,
    /// Rows taken on since opening.
    taken_rows: u64,
    records: VecDeque<QueuedRecord>,
    /// Records handed in so far; the number of the newest is its ticket.
    last_ticket: u64,
    /// Records that the writer holds but has not made durable.
    held_records: usize,
    reasons: Reasons,
    dropped_samples: u64,
    dropped_records: u64,
    jobs: VecDeque<(u64, WriterJob)>,
    last_job: u64,
    finished_job: u64,
    closing: bool,
    stopped: bool,
}

/// What the writer takes out in one go.
pub(crate) struct Delivery {
    pub(crate) batches: VecDeque<SeriesRows>,
    pub(crate) records: VecDeque<QueuedRecord>,
    pub(crate) reasons: Reasons,
    pub(crate) job: Option<(u64, WriterJob)>,
    pub(crate) closing: bool,
}

/// Waiting room of one history.
#[derive(Debug)]
pub(crate) struct Mailbox {
    state: Mutex<MailboxState>,
    /// Something has arrived for the writer.
    arrived: Condvar,
    /// The writer has taken something, or has finished a job.
    progressed: Condvar,
    queue_rows: usize,
    queue_records: usize,
    when_full: WhenFull,
}

/// Figures of the waiting room.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct QueueFigures {
    pub(crate) rows: usize,
    pub(crate) records: usize,
    pub(crate) dropped_samples: u64,
    pub(crate) dropped_records: u64,
}

impl Mailbox {
    pub(crate) fn new(series: &[Series], options: &Options) -> Self {
        let state = MailboxState {
            current: SeriesRows::for_series(series),
            full: VecDeque::new(),
            free: Vec::new(),
            queued_rows: 0,
            taken_rows: 0,
            records: VecDeque::new(),
            last_ticket: 0,
            held_records: 0,
            reasons: Reasons::default(),
            dropped_samples: 0,
            dropped_records: 0,
            jobs: VecDeque::new(),
            last_job: 0,
            finished_job: 0,
            closing: false,
            stopped: false,
        };
        Self {
            state: Mutex::new(state),
            arrived: Condvar::new(),
            progressed: Condvar::new(),
            queue_rows: options.queue_rows.max(1),
            queue_records: options.queue_records.max(1),
            when_full: options.when_full,
        }
    }

    fn lock_state(&self) -> MutexGuard<'_, MailboxState> {
        // Nothing in here is left half done by a panic: every push is completed before the lock is released.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait_for_progress<'a>(&self, state: MutexGuard<'a, MailboxState>) -> MutexGuard<'a, MailboxState> {
        self.progressed.wait(state).unwrap_or_else(PoisonError::into_inner)
    }

    /// Queues one tick; the samples dropped so far.
    pub(crate) fn queue_sample(&self, sample: &Sample, extras: &[ExtraValue<'_>]) -> u64 {
        let mut state = self.lock_state();
        while state.queued_rows >= self.queue_rows && self.when_full == WhenFull::Wait && !state.stopped {
            self.arrived.notify_one();
            state = self.wait_for_progress(state);
        }
        if state.queued_rows >= self.queue_rows || state.stopped {
            state.dropped_samples += 1;
            return state.dropped_samples;
        }
        let MailboxState { current, reasons, .. } = &mut *state;
        current.push(sample, extras, reasons);
        state.queued_rows += 1;
        state.taken_rows += 1;
        if state.current.len() >= BATCH_ROWS.min(self.queue_rows) {
            state.close_batch();
            self.arrived.notify_one();
        }
        state.dropped_samples
    }

    /// Queues one record; its ticket, or `None` when the queue is full.
    pub(crate) fn queue_record(&self, record: Record) -> Option<u64> {
        let mut state = self.lock_state();
        while state.waiting_records() >= self.queue_records && self.when_full == WhenFull::Wait && !state.stopped {
            self.arrived.notify_one();
            state = self.wait_for_progress(state);
        }
        if state.waiting_records() >= self.queue_records || state.stopped {
            state.dropped_records += 1;
            return None;
        }
        state.last_ticket += 1;
        let (ticket, after_rows) = (state.last_ticket, state.taken_rows);
        state.records.push_back(QueuedRecord { record, ticket, after_rows });
        Some(ticket)
    }

    /// Asks for a job and returns its number.
    pub(crate) fn queue_job(&self, job: WriterJob) -> u64 {
        let mut state = self.lock_state();
        state.last_job += 1;
        let number = state.last_job;
        state.jobs.push_back((number, job));
        self.arrived.notify_one();
        number
    }

    /// Waits until job `number` is finished; false when it was not within `limit` or the writer has stopped.
    pub(crate) fn await_job(&self, number: u64, limit: Duration) -> bool {
        let until = Instant::now() + limit;
        let mut state = self.lock_state();
        while state.finished_job < number && !state.stopped {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return false;
            }
            state = self.progressed.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0;
        }
        state.finished_job >= number
    }

    /// Asks the writer to finish.
    pub(crate) fn request_close(&self) {
        self.lock_state().closing = true;
        self.arrived.notify_one();
    }

    /// The writer's side: waits until there is a full batch, a job or `limit` has passed, then takes what is there.
    /// `rows_too` false leaves the samples where they are.
    pub(crate) fn receive_delivery(&self, limit: Duration, rows_too: bool, job_too: bool) -> Delivery {
        let mut state = self.lock_state();
        let ready = |state: &MailboxState| {
            (rows_too && !state.full.is_empty()) || (job_too && !state.jobs.is_empty()) || state.closing
        };
        if !ready(&state) && !limit.is_zero() {
            let waited = self.arrived.wait_timeout_while(state, limit, |state| !ready(state));
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        let delivery = state.collect_delivery(rows_too, job_too);
        self.progressed.notify_all();
        delivery
    }

    /// The writer's side: an emptied batch, and how many records it still holds.
    pub(crate) fn recycle_batch(&self, mut batch: SeriesRows) {
        batch.clear();
        let mut state = self.lock_state();
        if state.free.len() < FREE_MAX {
            state.free.push(batch);
        }
    }

    /// The writer's side: how many records it holds that are not durable yet.
    pub(crate) fn hold_records(&self, count: usize) {
        self.lock_state().held_records = count;
        self.progressed.notify_all();
    }

    /// The writer's side: job `number` is done.
    pub(crate) fn finish_job(&self, number: u64) {
        self.lock_state().finished_job = number;
        self.progressed.notify_all();
    }

    /// The writer's side: there is nobody to write any more.
    pub(crate) fn mark_stopped(&self) {
        self.lock_state().stopped = true;
        self.progressed.notify_all();
    }

    /// Is there nobody to write any more?
    pub(crate) fn is_stopped(&self) -> bool {
        self.lock_state().stopped
    }

    /// Would a record that is handed in now be taken?
    pub(crate) fn takes_records(&self) -> bool {
        let state = self.lock_state();
        !state.stopped && state.waiting_records() < self.queue_records
    }

    pub(crate) fn measure_queue(&self) -> QueueFigures {
        let state = self.lock_state();
        QueueFigures {
            rows: state.queued_rows,
            records: state.waiting_records(),
            dropped_samples: state.dropped_samples,
            dropped_records: state.dropped_records,
        }
    }
}

impl MailboxState {
    fn waiting_records(&self) -> usize {
        self.records.len() + self.held_records
    }

    fn close_batch(&mut self) {
        let empty = self.free.pop().unwrap_or_else(|| self.current.empty_like());
        let full = std::mem::replace(&mut self.current, empty);
        self.full.push_back(full);
    }

    fn collect_delivery(&mut self, rows_too: bool, job_too: bool) -> Delivery {
        let mut batches = VecDeque::new();
        if rows_too {
            if !self.current.is_empty() {
                self.close_batch();
            }
            batches = std::mem::take(&mut self.full);
            self.queued_rows = 0;
        }
        let records = std::mem::take(&mut self.records);
        self.held_records += records.len();
        Delivery {
            batches,
            records,
            reasons: self.reasons.clone(),
            job: if job_too { self.jobs.pop_front() } else { None },
            closing: self.closing,
        }
    }
}
