//! Modbus over TCP.
//!
//! Source: Modbus Messaging on TCP/IP Implementation Guide V1.0b, 3.1.3 (the header: transaction, protocol 0, length,
//! unit) and 4.2 (TCP_NODELAY; a connection per server). Every source that names the same host and port shares the connection,
//! as those on one serial line share the line.

use super::error::MeterError;
use super::line::{ModbusError, ModbusLine, ModbusResponse};
use super::rtu;
use adapter_core::address::Endpoint;
use adapter_core::clock::Clock;
use adapter_core::integer::convert_bounded;
use adapter_core::reading::Stamp;
use adapter_core::stream::{self, Short};
use std::collections::HashMap;
use std::io::{self, ErrorKind, Write};
use std::net::TcpStream;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

const HEADER: usize = 7;
/// The longest PDU.
const PDU_MAX: usize = 253;
/// So many answers to other requests are passed over before the connection is given up.
const STRAY_MAX: u64 = 4;
/// A request has at least so long to leave, however late the connection was made.
const WRITE_LEAST: Duration = Duration::from_millis(10);

/// Behind the last byte of a late answer, as carried by a network.
const SILENCE: Duration = Duration::from_millis(20);

/// How a frame looks on a TCP connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TcpFraming {
    /// Modbus TCP: a header with a transaction number.
    #[default]
    Tcp,
    /// RTU frames as on a serial line, as transparent converters carry them.
    Rtu,
}

/// One connection to a host and port, with every unit that is asked over it: a converter to a serial line serves one client as a
/// rule, and one request at a time in any case.
struct TcpPort {
    endpoint: Endpoint,
    framing: TcpFraming,
    stream: Option<TcpStream>,
    transaction: u16,
    stray: u64,
    /// Until then the answer to a request that was given up may still come.
    quiet_until: Option<Instant>,
}

/// A connection that several sources share.
type SharedPort = Arc<Mutex<TcpPort>>;

/// The connections that are in use, by host and port.
type PortsByEndpoint = HashMap<(String, u16), Weak<Mutex<TcpPort>>>;

static PORTS: Mutex<Option<PortsByEndpoint>> = Mutex::new(None);

/// The connection of this host and port; the same one for every address that names it.
fn open_shared_port(at: &Endpoint, framing: TcpFraming) -> Result<SharedPort, MeterError> {
    let mut ports = PORTS.lock().unwrap_or_else(PoisonError::into_inner);
    let ports = ports.get_or_insert_with(HashMap::new);
    ports.retain(|_, port| port.strong_count() > 0);
    let key = (at.host.clone(), at.port);
    let Some(port) = ports.get(&key).and_then(Weak::upgrade) else {
        let new = TcpPort { endpoint: at.clone(), framing, stream: None, transaction: 0, stray: 0, quiet_until: None };
        let port = Arc::new(Mutex::new(new));
        ports.insert(key, Arc::downgrade(&port));
        return Ok(port);
    };
    let same = port.lock().unwrap_or_else(PoisonError::into_inner).framing == framing;
    same.then_some(port).ok_or_else(|| MeterError::Framing { host: at.host.clone(), port: at.port })
}

pub(super) struct TcpLine {
    port: SharedPort,
    deadline: Duration,
    stray: u64,
}

impl TcpLine {
    /// A line to a host and port.
    ///
    /// # Errors
    /// [`MeterError::Framing`].
    pub(super) fn new(at: &Endpoint, framing: TcpFraming, deadline: Duration) -> Result<Self, MeterError> {
        Ok(Self { port: open_shared_port(at, framing)?, deadline, stray: 0 })
    }
}

impl TcpPort {
    /// One request and its answer. A connection that was open and is closed without a byte is opened anew once: many converters
    /// close what has been idle. It is put back only after a good exchange: whatever still comes on another one belongs to a
    /// request that was given up.
    fn exchange_request(&mut self, clock: &dyn Clock, asked: TcpRequest<'_>) -> Result<ModbusResponse, ModbusError> {
        let was_open = self.stream.is_some();
        match self.attempt_exchange(clock, asked) {
            Err(Attempt::ClosedIdle(_)) if was_open => self.attempt_exchange(clock, asked),
            other => other,
        }
        .map_err(|attempt| match attempt {
            Attempt::ClosedIdle(error) | Attempt::Failed(error) => error,
        })
    }

