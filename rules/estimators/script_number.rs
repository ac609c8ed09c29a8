//! Numbers that are written into scripts: whoever reads them back has the same number.

/// A number as a script reads one: with a point, without an exponent, and with as many digits as the same number needs to come back
/// (17 at most). A coefficient of the third power is small and acts on a great number, so places after the point say nothing about
/// what may be left out.
#[must_use]
pub fn format_script_number(value: f64) -> String {
    let text = value.to_string();
    if text.contains('.') || !value.is_finite() { text } else { text + ".0" }
}

#[cfg(test)]
mod tests {
    use super::format_script_number;
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn every_number_comes_back() {
        let mut dice = Pcg64Mcg::seed_from_u64(7);
        let random = (0..20_000).map(|_| {
            let size: f64 = dice.random_range(-30.0..12.0);
            dice.random_range(-1.0..1.0) * 10.0_f64.powf(size)
        });
        let given = [0.0, -0.0, 7.4e-13, 1.0, -2.0, 1e15, 0.1 + 0.2, f64::MIN_POSITIVE];
        for value in random.chain(given) {
            let text = format_script_number(value);
            assert_eq!(text.parse::<f64>().map(f64::to_bits), Ok(value.to_bits()), "{text}");
            assert!(text.contains('.') && !text.contains('e'), "{text}");
        }
    }
}
