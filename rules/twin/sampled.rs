//! Edges between samples: what is late by less than the time from row to row is late by a whole row at some edges and on
//! time at the others, as each lies between the samples. No share of every edge tells that, which is what a delay comes to
//! in the mean; and the rows of the late ones look like spikes.
//!
//! Which edges are late is a hidden state with the delay as its chance: one of 0.3 rows makes three of ten edges late. The
//! delay, which may grow at a constant rate as a clock does that runs fast, is the one that makes all choices together
//! likeliest (the forward sum); each edge is then late or not as the likeliest sequence has it (Viterbi), and what that
//! choice explains beyond the sum is its price. Where the output ramps over several rows a delay is what it is in the mean.

use super::frame::Frame;
use super::noise::Arma;
use super::path_state::{Cheapest, Mixture};
use crate::statistics::count;
use std::ops::{Range, RangeInclusive};

/// Whole rows by which something may be early (negative) or late.
pub(super) const ROWS: RangeInclusive<i32> = -3..=4;
/// Delays that are tried per row, and by how many rows a clock may come to go wrong over the whole recording.
const PER_ROW: usize = 8;
const DRIFTS_ROWS: [f64; 4] = [-1.0, -0.5, 0.5, 1.0];
/// Refinements of delay and drift, by half each.
const ROUNDS: i32 = 5;
/// How many times the change before and after it an edge must be: what changes in a row as in the next is a ramp.
const EDGE: f64 = 3.0;
/// Least and greatest chance that an edge is late by the greater of two whole rows.
const CHANCE: (f64, f64) = (0.02, 0.98);
/// Square of an innovation, in variances, beyond which a row says no more.
pub(super) const SURPRISE_MAX: f64 = 36.0;
/// Edges that must be seen, and by how many deviations one must stand out of the noise to be.
const EDGES_MIN: usize = 8;
const SEEN: f64 = 4.0;
/// From so many deviations an edge tells whether it lies between on time and a whole row late.
const CLEAR: f64 = 9.0;
/// Share of the edge by which it must be away from either to lie between.
const APART: f64 = 0.15;
/// Share of such edges that may lie between: more do where a meter averages, or where the cut builds up.
const BETWEEN_MAX: f64 = 0.15;
/// Edges that must be late, and on time: a delay by a whole number of rows is no matter of where an edge lies.
const MIXED_MIN: f64 = 4.0;
/// Information that a clock's drift must bring beyond a delay that stays.
const DRIFT_INFORMATION: f64 = 12.0;

/// How late something is: in rows in the middle of the recording, and how much more at its end than at its beginning.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Lateness {
    rows: f64,
    drift_rows: f64,
}

/// A law at every whole delay, and the residual it may explain.
pub(super) struct Edges<'a> {
    residual: &'a [f64],
    frame: &'a Frame,
    noise: Arma,
    /// Standard deviation of an innovation.
    deviation: f64,
    /// What the law adds at each of [`ROWS`], per row.
    shifted: Vec<Vec<f64>>,
    /// Is the row at an edge between this whole delay and the next?
    at_edge: Vec<Vec<bool>>,
}

/// Which edges are how late.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sampled {
    /// How late in the mean, in rows.
    pub(super) rows: f64,
    /// Its standard error.
    pub(super) rows_error: f64,
    /// How late each row is, in rows.
    pub(super) late_rows: Vec<f64>,
    /// Price of having chosen the delay and which edges are late, in units of information.
    pub(super) price: f64,
}

/// The two looks of a row, how late each has it, and the chance of each.
#[derive(Clone, Copy)]
struct Looks {
    x: [f64; 2],
    late_rows: [f64; 2],
    chance: [f64; 2],
}

/// From a look of the row before to a look of this one.
struct LookTransition {
    from: usize,
    to: usize,
    /// The innovation of the path so far.
    e: f64,
    /// Square of the innovation, in variances.
    surprise: f64,
}

impl<'a> Edges<'a> {
    /// `noise` is that of the residual with the standard deviation of its innovations; `shifted` is what the law adds at
    /// each of [`ROWS`].
    pub(super) fn new(
        residual: &'a [f64],
        frame: &'a Frame,
        (noise, deviation): (Arma, f64),
        shifted: Vec<Vec<f64>>,
    ) -> Self {
        let at_edge = shifted.windows(2).map(|pair| edges(&pair[0], &pair[1])).collect();
        Self { residual, frame, noise, deviation, shifted, at_edge }
    }

