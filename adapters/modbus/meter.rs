//! A Modbus meter as a source.

use super::line::{ModbusError, ModbusLine};
use super::number::Format;
use super::pdu::{NoRegisters, RegisterBlock};
use super::plan::PollBlocks;
use super::profile::{MeterRegister, Profile, RegisterMeaning, find};
use super::refresh::Refresh;
use super::rtu::RtuLine;
use super::tcp::TcpLine;
use crate::address::{Address, Circuit, Endpoint, MeterTarget, SerialTarget};
use crate::channel::ChannelId;
use crate::clock::Clock;
use crate::driver::{Fact, Source, SourceError};
use crate::reading::{Absence, Reading, Stamp};
use crate::serial::Bus;
use std::time::Duration;

/// How the registers of an output are put together.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Law {
    Sum,
    Mean,
    /// Mean of the phases against neutral, times the square root of three.
    BetweenPhases,
}

/// A channel and the registers that it comes from.
#[derive(Debug, Clone, PartialEq)]
struct MeterChannel {
    channel: ChannelId,
    law: Law,
    parts: Vec<Part>,
}

/// Where a register stands in what a poll brings, and what is made of it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Part {
    block: usize,
    /// Registers into the block.
    offset: usize,
    format: Format,
    /// To the unit of the channel.
    factor: f64,
}

/// A meter that is polled over Modbus.
pub struct ModbusMeter {
    name: String,
    line: Box<dyn ModbusLine>,
    unit: u8,
    profile: Profile,
    plan: PollBlocks,
    outputs: Vec<MeterChannel>,
    channels: Vec<ChannelId>,
    period: Duration,
    serial: Option<SerialTarget>,
    refresh: Refresh,
    registers: Vec<Result<Vec<u16>, u8>>,
    stamps: Vec<Stamp>,
}

impl ModbusMeter {
    /// A meter on the network.
    ///
    /// # Errors
    /// In words: an unusable profile.
    pub fn tcp(address: &Address, at: &Endpoint, meter: &MeterTarget) -> Result<Self, String> {
        let line = TcpLine::new(at.clone(), meter.timeout);
        Self::new(address, Box::new(line), meter, None)
    }

    /// A meter on a serial line.
    ///
    /// # Errors
    /// In words: an unusable profile; a line that another address uses at another speed.
    pub fn rtu(address: &Address, target: &SerialTarget, meter: &MeterTarget) -> Result<Self, String> {
        let line = RtuLine::new(Bus::of(target)?, meter.timeout);
        Self::new(address, Box::new(line), meter, Some(target.clone()))
    }

    fn new(
        address: &Address,
        line: Box<dyn ModbusLine>,
        meter: &MeterTarget,
        serial: Option<SerialTarget>,
    ) -> Result<Self, String> {
        let profile = find(&meter.profile, meter.profiles.as_deref()).map_err(|error| error.to_string())?;
        let plan = PollBlocks::of(&profile)?;
        let parts = parts(&profile, &plan, &factors(&profile, meter)?)?;
        let outputs = outputs(&profile, &parts, meter.circuit)?;
        let busy = serial.as_ref().map(|line| plan.wire_time(line) * 5 / 4).unwrap_or_default();
        Ok(Self {
            name: address.text().to_owned(),
            line,
            unit: meter.unit,
            period: profile.period.max(busy),
            channels: outputs.iter().map(|output| output.channel).collect(),
            plan,
            profile,
            outputs,
            serial,
            refresh: Refresh::default(),
            registers: Vec::new(),
            stamps: Vec::new(),
        })
    }

    /// The map that is read.
    #[must_use]
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// Reads every block; a block that is refused is kept as refused, anything else ends the poll.
    fn poll(&mut self, clock: &dyn Clock) -> Result<(), SourceError> {
        self.registers.clear();
        self.stamps.clear();
        for block in &self.plan.blocks {
            let asked = ask(self.line.as_mut(), clock, self.unit, block);
            let (registers, stamp) = match asked {
                Ok((registers, stamp)) => (Ok(registers), stamp),
                Err(ModbusError::Refused(code)) if self.plan.blocks.len() > 1 => {
                    (Err(code), Stamp::exact(clock.now_ns()))
                }
                Err(fault) => return Err(fault.of_source(&self.name, block.told(), self.line.deadline())),
            };
            self.registers.push(registers);
            self.stamps.push(stamp);
        }
        match self.registers.first() {
            Some(Err(code)) if self.registers.iter().all(Result::is_err) => {
                Err(ModbusError::Refused(*code).of_source(&self.name, self.plan.blocks[0].told(), self.line.deadline()))
            }
            _ => Ok(()),
        }
    }

