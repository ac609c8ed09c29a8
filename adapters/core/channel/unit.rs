//! Units as people write them, with what turns a number of one into a number of another.
//!
//! The factors are those of the SI brochure and, for inch and pound, of the yard and pound agreement of 1959 (25.4 mm, 0.45359237 kg).

/// What a unit measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Dimension {
    /// A duration; its base unit is s.
    Time,
    /// A length or a position; its base unit is mm.
    Length,
    /// A velocity along a path; its base unit is mm/min.
    Velocity,
    /// An acceleration along a path; its base unit is m/s2.
    Acceleration,
    /// A rotational speed; its base unit is rpm.
    Rotation,
    /// A change of rotational speed; its base unit is rpm/s.
    RotationRate,
    /// A feed per revolution; its base unit is mm/rev.
    FeedPerRevolution,
    /// A volume of chips per time; its base unit is cm3/min.
    RemovalRate,
    /// Active power; its base unit is W.
    Power,
    /// An electric current; its base unit is A.
    Current,
    /// An electric voltage; its base unit is V.
    Voltage,
    /// A force; its base unit is N.
    Force,
    /// A torque; its base unit is N m.
    Torque,
    /// A temperature; its base unit is °C.
    Temperature,
    /// A share of a whole; its base unit is %.
    Share,
    /// A volume of fluid per time; its base unit is l/min.
    Flow,
    /// A pressure; its base unit is bar.
    Pressure,
    /// An energy; its base unit is Wh.
    Energy,
    /// Apparent power; its base unit is VA.
    ApparentPower,
    /// An angle; its base unit is °.
    Angle,
    /// A number without a unit.
    Number,
}

/// A unit: `base = factor * x + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// The dimension whose base unit the numbers are turned into.
    pub dimension: Dimension,
    /// By which a number is multiplied to be one of the base unit.
    pub factor: f64,
    /// Added after the factor, in the base unit.
    pub offset: f64,
}

const fn define_unit(dimension: Dimension, factor: f64) -> Unit {
    Unit { dimension, factor, offset: 0.0 }
}

const INCH_MM: f64 = 25.4;
/// 0.45359237 kg * 9.80665 m/s2.
const POUND_N: f64 = 4.448_221_615_260_5;
/// Standard acceleration of gravity, m/s2 (SI brochure, 3rd General Conference 1901): newtons of a kilogram-force.
const KILOGRAM_N: f64 = 9.806_65;
const RAD_RPM: f64 = 60.0 / std::f64::consts::TAU;

use Dimension::{
    Acceleration, Angle, ApparentPower, Current, Energy, FeedPerRevolution, Flow, Force, Length, Number, Power,
    Pressure, RemovalRate, Rotation, RotationRate, Share, Temperature, Time, Torque, Velocity, Voltage,
};

/// Spellings, without spaces, in lower case where case says nothing; then the unit. Those in which it does stand first, as written.
const EXACT: &[(&[&str], Unit)] = &[
    (&["mW"], define_unit(Power, 1e-3)),
    (&["MW"], define_unit(Power, 1e6)),
    (&["mV"], define_unit(Voltage, 1e-3)),
    (&["mA"], define_unit(Current, 1e-3)),
    (&["mN"], define_unit(Force, 1e-3)),
    (&["MN"], define_unit(Force, 1e6)),
    (&["K"], Unit { dimension: Temperature, factor: 1.0, offset: -273.15 }),
    (&["M/min"], define_unit(Velocity, 1e3)),
    (&["MWh"], define_unit(Energy, 1e6)),
    (&["MJ"], define_unit(Energy, 1e6 / 3600.0)),
    (&["mHz"], define_unit(Rotation, 60e-3)),
];

