//! The fewest blocks that hold every register of a profile, and what they take on the wire.
//!
//! A meter may not give as many registers at once as the protocol allows, or not those that nobody reads. It says so with an
//! exception (2 or 3), and the block is then read in parts: first without what nobody reads, then in halves, down to single
//! numbers. What was found out is remembered for a minute; then whole blocks are asked for again.

use super::error::MeterError;
use super::pdu::{RegisterBlock, RegisterTable};
use super::register::MeterRegister;
use adapter_core::address::SerialTarget;
use adapter_core::integer::convert_bounded;
use device_line::serial;
use std::time::Duration;

/// More requests than this in one poll are a sign of a profile that should be two.
const BLOCKS_MAX: usize = 8;

/// Address, function, register, count, CRC.
const REQUEST_BYTES: usize = 8;
/// Address, function, byte count, CRC.
const ANSWER_AROUND: usize = 5;

/// Registers of one number, from the first to behind the last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct NumberSpan {
    table: RegisterTable,
    from: u32,
    to: u32,
}

/// The blocks of one poll.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PollBlocks {
    /// In the order of their tables and addresses; no two overlap.
    pub blocks: Vec<RegisterBlock>,
    spans: Vec<NumberSpan>,
}

impl PollBlocks {
    /// The fewest blocks of at most `most` registers that run across at most `gap` which nobody reads.
    ///
    /// # Errors
    /// [`MeterError::TooManyRequests`].
    pub fn from_registers<'a>(
        registers: impl IntoIterator<Item = &'a MeterRegister>,
        most: u16,
        gap: u16,
    ) -> Result<Self, MeterError> {
        let span = |register: &MeterRegister| {
            let from = u32::from(register.address);
            NumberSpan { table: register.table, from, to: from + u32::from(register.format.register_count()) }
        };
        let mut spans: Vec<NumberSpan> = registers.into_iter().map(span).collect();
        spans.sort_unstable();
        spans.dedup();
        let blocks = join_spans(&spans, most, gap);
        if blocks.len() > BLOCKS_MAX {
            return Err(MeterError::TooManyRequests { requests: blocks.len(), most: BLOCKS_MAX });
        }
        Ok(Self { blocks, spans })
    }

    /// In which block a register stands, and how many registers into it; `None` where the meter does not have it.
    pub(super) fn find_place(&self, register: &MeterRegister) -> Option<(usize, usize)> {
        let holds = |block: &RegisterBlock| {
            block.table == register.table
                && register.address >= block.start
                && register.address - block.start + register.format.register_count() <= block.count
        };
        let at = self.blocks.iter().position(holds)?;
        Some((at, usize::from(register.address - self.blocks[at].start)))
    }

    /// The meter refuses this block: it is read in parts from now on. A single number that is refused does not exist, and
    /// nothing is read in its place.
    pub(super) fn split_block(&mut self, at: usize) {
        let Some(block) = self.blocks.get(at).copied() else { return };
        let (from, to) = (u32::from(block.start), u32::from(block.start) + u32::from(block.count));
        // A number that takes the whole block is refused with it; others may share registers with it.
        let whole = NumberSpan { table: block.table, from, to };
        let is_part =
            |span: &&NumberSpan| span.table == block.table && span.from >= from && span.to <= to && **span != whole;
        let inside: Vec<NumberSpan> = self.spans.iter().filter(is_part).copied().collect();
        let join = |spans: &[NumberSpan]| join_spans(spans, block.count, 0);
        let (first, second) = inside.split_at(inside.len() / 2);
        let ways = [join(&inside), [join(first), join(second)].concat(), inside.chunks(1).flat_map(join).collect()];
        // Every part is smaller than the block, so that splitting ends.
        let parts = ways.into_iter().find(|parts| !parts.contains(&block)).unwrap_or_default();
        self.blocks.splice(at..=at, parts);
    }

    /// What a poll takes on a serial line, with all silences.
    #[must_use]
    pub fn wire_time(&self, line: &SerialTarget) -> Duration {
        self.blocks.iter().map(|block| wire_time(line, block.count)).sum()
    }
}

