//! Which numbers come back bit for bit, and to what the others are rounded.
//!
//! Controllers and meters deliver short decimals (0.1 W, 0.001 mm): those are kept exactly. Interpolated and estimated
//! values have 17 digits of which most are noise: those are rounded to the series' resolution, once, so that the crash
//! tail, the blocks, the page and `history query` all show the same number.

/// Decimal places of a number that is kept exactly.
pub(crate) const PLACES_MAX: u8 = 9;
/// A scaled number below this is an integer that a double holds exactly and that survives two differences.
pub(crate) const SCALED_MAX: f64 = 1e15;
/// Significant digits of a number that is kept exactly: scaled, it stays below this.
const SIGNIFICANT_MAX: f64 = 1e9;

/// Powers of ten from 0 to [`PLACES_MAX`].
pub(crate) const TEN: [f64; 10] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9];

/// The nearest integer of `x`, ties to even; exact for |x| < 2^51.
#[inline]
pub(crate) fn round_to_integer(x: f64) -> f64 {
    const MAGIC: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52: adding it pushes the fraction out of the mantissa
    (x + MAGIC) - MAGIC
}

/// `value` as the history keeps it: unchanged when it is a decimal of at most 9 significant digits and 9 places,
/// otherwise rounded to `decimals` places. Numbers too large for that are left alone.
#[must_use]
#[inline]
pub fn round_to_decimals(value: f64, decimals: u8) -> f64 {
    let scale = TEN[usize::from(decimals.min(PLACES_MAX))];
    let scaled = value * scale;
    // NaN fails the comparison too and is left to the caller.
    if scaled.abs() >= SCALED_MAX || scaled.is_nan() {
        return value;
    }
    let kept = round_to_integer(scaled) / scale;
    if kept == value || is_short_decimal(value) { value } else { kept }
}

fn is_short_decimal(value: f64) -> bool {
    let magnitude = value.abs();
    let places = TEN.iter().take_while(|ten| magnitude * **ten < SIGNIFICANT_MAX).count();
    places > 0 && round_to_integer(value * TEN[places - 1]) / TEN[places - 1] == value
}

/// The fewest decimal places, at least `at_least`, with which every one of `values` is an exact scaled integer.
pub(crate) fn places_of(values: &[f64]) -> Option<u8> {
    let mut places = 0;
    for value in values {
        while round_to_integer(value * TEN[places]) / TEN[places] != *value || (value * TEN[places]).abs() >= SCALED_MAX
        {
            places += 1;
            if places > usize::from(PLACES_MAX) {
                return None;
            }
        }
    }
    u8::try_from(places).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn short_decimals_stay_and_long_fractions_are_rounded() {
        assert_eq!(round_to_decimals(0.000_696, 1), 0.000_696);
        assert_eq!(round_to_decimals(1203.4, 1), 1203.4);
        assert_eq!(round_to_decimals(817.238_746_112_359, 1), 817.2);
        assert_eq!(round_to_decimals(-1.0 / 3.0, 3), -0.333);
        assert_eq!(round_to_decimals(1e300, 3), 1e300);
    }

    proptest! {
        #[test]
        fn rounding_is_close_and_once_is_enough(value in -1e9f64..1e9, decimals in 0u8..=9) {
            let kept = round_to_decimals(value, decimals);
            prop_assert!((kept - value).abs() <= 0.5000001 / TEN[usize::from(decimals)] + value.abs() * 2.3e-16);
            prop_assert_eq!(round_to_decimals(kept, decimals), kept);
        }

        #[test]
        fn nine_digits_survive(digits in -999_999_999i64..1_000_000_000, places in 0usize..=9) {
            let value = digits as f64 / TEN[places];
            prop_assert_eq!(round_to_decimals(value, 0), value);
            prop_assert!(places_of(&[value]).is_some());
        }
    }
}
