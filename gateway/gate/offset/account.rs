//! Carrying out what was decided about an offset, and the account of what is the operator's and what the gateway's.
//!
//! Nothing is written before the intent is on disk: when the line fails or the gateway dies in the middle, the next look at
//! the control tells whether it has been taken, and nothing is written on top of what nobody knows. When somebody else has
//! changed the offset, or the gate has counted on another shift than there is, nothing is written either; the gate decides
//! anew from what was found.

use super::journal::OffsetJournal;
use super::order::{Moved, NotOnDisk, OffsetOrder, Shifted};
use adapter_core::SourceError;
use adapter_core::clock::Clock;
use adapter_core::offset::{Axis, LastWrite, Left, OffsetShares, OffsetSink, is_same_offset};

/// No gate may ask for a greater shift than this, whatever its configuration says.
const MOST_UM: f64 = 1000.0;

/// Holds the only sink of offsets there is. Blocks as long as the control takes to answer.
pub struct OffsetAccount {
    sink: Box<dyn OffsetSink>,
    shares: [OffsetShares; Axis::ALL.len()],
    journal: OffsetJournal,
}

impl OffsetAccount {
    /// With what the book knows of this control.
    #[must_use]
    pub fn new(sink: Box<dyn OffsetSink>, journal: OffsetJournal) -> Self {
        let ledgers = Axis::ALL.map(|axis| OffsetShares::with(journal.find_leftover(axis)));
        Self { sink, shares: ledgers, journal }
    }

    /// Carries out an order.
    pub fn carry_out(&mut self, order: OffsetOrder, clock: &dyn Clock) -> Moved {
        let at_ns = clock.now_ns();
        let axis = order.axis();
        let result = self.execute_order(order, clock);
        let left = self.find_leftover(axis);
        // An open intent is in the book already.
        let kept = if result.is_ok() { self.journal.store_leftover(axis, left) } else { Ok(()) };
        Moved {
            at_ns,
            order,
            result,
            left,
            kept: kept.map_err(|error| NotOnDisk { kind: error.kind(), said: error.to_string() }),
        }
    }

    fn find_leftover(&self, axis: Axis) -> Option<Left> {
        self.shares[axis.index()].leftover_offset()
    }

    fn execute_order(&mut self, order: OffsetOrder, clock: &dyn Clock) -> Result<Option<Shifted>, SourceError> {
        let axis = order.axis();
        if matches!(order, OffsetOrder::Restore(_)) && self.find_leftover(axis).is_none() {
            return Ok(None);
        }
        let before_um = self.sink.at_rest(clock, axis)?;
        let (base_um, last) = self.shares[axis.index()].reconcile_offset(before_um);
        let asked_um = match order {
            OffsetOrder::Look(_) => before_um,
            _ if last == LastWrite::Replaced => before_um,
            OffsetOrder::Shift { from_um, .. } if !is_same_offset(from_um, before_um - base_um) => before_um,
            OffsetOrder::Shift { wanted_um, .. } => base_um + wanted_um.round().clamp(-MOST_UM, MOST_UM),
            OffsetOrder::Restore(_) => base_um,
        };
        let after_um = match is_same_offset(asked_um, before_um) {
            true => before_um,
            false => self.write(clock, axis, [base_um, before_um, asked_um])?,
        };
        Ok(Some(Shifted { before_um, base_um, asked_um, after_um, last }))
    }

    fn write(
        &mut self,
        clock: &dyn Clock,
        axis: Axis,
        [base_um, before_um, asked_um]: [f64; 3],
    ) -> Result<f64, SourceError> {
        // The wall before the machine: whatever was proposed, no shift from what the operator has set is greater.
        assert!((asked_um - base_um).abs() <= MOST_UM + 1e-6, "{}: {asked_um} um from {base_um} um", axis.as_word());
        let settled = self.shares[axis.index()];
        self.shares[axis.index()].record_intended_write(base_um, before_um, asked_um);
        if let Err(error) = self.journal.store_leftover(axis, self.find_leftover(axis)) {
            self.shares[axis.index()] = settled;
            return Err(self.accounting_error(axis, &error));
        }
        let after_um = self.sink.write(clock, axis, before_um, asked_um)?;
        self.shares[axis.index()].record_offset(base_um, after_um);
        Ok(after_um)
    }

    fn accounting_error(&self, axis: Axis, error: &std::io::Error) -> SourceError {
        SourceError::Refused {
            source_name: self.sink.name().to_owned(),
            request: format!("the external offset of {}", axis.as_word()),
            what: format!("it could not be accounted for in {}: {error}", self.journal.path().display()),
            next: "Nothing is written before that; free some room, or look at the permissions".to_owned(),
        }
    }
}
