//! The registers of the simulated controller: memory that the PLC and clients share, F and G as the machine has them, and
//! the mailboxes from which the ladder takes the gateway's override and its shifts.

use super::values::channel_word;
use adapter_core::clock::Clock;
use adapter_core::driver::Actuator;
use adapter_core::offset::{Axis, OffsetSink};
use nclink::mailbox::{ControllerRegister, Mailbox, MailboxRequest, request_of};
use nclink::offset_mailbox::OffsetMailbox;
use simulated::{Moment, Simulated, SimulatedOffsets, SimulatedOverride};
use std::collections::BTreeMap;

/// First F and G word of channel 0, configuration HNC-30.
const CHANNEL: u32 = 2560;
/// Behind it, in G: the feed override.
const FEED_OVERRIDE: u32 = 4;
/// First F word of the system, and behind it the counter of milliseconds.
const SYSTEM: u32 = 2960;
const HEARTBEAT: u32 = 149;

/// Memory that can be written, with its size and the width of a register in bits.
const MEMORY: [(char, u32, u32); 4] = [('R', 2288, 8), ('W', 200, 16), ('D', 200, 32), ('B', 8304, 32)];

pub(super) struct SimulatedRegisters {
    memory: BTreeMap<ControllerRegister, i64>,
    mailbox: Mailbox,
    ladder: SimulatedOverride,
    offset_mailbox: OffsetMailbox,
    offsets: SimulatedOffsets,
    heartbeat: Option<i64>,
}

impl SimulatedRegisters {
    pub(super) fn new(machine: &Simulated) -> Self {
        let mailbox = Mailbox::new(super::MAILBOX.parse().unwrap_or(ControllerRegister { kind: 'D', index: 100 }));
        let first = super::OFFSETS.parse().unwrap_or(ControllerRegister { kind: 'D', index: 110 });
        let (offset_mailbox, offsets) = (OffsetMailbox::new(first), machine.offsets());
        let (memory, ladder, heartbeat) = (BTreeMap::new(), machine.feed_override(), None);
        Self { memory, mailbox, ladder, offset_mailbox, offsets, heartbeat }
    }

    /// The value of a register; `None` where there is none.
    pub(super) fn read(&self, at: ControllerRegister, moment: &Moment, at_ms: i64) -> Option<i64> {
        match at.kind {
            'F' if at.index == CHANNEL => Some(channel_word(&moment.panel)),
            'F' if at.index == SYSTEM + HEARTBEAT => Some(at_ms & 0xffff),
            'G' if at.index == CHANNEL + FEED_OVERRIDE => Some(i64::from(moment.panel.feed_override_pct)),
            'F' | 'G' if at.index < 3120 => Some(0),
            kind => {
                let (_, size, _) = MEMORY.iter().find(|(memory, ..)| *memory == kind)?;
                (at.index < *size).then(|| self.memory.get(&at).copied().unwrap_or(0))
            }
        }
    }

    /// Writes a register, or says why not.
    pub(super) fn write(&mut self, at: ControllerRegister, value: i64) -> Result<(), &'static str> {
        let Some((_, size, bits)) = MEMORY.iter().find(|(memory, ..)| *memory == at.kind) else {
            return Err("READ_ONLY");
        };
        if at.index >= *size {
            return Err("INDEX_OUT_OF_RANGE");
        }
        let limit = 1_i64 << bits;
        if value < -limit / 2 || value >= limit {
            return Err("VALUE_OUT_OF_RANGE");
        }
        self.memory.insert(at, value);
        Ok(())
    }

    /// What the ladder does after a client has written.
    pub(super) fn scan_letters(&mut self, clock: &dyn Clock) {
        self.override_letter(clock);
        self.offset_letter(clock);
    }

    /// A letter with a new number is taken while no program runs, as far as the machine lets itself be shifted.
    fn offset_letter(&mut self, clock: &dyn Clock) {
        let word = |offset| self.memory.get(&self.offset_mailbox.register_at(offset)).copied().unwrap_or(0);
        let words: Vec<i64> = (0..OffsetMailbox::LENGTH).map(word).collect();
        let Some(letters) = OffsetMailbox::read(&words).filter(|letters| letters.number != letters.taken) else {
            return;
        };
        let mut in_force_um = letters.in_force_um;
        for (axis, in_force_um) in Axis::ALL.into_iter().zip(&mut in_force_um) {
            let wanted_um = letters.wanted_um[axis.index()];
            if wanted_um == *in_force_um {
                continue;
            }
            #[expect(clippy::cast_precision_loss, reason = "a shift has few digits")]
            let further_um = (wanted_um - *in_force_um) as f64;
            let offsets = &mut self.offsets;
            let found = offsets.at_rest(clock, axis);
            if found.and_then(|found_um| offsets.write(clock, axis, found_um, found_um + further_um)).is_err() {
                return;
            }
            *in_force_um = wanted_um;
        }
        self.memory.extend(self.offset_mailbox.build_ladder_answer(in_force_um, letters.number));
    }

    /// A heartbeat that has moved delivers the letter about the override.
    fn override_letter(&mut self, clock: &dyn Clock) {
        let word = |offset| self.memory.get(&self.mailbox.register_at(offset)).copied().unwrap_or(0);
        let heartbeat = word(Mailbox::HEARTBEAT);
        if self.heartbeat == Some(heartbeat) || heartbeat == 0 {
            return;
        }
        self.heartbeat = Some(heartbeat);
        if let Some(request) = request_of(word(Mailbox::REQUEST)) {
            let _off = self.ladder.ask_ladder(clock, request);
        }
        // A machine that is off takes no letters; the client sees it by the override in force.
        let _taken = match MailboxRequest::from_registers(word(Mailbox::ENABLE), word(Mailbox::OVERRIDE)) {
            Some(MailboxRequest::Override(wanted)) => self.ladder.write_feed_override(clock, wanted),
            Some(MailboxRequest::Release) | None => self.ladder.release_override(clock),
        };
    }
}
