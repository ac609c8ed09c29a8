//! Stretches in which time only increases, and by which clock each of them was dated.
//!
//! A box that cannot trust its clock stores all the same. What it stored can be dated anew later: the row of a segment keeps
//! the anchor of its clock (time of the rows minus time since the computer was started) and which start of the computer that
//! was, and the last number of each kind of record before it. See [`redate`](super::redate).

use super::error::{Doing, HistoryError};
use super::minute_buffer::Segment;
use super::{outbox, schema};
use adapter_core::clock::TimeNs;
use gateway_base::clock::ClockMark;
use rusqlite::{Connection, OptionalExtension, params};
use serde::{Deserialize, Serialize};

/// Tables of records whose rows are numbered, with their columns of time.
pub(crate) const RECORD_TABLES: [(&str, &[&str]); 9] = [
    ("states", &["since_ns", "until_ns"]),
    ("parts", &["began_ns", "ended_ns"]),
    ("events", &["at_ns"]),
    ("alarms", &["raised_ns", "cleared_ns"]),
    ("decisions", &["at_ns"]),
    ("commands", &["at_ns"]),
    ("reactions", &["at_ns"]),
    ("models", &["at_ns"]),
    ("diagnoses", &["at_ns", "from_ns", "to_ns"]),
];

/// The last number of each kind of record: what follows it came later.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct RecordMarks {
    /// In the order of [`RECORD_TABLES`], then of the audit.
    pub(crate) numbers: Vec<i64>,
    /// Number of the next item that leaves the box; 0 where nothing does.
    pub(crate) outbox: u64,
}

impl RecordMarks {
    /// Those of this moment.
    pub(crate) fn read_current(db: &Connection) -> Result<Self, HistoryError> {
        let last = |table: &str, key: &str| {
            db.prepare_cached(&format!("SELECT coalesce(max({key}), 0) FROM {table}"))
                .and_then(|mut select| select.query_row([], |row| row.get(0)))
                .with_activity("numbering records")
        };
        let mut numbers: Vec<i64> = Vec::with_capacity(RECORD_TABLES.len() + 1);
        for (table, _) in RECORD_TABLES {
            numbers.push(last(table, "id")?);
        }
        numbers.push(last("audit", "number")?);
        Ok(Self { numbers, outbox: outbox::next_sequence_of(db)? })
    }
}

/// Key in `meta` of the run that has stored no row yet.
const RUN_WITHOUT_ROWS: &str = "run_without_rows";

/// The stretches of the file in their order, as a table of `SQLite`: the segments, and behind them the run that has stored no row yet. What
/// that run has recorded (the control may not answer for hours) is dated by its clock, as are the rows of a segment.
pub(crate) const STRETCHES: &str =
    "SELECT id, first_row, anchor_ns, marks, clock, boot FROM segments
     UNION ALL
     SELECT 9223372036854775807, 9223372036854775807, json_extract(value, '$.anchor_ns'), json_extract(value, '$.marks'),
            json_extract(value, '$.clock'), json_extract(value, '$.boot')
     FROM meta WHERE key = 'run_without_rows'";

/// A run begins: what is recorded from now on, before its first row as well, is dated by `clock`.
pub(crate) fn begin_run(db: &Connection, clock: &ClockMark) -> Result<(), HistoryError> {
    let marks = serde_json::to_value(RecordMarks::read_current(db)?).unwrap_or_default();
    let run = serde_json::json!({
        "anchor_ns": clock.anchor_ns, "clock": clock.trust, "boot": clock.boot, "marks": marks
    });
    db.execute("INSERT OR REPLACE INTO meta (key, value) VALUES (?1, ?2)", params![RUN_WITHOUT_ROWS, run.to_string()])
        .map(drop)
        .with_activity("beginning a run")
}

/// Its first row is there: the marks of the run are those of its first segment. `None` for a later segment.
fn take_run_marks(db: &Connection) -> Result<Option<String>, HistoryError> {
    db.query_row(
        "DELETE FROM meta WHERE key = ?1 RETURNING json_extract(value, '$.marks')",
        [RUN_WITHOUT_ROWS],
        |row| row.get(0),
    )
    .optional()
    .with_activity("beginning a segment")
}

