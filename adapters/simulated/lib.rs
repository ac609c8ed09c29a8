//! The built-in machine: one physical model behind a controller and a meter that are two sources with their own clocks.
//!
//! The model has its own forms of the laws; an estimator that finds them has found them. A part programme runs for
//! hours: power-up, standby, warm-up, facing, roughing and finishing of two diameters, tool changes, wear, thermal
//! growth, pauses, small trouble, the night. The machine obeys the feed override except in threading and tapping; what the
//! gateway writes goes through the builder's ladder (`ladder`), behind the operator's dial.
//!
//! Everything is a function of the seed, the time and what was written: asking more often, or not at all for a
//! while, changes nothing. The same machine runs against the clock ([`Source`](adapter_core::Source)) or as fast as possible
//! ([`Pull`](adapter_core::Pull)).
//!
//! [`Simulated::truth`] is for scoring an estimate, never for making one.

mod actuator;
pub mod address;
mod controller;
mod cutting;
mod device;
mod frame;
mod ladder;
mod machine;
mod meter;
mod moment;
mod noise;
mod offsets;
mod plant;
mod program;
mod settings;

#[cfg(test)]
mod tests;

pub use actuator::SimulatedOverride;
pub use controller::SimulatedController;
pub use ladder::{LadderCounts, LadderSettings};
pub use meter::{METER_CHANNELS, MeterValues, SimulatedMeter};
pub use moment::{Electric, Moment, Panel, TrueState, Truth};
pub use offsets::SimulatedOffsets;
pub use program::{EXPERIMENT_PROGRAM, ExperimentCut, ExperimentStep};
pub use settings::{CutLevel, DaySettings, DeviceSettings, LaterChange, LostInsert, MeterSettings, SimulatedSettings};

use adapter_core::clock::TimeNs;
use adapter_core::offset::Axis;
use adapter_core::override_pct::OverridePct;
use ladder::LadderInput;
use machine::Machine;
use moment::Integrals;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A handle on the simulated machine; clones are handles on the same machine.
#[derive(Clone)]
pub struct Simulated {
    name: Arc<str>,
    settings: SimulatedSettings,
    origin_ns: TimeNs,
    machine: Arc<Mutex<Machine>>,
}

impl Simulated {
    /// A machine whose day begins at `origin_ns`. `name` is the address.
    #[must_use]
    pub fn new(name: &str, settings: SimulatedSettings, origin_ns: TimeNs) -> Self {
        Self::of(name, settings, origin_ns, None)
    }

    /// A machine that is switched on at `origin_ns` and runs these steps in place of its day: program
    /// [`EXPERIMENT_PROGRAM`], whose block numbers count the steps from 1.
    #[must_use]
    pub fn experiment(name: &str, settings: SimulatedSettings, origin_ns: TimeNs, steps: &[ExperimentStep]) -> Self {
        Self::of(name, settings, origin_ns, Some(steps))
    }

    fn of(name: &str, settings: SimulatedSettings, origin_ns: TimeNs, steps: Option<&[ExperimentStep]>) -> Self {
        let machine = Arc::new(Mutex::new(Machine::new(settings, origin_ns, steps)));
        Self { name: Arc::from(name), settings, origin_ns, machine }
    }

    /// How it was set up.
    #[must_use]
    pub fn settings(&self) -> &SimulatedSettings {
        &self.settings
    }

    /// When its day began.
    #[must_use]
    pub fn origin_ns(&self) -> TimeNs {
        self.origin_ns
    }

    /// Its controller as a source.
    #[must_use]
    pub fn controller(&self) -> SimulatedController {
        SimulatedController::new(self.device_name("controller"), self.clone())
    }

    /// Its meter as a source.
    #[must_use]
    pub fn meter(&self) -> SimulatedMeter {
        SimulatedMeter::new(self.device_name("meter"), self.clone())
    }

    /// The way to its feed override.
    #[must_use]
    pub fn feed_override(&self) -> SimulatedOverride {
        SimulatedOverride::new(self.device_name("controller"), self.clone())
    }

    /// The way to its external work offsets.
    #[must_use]
    pub fn offsets(&self) -> SimulatedOffsets {
        SimulatedOffsets::new(self.device_name("controller"), self.clone())
    }

    /// The external work offset of this axis, um.
    #[must_use]
    pub fn offset_um(&self, axis: Axis) -> f64 {
        self.locked().offset_um(axis)
    }

    /// The operator sets the external work offset of this axis, um.
    pub fn set_offset(&self, axis: Axis, offset_um: f64) {
        self.locked().set_offset(axis, offset_um);
    }

    /// The operator locks the offsets against changes by programs and network, or unlocks them: a write is acknowledged
    /// and changes nothing.
    pub fn protect_offsets(&self, protected: bool) {
        self.locked().protect_offsets(protected);
    }

    /// From now on the machine is changed like this, whatever was set up: for a fault that comes and goes.
    pub fn change_machine(&self, cut: f64, friction: f64) {
        self.locked().change_now(cut, friction);
    }

    /// The edge in use of this tool, by the number after the T, loses an insert now.
    pub fn break_insert(&self, tool: u8) {
        self.locked().break_insert(tool);
    }

    /// The operator gives this tool a fresh edge now.
    pub fn change_edge(&self, tool: u8) {
        self.locked().change_edge(tool);
    }

    /// The operator turns the dial of the feed override at `at_ns`.
    pub fn turn_dial(&self, at_ns: TimeNs, dial: OverridePct) {
        self.locked().post_letter(at_ns, LadderInput::Dial(dial));
    }

    /// What was written to the controller since the beginning, as the controller itself has counted it.
    #[must_use]
    pub fn written(&self) -> LadderCounts {
        self.locked().ladder_counts()
    }

    /// The machine at `at_ns`, for a partner that serves it over a real protocol. The last four seconds before the
    /// furthest time asked for are remembered exactly.
    #[must_use]
    pub fn moment(&self, at_ns: TimeNs) -> Moment {
        self.locked().compute_moment(at_ns)
    }

    /// What is true at `at_ns`: only for scoring.
    #[must_use]
    pub fn truth(&self, at_ns: TimeNs) -> Truth {
        self.moment(at_ns).truth
    }

    /// The running integrals at two times, and the machine at the second one.
    fn between(&self, from_ns: TimeNs, to_ns: TimeNs) -> (Integrals, Integrals, Moment) {
        let mut machine = self.locked();
        // The later one first would lose nothing: it is within the four seconds that are remembered.
        (machine.integrals_at(from_ns), machine.integrals_at(to_ns), machine.compute_moment(to_ns))
    }

    fn locked(&self) -> MutexGuard<'_, Machine> {
        self.machine.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn device_name(&self, device: &str) -> String {
        let joint = if self.name.contains('?') { '&' } else { '?' };
        if self.name.contains("device=") {
            return self.name.to_string();
        }
        format!("{}{joint}device={device}", self.name)
    }
}
