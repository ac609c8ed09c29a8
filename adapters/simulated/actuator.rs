//! The way to the mailbox of the simulated machine's ladder.

use super::Simulated;
use super::ladder::LadderInput;
use adapter_core::clock::Clock;
use adapter_core::driver::{Actuator, LadderRequest, SourceError};
use adapter_core::override_pct::OverridePct;

/// Posts overrides and requests to the ladder of the simulated machine, and reads back what is in force.
pub struct SimulatedOverride {
    name: String,
    machine: Simulated,
}

impl SimulatedOverride {
    pub(super) fn new(name: String, machine: Simulated) -> Self {
        Self { name, machine }
    }

    fn post_letter(&self, clock: &dyn Clock, letter: LadderInput) -> Result<(), SourceError> {
        self.refuse_unless_booted(clock)?;
        self.machine.locked().post_letter(clock.now_ns(), letter);
        Ok(())
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
        self.post_letter(clock, LadderInput::Override(wanted))
    }

    fn read_feed_override(&mut self, clock: &dyn Clock) -> Result<OverridePct, SourceError> {
        self.refuse_unless_booted(clock)?;
        let shown = self.machine.moment(clock.now_ns()).panel.feed_override_pct;
        Ok(OverridePct::new(shown).unwrap_or(OverridePct::FULL))
    }

    fn read_dial(&mut self, clock: &dyn Clock) -> Result<Option<OverridePct>, SourceError> {
        self.refuse_unless_booted(clock)?;
        Ok(OverridePct::new(self.machine.moment(clock.now_ns()).panel.dial_pct))
    }

    fn release_override(&mut self, clock: &dyn Clock) -> Result<(), SourceError> {
        self.post_letter(clock, LadderInput::Release)
    }

    fn ask_ladder(&mut self, clock: &dyn Clock, request: LadderRequest) -> Result<(), SourceError> {
        self.post_letter(clock, LadderInput::Ask(request))
    }
}
