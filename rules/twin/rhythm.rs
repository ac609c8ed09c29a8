//! How long a hidden consumer stays on and off, and which sequence of both is the likeliest.
//!
//! A pump between two pressures, a conveyor and a lubrication unit keep a rhythm: how long a spell has lasted says how soon
//! it ends. States are therefore on and off together with the age of the spell (a semi-Markov chain with explicit durations:
//! Ferguson 1980; Rabiner, Proc. IEEE 77 (1989), section IV D). Each survivor carries its own innovation, so that slow
//! noise is told from a step. What a sequence costs beyond its likelihood is what the sum over all sequences leaves of it:
//! where exactly a switching lies is often of no account, and need not be paid for.

use super::frame::Frame;
use super::latent::Switching;
use super::noise::whiten;
use super::race::{Belief, Came, Race, Seen};
use crate::statistics::{count, median, robust_deviation};
use std::ops::Range;

/// Complete spells of either kind from which a rhythm can be told.
const SPELLS_MIN: usize = 4;
/// Narrowest and widest deviation of the logarithm of a duration.
const SPREAD: (f64, f64) = (0.15, 1.2);
/// Greatest deviation of the logarithm of the durations of what keeps a rhythm.
const REGULAR: f64 = 0.4;
/// Shape of a log-logistic law times the deviation of its logarithm: pi / sqrt(3).
const SHAPE: f64 = 1.813_799_364_234_217_8;
/// Ages that are told apart, in middle durations and in rows; beyond, a spell ends as it would there.
const AGES: f64 = 2.5;
/// See [`AGES`].
const AGES_MAX: usize = 160;
/// Least and greatest chance that a spell ends with a row.
const CHANCE: (f64, f64) = (1e-4, 0.95);
/// Rows of a spell that is no flicker.
pub(super) const SPELL_ROWS_MIN: usize = 4;
/// Numbers that describe a rhythm.
const PARAMETERS: f64 = 4.0;
/// Square of an innovation, in variances, beyond which a row says no more.
const SURPRISE_MAX: f64 = 25.0;

/// Rows next to each other in which it is on, or off.
pub(super) struct OnOffSpell {
    pub(super) on: bool,
    pub(super) rows: Range<usize>,
}

/// The spells of a stretch, in order.
pub(super) fn spells(state: &[f64], stretch: &Range<usize>) -> Vec<OnOffSpell> {
    let mut start = stretch.start;
    let of_rows = |rows: &[f64]| {
        let spell = OnOffSpell { on: rows[0] > 0.5, rows: start..start + rows.len() };
        start = spell.rows.end;
        spell
    };
    state[stretch.clone()].chunk_by(|a, b| a == b).map(of_rows).collect()
}

/// By state (off, on) and by the rows a spell has lasted: the chance that it ends with the next row, and how often a
/// stretch begins there.
#[derive(Debug, Clone, PartialEq)]
pub struct Rhythm {
    pub(super) ends: [Vec<f64>; 2],
    pub(super) begins: [Vec<f64>; 2],
    /// Numbers that were read from the recording to know it.
    parameters: f64,
    /// Deviation of the logarithm of the durations, of the state that keeps the rhythm less well.
    spread: f64,
}

impl Rhythm {
    /// No rhythm: a spell that is no flicker ends with this chance, however long it has lasted; a stretch begins on with the
    /// other.
    #[must_use]
    pub fn none(chance: f64, share_on: f64) -> Self {
        let [ends, begins] = [[chance; 2], [1.0 - share_on, share_on]];
        Self::without_memory(ends, begins, 0.0)
    }

    /// By state: the chance that a spell ends with a row once it is no flicker, and that a stretch begins within such a one.
    /// Without the former a single stray row costs less as two switchings than as what it is.
    fn without_memory(ends: [f64; 2], begins: [f64; 2], parameters: f64) -> Self {
        let last = |young: f64, last: f64| {
            let mut ages = vec![young; SPELL_ROWS_MIN];
            ages[SPELL_ROWS_MIN - 1] = last;
            ages
        };
        Self {
            ends: ends.map(|chance| last(CHANCE.0, chance)),
            begins: begins.map(|share| last(0.0, share)),
            parameters,
            spread: f64::INFINITY,
        }
    }

