//! The rows that take part in a comparison, as groups of neighbouring rows, in stretches of unbroken noise.
//!
//! A long recording is reduced by averaging groups of neighbouring rows *after* every law has been evaluated at full
//! rate, so that edges keep their shape.

use super::levels::PassAndToolLevels;
use super::noise::{Arma, GRID, log_likelihood, whiten};
use crate::physics::Scene;
use crate::statistics::{count, mean, robust_deviation};
use std::collections::BTreeSet;
use std::ops::Range;

/// Rows that are fitted one by one; beyond, neighbours are averaged or an excerpt is fitted.
pub(super) const ROWS_MAX: usize = 14_000;

/// Rows to a group where all of them are fitted.
#[must_use]
pub fn group_size(scene: &Scene) -> usize {
    scene.rows().div_ceil(ROWS_MAX).max(1)
}

/// A stretch of rows that is held out, or not, as a whole.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unit {
    /// The run's name; with a part number where one run is cut into several units.
    pub name: String,
    /// Its rows.
    pub rows: Range<usize>,
}

/// Units of hold-out: the runs, or stretches of them where there are fewer than four.
#[must_use]
pub fn units(scene: &Scene) -> Vec<Unit> {
    units_of(scene.runs(), scene.run_names())
}

/// The same from the rows and names of the runs.
#[must_use]
pub fn units_of(runs: &[Range<usize>], names: &[String]) -> Vec<Unit> {
    let named = runs.iter().zip(names);
    if runs.len() >= 4 {
        return named.map(|(rows, name)| Unit { name: name.clone(), rows: rows.clone() }).collect();
    }
    let per_run = (24 / runs.len().max(1)).max(1);
    named.flat_map(|(rows, name)| cut(rows, name, per_run)).collect()
}

fn cut(rows: &Range<usize>, name: &str, wanted: usize) -> Vec<Unit> {
    let parts = wanted.min(rows.len() / 10).max(1);
    let edge = |index: usize| rows.start + rows.len() * index / parts;
    (0..parts)
        .map(|index| Unit { name: format!("{name}[{}/{parts}]", index + 1), rows: edge(index)..edge(index + 1) })
        .collect()
}

/// One unit in so many is held out.
pub const FOLDS: usize = 4;

/// Every fourth unit is held out, of the first four the one of this index; none of fewer than four.
#[must_use]
pub fn held_out(units: &[Unit], fold: usize) -> BTreeSet<usize> {
    if units.len() < FOLDS {
        return BTreeSet::new();
    }
    (0..units.len()).filter(|index| index % FOLDS == fold).collect()
}

/// Groups of rows that take part.
#[derive(Debug, Clone, Default)]
pub struct Frame {
    groups: Vec<Range<usize>>,
    /// Unbroken stretches of groups, within a unit.
    pub stretches: Vec<Range<usize>>,
    /// The unit of each group.
    pub unit: Vec<usize>,
    /// Weight of each group's innovation; empty while all weigh the same.
    weights: Vec<f64>,
    /// How quiet its pass or its load leaves each group: inverse of its noise, with a geometric mean of one; empty while
    /// all are taken to be alike.
    quiet: Vec<f64>,
    /// Levels of their own that passes and tools have, where they have been found.
    pub levels: Option<PassAndToolLevels>,
}

/// Innovations beyond this many robust standard deviations lose weight.
const HEAVY_DEVIATIONS: f64 = 6.0;
/// Share of the rows up to which outlandish ones are few.
const FEW_SHARE: f64 = 0.005;
/// By how much another noise must be likelier between outliers than the likeliest over all rows.
const CLEARLY_LIKELIER: f64 = 20.0;

/// An innovation beyond what so wide a spread makes ordinary; none where there is no spread.
fn is_outlandish(innovation: f64, spread: f64) -> bool {
    spread > 0.0 && innovation.abs() > HEAVY_DEVIATIONS * spread
}

/// Loss of a deviation: whatever is outlandish loses the same, however far out it is (Hampel's skipped mean).
fn bounded(deviation: f64) -> f64 {
    0.5 * deviation.abs().min(HEAVY_DEVIATIONS).powi(2)
}

impl Frame {
    /// Innovations of a column within unbroken stretches, weighted.
    #[must_use]
    pub fn whiten(&self, column: &[f64], noise: Arma) -> Vec<f64> {
        let mut white = self.unweighted(column, noise);
        white.iter_mut().zip(&self.weights).for_each(|(e, weight)| *e *= weight);
        white
    }

    fn unweighted(&self, column: &[f64], noise: Arma) -> Vec<f64> {
        let mut white = self.evened(column, noise);
        if let Some(levels) = &self.levels {
            levels.whiten(self, &mut white, noise);
        }
        white
    }

    /// Divides innovations from now on by how restless each group is, given how quiet each is in relation to the others.
    pub fn even_by(&mut self, mut quiet: Vec<f64>) {
        let typical = (quiet.iter().map(|x| x.ln()).sum::<f64>() / count(quiet.len())).exp();
        quiet.iter_mut().for_each(|x| *x /= typical);
        self.quiet = quiet;
    }

