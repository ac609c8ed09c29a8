//! Four registers through which the gateway asks the ladder for an override, and what stands in them.
//!
//! The ladder rewrites the override register (G2564) in every cycle from the operator's dial, so that a value written
//! there directly is lost or fights the operator. The builder is asked for a few rungs instead, which read four free
//! registers (R, W or D; B keeps its contents without power and must not hold a command):
//!
//! | register | what |
//! |---|---|
//! | +0 | wanted override, percent, 0 to 254 |
//! | +1 | 1 the override counts, 0 the dial alone |
//! | +2 | 0 nothing, 1 feed hold, 2 stop after this part |
//! | +3 | heartbeat: 1 to 100 and around, moved by every letter; the ladder falls back to the dial when it stands still |
//!
//! The heartbeat is written last, in the same request: a letter counts when it moves.

use adapter_core::driver::{LadderRequest, SourceError};
use adapter_core::override_pct::OverridePct;
use adapter_core::reading::Absence;
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// A register of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ControllerRegister {
    /// Its kind: X, Y, F, G, R, W, D, B or P.
    pub kind: char,
    /// Its number within the kind, below 60000 where it is read from a text.
    pub index: u32,
}

impl fmt::Display for ControllerRegister {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.kind, self.index)
    }
}

/// A text that is no kind and number of a register below 60000.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{0} is no register; write it like D100")]
pub struct NoRegister(pub String);

impl FromStr for ControllerRegister {
    type Err = NoRegister;

    fn from_str(text: &str) -> Result<Self, NoRegister> {
        let mut letters = text.trim().chars();
        let kind = letters.next().map(|kind| kind.to_ascii_uppercase()).filter(|kind| "XYFGRWDBP".contains(*kind));
        let index = letters.as_str().parse().ok().filter(|index| *index < 60_000);
        match (kind, index) {
            (Some(kind), Some(index)) => Ok(Self { kind, index }),
            _ => Err(NoRegister(text.to_owned())),
        }
    }
}

/// What the gateway asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MailboxRequest {
    /// This override beside the dial.
    Override(OverridePct),
    /// The override of the dial alone counts.
    Release,
}

impl MailboxRequest {
    /// What stands in the registers +1 and +0; `None` when it is no letter.
    #[must_use]
    pub fn from_registers(enable: i64, percent: i64) -> Option<Self> {
        match enable {
            0 => Some(Self::Release),
            1 => u8::try_from(percent).ok().and_then(OverridePct::new).map(Self::Override),
            _ => None,
        }
    }
}

/// The four registers through which the gateway asks the ladder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mailbox {
    first: ControllerRegister,
    heartbeat: u8,
}

impl Mailbox {
    /// Register +0: the wanted override, %.
    pub const OVERRIDE: u32 = 0;
    /// Register +1: it is 1 while the override counts.
    pub const ENABLE: u32 = 1;
    /// Feed hold or stop.
    pub const REQUEST: u32 = 2;
    /// Register +3: the sign of life.
    pub const HEARTBEAT: u32 = 3;

    /// Registers of the mailbox in all.
    pub const LENGTH: u32 = 4;

    /// The mailbox that begins at this register.
    #[must_use]
    pub fn new(first: ControllerRegister) -> Self {
        Self { first, heartbeat: 0 }
    }

    /// Can a mailbox begin there? It must be memory that clients may write and that forgets without power.
    #[must_use]
    pub fn may_begin(at: ControllerRegister) -> bool {
        matches!(at.kind, 'R' | 'W' | 'D')
    }

    /// The register this far behind the first.
    #[must_use]
    pub fn register_at(&self, offset: u32) -> ControllerRegister {
        ControllerRegister { index: self.first.index + offset, ..self.first }
    }