    fn reading(&self, output: &MeterChannel) -> Reading {
        let mut stamp = self.stamps[0];
        let mut numbers = Vec::with_capacity(3);
        for part in &output.parts {
            match self.number(part) {
                Ok((number, at)) => {
                    stamp = at;
                    numbers.push(number);
                }
                Err((reason, at)) => return Reading::absent(output.channel, at, reason),
            }
        }
        Reading::number(output.channel, stamp, output.law.of(&numbers))
    }

    fn number(&self, part: &Part) -> Result<(f64, Stamp), (Absence, Stamp)> {
        let stamp = self.stamps[part.block];
        let registers = self.registers[part.block].as_ref().map_err(|_| (Absence::Refused, stamp))?;
        let decoded = part.format.decode(&registers[part.offset..], self.profile.word_order);
        // What a meter does not measure it gives as an IEEE number that is none.
        let number = decoded.ok_or((Absence::NotSupported, stamp))?;
        Ok((number * part.factor, stamp))
    }

    fn look_at_refresh(&mut self) {
        if let Some(stamp) = self.stamps.first() {
            self.refresh.push(self.registers.iter().flatten().flatten().copied(), stamp.mid_ns);
        }
    }
}

fn ask(
    line: &mut dyn ModbusLine,
    clock: &dyn Clock,
    unit: u8,
    block: &RegisterBlock,
) -> Result<(Vec<u16>, Stamp), ModbusError> {
    let answer = line.ask(clock, unit, &block.request(), block.answer_bytes())?;
    match block.registers(&answer.pdu) {
        Ok(registers) => Ok((registers, answer.stamp)),
        Err(NoRegisters::Refused(code)) => Err(ModbusError::Refused(code)),
        Err(NoRegisters::Other(bytes)) => {
            Err(ModbusError::Garbled(format!("{bytes} bytes that answer another question")))
        }
    }
}

impl Law {
    fn of(self, numbers: &[f64]) -> f64 {
        let sum: f64 = numbers.iter().sum();
        let count = f64::from(u32::try_from(numbers.len()).unwrap_or(1)).max(1.0);
        match self {
            Self::Sum => sum,
            Self::Mean => sum / count,
            Self::BetweenPhases => 3.0_f64.sqrt() * sum / count,
        }
    }
}

/// Register to channel unit, with the transformers where the meter does not count them in.
fn factors(profile: &Profile, meter: &MeterTarget) -> Result<Vec<f64>, String> {
    let given = (meter.ct - 1.0).abs() > 1e-12 || (meter.pt - 1.0).abs() > 1e-12;
    if given && !profile.secondary {
        return Err(format!("{} counts its transformers in: leave ct and pt out", profile.meter));
    }
    let ratio = |quantity| match quantity {
        RegisterMeaning::Power | RegisterMeaning::PhasePower(_) => meter.ct * meter.pt,
        RegisterMeaning::Current(_) => meter.ct,
        RegisterMeaning::Voltage(_) | RegisterMeaning::LineVoltage => meter.pt,
        RegisterMeaning::Channel(_) => 1.0,
    };
    Ok(profile.registers.iter().map(|register| register.factor * ratio(register.quantity)).collect())
}

/// Where each register of the profile is found in the blocks.
fn parts(profile: &Profile, plan: &PollBlocks, factors: &[f64]) -> Result<Vec<Part>, String> {
    let part = |(register, factor): (&MeterRegister, &f64)| {
        let place = plan.place(register).ok_or_else(|| format!("no block holds register {}", register.address));
        place.map(|(block, offset)| Part { block, offset, format: register.format, factor: *factor })
    };
    profile.registers.iter().zip(factors).map(part).collect()
}

