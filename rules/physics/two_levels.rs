//! Something that is on or off and that nobody records, followed through a recording from earlier rows.
//!
//! A hidden Markov chain of two levels behind noise with a memory from row to row (Hamilton, Econometrica 57, 1989): in each row
//! the probability of being on is predicted from the row before, and only then learns from what is recorded there.

use super::Scene;

/// Deviations beyond which a row says no more: one spike is no switch.
const FARTHEST: f64 = 5.0;

/// What switches, and the noise that it is seen through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoLevels {
    /// What it adds while it is on, in the unit of the output.
    pub step: f64,
    /// Deviation of what is new in the noise of a row, in the same unit.
    pub deviation: f64,
    /// Share of the noise of the row before that stays.
    pub memory: f64,
    /// Mean time in one level, s.
    pub dwell_s: f64,
    /// Share of the time in which it is on.
    pub share: f64,
}

/// Probability of being on in each row, from the earlier rows of its run; `left` is what everything else leaves of the output.
#[must_use]
pub fn predict_on_probability(scene: &Scene, left: &[f64], levels: TwoLevels) -> Vec<f64> {
    let mut predicted = vec![levels.share; scene.rows()];
    for run in scene.runs() {
        let mut on = levels.share;
        let mut before: Option<f64> = None;
        for row in run.clone() {
            // The chain forgets towards its shares, in proportion to the time that has passed.
            let kept = if row > run.start { (-2.0 * scene.driven_s(row) / levels.dwell_s).exp() } else { 0.0 };
            predicted[row] = levels.share + (on - levels.share) * kept;
            if scene.usable_rows()[row] && left[row].is_finite() {
                on = levels.learn_from_row(on, kept, before, left[row]);
                before = Some(left[row]);
            } else {
                on = predicted[row];
                before = None;
            }
        }
    }
    predicted
}

impl TwoLevels {
    /// Probability of being on in a row once it has been seen; `was_on` is that of the row before, whose level the noise of this row
    /// remembers: both levels then and both levels now are weighed together.
    fn learn_from_row(&self, was_on: f64, kept: f64, before: Option<f64>, left: f64) -> f64 {
        let deviation = self.deviation.max(f64::MIN_POSITIVE);
        let ln = |level: f64, level_before: f64| {
            let noise = before.map_or(0.0, |before| self.memory * (before - level_before));
            -0.5 * (((left - level - noise) / deviation).clamp(-FARTHEST, FARTHEST)).powi(2)
        };
        let (mut for_on, mut for_off) = (0.0, 0.0);
        for (chance, level_before) in [(was_on, self.step), (1.0 - was_on, 0.0)] {
            let stays = f64::from(u8::from(level_before != 0.0));
            let turns_on = self.share + (stays - self.share) * kept;
            for_on += chance * turns_on * ln(self.step, level_before).exp();
            for_off += chance * (1.0 - turns_on) * ln(0.0, level_before).exp();
        }
        if for_on + for_off > 0.0 { for_on / (for_on + for_off) } else { self.share + (was_on - self.share) * kept }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::read_csv;
    use std::collections::BTreeMap;
    use std::fmt::Write;

    const PUMP: TwoLevels = TwoLevels { step: 100.0, deviation: 5.0, memory: 0.0, dwell_s: 20.0, share: 0.5 };

    fn is_on(row: u32) -> bool {
        row / 20 % 2 == 1
    }

    fn predict(rows_from: u32, spoilt: f64) -> Vec<f64> {
        let mut text = String::from("time_s,total_power_w\n");
        for row in 0..200_u32 {
            let left = if is_on(row) { 100.0 } else { 0.0 } + 4.0 * (f64::from(row) * 2.1).sin();
            writeln!(text, "{row},{}", if row >= rows_from { spoilt } else { left }).expect("a string takes it");
        }
        let recording = read_csv(text.as_bytes(), "t.csv").expect("readable").recording;
        let scene = Scene::new(&recording, "total_power_w", &BTreeMap::new()).expect("recorded");
        predict_on_probability(&scene, scene.recorded_output(), PUMP)
    }

    #[test]
    fn a_level_is_known_one_row_after_it_has_changed() {
        let on = predict(200, 0.0);
        let known = |row: &u32| (on[*row as usize] > 0.5) == is_on(*row);
        assert!((1..200).filter(|row| row % 20 != 0).all(|row| known(&row)), "{on:?}");
        assert!((20..200).step_by(20).all(|row| !known(&row)), "no row knows its own change before it is seen");
    }

    #[test]
    fn later_rows_do_not_change_what_was_predicted() {
        assert_eq!(predict(200, 0.0)[..=150], predict(150, 5000.0)[..=150]);
    }

    #[test]
    fn a_wrong_belief_is_left_behind_noise_with_a_memory() {
        // Believed to be off while it is on: the memory of the noise explains most of the level, row after row.
        let levels = TwoLevels { step: 100.0, deviation: 40.0, memory: 0.6, dwell_s: 160.0, share: 0.5 };
        let kept = (-2.0_f64 / 160.0).exp();
        let mut on = 0.02;
        for _ in 0..20 {
            on = levels.learn_from_row(on, kept, Some(100.0), 100.0);
        }
        assert!(on > 0.9, "{on}");
    }
}
