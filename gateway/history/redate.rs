//! Dating anew what was stored before the clock was certain.
//!
//! A segment says on which start of the computer it was stored and by which anchor it was dated ([`segments`](super::segments)).
//! When that anchor turns out to be wrong, everything of the segment moves by the difference: blocks, summaries, records, and the
//! items that wait for the sinks. Only rows of the same start of the computer can be moved: the time between two starts is what
//! nobody measured. A row of the audit cannot be changed; another one is appended that says which rows were dated how wrongly.

use super::audit;
use super::block::{BLOCK_COLUMNS, Decoder, Encoder, LEVEL_FRESH, StoredBlock};
use super::error::{Doing, HistoryError};
use super::levels::MINUTE_NS;
use super::lock::Lock;
use super::outbox::{self, ItemMove, RedatedItems};
use super::pyramid;
use super::record_sql::add_to_state_hours;
use super::recover::recover_file;
use super::schema;
use super::segments::{self, RECORD_TABLES, RecordMarks, STRETCHES};
use adapter_core::clock::{SECOND_NS, TimeNs};
use gateway_base::clock::{ClockMark, Trust, format_span};
use gateway_records::Audit;
use rusqlite::{Connection, OptionalExtension, params};
use std::ops::Range;
use std::path::Path;

/// A clock that was wrong by no more than this was right: between two starts a time server moves it by some milliseconds, and reading it
/// twice takes some nanoseconds. Dating rows anew for that would change nothing that anybody reads.
const WRONG_NS: i64 = SECOND_NS;

/// What was dated anew.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Redated {
    /// Number of segments that were moved.
    pub segments: u64,
    /// Number of samples in those segments.
    pub samples: i64,
    /// By how much they were moved: least and greatest, ns.
    pub by_ns: (i64, i64),
    /// Items that had been sent under their old dates, `from..to`; empty where none were.
    pub sent: Range<u64>,
    /// What receivers of items have to know, wherever they have them from.
    pub moves: Vec<ItemMove>,
}

/// A segment to be moved.
struct Misdated {
    id: i64,
    rows: Range<i64>,
    by_ns: i64,
    /// Numbers of its records, table by table: after the first, up to the second.
    marks: RecordMarks,
    next_marks: Option<RecordMarks>,
}

/// Tells the history at `path`, which nobody may be writing, by which clock the box goes on. `decided_ns`: a person or a long
/// time has decided that it is this time now, whatever the rows say. Gives what was dated anew for it.
///
/// # Errors
/// The file cannot be opened or written.
pub fn set_clock(path: &Path, mark: &ClockMark, decided_ns: Option<TimeNs>) -> Result<Option<Redated>, HistoryError> {
    if !path.exists() {
        return Ok(None);
    }
    let _lock = Lock::acquire_at(path)?;
    let mut db = schema::open_for_writing(path)?;
    // What lies in the crash tail goes into blocks first.
    recover_file(&mut db, None)?;
    let writing = db.transaction().with_activity("dating rows anew")?;
    if let Some(now_ns) = decided_ns {
        note_decided(&writing, now_ns)?;
    }
    let misdated = if mark.trust == Trust::Unset.as_word() { Vec::new() } else { find_misdated(&writing, mark)? };
    let mut done: Option<Redated> = None;
    for segment in &misdated {
        let samples = segment.redate_segment(&writing, mark)?;
        let before = done.take();
        let (least, greatest) = before.as_ref().map_or((segment.by_ns, segment.by_ns), |done| done.by_ns);
        let numbers = (segment.marks.outbox, segment.next_marks.as_ref().map(|marks| marks.outbox));
        let RedatedItems { sent_range: sent, moves } =
            outbox::redate_items(&writing, numbers, &segment.rows, segment.by_ns)?;
        done = Some(Redated {
            segments: before.as_ref().map_or(0, |done| done.segments) + 1,
            samples: before.as_ref().map_or(0, |done| done.samples) + samples,
            by_ns: (least.min(segment.by_ns), greatest.max(segment.by_ns)),
            moves: before.iter().flat_map(|done| done.moves.clone()).chain(moves).collect(),
            sent: before
                .filter(|done| !done.sent.is_empty())
                .map_or(sent.clone(), |done| done.sent.start..sent.end.max(done.sent.end)),
        });
    }
    writing.commit().with_activity("dating rows anew")?;
    Ok(done)
}

