//! Held-out runs: predicted with parameters of the other runs only. A hidden state (which lot, a pump on or off, how
//! worn this tool is) is followed through a held-out run from that run's own earlier rows.

use super::frame::{Frame, Unit};
use super::model::{Part, PartFunction, simulate};
use super::noise::Arma;
use crate::physics::{Form, Scene};
use crate::statistics::count;
use std::collections::{BTreeMap, BTreeSet};

/// What a set of parts says about every row, and what each of its effects adds.
#[derive(Debug, Clone)]
pub struct Prediction {
    /// Simulated output per row.
    pub total: Vec<f64>,
    /// Contribution of each part per row.
    pub contributions: Vec<Vec<f64>>,
}

/// Simulates every row; hidden states of `parts[first..]` are followed causally through the held-out units.
#[must_use]
pub fn predict(
    scene: &mut Scene,
    parts: &[Part],
    first: usize,
    units: &[Unit],
    held: &BTreeSet<usize>,
    noise: HoldoutNoise,
) -> Option<Prediction> {
    let simulated = simulate(parts, scene)?;
    let mut prediction = Prediction { total: simulated.total, contributions: simulated.contributions };
    for index in first..parts.len() {
        if follows_state(&parts[index]) {
            follow(scene, parts, index, units, held, noise, &mut prediction);
        } else if is_of_recorded_lots(&parts[index]) {
            // Rows of a lot that no fitted run has.
            let _ = follow_new_lots(scene, &parts[index], index, units, held, noise, &mut prediction);
        }
    }
    Some(prediction)
}

/// The noise against which a state is followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HoldoutNoise {
    /// Its memory.
    pub arma: Arma,
    /// Standard deviation of a row.
    pub deviation: f64,
}

/// Steps and stretches of runs: whether a held-out run beside an edge lies before or after it must be followed.
fn follows_state(part: &Part) -> bool {
    match &part.body {
        PartFunction::Effect(effect, form) => {
            effect.has_hidden_state()
                && form.name != "stretches"
                && form.place.as_ref().is_some_and(|(column, _)| column == "run")
        }
        _ => false,
    }
}

fn follow(
    scene: &Scene,
    parts: &[Part],
    index: usize,
    units: &[Unit],
    held: &BTreeSet<usize>,
    noise: HoldoutNoise,
    prediction: &mut Prediction,
) {
    let Some(column) = unit_contribution(scene, &parts[index]) else { return };
    let present: Vec<bool> =
        units.iter().map(|unit| unit.rows.clone().any(|row| prediction.contributions[index][row] != 0.0)).collect();
    let beside = |unit: usize| {
        // A held-out run between a training run with the state and one without it.
        let before = (0..unit).rev().find(|unit| !held.contains(unit));
        let after = (unit + 1..units.len()).find(|unit| !held.contains(unit));
        held.contains(&unit) && before.zip(after).is_some_and(|(before, after)| present[before] != present[after])
    };
    for unit in (0..units.len()).filter(|unit| beside(*unit)) {
        follow_unit(scene, &column, index, units[unit].rows.clone(), noise, prediction);
    }
}

/// The contribution the part would have in every row were its state present.
fn unit_contribution(scene: &Scene, part: &Part) -> Option<Vec<f64>> {
    let mut always = part.clone();
    let first = scene.run_names().first()?.clone();
    if let PartFunction::Effect(_, form) = &mut always.body {
        form.place = Some(("run".to_owned(), first));
    }
    always.contribution(scene)
}

/// Is it another hardness in lots that are written down?
fn is_of_recorded_lots(part: &Part) -> bool {
    match &part.body {
        PartFunction::Effect(effect, form) => {
            effect.doc().kind == "hardness_batch" && ["lot", "lots"].contains(&form.name)
        }
        _ => false,
    }
}

/// The gain of a lot that no fitted run has, in each held-out run from its earlier rows: normal before any row is seen,
/// with the mean and the spread of the gains of the known lots.
fn follow_new_lots(
    scene: &Scene,
    part: &Part,
    index: usize,
    units: &[Unit],
    held: &BTreeSet<usize>,
    noise: HoldoutNoise,
    prediction: &mut Prediction,
) -> Option<()> {
    let lots = scene.words("lot")?;
    let fitted = (0..units.len()).filter(|unit| !held.contains(unit)).flat_map(|unit| units[unit].rows.clone());
    let known: BTreeSet<&str> = fitted.filter_map(|row| lots.get(row)).collect();
    let first = scene.run_names().first()?.clone();
    let always = Form { name: "step", place: Some(("run".to_owned(), first)), ..Form::default() };
    let (_, cut) = part.effect_and_form()?.0.columns(scene, &always)?.pop()?;
    let gains: Vec<f64> = part.parameters.iter().map(|gain| gain.value).collect();
    let lots_known = count(known.len().max(2));
    let mean = gains.iter().sum::<f64>() / lots_known;
    let spread = (gains.iter().map(|gain| gain * gain).sum::<f64>() / lots_known - mean * mean).max(f64::MIN_POSITIVE);
    let weight = noise.deviation * noise.deviation * noise.arma.inflation() / spread;
    for unit in held {
        let mut seen: BTreeMap<&str, (f64, f64)> = BTreeMap::new();
        for row in units[*unit].rows.clone() {
            let Some(lot) = lots.get(row).filter(|lot| !known.contains(lot)) else { continue };
            let (xy, xx) = seen.entry(lot).or_insert((mean * weight, weight));
            let without = prediction.total[row] - prediction.contributions[index][row];
            let expected = *xy / xx.max(f64::MIN_POSITIVE) * cut[row];
            prediction.contributions[index][row] = expected;
            prediction.total[row] = without + expected;
            if scene.usable()[row] {
                *xy += cut[row] * (scene.recorded()[row] - without);
                *xx += cut[row] * cut[row];
            }
        }
    }
    Some(())
}

/// Forward filter over two states, absent or present, with even odds at the start of the run.
fn follow_unit(
    scene: &Scene,
    present: &[f64],
    index: usize,
    rows: std::ops::Range<usize>,
    noise: HoldoutNoise,
    prediction: &mut Prediction,
) {
    let variance = (noise.deviation * noise.deviation * noise.arma.inflation()).max(f64::MIN_POSITIVE);
    let mut log_odds: f64 = 0.0;
    for row in rows {
        let probability = 1.0 / (1.0 + (-log_odds).exp());
        let before = prediction.contributions[index][row];
        let without = prediction.total[row] - before;
        let expected = probability * present[row];
        prediction.contributions[index][row] = expected;
        prediction.total[row] = without + expected;
        if scene.usable()[row] {
            let error = scene.recorded()[row] - without;
            let gain = (error * error - (error - present[row]).powi(2)) / (2.0 * variance);
            log_odds = (log_odds + gain).clamp(-20.0, 20.0);
        }
    }
}

/// Root mean square of recorded minus predicted over a frame; `None` for no rows.
#[must_use]
pub fn rmse(scene: &Scene, frame: &Frame, total: &[f64]) -> Option<f64> {
    let mut sum = 0.0;
    let mut rows = 0;
    for row in (0..frame.len()).flat_map(|group| frame.rows(group)) {
        sum += (scene.recorded()[row] - total[row]).powi(2);
        rows += 1;
    }
    (rows > 0).then(|| (sum / count(rows)).sqrt())
}
