//! A consumer that goes on and off unseen: its two levels and when it switches are read from what a fit leaves over.
//!
//! The most likely sequence of two levels (Viterbi) with a price per switching; levels and sequence are found in turn.
//! A drift is no switch: both levels must be far apart for their scatter, and it must have switched often enough.

use crate::statistics::{count, median};
use std::ops::Range;

/// Switchings that must be seen, counted over all runs.
const SWITCHINGS_MIN: usize = 4;
/// Distance of the levels over the scatter of the means of their spells (Ashman's D) below which there are not two: a
/// drift or a slow process has spells at any level.
const SEPARATION_MIN: f64 = 3.0;
/// Spells that each level must have.
const SPELLS_MIN: usize = 3;
/// Rounds of levels and sequence in turn.
const ROUNDS: usize = 6;

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
}

/// Finds the switch in a residual with these unbroken stretches, if there is one.
#[must_use]
pub fn find(residual: &[f64], stretches: &[Range<usize>]) -> Option<Switching> {
    let scatter = local_scatter(residual, stretches)?;
    let (mut low, mut high) = first_levels(residual, stretches)?;
    let mut state = Vec::new();
    for _ in 0..ROUNDS {
        state = sequence(residual, stretches, (low, high), scatter);
        let mean = |wanted: f64| {
            let chosen = || residual.iter().zip(&state).filter(|(_, state)| **state == wanted).map(|(x, _)| *x);
            let rows = chosen().count();
            (rows > 0).then(|| chosen().sum::<f64>() / count(rows))
        };
        (low, high) = (mean(0.0)?, mean(1.0)?);
    }
    let switchings = stretches.iter().map(|rows| state[rows.clone()].windows(2).filter(|p| p[0] != p[1]).count()).sum();
    let found = Switching { off: low, level: high - low, switchings, state };
    (switchings >= SWITCHINGS_MIN && separated(residual, stretches, &found)).then_some(found)
}

/// The same switch in another residual.
#[must_use]
pub fn again(residual: &[f64], stretches: &[Range<usize>], found: &Switching) -> Switching {
    let scatter = local_scatter(residual, stretches).unwrap_or(found.level.abs());
    Switching { state: sequence(residual, stretches, (found.off, found.off + found.level), scatter), ..found.clone() }
}

/// The price, in units of information, of having chosen when to switch.
#[must_use]
pub fn price(switching: &Switching) -> f64 {
    let rows = count(switching.state.len());
    let switchings = count(switching.switchings).max(1.0);
    2.0 * switchings * (rows / switchings).ln() + 2.0 * switchings
}

/// Scatter from row to row: half the slow changes do not enter.
fn local_scatter(residual: &[f64], stretches: &[Range<usize>]) -> Option<f64> {
    let steps = stretches.iter().flat_map(|rows| residual[rows.clone()].windows(2).map(|p| (p[1] - p[0]).abs()));
    let scatter = 1.4826 * median(steps.collect())? / std::f64::consts::SQRT_2;
    (scatter > 0.0).then_some(scatter)
}

/// Two levels to start from: quarter and three-quarter points of the residual smoothed over five rows.
fn first_levels(residual: &[f64], stretches: &[Range<usize>]) -> Option<(f64, f64)> {
    let mut smooth: Vec<f64> = stretches
        .iter()
        .flat_map(|rows| residual[rows.clone()].windows(5).map(|window| window.iter().sum::<f64>() / 5.0))
        .collect();
    smooth.sort_by(f64::total_cmp);
    // The best cut in two by the sum of squares (Otsu), so that a rare state is not missed.
    let total: f64 = smooth.iter().sum();
    let mut left = 0.0;
    let mut best = (0.0, None);
    for index in 1..smooth.len() {
        left += smooth[index - 1];
        let (below, above) = (count(index), count(smooth.len() - index));
        let (low, high) = (left / below, (total - left) / above);
        let between = below * above * (high - low) * (high - low);
        if between > best.0 {
            best = (between, Some((low, high)));
        }
    }
    best.1
}

