//! A consumer that goes on and off unseen: its level and when it switches are read from what a fit leaves over.
//!
//! The most likely sequence of on and off in the presence of slow noise: a switching is a jump, and slow noise makes none,
//! so that a consumer half as strong as the noise still shows. Viterbi's algorithm, in which each of the two survivors
//! carries its own innovation (per-survivor processing: Raheli, Polydoros, Tzou, IEEE Trans. Communications 43 (1995)),
//! with a price per switching; sequence, level and noise are found in turn (the race itself: `race`), and where it stands
//! alone its rhythm with them (`rhythm`). What makes it a consumer of its own and not something of the process stands in
//! `consumer`.

use super::frame::Frame;
use super::linear::{dot, least_squares};
use super::noise::{Arma, fit_near};
use super::race::Seen;
use super::rhythm::Rhythm;
use crate::statistics::{count, robust_deviation};
use std::ops::Range;

/// Switchings that must be seen, those between runs included.
pub(super) const SWITCHINGS_MIN: usize = 4;
/// Switchings that the first sequence is priced for.
const SWITCHINGS_FIRST: usize = 10;
/// Share of the rows that each of the two levels must have.
const SHARE_MIN: f64 = 0.15;
/// Levels to start from, in deviations of the innovations.
const STARTS: [f64; 4] = [1.0, 2.0, 4.0, 8.0];
/// Rounds of sequence and level to choose a start, of sequence, level and noise after it, and of these with a rhythm.
const ROUNDS: (usize, usize, usize) = (2, 4, 6);
/// The best starts from which it is followed to the end.
const SETTLED: usize = 3;
/// Share of its price that a sequence may fall short by and still be looked at for a rhythm.
const RHYTHM_SHARE: f64 = 0.6;
/// Step, in deviations of the innovations, from which a switch need not keep a rhythm.
const CLEAR: f64 = 2.5;
/// Chance that a switch stays as it is from one row to the next, where it is followed.
const STAYS: f64 = 0.99;

/// Tells a rhythm from a sequence and its stretches.
type RhythmLaw = fn(&[f64], &[Range<usize>]) -> Option<Rhythm>;

/// What was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Switching {
    /// On (1) or off (0), per row of the residual.
    pub state: Vec<f64>,
    /// How often it switches.
    pub switchings: usize,
    /// Residual while it is off.
    pub off: f64,
    /// What it adds when on.
    pub level: f64,
    /// The noise beside it, and the standard deviation of its innovations.
    pub noise: Arma,
    /// See `noise`.
    pub deviation: f64,
    /// How long it stays on and off, where that is known.
    pub rhythm: Option<Rhythm>,
    /// What having chosen when to switch costs, in units of information.
    pub price: f64,
}

/// Finds the switch in a residual of this noise, if there is one that explains more than its price: that of every switching.
#[must_use]
pub fn find(residual: &[f64], frame: &Frame, noise: Arma) -> Option<Switching> {
    SwitchSearch::new(residual, frame, noise).likeliest().filter(Offer::holds).map(|offer| offer.found)
}

/// The same, and where its switchings cost too much, as its rhythm tells it. For what is left where nothing is named: beside
/// others it is no noise that a rhythm could be read from.
#[must_use]
pub fn find_alone(residual: &[f64], frame: &Frame, noise: Arma) -> Option<Switching> {
    let search = SwitchSearch::new(residual, frame, noise);
    let best = search.likeliest()?;
    let near = best.gain > -RHYTHM_SHARE * best.found.price;
    let told = if near { best.found.with_rhythms(residual, frame) } else { Vec::new() };
    let told = told.into_iter().map(|found| search.offer(found));
    let best = std::iter::once(best).chain(told).max_by(|a, b| a.gain.total_cmp(&b.gain));
    best.filter(Offer::holds).map(|offer| offer.found)
}

/// Where a switch is looked for.
struct SwitchSearch<'a> {
    residual: &'a [f64],
    frame: &'a Frame,
    noise: Arma,
    /// Logarithm of the likelihood of the residual without a switch: a mean, and noise of its own.
    without: f64,
}

impl<'a> SwitchSearch<'a> {
    fn new(residual: &'a [f64], frame: &'a Frame, noise: Arma) -> Self {
        let one = frame.whiten(&vec![1.0; residual.len()], noise);
        let mean = least_squares(&[one], &frame.whiten(residual, noise)).coefficients[0];
        let about_mean: Vec<f64> = residual.iter().map(|x| x - mean).collect();
        Self { residual, frame, noise, without: fit_near(&about_mean, frame, noise).0 }
    }

    /// The best of all starts.
    fn likeliest(&self) -> Option<Offer> {
        let starts = [self.noise, Arma::WHITE, Arma { phi: 0.7, theta: 0.0 }];
        let begin = |noise: &Arma| STARTS.map(|size| begin(self.residual, self.frame, *noise, size));
        let begun = starts.iter().flat_map(begin).flatten().filter(Switching::lasts);
        let mut begun: Vec<Offer> = begun.map(|found| self.offer(found)).collect();
        begun.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let settled =
            begun.into_iter().take(SETTLED).filter_map(|begun| begun.found.settled(self.residual, self.frame));
        settled.map(|found| self.offer(found)).max_by(|a, b| a.gain.total_cmp(&b.gain))
    }

