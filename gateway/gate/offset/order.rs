//! Carrying out what was decided about an offset.

use super::super::write::Fault;
use adapters::SourceError;
use adapters::clock::{Clock, TimeNs};
use adapters::offset::{Axis, OffsetSink, Shifted};

/// What is to be written to the control.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Order {
    /// This shift from what the operator has set.
    Shift {
        /// Which axis.
        axis: Axis,
        /// How far, um.
        wanted_um: f64,
    },
    /// What the operator has set, in one step.
    Restore(Axis),
}

impl Order {
    /// Which axis.
    #[must_use]
    pub fn axis(self) -> Axis {
        match self {
            Self::Shift { axis, .. } | Self::Restore(axis) => axis,
        }
    }
}

/// What an order came to.
#[derive(Debug, Clone, PartialEq)]
pub struct Moved {
    /// When it was carried out.
    pub at_ns: TimeNs,
    /// What was ordered.
    pub order: Order,
    /// What is in force now; nothing where there was nothing to give back.
    pub result: Result<Option<Shifted>, SourceError>,
}

impl Moved {
    /// Why the gate is to be disarmed. A control that says no, or is off, is asked again later.
    #[must_use]
    pub fn fault(&self) -> Option<Fault> {
        let axis = self.order.axis();
        match &self.result {
            Ok(Some(shifted)) if !shifted.is_taken() => {
                let Shifted { asked_um, after_um: found_um, .. } = *shifted;
                Some(Fault::Offset { axis, asked_um, found_um })
            }
            Ok(_) | Err(SourceError::Refused { .. } | SourceError::Off { .. }) => None,
            Err(error) => Some(Fault::OffsetLine(error.clone())),
        }
    }
}

/// Writes, and reads back. Blocks as long as the control takes.
pub fn carry_out(sink: &mut dyn OffsetSink, order: Order, clock: &dyn Clock) -> Moved {
    let at_ns = clock.now_ns();
    let result = match order {
        Order::Shift { axis, wanted_um } => sink.shift(clock, axis, wanted_um).map(Some),
        Order::Restore(axis) => sink.restore(clock, axis),
    };
    Moved { at_ns, order, result }
}
