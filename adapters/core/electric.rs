//! Can this be a supply? What the values of one answer of a power meter say about each other.
//!
//! A meter that is read with the map of another one answers promptly and nothing fails: 0 W, 4e-35 V. Its voltage gives it away,
//! because a meter that measures anything hangs on a supply. So a voltage that no supply has costs everything in the same answer its
//! value, and so does an answer that is all zero for one poll. What is missing on one phase only, and powers that contradict each
//! other, cost themselves. No phase carries more active power than its voltage times its current, so that these three together are
//! a witness that a wrong map hardly passes. Nothing is corrected.
//!
//! Limits: low-voltage supplies of the world are 100 to 400 V against neutral (IEC 60038), with 20 % on either side; 45 to
//! 65 Hz holds 50 and 60 Hz with 10 %. Powers of phases and their sum are refreshed one after the other by some meters; only what stays
//! apart for `LASTS` answers counts, once they have agreed: before that a contradiction counts at once, because it is the profile that
//! is not proven yet.

use crate::driver::SourceProblem;

/// A phase against neutral, V.
const PHASE_V: (f64, f64) = (80.0, 480.0);
/// Between two phases, V.
const LINE_V: (f64, f64) = (138.0, 831.0);
/// Of the supply, Hz.
const SUPPLY_HZ: (f64, f64) = (45.0, 65.0);
/// Powers of the phases and their sum may be apart by this share, and by so many watts.
const APART: (f64, f64) = (0.1, 20.0);
/// Apparent power below this share of voltage times current is that of a part of the phases.
const PART: f64 = 0.5;
/// Below this apparent power, VA, a power factor is noise.
const LOADED_VA: f64 = 100.0;
/// So many answers in a row.
const LASTS: u32 = 2;

/// What one answer of a meter says, in W, A, V, Hz and VA; what it does not measure is `None`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SupplyValues {
    /// Of all phases together.
    pub power: Option<f64>,
    /// Active power of each phase, W.
    pub phase_power: [Option<f64>; 3],
    /// Current of each phase, A.
    pub current: [Option<f64>; 3],
    /// Of each phase against neutral.
    pub voltage: [Option<f64>; 3],
    /// Between two phases, V.
    pub line_voltage: Option<f64>,
    /// Frequency of the supply, Hz.
    pub frequency: Option<f64>,
    /// Of all phases together.
    pub power_factor: Option<f64>,
    /// Of all phases together.
    pub apparent_power: Option<f64>,
}

/// What is not believed of an answer.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Doubts {
    /// No value of the answer is believed.
    pub everything: bool,
    /// The voltage of the supply.
    pub voltage: bool,
    /// Powers of every kind and the power factor.
    pub power: bool,
    /// The power factor alone.
    pub power_factor: bool,
    /// The frequency of the supply.
    pub frequency: bool,
    /// Why something is not believed; empty when nothing is doubted.
    pub problems: Vec<SourceProblem>,
}

/// Looks at the answers of one meter.
#[derive(Debug, Clone, Copy, Default)]
pub struct SupplyCheck {
    /// Answers in a row in which the phases do not make the sum.
    sum_apart: u32,
    /// Answers in a row with less apparent than active power.
    less_apparent: u32,
    /// Answers in a row with more active power than voltage times current.
    above_product: u32,
    /// Have the powers of an answer agreed with each other and with voltage and current?
    has_agreed: bool,
}

const WRONG_MAP: &str = "Compare with the meter's own display: is this the profile of this very model, with its word order? doctor --all tries \
                         the shipped profiles";

fn is_within_range(number: f64, (least, greatest): (f64, f64)) -> bool {
    number >= least && number <= greatest
}

impl SupplyCheck {
    /// What is not believed of this answer.
    pub fn judge_values(&mut self, values: &SupplyValues) -> Doubts {
        let mut doubts = Doubts::default();
        judge_voltages(values, &mut doubts);
        // Without a supply there is nothing that powers could contradict.
        if !doubts.everything {
            self.judge_powers(values, &mut doubts);
        }
        if let Some(hz) = values.frequency.filter(|hz| !is_within_range(*hz, SUPPLY_HZ)) {
            let what = format!("wrong profile? The meter says {hz:.4e} Hz, which is no frequency of a supply");
            // With voltages of a supply beside it, it is this register alone.
            let alone = values.voltage.iter().any(Option::is_some) || values.line_voltage.is_some();
            doubts.add(what, WRONG_MAP, |doubts| {
                (doubts.frequency, doubts.everything) = (true, doubts.everything || !alone)
            });
        }
        judge_zeros(values, &mut doubts);
        // Before anything has agreed it is the map that is not proven: what contradicts it costs all that was read with it.
        doubts.everything |= !self.has_agreed && (doubts.power || doubts.frequency || doubts.power_factor);
        doubts
    }

