//! The ladder of the sample machine: who decides about the feed override. A machine's maker can build the same rungs.
//!
//! Mailbox and requests are laid out in [`fanuc::ladder`].
//!
//! Every scan: the wanted override counts while byte +0 says so and the heartbeat has changed within the last 1.5 s,
//! and never outside the ladder's own limits (50 to 120 %). With the operator's dial it becomes one override by the
//! [`LadderRule`]: the lesser of the two, or their product where the machine's maker lets the gateway go above the dial;
//! a dial at 0 % stays sovereign either way. The result goes to G012 in every scan, whatever anybody else wrote there. A
//! second byte (R910 by default) goes, inverted, to the second override G013; 0 there is no request.
//!
//! A bit that is on when the ladder starts is a leftover and latches nothing. While feed hold is latched, *SP (G008.5)
//! is off and the axes stand. While a stop is latched, the ladder lets the running part end and no cycle start through.
//! The gateway can neither end what it has asked for nor ask for the same a second time before it was acknowledged.

use super::Memory;
use adapter_core::clock::TimeNs;
use adapter_core::driver::{LadderRequest, LadderRule};
use adapter_core::override_pct::OverridePct;
use fanuc::feed_override;
use fanuc::item::Area;
use fanuc::ladder::{ENABLED, request_bit};
use fanuc::poll::find_signal_address;

/// One turn of the ladder.
pub const SCAN_NS: i64 = 8_000_000;

/// Without a change of the heartbeat for this long, the gateway is gone.
const SILENT_NS: i64 = 1_500_000_000;

/// The ladder's own limits, %.
const LIMITS_PCT: (u8, u8) = (50, 120);

/// *IT, *ESP and *SP of G008: off means interlock, emergency stop and feed hold.
const RUNNING: u8 = 0x31;
const FEED_HOLD: u8 = 0x20;
const INTERLOCKS_AT: u16 = 8;

/// What byte +4 says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MailboxState {
    /// Nobody asks for an override.
    NotAsked,
    /// The wanted override is taken.
    Taken,
    /// The heartbeat has stopped.
    HeartbeatLost,
    /// Taken within the ladder's limits.
    Limited,
}

/// The rungs and what they remember.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PmcLadder {
    /// The path whose signals it writes, from 1.
    pub path: u8,
    /// Area and first byte of the mailbox.
    pub mailbox: (Area, u16),
    /// Area and byte of the second override.
    pub second: (Area, u16),
    /// Area and first byte of the requests.
    pub requests: (Area, u16),
    /// The operator's dial, %.
    pub dial: OverridePct,
    /// What dial and mailbox make.
    pub rule: LadderRule,
    /// Bits of the last scan; `None` before the first one.
    asked: Option<u8>,
    latched: u8,
    beat: Option<(u8, TimeNs)>,
}

/// The bytes of a path lie so far behind those of the one before.
const PATH_STEP: u16 = 20;

impl Default for PmcLadder {
    fn default() -> Self {
        Self::of_path(1)
    }
}

impl PmcLadder {
    /// The rungs of a path from 1: R900 and so on for the first, R920 and so on for the second.
    #[must_use]
    pub fn of_path(path: u8) -> Self {
        let byte = |at: u16| (Area::R, at + PATH_STEP * u16::from(path.max(1) - 1));
        Self {
            path,
            mailbox: byte(900),
            second: byte(910),
            requests: byte(905),
            dial: OverridePct::FULL,
            rule: LadderRule::default(),
            asked: None,
            latched: 0,
            beat: None,
        }
    }

    /// One scan of the ladder over the memory at `now_ns`.
    pub fn scan_memory(&mut self, memory: &mut Memory, now_ns: TimeNs) {
        let (area, at) = self.mailbox;
        let (taken, state) = self.read_mailbox(memory, now_ns);
        memory.set_byte(area, at + 3, taken);
        memory.set_byte(area, at + 4, state as u8);
        memory.set_byte(
            Area::G,
            find_signal_address(feed_override::AT, self.path),
            feed_override::encode(self.in_force(taken, state)),
        );
        let wanted = memory.read_byte(self.second.0, self.second.1);
        let second =
            OverridePct::new(if wanted == 0 { 100 } else { limit_percent(wanted) }).unwrap_or(OverridePct::FULL);
        memory.set_byte(
            Area::G,
            find_signal_address(feed_override::SECOND_AT, self.path),
            feed_override::encode(second),
        );
        self.latch_requests(memory);
    }