/// Stores the beginning of a segment.
pub(crate) fn insert(
    db: &Connection,
    segment: &Segment,
    (origin, clock): (&str, &ClockMark),
) -> Result<(), HistoryError> {
    let marks = match take_run_marks(db)? {
        Some(marks) => marks,
        None => serde_json::to_string(&RecordMarks::read_current(db)?).unwrap_or_default(),
    };
    db.prepare_cached(
        "INSERT INTO segments (id, first_row, start_ns, origin, reason, version, clock, boot, anchor_ns, marks)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10)",
    )
    .and_then(|mut insert| {
        insert.execute(params![
            segment.id,
            segment.first_row,
            segment.start_ns,
            origin,
            segment.reason,
            env!("CARGO_PKG_VERSION"),
            clock.trust,
            clock.boot,
            clock.anchor_ns,
            marks
        ])
    })
    .map(drop)
    .with_activity("beginning a segment")
}

/// The clock of the running segments is confirmed: what they hold is dated for good.
pub(crate) fn confirm_clock(db: &Connection, clock: &ClockMark) -> Result<(), HistoryError> {
    db.execute(
        "UPDATE segments SET clock = 'confirmed' WHERE clock = 'plausible' AND boot = ?1 AND anchor_ns = ?2",
        params![clock.boot, clock.anchor_ns],
    )
    .and_then(|_| {
        db.execute(
            "UPDATE meta SET value = json_set(value, '$.clock', 'confirmed')
             WHERE key = ?1 AND json_extract(value, '$.clock') = 'plausible'",
            [RUN_WITHOUT_ROWS],
        )
    })
    .map(drop)
    .with_activity("noting that the clock is confirmed")
}

/// A stretch is dated by `clock` now.
pub(crate) fn redate_stretch(db: &Connection, id: i64, by_ns: i64, clock: &ClockMark) -> Result<(), HistoryError> {
    db.execute(
        "UPDATE segments SET start_ns = start_ns + ?2, anchor_ns = ?3, clock = ?4 WHERE id = ?1",
        params![id, by_ns, clock.anchor_ns, clock.trust],
    )
    .and_then(|segments| {
        if segments > 0 {
            return Ok(segments);
        }
        db.execute(
            "UPDATE meta SET value = json_set(value, '$.anchor_ns', ?2, '$.clock', ?3) WHERE key = ?1",
            params![RUN_WITHOUT_ROWS, clock.anchor_ns, clock.trust],
        )
    })
    .map(drop)
    .with_activity("dating rows anew")
}

/// The latest time that a row stored under a confirmed clock has; it is certainly later by now. `None`: no clock was confirmed
/// yet, or the last decision about the time has not been confirmed since.
pub(crate) fn certain_ns(db: &Connection) -> Result<Option<TimeNs>, HistoryError> {
    if !schema::has_clocks(db)? {
        return Ok(None);
    }
    let decided: Option<String> = db
        .query_row("SELECT value FROM meta WHERE key = 'clock_decided'", [], |row| row.get(0))
        .optional()
        .with_activity("looking for the last certain time")?;
    let decided = decided.as_deref().and_then(|text| text.split_once(' '));
    let (after, decided_ns) = decided.map_or((0, None), |(id, at)| (id.parse().unwrap_or(0), at.parse().ok()));
    let row_ns: Option<TimeNs> = db
        .query_row(
            "SELECT max(b.end_ns) FROM segments s
             LEFT JOIN segments n ON n.id = (SELECT min(id) FROM segments WHERE id > s.id)
             JOIN (SELECT first_row, end_ns FROM blocks UNION ALL SELECT first_row, end_ns FROM tail) b
               ON b.first_row >= s.first_row AND (n.first_row IS NULL OR b.first_row < n.first_row)
             WHERE s.id = (SELECT max(id) FROM segments WHERE clock = 'confirmed' AND id > ?1)",
            [after],
            |row| row.get(0),
        )
        .with_activity("looking for the last certain time")?;
    Ok(row_ns.max(decided_ns))
}
