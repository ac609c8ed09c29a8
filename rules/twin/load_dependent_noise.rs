//! Noise that grows with the load, as that of a meter of some class does: rows weigh by how restless their load makes
//! them, or few heavy cuts would pass for an effect that most rows say nothing of.
//!
//! Variance `a + b L^2` of what a row adds, told by the changes between neighbours under the same load: an effect that is
//! missing changes slowly there, or at edges, which are left out.

use super::diagnose::Case;
use super::fit::Fit;
use super::frame::Frame;
use super::linear::{Solution, least_squares};
use super::model::simulate;
use crate::physics::Role;
use crate::statistics::{mean, median};

/// Loads at which restlessness is told.
const BINS: usize = 10;
/// Pairs of neighbours to a bin, at least.
const PAIRS_MIN: usize = 25;
/// Share of the greatest load within which two neighbours are under the same.
const SAME_LOAD_SHARE: f64 = 0.03;
/// By how many times the most restless rows exceed the quietest before loads weigh differently.
const CLEAR: f64 = 1.5;
/// Share of how bins differ that the law must explain.
const EXPLAINED_MIN: f64 = 0.5;
/// Rows are taken to be at most this many times more restless than the middle.
const NOISE_RATIO_MAX: f64 = 12.0;
/// The same for quieter: no law is as true as a quiet meter could show.
const QUIET_MAX: f64 = 2.0;

impl Case<'_> {
    /// Lets rows count by how restless their load makes them; where passes have levels of their own each pass has told
    /// how restless it is.
    pub(super) fn even_out(&mut self, plain: &Fit) {
        if self.frame.levels.is_some() {
            return;
        }
        let Some(simulated) = simulate(&plain.parts, &mut self.scene) else { return };
        let load = self.scene.load().or_else(|| self.scene.role(Role::Load)).unwrap_or(&simulated.total);
        if let Some(quiet) = quiet_under_load(&self.frame, &self.frame.reduce(load), &plain.residual) {
            self.frame.even_by(quiet);
        }
    }
}

/// How quiet each group's load leaves it, the middle one at one; `None` where the noise does not grow with the load.
/// `load` and `residual` are one value per group, in the output's unit.
#[must_use]
fn quiet_under_load(frame: &Frame, load: &[f64], residual: &[f64]) -> Option<Vec<f64>> {
    let bins = bins(frame, load, residual)?;
    let law = VarianceLaw::of(&bins)?;
    let quiet: Vec<f64> = load.iter().map(|load| law.variance(*load).sqrt().recip()).collect();
    let middle = median(quiet.clone())?;
    Some(quiet.iter().map(|x| (x / middle).clamp(1.0 / NOISE_RATIO_MAX, QUIET_MAX)).collect())
}

/// Neighbours under about the same load.
struct Bin {
    load: f64,
    variance: f64,
}

fn bins(frame: &Frame, load: &[f64], residual: &[f64]) -> Option<Vec<Bin>> {
    let top = load.iter().fold(0.0_f64, |top, x| top.max(x.abs()));
    let same = |group: &usize| (load[*group] - load[group - 1]).abs() <= SAME_LOAD_SHARE * top;
    let groups = frame.stretches.iter().flat_map(|stretch| stretch.start + 1..stretch.end).filter(same);
    let mut pairs: Vec<(f64, f64)> =
        groups.map(|group| (load[group].abs(), (residual[group] - residual[group - 1]).abs())).collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let size = (pairs.len() / BINS).max(PAIRS_MIN);
    let bin = |pairs: &[(f64, f64)]| {
        let load = mean(&pairs.iter().map(|(load, _)| *load).collect::<Vec<_>>());
        let change = median(pairs.iter().map(|(_, change)| *change).collect())?;
        // Where most neighbours are equal the steps of the meter say nothing of its noise.
        (change > 0.0).then_some(Bin { load, variance: change * change })
    };
    pairs.chunks(size).filter(|pairs| pairs.len() >= PAIRS_MIN).map(bin).collect()
}

/// Variance over load.
struct VarianceLaw {
    constant: f64,
    slope: f64,
}

impl VarianceLaw {
    fn variance(&self, load: f64) -> f64 {
        self.constant + self.slope * load * load
    }

    /// The law of these bins, if they follow one that rises clearly.
    fn of(bins: &[Bin]) -> Option<Self> {
        let least = bins.iter().map(|bin| bin.variance).reduce(f64::min)?;
        let mut law = Self { constant: mean(&bins.iter().map(|bin| bin.variance).collect::<Vec<_>>()), slope: 0.0 };
        for _ in 0..4 {
            // Errors are shares of the variance itself.
            let weight = |bin: &Bin| law.variance(bin.load).recip();
            let weighted = |of: &dyn Fn(&Bin) -> f64| bins.iter().map(|bin| weight(bin) * of(bin)).collect();
            let columns = [weighted(&|_| 1.0), weighted(&|bin| bin.load * bin.load)];
            let Solution { coefficients, dropped, .. } = least_squares(&columns, &weighted(&|bin| bin.variance));
            let (&[constant, slope], true) = (coefficients.as_slice(), dropped.is_empty()) else { return None };
            law = Self { constant: constant.max(0.25 * least), slope: slope.max(0.0) };
        }
        law.is_clear(bins).then_some(law)
    }

    fn is_clear(&self, bins: &[Bin]) -> bool {
        let (Some(first), Some(last)) = (bins.first(), bins.last()) else { return false };
        let rises = self.variance(last.load) > CLEAR * CLEAR * self.variance(first.load);
        let logarithms: Vec<f64> = bins.iter().map(|bin| bin.variance.ln()).collect();
        let middle = mean(&logarithms);
        let differ: f64 = logarithms.iter().map(|x| (x - middle).powi(2)).sum();
        let left: f64 = bins.iter().map(|bin| (bin.variance / self.variance(bin.load)).ln().powi(2)).sum();
        rises && left < (1.0 - EXPLAINED_MIN) * differ
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::count;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const ROWS: usize = 3000;

    /// A load that is cut for thirty rows of every sixty, each time another, and noise of a share of it on top of one.
    fn noisy(share: f64) -> (Vec<f64>, Vec<f64>) {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(7);
        let load = |row: usize| if row % 60 < 30 { 0.0 } else { 100.0 * count(1 + row / 60 % 7) };
        let load: Vec<f64> = (0..ROWS).map(load).collect();
        let noise = |load: &f64| {
            let e: f64 = StandardNormal.sample(&mut rng);
            e * (1.0 + share * load)
        };
        let noise = load.iter().map(noise).collect();
        (load, noise)
    }

    #[test]
    fn noise_in_proportion_to_the_load_is_evened() {
        let (load, noise) = noisy(0.02);
        let quiet = quiet_under_load(&Frame::one_run(ROWS), &load, &noise).expect("it grows with the load");
        let idle = quiet.iter().zip(&load).find(|(_, load)| **load == 0.0).expect("idle").0;
        let heaviest = quiet.iter().zip(&load).find(|(_, load)| **load == 700.0).expect("cut").0;
        // Fifteen times as restless as idle rows, and five times as the middle.
        assert!((6.0..14.0).contains(&(idle / heaviest)), "{idle} {heaviest}");
    }

    #[test]
    fn noise_that_is_the_same_everywhere_is_left_alone() {
        let (load, noise) = noisy(0.0);
        assert_eq!(quiet_under_load(&Frame::one_run(ROWS), &load, &noise), None);
        assert_eq!(quiet_under_load(&Frame::one_run(ROWS), &vec![0.0; ROWS], &noise), None);
    }
}
