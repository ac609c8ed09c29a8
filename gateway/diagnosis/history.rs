//! A range of a history as a recording: `history:DB?from=..&to=..`.

use adapters::Recording;
use gateway_base::moment;
use gateway_history::{Query, Reader};
use std::path::Path;

/// How the address is written, for messages.
const NOTATION: &str =
    "write history:gateway.db?from=2026-01-31T08:00:00Z&to=2026-01-31T16:00:00Z (both may be left out)";

/// Reads the range that `address` (without `history:`) names.
pub(super) fn read(address: &str) -> Result<Recording, String> {
    let (path, conditions) = address.split_once('?').unwrap_or((address, ""));
    let reader = Reader::open(Path::new(path)).map_err(|error| error.to_string())?;
    let span = reader.read_present_span().map_err(|error| error.to_string())?;
    let newest_ns = span.map_or(0, |(_, newest_ns)| newest_ns);
    let query = parse_query(conditions, newest_ns).map_err(|problem| format!("history:{address}: {problem}"))?;
    reader.read_recording(&query).map_err(|error| format!("history:{address}: {error}"))
}

fn parse_query(conditions: &str, newest_ns: i64) -> Result<Query, String> {
    let mut query = Query::default();
    for condition in conditions.split('&').filter(|condition| !condition.is_empty()) {
        let (key, value) =
            condition.split_once('=').ok_or_else(|| format!("{condition:?} has no value; {NOTATION}"))?;
        match key {
            "from" => query.from_ns = Some(moment::parse(value, newest_ns)?),
            "to" => query.to_ns = Some(moment::parse(value, newest_ns)?),
            "state" => query.state = Some(value.to_owned()),
            "program" => query.program = Some(value.to_owned()),
            "tool" => query.tool = Some(value.to_owned()),
            "series" => query.series = value.split(',').map(str::to_owned).collect(),
            _ => return Err(format!("{key:?} is no condition (from, to, state, program, tool, series); {NOTATION}")),
        }
    }
    if let (Some(from_ns), Some(to_ns)) = (query.from_ns, query.to_ns)
        && from_ns >= to_ns
    {
        return Err(format!("from is not before to; {NOTATION}"));
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
        assert!(super::parse_query("since=1970-01-01", 0).expect_err("unknown").contains("since"));
        assert!(super::parse_query("from=1970-01-02&to=1970-01-01", 0).expect_err("empty").contains("not before"));
    }
}
