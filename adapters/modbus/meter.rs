//! A Modbus meter as a source.

use super::error::MeterError;
use super::line::{ModbusError, ModbusLine};
use super::outputs::{self, MeterChannel};
use super::own_register::OwnRegister;
use super::plan::PollBlocks;
use super::poll::RegisterPoll;
use super::profile::{self, Profile};
use super::refresh::Refresh;
use super::register::{MeterRegister, RegisterMeaning};
use super::rtu::RtuLine;
use super::tcp::TcpLine;
use crate::address::MeterTarget;
use adapter_core::address::{Endpoint, SerialTarget};
use adapter_core::channel::ChannelId;
use adapter_core::clock::Clock;
use adapter_core::driver::{Fact, Offer, Source, SourceError, SourceProblem};
use adapter_core::electric::{Doubts, SupplyCheck};
use adapter_core::energy_count::EnergyCount;
use adapter_core::integer::count_to_f64;
use adapter_core::own::Own;
use adapter_core::reading::{Absence, Reading};
use device_line::serial::Bus;
use std::ops::Range;
use std::time::Duration;

/// A meter that is polled over Modbus.
pub struct ModbusMeter {
    name: String,
    line: Box<dyn ModbusLine>,
    target: MeterTarget,
    profile: Profile,
    /// Those of the profile, then those of the user's own channels.
    registers: Vec<MeterRegister>,
    outputs: Vec<MeterChannel>,
    /// The user's own channels, each with the places of its registers.
    own: Vec<(Own<OwnRegister>, Range<usize>)>,
    channels: Vec<ChannelId>,
    poll: RegisterPoll,
    period: Duration,
    serial: Option<SerialTarget>,
    refresh: Refresh,
    check: SupplyCheck,
    doubts: Doubts,
    count: Option<EnergyCount>,
}

impl ModbusMeter {
    /// A meter on the network.
    ///
    /// # Errors
    /// See [`MeterError`]: an unusable profile; another address that uses the same host and port with other frames.
    pub fn with_tcp_line(name: &str, at: &Endpoint, meter: &MeterTarget) -> Result<Self, MeterError> {
        let line = TcpLine::new(at, meter.framing, meter.timeout)?;
        Self::new(name, Box::new(line), meter, None)
    }

    /// A meter on a serial line.
    ///
    /// # Errors
    /// See [`MeterError`]: an unusable profile; a line that another address uses at another speed.
    pub fn with_rtu_line(name: &str, target: &SerialTarget, meter: &MeterTarget) -> Result<Self, MeterError> {
        let line = RtuLine::new(Bus::from_target(target)?, meter.timeout);
        Self::new(name, Box::new(line), meter, Some(target.clone()))
    }

    fn new(
        name: &str,
        line: Box<dyn ModbusLine>,
        meter: &MeterTarget,
        serial: Option<SerialTarget>,
    ) -> Result<Self, MeterError> {
        let profile = profile::find_profile(&meter.profile, meter.profiles.as_deref())?;
        let mut registers = outputs::list_registers(&profile, meter)?;
        let outputs = outputs::list_channels(&profile, meter.circuit)?;
        let count = outputs::find_energy_count(&registers);
        let mut own = Vec::new();
        for channel in &meter.own {
            let from = registers.len();
            registers.extend(channel.item.list_registers(channel.id));
            own.push((channel.clone(), from..registers.len()));
        }
        let blocks = PollBlocks::from_registers(&registers, profile.block_max, profile.block_gap)?;
        let busy = serial.as_ref().map(|line| blocks.wire_time(line) * 5 / 4).unwrap_or_default();
        let channels = outputs.iter().map(|output| output.channel).chain(own.iter().map(|(own, _)| own.id));
        Ok(Self {
            name: name.to_owned(),
            line,
            target: meter.clone(),
            period: profile.period.max(busy),
            channels: channels.collect(),
            poll: RegisterPoll::new(blocks),
            profile,
            registers,
            outputs,
            own,
            serial,
            refresh: Refresh::default(),
            check: SupplyCheck::default(),
            doubts: Doubts::default(),
            count,
        })
    }

    /// The map that is read.
    #[must_use]
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    fn build_error(&self, (error, request): (ModbusError, String)) -> SourceError {
        error.of_source(&self.name, request, self.line.deadline())
    }

    fn own_reading(&self, own: &Own<OwnRegister>, places: &Range<usize>) -> Reading {
        let registers = self.registers.get(places.clone()).unwrap_or_default();
        let mut stamp = self.poll.list_all_registers().1;
        let mut parts: Vec<(&MeterRegister, Result<&[u16], Absence>)> = Vec::with_capacity(registers.len());
        for register in registers {
            let found = self.poll.find_registers(register);
            stamp = found.as_ref().map_or_else(|(_, at)| *at, |(_, at)| *at);
            parts.push((register, found.map(|(found, _)| found).map_err(|(why, _)| why)));
        }
        own.to_reading(stamp, own.item.extract_value(&own.channel, &parts))
    }

