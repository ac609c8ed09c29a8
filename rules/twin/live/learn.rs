//! What is usual: learned once from a healthy stretch, per regime, and then held fast.
//!
//! Every kind of work (program, tool, operation) keeps its own usual deviation from the simulation, because a model
//! fits one cut better than another; the noise around it is shared within the regime.

use super::control_chart::{Healthy, Point};
use super::noise::{self, Arma, PHI_MAX};
use numerics::statistics::{count_to_f64, robust_deviation};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Blocks of a kind of work from which its usual deviation is known.
pub const WORK_BLOCKS: usize = 4;
/// The band is this many times the greatest deviation that was seen while learning,
const BAND_FACTOR: f64 = 1.3;
/// and wider by this over the number of independent levels that were seen: few of them do not show the range.
const BAND_FEW: f64 = 5.0;
/// So many blocks of the spread that all work shares are mixed into that of one kind of work.
const SHARED_BLOCKS: f64 = 8.0;
/// Blocks over which deviations are averaged for the band.
const BAND_BLOCKS: usize = 10;
/// The band is at least this share of the mean output of the regime.
const BAND_SHARE: f64 = 0.02;

/// One block while learning.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WorkBlock {
    /// When it began and ended, s.
    pub from_s: f64,
    /// When it ended, on the same clock, s.
    pub to_s: f64,
    /// Recorded minus simulated over the block, in the unit of the output.
    pub residual: f64,
    /// Simulated output over the block.
    pub expected: f64,
    /// Which kind of work.
    pub work: usize,
}

/// What was learned of a regime.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Learned {
    /// The noise and what counts as a change.
    pub healthy: Healthy,
    /// What is usual for each kind of work.
    pub usual: BTreeMap<usize, Usual>,
    /// Standard deviation that the work of the regime shares.
    pub shared: f64,
    /// Mean residual of the regime, in the unit of the output.
    pub bias: f64,
    /// Mean simulated output of the regime.
    pub expected: f64,
    /// From how many blocks.
    pub blocks: usize,
}

/// What is usual for a kind of work.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Usual {
    /// Mean residual of its blocks, in the unit of the output.
    pub mean: f64,
    /// Standard deviation of its blocks.
    pub sd: f64,
}

/// Learns from blocks in the order of time. `None` when no kind of work has enough of them.
#[must_use]
pub fn learn_regime(blocks: &[WorkBlock]) -> Option<Learned> {
    let (usual, shared) = compute_usual_levels(blocks);
    let known: Vec<&WorkBlock> = blocks.iter().filter(|block| usual.contains_key(&block.work)).collect();
    if known.len() < 2 * BAND_BLOCKS {
        return None;
    }
    let n = count_to_f64(known.len());
    let expected = known.iter().map(|block| block.expected).sum::<f64>() / n;
    let bias = known.iter().map(|block| block.residual).sum::<f64>() / n;
    let nothing = Healthy { phi: 0.0, theta: 0.0, sd: 0.0, mean_variance: 0.0, band: 0.0 };
    let mut learned = Learned { healthy: nothing, usual, shared, bias, expected, blocks: known.len() };
    let deviations: Vec<f64> =
        known.iter().filter_map(|block| learned.standardise_block(block)).map(|point| point.deviation).collect();
    learned.healthy = fit_healthy_model(&deviations, expected, count_to_f64(learned.usual.len()));
    Some(learned)
}

/// What is usual for each kind of work that was seen often enough, and the standard deviation within all of it.
fn compute_usual_levels(blocks: &[WorkBlock]) -> (BTreeMap<usize, Usual>, f64) {
    let mut works: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    blocks.iter().for_each(|block| works.entry(block.work).or_default().push(block.residual));
    works.retain(|_, residuals| residuals.len() >= WORK_BLOCKS);
    let mean = |residuals: &[f64]| residuals.iter().sum::<f64>() / count_to_f64(residuals.len());
    let squares = |residuals: &[f64]| {
        let mean = mean(residuals);
        residuals.iter().map(|residual| (residual - mean).powi(2)).sum::<f64>()
    };
    let all: usize = works.values().map(Vec::len).sum();
    let within: f64 = works.values().map(|residuals| squares(residuals)).sum();
    let shared = within / count_to_f64(all.saturating_sub(works.len()).max(1));
    // Few blocks say little of their spread: it is drawn towards what all work shares.
    let sd = |residuals: &[f64]| {
        ((squares(residuals) + SHARED_BLOCKS * shared) / (count_to_f64(residuals.len()) + SHARED_BLOCKS)).sqrt()
    };
    let usual = works.iter().map(|(work, residuals)| (*work, Usual { mean: mean(residuals), sd: sd(residuals) }));
    (usual.collect(), shared.sqrt())
}

fn fit_healthy_model(deviations: &[f64], expected: f64, works: f64) -> Healthy {
    let n = count_to_f64(deviations.len());
    let all = std::iter::once(0..deviations.len()).collect::<Vec<_>>();
    let noise = correct_memory_bias(noise::fit_arma(deviations, &all), n);
    let innovations = noise::whiten_column(deviations, &all, noise);
    let rms = (innovations.iter().map(|e| e * e).sum::<f64>() / (n - works).max(1.0)).sqrt();
    let robust = robust_deviation(innovations.iter().copied()).unwrap_or(0.0);
    let level = deviations.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    // Never nothing: a series that is constant to the last digit has the resolution of its meter.
    let floor = (1e-6 * expected.abs()).max(1e-9 * level).max(f64::MIN_POSITIVE);
    let sd = rms.max(robust).max(floor) * (1.0 + 2.0 / (2.0 * n).sqrt());
    let gain = (1.0 + noise.theta) / (1.0 - noise.phi);
    Healthy {
        phi: noise.phi,
        theta: noise.theta,
        sd,
        mean_variance: (sd * gain).powi(2) * works.max(1.0) / n,
        band: compute_band(deviations, expected, n / noise.variance_inflation()),
    }
}

/// Memory as long as the data allow: short stretches make it look shorter than it is, and a memory that is believed
/// too short turns every slow excursion into a change.
fn correct_memory_bias(noise: Arma, n: f64) -> Arma {
    let Arma { phi, theta } = noise;
    let bias = (1.0 + 3.0 * phi.max(0.0)) / n;
    let error = ((1.0 - phi * phi).max(0.0) / n).sqrt();
    Arma { phi: (phi + bias + error).min(PHI_MAX), theta }
}

fn compute_band(deviations: &[f64], expected: f64, independent: f64) -> f64 {
    let mean = |part: &[f64]| part.iter().sum::<f64>() / count_to_f64(part.len());
    let greatest = deviations.windows(BAND_BLOCKS).map(|part| mean(part).abs()).fold(0.0, f64::max);
    let factor = BAND_FACTOR * (1.0 + BAND_FEW / independent.max(BAND_FEW));
    (factor * greatest).max(BAND_SHARE * expected.abs())
}

impl Learned {
    /// A block against what is usual for its work; `None` for work that is new.
    #[must_use]
    pub fn standardise_block(&self, block: &WorkBlock) -> Option<Point> {
        let usual = self.usual.get(&block.work)?;
        let difference = block.residual - usual.mean;
        let scale = if usual.sd > 0.0 { self.shared / usual.sd } else { 1.0 };
        let WorkBlock { from_s, to_s, expected, .. } = *block;
        Some(Point { from_s, to_s, deviation: difference * scale, difference, expected })
    }
}
