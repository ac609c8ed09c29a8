//! The other side: the simulated machine as a Modbus TCP meter, for other people's clients and for trying the box without a
//! machine.
//!
//! Unit 1 sits in the machine's supply, unit 2 in that of the spindle drive; both speak the same profile. While the
//! simulated meter drops out it does not answer, as a meter does. Registers that the profile does not name are 0 within the
//! profile's span and do not exist beyond it.
//!
//! Limits: 16 connections, a minute of silence on each.

use adapter_core::clock::Clock;
use modbus::pdu::{self, RegisterBlock};
use modbus::profile::Profile;
use modbus::register::RegisterMeaning;
use modbus::tcp::{encode_frame, parse_header};
use simulated::{MeterValues, Simulated, SimulatedMeter};
use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

const CONNECTIONS_MAX: usize = 16;
const IDLE_MAX: Duration = Duration::from_secs(60);
/// Connections look this often whether the server shall end.
const LOOK: Duration = Duration::from_millis(100);
/// Power factor of everything, for the current of the whole machine, which the simulation does not know.
const POWER_FACTOR: f64 = 0.85;

/// The unit in the machine's supply.
pub const UNIT_MACHINE: u8 = 1;
/// The unit in the supply of the spindle drive.
pub const UNIT_SPINDLE: u8 = 2;

/// A server that answers until it is dropped.
pub struct ModbusServer {
    at: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
}

struct ServedMeter {
    meter: SimulatedMeter,
    clock: Arc<dyn Clock>,
    profile: Profile,
    stop: Arc<AtomicBool>,
    connections: AtomicUsize,
}

impl ModbusServer {
    /// Serves the machine's meter at this address; port 0 takes a free one.
    ///
    /// # Errors
    /// When the address cannot be listened on.
    pub fn start(listen: SocketAddr, machine: &Simulated, clock: Arc<dyn Clock>, profile: Profile) -> io::Result<Self> {
        let listener = TcpListener::bind(listen)?;
        listener.set_nonblocking(true)?;
        let at = listener.local_addr()?;
        let stop = Arc::new(AtomicBool::new(false));
        let connections = AtomicUsize::new(0);
        let served = Arc::new(ServedMeter { meter: machine.meter(), clock, profile, stop: stop.clone(), connections });
        let thread =
            std::thread::Builder::new().name("modbus".to_owned()).spawn(move || accept_clients(&listener, &served))?;
        Ok(Self { at, stop, thread: Some(thread) })
    }

    /// Address and port on which it listens.
    #[must_use]
    pub fn listen_address(&self) -> SocketAddr {
        self.at
    }
}

impl Drop for ModbusServer {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            // A panic in it was told by the thread itself.
            let _ = thread.join();
        }
    }
}

fn accept_clients(listener: &TcpListener, served: &Arc<ServedMeter>) {
    while !served.stop.load(Ordering::SeqCst) {
        let Ok((stream, _)) = listener.accept() else {
            std::thread::sleep(Duration::from_millis(5));
            continue;
        };
        if served.connections.fetch_add(1, Ordering::SeqCst) >= CONNECTIONS_MAX {
            served.connections.fetch_sub(1, Ordering::SeqCst);
            continue;
        }
        let of_client = served.clone();
        let client = move || {
            // How a connection ends is the client's own affair.
            let _ = serve_client(&of_client, stream);
            of_client.connections.fetch_sub(1, Ordering::SeqCst);
        };
        if std::thread::Builder::new().name("modbus client".to_owned()).spawn(client).is_err() {
            served.connections.fetch_sub(1, Ordering::SeqCst);
        }
    }
}

fn serve_client(served: &ServedMeter, mut stream: TcpStream) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(LOOK))?;
    stream.set_write_timeout(Some(Duration::from_secs(1)))?;
    loop {
        let mut head = [0_u8; 7];
        fill_buffer(served, &mut stream, &mut head)?;
        let head = parse_header(head).ok_or(ErrorKind::InvalidData)?;
        let mut request = vec![0_u8; head.pdu];
        fill_buffer(served, &mut stream, &mut request)?;
        if let Some(answer) = served.answer_request(head.unit, &request) {
            stream.write_all(&encode_frame(head.transaction, head.unit, &answer))?;
        }
    }
}