    fn judge_powers(&mut self, values: &SupplyValues, doubts: &mut Doubts) {
        let phases: Vec<f64> = values.phase_power.iter().flatten().copied().collect();
        let sum: f64 = phases.iter().sum();
        let apart = |total: f64| {
            let size = phases.iter().map(|power| power.abs()).sum::<f64>().max(total.abs());
            (total - sum).abs() > APART.0 * size + APART.1
        };
        let is_apart = values.power.is_some_and(|total| phases.len() == 3 && apart(total));
        self.sum_apart = if is_apart { self.sum_apart + 1 } else { 0 };
        let product = sum_voltage_times_current(values);
        let above = |(product, power): (f64, f64)| power.abs() > product * (1.0 + APART.0) + APART.1;
        let most = values.power.map(f64::abs).into_iter().chain([phases.iter().map(|power| power.abs()).sum()]);
        // With the current of one phase only, it may be the power of three.
        let whole = product.filter(|_| values.current.iter().all(Option::is_some));
        let is_above = whole.zip(most.reduce(f64::max)).is_some_and(above);
        self.above_product = if is_above { self.above_product + 1 } else { 0 };
        // A third of it is one phase; vector and arithmetic sums of a real load differ by much less than half.
        let part = |(apparent, product): (f64, f64)| apparent < PART * product - 2.0 * APART.1;
        let is_part = values.apparent_power.zip(product).is_some_and(part);
        let less = |(apparent, power): (f64, f64)| apparent < power.abs() * (1.0 - APART.0) - APART.1;
        let is_less = values.apparent_power.zip(values.power).is_some_and(less);
        self.less_apparent = if is_less { self.less_apparent + 1 } else { 0 };
        if is_part && !self.has_agreed {
            let what = format!(
                "wrong profile? The meter says {:.0} VA, and voltage times current of the phases make {:.0} VA",
                values.apparent_power.unwrap_or(0.0),
                product.unwrap_or(0.0)
            );
            doubts.add(what, WRONG_MAP, |doubts| doubts.power = true);
        }
        self.has_agreed |=
            !is_apart && !is_less && !is_above && !is_part && values.power.is_some_and(|power| power.abs() > APART.1);
        let lasts = if self.has_agreed { LASTS } else { 1 };
        if self.above_product >= lasts {
            let what = format!(
                "wrong profile? Voltage times current of the phases make {:.0} VA, and the meter says {:.0} W, which cannot be more",
                product.unwrap_or(0.0),
                values.power.unwrap_or(sum)
            );
            doubts.add(what, WRONG_MAP, |doubts| doubts.power = true);
        }
        if self.sum_apart >= lasts {
            let what = format!(
                "wrong profile? The powers of the phases make {sum:.0} W, and the meter says {:.0} W",
                values.power.unwrap_or(0.0)
            );
            doubts.add(what, WRONG_MAP, |doubts| doubts.power = true);
        }
        if self.less_apparent >= lasts {
            let (apparent, power) = (values.apparent_power.unwrap_or(0.0), values.power.unwrap_or(0.0));
            let what = format!(
                "the meter says {apparent:.0} VA of apparent power and {power:.0} W of active power, which cannot be more"
            );
            doubts.add(what, WRONG_MAP, |doubts| doubts.power = true);
        }
        judge_power_factor(values, product, doubts);
    }
}

/// A power factor is at most 1, and at least active power over voltage times current: that of the fundamental wave is higher than that of
/// the whole.
fn judge_power_factor(values: &SupplyValues, product: Option<f64>, doubts: &mut Doubts) {
    let Some(factor) = values.power_factor else { return };
    let least = product.zip(values.power).filter(|(product, _)| *product > LOADED_VA);
    let least = least.map_or(0.0, |(product, power)| power.abs() / product);
    // More than voltage times current is another contradiction, which is judged by itself.
    if factor.abs() < least - APART.0 && least <= 1.0 + APART.0 {
        let what = format!(
            "wrong profile? The meter says a power factor of {factor:.4e}; its powers make at least {least:.2}"
        );
        doubts.add(what, WRONG_MAP, |doubts| doubts.power_factor = true);
    }
    if factor.abs() > 1.001 {
        let what = format!("the meter says a power factor of {factor:.4e}, which cannot be more than 1");
        doubts.add(what, WRONG_MAP, |doubts| doubts.power = true);
    }
}

