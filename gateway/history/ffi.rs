//! What `SQLite` calls when a statement reads the virtual table `samples`. The work is done in [`vtab`](super::vtab);
//! here is only the layout that C needs.
#![allow(unsafe_code, reason = "the traits of virtual tables are unsafe: they promise a memory layout to C")]

use super::vtab::{Cursor, Samples};
use rusqlite::vtab::{
    Context, Filters, IndexInfo, Module, VTab, VTabConfig, VTabConnection, VTabCursor, sqlite3_vtab,
    sqlite3_vtab_cursor,
};
use rusqlite::{Connection, Error};
use std::borrow::Cow;
use std::ffi::{CStr, c_int};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

/// Makes `samples` known to statements on `db`.
pub(super) fn register_samples(db: &Connection, path: &Path) -> Result<(), Error> {
    const MODULE: Module<'_, VirtualTable> = Module::eponymous_only_module();
    db.create_module(c"samples", &MODULE, Some(path.to_owned()))
}

/// The table, as `SQLite` holds it.
#[repr(C)]
struct VirtualTable {
    /// First, as C expects.
    base: sqlite3_vtab,
    samples: Samples,
}

/// A scan, as `SQLite` holds it.
#[repr(C)]
struct Scan<'vtab> {
    /// First, as C expects.
    base: sqlite3_vtab_cursor,
    cursor: Cursor,
    table: PhantomData<&'vtab VirtualTable>,
}

// SAFETY: `Table` is `repr(C)` and its first field is the `sqlite3_vtab` that the trait asks for.
unsafe impl<'vtab> VTab<'vtab> for VirtualTable {
    type Aux = PathBuf;
    type Cursor = Scan<'vtab>;

    fn connect(
        db: &mut VTabConnection,
        path: Option<&PathBuf>,
        _module: &[u8],
        _database: &[u8],
        _table: &[u8],
        _arguments: &[&[u8]],
    ) -> Result<(Cow<'static, CStr>, Self), Error> {
        // It opens a file, so views and triggers of a foreign file may not use it.
        db.config(VTabConfig::DirectOnly)?;
        let path = path.ok_or_else(|| Error::ModuleError("no history is connected".to_owned()))?;
        let samples = Samples::connect(path)?;
        Ok((Cow::Owned(samples.declare_columns()?), Self { base: sqlite3_vtab::default(), samples }))
    }

    fn best_index(&self, info: &mut IndexInfo) -> Result<bool, Error> {
        Samples::plan_query(info);
        Ok(true)
    }

    fn open(&'vtab mut self) -> Result<Scan<'vtab>, Error> {
        Ok(Scan { base: sqlite3_vtab_cursor::default(), cursor: self.samples.open_cursor()?, table: PhantomData })
    }
}

// SAFETY: `Scan` is `repr(C)` and its first field is the `sqlite3_vtab_cursor` that the trait asks for.
unsafe impl VTabCursor for Scan<'_> {
    fn filter(&mut self, _number: c_int, letters: Option<&str>, arguments: &Filters<'_>) -> Result<(), Error> {
        self.cursor.begin_scan(letters.unwrap_or(""), arguments)
    }

    fn next(&mut self) -> Result<(), Error> {
        self.cursor.next()
    }

    fn eof(&self) -> bool {
        self.cursor.is_at_end()
    }

    fn column(&self, context: &mut Context, column: c_int) -> Result<(), Error> {
        self.cursor.write_column(context, column)
    }

    fn rowid(&self) -> Result<i64, Error> {
        Ok(self.cursor.current_rowid())
    }
}
