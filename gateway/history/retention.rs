//! What goes when the history is too old or too big: raw samples first, alarms and the audit last. Every step deletes a
//! bounded number of rows, so that the writer never stalls.

use super::audit;
use super::error::{Doing, HistoryError};
use super::options::Retention;
use adapter_core::clock::{SECOND_NS, TimeNs};
use rusqlite::{Connection, OptionalExtension, params};

/// A kind of row, in the order in which they go.
struct RowKind {
    name: &'static str,
    table: &'static str,
    /// Column of time, and its unit in nanoseconds.
    time: &'static str,
    unit_ns: i64,
    /// What counts as a row of this kind.
    rows: &'static str,
    /// Only these may go.
    only: &'static str,
    /// Rows deleted per step.
    step: i64,
    days: fn(&Retention) -> f64,
}

const HOUR_NS: i64 = 3_600 * SECOND_NS;

static KINDS: [RowKind; 16] = [
    RowKind {
        name: "raw samples",
        table: "blocks",
        time: "first_row",
        unit_ns: 1,
        rows: "sum(rows)",
        only: "1",
        step: 16,
        days: |retention| retention.raw_days,
    },
    define_kind("minute summaries", "minutes", "minute", 60 * SECOND_NS, "1", |retention| retention.minutes_days),
    define_kind("hour summaries", "hours", "hour", HOUR_NS, "1", |retention| retention.records_days),
    define_kind("state hours", "state_hours", "hour", HOUR_NS, "1", |retention| retention.records_days),
    define_kind("day summaries", "days", "day", 24 * HOUR_NS, "1", |retention| retention.records_days),
    define_kind("states", "states", "since_ns", 1, "until_ns IS NOT NULL", |retention| retention.records_days),
    define_kind("parts", "parts", "ended_ns", 1, "1", |retention| retention.records_days),
    define_kind("facts", "facts", "at_ns", 1, "1", |retention| retention.records_days),
    define_kind("diagnoses", "diagnoses", "at_ns", 1, "1", |retention| retention.records_days),
    define_kind("models", "models", "at_ns", 1, "id < (SELECT max(id) FROM models)", |retention| {
        retention.records_days
    }),
    define_kind("events", "events", "at_ns", 1, "1", |retention| retention.records_days),
    define_kind("decisions", "decisions", "at_ns", 1, "1", |retention| retention.audit_days),
    define_kind("commands", "commands", "at_ns", 1, "1", |retention| retention.audit_days),
    define_kind("reactions", "reactions", "at_ns", 1, "1", |retention| retention.audit_days),
    define_kind("alarms", "alarms", "raised_ns", 1, "cleared_ns IS NOT NULL", |retention| retention.audit_days),
    // By age only through the oldest rows: the chain is cut at its beginning and nowhere else.
    define_kind("audit", "audit", "at_ns", 1, "1", |retention| retention.audit_days),
];

const fn define_kind(
    name: &'static str,
    table: &'static str,
    time: &'static str,
    unit_ns: i64,
    only: &'static str,
    days: fn(&Retention) -> f64,
) -> RowKind {
    RowKind { name, table, time, unit_ns, rows: "count(*)", only, step: 500, days }
}

/// What a step removed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Removed {
    pub(crate) any: bool,
    /// Raw samples among it.
    pub(crate) samples: u64,
}

/// Bytes of the pages in use.
pub(crate) fn used_bytes(db: &Connection) -> Result<u64, HistoryError> {
    db.query_row(
        "SELECT (page_count - freelist_count) * page_size FROM pragma_page_count, pragma_freelist_count, pragma_page_size",
        [],
        |row| row.get::<_, i64>(0),
    )
    .map(i64::unsigned_abs)
    .with_activity("measuring the database")
}

/// Removes the oldest of the first kind that can spare anything; nothing at all when only the newest rows are left.
pub(crate) fn remove_oldest(db: &mut Connection, because: &str) -> Result<Removed, HistoryError> {
    for kind in &KINDS {
        let RowKind { table, time, only, step, .. } = kind;
        let threshold: Option<i64> = db
            .query_row(
                &format!(
                    "SELECT max({time}) FROM (SELECT {time} FROM {table} WHERE {only} ORDER BY {time} LIMIT {step})
                          WHERE (SELECT count(*) FROM (SELECT 1 FROM {table} WHERE {only} LIMIT {step} + 1)) > {step}"
                ),
                [],
                |row| row.get(0),
            )
            .with_activity("looking for the oldest rows")?;
        if let Some(threshold) = threshold {
            return remove(db, kind, &format!("{time} <= {threshold}"), None, because);
        }
    }
    Ok(Removed::default())
}

/// One run of ageing takes at most what lies within so much time of the oldest row of its kind. A box that runs every day needs
/// one day; one wrong clock, however long it was believed, costs no more.
const RUN_TAKES_NS: i64 = 3 * 24 * HOUR_NS;
/// Before a row may go because of its age, samples must have been stored on so many days after it, as a part of that age: a
/// clock that leaps by years passes through few days.
const DAYS_STORED_PART: f64 = 0.1;

/// What one run of ageing may take: the times before which each kind may go.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct AgeLimits {
    now_ns: TimeNs,
    before_ns: Vec<Option<TimeNs>>,
}

