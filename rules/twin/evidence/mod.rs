//! What is missing, by evidence: estimate first, name second, decide once.
//!
//! 1. The model is refitted by plain least squares; from then on the simulation stands still (`fit.rs`).
//! 2. Every family of laws, named by the catalogue or nameless, is columns in one bank (`bank.rs`, `families/`).
//! 3. One Gram matrix for each likely noise, a Schur complement away from every hypothesis (`gram.rs`, `noise.rs`).
//! 4. The evidence of a set of variants is a Schur complement of it, all sizes summed out (`marginal.rs`, `search.rs`),
//!    first for the forms as they are, then for the leading ones with their form widened (`second.rs`), beside hidden
//!    switches (`hidden.rs`).
//! 5. A nameless curve that is the curve of a named law gets its name (`naming.rs`).
//! 6. Whether anything is there is one test (`existence.rs`). One rule decides what is told of it (`decision.rs`,
//!    `judge.rs`, `verdict.rs`): probabilities averaged over resamples (`bag.rs`), better on inner parts of the fitted rows; rows that are
//!    held out only withdraw.
//! 7. The nearest textbook law gives parameters, texts and the experiment (`told.rs`).

mod algebra;
mod answer;
mod asked;
mod bag;
mod bank;
mod contributions;
mod decision;
mod existence;
mod families;
mod follow;
mod gram;
mod hidden;
mod inner;
mod inputs;
mod judge;
mod marginal;
mod means;
mod naming;
mod noise;
mod outliers;
mod posterior;
mod search;
mod second;
mod settings;
mod states;
mod step;
mod textbook;
mod told;
mod verdict;
mod wave;

use super::case::Case;
use super::diagnosis::{Diagnosis, Experiment, Rows, Verdict, unit_of};
use super::fit::{Fit, Metric, fit};
use super::model::Model;
use super::words;
use adapters::Recording;
use adapters::bilingual::Bilingual;
use answer::EvidenceAnswer;
use existence::existence;
use gram::{Comparison, ComparisonInput};
use inputs::RecordingInputs;
use judge::Judge;
use naming::Naming;
use noise::NoiseModel;
use outliers::{Outliers, outliers};
use posterior::{NoiseSetting, explanations};
use search::{SetEvidence, SetSearch, priors};
use second::SecondStage;
use settings::{NoiseSettings, settings};
use states::Residuals;

/// Rows below which nothing is claimed: the verdict is `cannot_tell`.
const ROWS_MIN: usize = 40;
/// Rows that are compared one by one; of more, neighbours are averaged. Twice as many cost twice the time; half as many lose
/// delays of a few rows.
const ROWS_MAX: usize = 4000;
/// Sets that are followed in the first and in the second stage.
const BEAMS: (usize, usize) = (5, 6);

/// Compares a model with a recording; `seed` chooses what is held out.
///
/// # Errors
/// Everything that makes the input unusable, with what to record instead.
pub fn diagnose(recording: &Recording, model: &Model, seed: u64) -> Result<Diagnosis, Vec<String>> {
    let mut case = Case::new(recording, model, seed)?;
    if let Some(needed) = case.too_little(ROWS_MIN) {
        return Ok(cannot_tell(&case, &needed));
    }
    let fitted = case.fitted();
    let recorded = case.scene.recorded_output().to_vec();
    let weigh = |column: &[f64]| -> Vec<f64> { fitted.iter().map(|row| column[*row]).collect() };
    let parts = case.parts.clone();
    let mut scene = case.scene.clone();
    let metric = Metric { recorded: &recorded, weigh: &weigh, bounded: false };
    let Some(baseline) = fit(&mut scene, &parts, &metric) else {
        let needed = Bilingual::new("a model that can be fitted to this recording", "能对此记录拟合的模型");
        return Ok(cannot_tell(&case, &needed));
    };
    let inputs = RecordingInputs::new(&scene, &case.units, &case.held, comparable(&scene, &baseline));
    let bank = families::bank(&inputs, model);
    let outliers = outliers(&inputs, &bank, &baseline.tangents);
    let compared =
        ComparisonInput { tangents: &baseline.tangents, recorded: &outliers.recorded, scale: &outliers.scale };
    let first = Comparison::new(&inputs, &bank, &compared, ROWS_MAX);
    let (answer, noise) = answer(&inputs, &first, &compared, &baseline, &outliers);
    let report = told::EvidenceReport {
        recording,
        case: &mut case,
        inputs: &inputs,
        baseline: &baseline,
        answer,
        comparison: &first,
        noise,
        recorded: &outliers.recorded,
        ordinary: outliers.ordinary,
    };
    Ok(report.diagnosis())
}

