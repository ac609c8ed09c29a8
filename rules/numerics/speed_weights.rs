//! No-load power between, and a little beyond, the known speeds of a gear stage.
//!
//! Law: quadratic Lagrange interpolation on three adjacent known speeds,
//! `Pu(n) = sum_k Pu_k prod_(j != k) (n - n_j) / (n_k - n_j)`.
//! Source: power separation on a lathe (CJK6136), equation 4.
//! Choice of the three: they hold n between them, with the least sum of distances to n; a tie goes to the slower speeds
//! (400 rpm among 200, 300, 500, 600 takes 200, 300, 500). A quadratic through a slope break errs, so the difference to
//! the other choice counts as uncertainty. Where the speeds lie so unevenly that a quadratic would amplify noise, a
//! straight line serves; two known speeds make a line, one serves only itself.

/// Within known speeds, a quadratic that amplifies noise more than this gives way to the straight line. No-load power curves: over a
/// wide gap a straight line is a tenth of the power off, while powers known to 3 % that are amplified twice are 6 % off. Lower: air is
/// taken for a light cut between such speeds, and live and simulated power differ; higher: noise of speeds that lie close together.
pub const INSIDE_GAIN_LIMIT: f64 = 2.0;

/// Speeds to extrapolate from stand apart by this much in the logarithm.
const APART: f64 = 0.1;

/// Beyond the known speeds, a straight line that amplifies noise no more than this serves in the place of a quadratic that does.
const LINE_GAIN_OUTSIDE: f64 = 1.5;

/// An extrapolating quadratic that amplifies noise more than this gives way to the straight line, if that is calm.
const NOISE_GAIN_OUTSIDE: f64 = EXTRAPOLATION_GAIN_MAX;

/// Beyond the known speeds the law is given up where it amplifies noise more than this.
pub const EXTRAPOLATION_GAIN_MAX: f64 = 3.0 + 1e-9;

/// Speeds this close beyond an end, relative, are that end's: its power goes with the speed.
const END_TOLERANCE: f64 = 0.02;

/// Weights of the quadratic through three distinct speeds, at `speed_rpm`.
#[must_use]
pub fn lagrange_weights(speeds_rpm: [f64; 3], speed_rpm: f64) -> [f64; 3] {
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
pub fn select_adjacent_speeds(speeds_rpm: &[f64], speed_rpm: f64) -> usize {
    let distance = |first: usize| speeds_rpm[first..first + 3].iter().map(|s| (s - speed_rpm).abs()).sum::<f64>();
    let mut best = 0;
    for first in 1..speeds_rpm.len().saturating_sub(2) {
        if distance(first) < distance(best) {
            best = first;
        }
    }
    best
}

/// Weights on known powers, by position; a position may stand twice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// Positions among the known speeds.
    pub at: [usize; 3],
    /// The weight of the power at each of them.
    pub weight: [f64; 3],
}

/// The law between known speeds and beyond them: how the known powers are weighed at a speed, and how it could be done otherwise. Every
/// no-load power in this program comes from here: that of the running machine, of a simulated model, of a script.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedWeights {
    /// The weights of the law.
    pub law: Weights,
    /// Those of the form that serves as its doubt; `None` where that is a power law, which needs the powers.
    pub other: Option<Weights>,
}

/// Weighs at least two known speeds, ascending, rpm, at a speed. `None` for fewer.
#[must_use]
pub fn weigh_known_speeds(speeds_rpm: &[f64], speed_rpm: f64) -> Option<SpeedWeights> {
    let (speeds, n, count) = (speeds_rpm, speed_rpm, speeds_rpm.len());
    let interval = speeds.partition_point(|known| *known < n).saturating_sub(1).min(count.checked_sub(2)?);
    let line = Weights::from_interval(speeds, interval, n);
    if count == 2 {
        return Some(SpeedWeights { law: line, other: None });
    }
    if n < speeds[0] || n > speeds[count - 1] {
        return weigh_outside(speeds, n);
    }
    // Both triples that hold the interval, the nearer one first; a tie goes to the slower speeds.
    let last = count - 3;
    let (low, high) = (interval.saturating_sub(1), interval.min(last));
    let nearer = low + select_adjacent_speeds(&speeds[low..high + 3], n);
    let further = low + high - nearer;
    let calm = |first: usize| Some(Weights::from_speed_triple(speeds, first, n)).filter(Weights::is_noise_bounded);
    Some(match (calm(nearer), calm(further).filter(|_| further != nearer)) {
        (Some(law), other) => SpeedWeights { law, other: Some(other.unwrap_or(line)) },
        (None, Some(law)) => SpeedWeights { law, other: Some(line) },
        (None, None) => SpeedWeights { law: line, other: None },
    })
}

/// One standard deviation of a power by the choice of the form, in the unit of the powers: the other form is as likely as the law.
#[must_use]
pub fn form_sd(by_law: f64, by_other: f64) -> f64 {
    (by_law - by_other).abs() / 3.0_f64.sqrt()
}

/// The law for a simulation, which has to give a power at every speed. Where the running machine gives none, too far beyond the known
/// speeds, the power holds up to where it still gives one.
#[derive(Debug, Clone)]
pub struct SimulatedSpeedWeights<'a> {
    speeds_rpm: &'a [f64],
    reach_rpm: [f64; 2],
}

