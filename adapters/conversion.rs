//! Units as devices, profiles and configurations write them, and what a number in one of them is in another.
//!
//! One table for every kind of source. A unit that is not in it is no reason to guess: the value then has none, and says so.

/// What is measured; numbers of different dimensions are never converted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Dimension {
    Length,
    Speed,
    Rotation,
    Angle,
    Current,
    Voltage,
    Power,
    ApparentPower,
    Energy,
    Frequency,
    Temperature,
    Pressure,
    Force,
    Torque,
    Time,
    Share,
    Number,
}

/// Names of a unit, its dimension, and what a number in it is in the first unit of the dimension: times a factor, plus an offset.
type UnitRow = (&'static [&'static str], Dimension, f64, f64);

/// Factors are exact by definition (inch 25.4 mm) or by the SI; °F and K as usual.
const UNITS: &[UnitRow] = &[
    (&["mm", "毫米"], Dimension::Length, 1.0, 0.0),
    (&["um", "micron", "微米"], Dimension::Length, 1e-3, 0.0),
    (&["nm"], Dimension::Length, 1e-6, 0.0),
    (&["cm", "厘米"], Dimension::Length, 10.0, 0.0),
    (&["m", "米"], Dimension::Length, 1e3, 0.0),
    (&["inch", "in", "英寸"], Dimension::Length, 25.4, 0.0),
    (&["mm/min", "mm/m", "毫米/分", "毫米/分钟"], Dimension::Speed, 1.0, 0.0),
    (&["mm/s", "毫米/秒"], Dimension::Speed, 60.0, 0.0),
    (&["m/min", "米/分"], Dimension::Speed, 1e3, 0.0),
    (&["m/s", "米/秒"], Dimension::Speed, 6e4, 0.0),
    (&["inch/min", "in/min", "ipm"], Dimension::Speed, 25.4, 0.0),
    (&["inch/s", "in/s"], Dimension::Speed, 25.4 * 60.0, 0.0),
    (&["rpm", "r/min", "rev/min", "1/min", "转/分", "转/分钟"], Dimension::Rotation, 1.0, 0.0),
    (&["r/s", "rev/s", "rps"], Dimension::Rotation, 60.0, 0.0),
    (&["rad/s"], Dimension::Rotation, 60.0 / std::f64::consts::TAU, 0.0),
    (&["°", "deg", "degree", "度"], Dimension::Angle, 1.0, 0.0),
    (&["rad"], Dimension::Angle, 360.0 / std::f64::consts::TAU, 0.0),
    (&["A", "amp", "ampere", "安", "安培"], Dimension::Current, 1.0, 0.0),
    (&["mA", "毫安"], Dimension::Current, 1e-3, 0.0),
    (&["kA"], Dimension::Current, 1e3, 0.0),
    (&["V", "volt", "伏", "伏特"], Dimension::Voltage, 1.0, 0.0),
    (&["mV"], Dimension::Voltage, 1e-3, 0.0),
    (&["kV"], Dimension::Voltage, 1e3, 0.0),
    (&["W", "watt", "瓦", "瓦特"], Dimension::Power, 1.0, 0.0),
    (&["mW"], Dimension::Power, 1e-3, 0.0),
    (&["kW", "千瓦"], Dimension::Power, 1e3, 0.0),
    (&["MW"], Dimension::Power, 1e6, 0.0),
    (&["VA"], Dimension::ApparentPower, 1.0, 0.0),
    (&["kVA"], Dimension::ApparentPower, 1e3, 0.0),
    (&["kWh", "kW·h", "千瓦时", "度电"], Dimension::Energy, 1.0, 0.0),
    (&["Wh"], Dimension::Energy, 1e-3, 0.0),
    (&["MWh"], Dimension::Energy, 1e3, 0.0),
    (&["J"], Dimension::Energy, 1.0 / 3.6e6, 0.0),
    (&["MJ"], Dimension::Energy, 1.0 / 3.6, 0.0),
    (&["Hz", "赫兹"], Dimension::Frequency, 1.0, 0.0),
    (&["mHz"], Dimension::Frequency, 1e-3, 0.0),
    (&["kHz"], Dimension::Frequency, 1e3, 0.0),
    (&["°C", "C", "degC", "℃", "celsius", "摄氏度"], Dimension::Temperature, 1.0, 0.0),
    (&["K", "kelvin"], Dimension::Temperature, 1.0, -273.15),
    (&["°F", "F", "degF", "℉"], Dimension::Temperature, 5.0 / 9.0, -160.0 / 9.0),
    (&["bar", "巴"], Dimension::Pressure, 1.0, 0.0),
    (&["mbar"], Dimension::Pressure, 1e-3, 0.0),
    (&["Pa"], Dimension::Pressure, 1e-5, 0.0),
    (&["kPa"], Dimension::Pressure, 1e-2, 0.0),
    (&["MPa", "兆帕"], Dimension::Pressure, 10.0, 0.0),
    (&["psi"], Dimension::Pressure, 0.068_947_572_931_683_6, 0.0),
    (&["N", "牛"], Dimension::Force, 1.0, 0.0),
    (&["kN", "千牛"], Dimension::Force, 1e3, 0.0),
    (&["N·m", "Nm", "牛米"], Dimension::Torque, 1.0, 0.0),
    (&["kN·m", "kNm"], Dimension::Torque, 1e3, 0.0),
    (&["s", "sec", "秒"], Dimension::Time, 1.0, 0.0),
    (&["ms", "毫秒"], Dimension::Time, 1e-3, 0.0),
    (&["min", "分", "分钟"], Dimension::Time, 60.0, 0.0),
    (&["h", "小时"], Dimension::Time, 3600.0, 0.0),
    (&["%", "percent", "pct"], Dimension::Share, 1.0, 0.0),
    (&["‰"], Dimension::Share, 0.1, 0.0),
    (&["1", "-", "pcs", "件", "个"], Dimension::Number, 1.0, 0.0),
];

