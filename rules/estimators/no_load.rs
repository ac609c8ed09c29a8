//! No-load power over speed, one table per gear stage.
//!
//! Never across a gear stage; between speeds see `interpolation`. Direction of rotation does not matter: speeds are
//! magnitudes.
//!
//! What is learned is a joint estimate: no-load power drifts with temperature, mostly alike at every speed, so a
//! power learned now also corrects those learned earlier (Kalman update with correlated random walks).

use super::estimate::NoEstimate;
use super::estimate_words::NoLoadOrigin;
use super::settings::{SPEEDS_PER_STAGE, STAGES, Settings};
use super::signals::seconds_between;
use adapter_core::clock::TimeNs;
use numerics::speed_weights::{Weights, form_sd, noise_gain};
use serde::{Deserialize, Serialize};

/// Correlation of the drift of two speeds of one stage: bearings and oil warm up together.
const SHARED_DRIFT: f64 = 0.8;

/// Uncertainty of configured no-load powers, relative.
const CONFIGURED_SD: f64 = 0.03;

/// One standard deviation of the exponent of the power law.
const EXPONENT_SD: f64 = 0.3;

/// Logarithmic distance over which a power law is better than nothing: a factor of two.
const ROUGH_SPAN: f64 = 0.7;

/// Uncertainty of an extrapolation by once the span of the known speeds, relative.
const BEYOND_SD: f64 = 0.1;

/// An innovation beyond this many standard deviations means that the machine has changed, not the noise.
const SURPRISE_SD: f64 = 4.0;

/// A known no-load power.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct NoLoadPoint {
    /// Gear stage, the place of its table; 0 where the machine has none.
    pub stage: usize,
    /// Spindle speed, rpm; positive in both directions.
    pub speed_rpm: f64,
    /// Power at this speed, steady, not cutting.
    pub power_w: f64,
}

/// No-load power at a speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoLoad {
    /// The power of the spindle when nothing is cut, W.
    pub power_w: f64,
    /// One standard deviation: noise, age and interpolation.
    pub sd_w: f64,
    /// By how much the interpolation amplifies independent noise of the known powers.
    pub noise_gain: f64,
    /// Measured, interpolated or extrapolated.
    pub origin: NoLoadOrigin,
    /// Logarithm of supply voltage over its reference at which it was learned; 0 where no voltage is known.
    pub supply_log: f64,
}

impl NoLoad {
    /// Not just the rough idea of [`NoLoadTable::rough_power`].
    #[must_use]
    pub fn is_estimate(&self) -> bool {
        self.origin != NoLoadOrigin::None
    }
}

/// Known powers of one gear stage, ascending in speed, with their covariance.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct StagePowers {
    pub(super) speeds_rpm: Vec<f64>,
    pub(super) powers_w: Vec<f64>,
    /// Logarithm of supply voltage over its reference at which each power was learned; shorter than the powers where the
    /// voltage never was known.
    #[serde(default)]
    supply_logs: Vec<f64>,
    /// Row by row, W^2, as of `aged_ns`.
    covariance: Vec<f64>,
    aged_ns: Option<TimeNs>,
}

impl StagePowers {
    pub(super) fn len(&self) -> usize {
        self.speeds_rpm.len()
    }

    fn find_speed_near(&self, speed_rpm: f64, tolerance: f64) -> Option<usize> {
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
        let age_s = self.aged_ns.map_or(0.0, |then| seconds_between(then, now_ns).max(0.0));
        let drift = settings.no_load_drift;
        drift * drift * -(-age_s / settings.no_load_drift_time_s).exp_m1()
    }

    fn inflate_variance(&mut self, relative_variance: f64) {
        let n = self.len();
        for i in 0..n {
            for j in 0..n {
                self.covariance[i * n + j] += self.drift_w2(i, j, relative_variance);
            }
        }
    }

    fn apply_aging(&mut self, now_ns: TimeNs, settings: &Settings) {
        self.inflate_variance(self.aged_variance(now_ns, settings));
        self.aged_ns = Some(now_ns);
    }

    fn insert(&mut self, speed_rpm: f64, power_w: f64, variance_w2: f64, supply_log: f64) {
        let n = self.len();
        self.supply_logs.resize(n, 0.0);
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
        self.supply_logs.insert(at, supply_log);
    }

