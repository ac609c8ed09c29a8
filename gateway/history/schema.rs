//! Opening the file: what it must be, and the tables it gets when it is new.

use super::damage::was_ours;
use super::error::{Doing, HistoryError, is_of_disk};
use super::lock::append_suffix;
use super::pages::SEALED_APPLICATION;
use super::series::Series;
use super::series_kind::SeriesKind;
use super::{audit, earlier, pages, record_sql};
use rusqlite::{Connection, ErrorCode, OpenFlags, OptionalExtension, params};
use std::path::Path;

/// Newest schema this version knows; stored as `user_version`.
pub(crate) const SCHEMA: i64 = 6;
/// `cncg`, stored as `application_id` of files of older versions, whose pages have no sums.
pub(crate) const APPLICATION: i64 = 0x636e_6367;
const TABLES: &str = include_str!("schema.sql");
/// What each schema adds to the one before, beginning with 2. A new file gets all of it.
const ADDED: [&str; 5] = [
    include_str!("schema_2.sql"),
    include_str!("schema_3.sql"),
    include_str!("schema_4.sql"),
    include_str!("schema_5.sql"),
    include_str!("schema_6.sql"),
];

/// Opens the file for writing and creates the tables in a new one.
pub(crate) fn open_for_writing(path: &Path) -> Result<Connection, HistoryError> {
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_CREATE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let db = open_connection(path, path, flags)?;
    db.busy_timeout(std::time::Duration::from_secs(2)).with_activity("setting the time to wait for locks")?;
    let new = check_file(path, &db)?;
    if new {
        // Must be said before the first page is written.
        pages::reserve_room(&db).map_err(of_code).with_activity("leaving room for checksums")?;
        // Freed pages go back to the disk in small steps; must be set before the first table.
        db.pragma_update(None, "auto_vacuum", "INCREMENTAL").map_err(|error| explain_error(path, error))?;
    }
    db.pragma_update(None, "journal_mode", "WAL").map_err(|error| explain_error(path, error))?;
    db.pragma_update(None, "synchronous", "FULL").with_activity("choosing durable commits")?;
    let ready = if new { create_tables(&db) } else { change_tables(path, &db) };
    ready.map_err(|error| explain_error(path, error))?;
    Ok(db)
}

/// Opens the file of this name, so that its pages are checked; `path` stands for it in messages.
fn open_connection(name: &Path, path: &Path, flags: OpenFlags) -> Result<Connection, HistoryError> {
    Connection::open_with_flags_and_vfs(name, flags, page_layer()?).map_err(|error| explain_error(path, error))
}

/// A whole copy of the file as it is now, with what still stands in its log, at `to`, where nothing may be yet.
pub(crate) fn copy_whole(db: &Connection, to: &Path) -> Result<(), rusqlite::Error> {
    db.execute("VACUUM INTO ?1", [to.to_string_lossy()]).map(drop)
}

/// Name of the layer under `SQLite` that seals pages: a program of this process that changes a history opens it by this layer
/// (`vfs`), or its changes are taken for damage.
///
/// # Errors
/// What `SQLite` says.
pub fn page_layer() -> Result<&'static std::ffi::CStr, HistoryError> {
    pages::register_layer().map_err(of_code).with_activity("preparing to check pages")?;
    Ok(pages::VFS)
}

fn of_code(code: std::ffi::c_int) -> rusqlite::Error {
    rusqlite::Error::SqliteFailure(rusqlite::ffi::Error::new(code), None)
}

fn create_tables(db: &Connection) -> Result<(), rusqlite::Error> {
    let added = ADDED.concat();
    db.execute_batch(&format!(
        "BEGIN IMMEDIATE; {TABLES} {added} PRAGMA application_id = {SEALED_APPLICATION}; PRAGMA user_version = {SCHEMA}; COMMIT;"
    ))
}

/// Brings a file of an older version to the newest schema, and keeps a copy of it as it was.
fn change_tables(path: &Path, db: &Connection) -> Result<(), rusqlite::Error> {
    let found = read_version(db)?;
    if found >= SCHEMA {
        return Ok(());
    }
    let told = earlier::copy_before_change(path, db, found);
    migrate_schema(db)?;
    record_sql::store_record(db, &told.into())
}

