//! One number of a meter: where its registers are, what it means, and how it becomes a number in the unit of the channels.

use super::number::{Format, WordOrder};
use super::pdu::RegisterTable;
use adapter_core::channel::{self, CHANNELS, ChannelId};
use adapter_core::conversion::{self, Conversion};
use serde::Deserialize;

/// What a register means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RegisterMeaning {
    /// Of all phases together, W.
    Power,
    /// Of one phase, 0 to 2, W.
    PhasePower(usize),
    /// Of one phase, 0 to 2, A.
    Current(usize),
    /// One phase against neutral, 0 to 2, V.
    Voltage(usize),
    /// Between the first two phases, V.
    LineVoltage,
    /// Of all phases together, kWh.
    Energy,
    /// Of all phases together.
    PowerFactor,
    /// Of all phases together, VA.
    ApparentPower,
    /// Of the supply, Hz.
    Frequency,
    /// A channel by its name, in its unit.
    Channel(ChannelId),
}

/// One number of the meter.
#[derive(Debug, Clone, PartialEq)]
pub struct MeterRegister {
    /// The quantity or the channel that it stands for.
    pub meaning: RegisterMeaning,
    /// The table in which it stands.
    pub table: RegisterTable,
    /// Protocol address of its first register.
    pub address: u16,
    /// How it lies there.
    pub format: Format,
    /// In which order its bytes come.
    pub order: WordOrder,
    /// From the number in the register to W, A, V or the channel's unit.
    pub conversion: Conversion,
    /// Bits that stand for no value.
    pub no_value: Vec<u64>,
    /// What the point is called on this machine.
    pub name: Option<String>,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "lowercase")]
pub(super) enum RawTable {
    Holding,
    Input,
}

