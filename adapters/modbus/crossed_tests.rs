//! Every profile on the register map of every other one, and meters that refuse for a while. A power is right or absent.

use super::line::{ModbusError, ModbusLine, ModbusResponse};
use super::number::Format;
use super::outputs::{self, MeterChannel};
use super::pdu;
use super::plan::PollBlocks;
use super::poll::RegisterPoll;
use super::profile::{Profile, SHIPPED, find_profile};
use super::register::{MeterRegister, RegisterMeaning};
use adapter_core::address::Circuit;
use adapter_core::clock::{Clock, ManualClock, SECOND_NS};
use adapter_core::electric::SupplyCheck;
use adapter_core::energy_count::{CounterEvent, EnergyCount};
use adapter_core::reading::{Absence, Stamp};
use std::collections::BTreeMap;
use std::time::Duration;

/// A meter whose registers hold what another map says; others are refused, or 0.
struct Image {
    registers: BTreeMap<u16, u16>,
    others_are_zero: bool,
    refused: Vec<u16>,
}

const VOLTS: [f64; 3] = [229.0, 230.5, 232.0];
const AMPS: [f64; 3] = [2.1, 2.4, 2.2];
const WATTS: [f64; 3] = [430.0, 510.0, 470.0];
const TOTAL_W: f64 = 1410.0;

fn true_number(meaning: RegisterMeaning) -> f64 {
    match meaning {
        RegisterMeaning::Power => TOTAL_W,
        RegisterMeaning::PhasePower(at) => WATTS[at],
        RegisterMeaning::Current(at) => AMPS[at],
        RegisterMeaning::Voltage(at) => VOLTS[at],
        RegisterMeaning::LineVoltage => 399.0,
        RegisterMeaning::Energy => 1234.5,
        RegisterMeaning::PowerFactor => 0.91,
        RegisterMeaning::ApparentPower => 1550.0,
        RegisterMeaning::Frequency => 50.0,
        RegisterMeaning::Channel(_) => 41.5,
    }
}

impl Image {
    fn from_profile(profile: &Profile, others_are_zero: bool) -> Self {
        let mut registers = BTreeMap::new();
        for register in &profile.registers {
            let number = true_number(register.meaning);
            let raw = (number - register.conversion.offset) / register.conversion.scale;
            registers.extend((register.address..).zip(register.format.encode(raw, register.order)));
        }
        Self { registers, others_are_zero, refused: Vec::new() }
    }
}

impl ModbusLine for Image {
    fn exchange_pdu(
        &mut self,
        clock: &dyn Clock,
        _: u8,
        request: &[u8],
        _: usize,
    ) -> Result<ModbusResponse, ModbusError> {
        let block = pdu::parse_request(request).map_err(ModbusError::Refused)?;
        let asked = block.start..block.start.saturating_add(block.count);
        if self.refused.iter().any(|address| asked.contains(address)) {
            return Err(ModbusError::Refused(2));
        }
        let other = self.others_are_zero.then_some(0);
        let found: Option<Vec<u16>> = asked.map(|address| self.registers.get(&address).copied().or(other)).collect();
        let registers = found.ok_or(ModbusError::Refused(2))?;
        let stamp = Stamp::from_exact_time(clock.now_ns());
        Ok(ModbusResponse { pdu: pdu::encode_answer(block.table, &registers), stamp })
    }

    fn deadline(&self) -> Duration {
        Duration::from_secs(1)
    }

    fn late_answers(&self) -> u64 {
        0
    }
}

struct Reader {
    count: Option<EnergyCount>,
    profile: Profile,
    registers: Vec<MeterRegister>,
    outputs: Vec<MeterChannel>,
    poll: RegisterPoll,
    check: SupplyCheck,
}

