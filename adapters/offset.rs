//! The shift of an axis' coordinate: what a thermal compensation moves between two programs, and gives back.
//!
//! The offset belongs to the operator, who may have set it to anything and may set it anew at any time. A shift is added to
//! what the operator has set; what somebody has changed in between is the new starting point. [`Ledger`] keeps that account,
//! the same for every control.

use crate::clock::Clock;
use crate::driver::SourceError;

/// An axis whose offset can be shifted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Axis {
    /// X.
    X,
    /// Y.
    Y,
    /// Z.
    Z,
}

impl Axis {
    /// Every axis.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    /// The letter, in lower case.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
        }
    }

    /// The axis of this letter, upper or lower case.
    #[must_use]
    pub fn of(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|axis| axis.word().eq_ignore_ascii_case(word))
    }

    /// Its place in [`Axis::ALL`].
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }
}

/// What a shift has left in a control, um.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Left {
    /// What the operator had set.
    pub base_um: f64,
    /// What was written last: that and the shift.
    pub written_um: f64,
}

/// What a shift came to, um.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shifted {
    /// The offset before.
    pub before_um: f64,
    /// What the operator had set: the offset without the shift.
    pub base_um: f64,
    /// What was written.
    pub asked_um: f64,
    /// The offset now, as read back.
    pub after_um: f64,
    /// Had somebody else changed the offset since it was last written?
    pub changed_by_others: bool,
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
        same(self.asked_um, self.after_um)
    }
}

/// Something that accepts a shift of an axis. Only the gate holds one, beside its [`Actuator`](crate::Actuator).
pub trait OffsetSink: Send {
    /// The address, as in the configuration.
    fn name(&self) -> &str;

    /// Shifts this axis by `wanted_um` from what the operator has set, not from where it is, and reads back.
    ///
    /// # Errors
    /// [`SourceError::Refused`] where nothing may be moved now: a program runs, the machine measures in inches, the control
    /// says no. Others where the line failed.
    fn shift(&mut self, clock: &dyn Clock, axis: Axis, wanted_um: f64) -> Result<Shifted, SourceError>;

    /// Gives back what the operator had set, in one step; `None` where nothing was shifted. What somebody has set in between
    /// is left alone.
    ///
    /// # Errors
    /// As for [`OffsetSink::shift`].
    fn restore(&mut self, clock: &dyn Clock, axis: Axis) -> Result<Option<Shifted>, SourceError>;

    /// Takes over what an earlier run of the gateway has left in the control.
    fn resume(&mut self, axis: Axis, left: Left);
}

/// Whose is which part of the offset of one axis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Ledger(Option<Left>);

impl Ledger {
    /// With what an earlier run has left.
    #[must_use]
    pub fn with(left: Left) -> Self {
        Self(Some(left))
    }

    /// Is anything shifted, by this account?
    #[must_use]
    pub fn is_shifted(&self) -> bool {
        self.0.is_some()
    }

    /// What the operator has set, now that this offset is found; and whether somebody has changed it since it was written.
    #[must_use]
    pub fn base(&self, found_um: f64) -> (f64, bool) {
        match self.0 {
            Some(Left { base_um, written_um }) if same(written_um, found_um) => (base_um, false),
            Some(_) => (found_um, true),
            None => (found_um, false),
        }
    }

    /// This was written on that base.
    pub fn note(&mut self, base_um: f64, written_um: f64) {
        self.0 = Some(Left { base_um, written_um });
    }

    /// Everything was given back.
    pub fn clear(&mut self) {
        self.0 = None;
    }
}

/// Controls count in tenths of a micrometre at the finest.
fn same(a_um: f64, b_um: f64) -> bool {
    (a_um - b_um).abs() < 0.05
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_somebody_else_has_set_is_the_new_beginning() {
        let mut ledger = Ledger::default();
        assert_eq!((ledger.base(40.0), ledger.is_shifted()), ((40.0, false), false));
        ledger.note(40.0, 45.0);
        assert_eq!(ledger.base(45.0), (40.0, false));
        assert_eq!(ledger.base(100.0), (100.0, true));
        assert_eq!(Ledger::with(Left { base_um: 1.0, written_um: 3.0 }).base(3.0), (1.0, false));
    }
}