/// From now on only rows stored after this moment say what time it is at least.
fn note_decided(db: &Connection, now_ns: TimeNs) -> Result<(), HistoryError> {
    db.execute(
        "INSERT OR REPLACE INTO meta (key, value)
         SELECT 'clock_decided', coalesce(max(id), 0) || ' ' || ?1 FROM segments",
        [now_ns],
    )
    .map(drop)
    .with_activity("noting the time")
}

/// The segments of this start of the computer, and a run of it without rows, that another clock has dated and nothing has confirmed.
fn find_misdated(db: &Connection, mark: &ClockMark) -> Result<Vec<Misdated>, HistoryError> {
    if mark.boot.is_empty() {
        return Ok(Vec::new());
    }
    let mut statement = db
        .prepare(&format!(
            "SELECT id, first_row, anchor_ns, marks, next_first_row, next_marks
             FROM (SELECT *, lead(first_row) OVER (ORDER BY id) AS next_first_row, lead(marks) OVER (ORDER BY id) AS next_marks
                   FROM ({STRETCHES}))
             WHERE boot = ?1 AND clock IN ('unset', 'plausible') AND abs(anchor_ns - ?2) > ?3 ORDER BY id"
        ))
        .with_activity("looking for rows to date anew")?;
    let marks = |text: Option<String>| text.and_then(|text| serde_json::from_str::<RecordMarks>(&text).ok());
    let rows = statement.query_map(params![mark.boot, mark.anchor_ns, WRONG_NS], |row| {
        let (first, next): (i64, Option<i64>) = (row.get(1)?, row.get(4)?);
        Ok(Misdated {
            id: row.get(0)?,
            rows: first..next.unwrap_or(i64::MAX),
            by_ns: mark.anchor_ns.saturating_sub(row.get(2)?),
            marks: marks(row.get(3)?).unwrap_or_default(),
            next_marks: marks(row.get(5)?),
        })
    });
    rows.and_then(Iterator::collect).with_activity("looking for rows to date anew")
}

impl Misdated {
    /// Moves everything of the segment; gives how many samples.
    fn redate_segment(&self, db: &Connection, mark: &ClockMark) -> Result<i64, HistoryError> {
        let (samples, before) = self.move_blocks(db)?;
        self.move_records(db)?;
        segments::redate_stretch(db, self.id, self.by_ns, mark)?;
        if let Some(before) = before {
            let after = before.start.saturating_add(self.by_ns)..before.end.saturating_add(self.by_ns);
            let minutes =
                |range: &Range<TimeNs>| range.start.div_euclid(MINUTE_NS)..range.end.div_euclid(MINUTE_NS) + 1;
            pyramid::renew_buckets(db, minutes(&before))?;
            pyramid::renew_buckets(db, pyramid::with_blocks(db, minutes(&after))?)?;
        }
        self.append_audit_row(db)?;
        Ok(samples)
    }

    /// Gives how many samples were moved, and the time that they had before.
    fn move_blocks(&self, db: &Connection) -> Result<(i64, Option<Range<TimeNs>>), HistoryError> {
        let zstd = |error| HistoryError::Io { path: "zstd".into(), error };
        let (mut encoder, mut decoder) = (Encoder::new(LEVEL_FRESH).map_err(zstd)?, Decoder::new().map_err(zstd)?);
        let mut select = db
            .prepare(&format!(
                "SELECT {BLOCK_COLUMNS} FROM blocks WHERE first_row >= ?1 AND first_row < ?2 ORDER BY first_row LIMIT 1"
            ))
            .with_activity("reading a block")?;
        let (mut from, mut samples, mut span_ns) = (self.rows.start, 0, None::<Range<TimeNs>>);
        while let Some(stored) =
            select.query_row([from, self.rows.end], StoredBlock::of_row).optional().with_activity("reading a block")?
        {
            from = stored.key.first_row + 1;
            // A damaged block cannot be moved; it is left out of every answer anyway.
            let Some(moved) = stored.with_shifted_times(self.by_ns, &mut encoder, &mut decoder) else { continue };
            let key = moved.key;
            db.prepare_cached(
                "UPDATE blocks SET start_ns = ?2, end_ns = ?3, directory = ?4, columns = ?5 WHERE first_row = ?1",
            )
            .and_then(|mut update| {
                update.execute(params![key.first_row, key.start_ns, key.end_ns, moved.directory, moved.columns])
            })
            .with_activity("dating a block anew")?;
            samples += key.rows;
            let old = span_ns.get_or_insert(stored.key.start_ns..stored.key.end_ns);
            *old = old.start.min(stored.key.start_ns)..old.end.max(stored.key.end_ns);
        }
        // What is left in the tail lies in blocks, and has the old dates.
        db.execute("DELETE FROM tail WHERE first_row >= ?1 AND first_row < ?2", [self.rows.start, self.rows.end])
            .with_activity("dating rows anew")?;
        Ok((samples, span_ns))
    }

