//! The writer thread: takes what has gathered, seals minutes, commits at its own pace, and keeps going whatever the
//! disk says.

use super::commit::{TailSlots, commit_buffer};
use super::error::HistoryError;
use super::mailbox::{Delivery, Mailbox, WriterJob};
use super::maintenance::Maintenance;
use super::minute_buffer::MinuteBuffer;
use super::options::{Options, WhenFull};
use super::outbox::Gatherer;
use super::record_sql::close_state;
use super::rows::SeriesRows;
use super::segments;
use super::status::SharedStatus;
use adapter_core::clock::TimeNs;
use adapter_core::threads::reach_fault_point;
use gateway_base::clock::Trust;
use rusqlite::Connection;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// This many sealed blocks are committed without waiting for the next regular commit.
const BLOCKS_PRESSING: usize = 16;
/// At least this long between attempts while the disk refuses.
const RETRY: Duration = Duration::from_millis(250);
/// When asked to finish and the disk refuses: this many attempts.
const LAST_ATTEMPTS: usize = 8;

pub(crate) struct Thread {
    pub(crate) db: Connection,
    pub(crate) minute_buffer: MinuteBuffer,
    pub(crate) outbox: Option<Gatherer>,
    pub(crate) slots: TailSlots,
    pub(crate) maintenance: Maintenance,
    pub(crate) mailbox: Arc<Mailbox>,
    pub(crate) shared: Arc<SharedStatus>,
    pub(crate) options: Options,
    pub(crate) schedule: CommitSchedule,
}

/// When to commit, and what is being waited for.
#[derive(Debug)]
pub(crate) struct CommitSchedule {
    next_commit: Instant,
    failures: usize,
    flushing: Option<u64>,
    maintaining: Option<u64>,
    /// It is still to be noted that the clock is confirmed.
    confirming: bool,
}

impl Default for CommitSchedule {
    fn default() -> Self {
        Self { next_commit: Instant::now(), failures: 0, flushing: None, maintaining: None, confirming: false }
    }
}

/// Tells everybody who waits that nobody writes any more, also when the thread panics.
struct StopGuard(Arc<Mailbox>);

impl Drop for StopGuard {
    fn drop(&mut self) {
        self.0.mark_stopped();
    }
}

impl Thread {
    pub(crate) fn run(mut self) {
        let _guard = StopGuard(self.mailbox.clone());
        loop {
            self.shared.rounds.fetch_add(1, Ordering::Relaxed);
            reach_fault_point("history");
            let rows_too = self.takes_rows();
            let delivery = self.receive_delivery(rows_too);
            let closing = delivery.closing && delivery.batches.is_empty();
            self.accept_delivery(delivery);
            self.commit_if_due(closing);
            self.run_maintenance();
            let done = rows_too && !self.is_dirty();
            if closing && (done || self.schedule.failures >= LAST_ATTEMPTS) {
                return self.finish_writing();
            }
        }
    }

    /// While nothing becomes durable, a recording waits and a live machine goes on.
    fn takes_rows(&self) -> bool {
        !(self.minute_buffer.is_full() && self.options.when_full == WhenFull::Wait)
    }

    fn receive_delivery(&mut self, rows_too: bool) -> Delivery {
        let until_commit = self.schedule.next_commit.saturating_duration_since(Instant::now());
        let limit = if self.maintenance.is_busy() { Duration::ZERO } else { until_commit };
        // A flush promises everything before it, so it cannot come before its rows.
        let job_too = rows_too && self.schedule.flushing.is_none() && self.schedule.maintaining.is_none();
        self.mailbox.receive_delivery(limit, rows_too, job_too)
    }