fn fill_buffer(served: &ServedMeter, stream: &mut TcpStream, mut into: &mut [u8]) -> io::Result<()> {
    let until = Instant::now() + IDLE_MAX;
    while !into.is_empty() {
        if served.stop.load(Ordering::SeqCst) || Instant::now() > until {
            return Err(ErrorKind::ConnectionAborted.into());
        }
        match stream.read(into) {
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Ok(count) => into = &mut into[count..],
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

impl ServedMeter {
    /// `None`: the meter is silent at this moment.
    fn answer_request(&self, unit: u8, request: &[u8]) -> Option<Vec<u8>> {
        let function = request.first().copied().unwrap_or(0);
        let refuse = |code| Some(pdu::encode_refusal(function, code));
        let spindle = match unit {
            UNIT_SPINDLE => true,
            UNIT_MACHINE | 0 | 255 => false,
            _ => return refuse(11),
        };
        match pdu::parse_request(request) {
            Ok(block) if block.table != self.profile.table => refuse(1),
            Ok(block) => {
                let values = self.meter.read_values(self.clock.now_ns())?;
                Some(self.read_registers(&block, &values, spindle).map_or_else(
                    || pdu::encode_refusal(function, 2),
                    |registers| pdu::encode_answer(block.table, &registers),
                ))
            }
            Err(code) => refuse(code),
        }
    }

    /// `None`: not all of these registers exist.
    fn read_registers(&self, block: &RegisterBlock, values: &MeterValues, spindle: bool) -> Option<Vec<u16>> {
        let registers = &self.profile.registers;
        let first = registers.iter().map(|register| usize::from(register.address)).min()?;
        let end = |address: u16, count: u16| usize::from(address) + usize::from(count);
        let last = registers.iter().map(|register| end(register.address, register.format.register_count())).max()?;
        let (from, to) = (usize::from(block.start), end(block.start, block.count));
        if from < first || to > last {
            return None;
        }
        let mut image = vec![0_u16; to - from];
        for register in registers {
            let number = find_number(register.meaning, values, spindle).unwrap_or(f64::NAN);
            let number = (number - register.conversion.offset) / register.conversion.scale;
            let words = register.format.encode(number, register.order);
            for (offset, word) in words.into_iter().enumerate() {
                let place = (usize::from(register.address) + offset).checked_sub(from);
                if let Some(place) = place.and_then(|place| image.get_mut(place)) {
                    *place = word;
                }
            }
        }
        Some(image)
    }
}

/// `None`: the simulated meter does not measure it.
fn find_number(quantity: RegisterMeaning, values: &MeterValues, spindle: bool) -> Option<f64> {
    let power_w = if spindle { values.spindle_power_w } else { values.total_power_w };
    let phase_v = values.supply_voltage_v / 3.0_f64.sqrt();
    let current_a = match spindle {
        true => values.spindle_current_a,
        false => power_w.abs() / (3.0 * phase_v * POWER_FACTOR).max(1.0),
    };
    match quantity {
        RegisterMeaning::Power => Some(power_w),
        RegisterMeaning::PhasePower(_) => Some(power_w / 3.0),
        RegisterMeaning::Current(_) => Some(current_a),
        RegisterMeaning::Voltage(_) => Some(phase_v),
        RegisterMeaning::LineVoltage => Some(values.supply_voltage_v),
        RegisterMeaning::PowerFactor => Some(POWER_FACTOR),
        RegisterMeaning::ApparentPower => Some(power_w.abs() / POWER_FACTOR),
        RegisterMeaning::Energy | RegisterMeaning::Frequency => None,
        RegisterMeaning::Channel(channel) => match channel.name() {
            "bearing_temperature_c" => Some(values.bearing_temperature_c),
            "ambient_temperature_c" => Some(values.ambient_temperature_c),
            "spindle_power_w" => Some(values.spindle_power_w),
            "total_power_w" => Some(values.total_power_w),
            _ => None,
        },
    }
}
