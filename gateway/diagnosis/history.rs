//! A range of a history as a recording: `history:DB?from=..&to=..`.

use gateway_base::moment::{self, MomentError};
use gateway_history::{HistoryError, Query, Reader};
use recording::Recording;
use std::path::Path;
use thiserror::Error;

/// How the address is written, for messages.
const NOTATION: &str =
    "write history:gateway.db?from=2026-01-31T08:00:00Z&to=2026-01-31T16:00:00Z (both may be left out)";

/// Why a range of a history is no recording.
#[derive(Debug, Error)]
pub(super) enum HistoryRangeError {
    /// The history cannot be read.
    #[error(transparent)]
    History(#[from] HistoryError),
    /// The conditions cannot be understood.
    #[error("history:{address}: {error}")]
    Conditions { address: String, error: ConditionError },
    /// The history has no answer to them.
    #[error("history:{address}: {error}")]
    Range { address: String, error: HistoryError },
}

/// What is wrong with a condition.
#[derive(Debug, Error)]
pub(super) enum ConditionError {
    /// There is nothing behind its name.
    #[error("{condition:?} has no value; {NOTATION}")]
    NoValue { condition: String },
    /// A time that is none.
    #[error(transparent)]
    Moment(#[from] MomentError),
    /// Its name is not known.
    #[error("{key:?} is no condition (from, to, state, program, tool, series); {NOTATION}")]
    Unknown { key: String },
    /// The range is empty.
    #[error("from is not before to; {NOTATION}")]
    Empty,
}

/// Reads the range that `address` (without `history:`) names.
pub(super) fn read(address: &str) -> Result<Recording, HistoryRangeError> {
    let (path, conditions) = address.split_once('?').unwrap_or((address, ""));
    let reader = Reader::open(Path::new(path))?;
    let span = reader.read_present_span()?;
    let newest_ns = span.map_or(0, |(_, newest_ns)| newest_ns);
    let query = parse_query(conditions, newest_ns)
        .map_err(|error| HistoryRangeError::Conditions { address: address.to_owned(), error })?;
    reader.read_recording(&query).map_err(|error| HistoryRangeError::Range { address: address.to_owned(), error })
}

fn parse_query(conditions: &str, newest_ns: i64) -> Result<Query, ConditionError> {
    let mut query = Query::default();
    for condition in conditions.split('&').filter(|condition| !condition.is_empty()) {
        let (key, value) =
            condition.split_once('=').ok_or_else(|| ConditionError::NoValue { condition: condition.to_owned() })?;
        match key {
            "from" => query.from_ns = Some(moment::parse(value, newest_ns)?),
            "to" => query.to_ns = Some(moment::parse(value, newest_ns)?),
            "state" => query.state = Some(value.to_owned()),
            "program" => query.program = Some(value.to_owned()),
            "tool" => query.tool = Some(value.to_owned()),
            "series" => query.series = value.split(',').map(str::to_owned).collect(),
            _ => return Err(ConditionError::Unknown { key: key.to_owned() }),
        }
    }
    if let (Some(from_ns), Some(to_ns)) = (query.from_ns, query.to_ns)
        && from_ns >= to_ns
    {
        return Err(ConditionError::Empty);
    }
    Ok(query)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conditions_are_read_and_wrong_ones_named() {
        let query = parse_query("from=1970-01-01&to=1970-01-02&tool=T2", 0).expect("fine");
        assert_eq!((query.from_ns, query.to_ns), (Some(0), Some(86_400_000_000_000)));
        assert_eq!(query.tool.as_deref(), Some("T2"));
        assert!(super::parse_query("since=1970-01-01", 0).expect_err("unknown").to_string().contains("since"));
        assert!(
            super::parse_query("from=1970-01-02&to=1970-01-01", 0)
                .expect_err("empty")
                .to_string()
                .contains("not before")
        );
    }
}