impl Reader {
    fn new(profile: &Profile) -> Self {
        let blocks = PollBlocks::from_registers(&profile.registers, profile.block_max, profile.block_gap);
        Self {
            count: outputs::find_energy_count(&profile.registers),
            profile: profile.clone(),
            registers: profile.registers.clone(),
            outputs: outputs::list_channels(profile, Circuit::Machine).expect("channels"),
            poll: RegisterPoll::new(blocks.expect("blocks")),
            check: SupplyCheck::default(),
        }
    }

    /// Every channel of the machine, in its unit; none where nothing was answered.
    fn read_all(&mut self, line: &mut Image, clock: &dyn Clock) -> Vec<ChannelResult> {
        if self.poll.read(line, clock, 1).is_err() {
            return Vec::new();
        }
        let doubts = outputs::judge_answer(&mut self.check, &self.profile, &self.registers, &self.poll);
        let (registers, poll, count) = (&self.registers, &self.poll, &mut self.count);
        let read = |output: &MeterChannel| {
            let value = output.build_counted_reading(registers, poll, &doubts, count.as_mut()).value;
            let value = value.map(|value| value.as_number().unwrap_or(f64::NAN));
            ChannelResult { name: output.channel.name(), value }
        };
        self.outputs.iter().map(read).collect()
    }

    /// The power of the machine, W.
    fn read_power(&mut self, line: &mut Image, clock: &dyn Clock) -> Result<f64, Absence> {
        let all = self.read_all(line, clock);
        all.into_iter().find(|one| one.name == "total_power_w").map_or(Err(Absence::NotProvided), |one| one.value)
    }
}

/// What one poll says of a channel.
struct ChannelResult {
    name: &'static str,
    value: Result<f64, Absence>,
}

/// What the meter of the images measures; `None` for temperatures, which no electrical witness can prove.
fn find_truth(name: &str) -> Option<f64> {
    match name {
        "total_power_w" => Some(TOTAL_W),
        "total_energy_kwh" => Some(1234.5),
        "total_power_factor" => Some(0.91),
        "total_apparent_power_va" => Some(1550.0),
        "supply_frequency_hz" => Some(50.0),
        "supply_voltage_v" => Some(399.1),
        _ => None,
    }
}

/// Every shipped profile (the second) on the map of every other one and its own (the first), with other registers refused and zero.
fn visit_crossed_profiles(mut visit: impl FnMut(&Profile, &Profile, Image)) {
    let profiles: Vec<Profile> =
        SHIPPED.iter().map(|(name, _)| find_profile(name, None).unwrap_or_else(|error| panic!("{error}"))).collect();
    for of_meter in &profiles {
        for of_address in &profiles {
            for others_are_zero in [false, true] {
                visit(of_meter, of_address, Image::from_profile(of_meter, others_are_zero));
            }
        }
    }
}

#[test]
fn a_profile_on_another_map_is_right_or_absent() {
    let clock = ManualClock::with_time(0);
    let (mut right, mut absent, mut wrong) = (0, 0, Vec::new());
    visit_crossed_profiles(|of_meter, of_address, mut line| {
        let mut reader = Reader::new(of_address);
        for _ in 0..3 {
            match reader.read_power(&mut line, &clock) {
                Ok(power) if (power - TOTAL_W).abs() <= 0.02 * TOTAL_W => right += 1,
                Ok(power) => wrong.push(format!("{} on {}: {power} W", of_address.name, of_meter.name)),
                Err(_) if of_meter.name == of_address.name && of_meter.name != "temperature8" => {
                    wrong.push(format!("{} on its own map has no power", of_meter.name));
                }
                Err(_) => absent += 1,
            }
        }
    });
    eprintln!("{right} right, {absent} absent, {} wrong", wrong.len());
    assert_eq!(wrong, Vec::<String>::new(), "{right} right, {absent} absent");
    assert!(right >= 48 && absent >= 300, "{right} right, {absent} absent");
}