    /// Without a request of the gateway the dial alone counts.
    fn in_force(&self, taken: u8, state: MailboxState) -> OverridePct {
        match (state, OverridePct::new(taken)) {
            (MailboxState::Taken | MailboxState::Limited, Some(taken)) => self.rule.combine_overrides(self.dial, taken),
            _ => self.dial,
        }
    }

    fn latch_requests(&mut self, memory: &mut Memory) {
        let (area, at) = self.requests;
        let asked = memory.read_byte(area, at);
        self.latched |= asked & !self.asked.unwrap_or(asked) & (1 | 2);
        self.asked = Some(asked);
        memory.set_byte(area, at + 1, self.latched);
        memory.set_byte(area, at + 2, self.dial.percent());
        let interlocks = if self.is_latched(LadderRequest::FeedHold) { RUNNING & !FEED_HOLD } else { RUNNING };
        memory.set_byte(Area::G, find_signal_address(INTERLOCKS_AT, self.path), interlocks);
    }

    /// Does the machine have to stand because of this?
    #[must_use]
    pub fn is_latched(&self, request: LadderRequest) -> bool {
        self.latched & request_bit(request) != 0
    }

    /// The override that both bytes of its path make now, %.
    #[must_use]
    pub fn compute_override(&self, memory: &Memory) -> OverridePct {
        let byte = |at| feed_override::decode(memory.read_byte(Area::G, find_signal_address(at, self.path)));
        LadderRule::Product.combine_overrides(byte(feed_override::AT), byte(feed_override::SECOND_AT))
    }

    /// The operator has seen to it.
    pub fn acknowledge_request(&mut self, request: LadderRequest) {
        self.latched &= !request_bit(request);
    }

    /// Forgets what the power-on clears.
    pub fn power_off(&mut self) {
        (self.beat, self.asked, self.latched) = (None, None, 0);
    }

    fn read_mailbox(&mut self, memory: &Memory, now_ns: TimeNs) -> (u8, MailboxState) {
        let (area, at) = self.mailbox;
        let byte = |offset| memory.read_byte(area, at + offset);
        let before = self.beat;
        match before {
            Some((beat, _)) if beat == byte(2) => {}
            _ => self.beat = Some((byte(2), now_ns)),
        }
        if byte(0) != ENABLED {
            return (100, MailboxState::NotAsked);
        }
        // The first number seen is no beat: it may be left over from a gateway that is gone.
        let alive = before.is_some() && self.beat.is_some_and(|(_, since_ns)| now_ns - since_ns <= SILENT_NS);
        match (alive, limit_percent(byte(1))) {
            (false, _) => (100, MailboxState::HeartbeatLost),
            (true, taken) if taken == byte(1) => (taken, MailboxState::Taken),
            (true, taken) => (taken, MailboxState::Limited),
        }
    }
}

