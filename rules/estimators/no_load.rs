//! No-load power over speed, one table per gear stage.
//!
//! Law: quadratic Lagrange interpolation on three adjacent known speeds,
//! `Pu(n) = sum_k Pu_k prod_(j != k) (n - n_j) / (n_k - n_j)`.
//! Source: power separation on a lathe (CJK6136), equation 4.
//! Choice of the three: least sum of distances to n; a tie goes to the slower speeds (400 rpm among 200, 300, 500, 600
//! takes 200, 300, 500). Never across a gear stage. A quadratic through a slope break errs, so the difference to the
//! neighbouring choice counts as uncertainty. Two known speeds interpolate linearly; one serves only itself.
//! Direction of rotation does not matter: speeds are magnitudes.
//!
//! What is learned is a joint estimate: no-load power drifts with temperature, mostly alike at every speed, so a
//! power learned now also corrects those learned earlier (Kalman update with correlated random walks).

use super::estimate::{NoEstimate, NoLoadOrigin};
use super::settings::{SPEEDS_PER_STAGE, STAGES, Settings};
use super::signals::seconds;
use adapters::clock::TimeNs;
use serde::{Deserialize, Serialize};

/// Correlation of the drift of two speeds of one stage: bearings and oil warm up together.
const SHARED_DRIFT: f64 = 0.8;

/// Uncertainty of configured no-load powers, relative.
const CONFIGURED_SD: f64 = 0.03;

/// Within known speeds, a quadratic that amplifies noise more than this gives way to the straight line.
const INSIDE_GAIN_LIMIT: f64 = 1.5;

/// An innovation beyond this many standard deviations means that the machine has changed, not the noise.
const SURPRISE_SD: f64 = 4.0;

/// A known no-load power.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct NoLoadPoint {
    /// Gear stage.
    pub stage: usize,
    /// Speed, positive.
    pub speed_rpm: f64,
    /// Power at this speed, steady, not cutting.
    pub power_w: f64,
}

/// No-load power at a speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoLoad {
    /// The power.
    pub power_w: f64,
    /// One standard deviation: noise, age and interpolation.
    pub sd_w: f64,
    /// By how much the interpolation amplifies independent noise of the known powers.
    pub noise_gain: f64,
    /// Measured, interpolated or extrapolated.
    pub origin: NoLoadOrigin,
}

/// Weights of the quadratic through three distinct speeds, at `speed_rpm`.
#[must_use]
pub fn lagrange(speeds_rpm: [f64; 3], speed_rpm: f64) -> [f64; 3] {
    let [a, b, c] = speeds_rpm;
    let n = speed_rpm;
    [
        (n - b) * (n - c) / ((a - b) * (a - c)),
        (n - a) * (n - c) / ((b - a) * (b - c)),
        (n - a) * (n - b) / ((c - a) * (c - b)),
    ]
}

/// By how much weights amplify independent noise: the root of the sum of their squares.
#[must_use]
pub fn noise_gain(weights: &[f64]) -> f64 {
    weights.iter().map(|weight| weight * weight).sum::<f64>().sqrt()
}

/// Position of the first of the three adjacent speeds to use, among at least three ascending ones.
#[must_use]
pub fn triple(speeds_rpm: &[f64], speed_rpm: f64) -> usize {
    let distance = |first: usize| speeds_rpm[first..first + 3].iter().map(|s| (s - speed_rpm).abs()).sum::<f64>();
    let mut best = 0;
    for first in 1..speeds_rpm.len().saturating_sub(2) {
        if distance(first) < distance(best) {
            best = first;
        }
    }
    best
}

/// Known powers of one gear stage, ascending in speed, with their covariance.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
struct Stage {
    speeds_rpm: Vec<f64>,
    powers_w: Vec<f64>,
    /// Row by row, W^2, as of `aged_ns`.
    covariance: Vec<f64>,
    aged_ns: Option<TimeNs>,
}

/// Weights on known powers, by position.
#[derive(Debug, Clone, Copy)]
struct Weights {
    at: [usize; 3],
    weight: [f64; 3],
}

impl Weights {
    fn one(at: usize, weight: f64) -> Self {
        Self { at: [at; 3], weight: [weight, 0.0, 0.0] }
    }

    fn line(speeds_rpm: &[f64], first: usize, n: f64) -> Self {
        let (a, b) = (speeds_rpm[first], speeds_rpm[first + 1]);
        let share = (n - a) / (b - a);
        Self { at: [first, first + 1, first], weight: [1.0 - share, share, 0.0] }
    }

    fn quadratic(speeds_rpm: &[f64], first: usize, n: f64) -> Self {
        let three = [speeds_rpm[first], speeds_rpm[first + 1], speeds_rpm[first + 2]];
        Self { at: [first, first + 1, first + 2], weight: lagrange(three, n) }
    }

    fn of(&self, powers_w: &[f64]) -> f64 {
        self.at.iter().zip(self.weight).map(|(at, weight)| powers_w[*at] * weight).sum()
    }
}

