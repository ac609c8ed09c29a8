//! Faults on purpose: what goes wrong between a gateway and a controller.

use std::time::Duration;

/// What happens to the next answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum InjectedFault {
    /// Every answer is what the control says.
    #[default]
    None,
    /// No answer to a question; connections are opened.
    Silence,
    /// Connections are accepted, and nothing is ever said on them.
    Blackhole,
    /// The answer comes later.
    Delay(Duration),
    /// The answer comes byte by byte, with this pause.
    ByteByByte(Duration),
    /// The answer ends early and nothing follows.
    Truncated,
    /// The connection is reset in the middle of the answer.
    Reset,
    /// The first answer names another function.
    WrongEcho,
    /// The frame begins with other bytes.
    WrongMagic,
    /// The answer counts one block too many.
    WrongCount,
    /// The length in the frame is the greatest there is.
    HugeLength,
    /// Every new connection is refused: all are in use.
    NoSession,
    /// The control is switched off: open connections end, new ones are refused.
    PowerOff,
}

impl InjectedFault {
    /// The bytes as they are spoiled.
    #[must_use]
    pub(super) fn spoil_bytes(self, mut bytes: Vec<u8>) -> Vec<u8> {
        let at = |bytes: &mut Vec<u8>, index: usize, value: u8| {
            if let Some(byte) = bytes.get_mut(index) {
                *byte = value;
            }
        };
        match self {
            Self::WrongMagic => at(&mut bytes, 0, b'H'),
            Self::WrongEcho => at(&mut bytes, 19, 0x77),
            Self::WrongCount => {
                let count = bytes.get(11).copied().unwrap_or(0);
                at(&mut bytes, 11, count.wrapping_add(1));
            }
            Self::HugeLength => bytes.splice(8..10, [0xFF, 0xFF]).for_each(drop),
            Self::Truncated | Self::Reset => bytes.truncate(bytes.len() * 2 / 3),
            _ => {}
        }
        bytes
    }
}
