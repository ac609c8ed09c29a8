//! The external work offsets of the simulated control: what a thermal compensation shifts between two programs.

use super::Simulated;
use adapter_core::clock::Clock;
use adapter_core::driver::SourceError;
use adapter_core::offset::{Axis, OffsetSink};
use adapter_core::words::execution;

/// Shifts the offsets of the simulated machine, in whole micrometres, while no program runs.
pub struct SimulatedOffsets {
    name: String,
    machine: Simulated,
}

impl SimulatedOffsets {
    pub(super) fn new(name: String, machine: Simulated) -> Self {
        Self { name, machine }
    }
}

impl OffsetSink for SimulatedOffsets {
    fn name(&self) -> &str {
        &self.name
    }

    fn offset_name(&self) -> &'static str {
        "the external offset"
    }

    fn at_rest(&mut self, clock: &dyn Clock, axis: Axis) -> Result<f64, SourceError> {
        let panel = self.machine.moment(clock.now_ns()).panel;
        if !panel.booted {
            return Err(SourceError::Off { source_name: self.name.clone() });
        }
        self.check_movable(axis, Some([execution::READY, execution::PROGRAM_COMPLETED].contains(&panel.execution)))?;
        Ok(self.machine.offset_um(axis))
    }

    fn write(&mut self, clock: &dyn Clock, axis: Axis, found_um: f64, wanted_um: f64) -> Result<f64, SourceError> {
        let now_um = self.at_rest(clock, axis)?;
        self.check_unchanged(axis, now_um, found_um)?;
        self.machine.locked().write_offset(axis, wanted_um.round());
        Ok(self.machine.offset_um(axis))
    }
}
