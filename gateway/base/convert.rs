//! Conversions between kinds of numbers in which the greatest value stands for everything beyond it. Each is right for the reason
//! that its documentation gives; a number that is stored or sent and must be exact is converted with an error instead.

use adapter_core::clock::{SECOND_NS, TimeNs};
pub use adapter_core::integer::{saturate_to_ms, saturate_to_ns, saturate_to_us};
use std::time::Duration;

/// A duration without sign, ns. More than 584 years are 584 years: nothing here is waited for that long.
#[must_use]
pub fn duration_to_unsigned_ns(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

/// An instant from seconds since 1970. Instants end in 2262; a clock that says more is wrong, and no instant is farther off than
/// the last one.
#[must_use]
pub fn seconds_to_instant(at_s: u64) -> TimeNs {
    clamp_to_signed(at_s).saturating_mul(SECOND_NS)
}

/// Whole seconds since 1970 of an instant; none before 1970, which a clock says that was never set.
#[must_use]
pub fn instant_to_seconds(at_ns: TimeNs) -> u64 {
    clamp_to_unsigned(at_ns.div_euclid(SECOND_NS))
}

/// What must not be negative: time since 1970, or a count as `SQLite` holds it. A clock that says less has not been set, and fewer
/// than none is none. Only for figures to look at and to measure by; a number that names something is read with an error.
#[must_use]
pub fn clamp_to_unsigned(number: i64) -> u64 {
    u64::try_from(number).unwrap_or(0)
}

/// A count, a limit or the bound of a query as `SQLite` holds it: no count comes near 2^63, and a bound beyond it bounds nothing.
#[must_use]
pub fn clamp_to_signed(number: u64) -> i64 {
    i64::try_from(number).unwrap_or(i64::MAX)
}

/// A count or a limit as a length in memory. Where addresses have 32 bits, what is beyond them does not fit into the memory
/// either, so that whoever compares or bounds with it decides alike.
#[must_use]
pub fn clamp_to_length(number: u64) -> usize {
    usize::try_from(number).unwrap_or(usize::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fits_is_exact_and_what_does_not_is_the_bound() {
        let span = Duration::new(3, 500_000_001);
        assert_eq!((saturate_to_ns(span), duration_to_unsigned_ns(span)), (3_500_000_001, 3_500_000_001));
        assert_eq!((saturate_to_us(span), saturate_to_ms(span)), (3_500_000, 3_500));
        assert_eq!((saturate_to_ns(Duration::MAX), duration_to_unsigned_ns(Duration::MAX)), (i64::MAX, u64::MAX));
        assert_eq!((instant_to_seconds(2 * SECOND_NS + 5), instant_to_seconds(-1)), (2, 0));
        assert_eq!((seconds_to_instant(2), seconds_to_instant(u64::MAX)), (2 * SECOND_NS, TimeNs::MAX));
        assert_eq!((clamp_to_unsigned(-1), clamp_to_unsigned(7)), (0, 7));
        assert_eq!((clamp_to_signed(u64::MAX), clamp_to_signed(7)), (i64::MAX, 7));
        assert_eq!(clamp_to_length(7), 7);
    }
}
