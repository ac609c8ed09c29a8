//! The numbers of an operation: one table of keys, units and ranges, and the unit mistakes that it recognises.

/// One number of an operation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OperationQuantity {
    /// Key in the file and name of the channel; ends in the unit.
    pub key: &'static str,
    /// Least and greatest value that is believed.
    pub range: (f64, f64),
    /// What it is, in English, for messages.
    pub en: &'static str,
    /// Other names under which people write it.
    aliases: &'static [&'static str],
}

/// Every number of an operation.
pub const QUANTITIES: [OperationQuantity; 4] = [
    OperationQuantity {
        key: "depth_of_cut_mm",
        range: (0.001, 50.0),
        en: "depth of cut ap",
        aliases: &["ap", "depth", "depth_of_cut", "axial_depth", "cut_depth"],
    },
    OperationQuantity {
        key: "width_of_cut_mm",
        range: (0.001, 1000.0),
        en: "width of cut ae, in milling",
        aliases: &["ae", "width", "width_of_cut", "radial_depth", "cut_width"],
    },
    OperationQuantity {
        key: "diameter_mm",
        range: (0.05, 5000.0),
        en: "diameter of the work in turning, of the tool in milling",
        aliases: &["diameter", "d", "dia", "tool_diameter", "work_diameter"],
    },
    OperationQuantity {
        key: "teeth",
        range: (1.0, 200.0),
        en: "teeth of the tool",
        aliases: &["z", "flutes", "number_of_teeth"],
    },
];

/// Millimetres of one unit, by the ending of a key.
const ENDINGS: [(&str, f64); 6] =
    [("_um", 1e-3), ("_cm", 10.0), ("_m", 1000.0), ("_in", 25.4), ("_inch", 25.4), ("_mm", 1.0)];

impl OperationQuantity {
    /// Is the number one that is believed?
    #[must_use]
    pub fn is_credible(&self, number: f64) -> bool {
        number.is_finite()
            && number >= self.range.0
            && number <= self.range.1
            && (self.in_mm() || number.fract() == 0.0)
    }

    fn in_mm(&self) -> bool {
        self.key.ends_with("_mm")
    }

    /// What to do about a number that is not believed: the unit it was probably written in.
    #[must_use]
    pub fn describe_correction(&self, number: f64) -> String {
        let (least, greatest) = self.range;
        let range = format!("{}: {least} to {greatest}", self.en);
        if !self.in_mm() {
            return format!("{range}, a whole number");
        }
        let units = [("micrometres", 1e-3), ("metres", 1000.0)];
        let fitting = units.iter().find(|(_, scale)| self.is_credible(number * scale) && number > 0.0);
        match fitting {
            Some((unit, scale)) => {
                format!("in {unit}? then write {} = {}; {range} mm", self.key, round_number(number * scale))
            }
            None => format!("{range} mm"),
        }
    }
}

/// What an unknown key was meant to be: the key, and the number in its unit where the key names another unit.
pub(super) fn suggest_key(key: &str, number: Option<f64>) -> Option<String> {
    let lower = key.to_lowercase();
    let (stem, scale) = ENDINGS
        .iter()
        .find_map(|(ending, scale)| lower.strip_suffix(ending).map(|stem| (stem, Some(*scale))))
        .unwrap_or((&lower, None));
    let quantity = QUANTITIES.iter().find(|quantity| {
        quantity.aliases.contains(&stem) || quantity.key.strip_suffix("_mm").unwrap_or(quantity.key) == stem
    })?;
    let converted = scale.zip(number).map(|(scale, number)| number * scale);
    Some(match converted {
        Some(number) => format!("write {} = {}", quantity.key, round_number(number)),
        None if quantity.in_mm() => format!("write {} = ..., in millimetres", quantity.key),
        None => format!("write {} = ...", quantity.key),
    })
}

/// Without the noise of a conversion.
fn round_number(number: f64) -> f64 {
    (number * 1e9).round() / 1e9
}
