//! Counts, means, medians, quantiles: the few numbers that describe many.

/// A count as a number.
#[must_use]
pub(crate) fn count(n: usize) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "counts of rows stay far below 2^52")]
    let n = n as f64;
    n
}

/// The mean; zero for no values.
#[must_use]
pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / count(values.len().max(1))
}

/// The median of finite values, the upper of two; `None` for none.
#[must_use]
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The value below which this share of the values lies; `None` for none.
#[must_use]
pub(crate) fn quantile(values: impl IntoIterator<Item = f64>, share: f64) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    let last = values.len().checked_sub(1)?;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a count lies within it")]
    let at = (count(last) * share).round() as usize;
    (at <= last).then(|| *values.select_nth_unstable_by(at, f64::total_cmp).1)
}

/// The standard deviation of normal noise about zero, told by the middle of its sizes: whatever the few greatest are.
/// `None` for no values.
#[must_use]
pub(crate) fn robust_deviation(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    median(values.into_iter().map(f64::abs).collect()).map(|middle| 1.4826 * middle)
}

/// The root of the mean square; zero for no values.
#[must_use]
pub(crate) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / count(values.len().max(1))).sqrt()
}