fn outputs(profile: &Profile, parts: &[Part], circuit: Circuit) -> Result<Vec<MeterChannel>, String> {
    let where_is = |wanted: &dyn Fn(RegisterMeaning) -> bool| -> Vec<Part> {
        let each = profile.registers.iter().zip(parts);
        each.filter(|(register, _)| wanted(register.quantity)).map(|(_, part)| *part).collect()
    };
    let total = where_is(&|quantity| quantity == RegisterMeaning::Power);
    let phases = where_is(&|quantity| matches!(quantity, RegisterMeaning::PhasePower(_)));
    let currents = where_is(&|quantity| matches!(quantity, RegisterMeaning::Current(_)));
    let line = where_is(&|quantity| quantity == RegisterMeaning::LineVoltage);
    let voltages = where_is(&|quantity| matches!(quantity, RegisterMeaning::Voltage(_)));
    let power = if circuit == Circuit::Spindle { "spindle_power_w" } else { "total_power_w" };
    let mut outputs = Vec::new();
    let mut add = |name: &str, law, parts: Vec<Part>| {
        if let Some(channel) = ChannelId::of(name).filter(|_| !parts.is_empty()) {
            outputs.push(MeterChannel { channel, law, parts });
        }
    };
    add(power, Law::Sum, if total.is_empty() { phases } else { total });
    if circuit == Circuit::Spindle {
        add("spindle_current_a", Law::Mean, currents);
    }
    let (law, voltages) = if line.is_empty() { (Law::BetweenPhases, voltages) } else { (Law::Mean, line) };
    add("supply_voltage_v", law, voltages);
    for (register, part) in profile.registers.iter().zip(parts) {
        if let RegisterMeaning::Channel(channel) = register.quantity {
            outputs.push(MeterChannel { channel, law: Law::Sum, parts: vec![*part] });
        }
    }
    let mut seen = Vec::new();
    for output in &outputs {
        if seen.contains(&output.channel) {
            return Err(format!("profile {} gives {} twice", profile.name, output.channel));
        }
        seen.push(output.channel);
    }
    if outputs.is_empty() { Err(format!("profile {} gives no channel", profile.name)) } else { Ok(outputs) }
}

fn point_name(register: &MeterRegister) -> Option<Fact> {
    let RegisterMeaning::Channel(channel) = register.quantity else { return None };
    register.name.as_ref().map(|name| Fact::text(channel.name(), name.clone()))
}

impl Source for ModbusMeter {
    fn name(&self) -> &str {
        &self.name
    }

    fn channels(&self) -> &[ChannelId] {
        &self.channels
    }

    fn period(&self) -> Duration {
        self.period
    }

    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        if let Err(error) = self.poll(clock) {
            self.refresh.interrupt();
            return Err(error);
        }
        self.look_at_refresh();
        out.extend(self.outputs.iter().map(|output| self.reading(output)));
        Ok(())
    }

    fn facts(&self) -> Vec<Fact> {
        let mut facts = vec![Fact::text("meter", self.profile.meter.clone())];
        if !self.profile.confirmed {
            facts.push(Fact::text("register_map", format!("to be confirmed: {}", self.profile.source)));
        }
        if let Some(line) = &self.serial {
            let wire = self.plan.wire_time(line);
            facts.push(Fact::number("wire_time_ms", wire.as_secs_f64() * 1e3));
            facts.push(Fact::number("wire_share_pct", 100.0 * wire.as_secs_f64() / self.period.as_secs_f64()));
        }
        match self.refresh.effective() {
            Some(found) if found.at_least_as_fast => {
                facts.push(Fact::text("effective_refresh", "at least as fast as it is polled"));
            }
            Some(found) => {
                facts.push(Fact::number("effective_refresh_s", found.refresh_s));
                facts.push(Fact::number("effective_refresh_uncertainty_s", found.uncertainty_s));
            }
            None => facts.push(Fact::text("effective_refresh", "not known yet")),
        }
        #[expect(clippy::cast_precision_loss, reason = "a count of late answers stays far below 2^53")]
        facts.push(Fact::number("late_answers", self.line.late_answers() as f64));
        facts.extend(self.profile.registers.iter().filter_map(point_name));
        facts
    }
}
