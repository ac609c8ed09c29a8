//! Values as bytes of an answer, big-endian.

use adapter_core::integer::convert_bounded;

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

/// A count of what is in memory, as 32 bits.
pub(super) fn convert_to_i32(count: usize) -> i32 {
    convert_bounded(count, i32::MAX)
}

/// A counter that the control shows in 32 bits: it stands at its greatest number when there is more to count.
pub(super) fn saturate_counter(count: i64) -> i32 {
    i32::try_from(count.max(0)).unwrap_or(i32::MAX)
}
