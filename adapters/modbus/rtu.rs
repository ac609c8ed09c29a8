//! Modbus over a serial line.
//!
//! Source: Modbus over Serial Line V1.02, 2.5.1 (RTU framing). The length of a good answer is known from the request, so
//! a frame is found by address, function, length and CRC wherever it begins: bytes of noise in front of it, and the echo
//! of our own request that two-wire adapters return, do no harm.

use super::crc::{compute_crc, is_whole};
use super::line::{ModbusError, ModbusLine, ModbusResponse, serial_fault, serial_silence};
use adapter_core::clock::Clock;
use adapter_core::integer::saturate_to_wait_ns;
use adapter_core::reading::Stamp;
use device_line::serial::{Bus, SharedBus, wire_time};
use std::sync::PoisonError;
use std::time::{Duration, Instant};

/// Address before, CRC behind.
const AROUND: usize = 3;
/// An exception: address, function, code, CRC.
const EXCEPTION: usize = 5;
/// More bytes than this without a frame among them are noise.
pub(super) const BYTES_MAX: usize = 1024;

pub(super) struct RtuLine {
    bus: SharedBus,
    deadline: Duration,
    late: u64,
}

impl RtuLine {
    pub(super) fn new(bus: SharedBus, deadline: Duration) -> Self {
        Self { bus, deadline, late: 0 }
    }
}

impl ModbusLine for RtuLine {
    fn exchange_pdu(
        &mut self,
        clock: &dyn Clock,
        unit: u8,
        request: &[u8],
        answer_bytes: usize,
    ) -> Result<ModbusResponse, ModbusError> {
        let mut bus = self.bus.lock().unwrap_or_else(PoisonError::into_inner);
        let wanted = Wanted::from_request(unit, request, answer_bytes);
        let answer = exchange_frames(&mut bus, clock, &encode_frame(unit, request), &wanted, self.deadline);
        if matches!(answer, Err(ModbusError::Timeout { .. } | ModbusError::Garbled(_))) {
            bus.keep_quiet(2 * self.deadline);
        }
        self.late = bus.late_answers();
        answer
    }

    fn deadline(&self) -> Duration {
        self.deadline
    }

    fn late_answers(&self) -> u64 {
        self.late
    }
}

fn exchange_frames(
    bus: &mut Bus,
    clock: &dyn Clock,
    frame: &[u8],
    wanted: &Wanted,
    deadline: Duration,
) -> Result<ModbusResponse, ModbusError> {
    let target = bus.target().clone();
    let failed = |error| serial_fault(&error, &target);
    bus.send_request(frame).map_err(failed)?;
    let (began_ns, until) = (clock.now_ns(), Instant::now() + deadline);
    let mut bytes = Vec::new();
    while bytes.len() < BYTES_MAX && bus.receive_bytes(until, &mut bytes).map_err(failed)? {
        if let Some(found) = wanted.find_frame(&bytes) {
            let sent = wire_time(&target, frame.len());
            let received = wire_time(&target, found.len());
            let pdu = found[1..found.len() - 2].to_vec();
            return Ok(ModbusResponse { pdu, stamp: estimate_stamp(began_ns, clock.now_ns(), sent, received) });
        }
    }
    if bytes.is_empty() {
        return Err(serial_silence(&target));
    }
    Err(ModbusError::Garbled(without_frame(&bytes)))
}

/// What came instead of an answer.
pub(super) fn without_frame(bytes: &[u8]) -> String {
    format!("{} bytes without a good frame among them: {}", bytes.len(), format_excerpt(bytes))
}

/// Unit, request and check.
pub(super) fn encode_frame(unit: u8, request: &[u8]) -> Vec<u8> {
    let mut frame = vec![unit];
    frame.extend(request);
    let check = compute_crc(&frame);
    frame.extend(check);
    frame
}

/// The value was taken after the request had left and before the answer began to come; the wire's own time is known.
fn estimate_stamp(began_ns: i64, ended_ns: i64, sent: Duration, received: Duration) -> Stamp {
    let wire_ns = (saturate_to_wait_ns(sent), saturate_to_wait_ns(received));
    if wire_ns.0 + wire_ns.1 > ended_ns - began_ns {
        // A line that is faster than its baud rate says: a pseudo terminal, or an adapter with a buffer.
        return Stamp::of_request(began_ns, ended_ns);
    }
    Stamp::of_request(began_ns + wire_ns.0, ended_ns - wire_ns.1)
}

fn format_excerpt(bytes: &[u8]) -> String {
    let shown: Vec<String> = bytes.iter().take(16).map(|byte| format!("{byte:02X}")).collect();
    shown.join(" ")
}

/// The frame that answers.
pub(super) struct Wanted {
    unit: u8,
    function: u8,
    bytes: usize,
}

impl Wanted {
    /// The answer to this request, whose good answer has so many bytes without address and check.
    pub(super) fn from_request(unit: u8, request: &[u8], answer_bytes: usize) -> Self {
        Self { unit, function: request.first().copied().unwrap_or(0), bytes: answer_bytes + AROUND }
    }

    /// The whole frame, wherever it begins.
    pub(super) fn find_frame<'a>(&self, bytes: &'a [u8]) -> Option<&'a [u8]> {
        (0..bytes.len()).find_map(|at| self.match_frame(&bytes[at..]))
    }

    fn match_frame<'a>(&self, bytes: &'a [u8]) -> Option<&'a [u8]> {
        let [unit, function, third, ..] = *bytes else { return None };
        if unit != self.unit {
            return None;
        }
        let length = match function {
            f if f == self.function && usize::from(third) + EXCEPTION == self.bytes => self.bytes,
            f if f == self.function | 0x80 => EXCEPTION,
            _ => return None,
        };
        bytes.get(..length).filter(|frame| is_whole(frame))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WANTED: Wanted = Wanted { unit: 1, function: 4, bytes: 9 };

    fn frame(body: &[u8]) -> Vec<u8> {
        [body, &compute_crc(body)].concat()
    }

    #[test]
    fn a_frame_is_found_behind_noise_and_the_echo_of_the_request() {
        let answer = frame(&[1, 4, 4, 0x43, 0x66, 0x33, 0x33]);
        let echo = frame(&[1, 4, 0, 0, 0, 2]);
        let bytes = [&[0x00, 0xFF, 0x01][..], &echo, &answer].concat();
        assert_eq!(WANTED.find_frame(&bytes), Some(&answer[..]));
        assert_eq!(WANTED.find_frame(&bytes[..bytes.len() - 1]), None);
    }

    #[test]
    fn another_unit_length_or_check_is_no_answer() {
        for body in [&[2, 4, 4, 0, 0, 0, 0][..], &[1, 3, 4, 0, 0, 0, 0], &[1, 4, 2, 0, 0]] {
            assert_eq!(WANTED.find_frame(&frame(body)), None);
        }
        let mut broken = frame(&[1, 4, 4, 0, 0, 0, 0]);
        broken[4] ^= 0x10;
        assert_eq!(WANTED.find_frame(&broken), None);
        assert!(WANTED.find_frame(&frame(&[1, 0x84, 2])).is_some());
    }

    #[test]
    fn the_wire_is_left_out_of_the_stamp_where_it_was_there() {
        let ms = |count: u64| Duration::from_millis(count);
        let stamp = estimate_stamp(0, 100_000_000, ms(8), ms(42));
        assert_eq!((stamp.mid_ns, stamp.half_width_ns), (33_000_000, 25_000_000));
        assert_eq!(estimate_stamp(0, 10, ms(8), ms(42)).mid_ns, 5);
    }
}