    /// A letter as registers with their values, in the order in which they are to be written.
    pub fn build_letter(
        &mut self,
        letter: MailboxRequest,
        request: Option<LadderRequest>,
    ) -> [(ControllerRegister, i64); 4] {
        self.heartbeat = self.heartbeat % 100 + 1;
        let (percent, enable) = match letter {
            MailboxRequest::Override(wanted) => (wanted, 1),
            MailboxRequest::Release => (OverridePct::FULL, 0),
        };
        [
            (self.register_at(Self::OVERRIDE), i64::from(percent.percent())),
            (self.register_at(Self::REQUEST), request.map_or(0, request_word)),
            (self.register_at(Self::ENABLE), enable),
            (self.register_at(Self::HEARTBEAT), i64::from(self.heartbeat)),
        ]
    }
}

fn request_word(request: LadderRequest) -> i64 {
    match request {
        LadderRequest::FeedHold => 1,
        LadderRequest::Stop => 2,
    }
}

/// What the register +2 asks for.
#[must_use]
pub fn request_of(word: i64) -> Option<LadderRequest> {
    LadderRequest::ALL.into_iter().find(|request| request_word(*request) == word)
}

/// The override in force as the controller shows it. A value that is not there is an error, not 0 %.
///
/// # Errors
/// [`SourceError::Decode`] with the reason.
pub fn in_force(name: &str, found: Result<f64, Absence>) -> Result<OverridePct, SourceError> {
    let nonsense = |what: String| SourceError::Decode {
        source_name: name.to_owned(),
        request: "the feed override in force".to_owned(),
        what,
    };
    let percent = found.map_err(|reason| nonsense(format!("there is no value ({reason})")))?;
    OverridePct::from_nearest_percent(percent).ok_or_else(|| nonsense(format!("{percent} % is no override")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_are_read_and_printed() {
        assert_eq!("d100".parse(), Ok(ControllerRegister { kind: 'D', index: 100 }));
        assert_eq!(ControllerRegister { kind: 'R', index: 7 }.to_string(), "R7");
        for bad in ["", "D", "Q1", "D-1", "D1x", "D99999999"] {
            assert!(bad.parse::<ControllerRegister>().is_err(), "{bad}");
        }
        assert!(
            !Mailbox::may_begin(ControllerRegister { kind: 'B', index: 1 })
                && !Mailbox::may_begin(ControllerRegister { kind: 'G', index: 1 })
        );
    }

    #[test]
    fn a_letter_moves_the_heartbeat_last_and_never_to_zero() {
        let mut mailbox = Mailbox::new(ControllerRegister { kind: 'D', index: 100 });
        let wanted = OverridePct::new(80).expect("exists");
        let mut last = 0;
        for _ in 0..250 {
            let words = mailbox.build_letter(MailboxRequest::Override(wanted), None);
            let (heartbeat, value) = words[3];
            assert_eq!(heartbeat, ControllerRegister { kind: 'D', index: 103 });
            assert!(value != last && (1..=100).contains(&value));
            last = value;
            assert_eq!(words[0], (ControllerRegister { kind: 'D', index: 100 }, 80));
        }
    }

    #[test]
    fn a_letter_is_read_back_from_its_registers() {
        for percent in 0..=254 {
            let wanted = OverridePct::new(percent).expect("exists");
            assert_eq!(MailboxRequest::from_registers(1, i64::from(percent)), Some(MailboxRequest::Override(wanted)));
        }
        assert_eq!(MailboxRequest::from_registers(0, 80), Some(MailboxRequest::Release));
        assert_eq!(
            (
                MailboxRequest::from_registers(1, 255),
                MailboxRequest::from_registers(1, -1),
                MailboxRequest::from_registers(7, 80)
            ),
            (None, None, None)
        );
    }

    #[test]
    fn the_override_in_force_is_never_guessed() {
        assert_eq!(in_force("x", Ok(80.0)).map(OverridePct::percent), Ok(80));
        for none in [Ok(255.0), Ok(-1.0), Err(Absence::NotYetRead)] {
            assert!(in_force("x", none).is_err(), "{none:?}");
        }
        for request in LadderRequest::ALL {
            assert_eq!(request_of(request_word(request)), Some(request));
        }
        assert_eq!((request_of(0), request_of(3)), (None, None));
    }
}
