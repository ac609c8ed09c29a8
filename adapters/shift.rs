//! From an offset that can be read and written to one that the gate can shift: whole micrometres, limits, the account of
//! whose part is whose, and the way back. The same for every control.

use crate::clock::Clock;
use crate::driver::SourceError;
use crate::offset::{Axis, Ledger, Left, OffsetSink, Shifted};

/// The offsets of the axes in a control.
pub trait OffsetPlace: Send {
    /// The address, as in the configuration.
    fn name(&self) -> &str;

    /// The offset of this axis in whole micrometres, where it may be changed now.
    ///
    /// # Errors
    /// [`SourceError::Refused`] where it may not: a program runs, the machine measures in inches. Others where the line
    /// failed.
    fn at_rest(&mut self, clock: &dyn Clock, axis: Axis) -> Result<f64, SourceError>;

    /// Writes, and tells what is there then, µm.
    ///
    /// # Errors
    /// The control refuses, or the line failed.
    fn write(&mut self, clock: &dyn Clock, axis: Axis, offset_um: f64) -> Result<f64, SourceError>;
}

/// Limits of a shift, whatever is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftLimits {
    /// Largest change at a time, µm.
    pub step_um: f64,
    /// Largest shift from what the operator had set, µm.
    pub total_um: f64,
}

/// No gate may ask for more than this, whatever its configuration says.
const BOUNDS: ShiftLimits = ShiftLimits { step_um: 1000.0, total_um: 1000.0 };

/// A place whose offsets are shifted.
pub struct Shifts<P> {
    place: P,
    limits: ShiftLimits,
    ledgers: [Ledger; Axis::ALL.len()],
}

impl<P: OffsetPlace> Shifts<P> {
    /// By a millimetre at most.
    pub fn new(place: P) -> Self {
        Self::within(BOUNDS, place)
    }

    /// Within narrower limits.
    pub fn within(limits: ShiftLimits, place: P) -> Self {
        Self { place, limits, ledgers: Default::default() }
    }

    fn write(&mut self, clock: &dyn Clock, axis: Axis, before_um: f64, asked_um: f64) -> Result<f64, SourceError> {
        if asked_um == before_um { Ok(before_um) } else { self.place.write(clock, axis, asked_um) }
    }
}

impl<P: OffsetPlace> OffsetSink for Shifts<P> {
    fn name(&self) -> &str {
        self.place.name()
    }

    /// By one step at most. What was read back may be something else than what was asked for: whoever holds this has to
    /// compare.
    fn shift(&mut self, clock: &dyn Clock, axis: Axis, wanted_um: f64) -> Result<Shifted, SourceError> {
        let before_um = self.place.at_rest(clock, axis)?;
        let (base_um, changed_by_others) = self.ledgers[axis.index()].base(before_um);
        let (total_um, step_um) = (self.limits.total_um.round(), self.limits.step_um.round().max(1.0));
        let target_um = base_um + wanted_um.round().clamp(-total_um, total_um);
        let asked_um = before_um + (target_um - before_um).clamp(-step_um, step_um);
        let after_um = self.write(clock, axis, before_um, asked_um)?;
        self.ledgers[axis.index()].note(base_um, after_um);
        Ok(Shifted { before_um, base_um, asked_um, after_um, changed_by_others })
    }

    fn restore(&mut self, clock: &dyn Clock, axis: Axis) -> Result<Option<Shifted>, SourceError> {
        if !self.ledgers[axis.index()].is_shifted() {
            return Ok(None);
        }
        let before_um = self.place.at_rest(clock, axis)?;
        let (base_um, changed_by_others) = self.ledgers[axis.index()].base(before_um);
        let after_um = self.write(clock, axis, before_um, base_um)?;
        self.ledgers[axis.index()].clear();
        Ok(Some(Shifted { before_um, base_um, asked_um: base_um, after_um, changed_by_others }))
    }

    fn resume(&mut self, axis: Axis, left: Left) {
        self.ledgers[axis.index()] = Ledger::with(left);
    }
}