fn join_spans(spans: &[NumberSpan], most: u16, gap: u16) -> Vec<RegisterBlock> {
    let mut joined: Vec<NumberSpan> = Vec::new();
    let fits = |last: &NumberSpan, span: &NumberSpan| {
        last.table == span.table
            && span.to.max(last.to) - last.from <= u32::from(most)
            && span.from.saturating_sub(last.to) <= u32::from(gap)
    };
    for span in spans {
        match joined.last_mut().filter(|last| fits(last, span)) {
            Some(last) => last.to = last.to.max(span.to),
            None => joined.push(*span),
        }
    }
    // An address has 16 bits, and a block is no longer than `most` or one number.
    let word = |number: u32| convert_bounded(number, u16::MAX);
    let block = |span: NumberSpan| RegisterBlock {
        table: span.table,
        start: word(span.from),
        count: word(span.to - span.from),
    };
    joined.into_iter().map(block).collect()
}

/// What a request for so many registers and its answer take on a serial line, with the silence behind each; the meter's
/// own time to think comes on top.
#[must_use]
pub fn wire_time(line: &SerialTarget, registers: u16) -> Duration {
    let characters = REQUEST_BYTES + ANSWER_AROUND + 2 * usize::from(registers);
    serial::wire_time(line, characters) + 2 * serial::compute_silence(line)
}

#[cfg(test)]
mod tests {
    use super::super::profile::{Profile, SHIPPED, find_profile};
    use super::super::register::RegisterMeaning;
    use super::*;
    use adapter_core::address::Parity;
    use std::path::PathBuf;

    fn plan(profile: &Profile) -> PollBlocks {
        PollBlocks::from_registers(&profile.registers, profile.block_max, profile.block_gap).expect("a plan")
    }

    fn blocks(plan: &PollBlocks) -> Vec<(u16, u16)> {
        plan.blocks.iter().map(|block| (block.start, block.count)).collect()
    }

    #[test]
    fn every_shipped_profile_is_one_block_and_perhaps_one_of_the_counter() {
        let of = |name| blocks(&plan(&find_profile(name, None).expect("shipped")));
        for (name, _) in SHIPPED {
            let mut profile = find_profile(name, None).expect("shipped");
            assert!(of(name).len() <= 2, "{name}");
            profile.registers.retain(|register| register.meaning != RegisterMeaning::Energy);
            assert_eq!(blocks(&plan(&profile)).len(), 1, "{name}");
        }
        assert_eq!(of("sdm630"), [(0, 54)]);
        assert_eq!(of("iem3000"), [(0x0BB7, 62)]);
    }

    #[test]
    fn a_meter_with_limits_gets_more_blocks() {
        let profile = Profile { block_gap: 10, ..find_profile("sdm630", None).expect("shipped") };
        assert_eq!(blocks(&plan(&profile)), [(0, 18), (52, 2)]);
        let narrow = Profile { block_max: 4, ..profile };
        assert!(plan(&narrow).blocks.iter().all(|block| block.count <= 4));
    }

    #[test]
    fn a_block_that_is_refused_is_read_in_parts() {
        let mut plan = plan(&find_profile("sdm630", None).expect("shipped"));
        plan.split_block(0);
        assert_eq!(blocks(&plan), [(0, 18), (52, 2)], "without the gap first");
        plan.split_block(0);
        assert_eq!(blocks(&plan), [(0, 8), (8, 10), (52, 2)], "then in halves");
        plan.split_block(2);
        assert_eq!(blocks(&plan), [(0, 8), (8, 10)], "a single number is not there");
        while !plan.blocks.is_empty() {
            plan.split_block(0);
        }
    }

    #[test]
    fn numbers_that_share_registers_are_split_until_nothing_is_left() {
        let span = |from, to| NumberSpan { table: RegisterTable::Holding, from, to };
        for spans in [
            vec![span(100, 101), span(100, 102)],
            vec![span(100, 102), span(101, 102)],
            vec![span(100, 102), span(101, 103), span(102, 104)],
        ] {
            let mut plan = PollBlocks { blocks: join_spans(&spans, 125, 0), spans };
            for _ in 0..20 {
                plan.split_block(0);
            }
            assert!(plan.blocks.is_empty(), "{plan:?}");
        }
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
