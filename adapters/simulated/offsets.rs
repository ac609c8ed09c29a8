//! The external work offsets of the simulated control: what a thermal compensation shifts between two programs.

use super::Simulated;
use crate::clock::{Clock, TimeNs};
use crate::driver::SourceError;
use crate::offset::{Axis, Ledger, Left, OffsetSink, Shifted};
use crate::words::execution;

/// Shifts the offsets of the simulated machine, in whole micrometres, while no program runs.
pub struct SimulatedOffsets {
    name: String,
    machine: Simulated,
    ledgers: [Ledger; 3],
}

impl SimulatedOffsets {
    pub(super) fn new(name: String, machine: Simulated) -> Self {
        Self { name, machine, ledgers: [Ledger::default(); 3] }
    }

    /// The offset, when it may be changed now.
    fn at_rest(&self, at_ns: TimeNs, axis: Axis) -> Result<f64, SourceError> {
        let panel = self.machine.moment(at_ns).panel;
        if !panel.booted {
            return Err(SourceError::Off { source_name: self.name.clone() });
        }
        if ![execution::READY, execution::PROGRAM_COMPLETED].contains(&panel.execution) {
            return Err(SourceError::Refused {
                source_name: self.name.clone(),
                request: format!("the external offset of {}", axis.word()),
                what: "a program runs".to_owned(),
                next: "It is done between two programs".to_owned(),
            });
        }
        Ok(self.machine.offset_um(axis))
    }

    fn write(&self, axis: Axis, before_um: f64, after_um: f64) -> f64 {
        if after_um != before_um {
            self.machine.locked().write_offset(axis, after_um);
        }
        self.machine.offset_um(axis)
    }
}

impl OffsetSink for SimulatedOffsets {
    fn name(&self) -> &str {
        &self.name
    }

    fn shift(&mut self, clock: &dyn Clock, axis: Axis, wanted_um: f64) -> Result<Shifted, SourceError> {
        let before_um = self.at_rest(clock.now_ns(), axis)?;
        let ledger = &self.ledgers[axis.index()];
        let (base_um, changed_by_others) = ledger.base(before_um);
        let asked_um = base_um + wanted_um.round();
        let after_um = self.write(axis, before_um, asked_um);
        self.ledgers[axis.index()].note(base_um, after_um);
        Ok(Shifted { before_um, base_um, asked_um, after_um, changed_by_others })
    }

    fn restore(&mut self, clock: &dyn Clock, axis: Axis) -> Result<Option<Shifted>, SourceError> {
        if !self.ledgers[axis.index()].is_shifted() {
            return Ok(None);
        }
        let before_um = self.at_rest(clock.now_ns(), axis)?;
        let (asked_um, changed_by_others) = self.ledgers[axis.index()].base(before_um);
        let after_um = self.write(axis, before_um, asked_um);
        self.ledgers[axis.index()].clear();
        Ok(Some(Shifted { before_um, base_um: asked_um, asked_um, after_um, changed_by_others }))
    }

    fn resume(&mut self, axis: Axis, left: Left) {
        self.ledgers[axis.index()] = Ledger::with(left);
    }
}