const SPELLINGS: &[(&[&str], Unit)] = &[
    (&["s", "sec", "secs", "second", "seconds", "sek", "sekunden", "秒"], define_unit(Time, 1.0)),
    (&["ms", "msec", "millisecond", "milliseconds", "毫秒"], define_unit(Time, 1e-3)),
    (&["us", "µs", "μs", "usec", "microseconds", "微秒"], define_unit(Time, 1e-6)),
    (&["ns", "nsec", "nanoseconds"], define_unit(Time, 1e-9)),
    (&["min", "minute", "minutes", "minuten", "分", "分钟"], define_unit(Time, 60.0)),
    (&["h", "hr", "hour", "hours", "std", "stunden", "小时"], define_unit(Time, 3600.0)),
    (&["d", "day", "days", "tage", "天"], define_unit(Time, 86_400.0)),
    (&["mm", "毫米", "millimeter", "millimetre"], define_unit(Length, 1.0)),
    (&["um", "µm", "μm", "micron", "microns", "微米"], define_unit(Length, 1e-3)),
    (&["nm_length"], define_unit(Length, 1e-6)),
    (&["cm"], define_unit(Length, 10.0)),
    (&["m", "meter", "米"], define_unit(Length, 1e3)),
    (&["in", "inch", "inches", "\"", "zoll", "英寸"], define_unit(Length, INCH_MM)),
    (&["mil", "thou"], define_unit(Length, INCH_MM / 1e3)),
    (&["mm/min", "mm/m", "mm/minute", "毫米/分", "毫米/分钟", "millimeter/minute"], define_unit(Velocity, 1.0)),
    (&["m/min", "米/分", "米/分钟", "meter/minute"], define_unit(Velocity, 1e3)),
    (&["mm/s", "mm/sec", "毫米/秒", "millimeter/second"], define_unit(Velocity, 60.0)),
    (&["m/s", "m/sec", "米/秒", "meter/second"], define_unit(Velocity, 60e3)),
    (&["um/min", "µm/min"], define_unit(Velocity, 1e-3)),
    (&["cm/min"], define_unit(Velocity, 10.0)),
    (&["in/min", "inch/min", "ipm", "英寸/分", "inch/minute"], define_unit(Velocity, INCH_MM)),
    (&["in/s", "inch/s", "ips", "inch/second"], define_unit(Velocity, 60.0 * INCH_MM)),
    (&["ft/min", "sfm", "foot/minute"], define_unit(Velocity, 12.0 * INCH_MM)),
    (&["m/s2", "m/s^2", "m/s²"], define_unit(Acceleration, 1.0)),
    (&["mm/s2", "mm/s^2", "mm/s²"], define_unit(Acceleration, 1e-3)),
    (
        &[
            "rpm",
            "1/min",
            "min-1",
            "min^-1",
            "min⁻¹",
            "u/min",
            "umdr/min",
            "rev/min",
            "r/min",
            "upm",
            "转/分",
            "转/分钟",
            "转/min",
            "revolution/minute",
        ],
        define_unit(Rotation, 1.0),
    ),
    (
        &[
            "1/s",
            "s-1",
            "s^-1",
            "s⁻¹",
            "hz",
            "赫兹",
            "rps",
            "r/s",
            "rev/s",
            "u/s",
            "转/秒",
            "hertz",
            "revolution/second",
        ],
        define_unit(Rotation, 60.0),
    ),
    (&["khz"], define_unit(Rotation, 60e3)),
    (&["krpm", "1000/min", "x1000rpm"], define_unit(Rotation, 1e3)),
    (&["rad/s"], define_unit(Rotation, RAD_RPM)),
    (&["deg/s", "°/s", "grad/s", "degree/second"], define_unit(Rotation, 1.0 / 6.0)),
    (&["rpm/s"], define_unit(RotationRate, 1.0)),
    (&["rad/s2", "rad/s^2", "rad/s²"], define_unit(RotationRate, RAD_RPM)),
    (&["mm/rev", "mm/u", "mm/r", "mm/umdr", "mm/转", "millimeter/revolution"], define_unit(FeedPerRevolution, 1.0)),
    (&["um/rev", "µm/rev", "µm/u"], define_unit(FeedPerRevolution, 1e-3)),
    (&["in/rev", "ipr", "inch/revolution"], define_unit(FeedPerRevolution, INCH_MM)),
    (&["cm3/min", "cm^3/min", "cm³/min", "ccm/min"], define_unit(RemovalRate, 1.0)),
    (&["mm3/min", "mm^3/min", "mm³/min"], define_unit(RemovalRate, 1e-3)),
    (&["mm3/s", "mm^3/s", "mm³/s"], define_unit(RemovalRate, 0.06)),
    (&["in3/min", "in^3/min", "in³/min"], define_unit(RemovalRate, 16.387_064)),
    (&["w", "watt", "watts", "瓦", "瓦特"], define_unit(Power, 1.0)),
    (&["kw", "kilowatt", "千瓦"], define_unit(Power, 1e3)),
    (&["hp"], define_unit(Power, 745.699_871_582_270_2)),
    (&["ps", "马力"], define_unit(Power, 735.498_75)),
    (&["a", "amp", "amps", "ampere", "arms", "aeff", "安", "安培"], define_unit(Current, 1.0)),
    (&["毫安"], define_unit(Current, 1e-3)),
    (&["ka"], define_unit(Current, 1e3)),
    (&["v", "volt", "vrms", "veff", "伏", "伏特"], define_unit(Voltage, 1.0)),
    (&["kv"], define_unit(Voltage, 1e3)),
    (&["n", "newton", "牛"], define_unit(Force, 1.0)),
    (&["kn", "千牛"], define_unit(Force, 1e3)),
    (&["kgf", "kp", "公斤力", "千克力"], define_unit(Force, KILOGRAM_N)),
    (&["gf"], define_unit(Force, KILOGRAM_N / 1e3)),
    (&["dan"], define_unit(Force, 10.0)),
    (&["lbf"], define_unit(Force, POUND_N)),
    (&["nm", "n·m", "n*m", "n.m", "n-m", "牛米", "newton_meter"], define_unit(Torque, 1.0)),
    (&["ncm"], define_unit(Torque, 1e-2)),
    (&["nmm", "n·mm"], define_unit(Torque, 1e-3)),
    (&["knm"], define_unit(Torque, 1e3)),
    (&["kgf.m", "kgf·m", "kgf*m", "kgf-m", "kgfm", "kpm"], define_unit(Torque, KILOGRAM_N)),
    (&["kgf.cm", "kgf·cm", "kgf*cm", "kgf-cm", "kgfcm", "kpcm"], define_unit(Torque, KILOGRAM_N / 100.0)),
    (&["ft-lb", "ftlb", "lbft", "lbf·ft"], define_unit(Torque, POUND_N * 0.3048)),
    (&["°c", "degc", "c", "celsius", "grad", "℃", "摄氏度"], define_unit(Temperature, 1.0)),
    (&["kelvin"], Unit { dimension: Temperature, factor: 1.0, offset: -273.15 }),
    (&["°f", "degf", "f", "fahrenheit", "℉"], Unit { dimension: Temperature, factor: 5.0 / 9.0, offset: -160.0 / 9.0 }),
    (&["%", "pct", "percent", "prozent", "百分比"], define_unit(Share, 1.0)),
    (&["‰"], define_unit(Share, 0.1)),
    (&["l/min", "lpm", "升/分"], define_unit(Flow, 1.0)),
    (&["m3/h", "m³/h"], define_unit(Flow, 1000.0 / 60.0)),
    (&["bar", "巴"], define_unit(Pressure, 1.0)),
    (&["mbar"], define_unit(Pressure, 1e-3)),
    (&["kpa", "kilopascal"], define_unit(Pressure, 0.01)),
    (&["mpa", "兆帕"], define_unit(Pressure, 10.0)),
    (&["kgf/cm2", "kgf/cm^2", "kgf/cm²", "at"], define_unit(Pressure, KILOGRAM_N / 10.0)),
    (&["psi"], define_unit(Pressure, 0.068_947_572_931_68)),
    (&["pa", "pascal"], define_unit(Pressure, 1e-5)),
    (&["wh", "watt_hour"], define_unit(Energy, 1.0)),
    (&["kwh", "kw·h", "千瓦时", "度电", "kilowatt_hour"], define_unit(Energy, 1e3)),
    (&["j", "joule", "watt_second"], define_unit(Energy, 1.0 / 3600.0)),
    (&["va", "volt_ampere"], define_unit(ApparentPower, 1.0)),
    (&["kva"], define_unit(ApparentPower, 1e3)),
    (&["°", "deg", "degree", "degrees", "度"], define_unit(Angle, 1.0)),
    (&["rad", "radian"], define_unit(Angle, 360.0 / std::f64::consts::TAU)),
    (
        &["1", "-", "–", "bool", "0/1", "dimensionless", "unitless", "count", "counts", "pcs", "无", "件", "个"],
        define_unit(Number, 1.0),
    ),
];