    /// Innovations of a column divided by how restless its pass or its load is.
    #[must_use]
    pub fn evened(&self, column: &[f64], noise: Arma) -> Vec<f64> {
        let mut white = whiten(column, &self.stretches, noise);
        white.iter_mut().zip(&self.quiet).for_each(|(e, quiet)| *e *= quiet);
        white
    }

    /// What the innovation of this group is multiplied by.
    #[must_use]
    pub fn weight(&self, group: usize) -> f64 {
        let of = |weights: &[f64]| weights.get(group).copied().unwrap_or(1.0);
        of(&self.weights) * of(&self.quiet)
    }

    /// Logarithm of the likelihood, up to a constant, of innovations of this noise with this sum of squares.
    #[must_use]
    pub fn log_likelihood(&self, rss: f64, noise: Arma) -> f64 {
        let levels = self.levels.as_ref().map_or(0.0, |levels| levels.log_determinant(self, noise));
        log_likelihood(rss, self.len(), self.stretches.len(), noise) + levels
    }

    /// The same groups with the noise starting anew at both ends of each of these ranges of rows.
    #[must_use]
    pub fn broken_at(&self, ranges: &[Range<usize>]) -> Self {
        let edges: BTreeSet<usize> = ranges.iter().flat_map(|rows| [rows.start, rows.end]).collect();
        let mut stretches: Vec<Range<usize>> = Vec::new();
        for stretch in &self.stretches {
            let mut start = stretch.start;
            for group in stretch.start + 1..stretch.end {
                let reached = self.groups[group - 1].start + 1..=self.groups[group].start;
                if edges.range(reached).next().is_some() {
                    stretches.push(start..group);
                    start = group;
                }
            }
            stretches.push(start..stretch.end);
        }
        Self { stretches, ..self.clone() }
    }

    /// Gives every group the weight that Huber's rule gives its innovation: one within six robust standard deviations,
    /// falling beyond, so that a single row can say only so much for or against anything.
    pub fn weigh(&mut self, residual: &[f64], noise: Arma) {
        let (innovations, spread) = self.spread_of(residual, noise);
        let limit = HEAVY_DEVIATIONS * spread;
        let weight = |e: &f64| if is_outlandish(*e, spread) { limit / e.abs() } else { 1.0 };
        self.weights = innovations.iter().map(weight).collect();
    }

    /// How many groups would weigh less by this residual in this noise.
    #[must_use]
    pub(super) fn outlandish_in(&self, residual: &[f64], noise: Arma) -> usize {
        let (innovations, spread) = self.spread_of(residual, noise);
        innovations.iter().filter(|e| is_outlandish(**e, spread)).count()
    }

    /// Unweighted innovations and their robust standard deviation.
    fn spread_of(&self, residual: &[f64], noise: Arma) -> (Vec<f64>, f64) {
        let innovations = self.unweighted(residual, noise);
        let spread = robust_deviation(innovations.iter().copied()).unwrap_or(0.0);
        (innovations, spread)
    }

    /// The noise of what lies between outlandish rows: a few of them, each alone, make noise with a memory look white.
    /// The start stays unless another of the grid is clearly likelier where no row can lose much; and where outlandish
    /// rows are more than a few, which tells of an effect at edges rather than of spikes.
    #[must_use]
    pub(super) fn noise_between_outliers(&self, residual: &[f64], start: Arma) -> Arma {
        // Likelihood, and whether outlandish rows are few.
        let judged = |noise: Arma| {
            let (innovations, spread) = self.spread_of(residual, noise);
            let spread = spread.max(f64::MIN_POSITIVE);
            let outlandish = innovations.iter().filter(|e| is_outlandish(**e, spread)).count();
            let loss: f64 = innovations.iter().map(|e| bounded(e / spread)).sum();
            let (rows, stretches) = (count(innovations.len()), count(self.stretches.len()));
            let likelihood = stretches * noise.first_weight().ln() - loss - rows * spread.ln();
            (likelihood, count(outlandish) <= FEW_SHARE * rows)
        };
        let scored = GRID.iter().map(|noise| (judged(*noise), *noise));
        let best = scored.max_by(|((a, _), _), ((b, _), _)| a.total_cmp(b));
        let clearly = |likelihood: f64| likelihood > judged(start).0 + CLEARLY_LIKELIER;
        best.filter(|((likelihood, few), _)| *few && clearly(*likelihood)).map_or(start, |(_, noise)| noise)
    }

    /// Gives every group its full weight again.
    pub fn weigh_all_alike(&mut self) {
        self.weights.clear();
    }

    /// The same for plain least squares: every group counts as much as any other, and nothing has a level of its own.
    #[must_use]
    pub fn with_all_rows_alike(&self) -> Self {
        Self { weights: Vec::new(), quiet: Vec::new(), levels: None, ..self.clone() }
    }

    /// How many groups weigh less than the rest because their innovation is outlandish.
    #[must_use]
    pub fn heavy(&self) -> usize {
        self.weights.iter().filter(|weight| **weight < 1.0).count()
    }