    /// The likeliest delay and which edges are late; `None` where too few tell, or where many are neither on time nor a
    /// whole row late.
    pub(super) fn find(&self) -> Option<Sampled> {
        let (likelihood, lateness) = self.likeliest_lateness();
        let seen = self.seen(lateness);
        let chance = lateness.rows.rem_euclid(1.0);
        let mixed = lateness.drift_rows != 0.0 || chance.min(1.0 - chance) * count(seen) >= MIXED_MIN;
        if seen < EDGES_MIN || !mixed || self.between(lateness) > BETWEEN_MAX {
            return None;
        }
        let (late_rows, along) = self.likeliest_sequence(lateness);
        let parameters = if lateness.drift_rows == 0.0 { 1.0 } else { 2.0 };
        Some(Sampled {
            rows: lateness.rows,
            rows_error: (chance * (1.0 - chance) / count(seen)).sqrt().max(1.0 / count(seen)),
            late_rows,
            price: 2.0 * (along - likelihood).max(0.0) + parameters * count(self.residual.len()).ln(),
        })
    }

    fn likeliest_lateness(&self) -> (f64, Lateness) {
        let steady = self.refined(self.likeliest(grid(1, &[0.0])), &[(1.0, 0.0)]);
        let moving = self.refined(self.likeliest(grid(2, &DRIFTS_ROWS)), &[(1.0, 0.0), (0.0, 2.0)]);
        if 2.0 * (moving.0 - steady.0) > DRIFT_INFORMATION { moving } else { steady }
    }

    fn likeliest(&self, tried: impl Iterator<Item = Lateness>) -> (f64, Lateness) {
        let none = (f64::NEG_INFINITY, Lateness { rows: 0.0, drift_rows: 0.0 });
        tried.map(|lateness| (self.likelihood(lateness), lateness)).fold(none, |a, b| if b.0 > a.0 { b } else { a })
    }

    /// A pattern search along these directions of delay and drift.
    fn refined(&self, start: (f64, Lateness), directions: &[(f64, f64)]) -> (f64, Lateness) {
        (0..ROUNDS).fold(start, |best, round| {
            let step = 0.5_f64.powi(round) / count(PER_ROW);
            let beside = directions.iter().flat_map(|(rows, drift)| {
                [-step, step].map(|step| Lateness {
                    rows: best.1.rows + step * rows,
                    drift_rows: best.1.drift_rows + step * drift,
                })
            });
            let tried = self.likeliest(beside);
            if tried.0 > best.0 { tried } else { best }
        })
    }

    fn looks(&self, lateness: Lateness, row: usize) -> Looks {
        let (first, last) = (f64::from(*ROWS.start()), f64::from(*ROWS.end()));
        let progress = count(row) / count(self.residual.len().max(2) - 1) - 0.5;
        let late = (lateness.rows + lateness.drift_rows * progress).clamp(first, last - 1e-9);
        let (whole, part) = (late.floor(), late - late.floor());
        // Not negative, and below the number of whole delays.
        let sooner = (whole - first) as usize;
        let left = |delay: usize| self.residual[row] - self.shifted[delay][row];
        let (x, later) = (left(sooner), left(sooner + 1));
        if !self.at_edge[sooner][row] {
            let mean = x + part * (later - x);
            return Looks { x: [mean, mean], late_rows: [late, late], chance: [1.0, 0.0] };
        }
        let chance = part.clamp(CHANCE.0, CHANCE.1);
        Looks { x: [x, later], late_rows: [whole, whole + 1.0], chance: [1.0 - chance, chance] }
    }

