//! The ladder of the sample machine: who decides about the feed override. A machine's maker can build the same rungs.
//!
//! Mailbox, five bytes from a configurable byte on (R900 by default; R is cleared when the power comes on):
//!
//! | byte | written by | what |
//! |---|---|---|
//! | +0 | gateway | 0xA5 while the gateway asks for an override, anything else: it does not |
//! | +1 | gateway | wanted override, % |
//! | +2 | gateway | heartbeat: another number at every write |
//! | +3 | ladder | override taken from the gateway, %; 100 when none is |
//! | +4 | ladder | 0 not asked, 1 taken, 2 heartbeat lost, 3 taken within the ladder's own limits |
//!
//! Every scan: the wanted override counts while byte +0 says so and the heartbeat has changed within the last 1.5 s,
//! and never outside the ladder's own limits (50 to 120 %). It multiplies the operator's dial, which stays sovereign at
//! 0 %. The result goes to G012 in every scan, whatever anybody else wrote there. A second byte (R910 by default) goes,
//! inverted, to the second override G013; 0 there is no wish.

use super::Memory;
use crate::clock::TimeNs;
use crate::fanuc::feed_override;
use crate::fanuc::item::Area;
use crate::units::OverridePct;

/// Value of the first byte while an override is asked for.
pub const ENABLED: u8 = 0xA5;

/// One turn of the ladder.
pub const SCAN_NS: i64 = 8_000_000;

/// Without a change of the heartbeat for this long, the gateway is gone.
const SILENT_NS: i64 = 1_500_000_000;

/// The ladder's own limits, %.
const LIMITS_PCT: (u8, u8) = (50, 120);

/// What byte +4 says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MailboxState {
    /// Nobody asks.
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
pub struct Ladder {
    /// Area and first byte of the mailbox.
    pub mailbox: (Area, u16),
    /// Area and byte of the second override.
    pub second: (Area, u16),
    /// The operator's dial, %.
    pub dial: OverridePct,
    beat: Option<(u8, TimeNs)>,
}

impl Default for Ladder {
    fn default() -> Self {
        Self { mailbox: (Area::R, 900), second: (Area::R, 910), dial: OverridePct::FULL, beat: None }
    }
}

impl Ladder {
    /// One turn.
    pub fn scan(&mut self, memory: &mut Memory, now_ns: TimeNs) {
        let (area, at) = self.mailbox;
        let (taken, state) = self.taken(memory, now_ns);
        memory.set(area, at + 3, taken);
        memory.set(area, at + 4, state as u8);
        memory.set(Area::G, feed_override::AT, feed_override::encode(product(self.dial, taken)));
        let wanted = memory.byte(self.second.0, self.second.1);
        let second = OverridePct::new(if wanted == 0 { 100 } else { limited(wanted) }).unwrap_or(OverridePct::FULL);
        memory.set(Area::G, feed_override::SECOND_AT, feed_override::encode(second));
    }

    /// Forgets what the power-on clears.
    pub fn power_off(&mut self) {
        self.beat = None;
    }

    fn taken(&mut self, memory: &Memory, now_ns: TimeNs) -> (u8, MailboxState) {
        let (area, at) = self.mailbox;
        let byte = |offset| memory.byte(area, at + offset);
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
        match (alive, limited(byte(1))) {
            (false, _) => (100, MailboxState::HeartbeatLost),
            (true, taken) if taken == byte(1) => (taken, MailboxState::Taken),
            (true, taken) => (taken, MailboxState::Limited),
        }
    }
}

fn limited(percent: u8) -> u8 {
    percent.clamp(LIMITS_PCT.0, LIMITS_PCT.1)
}

fn product(dial: OverridePct, percent: u8) -> OverridePct {
    let product = u16::from(dial.percent()) * u16::from(percent) / 100;
    u8::try_from(product.min(254)).ok().and_then(OverridePct::new).unwrap_or(OverridePct::FULL)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scans(ladder: &mut Ladder, memory: &mut Memory, from_ms: i64, to_ms: i64) -> u8 {
        let mut now_ns = from_ms * 1_000_000;
        while now_ns <= to_ms * 1_000_000 {
            ladder.scan(memory, now_ns);
            now_ns += SCAN_NS;
        }
        feed_override::decode(memory.byte(Area::G, 12)).percent()
    }

    fn ask(memory: &mut Memory, percent: u8, beat: u8) {
        [ENABLED, percent, beat].into_iter().zip(900..).for_each(|(byte, at)| memory.set(Area::R, at, byte));
    }

    #[test]
    fn a_wish_is_taken_limited_and_dropped_when_the_heartbeat_stops() {
        let (mut ladder, mut memory) = (Ladder::default(), Memory::default());
        assert_eq!(scans(&mut ladder, &mut memory, 0, 50), 100);
        ask(&mut memory, 80, 1);
        assert_eq!(scans(&mut ladder, &mut memory, 50, 100), 80);
        assert_eq!((memory.byte(Area::R, 903), memory.byte(Area::R, 904)), (80, 1));
        ask(&mut memory, 20, 2);
        assert_eq!(scans(&mut ladder, &mut memory, 100, 150), 50);
        assert_eq!((memory.byte(Area::R, 903), memory.byte(Area::R, 904)), (50, 3));
        assert_eq!(scans(&mut ladder, &mut memory, 150, 1550), 50, "within the time");
        assert_eq!(scans(&mut ladder, &mut memory, 1550, 1700), 100, "the heartbeat has stopped");
        assert_eq!(memory.byte(Area::R, 904), 2);
    }

    #[test]
    fn the_dial_multiplies_and_is_sovereign_at_zero() {
        let (mut ladder, mut memory) = (Ladder::default(), Memory::default());
        scans(&mut ladder, &mut memory, 0, 10);
        ask(&mut memory, 120, 1);
        ladder.dial = OverridePct::new(50).expect("exists");
        assert_eq!(scans(&mut ladder, &mut memory, 20, 40), 60);
        ladder.dial = OverridePct::new(0).expect("exists");
        assert_eq!(scans(&mut ladder, &mut memory, 40, 60), 0);
    }

    #[test]
    fn a_direct_write_is_taken_back_in_the_next_scan() {
        let (mut ladder, mut memory) = (Ladder::default(), Memory::default());
        memory.set(Area::G, 12, feed_override::encode(OverridePct::new(50).expect("exists")));
        assert_eq!(scans(&mut ladder, &mut memory, 0, 8), 100);
    }

    #[test]
    fn a_number_that_was_left_over_is_no_heartbeat() {
        let (mut ladder, mut memory) = (Ladder::default(), Memory::default());
        ask(&mut memory, 80, 7);
        assert_eq!(scans(&mut ladder, &mut memory, 0, 0), 100);
        assert_eq!(memory.byte(Area::R, 904), 2);
    }

    #[test]
    fn the_second_override_goes_to_its_own_byte() {
        let (mut ladder, mut memory) = (Ladder::default(), Memory::default());
        memory.set(Area::R, 910, 70);
        assert_eq!(scans(&mut ladder, &mut memory, 0, 8), 100);
        assert_eq!(feed_override::decode(memory.byte(Area::G, 13)).percent(), 70);
    }
}