    /// RTU frames have no number that tells the late answer to one request from that to the next. As on a serial line, it is waited
    /// for and thrown away.
    fn discard_late_answer(&mut self, deadline: Duration) {
        let Some(quiet_until) = self.quiet_until.take().filter(|until| *until > Instant::now()) else { return };
        let Ok(mut stream) = connect_device(&self.endpoint, Instant::now() + deadline) else { return };
        let (mut late, mut until) = (Vec::new(), quiet_until);
        while late.len() < rtu::BYTES_MAX && stream::append_available(&mut stream, &mut late, until).is_ok() {
            until = Instant::now() + SILENCE;
        }
        self.stray += u64::from(!late.is_empty());
        self.stream = Some(stream);
    }

    fn attempt_exchange(&mut self, clock: &dyn Clock, asked: TcpRequest<'_>) -> Result<ModbusResponse, Attempt> {
        self.transaction = self.transaction.wrapping_add(1);
        let open = self.stream.take();
        let connected = open.map_or_else(|| connect_device(&self.endpoint, asked.until), Ok);
        let mut stream = connected.map_err(|error| Attempt::Failed(build_unreachable_error(&self.endpoint, &error)))?;
        let began_ns = clock.now_ns();
        let bytes = match self.framing {
            TcpFraming::Tcp => encode_frame(self.transaction, asked.unit, asked.request),
            TcpFraming::Rtu => rtu::encode_frame(asked.unit, asked.request),
        };
        stream.write_all(&bytes).map_err(|error| Attempt::ClosedIdle(build_broken_error(&error)))?;
        let pdu = match self.framing {
            TcpFraming::Tcp => self.receive_matching(&mut stream, asked),
            TcpFraming::Rtu => in_rtu(&mut stream, asked),
        }?;
        let stamp = Stamp::of_request(began_ns, clock.now_ns());
        self.stream = Some(stream);
        Ok(ModbusResponse { pdu, stamp })
    }

    fn receive_matching(&mut self, stream: &mut TcpStream, asked: TcpRequest<'_>) -> Result<Vec<u8>, Attempt> {
        let mut strays = 0;
        loop {
            let (header, pdu) = match receive_frame(stream, asked.until) {
                Ok(found) => found,
                Err(Attempt::Failed(ModbusError::Timeout { .. })) if strays > 0 => {
                    return Err(build_stray_error(strays));
                }
                Err(error) => return Err(error),
            };
            if header.transaction == self.transaction {
                return of_unit(header.unit, asked.unit).map(|()| pdu).map_err(Attempt::Failed);
            }
            (self.stray, strays) = (self.stray + 1, strays + 1);
            if strays >= STRAY_MAX {
                return Err(build_stray_error(strays));
            }
        }
    }
}

/// A request on its way.
#[derive(Clone, Copy)]
struct TcpRequest<'a> {
    unit: u8,
    request: &'a [u8],
    answer_bytes: usize,
    until: Instant,
}

/// Why an attempt gave nothing.
enum Attempt {
    /// The other side had closed before a byte came.
    ClosedIdle(ModbusError),
    Failed(ModbusError),
}

/// Answers came, and none to this request: somebody mixes up the numbers.
fn build_stray_error(count: u64) -> Attempt {
    Attempt::Failed(ModbusError::Garbled(format!(
        "{count} answers came, none with the transaction number of this request; the device or the converter before it answers \
         with numbers of its own. Try framing=rtu, or let this box be its only client"
    )))
}