/// What a number in one unit is in another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conversion {
    /// Factor.
    pub scale: f64,
    /// Added after the factor, in the other unit.
    pub offset: f64,
}

impl Conversion {
    /// A number that needs none.
    pub const NONE: Self = Self { scale: 1.0, offset: 0.0 };

    /// The number in the other unit.
    #[must_use]
    pub fn of(self, number: f64) -> f64 {
        number * self.scale + self.offset
    }
}

/// From one unit to another; `None` where one is not known or they measure different things. Upper and lower case count where
/// they make a difference (mW, MW), and else do not.
#[must_use]
pub fn between(from: &str, to: &str) -> Option<Conversion> {
    let ((_, dimension, scale, offset), (_, other, to_scale, to_offset)) = (row(from)?, row(to)?);
    (dimension == other).then(|| Conversion { scale: scale / to_scale, offset: (offset - to_offset) / to_scale })
}

/// Is this a unit that is known?
#[must_use]
pub fn is_known(unit: &str) -> bool {
    row(unit).is_some()
}

fn row(unit: &str) -> Option<UnitRow> {
    let wanted = plain(unit);
    let exact = UNITS.iter().find(|(names, ..)| names.iter().any(|name| plain(name) == wanted));
    if let Some(row) = exact {
        return Some(*row);
    }
    let lower = wanted.to_lowercase();
    let mut like = UNITS.iter().filter(|(names, ..)| names.iter().any(|name| plain(name).to_lowercase() == lower));
    like.next().copied().filter(|_| like.next().is_none())
}

/// Without blanks and points between factors, with one letter for micro.
fn plain(unit: &str) -> String {
    unit.trim()
        .chars()
        .filter(|c| !matches!(c, ' ' | '·' | '*' | '.'))
        .map(|c| if matches!(c, 'μ' | 'µ') { 'u' } else { c })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn converted(number: f64, from: &str, to: &str) -> Option<f64> {
        between(from, to).map(|conversion| (conversion.of(number) * 1e9).round() / 1e9)
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
            assert_eq!(between(from, to), None, "{from} {to}");
        }
    }

    #[test]
    fn no_name_means_two_units() {
        let names: Vec<Vec<String>> =
            UNITS.iter().map(|(names, ..)| names.iter().map(|name| plain(name)).collect()).collect();
        for (at, own) in names.iter().enumerate() {
            assert!(names[..at].iter().flatten().all(|name| !own.contains(name)), "{own:?}");
        }
    }

    #[test]
    fn every_unit_of_the_table_of_channels_is_known() {
        for channel in crate::channel::CHANNELS.iter().filter(|channel| !channel.unit.is_empty()) {
            assert!(is_known(channel.unit) || matches!(channel.unit, "cm3/min" | "mm/rev"), "{}", channel.unit);
        }
    }
}
