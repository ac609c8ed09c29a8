//! Is it a consumer? What flickers is noise; what switches with the pace, in the cut only, or at the same place of every
//! pass, is the process; what does not step is a drift or a spike; and what recovers after each step, or grows until the
//! next, has more than two levels.

use super::frame::Frame;
use super::latent::{SWITCHINGS_MIN, Switching};
use super::rhythm::{SPELL_ROWS_MIN, spells};
use crate::statistics::{count, mean, median};
use std::ops::Range;

/// Places of a channel at which switchings are counted, and how many must be seen there.
const PLACES: usize = 10;
const SWITCHINGS_TOLD: usize = 8;
/// Spells that tell whether they are flat, rows of a third of one, and what counts as a slope: in deviations, and as a
/// share of the level.
const SPELLS_TOLD: usize = 5;
const THIRD_ROWS_MIN: usize = 3;
const SLOPE_DEVIATE: f64 = 4.0;
const SLOPE_SHARE: f64 = 0.4;
/// Share of switchings at a change of pace, of those that are not there by chance, beyond which it is the machine's own
/// doing.
const OWN_DOING: f64 = 0.6;
/// Chance that so many switchings, or more, are at one place, below which they are not there by chance.
const BY_CHANCE_MAX: f64 = 0.02;
/// By how much its share of the cut and that of the rest may differ.
const SHARES_APART_MAX: f64 = 0.35;
/// Share of spells that may be flicker.
const SHORT_SPELLS_MAX: f64 = 0.25;
/// Rows on either side of a switching by which its step is measured, and how many there must be.
const BESIDE_ROWS: usize = 5;
const BESIDE_ROWS_MIN: usize = 3;
/// Switchings that must be seen within a run, and their share of all.
const STEPS_MIN: usize = 2;
const STEPS_SHARE_MIN: f64 = 0.3;
/// What the middle one of these must step by, in levels.
const STEP: std::ops::RangeInclusive<f64> = 0.5..=1.8;

impl Switching {
    /// Does it stay as it is for a while? What flickers from row to row is noise with two faces.
    #[must_use]
    pub fn stays(&self) -> bool {
        let spells = spells(&self.state, &(0..self.state.len()));
        let short = spells.iter().filter(|spell| spell.rows.len() < SPELL_ROWS_MIN).count();
        count(short) <= SHORT_SPELLS_MAX * count(spells.len())
    }

    /// Does it switch by itself? Not where it switches with the pace only, nor where it is on in the cut and off out of
    /// it or the other way round. `since_change` says of each row how many rows lie between it and a change of pace nearby,
    /// `cut` whether it is cut.
    #[must_use]
    pub fn by_itself(&self, since_change: &[Option<isize>], cut: &[bool]) -> bool {
        let share = |wanted: bool| {
            let of: Vec<f64> =
                self.state.iter().zip(cut).filter(|(_, cut)| **cut == wanted).map(|(on, _)| *on).collect();
            (!of.is_empty()).then(|| of.iter().sum::<f64>() / count(of.len()))
        };
        let apart = share(true).zip(share(false)).map_or(0.0, |(cut, rest)| (cut - rest).abs());
        !self.with_the_pace(since_change) && apart <= SHARES_APART_MAX
    }

    /// Does it switch where the pace changes, more often than by chance and as long after it each time? What cannot be told
    /// to a row is drawn to changes of pace as well, but to either side of them.
    fn with_the_pace(&self, since_change: &[Option<isize>]) -> bool {
        let at: Vec<Option<isize>> = self.rows_of_switchings().map(|row| since_change[row]).collect();
        // Of rows: how many are at a change, or so long after one.
        let some = |of: &[Option<isize>], since: Option<isize>| {
            of.iter().filter(|at| at.is_some() && (since.is_none() || **at == since)).count()
        };
        let share = |of: &[Option<isize>], since: Option<isize>| count(some(of, since)) / count(of.len());
        let chance = |since| at_least(some(&at, since), at.len(), share(since_change, since));
        let mut lags: Vec<isize> = at.iter().copied().flatten().collect();
        lags.sort_unstable();
        lags.dedup();
        let as_long_after = lags.iter().any(|lag| count(lags.len()) * chance(Some(*lag)) < BY_CHANCE_MAX);
        let by_chance = share(since_change, None);
        let apart = share(&at, None) - by_chance > OWN_DOING * (1.0 - by_chance);
        apart && chance(None) < BY_CHANCE_MAX && as_long_after
    }

