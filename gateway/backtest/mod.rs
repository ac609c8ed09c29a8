//! `rules backtest`: edited scripts over stored history, beside the running ones; what would have been different.
//!
//! Both sets see the same stored samples, each behind estimators with its own settings and with empty memory, from some time
//! before the stretch on, so that no-load powers have been learned when it begins. Nothing is written anywhere. The
//! gate does not take part: compared is what the scripts ask for, not what would be let through.
//!
//! What the history does not keep is not there: the age of a value within its tick, and readings between two ticks.
//!
//! | file | what |
//! |---|---|
//! | `rows` | from stored columns to samples |
//! | `lane` | one set of scripts, and what it did |
//! | `compare` | alarms and stops that one side has and the other has not |
//! | `report` | the answer in words and as JSON |

mod compare;
mod lane;
mod report;
mod rows;

pub use compare::{Difference, Kind, Spell};
pub use lane::{Asked, Lane};
pub use report::Report;

use crate::history::{HistoryError, Query, Reader};
use adapters::clock::{SECOND_NS, TimeNs};
use rows::Rows;
use rules::script::ScriptSet;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// So much of the history before the stretch is gone through without being compared.
pub const LEAD_IN_NS: i64 = 3600 * SECOND_NS;

/// What to compare.
pub struct Plan {
    /// The history.
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
pub fn backtest(plan: Plan) -> Result<Report, HistoryError> {
    let began = Instant::now();
    let Plan { history, from_ns, to_ns, every_ns, running, edited } = plan;
    let reader = Reader::open(&history)?;
    let mut race = Race::new(from_ns, running, edited);
    let mut query = Query::between(from_ns.saturating_sub(LEAD_IN_NS), to_ns.unwrap_or(TimeNs::MAX));
    query.series = rows::channels(&reader)?;
    if !query.series.is_empty() {
        let mut rows = Rows::new(every_ns);
        reader.samples(&query, |chunk| {
            rows.each(chunk, |sample| race.step(sample));
            ControlFlow::Continue(())
        })?;
    }
    Ok(race.finish(&history, began.elapsed()))
}

/// Both lanes, and where they differ at the same moment.
struct Race {
    from_ns: TimeNs,
    running: Lane,
    edited: Lane,
    rows: u64,
    last_ns: Option<TimeNs>,
    first_ns: Option<TimeNs>,
    covered_ns: i64,
    differing_ns: i64,
}

impl Race {
    fn new(from_ns: TimeNs, running: ScriptSet, edited: ScriptSet) -> Self {
        Self {
            from_ns,
            running: Lane::new(running, from_ns),
            edited: Lane::new(edited, from_ns),
            rows: 0,
            last_ns: None,
            first_ns: None,
            covered_ns: 0,
            differing_ns: 0,
        }
    }

    fn step(&mut self, sample: &adapters::Sample) {
        let at_ns = sample.at_ns;
        let step_ns = self.last_ns.replace(at_ns).map_or(0, |last_ns| at_ns - last_ns);
        // A longer step is a gap, in which nobody asked for anything.
        let step_ns = if (0..=lane::STEP_MAX_NS).contains(&step_ns) { step_ns } else { 0 };
        self.running.step(sample, step_ns);
        self.edited.step(sample, step_ns);
        if at_ns < self.from_ns {
            return;
        }
        self.first_ns.get_or_insert(at_ns);
        self.rows += 1;
        self.covered_ns += step_ns;
        if lane::differ(self.running.pct(), self.edited.pct()) {
            self.differing_ns += step_ns;
        }
    }

    fn finish(mut self, history: &Path, took: std::time::Duration) -> Report {
        let end_ns = self.last_ns.unwrap_or(self.from_ns);
        self.running.end(end_ns);
        self.edited.end(end_ns);
        let differences = compare::differences(self.running.spells(), self.edited.spells());
        Report {
            history: history.to_owned(),
            from_ns: self.first_ns.unwrap_or(self.from_ns),
            to_ns: end_ns,
            rows: self.rows,
            covered_s: seconds(self.covered_ns),
            differing_s: seconds(self.differing_ns),
            differences,
            running: self.running,
            edited: self.edited,
            took,
        }
    }
}

#[expect(clippy::cast_precision_loss, reason = "2^53 ns are a hundred days; beyond that microseconds suffice")]
fn seconds(ns: i64) -> f64 {
    ns as f64 / SECOND_NS as f64
}
