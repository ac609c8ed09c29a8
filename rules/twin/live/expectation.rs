//! What the model expects of the newest second, from the inputs of that second and of those before.

use super::second_row::Row;
use super::window::{CuttingTimes, LookBack, Window};
use crate::model::{Model, Part, simulate_parts};
use crate::{bind::bind_model, inputs::mark_rows_with_inputs};
use adapter_core::Absence;
use physics::Scene;
use recording::{Cells, Numbers};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Laws with a memory are told after half an hour at the earliest, and between two evaluations their long past stands.
const WARM_S: f64 = 1800.0;

/// Kinds that describe a stretch of a past recording and say nothing about the present.
const OF_THE_PAST: [&str; 2] = ["zero_drift", "auxiliary_switch"];

/// Why there is no expected output, or no residual.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoTwin {
    /// No second is complete yet.
    NotYet,
    /// The machine is switched off.
    MachineOff,
    /// An input of the model has no value.
    InputMissing,
    /// The measured output has no value.
    OutputMissing,
    /// A law with a memory of hours has not seen enough yet.
    WarmingUp,
}

impl NoTwin {
    /// The word in JSON and in the history.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::NotYet => "not_yet_read",
            Self::MachineOff => "machine_off",
            Self::InputMissing => "input_missing",
            Self::OutputMissing => "output_missing",
            Self::WarmingUp => "warming_up",
        }
    }
}

impl fmt::Display for NoTwin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotYet => "no second is complete yet",
            Self::MachineOff => "the machine is switched off",
            Self::InputMissing => "an input of the model has no value",
            Self::OutputMissing => "the measured output has no value",
            Self::WarmingUp => "the model has a memory of hours and has not seen half an hour yet",
        })
    }
}

/// The comparison of one second, in the unit of the output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ComparedSecond {
    /// What the model expects.
    pub expected: Result<f64, NoTwin>,
    /// Recorded minus expected, or why there is none.
    pub residual: Result<f64, NoTwin>,
}

impl ComparedSecond {
    /// Neither, for this reason.
    #[must_use]
    pub fn from_reason(reason: NoTwin) -> Self {
        Self { expected: Err(reason), residual: Err(reason) }
    }
}

/// A model over the last rows.
#[derive(Debug, Clone)]
pub struct Simulation {
    model: Model,
    look_back: LookBack,
    window: Window,
    parts: Option<Vec<Part>>,
    failure: Option<String>,
}

/// Takes out what says nothing about the present.
pub(super) fn drop_parts_of_the_past(model: &mut Model) {
    model.parts.retain(|part| !OF_THE_PAST.contains(&part.kind.as_str()));
}

impl Simulation {
    /// `minutes` is what the tools have cut before.
    #[must_use]
    pub fn new(mut model: Model, minutes: CuttingTimes) -> Self {
        drop_parts_of_the_past(&mut model);
        model.parts.iter_mut().for_each(Part::hold_departures_over_time);
        let memory = model.parts.iter().map(|part| LookBack::from_kind(&part.kind)).max().unwrap_or(LookBack::Moment);
        Self { model, look_back: memory, window: Window::new(memory, minutes), parts: None, failure: None }
    }

    /// Engaged minutes of each tool so far.
    #[must_use]
    pub fn cutting_times(&self) -> &CuttingTimes {
        self.window.cutting_times()
    }

    /// What the model lacks, in words, while it cannot be simulated.
    #[must_use]
    pub fn failure_reason(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    /// Takes a second and compares it.
    pub fn compare_second(&mut self, row: Row) -> ComparedSecond {
        let (off, no_output) = (row.off || row.no_output == Some(Absence::MachineOff), row.no_output);
        let recorded = row.read_number(&self.model.output);
        self.window.push(row);
        if off {
            return ComparedSecond::from_reason(NoTwin::MachineOff);
        }
        if self.look_back == LookBack::Shift && self.window.span_s() < WARM_S {
            return ComparedSecond::from_reason(NoTwin::WarmingUp);
        }
        let Some(expected) = self.simulate_output() else {
            return ComparedSecond::from_reason(NoTwin::InputMissing);
        };
        let recorded = recorded.filter(|_| no_output.is_none()).ok_or(NoTwin::OutputMissing);
        ComparedSecond { expected: Ok(expected), residual: recorded.map(|recorded| recorded - expected) }
    }

    fn simulate_output(&mut self) -> Option<f64> {
        let mut recording = self.window.to_recording();
        if recording.find_numbers(&self.model.output).is_none() {
            recording.set_column(&self.model.output, Cells::Numbers(Numbers::default()));
        }
        let mut scene = Scene::new(&recording, &self.model.output, &self.model.roles).ok()?;
        let parts = match self.parts.take() {
            Some(parts) => parts,
            None => bind_model(&self.model, &scene).map_err(|lacking| self.failure = Some(lacking.join("; "))).ok()?,
        };
        let known = mark_rows_with_inputs(&scene, &parts).last().copied().unwrap_or(false);
        let total = simulate_parts(&parts, &mut scene).and_then(|simulated| simulated.total.last().copied());
        self.parts = Some(parts);
        self.failure = None;
        total.filter(|total| known && total.is_finite())
    }
}
