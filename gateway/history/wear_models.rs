//! The library of wear models: stored beside the samples, found by machine, tool, work material and operation.

use super::error::{Doing, HistoryError};
use super::reader::Reader;
use super::schema;
use super::tables::has_table;
use adapter_core::clock::TimeNs;
use adapter_core::model_library::{LibraryModel, LibraryRow, WearKey};
use rusqlite::{Connection, params};
use std::path::Path;

/// A model of the library.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredWearModel<M> {
    /// Number in the library.
    pub id: i64,
    /// When it was stored.
    pub at_ns: TimeNs,
    /// Is it the newest of its key?
    pub in_force: bool,
    /// The model and what it is for.
    pub record: M,
}

/// Stores a model; the ones before stay, the newest of a key is in force. A gateway may be writing the same history. Gives the
/// number of the model.
///
/// # Errors
/// The file cannot be opened or written, or the model has a number that cannot be stored.
pub fn store_wear_model(path: &Path, at_ns: TimeNs, record: &impl LibraryModel) -> Result<i64, HistoryError> {
    insert_wear_model(&schema::open_for_writing(path)?, at_ns, record)
}

/// Stores all of these models or none, see [`store_wear_model`].
///
/// # Errors
/// The same.
pub fn store_wear_models(path: &Path, at_ns: TimeNs, records: &[&impl LibraryModel]) -> Result<(), HistoryError> {
    let mut db = schema::open_for_writing(path)?;
    let all = db.transaction().with_activity("storing wear models")?;
    for record in records {
        insert_wear_model(&all, at_ns, *record)?;
    }
    all.commit().with_activity("storing wear models")
}

fn insert_wear_model(db: &Connection, at_ns: TimeNs, record: &impl LibraryModel) -> Result<i64, HistoryError> {
    let LibraryRow { key, form, criterion_mm, cuts, residual_sd_w, r2, origin, toml } =
        record.to_row().map_err(|error| HistoryError::Question(error.to_string()))?;
    let cuts = i64::try_from(cuts)
        .map_err(|error| rusqlite::Error::ToSqlConversionFailure(Box::new(error)))
        .with_activity("storing a wear model")?;
    let WearKey { machine, tool, work_material, operation } = key;
    db.execute(
        "INSERT INTO wear_models (at_ns, machine, tool, work_material, operation, form, criterion_mm, cuts, residual_sd_w, r2,
         origin, toml) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12)",
        params![
            at_ns,
            machine,
            tool,
            work_material,
            operation,
            form,
            criterion_mm,
            cuts,
            residual_sd_w,
            r2,
            origin,
            toml
        ],
    )
    .with_activity("storing a wear model")?;
    Ok(db.last_insert_rowid())
}

fn has_library(db: &Connection) -> Result<bool, HistoryError> {
    has_table(db, "wear_models").with_activity("looking for the wear models")
}

impl Reader {
    /// Number of the newest model; 0 without any.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn newest_wear_model(&self) -> Result<i64, HistoryError> {
        if !has_library(&self.db)? {
            return Ok(0);
        }
        self.db
            .query_row("SELECT coalesce(max(id), 0) FROM wear_models", [], |row| row.get(0))
            .with_activity("looking for the newest wear model")
    }

    /// Every model, the oldest first.
    ///
    /// # Errors
    /// What `SQLite` says, or a model that was spoilt.
    pub fn wear_models<M: LibraryModel>(&self) -> Result<Vec<StoredWearModel<M>>, HistoryError> {
        if !has_library(&self.db)? {
            return Ok(Vec::new());
        }
        let mut statement = self
            .db
            .prepare("SELECT id, at_ns, in_force, (SELECT toml FROM wear_models AS it WHERE it.id = list.id) FROM wear_model_list AS list ORDER BY id")
            .with_activity("reading the wear models")?;
        let rows = statement.query_map([], |row| {
            Ok((row.get::<_, i64>(0)?, row.get::<_, i64>(1)?, row.get::<_, bool>(2)?, row.get::<_, String>(3)?))
        });
        let rows: Vec<_> = rows.and_then(Iterator::collect).with_activity("reading the wear models")?;
        rows.into_iter()
            .map(|(id, at_ns, in_force, toml)| {
                let spoilt = |what: M::Error| HistoryError::Question(format!("wear model {id} of the library: {what}"));
                Ok(StoredWearModel { id, at_ns, in_force, record: M::from_toml(&toml).map_err(spoilt)? })
            })
            .collect()
    }
}
