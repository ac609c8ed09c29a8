//! A statement of the user's own, over the tables, the views and all samples.

use super::error::{Doing, HistoryError};
use super::ffi;
use super::reader::Reader;
use super::schema;
use rusqlite::ErrorCode;
use rusqlite::hooks::{AuthAction, AuthContext, Authorization};
use rusqlite::types::Value;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// A statement of the program's own has ended long before this.
pub const SQL_WITHIN: Duration = Duration::from_secs(600);
/// A statement is looked at every so many steps of `SQLite`'s machine: some tenths of a millisecond.
const STEPS: i32 = 10_000;

impl Reader {
    /// Runs one statement that reads. Besides the tables and views of the file there is `samples`: one row per tick with
    /// `at_ns`, `time_utc`, `segment` and a column per series. `each` gets the names of the columns and one row.
    ///
    /// # Errors
    /// [`HistoryError::Question`] with what `SQLite` says of the statement, or when it has not ended within `limit`.
    pub fn run_sql(
        &self,
        statement: &str,
        limit: Duration,
        mut each: impl FnMut(&[String], &[Value]) -> ControlFlow<()>,
    ) -> Result<(), HistoryError> {
        let say = |error: rusqlite::Error| {
            HistoryError::Question(format!(
                "{error}. The table samples has one row per tick; the other tables are those of the file."
            ))
        };
        let mut db = schema::open_for_reading(&self.path)?;
        ffi::register_samples(&db, &self.path).with_activity("preparing the table samples")?;
        db.authorizer(Some(only_this_file)).with_activity("preparing to read only this file")?;
        let until = Instant::now() + limit;
        db.progress_handler(STEPS, Some(move || Instant::now() >= until)).with_activity("limiting the statement")?;
        let say = |error: rusqlite::Error| match error.sqlite_error_code() {
            Some(ErrorCode::OperationInterrupted) => HistoryError::Question(format!(
                "the statement has not ended within {} s: ask for less, or give it more time with --limit-s",
                limit.as_secs()
            )),
            _ => say(error),
        };
        let mut statement = db.prepare(statement).map_err(say)?;
        let names: Vec<String> = statement.column_names().map(str::to_owned).collect();
        let mut rows = statement.query([]).map_err(say)?;
        while let Some(row) = rows.next().map_err(say)? {
            let values: Result<Vec<Value>, _> = (0..names.len()).map(|column| row.get(column)).collect();
            if each(&names, &values.map_err(say)?).is_break() {
                break;
            }
        }
        Ok(())
    }
}

fn only_this_file(context: AuthContext<'_>) -> Authorization {
    match context.action {
        AuthAction::Attach { .. } | AuthAction::Detach { .. } => Authorization::Deny,
        _ => Authorization::Allow,
    }
}
