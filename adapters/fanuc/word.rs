//! The words of a block (F, S, T and so on) as modal values: their numbers on the wire and in the vendor's library.

use serde::{Deserialize, Serialize};

/// Words that a block can carry, in the order of their numbers on the wire (0 to 28).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the letters of the words say it; M2 and M3 are the second and third M of a block")]
pub enum BlockWord {
    A,
    B,
    C,
    D,
    E,
    F,
    H,
    I,
    J,
    K,
    L,
    M,
    M2,
    M3,
    /// Not used by the controls that are known.
    Unused14,
    /// Not used either, as [`BlockWord::Unused14`].
    Unused15,
    N,
    O,
    P,
    Q,
    R,
    S,
    T,
    U,
    V,
    W,
    X,
    Y,
    Z,
}

impl BlockWord {
    /// Every word with its number in the library's `cnc_modal`; on the wire it has the number of its place here.
    /// Source: what `libfwlib32` 1.0.5 puts on the wire for each of its numbers.
    pub const ALL: [(Self, Option<i16>); 29] = [
        (Self::A, Some(112)),
        (Self::B, Some(100)),
        (Self::C, Some(113)),
        (Self::D, Some(101)),
        (Self::E, Some(102)),
        (Self::F, Some(103)),
        (Self::H, Some(104)),
        (Self::I, Some(114)),
        (Self::J, Some(115)),
        (Self::K, Some(116)),
        (Self::L, Some(105)),
        (Self::M, Some(106)),
        (Self::M2, Some(125)),
        (Self::M3, Some(126)),
        (Self::Unused14, None),
        (Self::Unused15, None),
        (Self::N, Some(117)),
        (Self::O, Some(118)),
        (Self::P, Some(110)),
        (Self::Q, Some(111)),
        (Self::R, Some(109)),
        (Self::S, Some(107)),
        (Self::T, Some(108)),
        (Self::U, Some(119)),
        (Self::V, Some(120)),
        (Self::W, Some(121)),
        (Self::X, Some(122)),
        (Self::Y, Some(123)),
        (Self::Z, Some(124)),
    ];

    /// Its number on the wire.
    #[must_use]
    pub fn wire_number(self) -> i32 {
        self as i32
    }

    /// Its number in the vendor's library.
    #[must_use]
    pub fn number_in_library(self) -> Option<i16> {
        Self::ALL.iter().find(|(word, _)| *word == self).and_then(|(_, number)| *number)
    }

    /// The word with this number on the wire.
    #[must_use]
    pub fn of_number(number: i32) -> Option<Self> {
        Self::ALL.get(usize::try_from(number).ok()?).map(|(word, _)| *word)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_words_stand_in_the_order_of_their_numbers() {
        for (number, (word, _)) in (0..).zip(BlockWord::ALL) {
            assert_eq!((word.wire_number(), BlockWord::of_number(number)), (number, Some(word)));
        }
        // By hand from the reference: cnc_modal(103), (106), (107), (108) and (109) ask for 5, 11, 21, 22 and 20.
        let asked = [
            (BlockWord::F, 5, 103),
            (BlockWord::M, 11, 106),
            (BlockWord::S, 21, 107),
            (BlockWord::T, 22, 108),
            (BlockWord::R, 20, 109),
        ];
        for (word, wire, library) in asked {
            assert_eq!((word.wire_number(), word.number_in_library()), (wire, Some(library)), "{word:?}");
        }
        assert_eq!(BlockWord::of_number(29), None);
    }
}