    /// The exponent of the supply voltage is known better by `change`: powers were learned at a voltage, and are kept as they
    /// would be at its reference.
    fn correct_supply_exponent(&mut self, change: f64) {
        for (power_w, log) in self.powers_w.iter_mut().zip(&self.supply_logs) {
            *power_w *= (-change * log).exp();
        }
    }

    fn remove(&mut self, at: usize) {
        let n = self.len();
        let old = std::mem::take(&mut self.covariance);
        let kept = |k: &usize| k / n != at && k % n != at;
        self.covariance.extend((0..n * n).filter(kept).map(|k| old[k]));
        self.speeds_rpm.remove(at);
        self.powers_w.remove(at);
        self.supply_logs.resize(n, 0.0);
        self.supply_logs.remove(at);
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

    fn update_power(&mut self, at: usize, power_w: f64, variance_w2: f64, supply_log: f64) {
        let n = self.len();
        self.supply_logs.resize(n, 0.0);
        let moved_w = (supply_log - self.supply_logs[at]) * self.powers_w[at];
        let innovation_w = power_w - self.powers_w[at];
        let expected_w2 = self.covariance[at * n + at] + variance_w2;
        if innovation_w * innovation_w > SURPRISE_SD * SURPRISE_SD * expected_w2 {
            let relative = innovation_w / self.powers_w[at];
            self.inflate_variance(relative * relative);
        }
        let column: [f64; SPEEDS_PER_STAGE] =
            std::array::from_fn(|i| if i < n { self.covariance[i * n + at] } else { 0.0 });
        let total_w2 = column[at] + variance_w2;
        for i in 0..n {
            let gain = column[i] / total_w2;
            self.supply_logs[i] += gain * moved_w / self.powers_w[i];
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

    /// At what supply voltage the powers behind these weights were learned, by their share.
    fn supply_log(&self, weights: &Weights) -> f64 {
        let total_w = weights.weigh_powers(&self.powers_w);
        let logs = weights.at.iter().zip(weights.weight);
        let sum = logs.map(|(at, weight)| weight * self.powers_w[*at] * self.supply_logs.get(*at).unwrap_or(&0.0));
        if total_w > 0.0 { sum.sum::<f64>() / total_w } else { 0.0 }
    }

    /// The power law alone, and its uncertainty; `None` too far from any known speed.
    fn by_power_law(&self, n: f64, now_ns: TimeNs, settings: &Settings) -> Option<(f64, f64, f64)> {
        let (_, distance) = self.find_nearest_speed(n).filter(|(_, distance)| *distance <= ROUGH_SPAN)?;
        let weights = self.by_law(n);
        let power_w = weights.weigh_powers(&self.powers_w);
        let law_w = EXPONENT_SD * distance * power_w;
        let sd_w = (self.variance_w2(&weights, now_ns, settings) + law_w * law_w).sqrt();
        Some((power_w, sd_w, self.supply_log(&weights)))
    }

    /// How far `n` lies outside the known speeds, relative to the span they cover.
    fn measure_extrapolation(&self, n: f64) -> f64 {
        match (self.speeds_rpm.first(), self.speeds_rpm.last()) {
            (Some(first), Some(last)) if last > first => (first - n).max(n - last).max(0.0) / (last - first),
            _ => 0.0,
        }
    }
}

/// No-load power over speed for every gear stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NoLoadTable {
    stages: Vec<StagePowers>,
}

impl NoLoadTable {
    /// A table that knows what the settings give beforehand.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        let mut table = Self { stages: vec![StagePowers::default(); STAGES] };
        for point in &settings.no_load_table {
            let sd_w = CONFIGURED_SD * point.power_w;
            let stage = &mut table.stages[point.stage.min(STAGES - 1)];
            if stage.find_speed_near(point.speed_rpm, settings.speed_tolerance).is_none() {
                stage.insert(point.speed_rpm, point.power_w, sd_w * sd_w, 0.0);
            }
        }
        table
    }

    /// The powers of all gear stages, measured or configured, stage by stage.
    pub fn points(&self) -> impl Iterator<Item = NoLoadPoint> + '_ {
        self.stages.iter().enumerate().flat_map(|(stage, known)| {
            let pairs = known.speeds_rpm.iter().zip(&known.powers_w);
            pairs.map(move |(speed_rpm, power_w)| NoLoadPoint { stage, speed_rpm: *speed_rpm, power_w: *power_w })
        })
    }

