//! A withdrawal of the enable that is owed to the machine.

use adapter_core::clock::{SECOND_NS, TimeNs};

/// While the machine is off or cannot be reached a withdrawal is tried again after this time.
pub(super) const UNREACHED_AGAIN_NS: i64 = 5 * SECOND_NS;

/// The enable that has to be withdrawn and is not yet.
#[derive(Debug, Clone, Copy)]
pub(super) struct Owed {
    /// Of an earlier run: it is not known whether anything is enabled.
    pub(super) leftover: bool,
    /// Not tried again before.
    pub(super) next_ns: TimeNs,
    /// A refusal is told once.
    pub(super) told: bool,
}

impl Owed {
    /// Nobody knows what an earlier run has left.
    pub(super) fn from_leftover() -> Self {
        Self { leftover: true, next_ns: TimeNs::MIN, told: false }
    }

    /// An override of this run is enabled.
    pub(super) fn at_once() -> Self {
        Self { leftover: false, ..Self::from_leftover() }
    }

    /// The same, and the machine could not be reached at this moment.
    pub(super) fn from_unreached(at_ns: TimeNs) -> Self {
        Self { next_ns: at_ns.saturating_add(UNREACHED_AGAIN_NS), ..Self::at_once() }
    }
}
