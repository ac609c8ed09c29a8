//! `rules backtest`: edited scripts over stored history, beside the running ones; what would have been different.
//!
//! Both sets see the same stored samples, each behind estimators with its own settings and with empty memory, from some time
//! before the stretch on, so that no-load powers have been learned when it begins. Nothing is written anywhere. The
//! gate does not take part: compared is what the scripts ask for, not what would be let through.
//!
//! What the history does not keep is not there: the age of a value within its tick, and readings between two ticks. What it
//! rounds is rounded. Alarms are therefore compared with those that were raised besides: one that a running script
//! raised then and that the edited ones do not raise is lost, whatever the running ones do over the stored samples. Where
//! another version was in charge there are no such alarms, and the report says so.
//!
//! | file | what |
//! |---|---|
//! | `rows` | from stored columns to samples |
//! | `race` | both sets side by side, what they have in common once |
//! | `lane` | what one set did |
//! | `history_alarms` | the alarms that were raised then, as the history has them |
//! | `compare` | alarms and stops that one side has and the other has not |
//! | `report` | the answer in words and as JSON |

mod compare;
mod history_alarms;
mod lane;
mod race;
mod report;
mod rows;

pub use compare::{Evidence, Spell, SpellDifference, SpellKind};
pub use history_alarms::{Other, Recorded};
pub use lane::{Lane, RequestTotals};
pub use report::BacktestReport;

use adapter_core::clock::{SECOND_NS, TimeNs};
use compare::Sides;
use gateway_history::{HistoryError, Query, Reader};
use history_alarms::Concerned;
use rows::ChunkRows;
use rules::script::ScriptSet;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;

/// So much of the history before the stretch is gone through without being compared.
pub const LEAD_IN_NS: i64 = 3600 * SECOND_NS;

/// Which stretch of which history is gone through with which two sets of scripts.
pub struct BacktestPlan {
    /// Path of the database; it is only read.
    pub history: PathBuf,
    /// Beginning of the stretch.
    pub from_ns: TimeNs,
    /// Its end, excluded; `None`: to the newest sample.
    pub to_ns: Option<TimeNs>,
    /// Samples closer to the one before than this are left out; 0: every sample.
    pub every_ns: i64,
    /// The scripts in charge.
    pub running: ScriptSet,
    /// The scripts to try.
    pub edited: ScriptSet,
}

/// Goes through the stretch with both sets.
///
/// # Errors
/// A history that cannot be read.
pub fn run_backtest(plan: BacktestPlan) -> Result<BacktestReport, HistoryError> {
    let began = Instant::now();
    let BacktestPlan { history, from_ns, to_ns, every_ns, running, edited } = plan;
    let reader = Reader::open(&history)?;
    let mut query = Query::between(from_ns.saturating_sub(LEAD_IN_NS), to_ns.unwrap_or(TimeNs::MAX));
    query.series = rows::list_channels(&reader)?;
    let trials = rules::script::run_trials(&edited).into_iter().filter_map(|result| result.problem).collect();
    let concerned = Concerned::from_sets(&running, &edited);
    let raced = race::run_both_sets(from_ns, running, edited, |take| {
        if query.series.is_empty() {
            return Ok(());
        }
        let mut rows = ChunkRows::new(every_ns);
        reader.for_each_chunk(&query, |chunk| {
            rows.for_each_sample(chunk, &mut *take);
            ControlFlow::Continue(())
        })
    })?;
    let span = raced.first_ns.zip(raced.last_ns);
    let recorded =
        span.map(|(first_ns, last_ns)| history_alarms::read(&reader, &concerned, first_ns, last_ns)).transpose()?;
    let recorded = recorded.unwrap_or_default();
    Ok(BacktestReport {
        history,
        from_ns: raced.first_ns.unwrap_or(from_ns),
        to_ns: raced.last_ns.unwrap_or(from_ns),
        rows: raced.rows,
        covered_s: raced.covered_s,
        differing_s: raced.differing_s,
        differences: Sides {
            recorded: recorded.spells(),
            running: raced.running.spells(),
            edited: raced.edited.spells(),
            from_ns,
            near_ns: every_ns,
        }
        .find_differences(),
        recorded,
        trials,
        running: raced.running,
        edited: raced.edited,
        took: began.elapsed(),
    })
}