/// An RTU frame out of whatever comes.
fn in_rtu(stream: &mut TcpStream, asked: TcpRequest<'_>) -> Result<Vec<u8>, Attempt> {
    let wanted = rtu::Wanted::from_request(asked.unit, asked.request, asked.answer_bytes);
    let mut bytes = Vec::new();
    while bytes.len() < rtu::BYTES_MAX {
        match stream::append_available(stream, &mut bytes, asked.until) {
            Ok(()) => {}
            Err(Short::Silent) if !bytes.is_empty() => break,
            Err(why @ (Short::Closed | Short::Broken(_))) if bytes.is_empty() => {
                return Err(Attempt::ClosedIdle(convert_short(why)));
            }
            Err(other) => return Err(Attempt::Failed(convert_short(other))),
        }
        if let Some(found) = wanted.find_frame(&bytes) {
            return Ok(found[1..found.len() - 2].to_vec());
        }
    }
    Err(Attempt::Failed(ModbusError::Garbled(rtu::without_frame(&bytes))))
}

/// Some gateways answer as unit 0 or 255 whatever was asked.
fn of_unit(answered: u8, asked: u8) -> Result<(), ModbusError> {
    if answered == asked || matches!(answered, 0 | 255) {
        return Ok(());
    }
    Err(ModbusError::Garbled(format!("unit {answered} answered in place of unit {asked}")))
}

impl ModbusLine for TcpLine {
    fn exchange_pdu(
        &mut self,
        clock: &dyn Clock,
        unit: u8,
        request: &[u8],
        answer_bytes: usize,
    ) -> Result<ModbusResponse, ModbusError> {
        let mut port = self.port.lock().unwrap_or_else(PoisonError::into_inner);
        port.discard_late_answer(self.deadline);
        // Others may have been served before; the deadline is for this request alone.
        let until = Instant::now() + self.deadline;
        let answer = port.exchange_request(clock, TcpRequest { unit, request, answer_bytes, until });
        let is_out = matches!(answer, Err(ModbusError::Timeout { .. } | ModbusError::Garbled(_)));
        if port.framing == TcpFraming::Rtu && is_out {
            port.quiet_until = Some(Instant::now() + 2 * self.deadline);
        }
        self.stray = port.stray;
        answer
    }

    fn deadline(&self) -> Duration {
        self.deadline
    }

    fn late_answers(&self) -> u64 {
        self.stray
    }
}

fn connect_device(at: &Endpoint, until: Instant) -> io::Result<TcpStream> {
    let stream = stream::connect_host(at, until)?;
    let left = until.saturating_duration_since(Instant::now()).max(WRITE_LEAST);
    stream.set_write_timeout(Some(left))?;
    Ok(stream)
}

fn build_unreachable_error(Endpoint { host, port }: &Endpoint, error: &io::Error) -> ModbusError {
    let next = match error.kind() {
        ErrorKind::ConnectionRefused => {
            format!("{host} is there but nothing listens on port {port}: is Modbus TCP enabled, is the port right?")
        }
        ErrorKind::TimedOut | ErrorKind::WouldBlock => "Check the network cable and the address.".to_owned(),
        _ => "Check the address and the network.".to_owned(),
    };
    ModbusError::Line { what: format!("cannot connect: {error}"), next }
}

fn build_broken_error(error: &io::Error) -> ModbusError {
    let next = "It is opened again by itself; many meters serve one or two clients at a time.".to_owned();
    ModbusError::Line { what: format!("the connection broke: {error}"), next }
}

