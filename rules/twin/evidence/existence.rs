//! Is anything missing at all? One test, whatever it may be called.
//!
//! What the best explanation leaves is cut into pieces that are longer than the memory of the noise, and the signs of whole
//! pieces are drawn anew (wild bootstrap: Wu, Annals of Statistics 14, 1986). In each such recording nothing is missing, and
//! it keeps whatever dependence the rows of a piece have. Everything that was asked of the recording is asked of it again:
//! the evidence of every variant of every family, summed; and where only several together are more than that, the evidence of
//! the best set that the same search finds. The share of these recordings in which as much is found is the chance that noise
//! alone does as well.

use super::gram::{Comparison, Gram};
use super::linear_algebra::{CholeskyFactor, extract_block};
use super::marginal::{Ground, Saturated, log_sum_exp};
use super::resampling::split_into_pieces;
use super::search::SetSearch;
use super::thresholds::THRESHOLDS;
use crate::hold_out::Random;
use ndarray::{Array1, Array2, Axis, s};
use numerics::statistics::count_to_f64;

/// Recordings without anything missing that are made. The chance is known to one over their number.
const DRAWS: usize = 199;
/// Seed of the signs.
const SEED: u64 = 2;
/// Sets that are followed where a drawn recording is searched for sets.
const BEAM: usize = 3;

/// What the test found.
#[derive(Debug, Clone, Copy)]
pub(super) struct ExistenceTest {
    /// Chance that noise alone does as well.
    pub(super) chance: f64,
    /// How many independent rows the fitted rows are worth.
    pub(super) effective_rows: f64,
}

/// Asks of a recording with what the best explanation leaves, and the evidence that this explanation has over nothing.
pub(super) fn test_existence(
    comparison: &Comparison<'_>,
    (gram, saturated): (&Gram, Saturated),
    priors: &[f64],
    left: &[f64],
    evidence: f64,
) -> ExistenceTest {
    let noise = gram.noise;
    let pieces = split_into_pieces(&comparison.blocks, comparison.rows.len(), noise.correlation_rows());
    let tall = comparison.build_whitened_matrix(noise, |_| true);
    let innovations = Array1::from(comparison.whiten_column(left, noise));
    let last = tall.ncols() - 1;
    let mut along = Array2::zeros((last, pieces.len()));
    for (index, piece) in pieces.iter().enumerate() {
        let rows = tall.select(Axis(0), piece);
        let own = innovations.select(Axis(0), piece);
        along.column_mut(index).assign(&rows.slice(s![.., ..last]).t().dot(&own));
    }
    let fixed: Vec<usize> = (0..comparison.count_fixed_columns()).collect();
    let ridge = comparison.build_fixed_ridge(&gram.whole, saturated.variance);
    let mut inner = extract_block(&gram.whole, &fixed, &fixed);
    ridge.iter().enumerate().for_each(|(index, ridge)| inner[[index, index]] += ridge);
    let factor = CholeskyFactor::from_matrix(&inner);
    let reach = gram.whole.slice(s![..comparison.count_fixed_columns(), ..last]).to_owned();
    let (ground, _) = comparison.prepare_baseline(gram, saturated);
    let asked = comparison.prepare_variants(&ground);
    let evidence_of = |along: &Array1<f64>, square: f64| -> f64 {
        log_sum_exp(
            asked
                .iter()
                .zip(priors)
                .map(|(variant, prior)| prior + comparison.compute_variant_evidence(&ground, variant, along, square)),
        )
    };
    let singles = evidence_of(&ground.extract_output_products(), ground.output_square());
    let square: f64 = innovations.dot(&innovations);
    let mut random = Random::new(SEED);
    let draws: Vec<(Array1<f64>, f64)> = (0..DRAWS)
        .map(|_| {
            let signs =
                Array1::from_iter((0..pieces.len()).map(|_| if random.draw_uniform() < 0.5 { 1.0 } else { -1.0 }));
            let mut drawn = along.dot(&signs);
            let baseline = drawn.slice(s![..comparison.count_fixed_columns()]).to_owned();
            let coefficients = factor.solve_system(&baseline);
            drawn -= &reach.t().dot(&coefficients);
            let kept = (square - baseline.dot(&coefficients)).max(f64::MIN_POSITIVE);
            (drawn, kept)
        })
        .collect();
    let of_draws: Vec<f64> = draws.iter().map(|(along, square)| evidence_of(along, *square)).collect();
    let reaching = |observed: f64| of_draws.iter().filter(|drawn| **drawn >= observed).count();
    let mut chance = compute_p_value(reaching(singles.max(evidence)));
    if chance <= THRESHOLDS.chance_max && compute_p_value(reaching(singles)) > THRESHOLDS.chance_max {
        let search = SetSearch { comparison, priors, beam: BEAM };
        chance = compute_p_value(count_reaching_draws(&search, &ground, &draws, evidence));
    }
    ExistenceTest {
        chance,
        effective_rows: estimate_effective_rows(comparison, noise.variance_inflation(), &pieces, &innovations),
    }
}

/// The chance that so many of the draws stand for.
fn compute_p_value(reaching: usize) -> f64 {
    count_to_f64(reaching + 1) / count_to_f64(DRAWS + 1)
}

/// In how many of these recordings a search finds a set of so much evidence; it ends as soon as they are too many.
fn count_reaching_draws(search: &SetSearch<'_>, ground: &Ground, draws: &[(Array1<f64>, f64)], evidence: f64) -> usize {
    let mut reaching = 0;
    for (along, square) in draws {
        let best = search
            .search_sets(&ground.with_output(along, *square), 0.0)
            .into_values()
            .fold(f64::NEG_INFINITY, f64::max);
        reaching += usize::from(best >= evidence);
        if compute_p_value(reaching) > THRESHOLDS.chance_max {
            break;
        }
    }
    reaching
}

/// Rows over what their dependence takes: that which the noise knows, and that which the sums of whole pieces show beyond it.
fn estimate_effective_rows(
    comparison: &Comparison<'_>,
    inflation: f64,
    pieces: &[Vec<usize>],
    innovations: &Array1<f64>,
) -> f64 {
    let sums: f64 = pieces.iter().map(|piece| piece.iter().map(|at| innovations[*at]).sum::<f64>().powi(2)).sum();
    let squares = innovations.dot(innovations).max(f64::MIN_POSITIVE);
    count_to_f64(comparison.rows.len()) / (inflation * (sums / squares).max(1.0))
}