impl AgeLimits {
    /// Those of a run that begins at `now_ns`, which a confirmed clock says.
    pub(crate) fn from_retention(db: &Connection, retention: &Retention, now_ns: TimeNs) -> Result<Self, HistoryError> {
        let before_ns = KINDS.iter().map(|kind| before_ns(db, kind, (kind.days)(retention), now_ns));
        Ok(Self { now_ns, before_ns: before_ns.collect::<Result<_, _>>()? })
    }
}

/// The time before which rows of this kind may go; `None`: none may.
fn before_ns(db: &Connection, kind: &RowKind, days: f64, now_ns: TimeNs) -> Result<Option<TimeNs>, HistoryError> {
    let (time, only, table) = (if kind.table == "blocks" { "start_ns" } else { kind.time }, kind.only, kind.table);
    let oldest: Option<i64> = db
        .query_row(&format!("SELECT min({time}) FROM {table} WHERE {only}"), [], |row| row.get(0))
        .with_activity("looking for the oldest rows")?;
    let Some(oldest) = oldest else { return Ok(None) };
    let horizon_ns = Retention::horizon_ns(days, now_ns);
    let run_ns = oldest.saturating_mul(kind.unit_ns).saturating_add(RUN_TAKES_NS);
    Ok(stored_since_ns(db, days)?.map(|stored_ns| horizon_ns.min(run_ns).min(stored_ns)))
}

/// The beginning of the day since which samples were stored on enough days for an age of `days`.
fn stored_since_ns(db: &Connection, days: f64) -> Result<Option<TimeNs>, HistoryError> {
    #[allow(clippy::cast_possible_truncation, reason = "saturates, which is meant")]
    let needed = (days * DAYS_STORED_PART) as i64;
    if needed == 0 {
        return Ok(Some(TimeNs::MAX));
    }
    let day: Option<i64> = db
        .query_row("SELECT DISTINCT day FROM days ORDER BY day DESC LIMIT 1 OFFSET ?1", [needed - 1], |row| row.get(0))
        .optional()
        .with_activity("counting days with samples")?;
    Ok(day.map(|day| day.saturating_mul(24 * HOUR_NS)))
}

/// Removes one step's worth of what is older than its age, within the limits of the run.
pub(crate) fn remove_aged(db: &mut Connection, limits: &AgeLimits) -> Result<Removed, HistoryError> {
    for (kind, before_ns) in KINDS.iter().zip(&limits.before_ns) {
        let Some(before_ns) = before_ns else { continue };
        let horizon = before_ns.div_euclid(kind.unit_ns);
        let RowKind { table, time, only, step, .. } = kind;
        let condition = if *table == "blocks" {
            // Time of a block is not its key; the newest block stays, it says where the history ends.
            format!(
                "first_row IN (SELECT first_row FROM blocks WHERE start_ns < {horizon} AND end_ns < {horizon}
                 AND first_row < (SELECT max(first_row) FROM blocks) ORDER BY start_ns LIMIT {step})"
            )
        } else {
            format!(
                "{time} <= (SELECT max({time}) FROM
                 (SELECT {time} FROM {table} WHERE {only} AND {time} < {horizon} ORDER BY {time} LIMIT {step}))"
            )
        };
        let removed = remove(db, kind, &condition, Some(limits.now_ns), "age")?;
        if removed.any {
            return Ok(removed);
        }
    }
    Ok(Removed::default())
}

fn remove(
    db: &mut Connection,
    kind: &RowKind,
    condition: &str,
    at_ns: Option<TimeNs>,
    because: &str,
) -> Result<Removed, HistoryError> {
    let RowKind { name, table, only, rows, time, unit_ns, .. } = kind;
    let time = if *table == "blocks" { "end_ns" } else { time };
    let condition = &if *table == "audit" { audit::restrict_to_oldest(condition) } else { condition.to_owned() };
    let removing = db.transaction().with_activity("beginning to remove old rows")?;
    let (count, through): (Option<i64>, Option<i64>) = removing
        .query_row(&format!("SELECT {rows}, max({time}) FROM {table} WHERE {only} AND {condition}"), [], |row| {
            Ok((row.get(0)?, row.get(1)?))
        })
        .with_activity("counting old rows")?;
    let (Some(count @ 1..), Some(through)) = (count, through) else { return Ok(Removed::default()) };
    match *table {
        "audit" => audit::remove(&removing, condition, at_ns, because),
        _ => removing.execute(&format!("DELETE FROM {table} WHERE {only} AND {condition}"), []).map(drop),
    }
    .with_activity("removing old rows")?;
    removing
        .execute(
            "INSERT INTO dropped (kind, rows, through_ns, because) VALUES (?1, ?2, ?3, ?4)
             ON CONFLICT DO UPDATE SET rows = rows + excluded.rows, because = excluded.because,
               through_ns = max(through_ns, excluded.through_ns)",
            params![name, count, through.saturating_mul(*unit_ns), because],
        )
        .with_activity("counting what was removed")?;
    removing.commit().with_activity("removing old rows")?;
    Ok(Removed { any: true, samples: if *table == "blocks" { count.unsigned_abs() } else { 0 } })
}