/// Header and PDU as one write, so that they leave in one packet.
pub fn encode_frame(transaction: u16, unit: u8, pdu: &[u8]) -> Vec<u8> {
    let length = convert_bounded(pdu.len() + 1, u16::MAX);
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
pub struct MbapHeader {
    /// Transaction identifier: the answer carries the one of its request.
    pub transaction: u16,
    /// Unit identifier: the device behind a gateway, as the address of a serial line.
    pub unit: u8,
    /// Bytes of the PDU, 1 to 253.
    pub pdu: usize,
}

/// `None`: this is not Modbus.
pub fn parse_header(bytes: [u8; HEADER]) -> Option<MbapHeader> {
    let [t_high, t_low, p_high, p_low, l_high, l_low, unit] = bytes;
    let pdu = usize::from(u16::from_be_bytes([l_high, l_low])).checked_sub(1)?;
    let modbus = (p_high, p_low) == (0, 0) && (1..=PDU_MAX).contains(&pdu);
    modbus.then_some(MbapHeader { transaction: u16::from_be_bytes([t_high, t_low]), unit, pdu })
}

fn receive_frame(stream: &mut TcpStream, until: Instant) -> Result<(MbapHeader, Vec<u8>), Attempt> {
    let mut head = [0_u8; HEADER];
    stream::fill_counting(stream, &mut head, until).map_err(|(got, why)| match why {
        Short::Closed | Short::Broken(_) if got == 0 => Attempt::ClosedIdle(convert_short(why)),
        why => Attempt::Failed(convert_short(why)),
    })?;
    let header = parse_header(head).ok_or_else(|| {
        Attempt::Failed(ModbusError::Garbled(format!(
            "{head:02X?} is no Modbus header; is this the port of another protocol, or does the converter want framing=rtu?"
        )))
    })?;
    let mut pdu = vec![0_u8; header.pdu];
    stream::fill_buffer(stream, &mut pdu, until).map_err(|why| Attempt::Failed(convert_short(why)))?;
    Ok((header, pdu))
}

fn convert_short(why: Short) -> ModbusError {
    match why {
        Short::Silent => ModbusError::Timeout {
            next: "Check the unit number and the power of the meter; a slow one may need timeout_ms=2000.".to_owned(),
        },
        Short::Closed => build_broken_error(&io::Error::new(ErrorKind::UnexpectedEof, "the meter closed it")),
        Short::Broken(error) => build_broken_error(&error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The frame that a unit answers to `[3, 0, 0, 0, 1]`.
    fn register(value: u8) -> Vec<u8> {
        rtu::encode_frame(1, &[3, 2, 0, value])
    }

    #[test]
    fn a_late_answer_is_not_taken_for_that_to_the_next_request() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
        let port = listener.local_addr().expect("bound").port();
        let serving = std::thread::spawn(move || {
            let mut request = [0; 8];
            let (mut first, _) = listener.accept().expect("connects");
            std::io::Read::read_exact(&mut first, &mut request).expect("asks");
            // Silent until it is given up; the serial side answers all the same, onto the new connection.
            let (mut second, _) = listener.accept().expect("connects again");
            std::thread::sleep(Duration::from_millis(50));
            second.write_all(&register(1)).expect("late");
            std::io::Read::read_exact(&mut second, &mut request).expect("asks");
            second.write_all(&register(2)).expect("answers");
            std::thread::sleep(Duration::from_millis(300));
        });
        let at = Endpoint { host: "127.0.0.1".to_owned(), port };
        let mut line = TcpLine::new(&at, TcpFraming::Rtu, Duration::from_millis(150)).expect("a line");
        let clock = adapter_core::clock::SystemClock::new();
        let mut ask = || line.exchange_pdu(&clock, 1, &[3, 0, 0, 0, 1], 4).map(|response| response.pdu);
        assert!(matches!(ask(), Err(ModbusError::Timeout { .. })));
        assert_eq!(ask().expect("an answer"), [3, 2, 0, 2]);
        drop(line);
        serving.join().expect("no panic");
    }

    #[test]
    fn the_header_of_the_guide() {
        // Guide 3.1.3, example: transaction 1501 hex, unit FF, read register 4 with a length of 6.
        let bytes = encode_frame(0x1501, 0xFF, &[3, 0, 4, 0, 1]);
        assert_eq!(bytes, [0x15, 0x01, 0, 0, 0, 6, 0xFF, 3, 0, 4, 0, 1]);
        let head = parse_header(*bytes.first_chunk().expect("seven bytes"));
        assert_eq!(head, Some(MbapHeader { transaction: 0x1501, unit: 0xFF, pdu: 5 }));
        assert_eq!(parse_header(*b"HTTP/1."), None);
    }
}
