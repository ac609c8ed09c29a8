//! Units that were mistaken, recognised by the range in which a machine tool's numbers lie.

use super::refusal::{Refusal, RefusalKind};

/// Another unit in which the numbers may have been given: `value * scale + offset` is the number in the right one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mistake {
    /// Symbol of the other unit.
    pub unit: &'static str,
    /// Factor to the right unit.
    pub scale: f64,
    /// Added after the factor.
    pub offset: f64,
}

/// Where the middle of a quantity's magnitudes lies on a machine tool, and what it looks like in other units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plausible {
    /// Name of the quantity, for the message.
    pub quantity: &'static str,
    /// The unit that the numbers should have.
    pub unit: &'static str,
    /// Least and greatest credible median of the magnitudes, in that unit.
    pub range: (f64, f64),
    /// Units that people give instead.
    pub mistakes: &'static [Mistake],
}

const fn define_scale_mistake(unit: &'static str, scale: f64) -> Mistake {
    Mistake { unit, scale, offset: 0.0 }
}

impl Plausible {
    /// Power of a spindle drive: 5 W (a small spindle at rest) to 300 kW.
    pub const SPINDLE_POWER_W: Self = Self {
        quantity: "spindle power",
        unit: "W",
        range: (5.0, 3e5),
        mistakes: &[define_scale_mistake("kW", 1000.0), define_scale_mistake("mW", 1e-3)],
    };
    /// Spindle speed: 5 rpm to 200 000 rpm.
    pub const SPINDLE_SPEED_RPM: Self = Self {
        quantity: "spindle speed",
        unit: "rpm",
        range: (5.0, 2e5),
        mistakes: &[define_scale_mistake("1/s", 60.0), define_scale_mistake("rad/s", 60.0 / std::f64::consts::TAU)],
    };
    /// Feed: 0.5 mm/min to 60 m/min.
    pub const FEED_MM_MIN: Self = Self {
        quantity: "feed",
        unit: "mm/min",
        range: (0.5, 6e4),
        mistakes: &[define_scale_mistake("m/min", 1000.0), define_scale_mistake("um/min", 1e-3)],
    };
    /// Current of a spindle motor: 50 mA to 2 kA.
    pub const SPINDLE_CURRENT_A: Self = Self {
        quantity: "spindle current",
        unit: "A",
        range: (0.05, 2000.0),
        mistakes: &[define_scale_mistake("kA", 1000.0), define_scale_mistake("mA", 1e-3)],
    };
    /// Torque at the spindle: 0.02 N·m to 20 kN·m.
    pub const TORQUE_NM: Self = Self {
        quantity: "spindle torque",
        unit: "N·m",
        range: (0.02, 2e4),
        mistakes: &[define_scale_mistake("kN·m", 1000.0), define_scale_mistake("N·mm", 1e-3)],
    };
    /// Cutting force: 1 N to 200 kN.
    pub const CUTTING_FORCE_N: Self = Self {
        quantity: "cutting force",
        unit: "N",
        range: (1.0, 2e5),
        mistakes: &[define_scale_mistake("kN", 1000.0)],
    };
    /// Temperature on a machine: -20 °C to 150 °C.
    pub const TEMPERATURE_C: Self = Self {
        quantity: "temperature",
        unit: "°C",
        range: (0.0, 150.0),
        mistakes: &[Mistake { unit: "K", scale: 1.0, offset: -273.15 }],
    };

    /// Does the middle of the magnitudes lie where it should? Zeros do not count: a machine stands still most of the
    /// time.
    ///
    /// # Errors
    /// [`RefusalKind::Unit`], naming the unit that the numbers look like where there is one.
    pub fn check_values(&self, values: impl IntoIterator<Item = f64>) -> Result<(), Refusal> {
        let mut sizes: Vec<f64> = values.into_iter().map(f64::abs).filter(|size| *size > 0.0).collect();
        sizes.sort_by(f64::total_cmp);
        let Some(&middle) = sizes.get(sizes.len() / 2) else { return Ok(()) };
        if self.is_credible(middle) {
            return Ok(());
        }
        Err(self.build_refusal(middle))
    }

    fn is_credible(&self, middle: f64) -> bool {
        (self.range.0..=self.range.1).contains(&middle)
    }

    fn build_refusal(&self, middle: f64) -> Refusal {
        let Self { quantity, unit, range: (least, greatest), .. } = self;
        let meant = self.mistakes.iter().find(|other| self.is_credible(middle * other.scale + other.offset));
        let looks = meant.map_or_else(String::new, |other| format!("; it looks like {}", other.unit));
        let what =
            format!("the middle {quantity} is {middle:.6} {unit}, credible is {least} to {greatest} {unit}{looks}");
        Refusal::new(RefusalKind::Unit, what, format!("give {quantity} in {unit}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kilowatts_and_kelvins_are_recognised() {
        let told = |plausible: Plausible, values: &[f64]| plausible.check_values(values.iter().copied());
        let kilowatts = told(Plausible::SPINDLE_POWER_W, &[0.0, 0.5, 0.6, 1.4]).expect_err("kW").to_string();
        assert!(kilowatts.contains("looks like kW"), "{kilowatts}");
        let kelvins = told(Plausible::TEMPERATURE_C, &[293.0, 300.0]).expect_err("K").to_string();
        assert!(kelvins.contains("looks like K"), "{kelvins}");
        assert_eq!(told(Plausible::SPINDLE_POWER_W, &[0.0, 500.0, -20.0]), Ok(()));
        assert_eq!(told(Plausible::SPINDLE_POWER_W, &[]), Ok(()));
        assert!(told(Plausible::SPINDLE_POWER_W, &[1e12]).is_err());
    }
}
