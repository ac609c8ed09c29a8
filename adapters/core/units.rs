//! Units as newtypes, with only the products that physics allows.
//!
//! Numeric kernels work on plain `f64` with the unit in the name; these types guard the places where quantities of
//! different kinds meet (drivers, the merge, the gate).

use std::fmt;
use std::ops::{Add, Mul, Sub};

macro_rules! unit {
    ($(#[$doc:meta])* $name:ident, $symbol:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
        pub struct $name(pub f64);

        impl $name {
            /// The symbol printed after a value.
            pub const SYMBOL: &'static str = $symbol;
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{} {}", self.0, Self::SYMBOL)
            }
        }

        impl Add for $name {
            type Output = Self;
            fn add(self, other: Self) -> Self {
                Self(self.0 + other.0)
            }
        }

        impl Sub for $name {
            type Output = Self;
            fn sub(self, other: Self) -> Self {
                Self(self.0 - other.0)
            }
        }
    };
}

unit!(/// Electrical or mechanical power.
    Watts, "W");
unit!(/// Current, true root mean square unless said otherwise.
    Amperes, "A");
unit!(/// Voltage.
    Volts, "V");
unit!(/// Rotational speed, positive in M3.
    Rpm, "rpm");
unit!(/// Temperature.
    Celsius, "°C");
unit!(/// Length.
    Millimetres, "mm");
unit!(/// Feed or axis velocity.
    MmPerMin, "mm/min");
unit!(/// Torque.
    NewtonMetres, "N m");
unit!(/// Angular velocity.
    RadiansPerSecond, "rad/s");
unit!(/// Energy.
    Joules, "J");
unit!(/// Duration.
    Seconds, "s");
unit!(/// A share in percent, 100 is the whole.
    Percent, "%");

impl Rpm {
    /// The same speed as an angular velocity: `2 pi n / 60`.
    #[must_use]
    pub fn to_radians_per_second(self) -> RadiansPerSecond {
        RadiansPerSecond(self.0 * std::f64::consts::TAU / 60.0)
    }
}

impl Mul<RadiansPerSecond> for NewtonMetres {
    type Output = Watts;
    fn mul(self, speed: RadiansPerSecond) -> Watts {
        Watts(self.0 * speed.0)
    }
}

impl Mul<Amperes> for Volts {
    type Output = Watts;
    fn mul(self, current: Amperes) -> Watts {
        Watts(self.0 * current.0)
    }
}

impl Mul<Seconds> for Watts {
    type Output = Joules;
    fn mul(self, duration: Seconds) -> Joules {
        Joules(self.0 * duration.0)
    }
}

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
    fn torque_times_speed_is_power() {
        let power = NewtonMetres(9.43) * Rpm(800.0).to_radians_per_second();
        assert!((power.0 - 790.0).abs() < 0.5, "{power}");
    }

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
