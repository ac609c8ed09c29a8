//! The gate: could noise alone have produced the best of all hypotheses?
//!
//! Innovations of the best hypothesis, their signs flipped in blocks, are searched with every hypothesis as the
//! recording was; the share of replicates whose best is as good is the p-value of the whole search (Westfall-Young).

use super::fit::Fit;
use super::frame::Frame;
use super::linear::{dot, project_out};
use super::scan::{HypothesisBank, WhitenedFit, price};
use crate::statistics::count;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Replicates of the search: the least p-value that they can give is 1/100, half of what a finding may have
/// ([`super::search::P_MAX`]). With fewer than 49 nothing could ever be found.
const REPLICATES: usize = 99;
/// Replicates that may be as good before the answer is settled: 5 of at most 99 are a p-value of 0.05 or more, which no
/// finding may have.
const EXCEEDED_ENOUGH: usize = 5;
/// Rows whose signs flip together.
const BLOCK_ROWS: usize = 40;

/// What a scan, which moves no shape, may miss of a hypothesis on noise: so much less counts what a full fit gained.
const REFINED: f64 = 10.0;

/// The p-value of the best hypothesis of the bank on top of `base`, resampling the innovations of `best`; with
/// `runs_too` the greater of two, the other from whole runs that flip. What is tested may have gained more in full than
/// the scan shows, where it moves a time constant or frees a bent baseline: `tested` is its fit with its price.
#[must_use]
pub fn p_value(
    bank: &HypothesisBank<'_>,
    base: &Fit,
    best: &Fit,
    tested: Option<(&Fit, f64)>,
    ln_rows: f64,
    seed: u64,
    runs_too: bool,
) -> f64 {
    let stage = bank.through(base, best.noise);
    let innovations = best.innovations(bank.frame());
    let in_full = |(fit, price): (&Fit, f64)| {
        let left = fit.left_in(bank.frame(), best.noise).max(f64::MIN_POSITIVE);
        count(bank.frame().len()) * (stage.rss / left).ln() - price - REFINED
    };
    let scanned = best_score(bank, &stage, &stage.residual, ln_rows);
    let observed = tested.map_or(scanned, |tested| scanned.max(in_full(tested)));
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut share_as_good = |blocks: Blocks| {
        let mut exceeded = 0;
        for done in 1..=REPLICATES {
            let mut replicate = flipped(&innovations, bank.frame(), blocks, &mut rng);
            project_out(&stage.basis, &mut replicate);
            if best_score(bank, &stage, &replicate, ln_rows) >= observed {
                exceeded += 1;
                if exceeded == EXCEEDED_ENOUGH {
                    return count(exceeded) / count(done);
                }
            }
        }
        count(1 + exceeded) / count(1 + REPLICATES)
    };
    let by_run = if runs_too { share_as_good(Blocks::Units) } else { 0.0 };
    if by_run > super::search::P_MAX { by_run } else { by_run.max(share_as_good(Blocks::Rows)) }
}

/// What flips together: noise that remembers longer than the noise model knows shows only when whole runs flip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Blocks {
    /// Rows within a stretch.
    Rows,
    /// Whole units of hold-out.
    Units,
}

fn best_score(bank: &HypothesisBank<'_>, stage: &WhitenedFit<'_>, target: &[f64], ln_rows: f64) -> f64 {
    let rss = dot(target, target);
    let rows = count(target.len());
    let score = |index: usize| {
        let left = (rss - bank.explained(stage, index, target)).max(f64::MIN_POSITIVE);
        rows * (rss / left).ln() - price(&bank.designs[index], ln_rows)
    };
    (0..bank.designs.len()).map(score).fold(f64::NEG_INFINITY, f64::max)
}

/// Innovations with signs flipped block by block within stretches.
fn flipped(innovations: &[f64], frame: &Frame, blocks: Blocks, rng: &mut Pcg64Mcg) -> Vec<f64> {
    let mut out = innovations.to_vec();
    if blocks == Blocks::Units {
        let units = frame.unit.last().map_or(0, |last| last + 1);
        let signs: Vec<f64> = (0..units).map(|_| if rng.random::<bool>() { 1.0 } else { -1.0 }).collect();
        out.iter_mut().zip(&frame.unit).for_each(|(x, unit)| *x *= signs[*unit]);
        return out;
    }
    for rows in &frame.stretches {
        // A random first length moves the edges of the blocks from replicate to replicate.
        let mut left = rng.random_range(1..=BLOCK_ROWS);
        let mut sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
        for row in rows.clone() {
            if left == 0 {
                left = BLOCK_ROWS;
                sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
            }
            out[row] *= sign;
            left -= 1;
        }
    }
    out
}
