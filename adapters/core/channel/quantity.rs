//! What physical quantity a column holds, and in which unit: asked of its name in one place.
//!
//! A recording names its columns as the table of channels does: words joined by `_`, the unit last
//! (`spindle_power_w`). A name outside the table, such as that of a model's output or of a public data set, follows the
//! same rule, or has the quantity as a word and counts or nothing as its unit (`table_force_counts`). Everything that
//! treats a power otherwise than a force asks here; nothing else looks into a name.

use super::ChannelId;

/// Units by the end of a name, for columns outside the table of channels. A longer ending stands before a shorter one.
const ENDINGS: [(&str, &str); 30] = [
    ("_l_min", "l/min"),
    ("_rpm_per_s", "rpm/s"),
    ("_cm3_min", "cm3/min"),
    ("_mm_min", "mm/min"),
    ("_mm_s2", "mm/s2"),
    ("_counts", "counts"),
    ("_per_s", "1/s"),
    ("_m_min", "m/min"),
    ("_mm_s", "mm/s"),
    ("_m_s2", "m/s2"),
    ("_m_s", "m/s"),
    ("_rpm", "rpm"),
    ("_pct", "%"),
    ("_min", "min"),
    ("_bar", "bar"),
    ("_nm", "N m"),
    ("_um", "um"),
    ("_mm", "mm"),
    ("_kwh", "kWh"),
    ("_va", "VA"),
    ("_kw", "kW"),
    ("_hz", "Hz"),
    ("_w", "W"),
    ("_a", "A"),
    ("_n", "N"),
    ("_v", "V"),
    ("_c", "°C"),
    ("_m", "m"),
    ("_s", "s"),
    ("_l", "l"),
];

/// Quantities that the user's own channels can have: word, unit, and what is possible, in the unit. Those of the table of channels
/// have the limits of their rows.
pub const LIMITS: [(&str, &str, (f64, f64)); 12] = [
    ("power", "W", (-1e6, 1e6)),
    ("current", "A", (-1e4, 1e4)),
    ("voltage", "V", (0.0, 1000.0)),
    ("frequency", "Hz", (0.0, 100_000.0)),
    ("energy", "kWh", (-1e9, 1e9)),
    ("temperature", "°C", (-60.0, 300.0)),
    ("pressure", "bar", (-1.0, 5000.0)),
    ("rotation", "rpm", (-100_000.0, 100_000.0)),
    ("length", "mm", (-100_000.0, 100_000.0)),
    ("speed", "mm/min", (-200_000.0, 200_000.0)),
    ("load", "%", (-500.0, 500.0)),
    ("count", "1", (0.0, 1e9)),
];

/// The unit of a column: from the table of channels, else by the end of its name; `None` where neither tells.
#[must_use]
pub fn unit_of(name: &str) -> Option<&'static str> {
    let in_table = ChannelId::from_name(name).map(|id| id.channel().unit).filter(|unit| !unit.is_empty());
    in_table.or_else(|| ENDINGS.iter().find(|(ending, _)| name.ends_with(ending)).map(|(_, unit)| *unit))
}

/// A unit as it stands behind a number in a sentence: a space and its symbol. A number without a unit (`1`) has none.
#[must_use]
pub fn space_unit(unit: &str) -> String {
    if unit.is_empty() || unit == "1" { String::new() } else { format!(" {unit}") }
}

/// A column's name without the unit at its end.
#[must_use]
pub fn without_unit(name: &str) -> &str {
    ENDINGS.iter().find_map(|(ending, _)| name.strip_suffix(ending)).unwrap_or(name)
}

/// What kind of physical quantity a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Electrical or mechanical power.
    Power,
    /// Electric current in any of its units.
    Current,
    /// Torque in any of its units.
    Torque,
    /// Force in any of its units.
    Force,
    /// Load of a drive as a share of its rating.
    Load,
    /// Temperature in any of its units.
    Temperature,
    /// Position of a slide.
    Position,
    /// A small displacement, such as the thermal error of a tool's tip.
    Displacement,
    /// Neither the unit nor the name tells one of these.
    Other,
}

impl Quantity {
    /// By the unit of the column; where that is not enough, by its words.
    #[must_use]
    pub fn from_column_name(name: &str) -> Self {
        match unit_of(name) {
            Some("W" | "kW") => Self::Power,
            Some("A") => Self::Current,
            Some("N m") => Self::Torque,
            Some("N") => Self::Force,
            Some("um") => Self::Displacement,
            Some("°C") => Self::Temperature,
            _ => Self::of_words(name),
        }
    }

    fn of_words(name: &str) -> Self {
        let words = [
            ("power", Self::Power),
            ("force", Self::Force),
            ("torque", Self::Torque),
            ("current", Self::Current),
            ("load", Self::Load),
            ("temperature", Self::Temperature),
            ("position", Self::Position),
        ];
        words.into_iter().find(|(word, _)| has_word(name, word)).map_or(Self::Other, |(_, quantity)| quantity)
    }
}

/// Does the column belong to the spindle, by its name?
#[must_use]
pub fn is_of_spindle(name: &str) -> bool {
    has_word(name, "spindle")
}

/// Is this one of the words that a column's name is made of?
#[must_use]
pub fn has_word(name: &str, word: &str) -> bool {
    name.split('_').any(|part| part == word)
}

#[cfg(test)]
mod tests {
    use super::super::{CHANNELS, Kind};
    use super::*;

    #[test]
    fn every_number_of_the_table_has_the_unit_of_its_row() {
        for channel in CHANNELS.iter().filter(|channel| channel.kind != Kind::Text) {
            assert_eq!(unit_of(channel.name), Some(channel.unit), "{}", channel.name);
        }
    }

    #[test]
    fn the_quantity_follows_the_unit_then_the_words() {
        for (name, quantity) in [
            ("spindle_power_w", Quantity::Power),
            ("spindle_current_a", Quantity::Current),
            ("torque_nm", Quantity::Torque),
            ("x_force_n", Quantity::Force),
            ("table_force_counts", Quantity::Force),
            ("x_axis_load_pct", Quantity::Load),
            ("bearing_temperature_c", Quantity::Temperature),
            ("temperature_1_k", Quantity::Temperature),
            ("x_axis_position_mm", Quantity::Position),
            ("thermal_error_um", Quantity::Displacement),
            ("simulated_power", Quantity::Power),
            ("feed_override_pct", Quantity::Other),
            ("workload", Quantity::Other),
        ] {
            assert_eq!(Quantity::from_column_name(name), quantity, "{name}");
        }
    }
}
