//! On the writer thread: lines of ticks wait here until the commit that makes their rows durable gives them their
//! numbers.

use super::handle::{Outbox, OutboxHead};
use super::item::{SeriesInfo, is_deliverable};
use super::line::{self, NOT_RUNNING};
use super::means::{self, Bucket, MeanSchedule};
use super::means_again;
use super::report::{OutboxReport, OutboxSettings};
use super::store::{self, OutboxContents, Put};
use crate::HistoryError;
use crate::error::Doing;
use crate::mailbox::QueuedRecord;
use crate::reason::Reasons;
use crate::rows::SeriesRows;
use crate::series::Series;
use adapter_core::clock::TimeNs;
use gateway_base::convert::saturate_to_ns;
use rusqlite::Connection;
use std::borrow::Cow;
use std::collections::{BTreeSet, VecDeque};
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

/// Ticks that are further apart than this, and than three ticks, have a gap between them. Shorter: a tick that was late would end
/// every value; longer: a value is carried so far into a time of which nothing is known.
const GAP: Duration = Duration::from_secs(2);

/// How often it is looked whether the sinks have delivered everything, at the end.
const LOOK_EVERY: Duration = Duration::from_millis(10);

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
    series: Vec<Arc<SeriesInfo>>,
    pending_lines: VecDeque<PendingLine>,
    bytes: usize,
    /// Lines dropped because the disk took nothing for too long; they never got a number.
    lost: u64,
    contents: OutboxContents,
    tidied: Instant,
    /// Time until the next note.
    tidy_after: Duration,
    /// Time of the newest tick, of an earlier run too; with why there may be a gap after it.
    last: Option<(TimeNs, &'static str)>,
    means: MeanSchedule,
    /// Means that are told once more, because rows were dated anew.
    due_again: BTreeSet<Bucket>,
}

/// Means that are told once more in one commit, so that it stays short.
const AGAIN_AT_ONCE: usize = 1000;

/// What a transaction has taken, to be forgotten when it is durable.
pub(crate) struct TransactionWork {
    ticks: usize,
    put: Put,
    tidy: bool,
    means: MeanSchedule,
    /// Means that were told once more.
    again: usize,
}

fn build_series_info(series: &Series, settings: &OutboxSettings) -> SeriesInfo {
    let info = SeriesInfo::from(series);
    SeriesInfo { range: settings.range_of(&info), ..info }
}

impl Gatherer {
    /// Creates the tables where they are missing, and finds what each sink still has to deliver. `newest_ns` is the time of the
    /// newest row of the history.
    pub(crate) fn open(
        db: &mut Connection,
        outbox: Outbox,
        series: &[Series],
        newest_ns: Option<TimeNs>,
    ) -> Result<Self, HistoryError> {
        let stored = store::open_outbox(db, &outbox)?;
        let gatherer = Self {
            report: OutboxReport::new(outbox.settings(), series),
            series: series.iter().map(|series| Arc::new(build_series_info(series, outbox.settings()))).collect(),
            pending_lines: VecDeque::new(),
            bytes: 0,
            lost: 0,
            contents: stored,
            tidied: Instant::now(),
            tidy_after: Duration::ZERO,
            last: newest_ns.map(|newest_ns| (newest_ns, NOT_RUNNING)),
            means: MeanSchedule::new(newest_ns),
            due_again: means_again::load_buckets(db)?,
            outbox,
        };
        gatherer.publish_state(&Reasons::default());
        Ok(gatherer)
    }

    /// Takes on a batch of ticks whose first has the number `first_row`.
    pub(crate) fn gather_rows(&mut self, rows: &SeriesRows, first_row: i64, series: &[Series], reasons: &Reasons) {
        let gaps = self.find_gaps(rows);
        let Self { report, pending_lines: waiting, bytes, .. } = self;
        let mut put = |index: usize, at_ns: TimeNs, text: String| {
            *bytes += text.len();
            waiting.push_back(PendingLine { row: first_row + index as i64, at_ns, text });
        };
        for (row, at_ns) in rows.at_ns.iter().enumerate() {
            if let Some((_, from_ns, reason)) = gaps.iter().find(|(index, ..)| *index == row) {
                put(row, *from_ns, line::of_gap(*from_ns, Some(*at_ns), reason));
                report.begin_anew();
            }
            if let Some(text) = report.report_tick(rows, row, series, reasons) {
                put(row, *at_ns, text);
            }
        }
        while self.bytes > WAITING_BYTES_MAX {
            let Some(oldest) = self.pending_lines.pop_front() else { break };
            self.bytes -= oldest.text.len();
            self.lost += 1;
        }
    }

    /// Which of these rows come after a gap: index of the row, where the gap begins, and why.
    fn find_gaps(&mut self, rows: &SeriesRows) -> Vec<(usize, TimeNs, &'static str)> {
        let tick_ns = saturate_to_ns(self.outbox.settings().tick);
        let greatest_ns = saturate_to_ns(GAP).max(tick_ns.saturating_mul(3));
        let mut gaps = Vec::new();
        for (row, at_ns) in rows.at_ns.iter().enumerate() {
            let last = self.last.replace((*at_ns, "no_samples"));
            // A clock that went back leaves no gap.
            if let Some((last_ns, reason)) = last.filter(|(last_ns, _)| at_ns - last_ns > greatest_ns) {
                gaps.push((row, last_ns + tick_ns, reason));
            }
        }
        gaps
    }

