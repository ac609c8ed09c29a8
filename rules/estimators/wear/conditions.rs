//! The four conditions of a cut that its power depends on, their units and believed ranges, and what is measured.

use crate::regression::{Refusal, RefusalKind};
use std::fmt;

/// One of the four conditions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConditionFactor {
    /// Column in a recording; ends in the unit.
    pub name: &'static str,
    /// Symbol in formulas and reports, as `vc`.
    pub symbol: &'static str,
    /// Letter of the coded variable.
    pub letter: char,
    /// Unit of its values, as in the name of the column.
    pub unit: &'static str,
    /// Least and greatest value that is believed.
    pub range: (f64, f64),
    /// What it is, in English.
    pub en: &'static str,
    /// What it is, in Chinese.
    pub zh: &'static str,
    /// Unit that a greater value was probably written in, and its size in our unit.
    mistaken: (&'static str, f64),
}

/// Flank wear, cutting speed, feed, depth of cut: the order of all vectors of conditions.
pub const FACTORS: [ConditionFactor; 4] = [
    ConditionFactor {
        name: "flank_wear_mm",
        symbol: "VB",
        letter: 'a',
        unit: "mm",
        range: (0.0, 2.0),
        en: "flank wear",
        zh: "后刀面磨损量",
        mistaken: ("um", 1e-3),
    },
    ConditionFactor {
        name: "cutting_speed_m_min",
        symbol: "vc",
        letter: 'b',
        unit: "m/min",
        range: (1.0, 5000.0),
        en: "cutting speed",
        zh: "切削速度",
        mistaken: ("mm/min", 1e-3),
    },
    ConditionFactor {
        name: "feed_per_rev_mm",
        symbol: "f",
        letter: 'c',
        unit: "mm/rev",
        range: (0.001, 10.0),
        en: "feed per revolution",
        zh: "每转进给量",
        mistaken: ("um/rev, or a feed in mm/min", 1e-3),
    },
    ConditionFactor {
        name: "depth_of_cut_mm",
        symbol: "ap",
        letter: 'd',
        unit: "mm",
        range: (0.005, 50.0),
        en: "depth of cut",
        zh: "背吃刀量",
        mistaken: ("um", 1e-3),
    },
];

/// Column of the cutting power.
pub const CUTTING_POWER: &str = "cutting_power_w";

/// Index of the flank wear in [`FACTORS`].
pub const WEAR: usize = 0;

/// Specific cutting energy that metals, plastics and wood lie within, J/mm3.
const ENERGY_J_MM3: (f64, f64) = (0.02, 60.0);

/// The conditions of one cut, in the units of [`FACTORS`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CutConditions {
    /// Width of the flank wear land VB, mm; 0 for a sharp edge.
    pub flank_wear_mm: f64,
    /// Cutting speed vc, m/min.
    pub cutting_speed_m_min: f64,
    /// Feed f of one turn, mm/rev.
    pub feed_per_rev_mm: f64,
    /// Depth of cut ap, mm.
    pub depth_of_cut_mm: f64,
}

impl CutConditions {
    /// In the order of [`FACTORS`].
    #[must_use]
    pub fn to_vector(&self) -> [f64; 4] {
        [self.flank_wear_mm, self.cutting_speed_m_min, self.feed_per_rev_mm, self.depth_of_cut_mm]
    }

    /// From the order of [`FACTORS`].
    #[must_use]
    pub fn from_vector(vector: [f64; 4]) -> Self {
        let [flank_wear_mm, cutting_speed_m_min, feed_per_rev_mm, depth_of_cut_mm] = vector;
        Self { flank_wear_mm, cutting_speed_m_min, feed_per_rev_mm, depth_of_cut_mm }
    }

    /// The same cut with another wear.
    #[must_use]
    pub fn with_wear(self, flank_wear_mm: f64) -> Self {
        Self { flank_wear_mm, ..self }
    }

    /// Material removed per second, mm3/s.
    #[must_use]
    pub fn removal_rate_mm3_s(&self) -> f64 {
        self.cutting_speed_m_min * 1000.0 / 60.0 * self.feed_per_rev_mm * self.depth_of_cut_mm
    }

    /// Everything that is wrong with the four values; empty when they can be computed with.
    #[must_use]
    pub fn list_problems(&self) -> Vec<ConditionProblem> {
        FACTORS.iter().zip(self.to_vector()).filter_map(|(factor, value)| factor.find_problem(value)).collect()
    }
}

/// A condition of a cut that cannot be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConditionProblem {
    factor: &'static ConditionFactor,
    value: f64,
    /// The unit in which the value would be possible.
    mistaken_unit: Option<&'static str>,
}

impl ConditionProblem {
    /// A mistaken unit, or a value that no unit explains.
    #[must_use]
    pub fn kind(&self) -> RefusalKind {
        if self.mistaken_unit.is_some() { RefusalKind::Unit } else { RefusalKind::OutOfRange }
    }
}

