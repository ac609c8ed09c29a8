//! A consumer that goes on and off unseen: its level and when it switches are read from what a fit leaves over.
//!
//! The most likely sequence of on and off in the presence of slow noise: a switching is a jump, and slow noise makes none,
//! so that a consumer half as strong as the noise still shows. Viterbi's algorithm, in which each of the two survivors
//! carries its own innovation (per-survivor processing: Raheli, Polydoros, Tzou, IEEE Trans. Communications 43 (1995)),
//! with a price per switching; sequence, level and noise are found in turn (the race itself: `race`), and where it stands
//! alone its rhythm with them (`rhythm`). What makes it a consumer of its own and not something of the process: it is on
//! for a good part of the time, on and off as often in the cut as out of it, and it does not switch only when the machine
//! changes its pace.

use super::frame::Frame;
use super::linear::dot;
use super::noise::{Arma, fit_near};
use super::race::Seen;
use super::rhythm::Rhythm;
use crate::statistics::{count, median, robust_deviation};
use std::ops::Range;

/// Switchings that must be seen, those between runs included.
pub(super) const SWITCHINGS_MIN: usize = 4;
/// Switchings that the first sequence is priced for.
const SWITCHINGS_FIRST: usize = 10;
/// Share of the rows that each of the two levels must have.
const SHARE_MIN: f64 = 0.15;
/// Share of switchings at a change of pace, of those that are not there by chance, beyond which it is the machine's own
/// doing.
const OWN_DOING: f64 = 0.7;
/// By how much its share of the cut and that of the rest may differ.
const SHARES_APART_MAX: f64 = 0.35;
/// Rows of a spell that is no flicker, and the share of spells that may be shorter.
const SPELL_ROWS_MIN: usize = 4;
const SHORT_SPELLS_MAX: f64 = 0.25;
/// Rows on either side of a switching by which its step is measured, and how many there must be.
const BESIDE_ROWS: usize = 5;
const BESIDE_ROWS_MIN: usize = 3;
/// Switchings that must be seen within a run, and their share of all.
const STEPS_MIN: usize = 2;
const STEPS_SHARE_MIN: f64 = 0.3;
/// What the middle one of these must step by, in levels.
const STEP: std::ops::RangeInclusive<f64> = 0.5..=1.8;
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

/// Finds the switch in a residual of this noise, if there is one that explains more than its price. Only where nothing else
/// is named, `alone`, is its rhythm asked for: what is left beside others is no noise that one could be read from.
#[must_use]
pub fn find(residual: &[f64], frame: &Frame, noise: Arma, alone: bool) -> Option<Switching> {
    let likelihood = |noise: Arma, residual: &[f64]| {
        let e = frame.whiten(residual, noise);
        frame.log_likelihood(dot(&e, &e), noise)
    };
    let before = likelihood(noise, residual);
    let raw = |found: &Switching| 2.0 * (likelihood(found.noise, &found.left(residual)) - before);
    let priced = |found: Switching| {
        let found = Switching { price: price(&found, residual, frame), ..found };
        (raw(&found) - found.price, found)
    };
    let starts = [noise, Arma::WHITE, Arma { phi: 0.7, theta: 0.0 }];
    let begun = starts.iter().flat_map(|noise| STARTS.map(|size| begin(residual, frame, *noise, size)));
    let mut begun: Vec<(f64, Switching)> = begun.flatten().filter(Switching::lasts).map(priced).collect();
    begun.sort_by(|a, b| b.0.total_cmp(&a.0));
    let settled = begun.into_iter().take(SETTLED).filter_map(|(_, found)| found.settled(residual, frame));
    let best = settled.map(priced).max_by(|a, b| a.0.total_cmp(&b.0))?;
    let near = alone && best.0 > -RHYTHM_SHARE * best.1.price;
    let told = if near { best.1.with_rhythms(residual, frame) } else { Vec::new() };
    let told = told.into_iter().map(priced);
    let (gain, best) = std::iter::once(best).chain(told).max_by(|a, b| a.0.total_cmp(&b.0))?;
    (gain > 0.0 && best.switchings >= SWITCHINGS_MIN && best.lasts()).then_some(best)
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

    /// Does it stay as it is for a while? What flickers from row to row is noise with two faces.
    #[must_use]
    pub fn stays(&self) -> bool {
        let spells: Vec<usize> = self.state.chunk_by(|a, b| a == b).map(<[f64]>::len).collect();
        let short = spells.iter().filter(|rows| **rows < SPELL_ROWS_MIN).count();
        count(short) <= SHORT_SPELLS_MAX * count(spells.len())
    }

    /// Does it switch by itself? Not where it switches with the pace only, nor where it is on in the cut and off out of
    /// it or the other way round. `change` says of each row whether the pace changes there or nearby, `cut` whether it is
    /// cut.
    #[must_use]
    pub fn by_itself(&self, change: &[bool], cut: &[bool]) -> bool {
        let switchings = || (1..self.state.len()).filter(|row| self.state[*row] != self.state[*row - 1]);
        let all = count(switchings().count());
        let together = count(switchings().filter(|row| change[*row]).count());
        // As often as by chance is no sign.
        let by_chance = count((0..change.len()).filter(|row| change[*row]).count()) / count(change.len());
        let own_doing = all * (1.0 - by_chance) > 3.0 && together / all - by_chance > OWN_DOING * (1.0 - by_chance);
        let share = |wanted: bool| {
            let of: Vec<f64> =
                self.state.iter().zip(cut).filter(|(_, cut)| **cut == wanted).map(|(on, _)| *on).collect();
            (!of.is_empty()).then(|| of.iter().sum::<f64>() / count(of.len()))
        };
        let apart = share(true).zip(share(false)).map_or(0.0, |(cut, rest)| (cut - rest).abs());
        !own_doing && apart <= SHARES_APART_MAX
    }
}