impl Stage {
    fn len(&self) -> usize {
        self.speeds_rpm.len()
    }

    fn near(&self, speed_rpm: f64, tolerance: f64) -> Option<usize> {
        let distance = |at: &usize| (self.speeds_rpm[*at] - speed_rpm).abs();
        let nearest = (0..self.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        (distance(&nearest) <= tolerance * speed_rpm).then_some(nearest)
    }

    /// Variance that drift has added since the covariance was last brought up to date.
    fn drift_w2(&self, i: usize, j: usize, relative_variance: f64) -> f64 {
        let shared = if i == j { 1.0 } else { SHARED_DRIFT };
        relative_variance * shared * self.powers_w[i] * self.powers_w[j]
    }

    /// Relative variance that drift has added by now: grows with time and levels off at the whole drift.
    fn aged_variance(&self, now_ns: TimeNs, settings: &Settings) -> f64 {
        let age_s = self.aged_ns.map_or(0.0, |then| seconds(then, now_ns).max(0.0));
        let drift = settings.no_load_drift;
        drift * drift * -(-age_s / settings.no_load_drift_time_s).exp_m1()
    }

    fn inflate(&mut self, relative_variance: f64) {
        let n = self.len();
        for i in 0..n {
            for j in 0..n {
                self.covariance[i * n + j] += self.drift_w2(i, j, relative_variance);
            }
        }
    }

    fn age(&mut self, now_ns: TimeNs, settings: &Settings) {
        self.inflate(self.aged_variance(now_ns, settings));
        self.aged_ns = Some(now_ns);
    }

    fn insert(&mut self, speed_rpm: f64, power_w: f64, variance_w2: f64) {
        let n = self.len();
        let at = self.speeds_rpm.partition_point(|known| *known < speed_rpm);
        let old = std::mem::take(&mut self.covariance);
        let from = |k: usize| if k < at { Some(k) } else { k.checked_sub(1).filter(|_| k != at) };
        for i in 0..=n {
            for j in 0..=n {
                let kept = from(i).zip(from(j)).map(|(i, j)| old[i * n + j]);
                self.covariance.push(kept.unwrap_or(if i == j { variance_w2 } else { 0.0 }));
            }
        }
        self.speeds_rpm.insert(at, speed_rpm);
        self.powers_w.insert(at, power_w);
    }

    fn remove(&mut self, at: usize) {
        let n = self.len();
        let old = std::mem::take(&mut self.covariance);
        let kept = |k: &usize| k / n != at && k % n != at;
        self.covariance.extend((0..n * n).filter(kept).map(|k| old[k]));
        self.speeds_rpm.remove(at);
        self.powers_w.remove(at);
    }

    fn make_room(&mut self) {
        let n = self.len();
        if n < SPEEDS_PER_STAGE {
            return;
        }
        let doubt = |at: usize| self.covariance[at * n + at].sqrt() / self.powers_w[at];
        if let Some(worst) = (0..n).max_by(|a, b| doubt(*a).total_cmp(&doubt(*b))) {
            self.remove(worst);
        }
    }

    fn update(&mut self, at: usize, power_w: f64, variance_w2: f64) {
        let n = self.len();
        let innovation_w = power_w - self.powers_w[at];
        let expected_w2 = self.covariance[at * n + at] + variance_w2;
        if innovation_w * innovation_w > SURPRISE_SD * SURPRISE_SD * expected_w2 {
            let relative = innovation_w / self.powers_w[at];
            self.inflate(relative * relative);
        }
        let column: [f64; SPEEDS_PER_STAGE] =
            std::array::from_fn(|i| if i < n { self.covariance[i * n + at] } else { 0.0 });
        let total_w2 = column[at] + variance_w2;
        for i in 0..n {
            let gain = column[i] / total_w2;
            self.powers_w[i] = (self.powers_w[i] + gain * innovation_w).max(0.1 * self.powers_w[i]);
            for (j, other) in column[..n].iter().enumerate() {
                self.covariance[i * n + j] -= gain * other;
            }
        }
    }

    fn variance_w2(&self, weights: &Weights, now_ns: TimeNs, settings: &Settings) -> f64 {
        let (n, aged) = (self.len(), self.aged_variance(now_ns, settings));
        let mut sum = 0.0;
        for (i, wi) in weights.at.iter().zip(weights.weight) {
            for (j, wj) in weights.at.iter().zip(weights.weight) {
                sum += wi * wj * (self.covariance[i * n + j] + self.drift_w2(*i, *j, aged));
            }
        }
        sum.max(0.0)
    }

    /// Weights for `n` and those of the next best form, whose difference is the doubt in the interpolation itself.
    fn forms(&self, n: f64) -> Option<(Weights, Weights)> {
        let speeds = &self.speeds_rpm;
        let line_at = speeds.partition_point(|known| *known < n).saturating_sub(1).min(self.len().checked_sub(2)?);
        let line = Weights::line(speeds, line_at, n);
        if self.len() == 2 {
            let nearest = usize::from((speeds[1] - n).abs() < (speeds[0] - n).abs());
            return Some((line, Weights::one(nearest, n / speeds[nearest])));
        }
        let first = triple(speeds, n);
        let quadratic = Weights::quadratic(speeds, first, n);
        if self.inside(n) && noise_gain(&quadratic.weight) > INSIDE_GAIN_LIMIT {
            return Some((line, quadratic));
        }
        // The other triple that holds the same interval, where there is one; the straight line otherwise.
        let other = if first == line_at { first.checked_sub(1) } else { Some(first + 1) };
        let other = other.filter(|other| other + 3 <= self.len() && self.inside(n));
        Some((quadratic, other.map_or(line, |other| Weights::quadratic(speeds, other, n))))
    }

    fn inside(&self, n: f64) -> bool {
        self.speeds_rpm.first().is_some_and(|first| *first <= n)
            && self.speeds_rpm.last().is_some_and(|last| n <= *last)
    }
}

/// No-load power over speed for every gear stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NoLoadTable {
    stages: Vec<Stage>,
}