    /// The usable rows of the units that `takes` accepts, in groups of `size`.
    #[must_use]
    pub fn new(scene: &Scene, units: &[Unit], size: usize, takes: impl Fn(usize) -> bool) -> Self {
        let mut frame = Self::default();
        for (index, unit) in units.iter().enumerate().filter(|(index, _)| takes(*index)) {
            for stretch in unbroken(scene, unit.rows.clone()) {
                frame.add_stretch(index, stretch, size);
            }
        }
        frame
    }

    fn add_stretch(&mut self, unit: usize, rows: Range<usize>, size: usize) {
        let first = self.groups.len();
        let mut start = rows.start;
        while start < rows.end {
            let end = (start + size).min(rows.end);
            self.groups.push(start..end);
            self.unit.push(unit);
            start = end;
        }
        self.stretches.push(first..self.groups.len());
    }

    /// The groups of the units that `takes` accepts, as they weigh here; levels of their own are left out.
    #[must_use]
    pub(super) fn only(&self, takes: impl Fn(usize) -> bool) -> Self {
        let mut some = Self::default();
        for stretch in self.stretches.iter().filter(|stretch| takes(self.unit[stretch.start])) {
            let first = some.groups.len();
            some.groups.extend(self.groups[stretch.clone()].iter().cloned());
            some.unit.extend(&self.unit[stretch.clone()]);
            some.weights.extend(self.weights.get(stretch.clone()).unwrap_or_default());
            some.quiet.extend(self.quiet.get(stretch.clone()).unwrap_or_default());
            some.stretches.push(first..some.groups.len());
        }
        some
    }

    /// What the innovation of this group is multiplied by because it is outlandish.
    #[must_use]
    pub(super) fn outlier_weight(&self, group: usize) -> f64 {
        self.weights.get(group).copied().unwrap_or(1.0)
    }

    /// How many groups.
    #[must_use]
    pub fn len(&self) -> usize {
        self.groups.len()
    }

    /// No group at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    /// The rows of a group.
    #[must_use]
    pub fn rows(&self, group: usize) -> Range<usize> {
        self.groups[group].clone()
    }

    /// The mean of a full-rate column over each group.
    #[must_use]
    pub fn reduce(&self, column: &[f64]) -> Vec<f64> {
        self.groups.iter().map(|rows| mean(&column[rows.clone()])).collect()
    }

    /// The other way: each group's value in all of its rows, zero in rows that take no part.
    #[must_use]
    pub fn spread(&self, values: &[f64], rows: usize) -> Vec<f64> {
        let mut column = vec![0.0; rows];
        self.groups.iter().zip(values).for_each(|(group, value)| column[group.clone()].fill(*value));
        column
    }
}

/// Stretches of usable rows without a gap longer than three periods.
fn unbroken(scene: &Scene, rows: Range<usize>) -> Vec<Range<usize>> {
    let mut stretches: Vec<Range<usize>> = Vec::new();
    let longest_s = 3.0 * scene.period_s();
    for row in rows.filter(|row| scene.usable()[*row]) {
        match stretches.last_mut() {
            Some(last) if last.end == row && scene.time_s()[row] - scene.time_s()[row - 1] <= longest_s => {
                last.end = row + 1
            }
            _ => stretches.push(row..row + 1),
        }
    }
    stretches
}

#[cfg(test)]
impl Frame {
    /// One run of so many rows a second apart, for tests of what is done to a residual.
    pub(super) fn one_run(rows: usize) -> Self {
        use adapters::recording::{Cells, Numbers};
        let mut recording = adapters::Recording::new("test", (0..rows).map(count).collect(), None);
        recording.set_column("spindle_power_w", Cells::Numbers(Numbers::full(vec![1.0; rows])));
        let scene = Scene::new(&recording, "spindle_power_w", &Default::default()).expect("a scene");
        Self::new(&scene, &units(&scene), 1, |_| true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const ROWS: usize = 3000;

    /// Noise with a memory, and a spike of many deviations every so many rows.
    fn residual(every: usize) -> Vec<f64> {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(4);
        let mut slow = 0.0;
        let mut row_of = |row: usize| {
            let e: f64 = StandardNormal.sample(&mut rng);
            slow = 0.85 * slow + e;
            slow + if row % every == every / 2 { 600.0 } else { 0.0 }
        };
        (0..ROWS).map(&mut row_of).collect()
    }

    #[test]
    fn a_few_spikes_do_not_make_noise_with_a_memory_look_white() {
        let frame = Frame::one_run(ROWS);
        let spiked = residual(1000);
        let over_all = super::super::noise::fit(&spiked, &frame.stretches);
        assert!(over_all.phi < 0.5, "{over_all:?}");
        let between = frame.noise_between_outliers(&spiked, over_all);
        assert!((0.7..0.95).contains(&between.phi), "{between:?}");
        let at_every_edge = residual(60);
        assert_eq!(frame.noise_between_outliers(&at_every_edge, over_all), over_all, "an effect at edges");
    }
}
