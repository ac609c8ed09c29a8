//! `cnc-gateway diagnose`: where model and recordings differ, which physics was left out, the model with it.

use super::{CannotRun, CommandOutcome, CommandResult};
use crate::diagnosis::{DiagnosisOutputs, InputRecordings, read_hypotheses, read_model, read_recordings};
use clap::Args;
use rules::physics::explain::Language;
use rules::twin::{self, Diagnosis, Model};
use std::path::PathBuf;

/// Arguments of `diagnose`.
#[derive(Debug, Args)]
pub(super) struct DiagnoseArguments {
    /// What the simulation believes (model/1).
    #[arg(long, value_name = "M.toml")]
    model: PathBuf,
    /// Recordings (recording/1): .csv, .csv.gz, .parquet, or history:DB?from=..&to=..; several are put together, and
    /// their runs stay distinct.
    #[arg(long, value_name = "R.csv", num_args = 1.., required = true)]
    recording: Vec<String>,
    /// Write the diagnosis as JSON (diagnosis/1); without a path, or with -, to standard output in place of the words.
    #[arg(long, value_name = "D.json", num_args = 0..=1, default_missing_value = "-")]
    json: Option<PathBuf>,
    /// Write the diagnosis as one self-contained page.
    #[arg(long, value_name = "D.html")]
    html: Option<PathBuf>,
    /// Write recorded and simulated output and each added effect, row by row.
    #[arg(long, value_name = "D.csv")]
    rows: Option<PathBuf>,
    /// Write the extended, refitted model.
    #[arg(long, value_name = "NEW.toml")]
    accept: Option<PathBuf>,
    /// Seed by which runs are held out: the same input and seed give the same bytes.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Directory of further hypotheses: .toml files with [[effect]] entries.
    #[arg(long, value_name = "DIR")]
    effects_dir: Option<PathBuf>,
    /// Write the experiment that tells the explanations apart as a recording plan.
    #[arg(long, value_name = "PLAN.csv")]
    experiment: Option<PathBuf>,
    /// Tell the leading explanations with their probabilities on standard error.
    #[arg(long)]
    search: bool,
    /// Language of the words, the page and the plan.
    #[arg(long, value_enum, default_value_t = super::effects::Lang::En)]
    lang: super::effects::Lang,
}

/// Reads, examines, compares, writes.
pub(super) fn diagnose(arguments: DiagnoseArguments) -> CommandResult {
    let (model, given) = inputs(&arguments)?;
    given.warnings.iter().for_each(|warning| eprintln!("{warning}"));
    let examination = twin::examine(&given.recording, &model);
    let mut unusable = examination.unusable;
    unusable.extend(outputs(&arguments).trouble());
    if !unusable.is_empty() {
        return Err(cannot_use(&unusable));
    }
    examination.notes.iter().for_each(|note| eprintln!("note: {note}"));
    let found = twin::diagnose(&given.recording, &model, arguments.seed);
    let mut diagnosis = found.map_err(|all| cannot_use(&all))?;
    note_refusals(&mut diagnosis, &given);
    if arguments.search {
        eprintln!("{}", diagnosis.debug);
    }
    outputs(&arguments).write(&diagnosis, &given.recording).map_err(|problem| CannotRun::new(problem, ""))?;
    Ok(CommandOutcome::Fine)
}

/// Model, hypotheses and recordings; every problem of all of them at once.
fn inputs(arguments: &DiagnoseArguments) -> Result<(Model, InputRecordings), CannotRun> {
    let mut problems = Vec::new();
    let model = read_model(&arguments.model).map_err(|wrong| problems.extend(wrong));
    let hypotheses = arguments.effects_dir.as_ref().map_or(Ok(Vec::new()), |directory| read_hypotheses(directory));
    let hypotheses = hypotheses.map_err(|wrong| problems.extend(wrong));
    let given = read_recordings(&arguments.recording).map_err(|wrong| problems.extend(wrong));
    match (model, hypotheses, given) {
        (Ok(model), Ok(hypotheses), Ok(given)) => Ok((Model { hypotheses, ..model }, given)),
        _ => Err(cannot_use(&problems)),
    }
}

pub(super) fn cannot_use(problems: &[String]) -> CannotRun {
    CannotRun::new(format!("the input cannot be used:\n{}", problems.join("\n")), "")
}

/// Rows that were refused while reading belong to the quality of the recording.
fn note_refusals(diagnosis: &mut Diagnosis, given: &InputRecordings) {
    if given.refused > 0 {
        let column = given.refused_column.clone().unwrap_or_else(|| "time_s".to_owned());
        diagnosis.data_quality.push(twin::quality::Fault { fault: "refused_rows", column, rows: given.refused });
    }
}

fn outputs(arguments: &DiagnoseArguments) -> DiagnosisOutputs {
    DiagnosisOutputs {
        json: arguments.json.clone(),
        html: arguments.html.clone(),
        rows: arguments.rows.clone(),
        accept: arguments.accept.clone(),
        experiment: arguments.experiment.clone(),
        language: Language::from(arguments.lang),
    }
}