    fn offer(&self, found: Switching) -> Offer {
        let with = log_likelihood(&found.left(self.residual), self.frame, found.noise);
        let price = price(&found, self.residual, self.frame);
        Offer { gain: 2.0 * (with - self.without) - price, found: Switching { price, ..found } }
    }
}

fn log_likelihood(residual: &[f64], frame: &Frame, noise: Arma) -> f64 {
    let e = frame.whiten(residual, noise);
    frame.log_likelihood(dot(&e, &e), noise)
}

/// A switch, and what it explains beyond its price, in units of information.
struct Offer {
    gain: f64,
    found: Switching,
}

impl Offer {
    fn holds(&self) -> bool {
        self.gain > 0.0 && self.found.switchings >= SWITCHINGS_MIN && self.found.lasts()
    }
}

/// From a level of so many innovations, with this noise.
fn begin(residual: &[f64], frame: &Frame, noise: Arma, size: f64) -> Option<Switching> {
    let deviation = deviation(&frame.whiten(residual, noise))?;
    let level = size * deviation;
    let mut found = Switching {
        state: Vec::new(),
        switchings: 0,
        off: -0.3 * level,
        level,
        noise,
        deviation,
        rhythm: None,
        price: 0.0,
    };
    for _ in 0..ROUNDS.0 {
        found = found.improved(residual, frame)?;
    }
    Some(found)
}

impl Switching {
    /// What it leaves of a residual.
    pub(super) fn left(&self, residual: &[f64]) -> Vec<f64> {
        residual.iter().zip(&self.state).map(|(x, on)| x - self.off - self.level * on).collect()
    }

    /// A new sequence, then new levels; `None` when one of them is gone.
    fn improved(mut self, residual: &[f64], frame: &Frame) -> Option<Self> {
        self.state = sequence(residual, frame, &self);
        self.switchings = self.state.windows(2).filter(|pair| pair[0] != pair[1]).count();
        let one = frame.whiten(&vec![1.0; residual.len()], self.noise);
        let on = frame.whiten(&self.state, self.noise);
        let all = frame.whiten(residual, self.noise);
        let (aa, ab, bb) = (dot(&one, &one), dot(&one, &on), dot(&on, &on));
        let (ay, by) = (dot(&one, &all), dot(&on, &all));
        let determinant = aa * bb - ab * ab;
        if determinant <= 1e-9 * aa * bb || determinant.is_nan() {
            return None;
        }
        self.off = (bb * ay - ab * by) / determinant;
        self.level = (aa * by - ab * ay) / determinant;
        if self.level < 0.0 {
            self.off += self.level;
            self.level = -self.level;
            self.state.iter_mut().for_each(|on| *on = 1.0 - *on);
        }
        self.deviation = deviation(&frame.whiten(&self.left(residual), self.noise))?;
        Some(self)
    }

    /// Sequence, level and noise in turn.
    fn settled(mut self, residual: &[f64], frame: &Frame) -> Option<Self> {
        for _ in 0..ROUNDS.1 {
            self.noise = fit_near(&self.left(residual), frame, self.noise).1;
            self = self.improved(residual, frame)?;
        }
        Some(self)
    }

    /// The same switch as its rhythm tells it, where that is clear: with the chances of its sequence only, and with the
    /// durations of its spells.
    fn with_rhythms(&self, residual: &[f64], frame: &Frame) -> Vec<Self> {
        let laws: [(RhythmLaw, usize); 2] = [(Rhythm::even, 0), (Rhythm::of, ROUNDS.2)];
        let told = laws.into_iter().filter_map(|(law, rounds)| self.clone().with_rhythm(law, rounds, residual, frame));
        told.filter(Self::is_clear).collect()
    }

    /// Sequence, level, noise and rhythm in turn.
    fn with_rhythm(mut self, law: RhythmLaw, rounds: usize, residual: &[f64], frame: &Frame) -> Option<Self> {
        self.rhythm = Some(law(&self.state, &frame.stretches)?);
        for _ in 0..rounds {
            self.noise = fit_near(&self.left(residual), frame, self.noise).1;
            self = self.improved(residual, frame)?;
            self.rhythm = Some(law(&self.state, &frame.stretches)?);
        }
        Some(self)
    }

    /// Does its step stand out from a single innovation, or does it keep a rhythm? What is lower and irregular has two levels
    /// also in noise of another shape than a bell, unless every switching is paid for.
    fn is_clear(&self) -> bool {
        self.level >= CLEAR * self.deviation || self.rhythm.as_ref().is_some_and(Rhythm::is_regular)
    }

    /// Is each of the two levels there for a good part of the time?
    fn lasts(&self) -> bool {
        let on = self.state.iter().sum::<f64>() / count(self.state.len());
        (SHARE_MIN..=1.0 - SHARE_MIN).contains(&on)
    }
}

