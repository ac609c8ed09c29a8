//! Units as OPC UA tells them: by the number of their code of UN/CEFACT (recommendation 20). Pure.
//!
//! Source: OPC 10000-8, 5.6.4.3: the number of a code are its characters, each as a byte.

use opcua::types::{EUInformation, LocalizedText};

/// Namespace of the units of UN/CEFACT.
const UNITS: &str = "http://www.opcfoundation.org/UA/units/un/cefact";
/// The unit has no code.
const NO_CODE: i32 = -1;

/// Codes of the units that channels have; other units, and those of scripts, have only their symbol.
const CODES: [(&str, &str); 17] = [
    ("1", "C62"),
    ("%", "P1"),
    ("rpm", "RPM"),
    ("mm/min", "H81"),
    ("mm/s", "C16"),
    ("m/s2", "MSK"),
    ("mm", "MMT"),
    ("um", "4H"),
    ("W", "WTT"),
    ("kW", "KWT"),
    ("A", "AMP"),
    ("V", "VLT"),
    ("N", "NEW"),
    ("N·m", "NU"),
    ("°C", "CEL"),
    ("s", "SEC"),
    ("Hz", "HTZ"),
];

/// The unit of this symbol.
pub(super) fn to_unit_information(symbol: &str) -> EUInformation {
    EUInformation {
        namespace_uri: UNITS.into(),
        unit_id: find_unit_id(symbol),
        display_name: LocalizedText::from(symbol),
        description: LocalizedText::from(symbol),
    }
}

fn find_unit_id(symbol: &str) -> i32 {
    let code = CODES.iter().find(|(known, _)| *known == symbol);
    code.map_or(NO_CODE, |(_, code)| code.bytes().fold(0, |number, byte| (number << 8) | i32::from(byte)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_those_of_the_published_table() {
        // OPC 10000-8, UNECE_to_OPCUA.csv
        assert_eq!(find_unit_id("%"), 20529);
        assert_eq!(find_unit_id("°C"), 4_408_652);
        assert_eq!(find_unit_id("A"), 4_279_632);
        assert_eq!(find_unit_id("mm"), 5_066_068);
        assert_eq!(find_unit_id("cm3/min"), NO_CODE);
    }
}
