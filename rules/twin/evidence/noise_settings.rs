//! Which settings of the noise are likely: those that the empty or the saturated model makes likely are summed out.

use super::gram::{Comparison, Gram};
use super::inputs::RecordingInputs;
use super::marginal::Saturated;
use super::noise::NoiseModel;
use numerics::statistics::count_to_f64;

/// Nameless curves that stand for everything that may be there.
const CURVES_MAX: usize = 16;
/// Logarithm of the likelihood within which a setting counts as likely.
const WITHIN: f64 = 12.0;
/// Settings that go into the comparison from each residual.
const PRESELECTED: usize = 7;
/// Settings taken from each model.
const OF_EACH: usize = 2;

/// The likely settings of the noise.
pub(super) struct NoiseSettings {
    /// Likely settings, four at most.
    pub(super) likely: Vec<NoiseModel>,
    /// The likeliest under the empty and under the saturated model.
    pub(super) leading: Vec<NoiseModel>,
    /// The saturated model of each setting that was compared.
    known: Vec<(NoiseModel, Saturated)>,
}

impl NoiseSettings {
    /// The saturated model of a likely setting.
    pub(super) fn find_saturated_model(&self, noise: NoiseModel) -> Saturated {
        let of = self.known.iter().find(|(known, _)| *known == noise).or(self.known.first());
        of.map_or(Saturated { variance: 1.0, ln_likelihood: 0.0 }, |(_, saturated)| *saturated)
    }
}

/// Compares the settings of the grid: all of them by two residuals, the better ones in full. `wide` is what a wide smooth
/// model leaves.
pub(super) fn select_noise_settings(
    inputs: &RecordingInputs<'_>,
    comparison: &Comparison<'_>,
    wide: &[f64],
) -> NoiseSettings {
    let takes = mark_smooth_columns(comparison);
    let mut empty = Vec::new();
    let mut full = Vec::new();
    let mut known = Vec::new();
    for noise in preselect_noises(inputs, comparison, wide) {
        let gram: Gram = comparison.compute_partial_gram(noise, |column| takes[column]);
        let saturated = comparison.fit_saturated_model(&gram);
        empty.push((comparison.compute_empty_evidence(&gram, saturated), noise));
        full.push((saturated.ln_likelihood, noise));
        known.push((noise, saturated));
    }
    let mut likely: Vec<NoiseModel> = Vec::new();
    let mut leading: Vec<NoiseModel> = Vec::new();
    for all in [&mut empty, &mut full] {
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        let best = all[0];
        if !leading.contains(&best.1) {
            leading.push(best.1);
        }
        for (ln, noise) in all.iter().take(OF_EACH) {
            if *ln > best.0 - WITHIN && !likely.contains(noise) {
                likely.push(*noise);
            }
        }
    }
    NoiseSettings { likely, leading, known }
}

/// The settings that make one of two residuals likely: that of the baseline, and that of a wide smooth model.
fn preselect_noises(inputs: &RecordingInputs<'_>, comparison: &Comparison<'_>, wide: &[f64]) -> Vec<NoiseModel> {
    let group = count_to_f64(comparison.group);
    let grid = NoiseModel::build_grid(inputs.median_block_rows() / group, inputs.period_s * group);
    let mut chosen = vec![NoiseModel::WHITE];
    let base = inputs.build_column(|row| inputs.scene.recorded_output()[row] - inputs.simulated[row]);
    for residual in [base.as_slice(), wide] {
        let mut ranked: Vec<(f64, NoiseModel)> =
            grid.iter().map(|noise| (comparison.compute_ln_likelihood(residual, *noise), *noise)).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (_, noise) in ranked.into_iter().take(PRESELECTED) {
            if !chosen.contains(&noise) {
                chosen.push(noise);
            }
        }
    }
    chosen
}

/// Columns of the first smooth curves, by themselves and in the cut.
fn mark_smooth_columns(comparison: &Comparison<'_>) -> Vec<bool> {
    let mut takes = vec![false; comparison.bank.columns.len()];
    let curves = comparison.bank.variants.iter().filter(|variant| {
        variant.nameless_curve().is_some_and(|drawn| drawn.shape == "bumps" && ["1", "cut"].contains(&drawn.times))
    });
    for variant in curves.take(CURVES_MAX) {
        takes[variant.columns.clone()].fill(true);
    }
    takes
}
