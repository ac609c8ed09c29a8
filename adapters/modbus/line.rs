//! One request and its answer over either carrier, and every way in which that fails.

use crate::pdu;
use adapter_core::address::{Parity, SerialTarget};
use adapter_core::clock::Clock;
use adapter_core::driver::SourceError;
use adapter_core::integer::saturate_to_ms;
use adapter_core::reading::Stamp;
use std::io::{self, ErrorKind};
use std::time::Duration;

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ModbusResponse {
    /// Without address and check.
    pub(crate) pdu: Vec<u8>,
    /// From the end of the request to the beginning of the answer.
    pub(crate) stamp: Stamp,
}

/// Why there is no answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ModbusError {
    /// The line cannot be opened, or it broke.
    Line {
        /// What the system says, in words.
        what: String,
        /// What to do next, a sentence.
        next: String,
    },
    /// Nothing came in time.
    Timeout {
        /// What to do next, a sentence.
        next: String,
    },
    /// The device said no, with this exception code.
    Refused(u8),
    /// Something came that is no answer to this request.
    Garbled(String),
}

impl ModbusError {
    /// The same as the error of a source.
    pub fn of_source(self, source_name: &str, request: String, deadline: Duration) -> SourceError {
        let source_name = source_name.to_owned();
        match self {
            Self::Line { what, next } => SourceError::Line { source_name, what, next },
            Self::Timeout { next } => {
                let deadline_ms = saturate_to_ms(deadline);
                SourceError::Timeout { source_name, request, deadline_ms, next }
            }
            Self::Refused(code) => {
                let (what, next) = pdu::describe_exception(code);
                let what = format!("exception {code}, {what}");
                SourceError::Refused { source_name, request, what, next: format!("{next}.") }
            }
            Self::Garbled(what) => SourceError::Decode { source_name, request, what },
        }
    }
}

/// Something over which a unit can be asked.
pub(crate) trait ModbusLine: Send {
    /// Asks and waits. `answer_bytes` is the length of a good answer without address and check.
    fn exchange_pdu(
        &mut self,
        clock: &dyn Clock,
        unit: u8,
        request: &[u8],
        answer_bytes: usize,
    ) -> Result<ModbusResponse, ModbusError>;

    /// How long a request may take.
    fn deadline(&self) -> Duration;

    /// Answers that came too late and were thrown away.
    fn late_answers(&self) -> u64;
}

/// `ENOTTY` of Linux.
const NO_TERMINAL: i32 = 25;

/// What a failed serial line means, and what to do.
pub fn serial_fault(error: &io::Error, target: &SerialTarget) -> ModbusError {
    let port = target.port.display();
    let next = match error.kind() {
        ErrorKind::NotFound => "Plug the adapter in and look with: ls /dev/serial/by-id".to_owned(),
        ErrorKind::PermissionDenied => "Add the gateway's user to the group dialout".to_owned(),
        ErrorKind::ResourceBusy => format!("Find the other program with: fuser {port}"),
        _ if error.raw_os_error() == Some(NO_TERMINAL) => {
            "This is no serial line; look for the adapter with: ls /dev/serial/by-id".to_owned()
        }
        _ => "Check the adapter; the line is opened again by itself".to_owned(),
    };
    ModbusError::Line { what: format!("{port}: {error}"), next: format!("{next}.") }
}

/// What silence on a serial line means, and what to do.
pub fn serial_silence(target: &SerialTarget) -> ModbusError {
    let parity = match target.parity {
        Parity::None => "no",
        Parity::Even => "even",
        Parity::Odd => "odd",
    };
    let next = format!(
        "Check the power of the meter, its unit number, that A and B are not swapped, and that it speaks {} Bd with {parity} parity.",
        target.baud
    );
    ModbusError::Timeout { next }
}
