//! What parts do at a place of a program besides taking power: how far they feed through the air there, and whether the coolant runs.
//!
//! A program feeds through the air in every part, at the approach and behind the cut, and always as far. So air is no fault; more of it
//! than the first parts had is: the work or the edge is missing. Along the path an override changes nothing about that.

use serde::{Deserialize, Serialize};

/// The cut is missing when so much of it is air,
const MISSING_SHARE: f64 = 0.5;
/// or after so long beyond the usual air, s: state and meter are late by half a second in either direction at each end of a cut.
const MISSING_S: f64 = 5.0;
/// and not before this, s.
const MISSING_LEAST_S: f64 = 1.0;
/// The coolant of a place is known after so long in the cut, s.
const COOLANT_KNOWN_S: f64 = 2.0;

/// Path and coolant of the parts at a place.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub(super) struct PartAtPlace {
    /// The part that is being made.
    part: f64,
    /// Its path through the air and in the cut, mm (s where no feed is known).
    air: f64,
    cut: f64,
    /// The greatest of the parts before.
    most_air: f64,
    most_cut: f64,
    /// Time in the cut of the first parts in which the coolant is known, and in which it ran, s.
    coolant_known_s: f64,
    coolant_on_s: f64,
}

impl PartAtPlace {
    /// Another part begins: the one before counts among those that are known, unless its cut was missing.
    pub(super) fn follow_part(&mut self, part: f64, learned: bool) {
        if part == self.part {
            return;
        }
        let missed = learned && self.most_cut > 0.0 && self.air - self.most_air >= MISSING_SHARE * self.most_cut;
        if !missed {
            self.most_air = self.most_air.max(self.air);
            self.most_cut = self.most_cut.max(self.cut);
        }
        (self.part, self.air, self.cut) = (part, 0.0, 0.0);
    }

    pub(super) fn add_air(&mut self, part: f64, path: f64) {
        self.part = part;
        self.air += path;
    }

    pub(super) fn add_cut(&mut self, path: f64, step_s: f64, coolant_on: Option<bool>) {
        self.cut += path;
        if let Some(on) = coolant_on {
            self.coolant_known_s += step_s;
            self.coolant_on_s += if on { step_s } else { 0.0 };
        }
    }

    /// Air beyond the usual one over what says that the cut is missing; `per_s` is the path in a second now.
    pub(super) fn missing_share(&self, per_s: f64) -> Option<f64> {
        let enough = (MISSING_SHARE * self.most_cut).min(MISSING_S * per_s).max(MISSING_LEAST_S * per_s);
        (self.most_cut > 0.0 && enough > 0.0).then(|| ((self.air - self.most_air) / enough).max(0.0))
    }

    /// The share of the time in the cut in which the coolant ran.
    pub(super) fn coolant_share(&self) -> Option<f64> {
        (self.coolant_known_s >= COOLANT_KNOWN_S).then(|| self.coolant_on_s / self.coolant_known_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn air_beyond_that_of_the_first_parts_is_a_missing_cut() {
        let mut parts = PartAtPlace::default();
        for part in 0..3 {
            parts.follow_part(f64::from(part), false);
            parts.add_air(f64::from(part), 10.0 + f64::from(part));
            parts.add_cut(100.0, 30.0, Some(true));
        }
        parts.follow_part(3.0, true);
        assert_eq!(parts.coolant_share(), Some(1.0));
        parts.add_air(3.0, 12.0);
        assert_eq!(parts.missing_share(3.3), Some(0.0));
        parts.add_air(3.0, 16.5);
        assert_eq!(parts.missing_share(3.3), Some(1.0), "5 s at 3.3 mm/s");
        assert_eq!(parts.missing_share(100.0), Some(0.165), "1 s at least");
    }
}