impl Unit {
    /// The unit of a symbol as people write it; `None` where it is none that is known.
    #[must_use]
    pub fn from_symbol(symbol: &str) -> Option<Self> {
        let plain: String = symbol.chars().filter(|c| !c.is_whitespace()).collect();
        if let Some((_, unit)) = EXACT.iter().find(|(spellings, _)| spellings.contains(&plain.as_str())) {
            return Some(*unit);
        }
        let plain = plain.to_lowercase();
        SPELLINGS.iter().find(|(spellings, _)| spellings.contains(&plain.as_str())).map(|(_, unit)| *unit)
    }

    /// What turns a number of this unit into one of the other: factor and offset; `None` where they measure different things.
    #[must_use]
    pub fn compute_conversion(self, other: Self) -> Option<(f64, f64)> {
        (self.dimension == other.dimension)
            .then(|| (self.factor / other.factor, (self.offset - other.offset) / other.factor))
    }
}

/// Every spelling of every unit.
pub fn list_symbols() -> impl Iterator<Item = &'static str> {
    EXACT.iter().chain(SPELLINGS).flat_map(|(spellings, _)| spellings.iter().copied())
}

/// Every unit of a dimension with its symbol, the base first.
pub fn units_of(dimension: Dimension) -> impl Iterator<Item = (&'static str, Unit)> {
    let of = move |(_, unit): &&(&[&str], Unit)| unit.dimension == dimension;
    SPELLINGS.iter().chain(EXACT).filter(of).map(|(spellings, unit)| (spellings[0], *unit))
}

