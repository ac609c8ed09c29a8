//! What is wrong with clock and files, in words for the status.

use super::history_store::upkeep::{LOG_TOLD_BYTES, long_log};
use adapters::clock::SECOND_NS;
use gateway_access as access;
use gateway_base::clock::{Trust, format_span};
use gateway_base::state_file;
use gateway_status::{ClockStatus, HistoryStatus, StatusProblem};
use std::path::Path;

/// What the disk has changed, and nobody has looked at yet. Reads the directory.
pub(super) fn problems_of_disk(memory: &Path) -> Vec<StatusProblem> {
    let directory = memory.parent().unwrap_or(Path::new("."));
    let mut problems = state_file::list_damaged(directory);
    problems.extend(access::permission_problem(directory));
    problems
}

/// What is wrong with the files of the history.
pub(super) fn problems_of_history(history: &HistoryStatus) -> Vec<StatusProblem> {
    let mut problems = Vec::new();
    if history.log_bytes >= LOG_TOLD_BYTES {
        let next =
            "end the transaction, or the program that holds it: `lsof` names those that have the file open".to_owned();
        problems.push(StatusProblem { what: long_log(history.log_bytes), next });
    }
    problems.extend(history.set_aside.iter().map(|file| StatusProblem {
        what: format!("a damaged history is kept as {file}; storing goes on in a new one"),
        next: format!("`cnc-gateway history repair NEW --history {file}` saves what is whole; then remove it"),
    }));
    problems
}

/// `5 min ahead of`, `11 years behind`.
pub(super) fn describe_clock_offset(ahead_ns: i64) -> String {
    format!("{} {}", format_span(ahead_ns), if ahead_ns >= 0 { "ahead of" } else { "behind" })
}

/// What is wrong with the clock, and what to do.
#[expect(clippy::cast_possible_truncation, reason = "saturates, which is meant")]
pub(super) fn clock_problem(ClockStatus { trust, wall_ahead_s }: ClockStatus) -> Option<(String, &'static str)> {
    let ahead_ns = (wall_ahead_s * SECOND_NS as f64) as i64;
    match trust {
        Trust::Plausible | Trust::Confirmed => None,
        Trust::Leapt => Some((
            format!("the wall clock is {} the box, which keeps its own time", describe_clock_offset(ahead_ns)),
            "set the clock of the computer right; if it is right, the box follows by itself after some time",
        )),
        Trust::Unset => Some((
            format!(
                "the clock of the computer is not set: it is {} the last certain time, with which the box goes on; times are \
                 provisional and will be corrected",
                describe_clock_offset(ahead_ns)
            ),
            "set the clock, or give the computer a time server or a battery",
        )),
    }
}
