//! One poll of a meter: every block is asked for, and one that the meter does not give as a whole is read in parts from then on.

use super::line::{ModbusError, ModbusLine};
use super::pdu::{NoRegisters, RegisterBlock};
use super::plan::PollBlocks;
use super::register::MeterRegister;
use adapter_core::address::SerialTarget;
use adapter_core::clock::{Clock, SECOND_NS, TimeNs};
use adapter_core::reading::{Absence, Stamp};
use std::time::Duration;

/// What was refused is asked for again after this: a meter that starts refuses for seconds what it has later. What a meter really
/// does not have costs some requests more a minute.
const ASK_AGAIN_NS: i64 = 60 * SECOND_NS;

/// What a block gave, and when.
type BlockAnswer = (Result<Vec<u16>, u8>, Stamp);

/// The blocks of a meter and what the last poll brought.
#[derive(Debug, Clone)]
pub(super) struct RegisterPoll {
    /// As the profile has it.
    initial_blocks: PollBlocks,
    /// As the meter gives it.
    blocks: PollBlocks,
    answers: Vec<BlockAnswer>,
    /// When whole blocks were last asked for.
    whole_ns: TimeNs,
    /// Stamp of the last poll, for what was not read in it.
    stamp: Stamp,
}

impl RegisterPoll {
    pub(super) fn new(blocks: PollBlocks) -> Self {
        Self {
            initial_blocks: blocks.clone(),
            blocks,
            answers: Vec::new(),
            whole_ns: TimeNs::MIN,
            stamp: Stamp::from_exact_time(0),
        }
    }

    /// Asks for everything once. A block that is refused is kept as refused while another one is answered.
    ///
    /// # Errors
    /// Why nothing came, with what was asked for.
    pub(super) fn read(
        &mut self,
        line: &mut dyn ModbusLine,
        clock: &dyn Clock,
        unit: u8,
    ) -> Result<(), (ModbusError, String)> {
        self.answers.clear();
        let now_ns = clock.now_ns();
        self.stamp = Stamp::from_exact_time(now_ns);
        if !self.is_split() {
            self.whole_ns = now_ns;
        } else if !(0..ASK_AGAIN_NS).contains(&now_ns.saturating_sub(self.whole_ns)) {
            // A clock that was set back asks, too.
            self.blocks = self.initial_blocks.clone();
            self.whole_ns = now_ns;
        }
        let mut refused = None;
        while let Some(block) = self.blocks.blocks.get(self.answers.len()).copied() {
            match ask_block(line, clock, unit, &block) {
                Ok((registers, stamp)) => self.answers.push((Ok(registers), stamp)),
                Err(ModbusError::Refused(code)) => {
                    refused.get_or_insert((code, block.describe_block()));
                    self.record_refusal(code, clock);
                }
                Err(fault) => return Err((fault, block.describe_block())),
            }
        }
        if self.answers.iter().any(|(answer, _)| answer.is_ok()) {
            return Ok(());
        }
        // Perhaps it is another meter now: the next poll begins with whole blocks again.
        self.blocks = self.initial_blocks.clone();
        let (code, told) = refused.unwrap_or((2, "any register".to_owned()));
        Err((ModbusError::Refused(code), told))
    }

    /// Exception 2 is an address that is not there, 3 a number of registers that is too great: the block is split, and its
    /// parts are asked for next. Any other one is an answer.
    fn record_refusal(&mut self, code: u8, clock: &dyn Clock) {
        if matches!(code, 2 | 3) {
            self.blocks.split_block(self.answers.len());
        } else {
            self.answers.push((Err(code), Stamp::from_exact_time(clock.now_ns())));
        }
    }

    /// The registers of a number, and when they were read.
    pub(super) fn find_registers(&self, register: &MeterRegister) -> Result<(&[u16], Stamp), (Absence, Stamp)> {
        let (block, offset) = self.blocks.find_place(register).ok_or((Absence::NotSupported, self.stamp))?;
        let (answer, stamp) = self.answers.get(block).ok_or((Absence::NotYetRead, self.stamp))?;
        match answer {
            Ok(registers) => Ok((registers.get(offset..).unwrap_or_default(), *stamp)),
            Err(_) => Err((Absence::Refused, *stamp)),
        }
    }

    /// A number, in the unit of its quantity.
    pub(super) fn find_number(&self, register: &MeterRegister) -> Result<(f64, Stamp), (Absence, Stamp)> {
        let (registers, stamp) = self.find_registers(register)?;
        // What a meter does not measure it gives as an IEEE number that is none, or as a number of its own that says so.
        register.decode_number(registers).map(|number| (number, stamp)).ok_or((Absence::NotSupported, stamp))
    }

    /// Everything that came, in order, with the time of its first block.
    pub(super) fn list_all_registers(&self) -> (impl Iterator<Item = u16> + Clone + '_, Stamp) {
        let registers = self.answers.iter().filter_map(|(answer, _)| answer.as_ref().ok()).flatten().copied();
        (registers, self.answers.first().map_or(self.stamp, |(_, stamp)| *stamp))
    }

    /// Does the meter have the registers of this number, as far as is known?
    pub(super) fn has_register(&self, register: &MeterRegister) -> bool {
        self.blocks.find_place(register).is_some()
    }

    /// Requests of a poll; more than the profile needs where the meter gives less at once.
    pub(super) fn count_requests(&self) -> usize {
        self.blocks.blocks.len()
    }

    /// Did the meter refuse a block of the profile?
    pub(super) fn is_split(&self) -> bool {
        self.blocks != self.initial_blocks
    }

    /// What a poll takes on a serial line.
    pub(super) fn wire_time(&self, line: &SerialTarget) -> Duration {
        self.blocks.wire_time(line)
    }
}

fn ask_block(
    line: &mut dyn ModbusLine,
    clock: &dyn Clock,
    unit: u8,
    block: &RegisterBlock,
) -> Result<(Vec<u16>, Stamp), ModbusError> {
    let answer = line.exchange_pdu(clock, unit, &block.encode_request(), block.answer_bytes())?;
    match block.parse_answer(&answer.pdu) {
        Ok(registers) => Ok((registers, answer.stamp)),
        Err(NoRegisters::Refused(code)) => Err(ModbusError::Refused(code)),
        Err(NoRegisters::Other(bytes)) => {
            Err(ModbusError::Garbled(format!("{bytes} bytes that answer another question")))
        }
    }
}