#[cfg(test)]
mod tests {
    use super::super::{CHANNELS, Kind};
    use super::*;

    fn convert(x: f64, from: &str, to: &str) -> f64 {
        let (factor, offset) = Unit::from_symbol(from)
            .expect("known")
            .compute_conversion(Unit::from_symbol(to).expect("known"))
            .expect("alike");
        factor * x + offset
    }

    #[test]
    fn published_conversions() {
        for (x, from, to, y) in [
            (1.0, "in", "mm", 25.4),
            (0.0, "°C", "K", 273.15),
            (212.0, "°F", "°C", 100.0),
            (2.0, "kgf", "N", 19.6133),
            (10.0, "kgf.cm", "N m", 0.980_665),
            (1.0, "kgf/cm2", "bar", 0.980_665),
            (3000.0, "1/min", "rad/s", 314.159_265_358_979_3),
            (50.0, "1/s", "rpm", 3000.0),
            (1.5, "kW", "W", 1500.0),
            (2.0, "m/min", "mm/s", 33.333_333_333_333_336),
            (1.0, "hp", "W", 745.699_871_582_270_2),
            (250.0, "mA", "A", 0.25),
            (20.0, "mm³/s", "cm3/min", 1.2),
        ] {
            let got = convert(x, from, to);
            assert!((got - y).abs() < 1e-9 * y.abs().max(1.0), "{x} {from} = {got} {to}, not {y}");
        }
        assert_eq!(Unit::from_symbol("kW").and_then(|unit| unit.compute_conversion(Unit::from_symbol("A")?)), None);
        assert_eq!(Unit::from_symbol("Zeit"), None);
    }

    #[test]
    fn no_spelling_means_two_units() {
        let all: Vec<&str> =
            EXACT.iter().chain(SPELLINGS).flat_map(|(spellings, _)| spellings.iter().copied()).collect();
        for (index, spelling) in all.iter().enumerate() {
            assert!(!all[..index].contains(spelling), "{spelling}");
        }
    }

    #[test]
    fn every_unit_of_the_channels_is_known() {
        for channel in CHANNELS.iter().filter(|channel| channel.kind != Kind::Text) {
            assert!(Unit::from_symbol(channel.unit).is_some(), "{}: {}", channel.name, channel.unit);
        }
    }
}
