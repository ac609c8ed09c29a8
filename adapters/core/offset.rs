//! The shift of an axis' coordinate: what a thermal compensation moves between two programs, and gives back.
//!
//! The offset belongs to the operator, who may have set it to anything and may set it anew at any time. A shift is added to
//! what the operator has set; what somebody has changed in between is the new starting point. [`OffsetShares`] keeps that account,
//! the same for every control. A line that fails, or a gateway that dies, in the middle of a write leaves open whether the
//! control has taken it: the intent stays in the account until the control was read again.

use crate::clock::Clock;
use crate::driver::{SEE_DOCTOR, SourceError};
use serde::{Deserialize, Serialize};

/// An axis whose offset can be shifted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Axis {
    /// The linear axis X of the machine.
    X,
    /// The linear axis Y of the machine.
    Y,
    /// The linear axis Z of the machine.
    Z,
}

impl Axis {
    /// X, Y and Z, in this order.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    /// The letter, in lower case.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
        }
    }

    /// The axis of this letter, upper or lower case.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|axis| axis.as_word().eq_ignore_ascii_case(word))
    }

    /// Its place in [`Axis::ALL`].
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }
}

/// What a shift has left in a control, um.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Left {
    /// What the operator had set.
    pub base_um: f64,
    /// What was written last and is known to have been taken: that and the shift.
    pub written_um: f64,
    /// What was to be written next, while it is not known whether the control has taken it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intended_um: Option<f64>,
}

impl Left {
    /// The shift that is known to be in force.
    #[must_use]
    pub fn shift_um(&self) -> f64 {
        self.written_um - self.base_um
    }
}

/// The offset of an axis. Only the gate holds one, beside its [`Actuator`](crate::Actuator).
pub trait OffsetSink: Send {
    /// The address, as in the configuration.
    fn name(&self) -> &str;

    /// What the offset is called at this control: `the external work offset`.
    fn offset_name(&self) -> &'static str;

    /// The offset in force, um, where it may be moved now.
    ///
    /// # Errors
    /// [`SourceError::Refused`] where nothing may be moved now: a program runs, the machine measures in inches. Others where
    /// the line failed.
    fn at_rest(&mut self, clock: &dyn Clock, axis: Axis) -> Result<f64, SourceError>;

    /// Writes an offset, um, in the place of the one that was found, and gives what is in force then, as read back.
    ///
    /// # Errors
    /// [`SourceError::Refused`] where the control says no. After any error the offset may have been taken or not.
    fn write(&mut self, clock: &dyn Clock, axis: Axis, found_um: f64, wanted_um: f64) -> Result<f64, SourceError>;

    /// The offset of this axis is not read or written, and why.
    fn build_refusal(&self, axis: Axis, what: &str, next: &str) -> SourceError {
        SourceError::Refused {
            source_name: self.name().to_owned(),
            request: format!("{} of {}", self.offset_name(), axis.as_word()),
            what: what.to_owned(),
            next: next.to_owned(),
        }
    }

    /// May the offset be moved? `at_rest` is what the control says: nothing runs and nothing is held, or `None` where it
    /// does not say.
    ///
    /// # Errors
    /// [`SourceError::Refused`] while a program runs, or where nobody knows.
    fn check_movable(&self, axis: Axis, at_rest: Option<bool>) -> Result<(), SourceError> {
        match at_rest {
            Some(true) => Ok(()),
            Some(false) => Err(self.build_refusal(axis, "a program runs", "It is done between two programs")),
            None => Err(self.build_refusal(axis, "the state of the control is unknown", SEE_DOCTOR)),
        }
    }

    /// Is the offset, looked at once more before it is written, still the one that was found?
    ///
    /// # Errors
    /// [`SourceError::Refused`] where somebody has set another one in between.
    fn check_unchanged(&self, axis: Axis, now_um: f64, found_um: f64) -> Result<(), SourceError> {
        if now_um == found_um {
            return Ok(());
        }
        Err(self.build_refusal(axis, "somebody has just changed it", "It is looked at again"))
    }
}

