//! Has the level of a noisy series changed, and since when? A windowed generalised likelihood ratio, the form of the
//! cumulative sum that knows neither size nor time of the change beforehand (Siegmund and Venkatraman 1995).
//!
//! The series is whitened with the noise that was learned; a change of level by one shows in the innovations as
//! `1, 1 - phi - theta, ...`. For every possible onset within the window the sum of innovations against that signature
//! is kept up to date, so that a block costs one multiplication per onset. Evidence counts only for what the change is
//! *beyond the band*: what the series did while it was learned is no change.

use super::noise::Arma;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Onsets that are kept in mind: two hours of blocks.
const WINDOW: usize = 240;
/// Innovations count for no more than this many standard deviations.
const CLIP: f64 = 40.0;
/// Logarithm of the likelihood ratio that raises a change.
///
/// Blocks of half a minute are 86 400 in 30 days, of which two hours of onsets overlap; with white noise and no band at all
/// 12 would give about one false alarm in 30 days. The rest is for what is learned from few blocks.
const THRESHOLD: f64 = 14.0;
/// Onsets whose likelihood is within this of the best one make the 95 % interval: half the 95 % quantile of chi-squared
/// with one degree of freedom (3.84).
const INTERVAL: f64 = 1.92;
/// A change has lasted for at least this many blocks.
const BLOCKS_MIN: usize = 3;
/// The level of the moment is the mean of so many blocks.
const LEVEL_BLOCKS: usize = 10;
/// A level within this share of the band is where it was before.
const BACK: f64 = 0.5;
/// A block that stands this far from both its neighbours is a disturbance, not a level.
const ALONE: f64 = 4.0;

/// What was learned of the healthy series.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Healthy {
    /// Memory of the noise.
    pub phi: f64,
    /// Its moving average term.
    pub theta: f64,
    /// Standard deviation of an innovation.
    pub sd: f64,
    /// Variance of the learned mean.
    pub mean_variance: f64,
    /// Deviations up to this size are no change.
    pub band: f64,
}

impl Healthy {
    fn noise(&self) -> Arma {
        Arma { phi: self.phi, theta: self.theta }
    }
}

/// A change of level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LevelChange {
    /// Most likely time, s.
    pub at_s: f64,
    /// Begin of its 95 % interval, s.
    pub low_s: f64,
    /// End of the interval, s.
    pub high_s: f64,
    /// Mean difference since then, in the unit of the output.
    pub mean: f64,
    /// Mean simulated output since then.
    pub expected: f64,
}

/// One block of the series.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// When it began, s.
    pub from_s: f64,
    /// When it ended, s.
    pub to_s: f64,
    /// Deviation from what is usual, on the scale that all work of the regime shares.
    pub deviation: f64,
    /// The same in the unit of the output.
    pub difference: f64,
    /// Simulated output, in the unit of the output.
    pub expected: f64,
}

/// A possible onset, and the evidence for it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct CandidateOnset {
    /// The block before began here; the change may lie within it.
    low_s: f64,
    /// The first block after the change.
    from_s: f64,
    to_s: f64,
    /// Present value of the signature.
    signature: f64,
    /// Sum of innovation times signature.
    sum: f64,
    /// Sum of the signature, and of its squares.
    length: f64,
    weight: f64,
    /// Sums of differences and of simulated outputs, and how many.
    difference: f64,
    expected: f64,
    count: f64,
}

/// Watches one series of blocks.
#[derive(Debug, Clone)]
pub struct Chart {
    healthy: Healthy,
    candidates: VecDeque<CandidateOnset>,
    /// The block that waits for its successor.
    pending: Option<Point>,
    before: f64,
    last: Option<(f64, f64)>,
    last_from_s: Option<f64>,
    recent: VecDeque<f64>,
}

impl Chart {
    /// A chart that has seen nothing.
    #[must_use]
    pub fn new(healthy: Healthy) -> Self {
        Self {
            healthy,
            candidates: VecDeque::new(),
            pending: None,
            before: 0.0,
            last: None,
            last_from_s: None,
            recent: VecDeque::new(),
        }
    }

    /// What it holds against.
    #[must_use]
    pub fn healthy(&self) -> &Healthy {
        &self.healthy
    }

    /// Takes a block; gives the change that it completes. A block is judged when its successor is there.
    pub fn update_with_point(&mut self, point: Point) -> Option<LevelChange> {
        let waiting = self.pending.replace(point)?;
        let deviation = self.replace_disturbance(waiting.deviation, point.deviation);
        self.before = deviation;
        self.add_point(Point { deviation, ..waiting });
        self.detect_change()
    }

