//! The EDA9033A three-phase meter in its native protocol.
//!
//! Source: the protocol as two revisions of one production driver speak it. Request, 7 bytes:
//! `4C 57 address 30 0E check 0D`. Answer, 45 bytes: `4C 57 address 30 0E`, 38 bytes of data, check, `0D`. The check of the
//! request is the low byte of the sum from the address to the command; that of the answer is taken to be the same sum
//! with the data in it, which is to be confirmed on a meter. Numbers are big-endian: voltage and current of each phase
//! from byte 5 on, without sign; total power at 17 with the highest bit as its sign, then reactive power, power factor,
//! and the power of each phase at 23, 25 and 27. 10 000 counts are 250 V, 5 A, and their product (three times that for the
//! total). Power fed back stays negative.

use crate::address::{Circuit, EdaTarget, SerialTarget};
use crate::channel::ChannelId;
use crate::clock::Clock;
use crate::driver::{Fact, Source, SourceError, SourceProblem};
use crate::electric::{Doubts, SupplyCheck, SupplyValues};
pub use crate::modbus::line::{ModbusError, serial_fault, serial_silence};
use crate::reading::{Reading, Stamp};
use adapter_core::integer::saturate_to_wait_ns;
use device_line::serial::LineConflict;
use device_line::serial::{Bus, SharedBus, wire_time};
use std::sync::PoisonError;
use std::time::{Duration, Instant};

const HEAD: [u8; 2] = [0x4C, 0x57];
const COMMAND: [u8; 2] = [0x30, 0x0E];
const END: u8 = 0x0D;
const REQUEST_BYTES: usize = 7;
const ANSWER_BYTES: usize = 45;
const BYTES_MAX: usize = 1024;

const NOMINAL_V: f64 = 250.0;
const NOMINAL_A: f64 = 5.0;
const COUNTS: f64 = 10_000.0;

/// The meter as a source.
pub struct Eda9033a {
    name: String,
    bus: SharedBus,
    address: u8,
    ct: f64,
    deadline: Duration,
    channels: Vec<ChannelId>,
    late: u64,
    check: SupplyCheck,
    doubts: Doubts,
}

impl Eda9033a {
    /// A meter on this line. `name` is the address.
    ///
    /// # Errors
    /// A line that another address uses at another speed or parity.
    pub fn new(name: &str, line: &SerialTarget, meter: &EdaTarget) -> Result<Self, LineConflict> {
        let EdaTarget { address, ct, circuit, timeout: deadline } = *meter;
        let names: &[&str] = match circuit {
            Circuit::Machine => &["total_power_w", "supply_voltage_v"],
            Circuit::Spindle => &["spindle_power_w", "supply_voltage_v", "spindle_current_a"],
        };
        let channels = names.iter().filter_map(|name| ChannelId::from_name(name)).collect();
        let (check, doubts) = (SupplyCheck::default(), Doubts::default());
        Ok(Self {
            name: name.to_owned(),
            bus: Bus::from_target(line)?,
            address,
            ct,
            deadline,
            channels,
            late: 0,
            check,
            doubts,
        })
    }

    fn read_values(&mut self, clock: &dyn Clock) -> Result<(Values, Stamp), ModbusError> {
        let mut bus = self.bus.lock().unwrap_or_else(PoisonError::into_inner);
        let answer = exchange_frames(&mut bus, clock, self.address, self.deadline);
        if matches!(answer, Err(ModbusError::Timeout { .. } | ModbusError::Garbled(_))) {
            bus.keep_quiet(2 * self.deadline);
        }
        self.late = bus.late_answers();
        answer.map(|(frame, stamp)| (Values::from_frame(&frame, self.ct), stamp))
    }
}

fn compute_checksum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte))
}

fn build_request(address: u8) -> [u8; REQUEST_BYTES] {
    let check = compute_checksum(&[address, COMMAND[0], COMMAND[1]]);
    [HEAD[0], HEAD[1], address, COMMAND[0], COMMAND[1], check, END]
}

fn exchange_frames(
    bus: &mut Bus,
    clock: &dyn Clock,
    address: u8,
    deadline: Duration,
) -> Result<([u8; ANSWER_BYTES], Stamp), ModbusError> {
    let target = bus.target().clone();
    let failed = |error| serial_fault(&error, &target);
    bus.send_request(&build_request(address)).map_err(failed)?;
    let (began_ns, until) = (clock.now_ns(), Instant::now() + deadline);
    let mut bytes = Vec::new();
    while bytes.len() < BYTES_MAX && bus.receive_bytes(until, &mut bytes).map_err(failed)? {
        if let Some(frame) = find_answer(&bytes, address) {
            let wire = wire_time(&target, REQUEST_BYTES + ANSWER_BYTES);
            let wire_ns = saturate_to_wait_ns(wire);
            let ended_ns = clock.now_ns();
            // Where the line is real, the answer took the later part of that time.
            let spent_ns = if wire_ns < ended_ns - began_ns { wire_ns } else { 0 };
            return Ok((frame, Stamp::of_request(began_ns, ended_ns - spent_ns)));
        }
    }
    if bytes.is_empty() { Err(serial_silence(&target)) } else { Err(no_frame(&bytes)) }
}

fn no_frame(bytes: &[u8]) -> ModbusError {
    let shown: Vec<String> = bytes.iter().take(16).map(|byte| format!("{byte:02X}")).collect();
    ModbusError::Garbled(format!("{} bytes without a good frame among them: {}", bytes.len(), shown.join(" ")))
}