    /// No rhythm either, with the chances of a sequence.
    #[must_use]
    pub fn even(state: &[f64], stretches: &[Range<usize>]) -> Option<Self> {
        let mut turns = [0.0; 2];
        for pair in stretches.iter().flat_map(|stretch| state[stretch.clone()].windows(2)) {
            turns[usize::from(pair[0] > 0.5)] += if pair[0] == pair[1] { 0.0 } else { 1.0 };
        }
        let on = state.iter().sum::<f64>();
        let rows = [count(state.len()) - on, on];
        if rows.iter().chain(&turns).any(|number| *number < 1.0) {
            return None;
        }
        let ends = [0, 1].map(|on: usize| (turns[on] / rows[on]).clamp(CHANCE.0, CHANCE.1));
        Some(Self::without_memory(ends, rows.map(|rows| rows / count(state.len())), 2.0))
    }

    /// The rhythm of a sequence, from the spells that begin and end within a stretch; `None` where they are few.
    #[must_use]
    pub fn of(state: &[f64], stretches: &[Range<usize>]) -> Option<Self> {
        let mut lasted = [Vec::new(), Vec::new()];
        for stretch in stretches {
            let of_stretch = spells(state, stretch);
            let whole = of_stretch.len().saturating_sub(2);
            for spell in of_stretch.iter().skip(1).take(whole) {
                lasted[usize::from(spell.on)].push(count(spell.rows.len()));
            }
        }
        if lasted.iter().any(|lasted| lasted.len() < SPELLS_MIN) {
            return None;
        }
        let laws = lasted.map(|rows| Duration::of(&rows));
        let [Some(off), Some(on)] = laws else { return None };
        let ages = (AGES * off.middle.max(on.middle)).ceil().clamp(1.0, count(AGES_MAX)) as usize;
        let survival = [off, on].map(|law| (0..ages).map(|age| law.lasts(count(age))).collect::<Vec<f64>>());
        let all: f64 = survival.iter().flatten().sum();
        let begins = survival.map(|survival| survival.iter().map(|s| s / all).collect());
        let ends = [off, on].map(|law| (0..ages).map(|age| law.ends_after(count(age + 1))).collect());
        Some(Self { ends, begins, parameters: PARAMETERS, spread: off.spread.max(on.spread) })
    }

    /// Do both kinds of spell last nearly as long each time?
    #[must_use]
    pub fn is_regular(&self) -> bool {
        self.spread <= REGULAR
    }

    fn ages(&self) -> usize {
        self.ends[0].len()
    }

    /// The price, in units of information, of having chosen this sequence among all and of the rhythm itself.
    #[must_use]
    pub fn price(&self, residual: &[f64], frame: &Frame, found: &Switching) -> f64 {
        let e = whiten(&found.left(residual), &frame.stretches, found.noise);
        let whole = |rows: &Range<usize>| {
            let seen = |row: usize| Seen { x: found.levels(residual[row]), weight: frame.weight(row) };
            let along: f64 = rows.clone().map(|row| -0.5 * found.surprise(e[row], frame.weight(row))).sum();
            (along, self.followed(found, rows.clone().map(seen)).0)
        };
        let (along, all) =
            frame.stretches.iter().map(whole).fold((0.0, 0.0), |sum, next| (sum.0 + next.0, sum.1 + next.1));
        2.0 * (along - all) + self.parameters * count(found.switchings.max(2)).ln()
    }

    /// The likeliest sequence of on (1) and off (0) in one stretch.
    pub(super) fn likeliest(
        &self,
        residual: &[f64],
        frame: &Frame,
        found: &Switching,
        rows: Range<usize>,
        state: &mut [f64],
    ) {
        let mut race = Race::begin(self, found, residual[rows.start], frame.weight(rows.start));
        let mut back = vec![[Came::default(); 2]];
        back.extend((rows.start + 1..rows.end).map(|row| race.step(residual[row], frame.weight(row))));
        let mut at = race.winner();
        for (row, came) in rows.zip(back).rev() {
            state[row] = if at.0 == 1 { 1.0 } else { 0.0 };
            at = came[at.0].from(at, self.ages());
        }
    }

    /// Row by row, the chance that it is on, known from earlier rows only; before it the logarithm of the likelihood of all
    /// sequences together.
    pub(super) fn followed(&self, found: &Switching, rows: impl Iterator<Item = Seen>) -> (f64, Vec<f64>) {
        let mut belief = Belief::begin(self, found);
        let mut likelihood = 0.0;
        let told = rows.map(|row| {
            let (on, likely) = belief.step(&row);
            likelihood += likely;
            on
        });
        let told = told.collect();
        (likelihood, told)
    }
}

