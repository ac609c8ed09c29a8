//! From the registers of a meter to channels, and to what they say about each other.

use super::error::MeterError;
use super::poll::RegisterPoll;
use super::profile::Profile;
use super::register::{MeterRegister, RegisterMeaning};
use crate::address::MeterTarget;
use adapter_core::address::Circuit;
use adapter_core::channel::ChannelId;
use adapter_core::driver::SourceProblem;
use adapter_core::electric::{Doubts, SupplyCheck, SupplyValues};
use adapter_core::energy_count::{CounterForm, EnergyCount};
use adapter_core::integer::count_to_f64;
use adapter_core::reading::{Reading, Value};

/// How the registers of an output are put together.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Law {
    Sum,
    Mean,
    /// Mean of the phases against neutral, times the square root of three.
    BetweenPhases,
}

/// What a doubt about the answer costs an output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Believed {
    /// Nothing: it is no electrical quantity.
    Always,
    /// Its value, while all of the answer is in doubt.
    WithAll,
    /// Nothing beside it proves a counter: while anything tells against the map, it is not believed either.
    AsEnergy,
    AsPower,
    AsPowerFactor,
    /// As the voltage of the supply.
    AsVoltage,
    AsFrequency,
}

/// A channel and the registers that it comes from.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct MeterChannel {
    pub(super) channel: ChannelId,
    law: Law,
    believed: Believed,
    /// Places in the list of registers.
    parts: Vec<usize>,
}

impl Law {
    fn combine_numbers(self, numbers: &[f64]) -> f64 {
        let sum: f64 = numbers.iter().sum();
        let count = count_to_f64(numbers.len()).max(1.0);
        match self {
            Self::Sum => sum,
            Self::Mean => sum / count,
            Self::BetweenPhases => 3.0_f64.sqrt() * sum / count,
        }
    }
}

impl Believed {
    fn is_doubted(self, doubts: &Doubts) -> bool {
        match self {
            Self::Always => false,
            Self::WithAll => doubts.everything,
            Self::AsEnergy => doubts.everything || doubts.power || doubts.power_factor || doubts.frequency,
            Self::AsPowerFactor => doubts.everything || doubts.power || doubts.power_factor,
            Self::AsPower => doubts.everything || doubts.power,
            Self::AsVoltage => doubts.everything || doubts.voltage,
            Self::AsFrequency => doubts.everything || doubts.frequency,
        }
    }
}

/// Share of a number by which neighbours of single precision lie apart.
const SINGLE_PRECISION: f64 = 1.2e-7;

/// The counter of a profile, where it has one.
pub(super) fn find_energy_count(registers: &[MeterRegister]) -> Option<EnergyCount> {
    let register = registers.iter().find(|register| register.meaning == RegisterMeaning::Energy)?;
    let step_kwh = register.conversion.scale.abs();
    let form = match register.format.find_counter_bits() {
        Some((bits, is_unsigned)) => {
            CounterForm { wraps_at_kwh: Some(2_f64.powi(bits) * step_kwh), is_unsigned, resolution: (0.0, step_kwh) }
        }
        None => {
            CounterForm { wraps_at_kwh: None, is_unsigned: false, resolution: (SINGLE_PRECISION, step_kwh.min(0.01)) }
        }
    };
    Some(EnergyCount::new(form))
}

impl MeterChannel {
    /// The same, where a counter of energy is also held against its last count.
    pub(super) fn build_counted_reading(
        &self,
        registers: &[MeterRegister],
        poll: &RegisterPoll,
        doubts: &Doubts,
        count: Option<&mut EnergyCount>,
    ) -> Reading {
        let reading = self.build_reading(registers, poll, doubts);
        let counted = count.filter(|_| self.believed == Believed::AsEnergy);
        let number = reading.value.as_ref().ok().and_then(Value::as_number);
        let is_believed = counted.zip(number).map(|(count, number)| count.judge_count(reading.stamp.mid_ns, number));
        match (is_believed, number) {
            (Some(false), Some(number)) => Reading::from_implausible(self.channel, reading.stamp, number),
            _ => reading,
        }
    }