    fn rows_of_switchings(&self) -> impl Iterator<Item = usize> + '_ {
        (1..self.state.len()).filter(|row| self.state[*row] != self.state[*row - 1])
    }

    /// Does it switch at certain places of something that the process goes through again and again, such as the position
    /// of an axis or the time in the cut? `channel` holds its value where it has one.
    #[must_use]
    pub fn follows(&self, channel: &[Option<f64>]) -> bool {
        let mut sorted: Vec<f64> = channel.iter().copied().flatten().collect();
        sorted.sort_by(f64::total_cmp);
        if sorted.len() < PLACES * SWITCHINGS_MIN {
            return false;
        }
        let edges: Vec<f64> = (1..PLACES).map(|place| sorted[place * sorted.len() / PLACES]).collect();
        let mut switchings = [0_usize; PLACES];
        for row in self.rows_of_switchings() {
            if let Some(value) = channel[row] {
                switchings[edges.partition_point(|edge| *edge <= value)] += 1;
            }
        }
        let here: usize = switchings.iter().sum();
        switchings.sort_unstable_by(|a, b| b.cmp(a));
        let together = switchings[0] + switchings[1];
        // The two places were chosen among all.
        let pairs = count(PLACES * (PLACES - 1) / 2);
        let by_chance = pairs * at_least(together, here, 2.0 / count(PLACES)) > BY_CHANCE_MAX;
        here >= SWITCHINGS_TOLD && 2 * here >= self.switchings && 2 * together > here && !by_chance
    }

    /// Does it stay at its two levels? What recovers after each step, or grows until the next, is no consumer.
    #[must_use]
    pub fn is_flat(&self, residual: &[f64], frame: &Frame) -> bool {
        [true, false].into_iter().all(|on| {
            let changes = self.changes_within_spells(residual, frame, on);
            let spells = count(changes.len());
            let mean = mean(&changes);
            let variance = changes.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (spells - 1.0).max(1.0);
            let deviate = mean.abs() / (variance / spells.max(1.0)).sqrt().max(f64::MIN_POSITIVE);
            changes.len() < SPELLS_TOLD || deviate < SLOPE_DEVIATE || mean.abs() < SLOPE_SHARE * self.level
        })
    }

    /// Last third less first third of every spell on or off that is long enough.
    fn changes_within_spells(&self, residual: &[f64], frame: &Frame, on: bool) -> Vec<f64> {
        let mut changes = Vec::new();
        for spell in frame.stretches.iter().flat_map(|stretch| spells(&self.state, stretch)) {
            // The rows at either end may be on for a part.
            let inner = spell.rows.start + 1..spell.rows.end.saturating_sub(1);
            if spell.on == on && inner.len() >= 3 * THIRD_ROWS_MIN {
                let third = inner.len() / 3;
                let level = |rows: Range<usize>| mean(&residual[rows]);
                changes.push(level(inner.end - third..inner.end) - level(inner.start..inner.start + third));
            }
        }
        changes
    }

    /// Does the residual step by the level where it switches, and stay there? A consumer does; what wanders does not, nor
    /// does a spike, nor what is one level in one run and another in the next.
    #[must_use]
    pub fn steps(&self, residual: &[f64], frame: &Frame) -> bool {
        let mut steps = Vec::new();
        let turn = |row: usize| self.state[row] - self.state[row - 1];
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
        let enough = steps.len() >= STEPS_MIN && count(steps.len()) >= STEPS_SHARE_MIN * count(self.switchings);
        enough && median(steps).is_some_and(|step| STEP.contains(&(step / self.level)))
    }
}

/// Chance of so many or more, of all, each with the same chance: the upper tail of the binomial.
fn at_least(some: usize, all: usize, chance: f64) -> f64 {
    // The terms one from another, from none on.
    let odds = chance / (1.0 - chance).max(f64::MIN_POSITIVE);
    let next = |(k, term): (usize, f64)| (k + 1, term * odds * count(all - k) / count(k + 1));
    let none = (0, (1.0 - chance).powf(count(all)));
    let terms = std::iter::successors(Some(none), |term| (term.0 < all).then(|| next(*term)));
    terms.filter(|(k, _)| *k >= some).map(|(_, term)| term).sum()
}

