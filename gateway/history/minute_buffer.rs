//! What the writer thread holds in memory: the rows of the running minute, and what is sealed but not yet durable.

use super::block::{Block, Encoder, LEVEL_FRESH};
use super::error::HistoryError;
use super::levels::MINUTE_NS;
use super::mailbox::QueuedRecord;
use super::options::WhenFull;
use super::reason::Reasons;
use super::rows::SeriesRows;
use super::series::Series;
use adapter_core::clock::{SECOND_NS, TimeNs};
use gateway_base::convert::clamp_to_unsigned;
use gateway_records::{Event, Record};
use std::collections::VecDeque;

/// A block is sealed at this many rows even within its minute: bounds memory at 100 Hz and beyond.
const BLOCK_ROWS_MAX: usize = 6_000;
/// Blocks that may wait for the disk. An hour at one block a minute. Beyond that a live box drops the oldest and counts it; a recording
/// waits, and has what it had taken on by then.
const PENDING_MAX: usize = 64;

/// A stretch of increasing time, to be written before its first row.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Segment {
    pub(crate) id: i64,
    pub(crate) first_row: i64,
    pub(crate) start_ns: TimeNs,
    pub(crate) reason: &'static str,
}

/// Where the file ended when it was opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct End {
    pub(crate) segment: i64,
    pub(crate) next_row: i64,
    pub(crate) last_ns: Option<TimeNs>,
}

/// Rows and records that are not durable yet.
pub(crate) struct MinuteBuffer {
    pub(crate) series: Vec<Series>,
    pub(crate) reasons: Reasons,
    encoder: Encoder,
    /// Rows of the running minute.
    pub(crate) open: SeriesRows,
    /// How many of them the crash tail already holds.
    pub(crate) in_tail: usize,
    pub(crate) segments: VecDeque<Segment>,
    pub(crate) blocks: VecDeque<Block>,
    pub(crate) records: VecDeque<QueuedRecord>,
    /// Ticket of the newest record that is durable.
    pub(crate) durable_ticket: u64,
    pub(crate) segment: i64,
    /// Number of the first row after opening.
    pub(crate) opened_row: i64,
    /// Number of the next row that arrives.
    pub(crate) next_row: i64,
    last_ns: Option<TimeNs>,
    /// Time of the newest row in a block.
    sealed_ns: Option<TimeNs>,
    fresh: bool,
    when_full: WhenFull,
    /// Rows dropped because the disk took nothing for too long.
    pub(crate) lost_rows: u64,
}

impl MinuteBuffer {
    pub(crate) fn new(series: Vec<Series>, end: End, when_full: WhenFull) -> Result<Self, HistoryError> {
        let encoder = Encoder::new(LEVEL_FRESH).map_err(|error| HistoryError::Io { path: "zstd".into(), error })?;
        let open = SeriesRows::for_series(&series);
        Ok(Self {
            series,
            reasons: Reasons::default(),
            encoder,
            open,
            in_tail: 0,
            segments: VecDeque::new(),
            blocks: VecDeque::new(),
            records: VecDeque::new(),
            durable_ticket: 0,
            segment: end.segment,
            opened_row: end.next_row,
            next_row: end.next_row,
            last_ns: end.last_ns,
            sealed_ns: end.last_ns,
            fresh: true,
            when_full,
            lost_rows: 0,
        })
    }

    /// No more blocks should be taken on before some are durable.
    pub(crate) fn is_full(&self) -> bool {
        self.blocks.len() >= PENDING_MAX
    }

    /// Is there anything that a commit would make durable?
    pub(crate) fn is_dirty(&self) -> bool {
        !self.blocks.is_empty() || !self.records.is_empty() || self.in_tail < self.open.len()
    }

    /// Number of the first row of the running minute.
    pub(crate) fn open_row(&self) -> i64 {
        self.next_row - self.open.len() as i64
    }

    /// Rows taken on since opening, up to but without row `row`.
    pub(crate) fn rows_through(&self, row: i64) -> u64 {
        debug_assert!(row >= self.opened_row, "rows are numbered from the one at which the history was opened");
        clamp_to_unsigned(row - self.opened_row)
    }

    /// How many of the records belong to rows before row `row`.
    pub(crate) fn records_through(&self, row: i64) -> usize {
        let rows = self.rows_through(row);
        self.records.partition_point(|posted| posted.after_rows <= rows)
    }

    /// The first `count` records are durable.
    pub(crate) fn forget_records(&mut self, count: usize) {
        let newest = self.records.drain(..count).map(|posted| posted.ticket).max();
        self.durable_ticket = self.durable_ticket.max(newest.unwrap_or(0));
    }