/// The same switch in another residual, with the noise that is there.
#[must_use]
pub fn again(residual: &[f64], frame: &Frame, found: &Switching) -> Switching {
    let begun = Switching { state: sequence(residual, frame, found), ..found.clone() };
    begun.clone().settled(residual, frame).unwrap_or(begun)
}

/// The price, in units of information, of having chosen when to switch.
pub(super) fn price(switching: &Switching, residual: &[f64], frame: &Frame) -> f64 {
    if let Some(rhythm) = &switching.rhythm {
        return rhythm.price(residual, frame, switching);
    }
    let rows = count(switching.state.len());
    let switchings = count(switching.switchings).max(1.0);
    2.0 * switchings * (rows / switchings).ln() + 2.0 * switchings
}

/// Standard deviation of innovations, whatever the few greatest are.
fn deviation(innovations: &[f64]) -> Option<f64> {
    robust_deviation(innovations.iter().copied()).filter(|deviation| *deviation > 0.0)
}

/// The most likely sequence of on (1) and off (0).
fn sequence(residual: &[f64], frame: &Frame, found: &Switching) -> Vec<f64> {
    // What one more switching costs beside as many as there were: the slope of [`price`].
    let price = (count(residual.len()) / count(found.switchings.max(SWITCHINGS_FIRST))).ln().max(1.0);
    let any = Rhythm::none((-price).exp(), 0.5);
    let rhythm = found.rhythm.as_ref().unwrap_or(&any);
    let mut state = vec![0.0; residual.len()];
    for rows in &frame.stretches {
        rhythm.likeliest(residual, frame, found, rows.clone(), &mut state);
    }
    state
}

/// The chance, row by row and from earlier rows of the stretch only, that the switch is on.
#[must_use]
pub fn follow(residual: &[f64], found: &Switching, share_on: f64) -> Vec<f64> {
    let any = Rhythm::none(1.0 - STAYS, share_on);
    let rhythm = found.rhythm.as_ref().unwrap_or(&any);
    rhythm.followed(found, residual.iter().map(|x| Seen { x: found.levels(*x), weight: 1.0 })).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Noise with this memory and unit variance.
    fn noise(rows: usize, phi: f64, seed: u64) -> Vec<f64> {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        let mut last = 0.0;
        let mut next = |_| {
            let e: f64 = StandardNormal.sample(&mut rng);
            last = phi * last + (1.0 - phi * phi).sqrt() * e;
            last
        };
        (0..rows).map(&mut next).collect()
    }

    fn on(row: usize) -> f64 {
        if row / 60 % 2 == 1 { 1.0 } else { 0.0 }
    }

    fn with_pump(noise: &[f64], level: f64) -> Vec<f64> {
        noise.iter().enumerate().map(|(row, x)| x + level * on(row)).collect()
    }

    #[test]
    fn a_pump_is_found_with_its_level() {
        let residual = with_pump(&noise(1000, 0.0, 3), 4.0);
        let found = find_alone(&residual, &Frame::one_run(1000), Arma { phi: 0.97, theta: -0.65 }).expect("a switch");
        assert!((found.level - 4.0).abs() < 0.3 && found.switchings == 16, "{} {}", found.level, found.switchings);
    }

    #[test]
    fn a_pump_as_strong_as_slow_noise_is_found() {
        let residual = with_pump(&noise(2000, 0.95, 6), 1.5);
        let found = find_alone(&residual, &Frame::one_run(2000), Arma { phi: 0.97, theta: 0.0 }).expect("a switch");
        let right = found.state.iter().enumerate().filter(|(row, state)| **state == on(*row)).count();
        assert!((found.level - 1.5).abs() < 0.2 && right > 1800, "{} {right}", found.level);
    }

    #[test]
    fn noise_and_a_drift_are_no_pump() {
        let frame = Frame::one_run(1000);
        assert_eq!(find_alone(&noise(1000, 0.0, 4), &frame, Arma::WHITE), None);
        assert_eq!(find_alone(&noise(1000, 0.97, 4), &frame, Arma { phi: 0.97, theta: 0.0 }), None);
        let drift: Vec<f64> = noise(1000, 0.0, 5).iter().enumerate().map(|(row, x)| x + 0.006 * count(row)).collect();
        assert_eq!(find_alone(&drift, &frame, Arma { phi: 0.985, theta: -0.93 }), None);
    }

    #[test]
    fn a_followed_pump_is_known_soon_after_it_switches() {
        let found =
            find_alone(&with_pump(&noise(2000, 0.9, 6), 3.0), &Frame::one_run(2000), Arma { phi: 0.9, theta: 0.0 });
        let told = follow(&with_pump(&noise(2000, 0.9, 7), 3.0), &found.expect("a switch"), 0.5);
        let right = told.iter().enumerate().filter(|(row, chance)| (*chance - on(*row)).abs() < 0.5).count();
        assert!(right > 1850, "{right}");
    }
}