/// Brings a file of an older version to the newest schema, one version after the other, each in one transaction. A second
/// writer waits and finds it done.
fn migrate_schema(db: &Connection) -> Result<(), rusqlite::Error> {
    for (next, added) in (2_i64..).zip(ADDED) {
        if read_version(db)? >= next {
            continue;
        }
        db.execute_batch("BEGIN IMMEDIATE")?;
        let step =
            if read_version(db)? < next { format!("{added} PRAGMA user_version = {next};") } else { String::new() };
        let stepped = db.execute_batch(&step).and_then(|()| audit::account_for_earlier(db));
        stepped.and_then(|()| db.execute_batch("COMMIT")).inspect_err(|_| {
            // The transaction is gone either way; the first error is the one to tell.
            let _rolled_back = db.execute_batch("ROLLBACK");
        })?;
    }
    Ok(())
}

/// Opens the file for reading while a gateway may be writing it.
pub(crate) fn open_for_reading(path: &Path) -> Result<Connection, HistoryError> {
    if !path.is_file() {
        return Err(HistoryError::Missing { path: path.to_owned() });
    }
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let db = open_connection(path, path, flags)?;
    db.busy_timeout(std::time::Duration::from_secs(5)).with_activity("setting the time to wait for locks")?;
    if matches!(read_version(&db), Err(error) if error.sqlite_error_code() == Some(ErrorCode::CannotOpen)) {
        return open_on_read_only_disk(path);
    }
    refuse_empty(path, check_file(path, &db)?)?;
    Ok(db)
}

/// A write-ahead log needs a writable directory even to read; on a read-only disk nobody can be writing either.
/// What a crash left in the log cannot be read that way, and is not silently left out.
fn open_on_read_only_disk(path: &Path) -> Result<Connection, HistoryError> {
    if std::fs::metadata(append_suffix(path, "-wal")).is_ok_and(|log| log.len() > 0) {
        return Err(HistoryError::Question(format!(
            "{}: the gateway did not close this history and its directory is read-only, so its newest part cannot be \
             read; copy the file together with the one ending in -wal to a writable directory",
            path.display()
        )));
    }
    let name: String = path.to_string_lossy().replace('%', "%25").replace('?', "%3f").replace('#', "%23");
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_URI | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let db = open_connection(Path::new(&format!("file:{name}?immutable=1")), path, flags)?;
    refuse_empty(path, check_file(path, &db)?)?;
    Ok(db)
}

fn refuse_empty(path: &Path, empty: bool) -> Result<(), HistoryError> {
    let what = "it holds nothing. A history in use keeps its newest part, at first all of it, in the file ending in -wal: copy both files \
                together, or stop the gateway before"
        .to_owned();
    if empty { Err(HistoryError::NotAHistory { path: path.to_owned(), what }) } else { Ok(()) }
}

fn read_version(db: &Connection) -> Result<i64, rusqlite::Error> {
    db.query_row("PRAGMA user_version", [], |row| row.get(0))
}

/// Does the file say by which clock its segments were dated? One of an older version that nobody has written since does not.
pub(crate) fn has_clocks(db: &Connection) -> Result<bool, HistoryError> {
    read_version(db).map(|version| version >= 5).with_activity("reading the version of the file")
}

/// True for an empty file.
fn check_file(path: &Path, db: &Connection) -> Result<bool, HistoryError> {
    let application: i64 =
        db.query_row("PRAGMA application_id", [], |row| row.get(0)).map_err(|error| explain_error(path, error))?;
    let found = read_version(db).map_err(|error| explain_error(path, error))?;
    let tables: i64 = db
        .query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0))
        .map_err(|error| explain_error(path, error))?;
    let own = [APPLICATION, i64::from(SEALED_APPLICATION)].contains(&application);
    match (application, found, tables) {
        (0, 0, 0) => Ok(true),
        (_, found, _) if own && found > SCHEMA => {
            Err(HistoryError::NewerSchema { path: path.to_owned(), found, known: SCHEMA })
        }
        // Older schemas lack tables that no reader needs to find.
        (_, 1.., _) if own => Ok(false),
        // The header of a file whose pages have no sums may be what was changed.
        _ if was_ours(path) => Err(damaged_header()),
        _ => Err(HistoryError::NotAHistory { path: path.to_owned(), what: "another SQLite database".to_owned() }),
    }
}