/// What became of what was written last, by what is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LastWrite {
    /// It is in force, as was known; or nothing was written.
    InForce,
    /// It was not known whether it had been taken; it was.
    Taken,
    /// It was not known whether it had been taken; it was not.
    NotTaken,
    /// Somebody else has changed the offset since.
    Replaced,
}

/// Whose is which part of the offset of one axis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OffsetShares(Option<Left>);

impl OffsetShares {
    /// With what an earlier run has left.
    #[must_use]
    pub fn with(left: Option<Left>) -> Self {
        Self(left)
    }

    /// What is left in the control, by this account; nothing where it is the operator's alone.
    #[must_use]
    pub fn leftover_offset(&self) -> Option<Left> {
        self.0
    }

    /// This offset is found: the account agrees with it from now on. Gives what the operator has set, and what has become of
    /// the last write.
    pub fn reconcile_offset(&mut self, found_um: f64) -> (f64, LastWrite) {
        let Some(Left { base_um, written_um, intended_um }) = self.0 else { return (found_um, LastWrite::InForce) };
        let (base_um, last) = match intended_um {
            Some(intended_um) if is_same_offset(intended_um, found_um) => (base_um, LastWrite::Taken),
            Some(_) if is_same_offset(written_um, found_um) => (base_um, LastWrite::NotTaken),
            None if is_same_offset(written_um, found_um) => (base_um, LastWrite::InForce),
            _ => (found_um, LastWrite::Replaced),
        };
        self.record_offset(base_um, found_um);
        (base_um, last)
    }

    /// This is about to be written in the place of what is there.
    pub fn record_intended_write(&mut self, base_um: f64, found_um: f64, wanted_um: f64) {
        self.0 = Some(Left { base_um, written_um: found_um, intended_um: Some(wanted_um) });
    }

    /// This is in force on that base.
    pub fn record_offset(&mut self, base_um: f64, found_um: f64) {
        let left = Left { base_um, written_um: found_um, intended_um: None };
        self.0 = (!is_same_offset(base_um, found_um)).then_some(left);
    }
}

/// Are these offsets the same to a control? Controls count in tenths of a micrometre at the finest.
#[must_use]
pub fn is_same_offset(a_um: f64, b_um: f64) -> bool {
    (a_um - b_um).abs() < 0.05
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_somebody_else_has_set_is_the_new_beginning() {
        let mut ledger = OffsetShares::default();
        assert_eq!((ledger.reconcile_offset(40.0), ledger.leftover_offset()), ((40.0, LastWrite::InForce), None));
        ledger.record_offset(40.0, 45.0);
        assert_eq!(ledger.reconcile_offset(45.0), (40.0, LastWrite::InForce));
        assert_eq!((ledger.reconcile_offset(100.0), ledger.leftover_offset()), ((100.0, LastWrite::Replaced), None));
        ledger.record_offset(40.0, 40.0);
        assert_eq!(ledger.leftover_offset(), None, "given back");
    }

    #[test]
    fn an_open_write_is_settled_by_what_is_found() {
        for (found_um, last, shift_um) in
            [(48.0, LastWrite::Taken, 8.0), (45.0, LastWrite::NotTaken, 5.0), (7.0, LastWrite::Replaced, 0.0)]
        {
            let mut ledger = OffsetShares::default();
            ledger.record_intended_write(40.0, 45.0, 48.0);
            let (base_um, found) = ledger.reconcile_offset(found_um);
            let left = ledger.leftover_offset().map_or(0.0, |left| left.shift_um());
            assert_eq!((found, left, found_um - base_um), (last, shift_um, shift_um));
            assert!(ledger.leftover_offset().is_none_or(|left| left.intended_um.is_none()));
        }
    }
}