impl<'a> SimulatedSpeedWeights<'a> {
    /// Of known speeds, ascending, rpm; at least one.
    #[must_use]
    pub fn new(speeds_rpm: &'a [f64]) -> Self {
        let (first, last) = (speeds_rpm[0], speeds_rpm[speeds_rpm.len() - 1]);
        let reach_rpm = [find_reach(speeds_rpm, first, 0.1 * first), find_reach(speeds_rpm, last, 10.0 * last)];
        Self { speeds_rpm, reach_rpm }
    }

    /// The weights at a speed, rpm of either sign; those of the other form where there are three known speeds.
    #[must_use]
    pub fn weigh(&self, speed_rpm: f64) -> SpeedWeights {
        let (speeds, last) = (self.speeds_rpm, self.speeds_rpm.len() - 1);
        let [least, greatest] = self.reach_rpm;
        let n = speed_rpm.abs().clamp(least.min(speeds[0]), greatest.max(speeds[last]));
        for end in [0, last] {
            let outside = if end == 0 { n < speeds[end] } else { n > speeds[end] };
            if outside && (n - speeds[end]).abs() <= END_TOLERANCE * n {
                return SpeedWeights { law: Weights::from_single_speed(end, n / speeds[end]), other: None };
            }
        }
        let alone = SpeedWeights { law: Weights::from_single_speed(0, 1.0), other: None };
        weigh_known_speeds(speeds, n).unwrap_or(alone)
    }
}

/// The speed furthest from an end at which the law is not given up, towards `limit_rpm`.
fn find_reach(speeds_rpm: &[f64], end_rpm: f64, limit_rpm: f64) -> f64 {
    let holds = |n: f64| {
        weigh_known_speeds(speeds_rpm, n).is_some_and(|it| noise_gain(&it.law.weight) <= EXTRAPOLATION_GAIN_MAX)
    };
    let (mut inside, mut outside) = (end_rpm, limit_rpm);
    if holds(outside) {
        return outside;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (inside + outside);
        if holds(middle) { inside = middle } else { outside = middle }
    }
    inside
}

/// To a billionth of the range.
const HALVINGS: usize = 30;

/// Beyond the known speeds: the last three that stand well apart, or two of them where the quadratic would amplify noise and the
/// step is short.
fn weigh_outside(speeds: &[f64], n: f64) -> Option<SpeedWeights> {
    let last = speeds.len() - 1;
    let inward = |k: usize| if n > speeds[last] { last.checked_sub(k) } else { Some(k).filter(|k| *k <= last) };
    let apart = |from: usize, at: usize| (speeds[at] / speeds[from]).ln().abs() >= APART;
    let first = inward(0)?;
    let next = |after: usize| {
        (1..=last).filter_map(inward).find(|at| {
            let beyond = (speeds[*at] - speeds[after]).signum() != (n - speeds[first]).signum();
            beyond && apart(after, *at)
        })
    };
    let Some(second) = next(first) else {
        let law = Weights::from_speed_triple(speeds, select_adjacent_speeds(speeds, n), n);
        return Some(SpeedWeights { law, other: None });
    };
    let line = Weights::from_speed_pair(speeds, [first, second], n);
    let quadratic = match next(second) {
        Some(third) => Weights {
            at: [first, second, third],
            weight: lagrange_weights([first, second, third].map(|at| speeds[at]), n),
        },
        None => Weights::from_speed_triple(speeds, select_adjacent_speeds(speeds, n), n),
    };
    if noise_gain(&quadratic.weight) > NOISE_GAIN_OUTSIDE && noise_gain(&line.weight) <= LINE_GAIN_OUTSIDE {
        return Some(SpeedWeights { law: line, other: None });
    }
    Some(SpeedWeights { law: quadratic, other: Some(line) })
}

impl Weights {
    /// A single known power, times `weight`.
    #[must_use]
    pub fn from_single_speed(at: usize, weight: f64) -> Self {
        Self { at: [at; 3], weight: [weight, 0.0, 0.0] }
    }

    fn from_interval(speeds_rpm: &[f64], first: usize, n: f64) -> Self {
        Self::from_speed_pair(speeds_rpm, [first, first + 1], n)
    }

    fn from_speed_pair(speeds_rpm: &[f64], [first, second]: [usize; 2], n: f64) -> Self {
        let (a, b) = (speeds_rpm[first], speeds_rpm[second]);
        let share = (n - a) / (b - a);
        Self { at: [first, second, first], weight: [1.0 - share, share, 0.0] }
    }

    fn from_speed_triple(speeds_rpm: &[f64], first: usize, n: f64) -> Self {
        let three = [speeds_rpm[first], speeds_rpm[first + 1], speeds_rpm[first + 2]];
        Self { at: [first, first + 1, first + 2], weight: lagrange_weights(three, n) }
    }

    fn is_noise_bounded(&self) -> bool {
        noise_gain(&self.weight) <= INSIDE_GAIN_LIMIT
    }

    /// The power that these known ones give.
    #[must_use]
    pub fn weigh_powers(&self, powers_w: &[f64]) -> f64 {
        self.at.iter().zip(self.weight).map(|(at, weight)| powers_w[*at] * weight).sum()
    }
}
