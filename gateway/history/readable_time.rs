//! Times in sentences to a person.

use adapter_core::clock::TimeNs;

/// A time as a person reads it.
pub(crate) fn format_utc(at_ns: TimeNs) -> String {
    jiff::Timestamp::from_nanosecond(i128::from(at_ns)).map_or_else(|_| format!("{at_ns} ns"), |at| at.to_string())
}