    fn accept_delivery(&mut self, delivery: Delivery) {
        self.minute_buffer.reasons = delivery.reasons;
        self.minute_buffer.records.extend(delivery.records);
        for batch in delivery.batches {
            if let Some(outbox) = &mut self.outbox {
                outbox.gather_rows(
                    &batch,
                    self.minute_buffer.next_row,
                    &self.minute_buffer.series,
                    &self.minute_buffer.reasons,
                );
            }
            self.take_rows(&batch);
            self.mailbox.recycle_batch(batch);
        }
        match delivery.job {
            Some((number, WriterJob::Flush)) => self.schedule.flushing = Some(number),
            Some((number, WriterJob::Maintain(now_ns))) => {
                self.schedule.maintaining = Some(number);
                self.maintenance.begin_run(now_ns);
            }
            Some((number, WriterJob::ConfirmClock)) => {
                self.options.clock.trust = Trust::Confirmed.as_word();
                self.schedule.confirming = true;
                self.mailbox.finish_job(number);
            }
            None => {}
        }
    }

    /// Takes a batch on, with a commit wherever many blocks wait: rows that are far apart make a block each.
    fn take_rows(&mut self, batch: &SeriesRows) {
        let mut from = 0;
        while from < batch.len() {
            // While the disk refuses, nothing is gained by trying at every block.
            let blocks_max = if self.schedule.failures == 0 { BLOCKS_PRESSING } else { usize::MAX };
            from = self.minute_buffer.ingest_rows(batch, from, blocks_max);
            if self.minute_buffer.blocks.len() >= BLOCKS_PRESSING && self.schedule.failures == 0 {
                // The next regular commit adds what the running minute has by then.
                self.commit_pending(false);
            }
        }
    }

    fn commit_if_due(&mut self, closing: bool) {
        let urgent = self.schedule.failures == 0 && (closing || self.schedule.flushing.is_some());
        if urgent || Instant::now() >= self.schedule.next_commit {
            self.commit_pending(true);
        } else if closing {
            std::thread::sleep(self.schedule.next_commit.saturating_duration_since(Instant::now()));
        }
    }

    fn commit_pending(&mut self, with_tail: bool) {
        let began = Instant::now();
        let wait = self.options.group_commit;
        if !self.is_dirty() {
            self.schedule.next_commit = began + wait;
            return self.acknowledge_rows();
        }
        match self.commit_with_retry(with_tail) {
            Ok(()) => {
                let took = gateway_base::convert::saturate_to_us(began.elapsed());
                self.shared.commit_us.store(took, Ordering::Relaxed);
                self.shared.commits.fetch_add(1, Ordering::Relaxed);
                self.schedule.failures = 0;
                if with_tail {
                    self.schedule.next_commit = began + wait;
                }
                self.shared.mark_recovered();
                self.note_clock();
                self.acknowledge_rows();
                self.tidy_after_commit();
            }
            Err(error) => {
                self.schedule.failures += 1;
                self.schedule.next_commit = Instant::now() + wait.max(RETRY);
                self.shared.mark_degraded(&degraded_text(&error));
                if error.is_damage() {
                    // Trying again changes nothing: whoever holds the writer goes on with another file.
                    self.schedule.failures = LAST_ATTEMPTS;
                    self.shared.mark_damaged(&error.to_string());
                }
            }
        }
        self.shared.lost.store(self.minute_buffer.lost_rows, Ordering::Relaxed);
        self.mailbox.hold_records(self.minute_buffer.records.len());
    }

    /// One commit; on a full disk a second one after making room.
    fn commit_with_retry(&mut self, with_tail: bool) -> Result<(), HistoryError> {
        match self.commit_all(with_tail) {
            Err(error) if error.is_full() => {
                let waiting: u64 = self.minute_buffer.blocks.iter().map(|block| block.size_bytes() as u64).sum();
                self.maintenance.make_room(&mut self.db, 2 * waiting + 65_536)?;
                self.commit_all(with_tail)
            }
            done => done,
        }
    }

    fn commit_all(&mut self, with_tail: bool) -> Result<(), HistoryError> {
        let Self { db, minute_buffer, slots, outbox, options, .. } = self;
        let dated = (options.origin.as_str(), &options.clock);
        while !commit_buffer(db, minute_buffer, slots, outbox, dated, with_tail)? {}
        Ok(())
    }

