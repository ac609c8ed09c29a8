//! What is missing, by evidence: estimate first, name second, decide once.
//!
//! 1. The model is refitted by plain least squares; from then on the simulation stands still (`fit.rs`).
//! 2. Every family of laws, named by the catalogue or nameless, is columns in one bank (`variant_bank.rs`, `families/`).
//! 3. One Gram matrix for each likely noise, a Schur complement away from every hypothesis (`gram.rs`, `noise.rs`).
//! 4. The evidence of a set of variants is a Schur complement of it, all sizes summed out (`marginal.rs`, `search.rs`),
//!    first for the forms as they are, then for the leading ones with their form widened (`second_stage.rs`), beside hidden
//!    switches (`hidden_sequence.rs`).
//! 5. A nameless curve that is the curve of a named law gets its name (`naming.rs`).
//! 6. Whether anything is there is one test (`existence.rs`). One rule decides what is told of it (`thresholds.rs`,
//!    `validation.rs`, `naming_decision.rs`): probabilities averaged over resamples (`resampling.rs`), better on inner
//!    parts of the fitted rows; rows that are held out only withdraw.
//! 7. The names are written as a file: laws beside the refitted model (`written_law.rs`, `written_model.rs`), without those that it does not
//!    need (`needless_names.rs`), compared with their rivals (`written_rivals.rs`). What the file leaves is searched once more
//!    (`beside_written.rs`).
//! 8. The file gives parameters, texts and the experiment (`report.rs`).

mod answer;
mod beside_written;
mod contributions;
mod cross_validation;
mod existence;
mod families;
mod gram;
mod hidden_sequence;
mod inputs;
mod latent_law;
mod law_starts;
mod leave_out;
mod linear_algebra;
mod marginal;
mod naming;
mod naming_decision;
mod needless_names;
mod noise;
mod noise_settings;
mod outliers;
mod posterior;
mod posterior_means;
mod recursive_least_squares;
mod remainder;
mod report;
mod resampling;
mod search;
mod second_stage;
mod settled_parameters;
mod spectral_line;
mod step_search;
mod textbook;
mod thresholds;
mod unrecorded_states;
mod validation;
mod variant_bank;
mod variant_evidence;
mod written_law;
mod written_model;
mod written_rivals;

use super::diagnosis::{Diagnosis, Experiment, Rows, Verdict, find_output_unit};
use super::fit::{Fit, Metric, fit_parts};
use super::model::{Model, Part};
use super::prepared_recording::Case;
use super::summary;
use adapter_core::bilingual::Bilingual;
use answer::EvidenceAnswer;
use existence::test_existence;
use gram::{Comparison, ComparisonInput};
use inputs::RecordingInputs;
use naming::Naming;
use noise::NoiseModel;
use noise_settings::{NoiseSettings, select_noise_settings};
use outliers::{Outliers, detect_outliers};
use posterior::{NoiseSetting, rank_explanations};
use recording::Recording;
use search::{SetEvidence, SetSearch, compute_ln_priors};
use second_stage::SecondStage;
use std::cell::OnceCell;
use unrecorded_states::Residuals;
use validation::Judge;

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
pub fn diagnose_recording(recording: &Recording, model: &Model, seed: u64) -> Result<Diagnosis, Vec<String>> {
    let mut case = Case::new(recording, model, seed)?;
    if let Some(needed) = case.describe_missing_data(ROWS_MIN) {
        return Ok(build_undecided_diagnosis(&case, &needed));
    }
    let parts = case.parts.clone();
    let diagnosis = search_missing(&mut case, &parts, model, |case, found| {
        let report = report::EvidenceReport {
            recording,
            case,
            inputs: found.inputs,
            baseline: found.baseline,
            answer: found.answer,
            comparison: found.comparison,
            noise: found.noise,
            recorded: &found.outliers.recorded,
            ordinary: found.outliers.ordinary,
            baseline_square: OnceCell::new(),
        };
        report.into_diagnosis()
    });
    Ok(diagnosis.unwrap_or_else(|| {
        let needed = Bilingual::new("a model that can be fitted to this recording", "能对此记录拟合的模型");
        build_undecided_diagnosis(&case, &needed)
    }))
}

/// What a search has found beside some parts, and what it was found in.
struct Found<'a> {
    inputs: &'a RecordingInputs<'a>,
    /// The parts as they were fitted without what is missing.
    baseline: &'a Fit,
    comparison: &'a Comparison<'a>,
    outliers: &'a Outliers,
    answer: EvidenceAnswer,
    noise: NoiseModel,
}

/// Searches what is missing beside some parts, and tells it; `None` where the parts cannot be fitted to the recording.
fn search_missing<'m, T>(
    case: &mut Case<'m>,
    parts: &[Part],
    model: &Model,
    tell: impl FnOnce(&mut Case<'m>, Found<'_>) -> T,
) -> Option<T> {
    let fitted = case.list_fitted_rows();
    let recorded = case.scene.recorded_output().to_vec();
    let weigh = |column: &[f64]| -> Vec<f64> { fitted.iter().map(|row| column[*row]).collect() };
    let mut scene = case.scene.clone();
    let metric = Metric { recorded: &recorded, weigh: &weigh, has_bounds: false };
    let baseline = fit_parts(&mut scene, parts, &metric)?;
    let (units, held) = (case.units.clone(), case.held.clone());
    let inputs = RecordingInputs::new(&scene, &units, &held, mark_comparable_rows(&scene, &baseline));
    let bank = families::build_bank(&inputs, model);
    let mut outliers = detect_outliers(&inputs, &bank, &baseline.tangents);
    outliers.dither_exact_output(&inputs);
    let compared =
        ComparisonInput { tangents: &baseline.tangents, recorded: &outliers.recorded, scale: &outliers.scale };
    let first = Comparison::new(&inputs, &bank, &compared, ROWS_MAX);
    let (answer, noise) = infer_answer(&inputs, &first, &compared, &baseline, &outliers);
    let found = Found { inputs: &inputs, baseline: &baseline, comparison: &first, outliers: &outliers, answer, noise };
    Some(tell(case, found))
}

