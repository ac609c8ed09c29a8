//! What is ordered about an offset, and what came of it.

use crate::Fault;
use adapter_core::SourceError;
use adapter_core::clock::TimeNs;
use adapter_core::offset::{Axis, LastWrite, Left, is_same_offset};
use thiserror::Error;

/// What is to be done at the control.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum OffsetOrder {
    /// This shift from what the operator has set.
    Shift {
        /// The axis that is to be shifted.
        axis: Axis,
        /// The shift that the gate counts on, um. Where there is another, nothing is written.
        from_um: f64,
        /// The shift that is to hold, um from what the operator has set.
        wanted_um: f64,
    },
    /// What the operator has set, in one step.
    Restore(Axis),
    /// Only look what is there.
    Look(Axis),
}

impl OffsetOrder {
    /// The axis that the order is about.
    #[must_use]
    pub fn axis(self) -> Axis {
        match self {
            Self::Shift { axis, .. } | Self::Restore(axis) | Self::Look(axis) => axis,
        }
    }
}

/// What a shift came to, um.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shifted {
    /// The offset in the control before the order.
    pub before_um: f64,
    /// What the operator had set: the offset without the shift.
    pub base_um: f64,
    /// What was written; the same as before where nothing was.
    pub asked_um: f64,
    /// The offset now, as read back.
    pub after_um: f64,
    /// What had become of the write before.
    pub last: LastWrite,
}

impl Shifted {
    /// The shift in force.
    #[must_use]
    pub fn shift_um(&self) -> f64 {
        self.after_um - self.base_um
    }

    /// Is in force what was written?
    #[must_use]
    pub fn is_taken(&self) -> bool {
        is_same_offset(self.asked_um, self.after_um)
    }

    /// Whether another offset than the one before was written.
    #[must_use]
    pub fn is_written(&self) -> bool {
        !is_same_offset(self.asked_um, self.before_um)
    }
}

/// The account could not be kept on disk: after a restart the control is looked at again.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{said}")]
pub struct NotOnDisk {
    /// Of which kind the error is.
    pub kind: std::io::ErrorKind,
    /// What the system says.
    pub said: String,
}

/// What an order came to.
#[derive(Debug, Clone, PartialEq)]
pub struct Moved {
    /// When it was carried out.
    pub at_ns: TimeNs,
    /// The order that was carried out.
    pub order: OffsetOrder,
    /// What is in force now; nothing where there was nothing to give back.
    pub result: Result<Option<Shifted>, SourceError>,
    /// What is left in the control, by the account.
    pub left: Option<Left>,
    /// Why the account could not be kept on disk.
    pub kept: Result<(), NotOnDisk>,
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

    /// Is it open whether the control has taken what was written?
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.left.is_some_and(|left| left.intended_um.is_some())
    }
}
