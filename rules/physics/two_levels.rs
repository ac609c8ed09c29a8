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
            if row > run.start {
                // The chain forgets towards its shares, in proportion to the time that has passed.
                let kept = (-2.0 * scene.driven_s(row) / levels.dwell_s).exp();
                on = levels.share + (on - levels.share) * kept;
            }
            predicted[row] = on;
            if scene.usable_rows()[row] && left[row].is_finite() {
                on = learn_from_row(on, before, left[row], levels);
                before = Some(left[row]);
            } else {
                before = None;
            }
        }
    }
    predicted
}

/// Probability of being on after a row has been seen; the level of the row before counts as the likelier one.
fn learn_from_row(on: f64, before: Option<f64>, left: f64, levels: TwoLevels) -> f64 {
    let deviation = levels.deviation.max(f64::MIN_POSITIVE);
    let was = if on > 0.5 { levels.step } else { 0.0 };
    let noise = before.map_or(0.0, |before| levels.memory * (before - was));
    let square = |level: f64| (((left - level - noise) / deviation).clamp(-FARTHEST, FARTHEST)).powi(2);
    let odds = (0.5 * (square(0.0) - square(levels.step))).exp();
    let (for_on, for_off) = (on * odds, 1.0 - on);
    if for_on + for_off > 0.0 { for_on / (for_on + for_off) } else { on }
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
}