fn limit_percent(percent: u8) -> u8 {
    percent.clamp(LIMITS_PCT.0, LIMITS_PCT.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scans(ladder: &mut PmcLadder, memory: &mut Memory, from_ms: i64, to_ms: i64) -> u8 {
        let mut now_ns = from_ms * 1_000_000;
        while now_ns <= to_ms * 1_000_000 {
            ladder.scan_memory(memory, now_ns);
            now_ns += SCAN_NS;
        }
        feed_override::decode(memory.read_byte(Area::G, 12)).percent()
    }

    fn ask(memory: &mut Memory, percent: u8, beat: u8) {
        [ENABLED, percent, beat].into_iter().zip(900..).for_each(|(byte, at)| memory.set_byte(Area::R, at, byte));
    }

    #[test]
    fn a_wish_is_taken_limited_and_dropped_when_the_heartbeat_stops() {
        let (mut ladder, mut memory) = (PmcLadder::default(), Memory::default());
        assert_eq!(scans(&mut ladder, &mut memory, 0, 50), 100);
        ask(&mut memory, 80, 1);
        assert_eq!(scans(&mut ladder, &mut memory, 50, 100), 80);
        assert_eq!((memory.read_byte(Area::R, 903), memory.read_byte(Area::R, 904)), (80, 1));
        ask(&mut memory, 20, 2);
        assert_eq!(scans(&mut ladder, &mut memory, 100, 150), 50);
        assert_eq!((memory.read_byte(Area::R, 903), memory.read_byte(Area::R, 904)), (50, 3));
        assert_eq!(scans(&mut ladder, &mut memory, 150, 1550), 50, "within the time");
        assert_eq!(scans(&mut ladder, &mut memory, 1550, 1700), 100, "the heartbeat has stopped");
        assert_eq!(memory.read_byte(Area::R, 904), 2);
    }

    #[test]
    fn the_dial_multiplies_and_is_sovereign_at_zero() {
        let rule = LadderRule::Product;
        let (mut ladder, mut memory) = (PmcLadder { rule, ..PmcLadder::default() }, Memory::default());
        scans(&mut ladder, &mut memory, 0, 10);
        ask(&mut memory, 120, 1);
        ladder.dial = OverridePct::new(50).expect("exists");
        assert_eq!(scans(&mut ladder, &mut memory, 20, 40), 60);
        ladder.dial = OverridePct::new(0).expect("exists");
        assert_eq!(scans(&mut ladder, &mut memory, 40, 60), 0);
    }

    #[test]
    fn nothing_is_above_the_dial_unless_the_maker_says_so() {
        let (mut ladder, mut memory) = (PmcLadder::default(), Memory::default());
        scans(&mut ladder, &mut memory, 0, 10);
        ladder.dial = OverridePct::new(80).expect("exists");
        assert_eq!(scans(&mut ladder, &mut memory, 20, 40), 80, "the dial alone");
        for (wanted, expected) in [(120, 80), (60, 60)] {
            ask(&mut memory, wanted, wanted);
            assert_eq!(scans(&mut ladder, &mut memory, 60, 80), expected, "asked {wanted} %");
        }
        assert_eq!(memory.read_byte(Area::R, 907), 80, "the dial is told apart from what is in force");
    }

    #[test]
    fn a_request_is_latched_once_until_it_is_acknowledged() {
        let (mut ladder, mut memory) = (PmcLadder::default(), Memory::default());
        memory.set_byte(Area::R, 905, 1);
        scans(&mut ladder, &mut memory, 0, 20);
        assert_eq!(memory.read_byte(Area::R, 906), 0, "a leftover latches nothing");
        let mut bits = |bits: u8, ladder: &mut PmcLadder| {
            memory.set_byte(Area::R, 905, bits);
            scans(ladder, &mut memory, 20, 40);
            (memory.read_byte(Area::R, 906), memory.read_byte(Area::G, 8))
        };
        assert_eq!(bits(0, &mut ladder), (0, 0x31));
        assert_eq!(bits(1, &mut ladder), (1, 0x11), "*SP is off");
        assert_eq!(bits(0, &mut ladder), (1, 0x11), "and stays off");
        assert_eq!(bits(2, &mut ladder), (3, 0x11));
        ladder.acknowledge_request(LadderRequest::FeedHold);
        assert_eq!(bits(2, &mut ladder), (2, 0x31), "a bit that stays on asks once");
        assert_eq!(bits(0xFC, &mut ladder).0, 2, "other bits are nobody's");
    }

    #[test]
    fn a_direct_write_is_taken_back_in_the_next_scan() {
        let (mut ladder, mut memory) = (PmcLadder::default(), Memory::default());
        memory.set_byte(Area::G, 12, feed_override::encode(OverridePct::new(50).expect("exists")));
        assert_eq!(scans(&mut ladder, &mut memory, 0, 8), 100);
    }

    #[test]
    fn a_number_that_was_left_over_is_no_heartbeat() {
        let (mut ladder, mut memory) = (PmcLadder::default(), Memory::default());
        ask(&mut memory, 80, 7);
        assert_eq!(scans(&mut ladder, &mut memory, 0, 0), 100);
        assert_eq!(memory.read_byte(Area::R, 904), 2);
    }

    #[test]
    fn the_second_override_goes_to_its_own_byte() {
        let (mut ladder, mut memory) = (PmcLadder::default(), Memory::default());
        memory.set_byte(Area::R, 910, 70);
        assert_eq!(scans(&mut ladder, &mut memory, 0, 8), 100);
        assert_eq!(feed_override::decode(memory.read_byte(Area::G, 13)).percent(), 70);
    }
}