#[cfg(test)]
mod tests {
    use super::super::noise::Arma;
    use super::*;

    const ROWS: usize = 1200;

    /// On for half of every so many rows.
    fn switching(rows: usize) -> Switching {
        let state: Vec<f64> = (0..ROWS).map(|row| if 2 * (row % rows) >= rows { 1.0 } else { 0.0 }).collect();
        let switchings = state.windows(2).filter(|pair| pair[0] != pair[1]).count();
        Switching {
            state,
            switchings,
            off: 0.0,
            level: 1.0,
            noise: Arma::WHITE,
            deviation: 0.1,
            rhythm: None,
            price: 0.0,
        }
    }

    fn frame() -> Frame {
        Frame::one_run(ROWS)
    }

    #[test]
    fn what_switches_at_the_same_place_of_every_pass_follows_it() {
        let place = |row: usize| (row % 40 < 30).then(|| count(row % 40));
        let passes: Vec<Option<f64>> = (0..ROWS).map(place).collect();
        assert!(switching(40).follows(&passes), "twenty rows into every pass");
        assert!(!switching(94).follows(&passes), "whenever it likes");
    }

    #[test]
    fn what_recovers_after_every_step_is_not_flat() {
        let found = switching(80);
        let pump: Vec<f64> =
            found.state.iter().enumerate().map(|(row, on)| on + 0.1 * (count(row) * 1.7).sin()).collect();
        let saw: Vec<f64> =
            (0..ROWS).map(|row| count((row + 40) % 80) / 40.0 + 0.1 * (count(row) * 1.7).sin()).collect();
        assert!(found.is_flat(&pump, &frame()));
        assert!(!found.is_flat(&saw, &frame()));
    }

    /// On for sixty of every hundred and twenty rows, by one, in a little of something else.
    fn pump() -> (Switching, Vec<f64>) {
        let found = switching(120);
        let residual = found.state.iter().enumerate().map(|(row, on)| on + 0.1 * (count(row) * 1.7).sin()).collect();
        (found, residual)
    }

    #[test]
    fn a_spike_is_no_step() {
        let (found, pump) = pump();
        let spikes: Vec<f64> = (0..ROWS).map(|row| if row % 60 == 0 { 1.0 } else { 0.0 }).collect();
        assert!(found.steps(&pump, &frame()) && !found.steps(&spikes, &frame()));
    }

    #[test]
    fn nine_of_ten_at_even_chances_are_no_chance() {
        assert!((at_least(9, 10, 0.5) - 11.0 / 1024.0).abs() < 1e-12);
        assert!((at_least(0, 10, 0.3) - 1.0).abs() < 1e-12 && at_least(10, 10, 1.0).is_finite());
    }

    #[test]
    fn what_flickers_is_no_consumer() {
        let mut found = switching(120);
        assert!(found.stays());
        (0..ROWS).step_by(20).for_each(|row| found.state[row] = 1.0 - found.state[row]);
        assert!(!found.stays());
    }

    #[test]
    fn what_switches_with_the_machine_is_no_switch_of_its_own() {
        let found = switching(120);
        let since = |rows: usize, within: isize| -> Vec<Option<isize>> {
            (0..ROWS).map(|row| Some((row % rows) as isize).filter(|since| *since < within)).collect()
        };
        let cut: Vec<bool> = (0..ROWS).map(|row| row % 50 > 25).collect();
        assert!(!found.by_itself(&since(60, 5), &cut));
        assert!(!found.by_itself(&since(170, 5), &found.state.iter().map(|on| *on > 0.5).collect::<Vec<bool>>()));
        assert!(found.by_itself(&since(170, 5), &cut));
    }

    #[test]
    fn what_switches_now_before_and_now_after_a_change_of_pace_switches_by_itself() {
        let found = switching(120);
        let to_either_side: Vec<Option<isize>> = (0..ROWS as isize)
            .map(|row| Some((row % 60 + row / 60 % 7) % 10 - 3).filter(|since| (-3..=3).contains(since)))
            .collect();
        let cut: Vec<bool> = (0..ROWS).map(|row| row % 50 > 25).collect();
        assert!(found.by_itself(&to_either_side, &cut));
    }
}
