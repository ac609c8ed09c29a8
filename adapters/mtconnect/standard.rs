//! Types of the standard with their units, and the words of our dictionary for them. An agent converts into these units, and its documents do not repeat them.
//!
//! Source: MTConnect Standard 1.4, Part 2, tables of data item types and units.

/// A type of data items.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StandardType {
    /// Name of its element in MTConnectStreams.
    pub element: &'static str,
    /// The words of our dictionary for it.
    pub words: &'static str,
    /// Its unit, as our table of units spells it; empty where it has none.
    pub unit: &'static str,
}

const fn define_type(element: &'static str, words: &'static str, unit: &'static str) -> StandardType {
    StandardType { element, words, unit }
}

/// What a column of a recording can be.
const TYPES: &[StandardType] = &[
    define_type("RotaryVelocity", "Spindle speed", "rpm"),
    define_type("SpindleSpeed", "Spindle speed", "rpm"),
    define_type("PathFeedrate", "Path feedrate", "mm/s"),
    define_type("AxisFeedrate", "Axis velocity", "mm/s"),
    define_type("PathFeedratePerRevolution", "Feed per revolution", "mm/rev"),
    define_type("Wattage", "Power", "W"),
    define_type("Amperage", "Current", "A"),
    define_type("AmperageAC", "Current", "A"),
    define_type("Voltage", "Voltage", "V"),
    define_type("VoltageAC", "Voltage", "V"),
    define_type("Load", "Load", "%"),
    define_type("Torque", "Torque", "N m"),
    define_type("Temperature", "Temperature", "°C"),
    define_type("Position", "Position", "mm"),
    define_type("Displacement", "Displacement", "mm"),
    define_type("LinearForce", "Force", "N"),
    define_type("RotaryVelocityOverride", "Spindle override", "%"),
    define_type("PathFeedrateOverride", "Feed override", "%"),
    define_type("Program", "program", ""),
    define_type("Block", "block", ""),
    define_type("ControllerMode", "mode", ""),
    define_type("Execution", "execution", ""),
    define_type("ToolNumber", "tool", ""),
    define_type("ToolId", "tool", ""),
];

/// Units of further types, which have no column of their own.
const MORE_UNITS: [(&str, &str); 4] =
    [("PathPosition", "mm"), ("Velocity", "mm/s"), ("ElectricalEnergy", "J"), ("PartCount", "1")];

/// The type whose observations are elements of this name.
#[must_use]
pub fn find_type(element: &str) -> Option<&'static StandardType> {
    TYPES.iter().find(|known| known.element == element)
}

/// The unit that the standard gives to a type as a data item names it (`PATH_FEEDRATE`); `None` for a type that is not known here.
#[must_use]
pub fn find_unit(kind: &str) -> Option<&'static str> {
    let element = to_element_name(kind);
    let of_column = find_type(&element).map(|known| known.unit).filter(|unit| !unit.is_empty());
    of_column.or_else(|| MORE_UNITS.iter().find(|(known, _)| *known == element).map(|(_, unit)| *unit))
}

/// `PATH_FEEDRATE` is `PathFeedrate`, and `AMPERAGE_AC` is `AmperageAC`.
#[must_use]
pub fn to_element_name(kind: &str) -> String {
    let capitalise = |word: &str| match word {
        "AC" | "DC" | "PH" => word.to_owned(),
        _ => {
            let mut letters = word.chars();
            letters.next().map_or_else(String::new, |first| format!("{first}{}", letters.as_str().to_lowercase()))
        }
    };
    kind.split('_').map(capitalise).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapter_core::conversion::is_known;

    #[test]
    fn every_unit_is_known_and_found_by_the_type_of_a_data_item() {
        let units = TYPES.iter().map(|known| known.unit).chain(MORE_UNITS.iter().map(|(_, unit)| *unit));
        units.filter(|unit| !unit.is_empty()).for_each(|unit| assert!(is_known(unit), "{unit}"));
        assert_eq!(find_unit("PATH_FEEDRATE"), Some("mm/s"));
        assert_eq!(find_unit("AMPERAGE_AC"), Some("A"));
        assert_eq!(find_unit("ELECTRICAL_ENERGY"), Some("J"));
        assert_eq!((find_unit("PROGRAM"), find_unit("x:OWN"), find_unit("")), (None, None, None));
    }
}
