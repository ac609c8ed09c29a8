//! What goes when the history is too old or too big: raw samples first, alarms and the audit last. Every step deletes a
//! bounded number of rows, so that the writer never stalls.

use super::audit;
use super::error::{Doing, HistoryError};
use super::options::Retention;
use adapters::clock::{SECOND_NS, TimeNs};
use rusqlite::{Connection, params};

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

static KINDS: [RowKind; 15] = [
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
    kind("minute summaries", "minutes", "minute", 60 * SECOND_NS, "1", |retention| retention.minutes_days),
    kind("hour summaries", "hours", "hour", HOUR_NS, "1", |retention| retention.records_days),
    kind("state hours", "state_hours", "hour", HOUR_NS, "1", |retention| retention.records_days),
    kind("day summaries", "days", "day", 24 * HOUR_NS, "1", |retention| retention.records_days),
    kind("states", "states", "since_ns", 1, "until_ns IS NOT NULL", |retention| retention.records_days),
    kind("parts", "parts", "ended_ns", 1, "1", |retention| retention.records_days),
    kind("diagnoses", "diagnoses", "at_ns", 1, "1", |retention| retention.records_days),
    kind("models", "models", "at_ns", 1, "id < (SELECT max(id) FROM models)", |retention| retention.records_days),
    kind("events", "events", "at_ns", 1, "1", |retention| retention.records_days),
    kind("decisions", "decisions", "at_ns", 1, "1", |retention| retention.audit_days),
    kind("commands", "commands", "at_ns", 1, "1", |retention| retention.audit_days),
    kind("reactions", "reactions", "at_ns", 1, "1", |retention| retention.audit_days),
    kind("alarms", "alarms", "raised_ns", 1, "cleared_ns IS NOT NULL", |retention| retention.audit_days),
    // By age only through the oldest rows: the chain is cut at its beginning and nowhere else.
    kind("audit", "audit", "at_ns", 1, "1", |retention| retention.audit_days),
];

const fn kind(
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
    .doing("measuring the database")
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
            .doing("looking for the oldest rows")?;
        if let Some(threshold) = threshold {
            return remove(db, kind, &format!("{time} <= {threshold}"), because);
        }
    }
    Ok(Removed::default())
}

/// Removes one step's worth of what is older than its age.
pub(crate) fn remove_aged(db: &mut Connection, retention: &Retention, now_ns: TimeNs) -> Result<Removed, HistoryError> {
    for kind in &KINDS {
        let horizon = Retention::horizon_ns((kind.days)(retention), now_ns).div_euclid(kind.unit_ns);
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
        let removed = remove(db, kind, &condition, "age")?;
        if removed.any {
            return Ok(removed);
        }
    }
    Ok(Removed::default())
}

fn remove(db: &mut Connection, kind: &RowKind, condition: &str, because: &str) -> Result<Removed, HistoryError> {
    let RowKind { name, table, only, rows, time, unit_ns, .. } = kind;
    let time = if *table == "blocks" { "end_ns" } else { time };
    let condition = &if *table == "audit" { audit::oldest(condition) } else { condition.to_owned() };
    let removing = db.transaction().doing("beginning to remove old rows")?;
    let (count, through): (Option<i64>, Option<i64>) = removing
        .query_row(&format!("SELECT {rows}, max({time}) FROM {table} WHERE {only} AND {condition}"), [], |row| {
            Ok((row.get(0)?, row.get(1)?))
        })
        .doing("counting old rows")?;
    let (Some(count @ 1..), Some(through)) = (count, through) else { return Ok(Removed::default()) };
    if *table == "audit" {
        audit::release(&removing, &format!("{only} AND {condition}")).doing("removing old rows")?;
    }
    removing.execute(&format!("DELETE FROM {table} WHERE {only} AND {condition}"), []).doing("removing old rows")?;
    removing
        .execute(
            "INSERT INTO dropped (kind, rows, through_ns, because) VALUES (?1, ?2, ?3, ?4)
             ON CONFLICT DO UPDATE SET rows = rows + excluded.rows, because = excluded.because,
               through_ns = max(through_ns, excluded.through_ns)",
            params![name, count, through.saturating_mul(*unit_ns), because],
        )
        .doing("counting what was removed")?;
    removing.commit().doing("removing old rows")?;
    Ok(Removed { any: true, samples: if *table == "blocks" { count.unsigned_abs() } else { 0 } })
}
