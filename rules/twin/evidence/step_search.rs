//! A level that begins somewhere: the row from which a carrier has another factor than before.

use super::gram::Comparison;
use super::noise::NoiseModel;
use numerics::statistics::count_to_f64;

/// Share of the carrier's square on each side of the row.
const SIDE: f64 = 0.04;
/// Rows that are tried: a change is known to a few rows at best.
const TRIED: usize = 400;
/// Nats beyond the price of the choice from which a row is offered.
const NATS_MIN: f64 = 3.0;

/// Where a level begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Step {
    pub(super) row: usize,
    /// Logarithm of the number of rows that were tried.
    pub(super) ln_choices: f64,
}

/// The row at which the factor of a carrier changes most, in what is left over.
pub(super) fn find_step(comparison: &Comparison<'_>, left: &[f64], carrier: &[f64], noise: NoiseModel) -> Option<Step> {
    let (x, y) = (comparison.whiten_column(carrier, noise), comparison.whiten_column(left, noise));
    let total = |of: &dyn Fn(usize) -> f64| (0..x.len()).map(of).sum::<f64>();
    let (xx, xy) = (total(&|at| x[at] * x[at]), total(&|at| x[at] * y[at]));
    let variance = total(&|at| y[at] * y[at]) / count_to_f64(x.len().max(1));
    let every = x.len().div_ceil(TRIED).max(1);
    let (mut before_xx, mut before_xy) = (0.0, 0.0);
    let mut best: Option<(f64, usize)> = None;
    for at in 0..x.len() {
        let known = before_xx > SIDE * xx && before_xx < (1.0 - SIDE) * xx;
        if known && at % every == 0 {
            let (after_xx, after_xy) = (xx - before_xx, xy - before_xy);
            let change = after_xy / after_xx - before_xy / before_xx;
            let nats = 0.5 * change * change / ((1.0 / before_xx + 1.0 / after_xx) * variance);
            if best.is_none_or(|best| nats > best.0) {
                best = Some((nats, comparison.rows[at]));
            }
        }
        before_xx += x[at] * x[at];
        before_xy += x[at] * y[at];
    }
    let ln_choices = count_to_f64(x.len().min(TRIED)).ln();
    best.filter(|(nats, _)| *nats > ln_choices + NATS_MIN).map(|(_, row)| Step { row, ln_choices })
}
