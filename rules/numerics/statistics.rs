//! Counts, means, medians, quantiles: the few numbers that describe many; the normal distribution; correlation of pairs.

/// A count as a number.
#[must_use]
pub fn count_to_f64(n: usize) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "counts of rows stay far below 2^52")]
    let n = n as f64;
    n
}

/// The mean; zero for no values.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / count_to_f64(values.len().max(1))
}

/// The median of finite values, the upper of two; `None` for none.
#[must_use]
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The value below which this share of the values lies; `None` for none.
#[must_use]
pub fn quantile(values: impl IntoIterator<Item = f64>, share: f64) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    let last = values.len().checked_sub(1)?;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a count lies within it")]
    let at = (count_to_f64(last) * share).round() as usize;
    (at <= last).then(|| *values.select_nth_unstable_by(at, f64::total_cmp).1)
}

/// The standard deviation of normal noise about zero, told by the middle of its sizes: whatever the few greatest are.
/// `None` for no values.
#[must_use]
pub fn robust_deviation(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    median(values.into_iter().map(f64::abs).collect()).map(|middle| 1.4826 * middle)
}

/// The root of the mean square; zero for no values.
#[must_use]
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / count_to_f64(values.len().max(1))).sqrt()
}

/// Correlation of pairs in one pass, and how many there were; 0 where one side is constant.
#[must_use]
pub fn correlate_pairs(pairs: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    let (mut n, mut sx, mut sy, mut sxx, mut syy, mut sxy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for (x, y) in pairs {
        (n, sx, sy) = (n + 1.0, sx + x, sy + y);
        (sxx, syy, sxy) = (sxx + x * x, syy + y * y, sxy + x * y);
    }
    let spread: f64 = (n * sxx - sx * sx) * (n * syy - sy * sy);
    (if spread > 0.0 { (n * sxy - sx * sy) / spread.sqrt() } else { 0.0 }, n)
}

/// The complementary error function, relative error below 1.2e-7 (measured from -6 to 27: 1.1e-7).
///
/// `libm` 0.2 errs by 2.9e-16 and takes 53 ns instead of 37 ns; `statrs` 0.19 errs by 1.0e-10. Either moves nearly every
/// value in its seventh digit: the no-load powers that are learned, the evidences of a diagnosis, of which six digits are
/// printed, and with them the replay of what was recorded.
/// Source: Press et al., Numerical Recipes, section 6.2 (Chebyshev fit).
#[must_use]
pub fn erfc(x: f64) -> f64 {
    const TERMS: [f64; 10] = [
        -1.265_512_23,
        1.000_023_68,
        0.374_091_96,
        0.096_784_18,
        -0.186_288_06,
        0.278_868_07,
        -1.135_203_98,
        1.488_515_87,
        -0.822_152_23,
        0.170_872_77,
    ];
    let t = 1.0 / (1.0 + 0.5 * x.abs());
    let sum = TERMS.iter().rev().fold(0.0, |sum, term| sum * t + term);
    let tail = t * (-x * x + sum).exp();
    if x >= 0.0 { tail } else { 2.0 - tail }
}

/// Share of the standard normal distribution below `x`.
#[must_use]
pub fn normal_share(x: f64) -> f64 {
    0.5 * erfc(-x / std::f64::consts::SQRT_2)
}

/// Greatest magnitude; at least the smallest positive number, so that it can divide.
#[must_use]
pub fn find_greatest_magnitude(values: &[f64]) -> f64 {
    values.iter().fold(f64::MIN_POSITIVE, |top, value| top.max(value.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_the_normal_distribution_are_those_of_the_tables() {
        for (x, share) in [(0.0, 0.5), (1.0, 0.841_344_746), (-1.96, 0.024_997_895), (3.0, 0.998_650_102)] {
            assert!((normal_share(x) - share).abs() < 1e-6, "{x}: {}", normal_share(x));
        }
    }
}