    /// The time of the newest row.
    pub(crate) fn newest_ns(&self) -> Option<TimeNs> {
        self.open.at_ns.last().copied().or(self.blocks.back().map(|block| block.key.end_ns)).or(self.last_ns)
    }

    /// Right after a commit: the time of the newest durable row, and the number of the row after it.
    pub(crate) fn durable_end(&self) -> (Option<TimeNs>, i64) {
        let in_tail = self.in_tail.checked_sub(1).map(|row| self.open.at_ns[row]);
        (in_tail.or(self.sealed_ns), self.open_row() + self.in_tail as i64)
    }

    /// Takes the rows of a batch on from `from`, until all are or `blocks_max` blocks wait; gives the first that is not. Rows of the same minute
    /// gather, a new minute or a clock that went back seals what is there.
    pub(crate) fn ingest_rows(&mut self, batch: &SeriesRows, mut from: usize, blocks_max: usize) -> usize {
        while from < batch.len() && self.blocks.len() < blocks_max {
            self.prepare_row_at(batch.at_ns[from]);
            let minute = batch.at_ns[from].div_euclid(MINUTE_NS);
            let room = BLOCK_ROWS_MAX - self.open.len();
            let mut to = from + 1;
            while to < batch.len()
                && to - from < room
                && batch.at_ns[to] >= batch.at_ns[to - 1]
                && batch.at_ns[to].div_euclid(MINUTE_NS) == minute
            {
                to += 1;
            }
            debug_assert!(to > from && self.open.len() + (to - from) <= BLOCK_ROWS_MAX, "rows find room in the block");
            self.open.append_rows(batch, from..to);
            self.next_row += (to - from) as i64;
            self.last_ns = Some(batch.at_ns[to - 1]);
            from = to;
        }
        from
    }

    /// Makes the open rows ready for one at `at_ns`.
    fn prepare_row_at(&mut self, at_ns: TimeNs) {
        let went_back = self.last_ns.filter(|last_ns| at_ns < *last_ns);
        if let Some(last_ns) = went_back {
            self.note_step(last_ns, at_ns);
        }
        if self.fresh || went_back.is_some() {
            self.seal_open_rows();
            self.segment += 1;
            let reason = if self.fresh { "start" } else { "clock_went_back" };
            self.fresh = false;
            self.segments.push_back(Segment { id: self.segment, first_row: self.next_row, start_ns: at_ns, reason });
        }
        let other_minute = self
            .open
            .at_ns
            .first()
            .is_some_and(|first_ns| first_ns.div_euclid(MINUTE_NS) != at_ns.div_euclid(MINUTE_NS));
        if other_minute || self.open.len() >= BLOCK_ROWS_MAX {
            self.seal_open_rows();
        }
    }

    fn note_step(&mut self, last_ns: TimeNs, at_ns: TimeNs) {
        let back_s = (last_ns - at_ns) as f64 / SECOND_NS as f64;
        let record = Record::Event(Event {
            at_ns,
            kind: "clock_went_back".to_owned(),
            source: "history".to_owned(),
            text: format!("The clock went back by {back_s:.3} s. Samples continue in a new segment."),
            detail: format!("{{\"before_ns\":{last_ns},\"after_ns\":{at_ns}}}"),
        });
        let after_rows = self.rows_through(self.next_row);
        let place = self.records.partition_point(|posted| posted.after_rows <= after_rows);
        self.records.insert(place, QueuedRecord { record, ticket: 0, after_rows });
    }

    /// Turns the open rows into a block.
    pub(crate) fn seal_open_rows(&mut self) {
        if self.open.is_empty() {
            return;
        }
        let first_row = self.open_row();
        // What leaves here is stored as it is, and every reader relies on both.
        debug_assert!(
            self.open.at_ns.is_sorted(),
            "times within a block rise: a clock that goes back begins a segment"
        );
        debug_assert!(
            self.blocks.back().is_none_or(|block| block.key.first_row + block.key.rows == first_row),
            "rows are numbered without holes: a block begins where the one before it ends"
        );
        let block = self.encoder.encode_block(&self.open, &self.series, &self.reasons, self.segment, first_row);
        self.sealed_ns = Some(block.key.end_ns);
        self.open.clear();
        self.in_tail = 0;
        if self.is_full() && self.when_full == WhenFull::Drop {
            self.lost_rows += self.blocks.pop_front().map_or(0, |oldest| oldest.key.rows.unsigned_abs());
        }
        self.blocks.push_back(block);
    }
}
