//! Units as devices, profiles and configurations write them, and what a number in one of them is in another.
//!
//! The units are those of [`crate::channel::unit`]. A unit that is not in it is no reason to guess: the value then has none, and says so.

use crate::channel::unit::Unit;

/// What a number in one unit is in another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conversion {
    /// By which the number is multiplied first.
    pub scale: f64,
    /// Added after the factor, in the other unit.
    pub offset: f64,
}

impl Conversion {
    /// A number that needs none.
    pub const NONE: Self = Self { scale: 1.0, offset: 0.0 };

    /// The number in the other unit.
    #[must_use]
    pub fn convert_number(self, number: f64) -> f64 {
        number * self.scale + self.offset
    }
}

/// From one unit to another; `None` where one is not known or they measure different things. Upper and lower case count where
/// they make a difference (mW, MW), and else do not.
#[must_use]
pub fn find_conversion(from: &str, to: &str) -> Option<Conversion> {
    let (scale, offset) = Unit::from_symbol(from)?.compute_conversion(Unit::from_symbol(to)?)?;
    Some(Conversion { scale, offset })
}

/// Is this a unit that is known?
#[must_use]
pub fn is_known(unit: &str) -> bool {
    Unit::from_symbol(unit).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn converted(number: f64, from: &str, to: &str) -> Option<f64> {
        find_conversion(from, to).map(|conversion| (conversion.convert_number(number) * 1e9).round() / 1e9)
    }

    #[test]
    fn what_devices_say_becomes_what_the_channels_say() {
        for (number, from, to, expected) in [
            (20.0, "mm/s", "mm/min", 1200.0),
            (12_345.0, "um", "mm", 12.345),
            (12_345.0, "μm", "mm", 12.345),
            (1500.0, "mA", "A", 1.5),
            (1.5, "inch", "mm", 38.1),
            (25.0, "r/s", "rpm", 1500.0),
            (7.5, "kW", "W", 7500.0),
            (2.0, "MW", "W", 2e6),
            (2.0, "mW", "W", 2e-3),
            (212.0, "°F", "°C", 100.0),
            (300.0, "K", "°C", 26.85),
            (0.6, "MPa", "bar", 6.0),
            (3.0, "N m", "N·m", 3.0),
            (90.0, "度", "°", 90.0),
            (1200.0, "毫米/分", "mm/min", 1200.0),
            (100.0, "RPM", "rpm", 100.0),
        ] {
            assert_eq!(converted(number, from, to), Some(expected), "{number} {from}");
        }
    }

    #[test]
    fn what_is_not_known_or_measures_something_else_is_not_converted() {
        for (from, to) in [("furlong", "mm"), ("mm", "A"), ("", "mm"), ("mm/min", "mm"), ("VA", "W")] {
            assert_eq!(find_conversion(from, to), None, "{from} {to}");
        }
    }
}
