//! Modbus over TCP.
//!
//! Source: Modbus Messaging on TCP/IP Implementation Guide V1.0b, 3.1.3 (the header: transaction, protocol 0, length,
//! unit) and 4.2 (TCP_NODELAY; a connection per server).

use super::line::{ModbusError, ModbusLine, ModbusResponse};
use crate::address::Endpoint;
use crate::clock::Clock;
use crate::reading::Stamp;
use crate::stream::{self, Short};
use std::io::{self, ErrorKind, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

const HEADER: usize = 7;
/// The longest PDU.
const PDU_MAX: usize = 253;
/// So many answers to other requests are passed over before the connection is given up.
const STRAY_MAX: usize = 4;
/// A request has at least so long to leave, however late the connection was made.
const WRITE_LEAST: Duration = Duration::from_millis(10);

pub(super) struct TcpLine {
    at: Endpoint,
    deadline: Duration,
    stream: Option<TcpStream>,
    transaction: u16,
    stray: u64,
}

impl TcpLine {
    pub(super) fn new(at: Endpoint, deadline: Duration) -> Self {
        Self { at, deadline, stream: None, transaction: 0, stray: 0 }
    }

    /// The open connection, or a new one. It is put back only after a good exchange: whatever still comes on another one
    /// belongs to a request that was given up.
    fn connection(&mut self, until: Instant) -> Result<TcpStream, ModbusError> {
        let open = self.stream.take();
        open.map_or_else(|| connect(&self.at, until), Ok).map_err(|error| unreachable(&self.at, &error))
    }

    fn matching(&mut self, stream: &mut TcpStream, unit: u8, until: Instant) -> Result<Vec<u8>, ModbusError> {
        for _ in 0..STRAY_MAX {
            let (header, pdu) = receive(stream, until)?;
            if header.transaction == self.transaction {
                return of_unit(header.unit, unit).map(|()| pdu);
            }
            self.stray += 1;
        }
        Err(ModbusError::Garbled(format!("{STRAY_MAX} answers, all to other requests")))
    }
}

/// Some gateways answer as unit 0 or 255 whatever was asked.
fn of_unit(answered: u8, asked: u8) -> Result<(), ModbusError> {
    if answered == asked || matches!(answered, 0 | 255) {
        return Ok(());
    }
    Err(ModbusError::Garbled(format!("unit {answered} answered in place of unit {asked}")))
}

impl ModbusLine for TcpLine {
    fn ask(&mut self, clock: &dyn Clock, unit: u8, request: &[u8], _: usize) -> Result<ModbusResponse, ModbusError> {
        let until = Instant::now() + self.deadline;
        self.transaction = self.transaction.wrapping_add(1);
        let mut stream = self.connection(until)?;
        let began_ns = clock.now_ns();
        stream.write_all(&frame(self.transaction, unit, request)).map_err(|error| broken(&error))?;
        let pdu = self.matching(&mut stream, unit, until)?;
        let stamp = Stamp::of_request(began_ns, clock.now_ns());
        self.stream = Some(stream);
        Ok(ModbusResponse { pdu, stamp })
    }

    fn deadline(&self) -> Duration {
        self.deadline
    }

    fn late_answers(&self) -> u64 {
        self.stray
    }
}

fn connect(at: &Endpoint, until: Instant) -> io::Result<TcpStream> {
    let stream = stream::connect(at, until)?;
    let left = until.saturating_duration_since(Instant::now()).max(WRITE_LEAST);
    stream.set_write_timeout(Some(left))?;
    Ok(stream)
}

fn unreachable(Endpoint { host, port }: &Endpoint, error: &io::Error) -> ModbusError {
    let next = match error.kind() {
        ErrorKind::ConnectionRefused => {
            format!("{host} is there but nothing listens on port {port}: is Modbus TCP enabled, is the port right?")
        }
        ErrorKind::TimedOut | ErrorKind::WouldBlock => "Check the network cable and the address.".to_owned(),
        _ => "Check the address and the network.".to_owned(),
    };
    ModbusError::Line { what: format!("cannot connect: {error}"), next }
}

fn broken(error: &io::Error) -> ModbusError {
    let next = "It is opened again by itself; many meters serve one or two clients at a time.".to_owned();
    ModbusError::Line { what: format!("the connection broke: {error}"), next }
}

/// Header and PDU as one write, so that they leave in one packet.
pub(super) fn frame(transaction: u16, unit: u8, pdu: &[u8]) -> Vec<u8> {
    let length = u16::try_from(pdu.len() + 1).unwrap_or(u16::MAX);
    let mut frame = Vec::with_capacity(HEADER + pdu.len());
    frame.extend(transaction.to_be_bytes());
    frame.extend([0, 0]);
    frame.extend(length.to_be_bytes());
    frame.push(unit);
    frame.extend(pdu);
    frame
}

/// What a frame begins with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct MbapHeader {
    pub(super) transaction: u16,
    pub(super) unit: u8,
    /// Bytes of the PDU, 1 to 253.
    pub(super) pdu: usize,
}

/// `None`: this is not Modbus.
pub(super) fn header(bytes: [u8; HEADER]) -> Option<MbapHeader> {
    let [t_high, t_low, p_high, p_low, l_high, l_low, unit] = bytes;
    let pdu = usize::from(u16::from_be_bytes([l_high, l_low])).checked_sub(1)?;
    let modbus = (p_high, p_low) == (0, 0) && (1..=PDU_MAX).contains(&pdu);
    modbus.then_some(MbapHeader { transaction: u16::from_be_bytes([t_high, t_low]), unit, pdu })
}

fn receive(stream: &mut TcpStream, until: Instant) -> Result<(MbapHeader, Vec<u8>), ModbusError> {
    let mut head = [0_u8; HEADER];
    fill(stream, &mut head, until)?;
    let header = header(head).ok_or_else(|| {
        ModbusError::Garbled(format!("{head:02X?} is no Modbus header; is this the port of another protocol?"))
    })?;
    let mut pdu = vec![0_u8; header.pdu];
    fill(stream, &mut pdu, until)?;
    Ok((header, pdu))
}

fn fill(stream: &mut TcpStream, into: &mut [u8], until: Instant) -> Result<(), ModbusError> {
    stream::fill(stream, into, until).map_err(|short| match short {
        Short::Silent => ModbusError::Timeout {
            next: "Check the unit number and the power of the meter; a slow one may need timeout_ms=2000.".to_owned(),
        },
        Short::Closed => broken(&io::Error::new(ErrorKind::UnexpectedEof, "the meter closed it")),
        Short::Broken(error) => broken(&error),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_of_the_guide() {
        // Guide 3.1.3, example: transaction 1501 hex, unit FF, read register 4 with a length of 6.
        let bytes = frame(0x1501, 0xFF, &[3, 0, 4, 0, 1]);
        assert_eq!(bytes, [0x15, 0x01, 0, 0, 0, 6, 0xFF, 3, 0, 4, 0, 1]);
        let head = header(*bytes.first_chunk().expect("seven bytes"));
        assert_eq!(head, Some(MbapHeader { transaction: 0x1501, unit: 0xFF, pdu: 5 }));
        assert_eq!(header(*b"HTTP/1."), None);
    }
}
