//! Is it a consumer? What switches at the same place of every pass is the process, and what recovers after each step, or
//! grows until the next, has more than two levels.

use super::frame::Frame;
use super::latent::{SWITCHINGS_MIN, Switching};
use crate::statistics::{count, mean};
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

impl Switching {
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
        for row in (1..self.state.len()).filter(|row| self.state[*row] != self.state[*row - 1]) {
            if let Some(value) = channel[row] {
                switchings[edges.partition_point(|edge| *edge <= value)] += 1;
            }
        }
        let here: usize = switchings.iter().sum();
        switchings.sort_unstable_by(|a, b| b.cmp(a));
        here >= SWITCHINGS_TOLD && 2 * here >= self.switchings && 2 * (switchings[0] + switchings[1]) > here
    }

    /// Does it stay at its two levels? What recovers after each step, or grows until the next, is no consumer.
    #[must_use]
    pub fn is_flat(&self, residual: &[f64], frame: &Frame) -> bool {
        [1.0, 0.0].into_iter().all(|level| {
            let changes = self.changes_within_spells(residual, frame, level);
            let spells = count(changes.len());
            let mean = mean(&changes);
            let variance = changes.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (spells - 1.0).max(1.0);
            let deviate = mean.abs() / (variance / spells.max(1.0)).sqrt().max(f64::MIN_POSITIVE);
            changes.len() < SPELLS_TOLD || deviate < SLOPE_DEVIATE || mean.abs() < SLOPE_SHARE * self.level
        })
    }

    /// Last third less first third of every spell at a level that is long enough.
    fn changes_within_spells(&self, residual: &[f64], frame: &Frame, level: f64) -> Vec<f64> {
        let mut changes = Vec::new();
        for stretch in &frame.stretches {
            let mut start = stretch.start;
            for spell in self.state[stretch.clone()].chunk_by(|a, b| a == b) {
                // The rows at either end may be on for a part.
                let inner = start + 1..(start + spell.len()).saturating_sub(1);
                start += spell.len();
                if spell[0] == level && inner.len() >= 3 * THIRD_ROWS_MIN {
                    let third = inner.len() / 3;
                    let level = |rows: Range<usize>| mean(&residual[rows]);
                    changes.push(level(inner.end - third..inner.end) - level(inner.start..inner.start + third));
                }
            }
        }
        changes
    }
}

#[cfg(test)]
mod tests {
    use super::super::frame::units;
    use super::super::noise::Arma;
    use super::*;
    use crate::physics::Scene;
    use adapters::Recording;
    use adapters::recording::{Cells, Numbers};

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
        let mut recording = Recording::new("test", (0..ROWS).map(count).collect(), None);
        recording.set_column("spindle_power_w", Cells::Numbers(Numbers::full(vec![1.0; ROWS])));
        let scene = Scene::new(&recording, "spindle_power_w", &Default::default()).expect("a scene");
        Frame::new(&scene, &units(&scene), 1, |_| true)
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
}
