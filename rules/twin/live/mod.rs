//! The twin while the machine runs: what the model expects at this second, how far the machine is from it, and since
//! when that is no longer usual.
//!
//! Ticks become seconds, seconds are compared with the model, settled seconds of one kind of work become blocks of half
//! a minute, and blocks are held against what was learned from a healthy stretch. Nothing here reads a clock.

pub mod block;
pub mod control_chart;
pub mod expectation;
#[cfg(test)]
mod false_alarms;
pub mod feed;
pub mod learn;
pub mod noise;
pub mod regime;
pub mod second_row;
pub mod watch;
pub mod window;

pub use control_chart::LevelChange;
pub use expectation::{ComparedSecond, NoTwin};
pub use feed::list_unfed_inputs;
pub use regime::Regime;
pub use watch::{Mismatch, Notice, RegimeStage};

use super::model::Model;
use adapter_core::Sample;
use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::state::State;
use block::SettledSecond;
use expectation::Simulation;
use second_row::{Row, Seconds};
use serde::{Deserialize, Serialize};
use watch::Watch;
use window::CuttingTimes;

/// What is remembered across a restart.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct LiveState {
    watch: watch::WatchState,
    minutes: CuttingTimes,
}

impl LiveState {
    /// What still holds under another model: how long the tools have cut.
    #[must_use]
    pub fn retain_cutting_times(self) -> Self {
        Self { minutes: self.minutes, ..Self::default() }
    }
}

/// The running comparison of machine and model: takes samples, gives what is expected.
#[derive(Debug, Clone)]
pub struct Live {
    seconds: Seconds,
    simulation: Simulation,
    watch: Watch,
    compared: ComparedSecond,
    last_ns: Option<TimeNs>,
}

impl Live {
    /// A model, and what was learned under the same model before.
    #[must_use]
    pub fn new(model: Model, memory: LiveState) -> Self {
        Self {
            seconds: Seconds::new(&model.output),
            simulation: Simulation::new(model, memory.minutes),
            watch: Watch::new(memory.watch),
            compared: ComparedSecond::from_reason(NoTwin::NotYet),
            last_ns: None,
        }
    }

    /// Takes a tick; gives what has been noticed. Ticks come in the order of time.
    pub fn update_with_sample(&mut self, sample: &Sample, state: State) -> Option<Notice> {
        let row = self.seconds.add_sample(sample, state)?;
        let gap = self.last_ns.replace(row.at_ns).is_some_and(|last_ns| row.at_ns - last_ns > SECOND_NS);
        if gap {
            self.watch.skip_second();
        }
        self.compare_row(row)
    }

    fn compare_row(&mut self, row: Row) -> Option<Notice> {
        let what = regime::classify_row(&row);
        let speed = row.read_number("spindle_speed_rpm").unwrap_or(0.0);
        let at_s = ns_to_seconds(row.at_ns);
        self.compared = self.simulation.compare_second(row);
        match self.compared {
            ComparedSecond { expected: Ok(expected), residual: Ok(residual) } => {
                self.watch.update_with_second(what, speed, SettledSecond { at_s, expected, residual })
            }
            _ => {
                self.watch.skip_second();
                None
            }
        }
    }

    /// The newest complete second.
    #[must_use]
    pub fn compared_second(&self) -> ComparedSecond {
        self.compared
    }

    /// Begin of that second, ns since 1970; `None` before the first one.
    #[must_use]
    pub fn compared_at_ns(&self) -> Option<TimeNs> {
        self.last_ns
    }

    /// Every regime that has been seen, with its stage.
    pub fn list_stages(&self) -> impl Iterator<Item = (Regime, RegimeStage)> {
        self.watch.list_stages()
    }

    /// What the model lacks, in words, while it cannot be simulated.
    #[must_use]
    pub fn failure_reason(&self) -> Option<&str> {
        self.simulation.failure_reason()
    }

    /// What to remember across a restart.
    #[must_use]
    pub fn to_state(&self) -> LiveState {
        LiveState { watch: self.watch.to_state(), minutes: self.simulation.cutting_times().clone() }
    }
}

fn ns_to_seconds(ns: i64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "a quarter of a microsecond at the present date")]
    let seconds = ns as f64 / SECOND_NS as f64;
    seconds
}