    /// What the last poll says of it.
    pub(super) fn build_reading(&self, registers: &[MeterRegister], poll: &RegisterPoll, doubts: &Doubts) -> Reading {
        let mut numbers = Vec::with_capacity(3);
        let mut at = None;
        for register in self.parts.iter().filter_map(|part| registers.get(*part)) {
            match poll.find_number(register) {
                Ok((number, stamp)) => {
                    at = Some(stamp);
                    numbers.push(number);
                }
                Err((reason, stamp)) => return Reading::from_absence(self.channel, stamp, reason),
            }
        }
        let stamp = at.unwrap_or_else(|| poll.list_all_registers().1);
        let number = self.law.combine_numbers(&numbers);
        if self.believed.is_doubted(doubts) {
            return Reading::from_implausible(self.channel, stamp, number);
        }
        Reading::from_number(self.channel, stamp, number)
    }
}

/// The registers of a profile with the transformers in them that the meter does not count in.
///
/// # Errors
/// Transformers were given for a meter that counts them in.
pub(super) fn list_registers(profile: &Profile, meter: &MeterTarget) -> Result<Vec<MeterRegister>, MeterError> {
    let given = (meter.ct - 1.0).abs() > 1e-12 || (meter.pt - 1.0).abs() > 1e-12;
    if given && !profile.secondary {
        return Err(MeterError::TransformersCounted { meter: profile.meter.clone() });
    }
    let ratio = |quantity| match quantity {
        RegisterMeaning::Power
        | RegisterMeaning::PhasePower(_)
        | RegisterMeaning::Energy
        | RegisterMeaning::ApparentPower => meter.ct * meter.pt,
        RegisterMeaning::Current(_) => meter.ct,
        RegisterMeaning::Voltage(_) | RegisterMeaning::LineVoltage => meter.pt,
        RegisterMeaning::PowerFactor | RegisterMeaning::Frequency | RegisterMeaning::Channel(_) => 1.0,
    };
    let scaled = |register: &MeterRegister| {
        let mut register = register.clone();
        register.conversion.scale *= ratio(register.meaning);
        register
    };
    Ok(profile.registers.iter().map(scaled).collect())
}

/// The channels of a profile.
///
/// # Errors
/// It gives none, or one twice.
pub(super) fn list_channels(profile: &Profile, circuit: Circuit) -> Result<Vec<MeterChannel>, MeterError> {
    let all = |wanted: &dyn Fn(RegisterMeaning) -> bool| -> Vec<usize> {
        let each = profile.registers.iter().enumerate();
        each.filter(|(_, register)| wanted(register.meaning)).map(|(at, _)| at).collect()
    };
    let one = |wanted: RegisterMeaning| all(&|quantity| quantity == wanted);
    let (total, line) = (one(RegisterMeaning::Power), one(RegisterMeaning::LineVoltage));
    let phases = all(&|quantity| matches!(quantity, RegisterMeaning::PhasePower(_)));
    let currents = all(&|quantity| matches!(quantity, RegisterMeaning::Current(_)));
    let voltages = all(&|quantity| matches!(quantity, RegisterMeaning::Voltage(_)));
    let place = if circuit == Circuit::Spindle { "spindle" } else { "total" };
    let mut outputs = Vec::new();
    let mut add = |name: &str, law, believed, parts: Vec<usize>| {
        if let Some(channel) = ChannelId::from_name(name).filter(|_| !parts.is_empty()) {
            outputs.push(MeterChannel { channel, law, believed, parts });
        }
    };
    let power = if total.is_empty() { phases } else { total };
    add(&format!("{place}_power_w"), Law::Sum, Believed::AsPower, power);
    if circuit == Circuit::Spindle {
        add("spindle_current_a", Law::Mean, Believed::WithAll, currents);
    }
    let (law, voltages) = if line.is_empty() { (Law::BetweenPhases, voltages) } else { (Law::Mean, line) };
    add("supply_voltage_v", law, Believed::AsVoltage, voltages);
    for (name, believed, meaning) in [
        (format!("{place}_energy_kwh"), Believed::AsEnergy, RegisterMeaning::Energy),
        (format!("{place}_power_factor"), Believed::AsPowerFactor, RegisterMeaning::PowerFactor),
        (format!("{place}_apparent_power_va"), Believed::AsPower, RegisterMeaning::ApparentPower),
        ("supply_frequency_hz".to_owned(), Believed::AsFrequency, RegisterMeaning::Frequency),
    ] {
        add(&name, Law::Mean, believed, one(meaning));
    }
    for (at, register) in profile.registers.iter().enumerate() {
        if let RegisterMeaning::Channel(channel) = register.meaning {
            let believed = if channel.channel().is_electric() { Believed::WithAll } else { Believed::Always };
            outputs.push(MeterChannel { channel, law: Law::Sum, believed, parts: vec![at] });
        }
    }
    let mut seen = Vec::new();
    for output in &outputs {
        if seen.contains(&output.channel) {
            return Err(MeterError::ChannelTwice { profile: profile.name.clone(), channel: output.channel });
        }
        seen.push(output.channel);
    }
    if outputs.is_empty() { Err(MeterError::NoChannel { profile: profile.name.clone() }) } else { Ok(outputs) }
}