/// How the manual counts.
#[derive(Deserialize, Clone, Copy, PartialEq)]
#[serde(rename_all = "lowercase")]
pub(super) enum RawAddresses {
    /// From 0, as on the wire.
    Protocol,
    /// Input registers from 30001, holding registers from 40001.
    Manual,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawValue {
    quantity: Option<String>,
    channel: Option<String>,
    address: u16,
    r#type: Format,
    unit: String,
    #[serde(default = "one")]
    scale: f64,
    name: Option<String>,
    registers: Option<RawTable>,
    word_order: Option<WordOrder>,
    no_value: Option<Vec<i64>>,
}

fn one() -> f64 {
    1.0
}

/// What the head of a profile says for all of its values.
#[derive(Clone, Copy)]
pub(super) struct Whole {
    pub(super) registers: RawTable,
    pub(super) addresses: Option<RawAddresses>,
    pub(super) word_order: WordOrder,
}

impl RawTable {
    pub(super) fn to_table(self) -> RegisterTable {
        if matches!(self, Self::Input) { RegisterTable::Input } else { RegisterTable::Holding }
    }
}

/// Table and protocol address of a value. A number that is one in most manuals is not guessed.
fn resolve_address(raw: &RawValue, whole: Whole) -> Result<(RegisterTable, u16), String> {
    let (table, address) = (raw.registers.unwrap_or(whole.registers).to_table(), raw.address);
    let manual = match address {
        30_001..=39_999 => Some((RegisterTable::Input, address - 30_001)),
        40_001..=49_999 => Some((RegisterTable::Holding, address - 40_001)),
        _ => None,
    };
    match (whole.addresses, manual) {
        (Some(RawAddresses::Protocol), _) | (None, None) => Ok((table, address)),
        (Some(RawAddresses::Manual), Some(place)) => Ok(place),
        (Some(RawAddresses::Manual), None) => {
            Err(format!("address = {address}: with addresses = \"manual\" give 30001 to 39999 or 40001 to 49999"))
        }
        (None, Some((_, protocol))) => Err(format!(
            "address = {address} may be counted as in a manual: write addresses = \"manual\" at the top for register {protocol} on \
             the wire, or addresses = \"protocol\" for {address} itself"
        )),
    }
}

/// Registers that are read with two meanings.
pub(super) fn describe_overlaps(registers: &[MeterRegister]) -> Vec<String> {
    let end = |register: &MeterRegister| u32::from(register.address) + u32::from(register.format.register_count());
    let overlaps = |a: &MeterRegister, b: &MeterRegister| {
        a.table == b.table && u32::from(a.address) < end(b) && u32::from(b.address) < end(a)
    };
    let mut problems = Vec::new();
    for (at, register) in registers.iter().enumerate() {
        if let Some(first) = registers[..at].iter().position(|other| overlaps(other, register)) {
            problems.push(format!(
                "value {} reads register {} a second time with another meaning, after value {}: correct one of the two addresses",
                at + 1,
                register.address,
                first + 1
            ));
        }
    }
    problems
}

/// The register of a value.
///
/// # Errors
/// What is wrong with it.
pub(super) fn read(raw: &RawValue, whole: Whole) -> Result<MeterRegister, String> {
    let (quantity, base) = match (&raw.quantity, &raw.channel) {
        (Some(quantity), None) => of_quantity(quantity)?,
        (None, Some(channel)) => of_channel(channel)?,
        _ => return Err("give quantity or channel, one of the two".to_owned()),
    };
    let unit = conversion::find_conversion(&raw.unit, base)
        .ok_or_else(|| format!("unit = {:?} is no unit for a number in {base}", raw.unit))?;
    let (table, address) = resolve_address(raw, whole)?;
    if !(raw.scale.is_finite() && raw.scale != 0.0) {
        return Err(format!("scale = {}: give a number that is not 0", raw.scale));
    }
    if u32::from(address) + u32::from(raw.r#type.register_count()) > 65536 {
        return Err(format!("address = {}: the number does not end within the 65536 registers", raw.address));
    }
    let given = raw.no_value.as_ref().map(|bits| bits.iter().map(|bits| bits.cast_unsigned()).collect());
    Ok(MeterRegister {
        meaning: quantity,
        table,
        address,
        format: raw.r#type,
        order: raw.word_order.unwrap_or(whole.word_order),
        conversion: Conversion { scale: raw.scale * unit.scale, offset: unit.offset },
        no_value: given.unwrap_or_else(|| raw.r#type.no_values().to_vec()),
        name: raw.name.clone(),
    })
}

impl MeterRegister {
    /// The number in these registers, in the unit of its quantity; `None` where the meter says that there is none.
    #[must_use]
    pub fn decode_number(&self, registers: &[u16]) -> Option<f64> {
        let bits = self.format.extract_bits(registers, self.order)?;
        let number = self.format.decode(registers, self.order)?;
        (!self.no_value.contains(&bits)).then(|| self.conversion.convert_number(number))
    }
}

const QUANTITIES: [(&str, RegisterMeaning, &str); 15] = [
    ("power", RegisterMeaning::Power, "W"),
    ("power_l1", RegisterMeaning::PhasePower(0), "W"),
    ("power_l2", RegisterMeaning::PhasePower(1), "W"),
    ("power_l3", RegisterMeaning::PhasePower(2), "W"),
    ("current_l1", RegisterMeaning::Current(0), "A"),
    ("current_l2", RegisterMeaning::Current(1), "A"),
    ("current_l3", RegisterMeaning::Current(2), "A"),
    ("voltage_l1", RegisterMeaning::Voltage(0), "V"),
    ("voltage_l2", RegisterMeaning::Voltage(1), "V"),
    ("voltage_l3", RegisterMeaning::Voltage(2), "V"),
    ("voltage_l12", RegisterMeaning::LineVoltage, "V"),
    ("energy", RegisterMeaning::Energy, "kWh"),
    ("power_factor", RegisterMeaning::PowerFactor, "1"),
    ("apparent_power", RegisterMeaning::ApparentPower, "VA"),
    ("frequency", RegisterMeaning::Frequency, "Hz"),
];

fn of_quantity(name: &str) -> Result<(RegisterMeaning, &'static str), String> {
    if let Some((_, quantity, base)) = QUANTITIES.iter().find(|(known, ..)| *known == name) {
        return Ok((*quantity, base));
    }
    let names = QUANTITIES.iter().map(|(known, ..)| *known);
    let near =
        channel::find_nearest_name(name, names.clone()).or_else(|| names.clone().find(|known| name.starts_with(known)));
    let hint = near.map(|near| format!("; did you mean {near}?")).unwrap_or_default();
    Err(format!("no quantity {name:?}{hint}"))
}

fn of_channel(name: &str) -> Result<(RegisterMeaning, &'static str), String> {
    let id = ChannelId::from_name(name).filter(|id| !id.channel().unit.is_empty());
    if let Some(id) = id {
        return Ok((RegisterMeaning::Channel(id), id.channel().unit));
    }
    let names = CHANNELS.iter().map(|channel| channel.name);
    let hint =
        channel::find_nearest_name(name, names).map(|near| format!("; did you mean {near}?")).unwrap_or_default();
    Err(format!("no channel {name:?} that holds a number{hint}"))
}
