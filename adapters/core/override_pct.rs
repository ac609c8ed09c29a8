//! The override that is written to a controller: whole percent, and only what its interface can hold.

use std::fmt;

/// A feed or spindle override as a controller accepts it: 0 to 254 % in whole percent.
///
/// 255 does not exist on the interface of the controllers this product writes to and is therefore not representable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct OverridePct(u8);

impl OverridePct {
    /// 100 %, the programmed feed.
    pub const FULL: Self = Self(100);
    /// The greatest override that can be written.
    pub const GREATEST: Self = Self(254);

    /// An override of 0 to 254 %; `None` for 255.
    #[must_use]
    pub fn new(percent: u8) -> Option<Self> {
        (percent <= 254).then_some(Self(percent))
    }

    /// The whole percent nearest to a number; `None` when it is none from 0 to 254.
    #[must_use]
    pub fn from_nearest_percent(percent: f64) -> Option<Self> {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 254")]
        (0.0..=254.0).contains(&percent).then(|| Self(percent.round() as u8))
    }

    /// The override in percent.
    #[must_use]
    pub fn percent(self) -> u8 {
        self.0
    }
}

impl fmt::Display for OverridePct {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} %", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_override_but_255_exists() {
        for percent in 0..=254 {
            assert_eq!(OverridePct::new(percent).map(OverridePct::percent), Some(percent));
        }
        assert_eq!(OverridePct::new(255), None);
        assert_eq!(OverridePct::from_nearest_percent(99.6), Some(OverridePct::FULL));
        for none in [-0.5, 254.4, f64::NAN, f64::INFINITY] {
            assert_eq!(OverridePct::from_nearest_percent(none), None, "{none}");
        }
    }
}
