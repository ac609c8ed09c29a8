//! Conversions between kinds of whole numbers that cannot fail, each with the reason why it cannot, or why the greatest number is
//! right in the place of what is beyond it.
//!
//! A number from a device, a file or a configuration that may really be out of range is converted with `try_from` and an error of
//! the caller instead: nothing here makes a wrong number out of it.

use std::fmt::Display;
use std::time::Duration;

/// The greatest duration of [`saturate_to_wait_ns`], ns: 36 years.
const WAIT_MAX_NS: i64 = i64::MAX / 8;

/// A duration as a difference of instants, ns. More than 292 years are 292 years, which is right for a limit and for an age: no
/// instant is farther away, so that both compare as before.
#[must_use]
pub fn saturate_to_ns(duration: Duration) -> i64 {
    i64::try_from(duration.as_nanos()).unwrap_or(i64::MAX)
}

/// A duration that is added to instants, ns: at most 36 years, so that an instant of today and several such durations stay below
/// the last instant. Right for periods, delays and deadlines: nothing here waits for 36 years.
#[must_use]
pub fn saturate_to_wait_ns(duration: Duration) -> i64 {
    saturate_to_ns(duration).min(WAIT_MAX_NS)
}

/// A duration in whole milliseconds, for a message or a deadline. The greatest number stands for half a billion years and more.
#[must_use]
pub fn saturate_to_ms(duration: Duration) -> u64 {
    u64::try_from(duration.as_millis()).unwrap_or(u64::MAX)
}

/// A duration in whole microseconds, for a histogram. The greatest number stands for half a million years and more.
#[must_use]
pub fn saturate_to_us(duration: Duration) -> u64 {
    u64::try_from(duration.as_micros()).unwrap_or(u64::MAX)
}

/// A count that another program or a device tells, of which at most `most` are looked at. Fewer than none is none. Only for a
/// count that bounds what is taken from bytes or records that are there; a count that is stored is converted with an error.
#[must_use]
pub fn clamp_count(told: impl Into<i64>, most: usize) -> usize {
    let told: i64 = told.into();
    if told <= 0 { 0 } else { usize::try_from(told).map_or(most, |told| told.min(most)) }
}

/// A number that the caller has bounded, so that it fits: the bound stands beside the call. With debug assertions a number that
/// does not fit is a panic; without them it is `greatest`, the greatest number that the caller can use.
///
/// # Panics
/// With debug assertions, when the number does not fit.
#[must_use]
pub fn convert_bounded<N, T>(number: N, greatest: T) -> T
where
    N: Copy + Display,
    T: TryFrom<N> + Display,
{
    let converted = T::try_from(number);
    debug_assert!(converted.is_ok(), "{number} does not fit where at most {greatest} is expected");
    converted.unwrap_or(greatest)
}

/// A length as a number with sign. No object in memory is larger than `isize::MAX` bytes, so that every length fits.
#[must_use]
pub fn length_to_i64(length: usize) -> i64 {
    convert_bounded(length, i64::MAX)
}

/// A length or a count as 64 bits, which addresses do not exceed.
#[must_use]
pub const fn widen_to_u64(length: usize) -> u64 {
    const { assert!(usize::BITS <= u64::BITS) };
    length as u64
}

/// A number of 32 bits as a length; addresses have at least as many.
#[must_use]
pub const fn widen_to_usize(number: u32) -> usize {
    const { assert!(usize::BITS >= u32::BITS) };
    number as usize
}

/// A count of things in memory as a double. Doubles are exact up to 2^53, which no count in memory reaches.
#[must_use]
#[expect(clippy::cast_precision_loss, reason = "a count in memory is far below 2^53")]
pub fn count_to_f64(count: usize) -> f64 {
    debug_assert!(widen_to_u64(count) < 1 << 53, "{count} is too great for a double");
    count as f64
}

/// A constant as 16 bits; to be called in a constant, where one that does not fit is not compiled.
///
/// # Panics
/// When the number does not fit.
#[must_use]
#[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "asserted in the line before")]
pub const fn const_to_i16(number: usize) -> i16 {
    assert!(number <= i16::MAX.unsigned_abs() as usize);
    number as i16
}

/// The lowest 16 bits.
#[must_use]
pub const fn take_low_u16(bits: u64) -> u16 {
    let [a, b, ..] = bits.to_le_bytes();
    u16::from_le_bytes([a, b])
}

/// The lowest 32 bits.
#[must_use]
pub const fn take_low_u32(bits: u64) -> u32 {
    let [a, b, c, d, ..] = bits.to_le_bytes();
    u32::from_le_bytes([a, b, c, d])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_that_fit_are_exact_and_others_are_the_bound() {
        let span = Duration::new(3, 500_000_001);
        assert_eq!((saturate_to_ns(span), saturate_to_wait_ns(span)), (3_500_000_001, 3_500_000_001));
        assert_eq!((saturate_to_ms(span), saturate_to_us(span)), (3_500, 3_500_000));
        assert_eq!((saturate_to_ns(Duration::MAX), saturate_to_wait_ns(Duration::MAX)), (i64::MAX, WAIT_MAX_NS));
    }

    #[test]
    fn a_count_that_is_told_is_between_none_and_the_most() {
        assert_eq!([-1, 0, 3, 9].map(|told| clamp_count(told, 4)), [0, 0, 3, 4]);
        assert_eq!(clamp_count(i64::MIN, 4), 0);
    }

    #[test]
    fn numbers_that_fit_are_exact() {
        assert_eq!(convert_bounded(255_usize, u8::MAX), 255);
        assert_eq!((length_to_i64(7), widen_to_u64(7), widen_to_usize(u32::MAX)), (7, 7, 0xFFFF_FFFF));
        assert_eq!(count_to_f64(7).to_bits(), 7.0_f64.to_bits());
        assert_eq!((take_low_u16(0x1_2345), take_low_u32(0x1_2345_6789)), (0x2345, 0x2345_6789));
        const { assert!(const_to_i16(32) == 32) };
    }

    #[test]
    #[should_panic(expected = "256 does not fit where at most 255 is expected")]
    #[cfg(debug_assertions)]
    fn a_number_beyond_its_bound_is_found_by_tests() {
        let _ = convert_bounded(256_usize, u8::MAX);
    }
}
