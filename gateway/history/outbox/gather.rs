//! On the writer thread: lines of ticks wait here until the commit that makes their rows durable gives them their
//! numbers.

use super::item::{SeriesInfo, leaves};
use super::line;
use super::report::OutboxReport;
use super::shared::{Outbox, OutboxHead};
use super::store::{self, OutboxContents, Put};
use crate::history::HistoryError;
use crate::history::mailbox::QueuedRecord;
use crate::history::reason::Reasons;
use crate::history::rows::SeriesRows;
use crate::history::series::Series;
use adapters::clock::TimeNs;
use rusqlite::Connection;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Lines that may wait for a disk that takes nothing; beyond that the oldest is dropped and counted. At 10 ticks a second
/// with 20 changing values about four hours.
const WAITING_BYTES_MAX: usize = 16_000_000;

/// What the sinks have delivered is noted, and removed, this often: each time costs two pages of the disk (flash wears), and
/// what is not noted is sent again after a kill. The first time comes with the first delivery, and each time after it twice as long
/// after the one before: a box that lives for seconds only repeats no more than half of what it had sent.
const TIDY_EVERY: Duration = Duration::from_secs(5);
const TIDY_FIRST: Duration = Duration::from_millis(250);

/// The line of one tick.
#[derive(Debug)]
struct PendingLine {
    row: i64,
    at_ns: TimeNs,
    text: String,
}

/// The outbox on the side of the writer.
#[derive(Debug)]
pub(crate) struct Gatherer {
    outbox: Outbox,
    report: OutboxReport,
    known: Vec<Arc<SeriesInfo>>,
    waiting: VecDeque<PendingLine>,
    bytes: usize,
    /// Lines dropped because the disk took nothing for too long; they never got a number.
    lost: u64,
    stored: OutboxContents,
    tidied: Instant,
    /// Time until the next note.
    tidy_after: Duration,
}

/// What a transaction has taken, to be forgotten when it is durable.
pub(crate) struct TransactionWork {
    ticks: usize,
    put: Put,
    tidy: bool,
}

impl Gatherer {
    /// Creates the tables where they are missing, and finds what each sink still has to deliver.
    pub(crate) fn open(db: &mut Connection, outbox: Outbox, series: &[Series]) -> Result<Self, HistoryError> {
        let stored = store::open(db, &outbox)?;
        let gatherer = Self {
            report: OutboxReport::new(outbox.settings(), series),
            known: series.iter().map(|series| Arc::new(SeriesInfo::from(series))).collect(),
            waiting: VecDeque::new(),
            bytes: 0,
            lost: 0,
            stored,
            tidied: Instant::now(),
            tidy_after: Duration::ZERO,
            outbox,
        };
        gatherer.tell(&Reasons::default());
        Ok(gatherer)
    }

    /// Takes on a batch of ticks whose first has the number `first_row`.
    pub(crate) fn gather(&mut self, rows: &SeriesRows, first_row: i64, series: &[Series], reasons: &Reasons) {
        let Self { report, waiting, bytes, .. } = self;
        report.lines(rows, series, reasons, |index, text| {
            *bytes += text.len();
            waiting.push_back(PendingLine { row: first_row + index as i64, at_ns: rows.at_ns[index], text });
        });
        while self.bytes > WAITING_BYTES_MAX {
            let Some(oldest) = self.waiting.pop_front() else { break };
            self.bytes -= oldest.text.len();
            self.lost += 1;
        }
    }

    /// Would a commit change anything here?
    pub(crate) fn is_dirty(&self) -> bool {
        self.outbox.has_news() && self.is_due()
    }

    /// Is it time to note what the sinks have delivered? A new connection is noted at once.
    fn is_due(&self) -> bool {
        self.tidied.elapsed() >= self.tidy_after || self.outbox.has_connections()
    }

    /// At the end: notes what the sinks have delivered.
    pub(crate) fn close(&self, db: &Connection) -> Result<(), HistoryError> {
        store::note(db, &self.outbox, &[])
    }

    /// Puts into the running transaction the items of the ticks before row `end_row` and of these records, which belong
    /// after as many rows from `opened_row` on as they say; then drops what the bounds do not allow (`ages`: the bound of age
    /// too, which only a certain clock can tell), and now and then notes what the sinks have delivered.
    pub(crate) fn put<'a>(
        &self,
        db: &Connection,
        records: impl Iterator<Item = &'a QueuedRecord>,
        (opened_row, end_row): (i64, i64),
        ages: bool,
    ) -> Result<TransactionWork, HistoryError> {
        let mut lines: Vec<(TimeNs, std::borrow::Cow<'_, str>)> = Vec::new();
        let mut ticks = self.waiting.iter().take_while(|line| line.row < end_row).peekable();
        for posted in records.filter(|posted| leaves(&posted.record)) {
            let before = opened_row.saturating_add_unsigned(posted.after_rows);
            while let Some(tick) = ticks.next_if(|tick| tick.row < before) {
                lines.push((tick.at_ns, tick.text.as_str().into()));
            }
            lines.push((posted.record.at_ns(), line::of_record(&posted.record).into()));
        }
        lines.extend(ticks.map(|tick| (tick.at_ns, tick.text.as_str().into())));
        let ticks = self.waiting.iter().take_while(|line| line.row < end_row).count();
        let tidy = self.outbox.has_news() && self.is_due();
        let put = store::put(db, &self.outbox, &self.stored, &lines, (tidy, ages))?;
        Ok(TransactionWork { ticks, put, tidy })
    }

    /// What was put is durable.
    pub(crate) fn committed(&mut self, taken: TransactionWork, reasons: &Reasons) {
        for line in self.waiting.drain(..taken.ticks) {
            self.bytes -= line.text.len();
        }
        self.stored = taken.put.stored;
        self.outbox.noted(&taken.put.dropped);
        if taken.tidy {
            self.tidied = Instant::now();
            self.tidy_after = (2 * self.tidy_after).clamp(TIDY_FIRST, TIDY_EVERY);
            self.outbox.connections_noted();
        }
        self.tell(reasons);
    }

    fn tell(&self, reasons: &Reasons) {
        let OutboxContents { next_sequence, newest_ns, .. } = self.stored;
        self.outbox.publish(
            OutboxHead { next_sequence, newest_ns, ready: true },
            self.stored.figures(self.lost),
            self.report.latest(&self.known, reasons),
        );
    }
}