#[test]
fn every_channel_of_a_profile_on_another_map_is_right_or_absent() {
    let clock = ManualClock::with_time(0);
    let (mut right, mut absent, mut wrong) = (0, 0, Vec::new());
    visit_crossed_profiles(|of_meter, of_address, mut line| {
        for one in Reader::new(of_address).read_all(&mut line, &clock) {
            match (find_truth(one.name), one.value) {
                (Some(truth), Ok(value)) if (value - truth).abs() <= 0.02 * truth => right += 1,
                (Some(_), Ok(value)) => {
                    wrong.push(format!("{} on {}: {} {value}", of_address.name, of_meter.name, one.name));
                }
                (_, Err(_)) => absent += 1,
                (None, Ok(_)) => {}
            }
        }
    });
    eprintln!("{right} right, {absent} absent, {} wrong", wrong.len());
    assert_eq!(wrong, Vec::<String>::new(), "{right} right, {absent} absent");
    assert!(right >= 190 && absent >= 1400, "{right} right, {absent} absent");
}

#[test]
fn what_a_meter_refuses_while_it_starts_is_asked_for_again() {
    let clock = ManualClock::with_time(0);
    let profile = find_profile("sdm630", None).expect("shipped");
    let mut line = Image::from_profile(&profile, true);
    line.refused = vec![52];
    let mut reader = Reader::new(&profile);
    for second in 0..120 {
        clock.set_time(second * SECOND_NS);
        if second == 4 {
            line.refused.clear();
        }
        let power = reader.read_power(&mut line, &clock);
        match second {
            0..60 => assert_eq!(power, Err(Absence::NotSupported), "{second} s"),
            _ => assert!(power.is_ok_and(|power| (power - TOTAL_W).abs() < 1.0), "{second} s: {power:?}"),
        }
    }
}

/// Every profile with an energy register, and one for each further form of a counter.
fn list_counting_profiles() -> Vec<Profile> {
    let shipped = SHIPPED.iter().map(|(name, _)| find_profile(name, None).unwrap_or_else(|error| panic!("{error}")));
    let is_energy = |register: &MeterRegister| register.meaning == RegisterMeaning::Energy;
    let mut counting: Vec<Profile> = shipped.filter(|profile| profile.registers.iter().any(is_energy)).collect();
    let first = counting[0].clone();
    for format in [Format::U16, Format::Sm16, Format::Sm32, Format::U32, Format::F64] {
        let mut own = first.clone();
        own.name = format!("{} with {format:?}", first.name);
        let register = own.registers.iter_mut().find(|register| is_energy(register)).expect("energy");
        (register.format, register.conversion.scale) = (format, 0.1);
        counting.push(own);
    }
    counting
}

/// What the counter of a meter shows at one second: a count, or what stands there instead.
#[derive(Debug, Clone, Copy, PartialEq)]
enum ShownCount {
    Count(f64),
    Zero,
    BelowZero,
}