/// Does the residual step by the level where it switches, and stay there? A consumer does; what wanders does not, nor
/// does a spike, nor what is one level in one run and another in the next.
#[must_use]
pub fn steps(found: &Switching, residual: &[f64], frame: &Frame) -> bool {
    let mut steps = Vec::new();
    let turn = |row: usize| found.state[row] - found.state[row - 1];
    for rows in &frame.stretches {
        for row in (rows.start + 1..rows.end).filter(|row| turn(*row) != 0.0) {
            // The row of the switching itself may be on for a part.
            let before = residual[row.saturating_sub(BESIDE_ROWS).max(rows.start)..row].to_vec();
            let after = residual[row + 1..(row + 1 + BESIDE_ROWS).min(rows.end)].to_vec();
            if before.len().min(after.len()) >= BESIDE_ROWS_MIN {
                steps.extend(median(after).zip(median(before)).map(|(after, before)| turn(row) * (after - before)));
            }
        }
    }
    let enough = steps.len() >= STEPS_MIN && count(steps.len()) >= STEPS_SHARE_MIN * count(found.switchings);
    enough && median(steps).is_some_and(|step| STEP.contains(&(step / found.level)))
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
    use super::super::frame::units;
    use super::*;
    use crate::physics::Scene;
    use adapters::Recording;
    use adapters::recording::{Cells, Numbers};
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// One run of so many rows.
    fn frame(rows: usize) -> Frame {
        let mut recording = Recording::new("test", (0..rows).map(count).collect(), None);
        recording.set_column("spindle_power_w", Cells::Numbers(Numbers::full(vec![1.0; rows])));
        let scene = Scene::new(&recording, "spindle_power_w", &Default::default()).expect("a scene");
        Frame::new(&scene, &units(&scene), 1, |_| true)
    }

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
        let found = find(&residual, &frame(1000), Arma { phi: 0.97, theta: -0.65 }, true).expect("a switch");
        assert!((found.level - 4.0).abs() < 0.3 && found.switchings == 16, "{} {}", found.level, found.switchings);
    }

    #[test]
    fn a_pump_as_strong_as_slow_noise_is_found() {
        let residual = with_pump(&noise(2000, 0.95, 6), 1.5);
        let found = find(&residual, &frame(2000), Arma { phi: 0.97, theta: 0.0 }, true).expect("a switch");
        let right = found.state.iter().enumerate().filter(|(row, state)| **state == on(*row)).count();
        assert!((found.level - 1.5).abs() < 0.2 && right > 1800, "{} {right}", found.level);
    }

    #[test]
    fn noise_and_a_drift_are_no_pump() {
        let frame = frame(1000);
        assert_eq!(find(&noise(1000, 0.0, 4), &frame, Arma::WHITE, true), None);
        assert_eq!(find(&noise(1000, 0.97, 4), &frame, Arma { phi: 0.97, theta: 0.0 }, true), None);
        let drift: Vec<f64> = noise(1000, 0.0, 5).iter().enumerate().map(|(row, x)| x + 0.006 * count(row)).collect();
        assert_eq!(find(&drift, &frame, Arma { phi: 0.985, theta: -0.93 }, true), None);
    }

    #[test]
    fn a_spike_is_no_step() {
        let frame = frame(1000);
        let pump = with_pump(&noise(1000, 0.0, 3), 4.0);
        let found = find(&pump, &frame, Arma::WHITE, true).expect("a switch");
        let spikes: Vec<f64> = (0..1000).map(|row| if row % 60 == 0 { 4.0 } else { 0.0 }).collect();
        assert!(steps(&found, &pump, &frame) && !steps(&found, &spikes, &frame));
    }

    #[test]
    fn what_flickers_is_no_consumer() {
        let residual = with_pump(&noise(1000, 0.0, 3), 4.0);
        let mut found = find(&residual, &frame(1000), Arma::WHITE, true).expect("a switch");
        assert!(found.stays());
        (0..1000).step_by(20).for_each(|row| found.state[row] = 1.0 - found.state[row]);
        assert!(!found.stays());
    }

    #[test]
    fn what_switches_with_the_machine_is_no_switch_of_its_own() {
        let residual = with_pump(&noise(1000, 0.0, 3), 4.0);
        let found = find(&residual, &frame(1000), Arma::WHITE, true).expect("a switch");
        let with_the_pump: Vec<bool> = (0..1000).map(|row| (row + 2) % 60 < 5).collect();
        let seldom: Vec<bool> = (0..1000).map(|row| (row + 2) % 170 < 5).collect();
        let cut: Vec<bool> = (0..1000).map(|row| row % 50 > 25).collect();
        assert!(!found.by_itself(&with_the_pump, &cut));
        assert!(!found.by_itself(&seldom, &found.state.iter().map(|on| *on > 0.5).collect::<Vec<bool>>()));
        assert!(found.by_itself(&seldom, &cut));
    }

    #[test]
    fn a_followed_pump_is_known_soon_after_it_switches() {
        let found = find(&with_pump(&noise(2000, 0.9, 6), 3.0), &frame(2000), Arma { phi: 0.9, theta: 0.0 }, true);
        let told = follow(&with_pump(&noise(2000, 0.9, 7), 3.0), &found.expect("a switch"), 0.5);
        let right = told.iter().enumerate().filter(|(row, chance)| (*chance - on(*row)).abs() < 0.5).count();
        assert!(right > 1850, "{right}");
    }
}