    /// Numbers of its rows in the table at `index` of [`RECORD_TABLES`]: after the first, up to the second.
    fn record_bounds(&self, index: usize) -> Option<(i64, i64)> {
        let from = *self.marks.numbers.get(index)?;
        let to = self.next_marks.as_ref().and_then(|marks| marks.numbers.get(index)).copied().unwrap_or(i64::MAX);
        Some((from, to))
    }

    fn move_records(&self, db: &Connection) -> Result<(), HistoryError> {
        for (index, (table, times)) in RECORD_TABLES.iter().enumerate() {
            let Some((from, to)) = self.record_bounds(index) else { continue };
            if *table == "states" {
                spread_states(db, (from, to), -1.0)?;
            }
            let set: Vec<String> = times.iter().map(|time| format!("{time} = {time} + ?3")).collect();
            let update = format!("UPDATE {table} SET {} WHERE id > ?1 AND id <= ?2", set.join(", "));
            db.execute(&update, [from, to, self.by_ns]).with_activity("dating records anew")?;
            if *table == "states" {
                spread_states(db, (from, to), 1.0)?;
            }
        }
        Ok(())
    }

    /// A row of the audit is never changed: another one says what is wrong with the date of these.
    fn append_audit_row(&self, db: &Connection) -> Result<(), HistoryError> {
        let Some((from, to)) = self.record_bounds(RECORD_TABLES.len()) else { return Ok(()) };
        let found: (Option<i64>, Option<i64>, Option<TimeNs>) = db
            .query_row(
                "SELECT min(number), max(number), max(at_ns) FROM audit WHERE number > ?1 AND number <= ?2",
                [from, to],
                |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)),
            )
            .with_activity("reading the audit")?;
        let (Some(first), Some(last), Some(at_ns)) = found else { return Ok(()) };
        let way = if self.by_ns > 0 { "earlier" } else { "later" };
        let reason = format!(
            "rows {first} to {last} are dated {} {way} than they were: the clock was wrong by {} ns",
            format_span(self.by_ns),
            self.by_ns
        );
        let row = Audit {
            at_ns: at_ns.saturating_add(self.by_ns),
            kind: "clock".to_owned(),
            outcome: "redated".to_owned(),
            reason,
            ..Audit::default()
        };
        audit::append_row(db, &row).with_activity("noting the dates of the audit")
    }
}

/// Counts the ended states of these numbers in their hours, or takes them out again.
fn spread_states(db: &Connection, (from, to): (i64, i64), times: f64) -> Result<(), HistoryError> {
    let mut select = db
        .prepare("SELECT state, since_ns, until_ns FROM states WHERE id > ?1 AND id <= ?2 AND until_ns IS NOT NULL")
        .with_activity("reading states")?;
    let rows = select.query_map([from, to], |row| Ok((row.get::<_, String>(0)?, row.get(1)?, row.get(2)?)));
    let states: Vec<(String, TimeNs, TimeNs)> = rows.and_then(Iterator::collect).with_activity("reading states")?;
    for (state, since_ns, until_ns) in states {
        add_to_state_hours(db, &state, since_ns..until_ns, times).with_activity("counting states by the hour")?;
    }
    db.execute("DELETE FROM state_hours WHERE seconds < 1e-6", [])
        .map(drop)
        .with_activity("counting states by the hour")
}