/// The most likely sequence of the two levels.
fn sequence(residual: &[f64], stretches: &[Range<usize>], levels: (f64, f64), scatter: f64) -> Vec<f64> {
    let mut state = vec![0.0; residual.len()];
    let price = 3.0 * count(residual.len().max(2)).ln();
    let cost = |x: f64, level: f64| ((x - level) / scatter).powi(2).min(25.0);
    for rows in stretches {
        let mut back = Vec::with_capacity(rows.len());
        let (mut off, mut on) = (0.0_f64, 0.0_f64);
        for row in rows.clone() {
            let (from_off, from_on) = (on + price < off, off + price < on);
            back.push((from_off, from_on));
            let (best_off, best_on) = (off.min(on + price), on.min(off + price));
            off = best_off + cost(residual[row], levels.0);
            on = best_on + cost(residual[row], levels.1);
        }
        let mut is_on = on < off;
        for (index, row) in rows.clone().enumerate().rev() {
            state[row] = if is_on { 1.0 } else { 0.0 };
            let (off_came_from_on, on_came_from_off) = back[index];
            is_on = if is_on { !on_came_from_off } else { off_came_from_on };
        }
    }
    state
}

fn separated(residual: &[f64], stretches: &[Range<usize>], found: &Switching) -> bool {
    let mut means: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
    for rows in stretches {
        let mut start = rows.start;
        for row in rows.start + 1..=rows.end {
            if row == rows.end || found.state[row] != found.state[start] {
                let mean = residual[start..row].iter().sum::<f64>() / count(row - start);
                means[usize::from(found.state[start] > 0.5)].push(mean);
                start = row;
            }
        }
    }
    let level = [found.off, found.off + found.level];
    let spread =
        |index: usize| 1.4826 * median(means[index].iter().map(|m| (m - level[index]).abs()).collect()).unwrap_or(0.0);
    let enough = means.iter().all(|means| means.len() >= SPELLS_MIN);
    enough && std::f64::consts::SQRT_2 * found.level > SEPARATION_MIN * spread(0).hypot(spread(1))
}

/// The chance, row by row and from earlier rows of the stretch only, that the switch is on.
#[must_use]
pub fn follow(residual: &[f64], found: &Switching, deviation: f64, share_on: f64) -> Vec<f64> {
    let stay = 0.97;
    let mut on = share_on;
    residual
        .iter()
        .map(|x| {
            let now = on;
            let weight = |level: f64| (-0.5 * ((x - level) / deviation).powi(2).min(50.0)).exp();
            let (yes, no) = (now * weight(found.off + found.level), (1.0 - now) * weight(found.off));
            let posterior = if yes + no > 0.0 { yes / (yes + no) } else { now };
            on = posterior * stay + (1.0 - posterior) * (1.0 - stay);
            now
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    fn noise(rows: usize, seed: u64) -> Vec<f64> {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        (0..rows).map(|_| StandardNormal.sample(&mut rng)).collect()
    }

    #[test]
    fn a_pump_is_found_with_its_level() {
        let mut residual = noise(1000, 3);
        residual.iter_mut().enumerate().for_each(|(row, x)| *x += if row / 60 % 2 == 1 { 4.0 } else { 0.0 });
        let all = std::iter::once(0..1000).collect::<Vec<_>>();
        let found = find(&residual, &all).expect("a switch");
        assert!((found.level - 4.0).abs() < 0.3 && found.switchings == 16, "{} {}", found.level, found.switchings);
    }

    #[test]
    fn noise_and_a_drift_are_no_pump() {
        let all = std::iter::once(0..1000).collect::<Vec<_>>();
        assert_eq!(find(&noise(1000, 4), &all), None);
        let drift: Vec<f64> = noise(1000, 5).iter().enumerate().map(|(row, x)| x + 0.006 * count(row)).collect();
        assert_eq!(find(&drift, &all), None);
    }
}
