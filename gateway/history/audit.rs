//! The audit of the gate: every request, refusal, write and arming as a row that holds the hash of the one before.
//!
//! A row's hash is the SHA-256 (FIPS 180-4) over the JSON array of its fields and the hash before it, so a row that is
//! changed, removed or put in breaks the chain at that place. The newest number and hash stand in `meta` besides, in the same
//! transaction, so a chain that was cut at its end is noticed too. This shows what was tampered with by hand or lost by a
//! disk; somebody who rewrites the whole chain and `meta` with a program of their own is met by keeping the head elsewhere:
//! `history audit --verify` prints it.

use adapter_core::clock::TimeNs;
use gateway_records::Audit;
use rusqlite::{Connection, OptionalExtension, Row, params};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::fmt::Write;

/// What the first row holds in place of the hash before it.
pub(crate) const BEGINNING: &str = "0000000000000000000000000000000000000000000000000000000000000000";

/// A row of the audit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AuditEntry {
    /// From 1, without holes.
    pub number: i64,
    /// What was asked for, what became of it, and who was behind it.
    #[serde(flatten)]
    pub audit: Audit,
    /// Hash of the row before.
    pub previous: String,
    /// Hash of this row.
    pub hash: String,
}

/// What checking the chain found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct AuditCheck {
    /// Rows that were looked at.
    pub rows: u64,
    /// Number of the oldest row there is; retention may have taken those before. 0 without any.
    pub first: i64,
    /// Number of the newest row; 0 without any.
    pub last: i64,
    /// Hash of the newest row: keep it elsewhere to notice a chain that was rewritten as a whole.
    pub head: String,
    /// What a row of the chain says of those before the oldest.
    pub removed: Option<AuditRemoval>,
    /// The first place at which the chain is broken.
    pub broken: Option<Break>,
}

/// Rows that are not there any more, as a row of the chain says.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct AuditRemoval {
    /// Number of the last of them; the first had number 1.
    pub through: i64,
    /// When the last of them was removed.
    pub at_ns: TimeNs,
    /// Why they were removed, in words.
    pub because: String,
    /// Hash of the last of them: the oldest row there is has to follow from it.
    #[serde(skip)]
    pub(super) hash: String,
}

/// The first row that is not as it was written.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Break {
    /// Its number in the chain, from 1.
    pub number: i64,
    /// What is wrong with it.
    pub what: String,
}

/// The hash of a row.
pub(super) fn hash(previous: &str, number: i64, audit: &Audit) -> String {
    let Audit { at_ns, kind, outcome, before, asked, after, unit, reason, script, script_version, person } = audit;
    let fields = (
        (previous, number, at_ns, kind, outcome),
        (before, asked, after, unit),
        (reason, script, script_version, person),
    );
    // Numbers are written so that they come back the same; none of these types can fail to be written.
    let text = serde_json::to_string(&fields).unwrap_or_default();
    Sha256::digest(text.as_bytes()).iter().fold(String::with_capacity(64), |mut hex, byte| {
        let _infallible = write!(hex, "{byte:02x}");
        hex
    })
}

/// Number and hash of the newest row.
fn read_head(db: &Connection) -> Result<(i64, String), rusqlite::Error> {
    let newest = db
        .prepare_cached("SELECT number, hash FROM audit ORDER BY number DESC LIMIT 1")?
        .query_row([], |row| Ok((row.get(0)?, row.get(1)?)))
        .optional()?;
    match newest {
        Some(newest) => Ok(newest),
        // After retention has taken everything the chain goes on from where it was.
        None => Ok(noted_head(db)?.unwrap_or((0, BEGINNING.to_owned()))),
    }
}

/// The head that stands in `meta`.
pub(super) fn noted_head(db: &Connection) -> Result<Option<(i64, String)>, rusqlite::Error> {
    let text: Option<String> = db
        .prepare_cached("SELECT value FROM meta WHERE key = 'audit_head'")?
        .query_row([], |row| row.get(0))
        .optional()?;
    Ok(text
        .as_deref()
        .and_then(|text| text.split_once(' '))
        .and_then(|(number, hash)| Some((number.parse().ok()?, hash.to_owned()))))
}

/// Appends a row, in the transaction of the caller.
pub(crate) fn append_row(db: &Connection, audit: &Audit) -> Result<(), rusqlite::Error> {
    let (last, previous) = read_head(db)?;
    // The newest number is read from the file: one that a damaged file holds is an error, and no end of the thread that writes.
    let next = last.checked_add(1).filter(|number| *number > 0);
    let number = next.ok_or(rusqlite::Error::IntegralValueOutOfRange(0, last))?;
    let audit = audit.to_storable();
    let hash = hash(&previous, number, &audit);
    debug_assert!(previous.len() == BEGINNING.len() && hash.len() == BEGINNING.len(), "SHA-256 in hexadecimal");
    db.prepare_cached(
        "INSERT INTO audit (number, at_ns, kind, outcome, before, asked, after, unit, reason, script, script_version, person,
         previous, hash) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14)",
    )?
    .execute(params![
        number,
        audit.at_ns,
        audit.kind,
        audit.outcome,
        audit.before,
        audit.asked,
        audit.after,
        audit.unit,
        audit.reason,
        audit.script,
        audit.script_version,
        audit.person,
        previous,
        hash
    ])?;
    db.prepare_cached("INSERT OR REPLACE INTO meta (key, value) VALUES ('audit_head', ?1)")?
        .execute([format!("{number} {hash}")])
        .map(drop)
}

