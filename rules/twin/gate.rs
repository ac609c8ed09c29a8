//! The gate: could noise alone have produced the best of all hypotheses?
//!
//! Innovations of the best hypothesis, their signs flipped in blocks, are searched with every hypothesis as the
//! recording was; the share of replicates whose best is as good is the p-value of the whole search (Westfall-Young).

use super::designs::Design;
use super::fit::Fit;
use super::frame::Frame;
use super::linear::{dot, project_out};
use super::noise::{Arma, count};
use super::scan::{Stage, lawful_gain, price};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Replicates of the search.
const REPLICATES: usize = 99;
/// Rows whose signs flip together.
const BLOCK_ROWS: usize = 40;

/// The p-value of the best of `designs` on top of `base`, given the innovations of the best hypothesis and its noise.
#[must_use]
pub fn p_value(
    base: &Fit,
    frame: &Frame,
    designs: &[Design],
    innovations: &[f64],
    noise: Arma,
    ln_rows: f64,
    seed: u64,
) -> f64 {
    let stage = Stage::new(base, frame, noise);
    let prepared: Vec<(Vec<(usize, Vec<f64>)>, &Design)> =
        designs.iter().map(|design| (stage.outside(frame, design), design)).collect();
    let observed = best(&prepared, &stage.residual, ln_rows);
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut exceeded = 0;
    for _ in 0..REPLICATES {
        let mut replicate = flipped(innovations, frame, &mut rng);
        project_out(&stage.basis, &mut replicate);
        if best(&prepared, &replicate, ln_rows) >= observed {
            exceeded += 1;
        }
    }
    count(1 + exceeded) / count(1 + REPLICATES)
}

fn best(prepared: &[(Vec<(usize, Vec<f64>)>, &Design)], target: &[f64], ln_rows: f64) -> f64 {
    let rss = dot(target, target);
    let rows = count(target.len());
    let score = |(columns, design): &(Vec<(usize, Vec<f64>)>, &Design)| {
        let left = (rss - lawful_gain(columns, &design.ranges, target)).max(f64::MIN_POSITIVE);
        rows * (rss / left).ln() - price(design, ln_rows)
    };
    prepared.iter().map(score).fold(f64::NEG_INFINITY, f64::max)
}

/// Innovations with signs flipped block by block within stretches.
fn flipped(innovations: &[f64], frame: &Frame, rng: &mut Pcg64Mcg) -> Vec<f64> {
    let mut out = innovations.to_vec();
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