    /// Takes a power measured at a speed without cutting. Within the speed tolerance of a known speed it improves that
    /// one (and by the shared drift the others), power going as speed over that small distance. Ignores what is not
    /// positive and finite. The power is that at the reference of the supply voltage, `supply_log` the logarithm of the
    /// voltage over that reference while it was measured.
    pub fn learn_power(&mut self, point: NoLoadPoint, sd_w: f64, supply_log: f64, now_ns: TimeNs, settings: &Settings) {
        let NoLoadPoint { stage, speed_rpm, power_w } = point;
        let usable = |x: f64| x.is_finite() && x > 0.0;
        let Some(stage) = self.stages.get_mut(stage).filter(|_| usable(speed_rpm) && usable(power_w) && usable(sd_w))
        else {
            return;
        };
        stage.apply_aging(now_ns, settings);
        if let Some(at) = stage.find_speed_near(speed_rpm, settings.speed_tolerance) {
            let to_node = stage.speeds_rpm[at] / speed_rpm;
            stage.update_power(at, power_w * to_node, sd_w * sd_w, supply_log);
        } else {
            stage.make_room();
            stage.insert(speed_rpm, power_w, sd_w * sd_w, supply_log);
        }
    }

    /// The exponent of the supply voltage is known better by `change`.
    pub(super) fn correct_exponent(&mut self, change: f64) {
        self.stages.iter_mut().for_each(|stage| stage.correct_supply_exponent(change));
    }

    /// No-load power at a speed of a gear stage. Extrapolation is flagged, and refused when it amplifies noise beyond
    /// the limit of the settings.
    ///
    /// # Errors
    /// [`NoEstimate::NotLearned`] or [`NoEstimate::Extrapolated`].
    pub fn get(&self, stage: usize, speed_rpm: f64, now_ns: TimeNs, settings: &Settings) -> Result<NoLoad, NoEstimate> {
        let n = speed_rpm.abs();
        let stage = self.stages.get(stage).ok_or(NoEstimate::NotLearned)?;
        let (inside, near) = (stage.covers_speed(n), stage.find_speed_near(n, settings.speed_tolerance));
        // Between known speeds the law holds throughout; just beyond the last of them its power goes with the speed.
        let beside = near.filter(|_| !inside || stage.len() < 2);
        let alone = beside.map(|at| [Weights::from_single_speed(at, n / stage.speeds_rpm[at]); 2].into());
        let pair = alone.or_else(|| stage.compute_weight_pair(n));
        let (weights, other) = pair.ok_or(NoEstimate::NotLearned)?;
        let noise_gain = noise_gain(&weights.weight);
        let power_w = weights.weigh_powers(&stage.powers_w);
        // The limit itself is allowed, whatever the last digit of the weights.
        if !inside && (noise_gain > settings.noise_gain_limit + 1e-9 || power_w <= 0.0) {
            return Err(NoEstimate::Extrapolated { noise_gain });
        }
        if power_w <= 0.0 {
            return Err(NoEstimate::NotLearned);
        }
        let form_w = form_sd(power_w, other.weigh_powers(&stage.powers_w));
        let beyond_w = if near.is_none() { BEYOND_SD * stage.measure_extrapolation(n) * power_w } else { 0.0 };
        let sd_w = (stage.variance_w2(&weights, now_ns, settings) + form_w * form_w + beyond_w * beyond_w).sqrt();
        let origin = match (near, inside) {
            (Some(_), _) => NoLoadOrigin::Measured,
            (None, true) => NoLoadOrigin::Interpolated,
            (None, false) => NoLoadOrigin::Extrapolated,
        };
        Ok(NoLoad { power_w, sd_w, noise_gain, origin, supply_log: stage.supply_log(&weights) })
    }