    /// A block far from both neighbours, which agree, is replaced by the one before.
    fn replace_disturbance(&self, here: f64, after: f64) -> f64 {
        let far = ALONE * self.healthy.sd;
        let alone = (here - self.before).abs() > far && (here - after).abs() > far;
        if alone && (after - self.before).abs() < far && !self.recent.is_empty() { self.before } else { here }
    }

    fn add_point(&mut self, point: Point) {
        let noise = self.healthy.noise();
        let innovation = match self.last {
            None => point.deviation * noise.first_weight(),
            Some((x, e)) => point.deviation - noise.phi * x - noise.theta * e,
        };
        self.last = Some((point.deviation, innovation));
        let innovation = (innovation / self.healthy.sd).clamp(-CLIP, CLIP);
        for candidate in &mut self.candidates {
            candidate.signature = 1.0 - noise.phi - noise.theta * candidate.signature;
            candidate.add_innovation(innovation, &point);
        }
        let mut fresh = CandidateOnset {
            low_s: self.last_from_s.unwrap_or(point.from_s),
            from_s: point.from_s,
            to_s: point.to_s,
            signature: 1.0,
            sum: 0.0,
            length: 0.0,
            weight: 0.0,
            difference: 0.0,
            expected: 0.0,
            count: 0.0,
        };
        fresh.add_innovation(innovation, &point);
        self.candidates.push_back(fresh);
        self.last_from_s = Some(point.from_s);
        self.recent.push_back(point.deviation);
        self.candidates.drain(..self.candidates.len().saturating_sub(WINDOW));
        self.recent.drain(..self.recent.len().saturating_sub(2 * LEVEL_BLOCKS));
    }

    /// Logarithm of the likelihood ratio that the level has changed by more than the band at this onset.
    fn compute_band_evidence(&self, candidate: &CandidateOnset) -> f64 {
        let size = candidate.sum / candidate.weight * self.healthy.sd;
        (size.abs() - self.healthy.band).max(0.0).powi(2) / (2.0 * self.compute_size_variance(candidate))
    }

    /// Variance of the size of a change: that of the noise, and that of the learned mean as far as it enters.
    fn compute_size_variance(&self, candidate: &CandidateOnset) -> f64 {
        let Healthy { phi, theta, sd, mean_variance, .. } = self.healthy;
        let share = (1.0 - phi) / (1.0 + theta) * candidate.length / candidate.weight;
        sd * sd / candidate.weight + mean_variance * share * share
    }

    fn detect_change(&self) -> Option<LevelChange> {
        let long_enough = self.candidates.len().saturating_sub(BLOCKS_MIN - 1);
        let judged = || self.candidates.iter().take(long_enough);
        let evidence = judged().map(|candidate| self.compute_band_evidence(candidate)).fold(0.0, f64::max);
        let found = judged().max_by(|a, b| a.compute_ln_likelihood().total_cmp(&b.compute_ln_likelihood()))?;
        let level = self.compute_mean_level(usize::min(LEVEL_BLOCKS, self.recent.len()))?;
        if evidence < THRESHOLD || level.abs() <= self.healthy.band || level * found.sum <= 0.0 {
            return None;
        }
        let least = found.compute_ln_likelihood() - INTERVAL;
        let within = || judged().filter(|candidate| candidate.compute_ln_likelihood() > least);
        Some(LevelChange {
            at_s: found.from_s,
            low_s: within().map(|candidate| candidate.low_s).fold(f64::INFINITY, f64::min),
            high_s: within().map(|candidate| candidate.to_s).fold(f64::NEG_INFINITY, f64::max),
            mean: found.difference / found.count,
            expected: found.expected / found.count,
        })
    }

    /// Mean deviation of the last `blocks`, `None` before there are three.
    fn compute_mean_level(&self, blocks: usize) -> Option<f64> {
        let blocks = blocks.min(self.recent.len());
        if blocks < BLOCKS_MIN {
            return None;
        }
        let sum: f64 = self.recent.iter().rev().take(blocks).sum();
        Some(sum / numerics::statistics::count_to_f64(blocks))
    }

    /// After a change: is the level back where it was, for twenty blocks?
    #[must_use]
    pub fn has_recovered(&self) -> bool {
        let level = self.compute_mean_level(2 * LEVEL_BLOCKS).unwrap_or(f64::INFINITY);
        self.recent.len() >= 2 * LEVEL_BLOCKS && level.abs() < BACK * self.healthy.band
    }
}

impl CandidateOnset {
    /// Logarithm of the likelihood of a change here over that of none.
    fn compute_ln_likelihood(&self) -> f64 {
        self.sum * self.sum / (2.0 * self.weight)
    }

    fn add_innovation(&mut self, innovation: f64, point: &Point) {
        self.sum += innovation * self.signature;
        self.length += self.signature;
        self.weight += self.signature * self.signature;
        self.difference += point.difference;
        self.expected += point.expected;
        self.count += 1.0;
    }
}