/// Apparent power of the phases that voltage and current tell, VA; `None` unless every phase with a current has a voltage too.
fn sum_voltage_times_current(values: &SupplyValues) -> Option<f64> {
    // Between phases stands for each of them against neutral.
    let of_line = values.line_voltage.map(|volts| volts / 3.0_f64.sqrt());
    let known =
        values.current.iter().zip(values.voltage).filter_map(|(amps, volts)| Some(((*amps)?, volts.or(of_line))));
    let products: Option<Vec<f64>> = known.map(|(amps, volts)| Some((amps * volts?).abs())).collect();
    products.filter(|products| !products.is_empty()).map(|products| products.iter().sum())
}

fn judge_voltages(values: &SupplyValues, doubts: &mut Doubts) {
    let phases: Vec<(usize, f64)> = (1..).zip(values.voltage).filter_map(|(at, volts)| Some((at, volts?))).collect();
    let bad: Vec<&(usize, f64)> = phases.iter().filter(|(_, volts)| !is_within_range(*volts, PHASE_V)).collect();
    let line_bad = values.line_voltage.filter(|volts| !is_within_range(*volts, LINE_V));
    // A fuse that is gone takes voltage away: what no supply has reached is no phase of this meter.
    let too_high = bad.iter().any(|(_, volts)| *volts > PHASE_V.1);
    let good = bad.len() < phases.len() || (values.line_voltage.is_some() && line_bad.is_none());
    let some_good = good && !too_high;
    let told = |(at, volts): &(usize, f64)| format!("phase {at} {volts:.4e} V");
    let mut all: Vec<String> = bad.iter().map(|phase| told(phase)).collect();
    all.extend(line_bad.map(|volts| format!("between phases {volts:.4e} V")));
    if all.is_empty() {
        return;
    }
    let all = all.join(", ");
    if some_good {
        let next = "Look at the fuse and the voltage input of this phase; a meter on one phase needs a profile with one voltage";
        return doubts.add(format!("a phase has no voltage of a supply: {all}"), next, |doubts| doubts.voltage = true);
    }
    let what = format!("the meter shows no supply voltage ({all}), so nothing that it says is believed");
    let next = "Is the main switch off? Else the registers are those of another meter: choose its profile; doctor --all tries the \
                shipped ones";
    doubts.add(what, next, |doubts| doubts.everything = true);
}

/// A meter without voltage and frequency that says nothing but zero: perhaps nothing flows.
fn judge_zeros(values: &SupplyValues, doubts: &mut Doubts) {
    let said = [values.power, values.power_factor, values.apparent_power];
    let mut said: Vec<f64> = said.into_iter().chain(values.phase_power).chain(values.current).flatten().collect();
    let witness = values.voltage.iter().any(Option::is_some) || values.line_voltage.or(values.frequency).is_some();
    said.retain(|number| *number != 0.0);
    let count =
        values.phase_power.iter().chain(&values.current).flatten().count() + usize::from(values.power.is_some());
    if !witness && said.is_empty() && count >= 2 {
        let next = "Nothing may flow; else compare with the meter's display, and read a voltage too, which would tell";
        doubts.add("the meter says nothing but zero".to_owned(), next, |_| {});
    }
}

