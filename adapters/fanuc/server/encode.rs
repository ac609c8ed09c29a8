//! Values as bytes of an answer, big-endian.

pub(super) fn encode_text(text: &str, len: usize) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize(len, 0);
    bytes
}

pub(super) fn encode_shorts(numbers: &[i16]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_be_bytes()).collect()
}

pub(super) fn encode_longs(numbers: &[i32]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_be_bytes()).collect()
}

/// A count that travels as 32 bits.
pub(super) fn clamp_to_i32(count: usize) -> i32 {
    i32::try_from(count).unwrap_or(i32::MAX)
}
