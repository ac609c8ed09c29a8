//! Places in the memory of the programmable machine controller, where the ladder runs.

use serde::{Deserialize, Serialize};

/// Area of PMC memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Area {
    /// Signals from the ladder to the control.
    G,
    /// Signals from the control to the ladder.
    F,
    /// Outputs to the machine.
    Y,
    /// Inputs from the machine.
    X,
    /// Message requests of the ladder.
    A,
    /// Internal relays; cleared at power-on up to the battery-backed part.
    R,
    /// Timers of the ladder.
    T,
    /// Keep relays of the ladder.
    K,
    /// Counters of the ladder.
    C,
    /// Data table of the ladder, battery-backed.
    D,
    /// Extra relays, shared between PMCs.
    E,
}

impl Area {
    /// Every area with its letter and its number.
    pub const ALL: [(Self, char, i32); 11] = [
        (Self::G, 'G', 0),
        (Self::F, 'F', 1),
        (Self::Y, 'Y', 2),
        (Self::X, 'X', 3),
        (Self::A, 'A', 4),
        (Self::R, 'R', 5),
        (Self::T, 'T', 6),
        (Self::K, 'K', 7),
        (Self::C, 'C', 8),
        (Self::D, 'D', 9),
        (Self::E, 'E', 12),
    ];

    /// Its number on the wire and in the library.
    #[must_use]
    pub fn wire_number(self) -> i32 {
        Self::ALL.iter().find(|(area, ..)| *area == self).map_or(0, |(.., number)| *number)
    }

    /// Its letter, as in R900.
    #[must_use]
    pub fn letter(self) -> char {
        Self::ALL.iter().find(|(area, ..)| *area == self).map_or('?', |(_, letter, _)| *letter)
    }

    /// The area with this number.
    #[must_use]
    pub fn of_number(number: i32) -> Option<Self> {
        Self::ALL.iter().find(|(.., known)| *known == number).map(|(area, ..)| *area)
    }

    /// The area with this letter.
    #[must_use]
    pub fn of_letter(letter: char) -> Option<Self> {
        Self::ALL.iter().find(|(_, known, _)| *known == letter.to_ascii_uppercase()).map(|(area, ..)| *area)
    }
}

/// Bytes of one element of PMC memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum PmcWidth {
    /// One byte, 0 to 255.
    Byte,
    /// Two bytes, -32768 to 32767.
    Word,
    /// Four bytes, the range of `i32`.
    Long,
}

impl PmcWidth {
    /// Bytes of an element: 1, 2 or 4.
    #[must_use]
    pub fn byte_count(self) -> u16 {
        match self {
            Self::Byte => 1,
            Self::Word => 2,
            Self::Long => 4,
        }
    }

    /// Its number on the wire.
    #[must_use]
    pub fn wire_number(self) -> i32 {
        match self {
            Self::Byte => 0,
            Self::Word => 1,
            Self::Long => 2,
        }
    }

    /// The width with this number.
    #[must_use]
    pub fn of_number(number: i32) -> Option<Self> {
        [Self::Byte, Self::Word, Self::Long].into_iter().find(|width| width.wire_number() == number)
    }
}

/// A stretch of PMC memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Stretch {
    /// Area of all its bytes.
    pub area: Area,
    /// Address of its first byte.
    pub from: u16,
    /// Address of its last byte, which is included.
    pub to: u16,
    /// Size of the elements.
    pub width: PmcWidth,
}

impl Stretch {
    /// So many single bytes.
    #[must_use]
    pub fn from_byte_range(area: Area, from: u16, count: u16) -> Self {
        Self { area, from, to: from.saturating_add(count.saturating_sub(1)), width: PmcWidth::Byte }
    }

    /// Number of bytes; 0 when it ends before it begins.
    #[must_use]
    pub fn len(self) -> usize {
        usize::from(self.to) + 1 - usize::from(self.from.min(self.to.saturating_add(1)))
    }

    /// Does it end before it begins?
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.to < self.from
    }
}