/// What of the last answer is not believed.
pub(super) fn judge_answer(
    check: &mut SupplyCheck,
    profile: &Profile,
    registers: &[MeterRegister],
    poll: &RegisterPoll,
) -> Doubts {
    let mut doubts = check.judge_values(&collect_supply_values(registers, poll));
    doubt_missing_witnesses(profile, poll, &mut doubts);
    doubts
}

/// A map that nobody has confirmed is believed only with all of its witnesses: a meter that refuses one of them may be another one.
fn doubt_missing_witnesses(profile: &Profile, poll: &RegisterPoll, doubts: &mut Doubts) {
    let is_electric = |meaning| !matches!(meaning, RegisterMeaning::Channel(_) | RegisterMeaning::Energy);
    let mut electric = profile.registers.iter().filter(|register| is_electric(register.meaning));
    let Some(missing) = electric.find(|register| !poll.has_register(register)).filter(|_| !profile.confirmed) else {
        return;
    };
    (doubts.power, doubts.voltage) = (true, true);
    doubts.problems.push(SourceProblem {
        what: format!(
            "wrong profile? The map of {} is not confirmed, and this meter does not have its register {}: no power is believed",
            profile.meter, missing.address
        ),
        next: "Compare with the meter's own list of registers, and take the register out of a copy of the profile if the rest fits"
            .to_owned(),
    });
}

/// What the last poll says of the supply.
fn collect_supply_values(registers: &[MeterRegister], poll: &RegisterPoll) -> SupplyValues {
    let mut values = SupplyValues::default();
    for register in registers {
        let number = poll.find_number(register).ok().map(|(number, _)| number);
        let phase = |of: &mut [Option<f64>; 3], at: usize| {
            if let Some(place) = of.get_mut(at) {
                *place = number;
            }
        };
        match register.meaning {
            RegisterMeaning::Power => values.power = number,
            RegisterMeaning::PhasePower(at) => phase(&mut values.phase_power, at),
            RegisterMeaning::Current(at) => phase(&mut values.current, at),
            RegisterMeaning::Voltage(at) => phase(&mut values.voltage, at),
            RegisterMeaning::LineVoltage => values.line_voltage = number,
            RegisterMeaning::PowerFactor => values.power_factor = number,
            RegisterMeaning::ApparentPower => values.apparent_power = number,
            RegisterMeaning::Frequency => values.frequency = number,
            RegisterMeaning::Energy | RegisterMeaning::Channel(_) => {}
        }
    }
    values
}