impl fmt::Display for ConditionProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (ConditionFactor { name, unit, .. }, (least, greatest)) = (self.factor, self.factor.range);
        write!(f, "{name} = {} is outside {least} to {greatest} {unit}", self.value)?;
        self.mistaken_unit.map_or(Ok(()), |mistaken| write!(f, ": is it in {mistaken}?"))
    }
}

impl ConditionFactor {
    /// What is wrong with a value, and in which unit it probably is.
    #[must_use]
    pub fn find_problem(&'static self, value: f64) -> Option<ConditionProblem> {
        let (least, greatest) = self.range;
        if value.is_finite() && value >= least && value <= greatest {
            return None;
        }
        let (unit, size) = self.mistaken;
        let fits = value.is_finite() && value > greatest && (least..=greatest).contains(&(value * size));
        Some(ConditionProblem { factor: self, value, mistaken_unit: fits.then_some(unit) })
    }

    /// The factor of this column.
    #[must_use]
    pub fn find_by_name(name: &str) -> Option<&'static Self> {
        FACTORS.iter().find(|factor| factor.name == name || factor.symbol == name)
    }
}

impl fmt::Display for CutConditions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { flank_wear_mm, cutting_speed_m_min, feed_per_rev_mm, depth_of_cut_mm } = self;
        write!(
            f,
            "VB {flank_wear_mm} mm, vc {cutting_speed_m_min} m/min, f {feed_per_rev_mm} mm/rev, ap {depth_of_cut_mm} mm"
        )
    }
}

/// The cutting speed of a diameter at a spindle speed, m/min: `vc = pi D n / 1000`.
///
/// # Errors
/// A diameter outside 0.01 to 10 000 mm, or more than 200 000 rpm.
pub fn cutting_speed_m_min(diameter_mm: f64, spindle_speed_rpm: f64) -> Result<f64, Refusal> {
    if !(diameter_mm.is_finite() && (0.01..=10_000.0).contains(&diameter_mm)) {
        return Err(Refusal::new(RefusalKind::OutOfRange, format!("a diameter of {diameter_mm} mm cannot be"), ""));
    }
    if !(spindle_speed_rpm.is_finite() && spindle_speed_rpm.abs() <= 200_000.0) {
        let what = format!("a spindle speed of {spindle_speed_rpm} rpm cannot be");
        return Err(Refusal::new(RefusalKind::OutOfRange, what, ""));
    }
    Ok(std::f64::consts::PI * diameter_mm * spindle_speed_rpm.abs() / 1000.0)
}

/// One cut: its conditions and the power that it took.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    /// Wear, speed, feed and depth of this cut.
    pub conditions: CutConditions,
    /// Power that removes material, W.
    pub cutting_power_w: f64,
}

impl Cut {
    /// Energy per volume of material, J/mm3.
    #[must_use]
    pub fn specific_energy_j_mm3(&self) -> f64 {
        self.cutting_power_w / self.conditions.removal_rate_mm3_s()
    }
}

/// What is wrong with a set of cuts as a whole: powers in kW or mW show in the energy per volume of material.
#[must_use]
pub fn unit_trouble(cuts: &[Cut]) -> Option<String> {
    let mut energies: Vec<f64> = cuts.iter().map(Cut::specific_energy_j_mm3).filter(|it| it.is_finite()).collect();
    energies.sort_by(f64::total_cmp);
    let middle = *energies.get(energies.len() / 2)?;
    let (least, greatest) = ENERGY_J_MM3;
    if (least..=greatest).contains(&middle) {
        return None;
    }
    let guess = match middle {
        it if (least..=greatest).contains(&(it * 1000.0)) => "is the power in kW? It must be in W",
        it if (least..=greatest).contains(&(it / 1000.0)) => {
            "is the power in mW, or a speed in m/s, or a length in m? They must be in W, m/min and mm"
        }
        _ => "check the units of power, speed, feed and depth",
    };
    Some(format!(
        "the cuts take {middle:.3e} J per mm3 of material in the middle; metals lie between {least} and {greatest}: {guess}"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_cutting_speed() {
        let speed = cutting_speed_m_min(79.0, 800.0).expect("a speed");
        assert!((speed - 198.5).abs() < 0.1, "{speed}");
        assert!(cutting_speed_m_min(0.0, 800.0).is_err() && cutting_speed_m_min(79.0, f64::NAN).is_err());
    }

    #[test]
    fn units_that_were_mistaken_are_named() {
        let cut = |power, wear| Cut {
            conditions: CutConditions::from_vector([wear, 200.0, 0.15, 1.0]),
            cutting_power_w: power,
        };
        assert!(cut(790.0, 195.0).conditions.list_problems()[0].to_string().contains("is it in um?"));
        assert!(unit_trouble(&[cut(0.79, 0.2)]).is_some_and(|text| text.contains("kW")));
        assert!(unit_trouble(&[cut(790_000.0, 0.2)]).is_some_and(|text| text.contains("mW")));
        assert_eq!(unit_trouble(&[cut(790.0, 0.2)]), None);
    }
}