impl Doubts {
    fn add(&mut self, what: String, next: &str, mark: impl FnOnce(&mut Self)) {
        mark(self);
        self.problems.push(SourceProblem { what, next: next.to_owned() });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn well() -> SupplyValues {
        SupplyValues {
            power: Some(3000.0),
            phase_power: [Some(1000.0); 3],
            current: [Some(5.0); 3],
            voltage: [Some(230.0); 3],
            line_voltage: None,
            frequency: Some(50.0),
            power_factor: Some(0.9),
            apparent_power: Some(3300.0),
        }
    }

    #[test]
    fn a_meter_that_measures_is_believed() {
        let mut check = SupplyCheck::default();
        for values in [
            well(),
            SupplyValues { current: [Some(0.0); 3], power: Some(0.0), phase_power: [Some(0.0); 3], ..well() },
            SupplyValues { power: Some(-3000.0), phase_power: [Some(-1000.0); 3], power_factor: Some(-0.9), ..well() },
            SupplyValues { power: Some(4000.0), ..SupplyValues::default() },
            SupplyValues { voltage: [Some(120.0); 3], ..well() },
            SupplyValues { voltage: [None; 3], line_voltage: Some(400.0), ..well() },
        ] {
            assert_eq!(check.judge_values(&values), Doubts::default(), "{values:?}");
        }
    }

    #[test]
    fn what_no_supply_has_costs_everything() {
        for volts in [0.0, 4e-35, 2.3, 23_000.0, -230.0] {
            let doubts = SupplyCheck::default().judge_values(&SupplyValues { voltage: [Some(volts); 3], ..well() });
            assert!(doubts.everything && doubts.problems.len() == 1, "{volts}: {doubts:?}");
        }
        // A meter that does not see the voltage of a phase does not see its power either.
        let without_phase = SupplyValues {
            voltage: [Some(230.0), Some(0.0), Some(230.0)],
            power: Some(2000.0),
            phase_power: [Some(1000.0), Some(0.0), Some(1000.0)],
            apparent_power: Some(2200.0),
            ..well()
        };
        let one = SupplyCheck::default().judge_values(&without_phase);
        assert!(!one.everything && one.voltage && one.problems[0].what.contains("phase 2"), "{one:?}");
        let too_high = SupplyValues { voltage: [Some(510.0), Some(0.0), Some(230.0)], ..without_phase };
        assert!(SupplyCheck::default().judge_values(&too_high).everything, "no fuse makes 510 V");
    }

    #[test]
    fn a_power_factor_below_what_the_powers_make_is_not_believed() {
        let mut check = SupplyCheck::default();
        let zero = SupplyValues { power_factor: Some(0.0), ..well() };
        let doubts = check.judge_values(&zero);
        assert!(doubts.power_factor && !doubts.power && !doubts.everything, "the powers agree: {doubts:?}");
        let idle = SupplyValues { power: Some(15.0), phase_power: [Some(5.0); 3], current: [Some(0.1); 3], ..zero };
        assert_eq!(check.judge_values(&idle), Doubts::default(), "without a load it says nothing");
    }

    #[test]
    fn before_anything_has_agreed_a_contradiction_costs_everything() {
        let mut check = SupplyCheck::default();
        let wrong = SupplyValues { power: Some(9000.0), ..well() };
        assert!(check.judge_values(&wrong).everything);
        assert!(!check.judge_values(&well()).everything);
        check.judge_values(&wrong);
        let later = check.judge_values(&wrong);
        assert!(later.power && !later.everything, "the map is proven: {later:?}");
    }

    #[test]
    fn powers_that_contradict_each_other_are_not_believed_when_they_stay_apart() {
        let wrong = SupplyValues { power: Some(9000.0), ..well() };
        let mut check = SupplyCheck::default();
        assert!(check.judge_values(&wrong).power, "before the profile has proven itself, at once");
        assert!(!check.judge_values(&well()).power);
        assert!(!check.judge_values(&wrong).power, "a meter may refresh them one after the other");
        assert!(check.judge_values(&wrong).power);
        assert!(!check.judge_values(&well()).power);
        let apparent = SupplyValues { apparent_power: Some(1000.0), ..well() };
        check.judge_values(&apparent);
        assert!(check.judge_values(&apparent).power);
        assert!(check.judge_values(&SupplyValues { power_factor: Some(90.0), ..well() }).power);
        assert!(check.judge_values(&SupplyValues { frequency: Some(0.05), ..well() }).frequency);
    }

    #[test]
    fn no_more_power_is_believed_than_voltage_and_current_make() {
        // A map in which the third phase is the total: 2500 W, and U times I of the three makes 1525 VA.
        let total_as_phase = SupplyValues {
            phase_power: [Some(500.0), Some(500.0), Some(1500.0)],
            current: [Some(2.2); 3],
            voltage: [Some(230.0), Some(231.0), Some(232.0)],
            ..SupplyValues::default()
        };
        let doubts = SupplyCheck::default().judge_values(&total_as_phase);
        assert!(doubts.power && doubts.problems[0].what.contains("1525 VA"), "{doubts:?}");
        let ten_times =
            SupplyValues { power: Some(15_000.0), phase_power: [None; 3], current: [Some(2.2); 3], ..well() };
        assert!(SupplyCheck::default().judge_values(&ten_times).power);
        let between_phases = SupplyValues { voltage: [None; 3], line_voltage: Some(400.0), ..ten_times };
        assert!(SupplyCheck::default().judge_values(&between_phases).power);
        let no_voltage = SupplyValues { power: Some(1500.0), frequency: Some(3.0), ..SupplyValues::default() };
        assert!(SupplyCheck::default().judge_values(&no_voltage).everything);
    }

    #[test]
    fn nothing_but_zero_is_told() {
        let zero = SupplyValues { power: Some(0.0), current: [Some(0.0); 3], ..SupplyValues::default() };
        let doubts = SupplyCheck::default().judge_values(&zero);
        assert!(!doubts.everything && doubts.problems.len() == 1, "{doubts:?}");
    }
}