#[test]
fn every_counter_of_energy_is_right_or_absent_through_rollover_reset_zero_and_underflow() {
    let (mut right, mut absent, mut wrong, mut profiles) = (0, 0, Vec::new(), 0);
    for profile in list_counting_profiles() {
        profiles += 1;
        let register =
            profile.registers.iter().find(|register| register.meaning == RegisterMeaning::Energy).expect("energy");
        let bits = register.format.find_counter_bits();
        let step_kwh = register.conversion.scale;
        // Counts that never lie at the end of a register of 2^15 steps, and a single step of a counter every second.
        let tick_kwh = step_kwh.clamp(0.01, 0.1);
        let mut line = Image::from_profile(&profile, true);
        let (mut reader, clock) = (Reader::new(&profile), ManualClock::with_time(0));
        let (mut true_kwh, mut consumed_kwh) = (1000.0 * tick_kwh + 50.0, 0.0);
        for second in 0_i64..200 {
            clock.set_time(second * SECOND_NS);
            if second > 0 {
                (true_kwh, consumed_kwh) = (true_kwh + tick_kwh, consumed_kwh + tick_kwh);
            }
            if second == 120 {
                // Somebody resets the meter.
                true_kwh = tick_kwh;
            }
            let shown = match second {
                30 | 60 => ShownCount::Zero,
                80..90 if bits.is_some_and(|(_, is_unsigned)| is_unsigned) => ShownCount::BelowZero,
                _ => ShownCount::Count(true_kwh),
            };
            let raw = match shown {
                ShownCount::Count(kwh) => kwh / step_kwh,
                ShownCount::Zero => 0.0,
                ShownCount::BelowZero => 2_f64.powi(bits.expect("a whole number").0) - 3.0,
            };
            line.registers.extend((register.address..).zip(register.format.encode(raw, register.order)));
            let all = reader.read_all(&mut line, &clock);
            let value = all.into_iter().find(|one| one.name == "total_energy_kwh").expect("a channel").value;
            match value {
                Ok(kwh) if (kwh - true_kwh).abs() <= step_kwh.max(0.01) => right += 1,
                Ok(kwh) => wrong.push(format!("{} at {second} s: {kwh} kWh for {true_kwh}", profile.name)),
                Err(_) => absent += 1,
            }
        }
        let count = reader.count.expect("a counter");
        let told = |event| count.count_events(event);
        let underflows = u32::from(bits.is_some_and(|(_, is_unsigned)| is_unsigned));
        let found = (told(CounterEvent::Zero), told(CounterEvent::Reset), told(CounterEvent::BelowZero));
        assert_eq!(found, (2, 1, underflows), "{}", profile.name);
        assert!(
            (count.consumed_kwh() - consumed_kwh).abs() <= 3.0 * tick_kwh.max(step_kwh),
            "{}: {} of {consumed_kwh} kWh",
            profile.name,
            count.consumed_kwh()
        );
    }
    println!("{profiles} profiles: {right} right, {absent} absent, {} wrong", wrong.len());
    assert_eq!(wrong, Vec::<String>::new(), "{right} right, {absent} absent");
    assert!(profiles >= 15 && right >= 180 * profiles, "{right} right, {absent} absent");
}

#[test]
fn every_counter_with_a_sign_goes_over_the_end_of_its_register() {
    let (mut right, mut absent, mut profiles) = (0, 0, 0);
    for profile in list_counting_profiles() {
        let register =
            profile.registers.iter().find(|register| register.meaning == RegisterMeaning::Energy).expect("energy");
        let Some((bits @ 1..=31, false)) = register.format.find_counter_bits() else { continue };
        profiles += 1;
        let step_kwh = register.conversion.scale;
        let mut line = Image::from_profile(&profile, true);
        let (mut reader, clock) = (Reader::new(&profile), ManualClock::with_time(0));
        for second in 0_i32..40 {
            clock.set_time(i64::from(second) * SECOND_NS);
            let raw = (2_f64.powi(bits) - 20.0 + f64::from(second)) % 2_f64.powi(bits);
            line.registers.extend((register.address..).zip(register.format.encode(raw, register.order)));
            let all = reader.read_all(&mut line, &clock);
            match all.into_iter().find(|one| one.name == "total_energy_kwh").expect("a channel").value {
                Ok(kwh) => {
                    assert!((kwh - raw * step_kwh).abs() < 1e-3, "{} at {second} s: {kwh} kWh", profile.name);
                    right += 1;
                }
                Err(_) => absent += 1,
            }
        }
        let count = reader.count.expect("a counter");
        assert_eq!(count.count_events(CounterEvent::Rollover), 1, "{}", profile.name);
        assert!(
            (count.consumed_kwh() - 39.0 * step_kwh).abs() < 1e-3,
            "{}: {} kWh",
            profile.name,
            count.consumed_kwh()
        );
    }
    println!("{profiles} profiles: {right} right, {absent} absent");
    assert!(profiles >= 6 && absent <= profiles, "{right} right, {absent} absent");
}
