//! Rows from the future go into a file of their own: the history begins where it should, and nothing is lost.

use super::error::{Doing, HistoryError};
use super::levels::{LEVELS, Level, MINUTE_NS};
use super::lock::Lock;
use super::outbox;
use super::pyramid;
use super::recover::recover_file;
use super::schema;
use super::segments::RECORD_TABLES;
use adapter_core::clock::TimeNs;
use rusqlite::{Connection, params};
use serde::Serialize;
use std::path::Path;

/// What was set apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct SetApart {
    /// Number of samples that were moved.
    pub samples: i64,
    /// Events, states, parts and the like.
    pub records: usize,
}

/// Moves every sample and record that is dated after `after_ns` from the history at `path`, which nobody may be writing, into a new
/// one at `to`. Rows of the audit stay: they are a chain. Samples that the machine brought its own time for stay, too.
///
/// # Errors
/// Somebody writes the history, there is something at `to`, or a file cannot be written.
pub fn set_apart(path: &Path, to: &Path, after_ns: TimeNs) -> Result<SetApart, HistoryError> {
    if to.exists() {
        return Err(HistoryError::Question(format!("{} is there already; name another file", to.display())));
    }
    let _lock = Lock::acquire_at(path)?;
    let mut db = schema::open_for_writing(path)?;
    recover_file(&mut db, None)?;
    let new = schema::open_for_writing(to)?;
    outbox::create_like(&db, &new)?;
    drop(new);
    db.execute("ATTACH ?1 AS apart", [to.to_string_lossy()]).with_activity("opening the new file")?;
    let copying = db.transaction().with_activity("copying rows")?;
    copy_rows(&copying, after_ns)?;
    copying.commit().with_activity("copying rows")?;
    // Only what is in the new file is removed here.
    let removing = db.transaction().with_activity("removing rows")?;
    let apart = remove(&removing, after_ns, &to.display().to_string())?;
    removing.commit().with_activity("removing rows")?;
    Ok(apart)
}

/// Blocks that are dated after the first parameter by a clock of the computer.
const BLOCKS: &str = "start_ns > ?1 AND segment NOT IN (SELECT id FROM main.segments WHERE clock = 'stepped')";

fn copy_rows(db: &Connection, after_ns: TimeNs) -> Result<(), HistoryError> {
    let put = |sql: &str| db.execute(sql, [after_ns]).map(drop).with_activity("copying rows");
    db.execute_batch(
        "INSERT OR REPLACE INTO apart.meta SELECT * FROM main.meta WHERE key NOT LIKE 'audit%' AND key NOT LIKE 'outbox%';
         INSERT INTO apart.series SELECT * FROM main.series; INSERT INTO apart.segments SELECT * FROM main.segments;",
    )
    .with_activity("copying rows")?;
    put(&format!("INSERT INTO apart.blocks SELECT * FROM main.blocks WHERE {BLOCKS}"))?;
    for Level { table, key, width_ns, .. } in &LEVELS {
        put(&format!("INSERT INTO apart.{table} SELECT * FROM main.{table} WHERE {key} * {width_ns} > ?1"))?;
    }
    for (table, times) in RECORD_TABLES {
        put(&format!("INSERT INTO apart.{table} SELECT * FROM main.{table} WHERE {} > ?1", times[0]))?;
    }
    Ok(())
}

fn remove(db: &Connection, after_ns: TimeNs, to: &str) -> Result<SetApart, HistoryError> {
    let gone = |sql: &str| db.execute(sql, [after_ns]).with_activity("removing rows");
    let (samples, last_ns): (Option<i64>, Option<TimeNs>) = db
        .query_row(&format!("SELECT sum(rows), max(end_ns) FROM main.blocks WHERE {BLOCKS}"), [after_ns], |row| {
            Ok((row.get(0)?, row.get(1)?))
        })
        .with_activity("counting rows")?;
    gone(&format!("DELETE FROM main.blocks WHERE {BLOCKS}"))?;
    gone(&format!("DELETE FROM main.tail WHERE {BLOCKS}"))?;
    let last_minute: Option<i64> =
        db.query_row("SELECT max(minute) FROM main.minutes", [], |row| row.get(0)).with_activity("removing rows")?;
    for Level { table, key, width_ns, .. } in &LEVELS {
        gone(&format!("DELETE FROM main.{table} WHERE {key} * {width_ns} > ?1"))?;
    }
    // Of the minute that was cut, and of samples that stay.
    let minute = after_ns.div_euclid(MINUTE_NS);
    pyramid::renew_buckets(db, pyramid::with_blocks(db, minute..last_minute.unwrap_or(minute).max(minute) + 1)?)?;
    let mut records = 0;
    for (table, times) in RECORD_TABLES {
        records += gone(&format!("DELETE FROM main.{table} WHERE {} > ?1", times[0]))?;
    }
    db.execute("DELETE FROM main.state_hours WHERE hour * ?2 > ?1", params![after_ns, 60 * MINUTE_NS])
        .with_activity("removing rows")?;
    if let (Some(samples), Some(last_ns)) = (samples, last_ns) {
        db.execute(
            "INSERT OR REPLACE INTO dropped (kind, rows, through_ns, because) VALUES ('samples set apart', ?1, ?2, ?3)",
            params![samples, last_ns, format!("dated after they were stored; they are in {to}")],
        )
        .with_activity("noting what was set apart")?;
    }
    Ok(SetApart { samples: samples.unwrap_or(0), records })
}