    /// Is there anything that a commit would make durable?
    fn is_dirty(&self) -> bool {
        self.minute_buffer.is_dirty() || self.outbox.as_ref().is_some_and(Gatherer::is_dirty)
    }

    fn acknowledge_rows(&mut self) {
        let (through_ns, next_row) = self.minute_buffer.durable_end();
        if let Some(through_ns) = through_ns {
            self.shared.acknowledged_ns.store(through_ns, Ordering::Release);
        }
        let rows = self.minute_buffer.rows_through(next_row);
        self.shared.rows.store(rows.saturating_sub(self.minute_buffer.lost_rows), Ordering::Relaxed);
        self.shared.acknowledged_record.store(self.minute_buffer.durable_ticket, Ordering::Release);
        if let Some(number) = self.schedule.flushing.take() {
            self.mailbox.finish_job(number);
        }
    }

    /// The rows of the running segment are in the file by now.
    fn note_clock(&mut self) {
        if self.schedule.confirming {
            // Where this fails it is tried again after the next commit.
            self.schedule.confirming = segments::confirm_clock(&self.db, &self.options.clock).is_err();
        }
    }

    fn tidy_after_commit(&mut self) {
        match self.maintenance.after_commit(&mut self.db) {
            Ok(used) => self.shared.bytes.store(used, Ordering::Relaxed),
            Err(error) => self.shared.mark_degraded(&degraded_text(&error)),
        }
        self.shared.retired.store(self.maintenance.retired, Ordering::Relaxed);
        self.shared.log_bytes.store(self.maintenance.log_bytes, Ordering::Relaxed);
        self.shared.short_of_room.store(self.maintenance.is_short(), Ordering::Relaxed);
    }

    fn run_maintenance(&mut self) {
        if !self.maintenance.is_busy() {
            return;
        }
        let more = self.maintenance.run_step(&mut self.db).unwrap_or_else(|error| {
            // Maintenance can wait; what is being recorded cannot.
            self.shared.mark_degraded(&degraded_text(&error));
            self.maintenance.abandon_run();
            false
        });
        self.shared.retired.store(self.maintenance.retired, Ordering::Relaxed);
        if let Some(number) = self.schedule.maintaining.take_if(|_| !more) {
            self.mailbox.finish_job(number);
        }
    }

    fn finish_writing(mut self) {
        if let Some(number) = self.schedule.maintaining {
            self.mailbox.finish_job(number);
        }
        // The running minute becomes a block, so that its summaries are complete and leave the box; where this fails, the tail has it.
        self.minute_buffer.seal_open_rows();
        let _ = self.commit_all(false);
        // A clean end ends the state that the machine was in; after a failure the next start does it.
        if let Some(newest_ns) = self.minute_buffer.newest_ns() {
            let _ = end_state(&mut self.db, newest_ns);
        }
        if let Some(outbox) = &mut self.outbox {
            // Where this fails, the sinks send again what they sent last.
            let _ = outbox.close(&mut self.db, &self.minute_buffer.reasons);
        }
        // What is committed is in the log already; a failing last checkpoint loses nothing.
        let _ = self.db.close();
    }
}

/// In one transaction: a state of some days is many rows, and each commit of its own would wait for the disk.
fn end_state(db: &mut Connection, newest_ns: TimeNs) -> Result<(), rusqlite::Error> {
    let ending = db.transaction()?;
    close_state(&ending, newest_ns, "stop")?;
    ending.commit()
}

fn degraded_text(error: &HistoryError) -> String {
    if error.is_full() {
        return "The disk is full: the newest samples wait in memory, the oldest raw samples are given up. Free some \
                room on the disk of the history."
            .to_owned();
    }
    if error.is_locked() {
        return "Another program holds a transaction open on the history; new samples wait in memory. Close that \
                transaction."
            .to_owned();
    }
    error.to_string()
}
