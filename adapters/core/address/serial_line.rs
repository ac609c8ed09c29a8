//! A serial line as an address says it.

use super::keys::Keys;
use super::problem::AddressProblem;
use std::path::PathBuf;

/// Parity of a serial line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parity {
    /// No parity bit: ten bits per character.
    None,
    /// An even number of ones with the parity bit.
    Even,
    /// An odd number of ones with the parity bit.
    Odd,
}

/// The device file of a serial line and how it is set up.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SerialTarget {
    /// The device file, such as `/dev/ttyUSB0`.
    pub port: PathBuf,
    /// Bits per second, 300 to 4000000; 9600 where the address says nothing.
    pub baud: u32,
    /// Parity bit; none where the address says nothing.
    pub parity: Parity,
}

/// The device file of `//DEVICE`, with the keys `baud` and `parity`.
///
/// # Errors
/// [`AddressProblem::NoSerialPort`].
pub fn parse_serial(body: &str, keys: &mut Keys) -> Result<SerialTarget, AddressProblem> {
    let baud = keys.take_number("baud", 9600, 300, 4_000_000);
    let parity = keys.take_choice("parity", &[("none", Parity::None), ("even", Parity::Even), ("odd", Parity::Odd)]);
    let port = body.strip_prefix("//").unwrap_or(body);
    if port.is_empty() {
        return Err(AddressProblem::NoSerialPort);
    }
    Ok(SerialTarget { port: PathBuf::from(port), baud, parity })
}