pub(super) const COLUMNS: &str =
    "number, at_ns, kind, outcome, before, asked, after, unit, reason, script, script_version, person, previous, hash";

pub(super) fn read_entry(row: &Row<'_>) -> Result<AuditEntry, rusqlite::Error> {
    let audit = Audit {
        at_ns: row.get(1)?,
        kind: row.get(2)?,
        outcome: row.get(3)?,
        before: row.get(4)?,
        asked: row.get(5)?,
        after: row.get(6)?,
        unit: row.get(7)?,
        reason: row.get(8)?,
        script: row.get(9)?,
        script_version: row.get(10)?,
        person: row.get(11)?,
    };
    Ok(AuditEntry { number: row.get(0)?, audit, previous: row.get(12)?, hash: row.get(13)? })
}

/// Rows as `audit/1`: what `history audit --json` prints and `/api/v1/audit` answers. `last` is the number to go on after.
#[must_use]
pub fn audit_document(rows: &[AuditEntry]) -> serde_json::Value {
    serde_json::json!({ "schema": "audit/1", "rows": rows, "last": rows.last().map(|row| row.number) })
}

/// Of the rows of this condition those at the beginning of the chain, also when the clock has gone back in between.
pub(crate) fn restrict_to_oldest(condition: &str) -> String {
    format!(
        "number < (SELECT coalesce(min(number), 9223372036854775807) FROM audit WHERE NOT coalesce(({condition}), 0))"
    )
}

/// What the row that says so is called.
const REMOVED: &str = "removed";

impl AuditRemoval {
    /// What this row says of others, if it does.
    pub(super) fn from_entry(entry: &AuditEntry) -> Option<Self> {
        let Audit { kind, after, at_ns, reason, script_version, .. } = &entry.audit;
        #[expect(clippy::cast_possible_truncation, reason = "numbers of rows, far below 2^53")]
        let through = after.filter(|_| kind == REMOVED)? as i64;
        Some(Self { through, at_ns: *at_ns, because: reason.clone(), hash: script_version.clone() })
    }
}

/// Removes the rows of this condition, which are those at the beginning of the chain, in the transaction of the caller. A new
/// row of the chain says so first: which, when (at the time of the newest row where nobody knows) and why.
pub(crate) fn remove(
    db: &Connection,
    condition: &str,
    at_ns: Option<TimeNs>,
    because: &str,
) -> Result<(), rusqlite::Error> {
    let (first, last, at_newest_ns): (i64, i64, TimeNs) = db.query_row(
        &format!(
            "SELECT min(number), max(number), (SELECT at_ns FROM audit ORDER BY number DESC LIMIT 1) FROM audit WHERE {condition}"
        ),
        [],
        |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)),
    )?;
    let hash: String = db.query_row("SELECT hash FROM audit WHERE number = ?1", [last], |row| row.get(0))?;
    append_row(db, &build_removal_row(first, last, hash, at_ns.unwrap_or(at_newest_ns), because))?;
    db.execute("INSERT OR REPLACE INTO meta (key, value) VALUES ('audit_released', ?1)", [last])?;
    db.execute("DELETE FROM audit WHERE number BETWEEN ?1 AND ?2", [first, last]).map(drop)
}

#[expect(clippy::cast_precision_loss, reason = "numbers of rows, far below 2^53")]
fn build_removal_row(first: i64, last: i64, hash: String, at_ns: TimeNs, because: &str) -> Audit {
    Audit {
        at_ns,
        kind: REMOVED.to_owned(),
        outcome: "done".to_owned(),
        before: Some(first as f64),
        after: Some(last as f64),
        unit: "row".to_owned(),
        reason: because.to_owned(),
        script_version: hash,
        ..Audit::default()
    }
}

/// Older versions removed rows without saying so in the chain: says it once, when such a file gets the newer schema.
pub(crate) fn account_for_earlier(db: &Connection) -> Result<(), rusqlite::Error> {
    let has = super::tables::has_table(db, "audit")?;
    let released: Option<i64> =
        db.query_row("SELECT value FROM meta WHERE key = 'audit_released'", [], |row| row.get(0)).optional()?;
    let Some(last) = released.filter(|_| has) else { return Ok(()) };
    let told = db.query_row("SELECT 1 FROM audit WHERE kind = ?1 AND after = ?2", params![REMOVED, last], |_| Ok(()));
    if told.optional()?.is_some() {
        return Ok(());
    }
    let oldest: Option<(String, TimeNs)> = db
        .query_row("SELECT previous, at_ns FROM audit ORDER BY number LIMIT 1", [], |row| {
            Ok((row.get(0)?, row.get(1)?))
        })
        .optional()?;
    let noted = noted_head(db)?.map(|(_, hash)| (hash, 0));
    let Some((hash, at_ns)) = oldest.or(noted) else { return Ok(()) };
    append_row(
        db,
        &build_removal_row(1, last, hash, at_ns, "an earlier version removed them and did not say when or why"),
    )
}