fn explain_error(path: &Path, error: rusqlite::Error) -> HistoryError {
    let read_only = || HistoryError::ReadOnly {
        path: path.to_owned(),
        place: path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new(".")).to_owned(),
        error: error.to_string(),
    };
    match error.sqlite_error_code() {
        _ if is_of_disk(&error) && was_ours(path) => {
            HistoryError::NotAsWritten { doing: "opening the file", page: pages::damaged_page(), error }
        }
        Some(ErrorCode::ReadOnly | ErrorCode::CannotOpen | ErrorCode::PermissionDenied) => read_only(),
        Some(ErrorCode::NotADatabase) => {
            HistoryError::NotAHistory { path: path.to_owned(), what: "not a SQLite database".to_owned() }
        }
        _ => HistoryError::Sqlite { doing: "opening the file", error },
    }
}

fn damaged_header() -> HistoryError {
    HistoryError::NotAsWritten {
        doing: "opening the file",
        page: Some(1),
        error: of_code(rusqlite::ffi::SQLITE_CORRUPT),
    }
}

/// Notes the size limit, for those who only read.
pub(crate) fn note_limit(db: &Connection, max_bytes: u64) -> Result<(), HistoryError> {
    let max_bytes = gateway_base::convert::clamp_to_signed(max_bytes);
    db.execute("INSERT OR REPLACE INTO meta (key, value) VALUES ('max_bytes', ?1)", [max_bytes])
        .map(drop)
        .with_activity("noting the size limit")
}

/// Gives every series its number, creating what is new.
pub(crate) fn register_series(db: &mut Connection, series: &mut [Series]) -> Result<(), HistoryError> {
    let registering = db.transaction().with_activity("registering the series")?;
    for one in series.iter_mut() {
        one.id = register_one(&registering, one)?;
    }
    registering.commit().with_activity("registering the series")
}

fn register_one(db: &Connection, series: &Series) -> Result<i64, HistoryError> {
    let known: Option<(i64, String)> = db
        .query_row("SELECT id, kind FROM series WHERE name = ?1", [&*series.name], |row| Ok((row.get(0)?, row.get(1)?)))
        .optional()
        .with_activity("looking up a series")?;
    let kind = kind_word(series.kind);
    match known {
        Some((_, stored)) if stored != kind => Err(HistoryError::Question(format!(
            "the series {} was stored as {stored} and is now {kind}; give it another name",
            series.name
        ))),
        Some((id, _)) => {
            refresh_series(db, id, series).with_activity("refreshing a series")?;
            Ok(id)
        }
        None => {
            db.execute(
                "INSERT INTO series (name, unit, kind, decimals, en, zh, estimated) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
                params![&*series.name, &*series.unit, kind, series.decimals, &*series.en, &*series.zh, series.estimated],
            )
            .with_activity("registering a series")?;
            Ok(db.last_insert_rowid())
        }
    }
}

/// Descriptions may be improved and resolutions changed; blocks carry their own scale.
fn refresh_series(db: &Connection, id: i64, series: &Series) -> Result<(), rusqlite::Error> {
    db.execute(
        "UPDATE series SET unit = ?2, decimals = ?3, en = ?4, zh = ?5 WHERE id = ?1
         AND (unit, en, zh) IS NOT (?2, ?4, ?5) OR id = ?1 AND decimals IS NOT ?3",
        params![id, &*series.unit, series.decimals, &*series.en, &*series.zh],
    )
    .map(drop)
}

fn kind_word(kind: SeriesKind) -> &'static str {
    match kind {
        SeriesKind::Number => "number",
        SeriesKind::Text => "text",
    }
}

/// Every series the file knows, in the order of their numbers.
pub(crate) fn known_series(db: &Connection) -> Result<Vec<Series>, HistoryError> {
    let text = |row: &rusqlite::Row<'_>, column: usize| row.get::<_, String>(column).map(Into::into);
    let mut statement = db
        .prepare("SELECT id, name, unit, kind, decimals, en, zh, estimated FROM series ORDER BY id")
        .with_activity("reading the series")?;
    let rows = statement.query_map([], |row| {
        let kind = if row.get::<_, String>(3)? == "text" { SeriesKind::Text } else { SeriesKind::Number };
        Ok(Series {
            id: row.get(0)?,
            name: text(row, 1)?,
            unit: text(row, 2)?,
            kind,
            decimals: row.get(4)?,
            en: text(row, 5)?,
            zh: text(row, 6)?,
            estimated: row.get(7)?,
        })
    });
    rows.and_then(Iterator::collect).with_activity("reading the series")
}