    /// The ways into the looks of a row from those of the row before with their innovations; one where there is none.
    fn ways<'b>(
        &'b self,
        looks: &'b Looks,
        row: usize,
        last: Option<(Looks, [f64; 2])>,
    ) -> impl Iterator<Item = LookTransition> + 'b {
        let noise = self.noise;
        let way = move |from: usize, to: usize| {
            let x = looks.x[to];
            let (innovation, e) = match last {
                // The stationary start carries its size into the recursion only through its value.
                None if from == 0 => (x * noise.first_weight(), 0.0),
                None => return None,
                Some((before, last_e)) => {
                    let e = noise.innovation(x, before.x[from], last_e[from]);
                    (e, e)
                }
            };
            let surprise = (innovation * self.frame.weight(row) / self.deviation).powi(2).min(SURPRISE_MAX);
            Some(LookTransition { from, to, e, surprise })
        };
        let looked = (0..2).filter(|to| looks.chance[*to] > 0.0);
        looked.flat_map(move |to| (0..2).filter_map(move |from| way(from, to)))
    }

    /// Logarithm of how likely the residual is, all choices together.
    fn likelihood(&self, lateness: Lateness) -> f64 {
        self.frame.stretches.iter().map(|stretch| self.likelihood_of(lateness, stretch.clone())).sum()
    }

    fn likelihood_of(&self, lateness: Lateness, rows: Range<usize>) -> f64 {
        let mut last: Option<(Looks, [Mixture; 2])> = None;
        let mut sum = 0.0;
        for row in rows {
            let looks = self.looks(lateness, row);
            let mut next = [Mixture::default(); 2];
            for way in self.ways(&looks, row, last.map(|(looks, lanes)| (looks, lanes.map(|lane| lane.e)))) {
                let chance = last.map_or(1.0, |(_, lanes)| lanes[way.from].chance);
                next[way.to].take(chance * looks.chance[way.to] * (-0.5 * way.surprise).exp(), way.e);
            }
            let all = next[0].chance + next[1].chance;
            next.iter_mut().for_each(|lane| lane.settle(all));
            sum += all.max(f64::MIN_POSITIVE).ln();
            last = Some((looks, next));
        }
        sum
    }

    /// How late every row is in the likeliest sequence, and the logarithm of the likelihood along it.
    fn likeliest_sequence(&self, lateness: Lateness) -> (Vec<f64>, f64) {
        let mut late_rows = vec![0.0; self.residual.len()];
        let along = |stretch: &Range<usize>| self.likeliest_of(lateness, stretch.clone(), &mut late_rows);
        let along = self.frame.stretches.iter().map(along).sum();
        (late_rows, along)
    }

    fn likeliest_of(&self, lateness: Lateness, rows: Range<usize>, late_rows: &mut [f64]) -> f64 {
        let mut last: Option<(Looks, [Cheapest; 2])> = None;
        // Where each look came from, and how surprising it was from there.
        let mut back = Vec::with_capacity(rows.len());
        for row in rows.clone() {
            let looks = self.looks(lateness, row);
            let mut next = [Cheapest::NONE; 2];
            let mut came = [(0, 0.0); 2];
            for way in self.ways(&looks, row, last.map(|(looks, lanes)| (looks, lanes.map(|lane| lane.e)))) {
                let cost = last.map_or(0.0, |(_, lanes)| lanes[way.from].cost);
                if next[way.to].take(cost + way.surprise - 2.0 * looks.chance[way.to].ln(), way.e) {
                    came[way.to] = (way.from, way.surprise);
                }
            }
            back.push((looks, came));
            last = Some((looks, next));
        }
        let mut look = last.map_or(0, |(_, lanes)| usize::from(lanes[1].cost < lanes[0].cost));
        let mut along = 0.0;
        for (row, (looks, came)) in rows.zip(back).rev() {
            late_rows[row] = looks.late_rows[look];
            along -= 0.5 * came[look].1;
            look = came[look].0;
        }
        along
    }

    /// Edges that stand out of the noise.
    fn seen(&self, lateness: Lateness) -> usize {
        let stands_out = |row: &usize| self.looks(lateness, *row).size() > SEEN * self.deviation;
        (0..self.residual.len()).filter(stands_out).count()
    }

    /// Share of the clear edges that are neither on time nor a whole row late.
    fn between(&self, lateness: Lateness) -> f64 {
        let (mut clear, mut between) = (0.0, 0.0);
        for stretch in &self.frame.stretches {
            let mut last: Option<f64> = None;
            for row in stretch.clone() {
                let looks = self.looks(lateness, row);
                let is_clear = looks.size() > CLEAR * self.deviation;
                if let Some(last) = last.filter(|_| is_clear) {
                    let off = looks.x.map(|x| (x - self.noise.phi * last).abs());
                    let far = (SEEN * self.deviation).max(APART * looks.size());
                    clear += 1.0;
                    between += if off[0].min(off[1]) > far { 1.0 } else { 0.0 };
                }
                last = Some(if is_clear { 0.0 } else { looks.x[0] });
            }
        }
        between / f64::max(clear, 1.0)
    }
}

impl Looks {
    /// By how much its two looks differ; nothing where there is no edge.
    fn size(&self) -> f64 {
        (self.x[1] - self.x[0]).abs()
    }
}