    /// A rough idea of no-load power where [`NoLoadTable::get`] refuses: good enough to tell a heavy cut from none, not to
    /// be called an estimate. `None` where the gear stage has no known power within a factor of two of the speed.
    #[must_use]
    pub fn rough_power(&self, stage: usize, speed_rpm: f64, now_ns: TimeNs, settings: &Settings) -> Option<NoLoad> {
        let (power_w, sd_w, supply_log) = self.stages.get(stage)?.by_power_law(speed_rpm.abs(), now_ns, settings)?;
        Some(NoLoad { power_w, sd_w, noise_gain: 1.0, origin: NoLoadOrigin::None, supply_log })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapter_core::clock::SECOND_NS;

    fn point(speed_rpm: f64, power_w: f64) -> NoLoadPoint {
        NoLoadPoint { stage: 0, speed_rpm, power_w }
    }

    fn learned(points: &[(f64, f64)], settings: &Settings) -> NoLoadTable {
        let mut table = NoLoadTable::new(settings);
        points.iter().for_each(|(speed, power)| table.learn_power(point(*speed, *power), 2.0, 0.0, 0, settings));
        table
    }

    #[test]
    fn warm_up_seen_at_one_speed_corrects_the_others() {
        let settings = Settings::default();
        let mut table = learned(&[(600.0, 400.0), (1200.0, 800.0)], &settings);
        let later = 600 * SECOND_NS;
        table.learn_power(point(600.0, 380.0), 2.0, 0.0, later, &settings);
        let other = table.get(0, 1200.0, later, &settings).expect("known");
        assert!(other.power_w < 780.0 && other.power_w > 760.0, "{other:?}");
        assert!(other.sd_w > 10.0, "less sure than a measurement: {other:?}");
    }

    #[test]
    fn what_is_known_grows_old_but_not_without_bound() {
        let settings = Settings::default();
        let table = learned(&[(600.0, 400.0)], &settings);
        let sd = |after_s: i64| table.get(0, 600.0, after_s * SECOND_NS, &settings).expect("known").sd_w;
        assert!(sd(0) < 2.1 && sd(60) > 4.0 && sd(3600) > 15.0);
        assert!(sd(1_000_000) < 1.01 * 400.0 * settings.no_load_drift.hypot(2.0 / 400.0));
    }

    #[test]
    fn a_changed_machine_is_believed() {
        let settings = Settings::default();
        let mut table = learned(&[(600.0, 400.0), (600.0, 401.0), (600.0, 399.0)], &settings);
        table.learn_power(point(600.0, 520.0), 2.0, 0.0, SECOND_NS, &settings);
        assert!((table.get(0, 600.0, SECOND_NS, &settings).expect("known").power_w - 520.0).abs() < 6.0);
    }

    #[test]
    fn the_most_doubtful_speed_makes_room() {
        let settings = Settings::default();
        let mut table = NoLoadTable::new(&settings);
        for k in 0..SPEEDS_PER_STAGE {
            let speed = 200.0 * 1.15_f64.powi(i32::try_from(k).expect("small"));
            table.learn_power(point(speed, speed / 2.0), if k == 3 { 30.0 } else { 1.0 }, 0.0, 0, &settings);
        }
        table.learn_power(point(10_000.0, 9000.0), 5.0, 0.0, 0, &settings);
        assert_eq!(table.points().count(), SPEEDS_PER_STAGE);
        let gone = 200.0 * 1.15_f64.powi(3);
        assert!(table.points().all(|known| (known.speed_rpm - gone).abs() > 1.0));
    }

    #[test]
    fn unusable_powers_are_not_learned_and_a_rough_idea_has_its_limits() {
        let settings = Settings::default();
        let mut table = learned(&[(600.0, 400.0)], &settings);
        for (speed, power) in [(0.0, 1.0), (-600.0, 400.0), (600.0, f64::NAN), (700.0, -1.0), (f64::INFINITY, 1.0)] {
            table.learn_power(point(speed, power), 1.0, 0.0, 0, &settings);
        }
        assert_eq!(table.points().count(), 1);
        let rough = table.rough_power(0, 900.0, 0, &settings).expect("within a factor of two");
        assert!((rough.power_w - 400.0 * 1.5_f64.powf(1.3)).abs() < 1e-9 && rough.sd_w > 0.1 * rough.power_w);
        assert!(!rough.is_estimate());
        assert_eq!(table.get(0, 900.0, 0, &settings), Err(NoEstimate::NotLearned));
        assert_eq!(table.rough_power(0, 1300.0, 0, &settings), None);
        assert_eq!(table.rough_power(1, 600.0, 0, &settings), None);
    }
}