impl NoLoadTable {
    /// A table that knows what the settings give beforehand.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        let mut table = Self { stages: vec![Stage::default(); STAGES] };
        for point in &settings.no_load_table {
            let sd_w = CONFIGURED_SD * point.power_w;
            let stage = &mut table.stages[point.stage.min(STAGES - 1)];
            if stage.near(point.speed_rpm, settings.speed_tolerance).is_none() {
                stage.insert(point.speed_rpm, point.power_w, sd_w * sd_w);
            }
        }
        table
    }

    /// Every known power.
    pub fn points(&self) -> impl Iterator<Item = NoLoadPoint> + '_ {
        self.stages.iter().enumerate().flat_map(|(stage, known)| {
            let pairs = known.speeds_rpm.iter().zip(&known.powers_w);
            pairs.map(move |(speed_rpm, power_w)| NoLoadPoint { stage, speed_rpm: *speed_rpm, power_w: *power_w })
        })
    }

    /// Takes a power measured at a speed without cutting. Within the speed tolerance of a known speed it improves that
    /// one (and by the shared drift the others), power going as speed over that small distance. Ignores what is not
    /// positive and finite.
    pub fn learn(&mut self, point: NoLoadPoint, sd_w: f64, now_ns: TimeNs, settings: &Settings) {
        let NoLoadPoint { stage, speed_rpm, power_w } = point;
        let usable = |x: f64| x.is_finite() && x > 0.0;
        let Some(stage) = self.stages.get_mut(stage).filter(|_| usable(speed_rpm) && usable(power_w) && usable(sd_w))
        else {
            return;
        };
        stage.age(now_ns, settings);
        if let Some(at) = stage.near(speed_rpm, settings.speed_tolerance) {
            let to_node = stage.speeds_rpm[at] / speed_rpm;
            stage.update(at, power_w * to_node, sd_w * sd_w);
        } else {
            stage.make_room();
            stage.insert(speed_rpm, power_w, sd_w * sd_w);
        }
    }

    /// No-load power at a speed of a gear stage. Extrapolation is flagged, and refused when it amplifies noise beyond
    /// the limit of the settings.
    ///
    /// # Errors
    /// [`NoEstimate::NotLearned`] or [`NoEstimate::Extrapolated`].
    pub fn at(&self, stage: usize, speed_rpm: f64, now_ns: TimeNs, settings: &Settings) -> Result<NoLoad, NoEstimate> {
        let n = speed_rpm.abs();
        let stage = self.stages.get(stage).ok_or(NoEstimate::NotLearned)?;
        if let Some(at) = stage.near(n, settings.speed_tolerance) {
            let weights = Weights::one(at, n / stage.speeds_rpm[at]);
            let (power_w, sd_w) = (weights.of(&stage.powers_w), stage.variance_w2(&weights, now_ns, settings).sqrt());
            return Ok(NoLoad { power_w, sd_w, noise_gain: 1.0, origin: NoLoadOrigin::Measured });
        }
        let (weights, other) = stage.forms(n).ok_or(NoEstimate::NotLearned)?;
        let noise_gain = noise_gain(&weights.weight);
        let power_w = weights.of(&stage.powers_w);
        let inside = stage.inside(n);
        // The limit itself is allowed, whatever the last digit of the weights.
        if !inside && (noise_gain > settings.noise_gain_limit + 1e-9 || power_w <= 0.0) {
            return Err(NoEstimate::Extrapolated { noise_gain });
        }
        if power_w <= 0.0 {
            return Err(NoEstimate::NotLearned);
        }
        let form_w = (power_w - other.of(&stage.powers_w)) / 3.0_f64.sqrt();
        let sd_w = (stage.variance_w2(&weights, now_ns, settings) + form_w * form_w).sqrt();
        let origin = if inside { NoLoadOrigin::Interpolated } else { NoLoadOrigin::Extrapolated };
        Ok(NoLoad { power_w, sd_w, noise_gain, origin })
    }
}
