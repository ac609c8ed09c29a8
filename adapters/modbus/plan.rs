//! The fewest blocks that hold every register of a profile, and what they take on the wire.

use super::pdu::RegisterBlock;
use super::profile::{MeterRegister, Profile};
use crate::address::SerialTarget;
use crate::serial;
use std::time::Duration;

/// More requests than this in one poll are a sign of a profile that should be two.
const BLOCKS_MAX: usize = 8;

/// Address, function, register, count, CRC.
const REQUEST_BYTES: usize = 8;
/// Address, function, byte count, CRC.
const ANSWER_AROUND: usize = 5;

/// The blocks of one poll.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PollBlocks {
    /// In the order of their addresses; no two overlap.
    pub blocks: Vec<RegisterBlock>,
}

impl PollBlocks {
    /// The fewest blocks within the profile's limits.
    ///
    /// # Errors
    /// In words: a profile that needs too many requests.
    pub fn of(profile: &Profile) -> Result<Self, String> {
        let end = |register: &MeterRegister| u32::from(register.address) + u32::from(register.format.registers());
        let mut spans: Vec<(u32, u32)> =
            profile.registers.iter().map(|register| (u32::from(register.address), end(register))).collect();
        spans.sort_unstable();
        let mut joined: Vec<(u32, u32)> = Vec::new();
        for (from, to) in spans {
            match joined.last_mut().filter(|last| fits(last, from, to, profile)) {
                Some(last) => last.1 = last.1.max(to),
                None => joined.push((from, to)),
            }
        }
        if joined.len() > BLOCKS_MAX {
            return Err(format!("{} requests per poll; at most {BLOCKS_MAX}, so make it two profiles", joined.len()));
        }
        let word = |number: u32| u16::try_from(number).unwrap_or(u16::MAX);
        let block =
            |(from, to): (u32, u32)| RegisterBlock { table: profile.table, start: word(from), count: word(to - from) };
        Ok(Self { blocks: joined.into_iter().map(block).collect() })
    }

    /// In which block a register stands, and how many registers into it.
    pub(super) fn place(&self, register: &MeterRegister) -> Option<(usize, usize)> {
        let holds = |block: &RegisterBlock| {
            register.address >= block.start
                && register.address - block.start + register.format.registers() <= block.count
        };
        let at = self.blocks.iter().position(holds)?;
        Some((at, usize::from(register.address - self.blocks[at].start)))
    }

    /// What a poll takes on a serial line, with all silences.
    #[must_use]
    pub fn wire_time(&self, line: &SerialTarget) -> Duration {
        self.blocks.iter().map(|block| wire_time(line, block.count)).sum()
    }
}

fn fits(last: &(u32, u32), from: u32, to: u32, profile: &Profile) -> bool {
    let gap = from.saturating_sub(last.1);
    to.max(last.1) - last.0 <= u32::from(profile.block_max) && gap <= u32::from(profile.block_gap)
}

/// What a request for so many registers and its answer take on a serial line, with the silence behind each; the meter's
/// own time to think comes on top.
#[must_use]
pub fn wire_time(line: &SerialTarget, registers: u16) -> Duration {
    let characters = REQUEST_BYTES + ANSWER_AROUND + 2 * usize::from(registers);
    serial::wire_time(line, characters) + 2 * serial::silence(line)
}

#[cfg(test)]
mod tests {
    use super::super::profile::{SHIPPED, find};
    use super::*;
    use crate::address::Parity;
    use std::path::PathBuf;

    fn blocks(name: &str) -> Vec<(u16, u16)> {
        let plan = PollBlocks::of(&find(name, None).expect("shipped")).expect("a plan");
        plan.blocks.iter().map(|block| (block.start, block.count)).collect()
    }

    #[test]
    fn every_shipped_profile_is_one_block() {
        for (name, _) in SHIPPED {
            assert_eq!(blocks(name).len(), 1, "{name}");
        }
        assert_eq!(blocks("sdm630"), [(0, 54)]);
        assert_eq!(blocks("iem3000"), [(0x0BB7, 62)]);
    }

    #[test]
    fn a_meter_with_limits_gets_more_blocks() {
        let profile = Profile { block_gap: 10, ..find("sdm630", None).expect("shipped") };
        let plan = PollBlocks::of(&profile).expect("a plan");
        assert_eq!(plan.blocks.iter().map(|b| (b.start, b.count)).collect::<Vec<_>>(), [(0, 18), (52, 2)]);
        let narrow = Profile { block_max: 4, ..profile };
        assert!(PollBlocks::of(&narrow).expect("a plan").blocks.iter().all(|block| block.count <= 4));
    }

    #[test]
    fn the_wire_takes_what_was_computed_elsewhere() {
        // 8N1 with both silences: registers, then ms at 9600, 19200, 38400 and 115200 Bd.
        for (registers, ms) in
            [(2, [25.0, 12.5, 7.9, 5.0]), (12, [45.8, 22.9, 13.1, 6.7]), (54, [133.0, 66.7, 35.0, 14.0])]
        {
            for (baud, ms) in [9600, 19200, 38400, 115_200].into_iter().zip(ms) {
                let line = SerialTarget { port: PathBuf::new(), baud, parity: Parity::None };
                let found = wire_time(&line, registers).as_secs_f64() * 1e3;
                assert!((found - ms).abs() < 0.01 * ms + 0.05, "{registers} at {baud}: {found} for {ms}");
            }
        }
    }
}