/// The answer among the bytes, wherever it begins: two-wire adapters return our own request first.
fn find_answer(bytes: &[u8], address: u8) -> Option<[u8; ANSWER_BYTES]> {
    let head = [HEAD[0], HEAD[1], address, COMMAND[0], COMMAND[1]];
    bytes.windows(ANSWER_BYTES).find_map(|window| {
        let frame: &[u8; ANSWER_BYTES] = window.first_chunk()?;
        let whole = frame[..5] == head && frame[44] == END && compute_checksum(&frame[2..43]) == frame[43];
        whole.then_some(*frame)
    })
}

/// What an answer says.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Values {
    power_w: f64,
    phases_v: [f64; 3],
    current_a: f64,
}

impl Values {
    fn from_frame(frame: &[u8; ANSWER_BYTES], ct: f64) -> Self {
        let word = |at: usize| u16::from_be_bytes([frame[at], frame[at + 1]]);
        let share = |at: usize| f64::from(word(at)) / COUNTS;
        Self {
            power_w: decode_signed(word(17)) / COUNTS * 3.0 * NOMINAL_V * NOMINAL_A * ct,
            phases_v: [5, 9, 13].map(|at| NOMINAL_V * share(at)),
            current_a: NOMINAL_A * ct * [7, 11, 15].map(share).iter().sum::<f64>() / 3.0,
        }
    }

    fn between_phases_v(&self) -> f64 {
        3.0_f64.sqrt() * self.phases_v.iter().sum::<f64>() / 3.0
    }

    fn collect_supply_values(&self) -> SupplyValues {
        SupplyValues { power: Some(self.power_w), voltage: self.phases_v.map(Some), ..SupplyValues::default() }
    }
}

/// Fifteen bits and a sign.
fn decode_signed(word: u16) -> f64 {
    let size = f64::from(word & 0x7FFF);
    if word & 0x8000 == 0 { size } else { -size }
}

impl Source for Eda9033a {
    fn name(&self) -> &str {
        &self.name
    }

    fn channels(&self) -> &[ChannelId] {
        &self.channels
    }

    fn period(&self) -> Duration {
        let target = self.bus.lock().unwrap_or_else(PoisonError::into_inner).target().clone();
        let wire = wire_time(&target, REQUEST_BYTES + ANSWER_BYTES) + 2 * device_line::serial::compute_silence(&target);
        (wire * 5 / 4).max(Duration::from_millis(100))
    }

    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        let asked = self.read_values(clock);
        let (values, stamp) =
            asked.map_err(|fault| fault.of_source(&self.name, "all values".to_owned(), self.deadline))?;
        self.doubts = self.check.judge_values(&values.collect_supply_values());
        let all = self.doubts.everything;
        let numbers =
            [(values.power_w, all), (values.between_phases_v(), all || self.doubts.voltage), (values.current_a, all)];
        out.extend(self.channels.iter().zip(numbers).map(|(channel, (number, is_doubted))| match is_doubted {
            true => Reading::from_implausible(*channel, stamp, number),
            false => Reading::from_number(*channel, stamp, number),
        }));
        Ok(())
    }

    fn collect_facts(&self) -> Vec<Fact> {
        let resolution_w = 3.0 * NOMINAL_V * NOMINAL_A * self.ct / COUNTS;
        #[expect(clippy::cast_precision_loss, reason = "a count of late answers stays far below 2^53")]
        let late = self.late as f64;
        vec![
            Fact::from_text("meter", "EDA9033A, native protocol"),
            Fact::from_number("power_resolution_w", resolution_w),
            Fact::from_number("late_answers", late),
        ]
    }

    fn list_problems(&self) -> Vec<SourceProblem> {
        self.doubts.problems.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(power: u16) -> Vec<u8> {
        let mut frame = vec![0x4C, 0x57, 1, 0x30, 0x0E];
        for word in [9200_u16, 4000, 9200, 4000, 9200, 4000, power] {
            frame.extend(word.to_be_bytes());
        }
        frame.resize(43, 0);
        frame.push(compute_checksum(&frame[2..]));
        frame.push(END);
        frame
    }

    #[test]
    fn the_request_is_that_of_the_source() {
        assert_eq!(build_request(1), [0x4C, 0x57, 0x01, 0x30, 0x0E, 0x3F, 0x0D]);
    }

    #[test]
    fn braking_is_negative_and_transformers_count() {
        let bytes = [&[0xFF, 0x00][..], &build_request(1), &answer(0x8000 | 400)].concat();
        let values = Values::from_frame(&find_answer(&bytes, 1).expect("behind noise and echo"), 20.0);
        // One count is 0.375 W times the ratio.
        assert!((values.power_w + 400.0 * 0.375 * 20.0).abs() < 1e-9, "{values:?}");
        assert!((values.between_phases_v() - 3.0_f64.sqrt() * 230.0).abs() < 1e-9);
        assert!((values.current_a - 40.0).abs() < 1e-9);
    }

    #[test]
    fn another_address_or_a_broken_frame_is_no_answer() {
        assert_eq!(find_answer(&answer(1), 2), None);
        let mut broken = answer(1);
        broken[20] ^= 1;
        assert_eq!(find_answer(&broken, 1), None);
        assert_eq!(find_answer(&answer(1)[..44], 1), None);
    }
}