/// The diagnosis of a recording that does not suffice.
fn build_undecided_diagnosis(case: &Case<'_>, needed: &Bilingual) -> Diagnosis {
    Diagnosis {
        output: case.model.output.clone(),
        unit: find_output_unit(&case.model.output).to_owned(),
        verdict: Verdict::CannotTell,
        summary: summary::describe_needs(needed),
        existence: None,
        fit: None,
        mismatch: Vec::new(),
        missing: Vec::new(),
        alternatives: Vec::new(),
        baseline_shift: Vec::new(),
        data_quality: case.faults.clone(),
        remainder: Vec::new(),
        next_experiment: Some(Experiment {
            statement: format!("Record {needed}."),
            statement_zh: None,
            minutes: 10.0,
            effect: String::new(),
        }),
        rows: Rows::default(),
        model: case.model.clone(),
        debug: String::new(),
    }
}

/// Rows with a recorded output, every input of the model and finite tangents.
fn mark_comparable_rows(scene: &physics::Scene, baseline: &Fit) -> Vec<bool> {
    let finite =
        |row: usize| baseline.tangents.iter().all(|t| t[row].is_finite()) && baseline.simulated[row].is_finite();
    (0..scene.rows()).map(|row| scene.usable_rows()[row] && finite(row)).collect()
}

/// Both stages, the test, the names and the decision; and the likeliest noise.
fn infer_answer(
    inputs: &RecordingInputs<'_>,
    first: &Comparison<'_>,
    compared: &ComparisonInput<'_>,
    baseline: &Fit,
    outliers: &Outliers,
) -> (EvidenceAnswer, NoiseModel) {
    let bank = first.bank;
    let noises = select_noise_settings(inputs, first, &outliers.left);
    let own = compute_ln_priors(bank);
    let (found, prepared) = search_first_stage(first, &noises, &own);
    let mut second = SecondStage::from_first_stage(inputs, bank, &own, &found);
    let residuals = Residuals { inputs, comparison: first, setting: &prepared[0], scale: &outliers.scale };
    let slow = noises.leading.last().copied().unwrap_or(NoiseModel::WHITE);
    residuals.add_states(&found, slow, &mut second);
    let wide = Comparison::new(inputs, &second.bank, compared, ROWS_MAX);
    let settings: Vec<NoiseSetting> = noises
        .likely
        .iter()
        .map(|noise| {
            let known = prepared.iter().find(|setting| setting.gram.noise == *noise);
            let saturated = known.map_or_else(|| noises.find_saturated_model(*noise), |known| known.saturated);
            NoiseSetting::new(&wide, wide.compute_gram(*noise), saturated)
        })
        .collect();
    let search = SetSearch { comparison: &wide, priors: &second.priors, beam: BEAMS.1 };
    let mut found = SetEvidence::new();
    for setting in settings.iter().filter(|setting| noises.leading.contains(&setting.gram.noise)) {
        merge_set_evidence(&mut found, search.search_sets(&setting.ground, setting.ln));
    }
    let plain = first.compute_gram(NoiseModel::WHITE);
    let metric = &prepared[0].gram;
    let naming = Naming::new(first, &[metric, &plain]);
    let all = rank_explanations(&search, &settings, &found, &second, &naming);
    let best = all.first();
    let left = best.map_or_else(Vec::new, |best| wide.compute_residual(&settings[best.noise], &best.members));
    let of = prepared.iter().find(|setting| best.is_some_and(|b| setting.gram.noise == settings[b.noise].gram.noise));
    let of = of.unwrap_or(&prepared[0]);
    let named = best.filter(|best| !best.members.is_empty());
    let over_nothing = named.map_or(f64::NEG_INFINITY, |best| best.over_nothing);
    let test = test_existence(first, (&of.gram, of.saturated), &own, &left, over_nothing);
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
        first_stage: (first, metric),
        test,
    };
    let answer = judge.decide_answer(&all);
    let noise = settings[answer.noise].gram.noise;
    (answer, noise)
}

/// The search among forms as they are, for the leading noises.
fn search_first_stage(
    first: &Comparison<'_>,
    noises: &NoiseSettings,
    priors: &[f64],
) -> (SetEvidence, Vec<NoiseSetting>) {
    let mut found = SetEvidence::new();
    let mut prepared = Vec::new();
    for noise in &noises.leading {
        let gram = first.compute_gram(*noise);
        let setting = NoiseSetting::new(first, gram, noises.find_saturated_model(*noise));
        let search = SetSearch { comparison: first, priors, beam: BEAMS.0 };
        merge_set_evidence(&mut found, search.search_sets(&setting.ground, setting.ln));
        prepared.push(setting);
    }
    (found, prepared)
}

fn merge_set_evidence(into: &mut SetEvidence, from: SetEvidence) {
    for (members, ln) in from {
        let known = into.entry(members).or_insert(f64::NEG_INFINITY);
        *known = known.max(ln);
    }
}

#[cfg(test)]
mod tests;
