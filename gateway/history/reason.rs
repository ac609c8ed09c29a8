//! Reasons of absence as one byte: 0 is a value, 1 to 10 the first ten reasons of a reading, above that words of estimators, and from
//! 252 on the further reasons of a reading. A code means the same in every history that was ever written.

use adapter_core::Absence;
use std::sync::Arc;

/// The code of a value that is there.
pub(crate) const PRESENT: u8 = 0;
/// The code of a channel that no source delivers.
pub(crate) const NOT_PROVIDED: u8 = 1;
/// The code of a number that is none.
pub(crate) const OUT_OF_RANGE: u8 = 8;
/// The first code given to an estimator's own word.
const FIRST_OWN: u8 = 11;
/// The code of the reason of a reading that came after the first ten.
const FIRST_FURTHER: u8 = 252;
/// At most this many own words; further ones share the last code. Reasons are a handful of constants.
const OWN_MAX: u8 = 240;
/// The word of everything beyond [`OWN_MAX`].
const OTHER: &str = "other";

/// The code of a reading's reason.
pub(crate) fn code_of(absence: Absence) -> u8 {
    let code = absence.as_code() + 1;
    if code < FIRST_OWN { code } else { FIRST_FURTHER + (code - FIRST_OWN) }
}

/// Words and codes, both ways.
#[derive(Debug, Clone, Default)]
pub struct Reasons {
    own: Vec<Arc<str>>,
}

impl Reasons {
    /// No own words yet.
    pub(crate) const fn none() -> Self {
        Self { own: Vec::new() }
    }

    /// The code of `word`, learned when it is new.
    pub(crate) fn intern_word(&mut self, word: &str) -> u8 {
        if let Some(position) = self.own.iter().position(|known| &**known == word) {
            return own_code(position);
        }
        if let Some(absence) = Absence::from_word(word) {
            return code_of(absence);
        }
        let word = if self.own.len() < usize::from(OWN_MAX) { word } else { OTHER };
        self.own.push(word.into());
        self.own.truncate(usize::from(OWN_MAX) + 1);
        own_code(self.own.len() - 1)
    }

    /// The word of `code`; `None` for a value that is there.
    #[must_use]
    pub fn find_word(&self, code: u8) -> Option<&str> {
        match code {
            PRESENT => None,
            1..FIRST_OWN => Absence::from_code(code - 1).map(Absence::as_word),
            FIRST_FURTHER.. => Absence::from_code(code - FIRST_FURTHER + FIRST_OWN - 1).map(Absence::as_word),
            _ => Some(self.own.get(usize::from(code - FIRST_OWN)).map_or(OTHER, |word| word)),
        }
    }

    /// Is this an estimator's own word, whose code means nothing outside these reasons?
    pub(crate) fn is_own(code: u8) -> bool {
        (FIRST_OWN..FIRST_FURTHER).contains(&code)
    }
}

fn own_code(position: usize) -> u8 {
    FIRST_OWN + u8::try_from(position).map_or(OWN_MAX, |position| position.min(OWN_MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reason_survives_its_code() {
        let mut reasons = Reasons::default();
        for absence in Absence::ALL {
            assert_eq!(reasons.find_word(code_of(absence)), Some(absence.as_word()));
            assert_eq!(reasons.intern_word(absence.as_word()), code_of(absence));
        }
        assert_eq!(reasons.find_word(NOT_PROVIDED), Some("not_provided"));
        assert_eq!(reasons.find_word(OUT_OF_RANGE), Some("out_of_range"));
        let own = reasons.intern_word("not_learned");
        assert_eq!((reasons.intern_word("not_learned"), reasons.find_word(own)), (own, Some("not_learned")));
    }

    #[test]
    fn too_many_words_end_in_other() {
        let mut reasons = Reasons::default();
        let codes: Vec<u8> = (0..400).map(|number| reasons.intern_word(&format!("word_{number}"))).collect();
        assert_eq!(reasons.find_word(codes[0]), Some("word_0"));
        assert_eq!(reasons.find_word(codes[399]), Some("other"));
        assert!(codes.iter().all(|code| Reasons::is_own(*code)), "none of them is the reason of a reading");
    }
}