    /// Tries a profile on this meter: what it would give, or why it does not fit.
    fn try_profile(&mut self, clock: &dyn Clock, name: &str) -> Result<String, String> {
        let profile =
            profile::find_profile(name, self.target.profiles.as_deref()).map_err(|error| error.to_string())?;
        let outputs = outputs::list_channels(&profile, self.target.circuit).map_err(|error| error.to_string())?;
        let blocks = PollBlocks::from_registers(&profile.registers, profile.block_max, profile.block_gap)
            .map_err(|error| error.to_string())?;
        let mut poll = RegisterPoll::new(blocks);
        poll.read(self.line.as_mut(), clock, self.target.unit).map_err(|(error, request)| match error {
            ModbusError::Refused(code) => {
                format!("{request}: exception {code}, {}", super::pdu::describe_exception(code).0)
            }
            ModbusError::Timeout { .. } => format!("{request}: no answer"),
            ModbusError::Line { what, .. } | ModbusError::Garbled(what) => what,
        })?;
        let doubts = outputs::judge_answer(&mut SupplyCheck::default(), &profile, &profile.registers, &poll);
        if let Some(problem) = doubts.problems.first() {
            return Err(problem.what.clone());
        }
        let shown = |output: &MeterChannel| {
            let reading = output.build_reading(&profile.registers, &poll, &doubts);
            let unit = output.channel.channel().unit;
            match (reading.value.ok().and_then(|value| value.as_number()), reading.implausible) {
                (Some(number), _) => Ok(format!("{} {number:.6} {unit}", output.channel)),
                (None, Some(number)) => Err(format!("{} {number:.4e} {unit} cannot be", output.channel)),
                (None, None) => Ok(format!("{} -", output.channel)),
            }
        };
        let values: Vec<String> = outputs.iter().map(shown).collect::<Result<_, String>>()?;
        let note = if poll.is_split() { "; not all of its registers at once" } else { "" };
        Ok(format!("may be it: {}{note}", values.join(", ")))
    }

    fn describe_missing(&self) -> Option<SourceProblem> {
        let missing = self.registers.iter().filter(|register| !self.poll.has_register(register));
        let addresses: Vec<String> = missing.map(|register| register.address.to_string()).collect();
        (!addresses.is_empty()).then(|| SourceProblem {
            what: format!(
                "the meter does not have {} of the registers that are read: {}",
                addresses.len(),
                addresses.join(", ")
            ),
            next: "Choose the profile of this very model, or take these values out of it".to_owned(),
        })
    }
}

/// What a point is called on this machine, as a fact.
fn point_name(register: &MeterRegister) -> Option<Fact> {
    let RegisterMeaning::Channel(channel) = register.meaning else { return None };
    let name = register.name.as_ref()?;
    Some(Fact::from_text(channel.name(), name.clone()))
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
        if let Err(failed) = self.poll.read(self.line.as_mut(), clock, self.target.unit) {
            self.refresh.forget_last_change();
            return Err(self.build_error(failed));
        }
        let (all, stamp) = self.poll.list_all_registers();
        self.refresh.push(all, stamp.mid_ns);
        self.doubts = outputs::judge_answer(&mut self.check, &self.profile, &self.registers, &self.poll);
        for output in &self.outputs {
            let count = self.count.as_mut();
            out.push(output.build_counted_reading(&self.registers, &self.poll, &self.doubts, count));
        }
        out.extend(self.own.iter().map(|(own, places)| self.own_reading(own, places)));
        Ok(())
    }

    fn collect_facts(&self) -> Vec<Fact> {
        let mut facts = vec![Fact::from_text("meter", self.profile.meter.clone())];
        if !self.profile.confirmed {
            facts.push(Fact::from_text("register_map", format!("to be confirmed: {}", self.profile.source)));
        }
        if let Some(line) = &self.serial {
            let wire = self.poll.wire_time(line);
            facts.push(Fact::from_number("wire_time_ms", wire.as_secs_f64() * 1e3));
            facts.push(Fact::from_number("wire_share_pct", 100.0 * wire.as_secs_f64() / self.period.as_secs_f64()));
        }
        if self.poll.is_split() {
            facts.push(Fact::from_number("requests_per_poll", count_to_f64(self.poll.count_requests())));
        }
        match self.refresh.estimate_interval() {
            Some(found) if found.at_least_as_fast => {
                facts.push(Fact::from_text("effective_refresh", "at least as fast as it is polled"));
            }
            Some(found) => {
                facts.push(Fact::from_number("effective_refresh_s", found.refresh_s));
                facts.push(Fact::from_number("effective_refresh_uncertainty_s", found.uncertainty_s));
            }
            None => facts.push(Fact::from_text("effective_refresh", "not known yet")),
        }
        #[expect(clippy::cast_precision_loss, reason = "a count of late answers stays far below 2^53")]
        facts.push(Fact::from_number("late_answers", self.line.late_answers() as f64));
        facts.extend(self.profile.registers.iter().filter_map(point_name));
        facts.extend(self.count.iter().flat_map(EnergyCount::collect_facts));
        facts
    }

    fn list_problems(&self) -> Vec<SourceProblem> {
        let count = self.count.as_ref().and_then(EnergyCount::find_problem);
        self.doubts.problems.iter().cloned().chain(self.describe_missing()).chain(count).collect()
    }

    fn list_offers(&mut self, clock: &dyn Clock) -> Result<Vec<Offer>, SourceError> {
        let names: Vec<&str> = profile::SHIPPED.iter().map(|(name, _)| *name).collect();
        let offer =
            |name: &str| Offer { name: format!("profile={name}"), says: self.try_profile(clock, name), channel: None };
        Ok(names.into_iter().map(offer).collect())
    }
}