/// The diagnosis of a recording that does not suffice.
fn cannot_tell(case: &Case<'_>, needed: &Bilingual) -> Diagnosis {
    Diagnosis {
        output: case.model.output.clone(),
        unit: unit_of(&case.model.output).to_owned(),
        verdict: Verdict::CannotTell,
        summary: words::needs(needed),
        existence: None,
        fit: None,
        mismatch: Vec::new(),
        missing: Vec::new(),
        alternatives: Vec::new(),
        baseline_shift: Vec::new(),
        data_quality: case.faults.clone(),
        next_experiment: Some(Experiment {
            statement: format!("Record {needed}."),
            minutes: 10.0,
            expected_delta_ic: 0.0,
            effect: String::new(),
        }),
        rows: Rows::default(),
        model: case.model.clone(),
        debug: String::new(),
    }
}

/// Rows with a recorded output, every input of the model and finite tangents.
fn comparable(scene: &physics::Scene, baseline: &Fit) -> Vec<bool> {
    let finite =
        |row: usize| baseline.tangents.iter().all(|t| t[row].is_finite()) && baseline.simulated[row].is_finite();
    (0..scene.rows()).map(|row| scene.usable_rows()[row] && finite(row)).collect()
}

/// Both stages, the test, the names and the decision; and the likeliest noise.
fn answer(
    inputs: &RecordingInputs<'_>,
    first: &Comparison<'_>,
    compared: &ComparisonInput<'_>,
    baseline: &Fit,
    outliers: &Outliers,
) -> (EvidenceAnswer, NoiseModel) {
    let bank = first.bank;
    let noises = settings(inputs, first, &outliers.left);
    let own = priors(bank);
    let (found, prepared) = first_stage(first, &noises, &own);
    let mut second = SecondStage::of(inputs, bank, &own, &found);
    let residuals = Residuals { inputs, comparison: first, setting: &prepared[0], scale: &outliers.scale };
    let slow = noises.leading.last().copied().unwrap_or(NoiseModel::WHITE);
    residuals.add_states(&found, slow, &mut second);
    let wide = Comparison::new(inputs, &second.bank, compared, ROWS_MAX);
    let settings: Vec<NoiseSetting> = noises
        .likely
        .iter()
        .map(|noise| {
            let known = prepared.iter().find(|setting| setting.gram.noise == *noise);
            let saturated = known.map_or_else(|| noises.saturated(*noise), |known| known.saturated);
            NoiseSetting::new(&wide, wide.gram(*noise), saturated)
        })
        .collect();
    let search = SetSearch { comparison: &wide, priors: &second.priors, beam: BEAMS.1 };
    let mut found = SetEvidence::new();
    for setting in settings.iter().filter(|setting| noises.leading.contains(&setting.gram.noise)) {
        merge(&mut found, search.run(&setting.ground, setting.ln));
    }
    let plain = first.gram(NoiseModel::WHITE);
    let metric = &prepared[0].gram;
    let naming = Naming::new(first, &[metric, &plain]);
    let all = explanations(&search, &settings, &found, &second, &naming);
    let best = all.first();
    let left = best.map_or_else(Vec::new, |best| wide.left_by(&settings[best.noise], &best.members));
    let of = prepared.iter().find(|setting| best.is_some_and(|b| setting.gram.noise == settings[b.noise].gram.noise));
    let of = of.unwrap_or(&prepared[0]);
    let named = best.filter(|best| !best.members.is_empty());
    let over_nothing = named.map_or(f64::NEG_INFINITY, |best| best.over_nothing);
    let test = existence(first, (&of.gram, of.saturated), &own, &left, over_nothing);
    let judge = Judge {
        inputs,
        comparison: &wide,
        second: &second,
        settings: &settings,
        naming: &naming,
        recorded: &outliers.recorded,
        tangents: &baseline.tangents,
        scale: &outliers.scale,
        ordinary: outliers.ordinary,
        first: (first, metric),
        test,
    };
    let answer = judge.answer(&all);
    let noise = settings[answer.noise].gram.noise;
    (answer, noise)
}

/// The search among forms as they are, for the leading noises.
fn first_stage(first: &Comparison<'_>, noises: &NoiseSettings, priors: &[f64]) -> (SetEvidence, Vec<NoiseSetting>) {
    let mut found = SetEvidence::new();
    let mut prepared = Vec::new();
    for noise in &noises.leading {
        let gram = first.gram(*noise);
        let setting = NoiseSetting::new(first, gram, noises.saturated(*noise));
        let search = SetSearch { comparison: first, priors, beam: BEAMS.0 };
        merge(&mut found, search.run(&setting.ground, setting.ln));
        prepared.push(setting);
    }
    (found, prepared)
}

fn merge(into: &mut SetEvidence, from: SetEvidence) {
    for (members, ln) in from {
        let known = into.entry(members).or_insert(f64::NEG_INFINITY);
        *known = known.max(ln);
    }
}

#[cfg(test)]
mod tests;
