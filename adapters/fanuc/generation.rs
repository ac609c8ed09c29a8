//! What a controller says of itself when a connection is opened, and which generation it is.

use super::wire::{Cursor, WireError};
use serde::{Deserialize, Serialize};

/// Generation of a controller, from the version word of its frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Generation {
    /// Version word up to 2: 16i, 18i, 21i, 0i-A to C.
    Older(u16),
    /// Version word 3 and more: 30i, 31i, 32i, 35i, 0i-D and F.
    Newer(u16),
}

impl Generation {
    /// The generation of this version word.
    #[must_use]
    pub fn from_version(version: u16) -> Self {
        if version <= 2 { Self::Older(version) } else { Self::Newer(version) }
    }

    /// The version word as the control sent it.
    #[must_use]
    pub fn version(self) -> u16 {
        match self {
            Self::Older(version) | Self::Newer(version) => version,
        }
    }

    /// Longest body of an answer that such a controller sends.
    #[must_use]
    pub fn answer_max(self) -> usize {
        match self {
            Self::Older(_) => 1450,
            Self::Newer(3) => 2910,
            Self::Newer(_) => 3470,
        }
    }
}

/// The answer to the opening of a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Opening {
    /// Which encodings to use.
    pub generation: Generation,
    /// Number of the family of controllers.
    pub family: u16,
    /// Places for axes in every answer about all axes.
    pub axes_max: u16,
    /// Places for spindles in every answer about all spindles.
    pub spindles_max: u16,
    /// Paths of this controller.
    pub paths: u16,
    /// Axes of the asked path.
    pub axes: u16,
    /// Spindles of the asked path.
    pub spindles: u16,
}

/// Words of a path in the two forms of the answer, and where axes and spindles stand in them.
const OLDER: (usize, usize, usize) = (4, 2, 3);
const NEWER: (usize, usize, usize) = (16, 3, 5);

impl Opening {
    /// Reads the body of the answer for one path from 1.
    ///
    /// # Errors
    /// It has another form.
    pub fn read(generation: Generation, body: &[u8], path: u16) -> Result<Self, WireError> {
        let mut cursor = Cursor::new("answer to the opening", body);
        let heads = if matches!(generation, Generation::Older(_)) { 8 } else { 20 };
        let head = read_words(&mut cursor, heads)?;
        let (axes_max, spindles_max, paths, shape, records) = match generation {
            Generation::Older(_) => (head[2], head[3], head[5], OLDER, head[4]),
            Generation::Newer(_) => (head[3], head[4], head[11], NEWER, 10),
        };
        let records = (0..records.min(64)).map(|_| read_words(&mut cursor, shape.0)).collect::<Result<Vec<_>, _>>()?;
        cursor.check_end()?;
        let own = records.get(usize::from(path).saturating_sub(1));
        let at = |index: usize| own.map_or(0, |record| record[index]);
        let (axes, spindles) = (at(shape.1), at(shape.2));
        Ok(Self { generation, family: head[1], axes_max, spindles_max, paths, axes, spindles })
    }

    /// The body of the answer for a controller whose paths all have as many axes and spindles.
    #[must_use]
    pub fn encode_body(&self) -> Vec<u8> {
        self.body_with(|_| (self.axes, self.spindles))
    }

    /// The body of the answer; `of` says how many axes and spindles a path from 1 has.
    #[must_use]
    pub fn body_with(&self, of: impl Fn(u16) -> (u16, u16)) -> Vec<u8> {
        let words = match self.generation {
            Generation::Older(_) => self.encode_older(of),
            Generation::Newer(_) => self.encode_newer(of),
        };
        words.iter().flat_map(|word| word.to_be_bytes()).collect()
    }

    fn encode_older(&self, of: impl Fn(u16) -> (u16, u16)) -> Vec<u16> {
        let mut words = vec![7, self.family, self.axes_max, self.spindles_max, self.paths, self.paths, 0, 0];
        (1..=self.paths).for_each(|path| words.extend([SYSTEM, path, of(path).0, of(path).1]));
        words
    }

    fn encode_newer(&self, of: impl Fn(u16) -> (u16, u16)) -> Vec<u16> {
        let mut words = vec![0; 20 + 10 * 16];
        let head = [6, self.family, 1, self.axes_max, self.spindles_max, 10, 3, 3, self.axes, self.axes];
        words[..10].copy_from_slice(&head);
        words[10..15].copy_from_slice(&[self.spindles, self.paths, 1, 0, 1]);
        for path in 1..=self.paths.min(10) {
            let at = 20 + 16 * usize::from(path - 1);
            let (axes, spindles) = of(path);
            words[at..at + 8].copy_from_slice(&[SYSTEM, path, 0, axes, axes, spindles, 1, 1]);
        }
        words
    }
}

/// " M": a milling system.
const SYSTEM: u16 = 0x204D;

fn read_words(cursor: &mut Cursor<'_>, count: usize) -> Result<Vec<u16>, WireError> {
    (0..count).map(|_| cursor.read_u16()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn opening(generation: Generation) -> Opening {
        let (family, axes_max, spindles_max) =
            if matches!(generation, Generation::Older(_)) { (3, 8, 4) } else { (5, 32, 8) };
        Opening { generation, family, axes_max, spindles_max, paths: 1, axes: 3, spindles: 1 }
    }

    #[test]
    fn both_forms_are_read_as_they_are_written() {
        for version in [2, 3, 4] {
            let opening = opening(Generation::from_version(version));
            let body = opening.encode_body();
            assert_eq!(body.len(), if version == 2 { 24 } else { 360 });
            assert_eq!(Opening::read(opening.generation, &body, 1), Ok(opening));
            assert!(Opening::read(opening.generation, &body[1..], 1).is_err());
        }
    }

    #[test]
    fn a_path_that_is_not_there_has_no_axes() {
        let opening = opening(Generation::from_version(2));
        let other = Opening::read(opening.generation, &opening.encode_body(), 2).expect("readable");
        assert_eq!((other.axes, other.spindles), (0, 0));
    }
}
