//! How well a law predicts rows that it has not seen: whole runs, or contiguous blocks, are left out one at a time.
//!
//! Leaving out single rows says nothing here: the neighbours of a row know it. Source: Roberts et al. (2017), Ecography
//! 40:913 (blocked cross-validation for data with structure).

use super::quantities::THERMAL_ERROR;
use crate::regression::{Column, Intercept, Refusal, fit_unweighted};
use serde::Serialize;
use std::ops::Range;

/// Errors of rows that were left out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HeldOut {
    /// Root mean square over all rows, um.
    pub rms_um: f64,
    /// Greatest error of a row, um.
    pub greatest_um: f64,
    /// Mean square of each block, um^2.
    #[serde(skip)]
    pub blocks: Vec<f64>,
}

impl HeldOut {
    /// From the squared errors of each block.
    pub(super) fn from_squares(squares: &[Vec<f64>]) -> Self {
        let all: Vec<f64> = squares.concat();
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
        Self {
            rms_um: mean(&all).sqrt(),
            greatest_um: all.iter().copied().fold(0.0, f64::max).sqrt(),
            blocks: squares.iter().map(|block| mean(block)).collect(),
        }
    }

    /// Is this clearly better than `other`: by the share `least` of its root mean square, and in the blocks on average by
    /// more than the standard error of the difference?
    #[must_use]
    pub fn is_better_than(&self, other: &Self, least: f64) -> bool {
        let gains: Vec<f64> = other.blocks.iter().zip(&self.blocks).map(|(theirs, ours)| theirs - ours).collect();
        let count = gains.len().max(2) as f64;
        let mean = gains.iter().sum::<f64>() / count;
        let variance = gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() / (count - 1.0);
        self.rms_um < (1.0 - least) * other.rms_um && mean > (variance / count).sqrt()
    }
}

/// The errors of blocks that were left out; with no columns the law is the mean.
///
/// # Errors
/// As the regression of the rows that remain.
pub(super) fn held_out(columns: &[Column], y: &[f64], blocks: &[Range<usize>]) -> Result<HeldOut, Refusal> {
    let squares = blocks.iter().map(|block| left_out(columns, y, block)).collect::<Result<Vec<_>, Refusal>>()?;
    Ok(HeldOut::from_squares(&squares))
}

fn left_out(columns: &[Column], y: &[f64], block: &Range<usize>) -> Result<Vec<f64>, Refusal> {
    let coefficients = train_outside_block(columns, y, block)?;
    Ok(compute_squared_errors(&coefficients, columns, y, block))
}

/// Rows outside of the block.
pub(super) fn exclude_block(values: &[f64], block: &Range<usize>) -> Vec<f64> {
    values[..block.start].iter().chain(&values[block.end..]).copied().collect()
}

/// Constant and coefficients from the rows outside of the block.
pub(super) fn train_outside_block(columns: &[Column], y: &[f64], block: &Range<usize>) -> Result<Vec<f64>, Refusal> {
    let target = exclude_block(y, block);
    if columns.is_empty() {
        return Ok(vec![target.iter().sum::<f64>() / target.len().max(1) as f64]);
    }
    let train: Vec<Column> =
        columns.iter().map(|c| Column::new(c.name.as_str(), exclude_block(&c.values, block))).collect();
    Ok(fit_unweighted(&Column::new(THERMAL_ERROR, target), &train, Intercept::Fitted)?.values())
}

/// Squared errors of constant and coefficients in the rows of the block.
pub(super) fn compute_squared_errors(
    coefficients: &[f64],
    columns: &[Column],
    y: &[f64],
    block: &Range<usize>,
) -> Vec<f64> {
    let predicted = |row: usize| {
        coefficients[0] + coefficients[1..].iter().zip(columns).map(|(b, c)| b * c.values[row]).sum::<f64>()
    };
    block.clone().map(|row| (y[row] - predicted(row)).powi(2)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_right_law_predicts_what_it_has_not_seen_and_the_mean_does_not() {
        let x: Vec<f64> = (0..60).map(|row| f64::from(row % 17)).collect();
        let y: Vec<f64> = x.iter().map(|x| 3.0 + 2.0 * x).collect();
        let blocks = [0..20, 20..40, 40..60];
        let right = held_out(&[Column::new("x", x)], &y, &blocks).expect("a law");
        let mean = held_out(&[], &y, &blocks).expect("a mean");
        assert!(right.rms_um < 1e-9 && mean.rms_um > 9.0, "{right:?} {mean:?}");
        assert!(right.is_better_than(&mean, 0.05) && !mean.is_better_than(&right, 0.05));
    }
}
