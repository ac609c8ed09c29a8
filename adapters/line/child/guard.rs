//! Buffers around what a library fills in.
//!
//! A vendor's library has been seen to write a kilobyte and more into a structure of 18 bytes when the controller's
//! answer was malformed. The structure therefore stands at the beginning of a much larger buffer whose rest holds a
//! pattern; a broken pattern is an overrun, and what was read is not used.

use thiserror::Error;

/// Bytes behind the structure. The largest answer of a controller fits many times.
pub const MARGIN_LEN: usize = 16 * 1024;

const PATTERN: u8 = 0xCC;

/// The library wrote beyond the structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("the library wrote {beyond} bytes beyond a structure of {length}")]
pub struct Overrun {
    /// Length of the structure.
    pub length: usize,
    /// Bytes up to the last one that changed.
    pub beyond: usize,
}

/// A structure of so many bytes with its margin, aligned to eight bytes.
#[derive(Debug, Clone)]
pub struct Guarded {
    words: Vec<u64>,
    length: usize,
}

impl Guarded {
    /// Zeros for a structure of this length, the pattern behind it.
    #[must_use]
    pub fn new(length: usize) -> Self {
        let mut guarded = Self { words: vec![0; (length + MARGIN_LEN).div_ceil(8)], length };
        let words: usize = length.div_ceil(8);
        guarded.words[words..].fill(u64::from_ne_bytes([PATTERN; 8]));
        if let Some(last) = words.checked_sub(1).filter(|_| !length.is_multiple_of(8)) {
            let bytes: [u8; 8] = std::array::from_fn(|index| if index < length % 8 { 0 } else { PATTERN });
            guarded.words[last] = u64::from_ne_bytes(bytes);
        }
        guarded
    }

    /// Where a library may write. At least [`MARGIN_LEN`] bytes beyond the structure belong to it.
    pub fn as_mut_ptr(&mut self) -> *mut u64 {
        self.words.as_mut_ptr()
    }

    /// The structure's bytes, when the margin is as it was.
    ///
    /// # Errors
    /// It is not.
    pub fn read_bytes(&self) -> Result<Vec<u8>, Overrun> {
        let whole = u64::from_ne_bytes([PATTERN; 8]);
        let (first, margin) = self.words.split_at(self.length.div_ceil(8));
        // Most of the margin is looked at by words and never copied.
        let reached = margin.iter().rposition(|word| *word != whole).map_or(0, |last| last + 1);
        let touched = first.iter().chain(&margin[..reached]);
        let mut bytes: Vec<u8> = touched.flat_map(|word| word.to_ne_bytes()).collect();
        match bytes[self.length..].iter().rposition(|byte| *byte != PATTERN) {
            Some(last) => Err(Overrun { length: self.length, beyond: last + 1 }),
            None => {
                bytes.truncate(self.length);
                Ok(bytes)
            }
        }
    }

    /// Puts bytes at the beginning of the structure; what does not fit is left out.
    pub fn write_bytes(&mut self, bytes: &[u8]) {
        let bytes = &bytes[..bytes.len().min(self.length)];
        for (index, byte) in bytes.iter().enumerate() {
            let mut word = self.words[index / 8].to_ne_bytes();
            word[index % 8] = *byte;
            self.words[index / 8] = u64::from_ne_bytes(word);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_margin_shows_an_overrun_of_one_byte() {
        for length in [1, 8, 18, 44, 260] {
            let mut guarded = Guarded::new(length);
            assert_eq!(guarded.read_bytes(), Ok(vec![0; length]));
            guarded.write_bytes(&vec![7; length + 100]);
            assert_eq!(guarded.read_bytes(), Ok(vec![7; length]), "put stays within");
            let mut word = guarded.words[length / 8].to_ne_bytes();
            word[length % 8] = 1;
            guarded.words[length / 8] = u64::from_ne_bytes(word);
            assert_eq!(guarded.read_bytes(), Err(Overrun { length, beyond: 1 }));
        }
    }
}
