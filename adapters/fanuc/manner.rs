//! How answers of a path are read besides what they say.

use super::dial::Dial;

/// How answers are read besides what they say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Manner {
    /// Path of the control, counted from 1.
    pub path: u8,
    /// Is the second feed override in use on this machine?
    pub second_override: bool,
    /// Diagnosis number of the power of the spindle drive.
    pub power_diagnosis: Option<u16>,
    /// Where the operator's dial stands.
    pub dial: Option<Dial>,
}

impl Manner {
    /// For a path that is read besides: what the address says of the second override, power and dial is
    /// said of the first.
    #[must_use]
    pub fn of_further(self, path: u8) -> Self {
        Self { path, second_override: false, power_diagnosis: None, dial: None }
    }
}
