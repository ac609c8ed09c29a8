//! Facts of production in the database, see [`Fact`]: stored once, read by time.

use gateway_records::{Fact, FactKind};
use rusqlite::{Connection, Row, params};

/// Stores it once, whatever comes twice.
pub(crate) fn store_fact(db: &Connection, fact: &Fact) -> Result<(), rusqlite::Error> {
    db.prepare_cached(
        "INSERT INTO facts (at_ns, from_ns, until_ns, fact, value, parts, mark, way, author)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9) ON CONFLICT (mark) DO NOTHING",
    )?
    .execute(params![
        fact.at_ns,
        fact.from_ns,
        fact.until_ns,
        fact.fact.as_word(),
        fact.value,
        fact.parts,
        fact.mark,
        fact.way,
        fact.author
    ])
    .map(drop)
}

pub(super) fn read_fact(row: &Row<'_>) -> Result<Fact, rusqlite::Error> {
    let word: String = row.get(3)?;
    Ok(Fact {
        at_ns: row.get(0)?,
        from_ns: row.get(1)?,
        until_ns: row.get(2)?,
        // The table takes no other word.
        fact: FactKind::from_word(&word).unwrap_or_default(),
        value: row.get(4)?,
        parts: row.get(5)?,
        mark: row.get(6)?,
        way: row.get(7)?,
        author: row.get(8)?,
    })
}
