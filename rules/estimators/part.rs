//! What is known of the part that was finished last.

use super::estimate::NoEstimate;
use super::loads::Figure;

/// Of the part that was finished last.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PartFigures {
    /// Energy, J: of the whole machine where it is measured, else of the spindle.
    pub energy_j: Figure,
    /// Energy that removed material, J.
    pub cutting_energy_j: Figure,
    /// Time in which the spindle turned without cutting, s.
    pub idle_s: Figure,
}

impl PartFigures {
    /// No part has been finished.
    #[must_use]
    pub fn without_parts() -> Self {
        let none = Err(NoEstimate::NoPartYet);
        Self { energy_j: none, cutting_energy_j: none, idle_s: none }
    }
}