/// Every delay that is looked at, or one of so many, with each of these drifts.
fn grid(every: usize, drifts_rows: &[f64]) -> impl Iterator<Item = Lateness> {
    let (first, last) = (f64::from(*ROWS.start()), f64::from(*ROWS.end()));
    let steps = (ROWS.count() - 1) * PER_ROW;
    let at = move |step: usize| first + (last - first) * (count(step) + 0.5) / count(steps);
    let delays = (0..steps).step_by(every).map(at);
    delays.flat_map(|rows| drifts_rows.iter().map(move |drift_rows| Lateness { rows, drift_rows: *drift_rows }))
}

/// Rows at which a law at one delay and at the next differs by far more than in the rows beside.
fn edges(sooner: &[f64], later: &[f64]) -> Vec<bool> {
    let change: Vec<f64> = sooner.iter().zip(later).map(|(sooner, later)| (later - sooner).abs()).collect();
    let beside = |row: usize| {
        let before = row.checked_sub(1).map_or(0.0, |row| change[row]);
        before.max(change.get(row + 1).copied().unwrap_or(0.0))
    };
    (0..change.len()).map(|row| change[row] > EDGE * beside(row)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_distr::{Distribution, StandardNormal};

    const ROWS_TOLD: usize = 1500;

    fn frame() -> Frame {
        Frame::one_run(ROWS_TOLD)
    }

    /// The cut as the controller flags it: twenty of every thirty rows, at 30 deviations.
    fn flagged(row: i32) -> f64 {
        if row.rem_euclid(30) >= 10 { 30.0 } else { 0.0 }
    }

    fn shifted() -> Vec<Vec<f64>> {
        let late = |by: i32| (0..ROWS_TOLD as i32).map(|row| flagged(row - by) - flagged(row)).collect();
        ROWS.map(late).collect()
    }

    /// What is left of a recording in which each edge is late by a look that this draws, in white noise.
    fn residual(seed: u64, mut late: impl FnMut(&mut rand_pcg::Pcg64Mcg, i32) -> f64) -> Vec<f64> {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        let mut recorded = |row: i32| {
            let e: f64 = StandardNormal.sample(&mut rng);
            let change = flagged(row - 1) - flagged(row);
            let share = if change == 0.0 { 0.0 } else { late(&mut rng, row) };
            e + share * change
        };
        (0..ROWS_TOLD as i32).map(&mut recorded).collect()
    }

    fn found(residual: &[f64]) -> Option<Sampled> {
        Edges::new(residual, &frame(), (Arma::WHITE, 1.0), shifted()).find()
    }

    fn often(rng: &mut impl Rng, chance: f64) -> f64 {
        if rng.random_bool(chance) { 1.0 } else { 0.0 }
    }

    #[test]
    fn three_of_ten_edges_late_by_a_row_are_a_delay_of_three_tenths() {
        let mut late_at = Vec::new();
        let left = residual(4, |rng, row| {
            let late = often(rng, 0.3);
            late_at.push((row as usize, late));
            late
        });
        let found = found(&left).expect("a delay");
        assert!((found.rows - 0.3).abs() < 2.0 * found.rows_error, "{} +- {}", found.rows, found.rows_error);
        assert!(late_at.iter().all(|(row, late)| found.late_rows[*row] == *late), "each edge as it is");
        // A hundred edges at the entropy of their chance, and the delay itself.
        let entropy = -2.0 * count(late_at.len()) * (0.3 * 0.3_f64.ln() + 0.7 * 0.7_f64.ln());
        assert!((found.price - entropy - count(ROWS_TOLD).ln()).abs() < 0.2 * entropy, "{} {entropy}", found.price);
    }

    #[test]
    fn a_clock_that_drifts_is_late_more_often_at_the_end() {
        let left = residual(5, |rng, row| often(rng, 0.05 + 0.9 * f64::from(row) / ROWS_TOLD as f64));
        let (_, lateness) = Edges::new(&left, &frame(), (Arma::WHITE, 1.0), shifted()).likeliest_lateness();
        assert!((0.5..1.4).contains(&lateness.drift_rows), "{lateness:?}");
    }

    #[test]
    fn edges_on_time_and_edges_that_are_averaged_are_no_delay_between_samples() {
        assert_eq!(found(&residual(6, |_, _| 0.0)), None, "on time");
        assert_eq!(found(&residual(7, |_, _| 1.0)), None, "a whole row late, every one");
        assert_eq!(found(&residual(8, |rng, _| rng.random_range(0.0..1.0))), None, "averaged");
    }
}
