//! A limit by the clock, for whoever has a clock.
//!
//! Operations bound a run on a machine that has time for it. On one that is loaded the same run takes longer, and the tick
//! waits. The gateway therefore gives the host somebody who knows the time, and who is asked every few dozen operations. A
//! run that he stops asks for nothing; the script runs again when it is due, and only one that is stopped three times in a
//! row has failed. Every stop is a problem of that tick's decision, and thereby an event with its time in the history.
//!
//! A replay, a trial and a backtest are given nobody: they are bounded by operations alone, and the same samples give the
//! same decisions. Where the recorded machine's scripts were stopped by the clock, the events of that history say so, and a
//! replay of that stretch decides at those times what the script would have decided with time enough.

use rhai::{Dynamic, Engine, EvalAltResult};
use std::sync::Arc;

/// Somebody who knows when a run has lasted too long.
pub trait Deadline: Send + Sync {
    /// A run begins now: the time counts from here.
    fn begin_run(&self);

    /// Has the run lasted too long?
    fn is_over(&self) -> bool;
}

/// He is asked once in so many operations. A single one copies a whole map at most, some ten microseconds.
const ASK_EVERY: u64 = 32;
/// Stopped so many times in a row, a script has failed.
pub(super) const LATE_MAX: u8 = 3;

/// What a stopped run gives as its error.
#[derive(Debug, Clone, Copy)]
struct DeadlinePassed;

pub(super) fn watch_deadline(engine: &mut Engine, deadline: Arc<dyn Deadline>) {
    engine.on_progress(move |operations| {
        (operations.is_multiple_of(ASK_EVERY) && deadline.is_over()).then(|| Dynamic::from(DeadlinePassed))
    });
}

/// Was the run stopped by the clock?
pub(super) fn is_late(error: &EvalAltResult) -> bool {
    match error {
        EvalAltResult::ErrorInFunctionCall(_, _, inner, _) => is_late(inner),
        EvalAltResult::ErrorTerminated(token, _) => token.is::<DeadlinePassed>(),
        _ => false,
    }
}