    /// Would a commit change anything here?
    pub(crate) fn is_dirty(&self) -> bool {
        self.outbox.has_news() && self.is_due()
    }

    /// Is it time to note what the sinks have delivered? A new connection is noted at once.
    fn is_due(&self) -> bool {
        self.tidied.elapsed() >= self.tidy_after || self.outbox.has_connections()
    }

    /// At the end: tells that nothing comes any more, waits for the sinks within the time that the settings allow, and notes what
    /// they have delivered.
    pub(crate) fn close(&mut self, db: &mut Connection, reasons: &Reasons) -> Result<(), HistoryError> {
        self.tell_end(db, reasons)?;
        let until = Instant::now() + self.outbox.settings().drain;
        while Instant::now() < until && !self.outbox.is_drained(self.contents.next_sequence) {
            std::thread::sleep(LOOK_EVERY);
        }
        store::note_deliveries(db, &self.outbox, &[])
    }

    /// The last items: the hour and the day that are running, and that there are no samples from here on.
    fn tell_end(&mut self, db: &mut Connection, reasons: &Reasons) -> Result<(), HistoryError> {
        let Some((last_ns, "no_samples")) = self.last else { return Ok(()) };
        let tick = self.outbox.settings().tick;
        let ending = db.transaction().with_activity("ending the outbox")?;
        let running = self.means.current_buckets().collect();
        let mut lines: Vec<(TimeNs, Cow<'_, str>)> = means::format_lines(&ending, &running, tick)?
            .into_iter()
            .map(|(at_ns, text)| (at_ns, text.into()))
            .collect();
        let from_ns = last_ns.saturating_add(saturate_to_ns(tick));
        lines.push((from_ns, line::of_gap(from_ns, None, "stopped").into()));
        let put = store::store_lines(&ending, &self.outbox, &self.contents, &lines, (false, false))?;
        ending.commit().with_activity("ending the outbox")?;
        self.contents = put.contents;
        self.outbox.mark_dropped(&put.dropped);
        self.publish_state(reasons);
        Ok(())
    }

    /// Puts into the running transaction the items of the ticks before row `end_row` and of these records, which belong
    /// after as many rows from `opened_row` on as they say, and the means that the stored blocks complete, which begin at these
    /// times; then drops what the bounds do not allow (`ages`: the bound of age too, which only a certain clock can tell), and now
    /// and then notes what the sinks have delivered.
    pub(crate) fn store_items<'a>(
        &self,
        db: &Connection,
        records: impl Iterator<Item = &'a QueuedRecord>,
        (opened_row, end_row): (i64, i64),
        (blocks, ages): (impl Iterator<Item = TimeNs>, bool),
    ) -> Result<TransactionWork, HistoryError> {
        let mut lines: Vec<(TimeNs, Cow<'_, str>)> = Vec::new();
        let mut ticks = self.pending_lines.iter().take_while(|line| line.row < end_row).peekable();
        for posted in records.filter(|posted| is_deliverable(&posted.record)) {
            let before = opened_row.saturating_add_unsigned(posted.after_rows);
            while let Some(tick) = ticks.next_if(|tick| tick.row < before) {
                lines.push((tick.at_ns, tick.text.as_str().into()));
            }
            lines.push((posted.record.at_ns(), line::of_record(&posted.record).into()));
        }
        lines.extend(ticks.map(|tick| (tick.at_ns, tick.text.as_str().into())));
        let mut means = self.means;
        let mut due = means.collect_due_buckets(blocks);
        let again = self.due_again.len().min(AGAIN_AT_ONCE);
        due.extend(self.due_again.iter().take(again));
        if again > 0 && again == self.due_again.len() {
            means_again::forget_stretches(db)?;
        }
        let told = means::format_lines(db, &due, self.outbox.settings().tick)?;
        lines.extend(told.into_iter().map(|(at_ns, text)| (at_ns, text.into())));
        let ticks = self.pending_lines.iter().take_while(|line| line.row < end_row).count();
        let tidy = self.outbox.has_news() && self.is_due();
        let put = store::store_lines(db, &self.outbox, &self.contents, &lines, (tidy, ages))?;
        Ok(TransactionWork { ticks, put, tidy, means, again })
    }

    /// What was put is durable.
    pub(crate) fn confirm_commit(&mut self, taken: TransactionWork, reasons: &Reasons) {
        for line in self.pending_lines.drain(..taken.ticks) {
            self.bytes -= line.text.len();
        }
        debug_assert!(
            taken.put.contents.next_sequence >= self.contents.next_sequence,
            "the numbers of items only grow: a receiver takes one that comes again for one it has"
        );
        self.contents = taken.put.contents;
        self.means = taken.means;
        for _ in 0..taken.again {
            self.due_again.pop_first();
        }
        self.outbox.mark_dropped(&taken.put.dropped);
        if taken.tidy {
            self.tidied = Instant::now();
            self.tidy_after = (2 * self.tidy_after).clamp(TIDY_FIRST, TIDY_EVERY);
            self.outbox.connections_noted();
        }
        self.publish_state(reasons);
    }

    fn publish_state(&self, reasons: &Reasons) {
        let OutboxContents { next_sequence, newest_ns, .. } = self.contents;
        self.outbox.publish_state(
            OutboxHead { next_sequence, newest_ns, ready: true },
            self.contents.to_figures(self.lost),
            self.report.latest_readings(&self.series, reasons),
        );
    }
}