impl Switching {
    /// What is left of a value with the consumer off and on.
    pub(super) fn levels(&self, value: f64) -> [f64; 2] {
        [value - self.off, value - self.off - self.level]
    }

    pub(super) fn surprise(&self, e: f64, weight: f64) -> f64 {
        (e * weight / self.deviation).powi(2).min(SURPRISE_MAX)
    }
}

/// How long a spell lasts, log-logistic: its middle in rows, and the deviation of its logarithm.
#[derive(Debug, Clone, Copy)]
struct Duration {
    middle: f64,
    spread: f64,
}

impl Duration {
    fn of(spells: &[f64]) -> Option<Self> {
        let middle = median(spells.to_vec())?;
        let spread = robust_deviation(spells.iter().map(|rows| (rows / middle).ln()))?;
        Some(Self { middle, spread: spread.clamp(SPREAD.0, SPREAD.1) })
    }

    /// Chance that it lasts longer than this.
    fn lasts(self, rows: f64) -> f64 {
        1.0 / (1.0 + (rows / self.middle).powf(SHAPE / self.spread))
    }

    /// Chance that it ends with the next row after having lasted so long.
    fn ends_after(self, rows: f64) -> f64 {
        (1.0 - self.lasts(rows + 0.5) / self.lasts(rows - 0.5).max(f64::MIN_POSITIVE)).clamp(CHANCE.0, CHANCE.1)
    }
}

#[cfg(test)]
mod tests {
    use super::super::latent::{find, find_alone, price};
    use super::super::noise::{Arma, fit_near};
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const ROWS: usize = 2000;

    fn frame() -> Frame {
        Frame::one_run(ROWS)
    }

    /// On for 14 of every 38 rows, by two deviations of an innovation of noise with this memory.
    fn pump(phi: f64, seed: u64) -> (Vec<f64>, Vec<f64>) {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        let state: Vec<f64> = (0..ROWS).map(|row| if row % 38 < 14 { 1.0 } else { 0.0 }).collect();
        let mut slow = 0.0;
        let mut next = |on: &f64| {
            let e: f64 = StandardNormal.sample(&mut rng);
            slow = phi * slow + e;
            slow + 2.0 * on
        };
        (state.iter().map(&mut next).collect(), state)
    }

    #[test]
    fn a_rhythm_shows_a_pump_that_switches_too_often_to_pay_for() {
        let (residual, state) = pump(0.3, 9);
        let noise = fit_near(&residual, &frame(), Arma::WHITE).1;
        assert!(find(&residual, &frame(), noise).is_none());
        let found = find_alone(&residual, &frame(), noise).expect("a switch");
        let right = found.state.iter().zip(&state).filter(|(found, true_state)| found == true_state).count();
        assert!(right > 1800 && (found.level - 2.0).abs() < 0.4, "{right} rows, level {}", found.level);
        let told = Rhythm::of(&found.state, &frame().stretches).expect("a rhythm");
        let even = Rhythm::even(&found.state, &frame().stretches).expect("chances");
        let price = |rhythm: &Rhythm| {
            let told = Switching { rhythm: Some(rhythm.clone()), ..found.clone() };
            price(&told, &residual, &frame())
        };
        assert!(price(&told) < price(&even), "what is regular is cheaper");
    }

    #[test]
    fn a_spell_ends_about_when_it_always_has() {
        let state = pump(0.0, 1).1;
        let rhythm = Rhythm::of(&state, &frame().stretches).expect("a rhythm");
        let [off, on] = &rhythm.ends;
        assert!(on[6] < 0.05 && on[13] > 0.3, "{on:?}");
        assert!(off[12] < 0.05 && off[23] > 0.2, "{off:?}");
    }

    #[test]
    fn of_few_spells_no_rhythm_is_told() {
        let state: Vec<f64> = (0..ROWS).map(|row| if row / 400 % 2 == 1 { 1.0 } else { 0.0 }).collect();
        assert_eq!(Rhythm::of(&state, &frame().stretches), None);
        assert!(Rhythm::even(&state, &frame().stretches).is_some());
        assert_eq!(Rhythm::even(&vec![0.0; ROWS], &frame().stretches), None);
    }
}
