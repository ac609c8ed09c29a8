//! The feed override of the simulated machine.

use super::Simulated;
use crate::clock::Clock;
use crate::driver::{Actuator, SourceError};
use crate::units::OverridePct;

/// Writes and reads back the feed override of the simulated machine.
pub struct SimulatedOverride {
    name: String,
    machine: Simulated,
}

impl SimulatedOverride {
    pub(super) fn new(name: String, machine: Simulated) -> Self {
        Self { name, machine }
    }

    fn refuse_unless_booted(&self, clock: &dyn Clock) -> Result<(), SourceError> {
        let booted = self.machine.moment(clock.now_ns()).panel.booted;
        if booted { Ok(()) } else { Err(SourceError::Off { source_name: self.name.clone() }) }
    }
}

impl Actuator for SimulatedOverride {
    fn name(&self) -> &str {
        &self.name
    }

    fn write_feed_override(&mut self, clock: &dyn Clock, wanted: OverridePct) -> Result<(), SourceError> {
        self.refuse_unless_booted(clock)?;
        self.machine.locked().write_override(clock.now_ns(), wanted.percent());
        Ok(())
    }

    fn read_feed_override(&mut self, clock: &dyn Clock) -> Result<OverridePct, SourceError> {
        self.refuse_unless_booted(clock)?;
        Ok(OverridePct::new(self.machine.locked().written_override()).unwrap_or(OverridePct::FULL))
    }
}
