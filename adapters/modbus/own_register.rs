//! What the user can have read of a Modbus device besides its profile: a number or a text in registers. Written in the
//! configuration as
//!
//! ```text
//! read = "input 52 f32"        read = "holding 0x34 i16"
//! read = "input 52 f32 badc"   read = "holding 100 text 8"
//! ```
//!
//! The address is the protocol's, from 0; a text has so many registers.

use super::number::{Format, WordOrder};
use super::pdu::RegisterTable;
use super::register::{MeterRegister, RegisterMeaning};
use adapter_core::channel::ChannelId;
use adapter_core::conversion::Conversion;
use adapter_core::own::{OwnChannel, OwnRead};
use adapter_core::reading::{Absence, Value};
use std::sync::Arc;

/// Longest text, registers.
const TEXT_MAX: u16 = 64;

/// What is in the registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InRegisters {
    /// A number with its format and the order of its bytes.
    Number(Format, WordOrder),
    /// A text of so many registers.
    Text(u16),
}

/// Registers of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OwnRegister {
    /// The table in which they stand.
    pub table: RegisterTable,
    /// Protocol address of the first one.
    pub address: u16,
    /// How their bits are read.
    pub content: InRegisters,
}

impl OwnRead for OwnRegister {
    const EXAMPLES: &'static str = "table, address from 0 and type: `input 52 f32`, `holding 0x34 i16`, \
     `input 52 f32 badc` or `holding 100 text 8`";

    fn parse(text: &str) -> Option<Self> {
        let words: Vec<&str> = text.split_whitespace().collect();
        match words.as_slice() {
            [table, address, "text", count] => {
                let count = count.parse().ok().filter(|count| (1..=TEXT_MAX).contains(count));
                count.and_then(|count| parse_register(table, address, InRegisters::Text(count)))
            }
            [table, address, format] => Format::of_name(format)
                .and_then(|format| parse_register(table, address, InRegisters::Number(format, WordOrder::Big))),
            [table, address, format, order] => Format::of_name(format)
                .zip(WordOrder::of_name(order))
                .and_then(|(format, order)| parse_register(table, address, InRegisters::Number(format, order))),
            _ => None,
        }
    }

    fn is_text(&self) -> Option<bool> {
        Some(matches!(self.content, InRegisters::Text(_)))
    }
}

fn parse_register(table: &str, address: &str, holds: InRegisters) -> Option<OwnRegister> {
    let table = match table {
        "input" => RegisterTable::Input,
        "holding" => RegisterTable::Holding,
        _ => return None,
    };
    let address = match address.strip_prefix("0x") {
        Some(hex) => u16::from_str_radix(hex, 16).ok()?,
        None => address.parse().ok()?,
    };
    let own = OwnRegister { table, address, content: holds };
    (u32::from(address) + u32::from(own.register_count()) <= 65_536).then_some(own)
}

impl OwnRegister {
    fn register_count(&self) -> u16 {
        match self.content {
            InRegisters::Number(format, _) => format.register_count(),
            InRegisters::Text(count) => count,
        }
    }

    /// The number as a register of a meter, and the registers of a text one by one.
    pub(super) fn list_registers(&self, channel: ChannelId) -> Vec<MeterRegister> {
        let register = |address, format: Format, order| MeterRegister {
            meaning: RegisterMeaning::Channel(channel),
            table: self.table,
            address,
            format,
            order,
            conversion: Conversion::NONE,
            no_value: format.no_values().to_vec(),
            name: None,
        };
        match self.content {
            InRegisters::Number(format, order) => vec![register(self.address, format, order)],
            InRegisters::Text(count) => {
                (0..count).map(|at| register(self.address + at, Format::U16, WordOrder::Big)).collect()
            }
        }
    }
}

impl OwnRegister {
    /// What stands in the registers, before the scale. `parts` are those of [`OwnRegister::list_registers`], each with what it
    /// holds.
    ///
    /// # Errors
    /// The device does not have them, or says that there is no value.
    pub(super) fn extract_value(
        &self,
        channel: &OwnChannel,
        parts: &[(&MeterRegister, Result<&[u16], Absence>)],
    ) -> Result<Value, Absence> {
        match self.content {
            InRegisters::Number(..) => {
                let (register, found) = parts.first().ok_or(Absence::NotSupported)?;
                Value::from_number(register.decode_number((*found)?).ok_or(Absence::NotSupported)?)
            }
            InRegisters::Text(_) => {
                let words = parts
                    .iter()
                    .map(|(_, found)| found.and_then(|word| word.first().copied().ok_or(Absence::NotSupported)));
                let bytes: Vec<u8> =
                    words.collect::<Result<Vec<u16>, _>>()?.into_iter().flat_map(u16::to_be_bytes).collect();
                let encoding = channel.encoding.unwrap_or_default();
                Ok(Value::Text(Arc::from(encoding.decode_trimmed(&bytes))))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_can_be_read() {
        let number = |table, address, format, order| {
            Ok(OwnRegister { table, address, content: InRegisters::Number(format, order) })
        };
        assert_eq!(OwnRegister::read("input 52 f32"), number(RegisterTable::Input, 52, Format::F32, WordOrder::Big));
        assert_eq!(
            OwnRegister::read("holding 0x34 i16"),
            number(RegisterTable::Holding, 52, Format::I16, WordOrder::Big)
        );
        assert_eq!(
            OwnRegister::read("input 1 u32 badc"),
            number(RegisterTable::Input, 1, Format::U32, WordOrder::Badc)
        );
        assert_eq!(OwnRegister::read("holding 100 text 8").map(|own| own.content), Ok(InRegisters::Text(8)));
        for wrong in
            ["", "coil 1 u16", "input x f32", "input 65535 f32", "input 1 f31", "input 1 text 0", "input 1 f32 xyz"]
        {
            assert!(OwnRegister::read(wrong).is_err_and(|why| why.to_string().contains("input 52 f32")), "{wrong}");
        }
    }
}
