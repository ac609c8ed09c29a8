//! The twin while the machine runs: what the model expects at this second, how far the machine is from it, and since
//! when that is no longer usual.
//!
//! Ticks become seconds, seconds are compared with the model, settled seconds of one kind of work become blocks of half
//! a minute, and blocks are held against what was learned from a healthy stretch. Nothing here reads a clock.

pub mod block;
pub mod chart;
pub mod expected;
#[cfg(test)]
mod false_alarms;
pub mod learn;
pub mod noise;
pub mod regime;
pub mod second;
pub mod watch;
pub mod window;

pub use chart::LevelChange;
pub use expected::{ComparedSecond, NoTwin};
pub use regime::Regime;
pub use watch::{Mismatch, Notice, RegimeStage};

use super::model::Model;
use adapters::Sample;
use adapters::clock::{SECOND_NS, TimeNs};
use block::SettledSecond;
use estimators::State;
use expected::Simulation;
use second::{Row, Seconds};
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
    pub fn of_the_machine(self) -> Self {
        Self { minutes: self.minutes, ..Self::default() }
    }
}

/// See the [module](self).
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
            compared: ComparedSecond::none(NoTwin::NotYet),
            last_ns: None,
        }
    }

    /// Takes a tick; gives what has been noticed. Ticks come in the order of time.
    pub fn step(&mut self, sample: &Sample, state: State) -> Option<Notice> {
        let row = self.seconds.add(sample, state)?;
        let gap = self.last_ns.replace(row.at_ns).is_some_and(|last_ns| row.at_ns - last_ns > SECOND_NS);
        if gap {
            self.watch.skip();
        }
        self.compare(row)
    }

    fn compare(&mut self, row: Row) -> Option<Notice> {
        let what = regime::of(&row);
        let speed = row.number("spindle_speed_rpm").unwrap_or(0.0);
        let at_s = seconds(row.at_ns);
        self.compared = self.simulation.step(row);
        match self.compared {
            ComparedSecond { expected: Ok(expected), residual: Ok(residual) } => {
                self.watch.step(what, speed, SettledSecond { at_s, expected, residual })
            }
            _ => {
                self.watch.skip();
                None
            }
        }
    }

    /// The newest complete second.
    #[must_use]
    pub fn compared(&self) -> ComparedSecond {
        self.compared
    }

    /// Begin of that second, ns since 1970; `None` before the first one.
    #[must_use]
    pub fn compared_at_ns(&self) -> Option<TimeNs> {
        self.last_ns
    }

    /// Every regime that has been seen, with its stage.
    pub fn stages(&self) -> impl Iterator<Item = (Regime, RegimeStage)> {
        self.watch.stages()
    }

    /// What the model lacks, in words, while it cannot be simulated.
    #[must_use]
    pub fn why(&self) -> Option<&str> {
        self.simulation.why()
    }

    /// What to remember across a restart.
    #[must_use]
    pub fn memory(&self) -> LiveState {
        LiveState { watch: self.watch.memory(), minutes: self.simulation.minutes().clone() }
    }
}

fn seconds(ns: i64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "a quarter of a microsecond at the present date")]
    let seconds = ns as f64 / SECOND_NS as f64;
    seconds
}
