//! `cnc-gateway diagnose`: where model and recordings differ, which physics was left out, the model with it.

use super::lang::{language, localize_text, pick_text};
use super::{CannotRun, CommandOutcome, CommandResult};
use crate::diagnosis::context::DiagnosisContext;
use crate::diagnosis::series::{SimulatedSeries, attach_series, recorded_output, series_model};
use crate::diagnosis::series_alignment::AlignBy;
use crate::diagnosis::{
    Copies, DiagnosisOutputs, InputRecordings, read_hypotheses, read_model, read_recordings_as, stretch,
};
use adapters::recording::Recording;
use clap::Args;
use rules::twin::{self, Diagnosis, Model};
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct DiagnoseArguments {
    /// What the simulation believes (model/1).
    #[arg(long, value_name = "M.toml", required_unless_present = "simulated")]
    model: Option<PathBuf>,
    /// Recordings: CSV in any writing, Excel, OpenDocument, LabVIEW, MATLAB, Parquet, MTConnect, or history:DB?from=..&to=..; several are put
    /// together, and their runs stay distinct.
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
    /// A simulation that you already have, as a series of the output: CSV, Excel, Parquet, MAT of a simulation tool, and the column in it. Its error as
    /// given and as refitted stand side by side; without --model it is the model.
    #[arg(long, value_name = "FILE[:COLUMN]")]
    simulated: Option<String>,
    /// How the series is laid beside the recording.
    #[arg(long, value_enum, default_value_t = AlignBy::Auto, value_name = "HOW", requires = "simulated")]
    align: AlignBy,
    /// The map under which the recordings are read (map/1); without it the one beside each file, FILE.map.toml.
    #[arg(long, value_name = "MAP.toml")]
    map: Option<PathBuf>,
}

/// Reads, examines, compares, writes.
pub(super) fn diagnose_recordings(arguments: DiagnoseArguments) -> CommandResult {
    let (model, given) = read_inputs(&arguments)?;
    let (given, long) = thin_input(given, arguments.rows.is_some());
    given.warnings.iter().for_each(|warning| eprintln!("{}", localize_text(warning)));
    let examination = twin::examine_recording(&given.recording, &model);
    let mut unusable = examination.unusable;
    unusable.extend(collect_outputs(&arguments).find_unwritable_files());
    let context = DiagnosisContext::from_recording(&given.recording, &model, given.warnings.clone());
    if !unusable.is_empty() {
        // What the file may have under another name, or in another unit, is the likeliest cure.
        unusable.extend(context.doubts.iter().map(|doubt| localize_text(&doubt.text).to_owned()));
        return Err(cannot_use(&unusable));
    }
    examination.notes.iter().for_each(|note| eprintln!("{}{note}", pick_text("note: ", "提示：")));
    let found = twin::diagnose_recording(&given.recording, &model, arguments.seed);
    let mut diagnosis = found.map_err(|all| cannot_use(&all))?;
    note_refusals(&mut diagnosis, &given);
    let context = context.with_diagnosis(&model, &diagnosis);
    if arguments.search {
        eprintln!("{}", diagnosis.debug);
    }
    let mut outputs = collect_outputs(&arguments);
    if let Some(LongInput { whole, rows }) = long {
        outputs
            .write_rows(&diagnosis.rows.expand_rows(&rows, whole.count_rows()), &diagnosis, &whole)
            .map_err(CannotRun::from_error)?;
        outputs.rows = None;
    }
    outputs.write(&diagnosis, &given.recording, &context).map_err(CannotRun::from_error)?;
    Ok(CommandOutcome::Fine)
}

/// A recording of which not every row is compared, where every row is to be written.
struct LongInput {
    whole: Recording,
    /// The rows that are compared.
    rows: Vec<usize>,
}

/// Of a long recording the rows that are compared; the whole is kept only where its rows are to be written.
fn thin_input(mut given: InputRecordings, writes_rows: bool) -> (InputRecordings, Option<LongInput>) {
    let Some(thinned) = twin::thin_recording(&given.recording) else { return (given, None) };
    given.warnings.push(thinned.describe_thinning(given.recording.count_rows()));
    let whole = std::mem::replace(&mut given.recording, thinned.recording);
    (given, writes_rows.then_some(LongInput { whole, rows: thinned.rows }))
}

/// Model, hypotheses and recordings; every problem of all of them at once.
fn read_inputs(arguments: &DiagnoseArguments) -> Result<(Model, InputRecordings), CannotRun> {
    let mut problems: Vec<String> = Vec::new();
    let model =
        arguments.model.as_ref().map(|path| read_model(path)).transpose().map_err(|wrong| problems.extend(wrong));
    let hypotheses = arguments.effects_dir.as_ref().map_or(Ok(Vec::new()), |directory| read_hypotheses(directory));
    let hypotheses = hypotheses.map_err(|wrong| problems.extend(wrong));
    let given = read_recordings_as(&arguments.recording, arguments.map.as_ref(), Copies::CountOnce);
    let given = given.map_err(|wrong| problems.extend(wrong.iter().map(|problem| localize_text(problem).to_owned())));
    let (Ok(model), Ok(hypotheses), Ok(mut given)) = (model, hypotheses, given) else {
        return Err(cannot_use(&problems));
    };
    if let Some(model) = &model
        && arguments.recording.iter().all(|source| source.starts_with("history:"))
    {
        given.recording = stretch::of_history(given.recording, &model.output);
    }
    let (model, given) = with_series(arguments, model, given)?;
    Ok((Model { hypotheses, ..model }, given))
}

/// The series that is given becomes a column; without a model it is the model.
fn with_series(
    arguments: &DiagnoseArguments,
    model: Option<Model>,
    mut given: InputRecordings,
) -> Result<(Model, InputRecordings), CannotRun> {
    let Some(text) = &arguments.simulated else {
        return model
            .map(|model| (model, given))
            .ok_or_else(|| CannotRun::new("no model", "give --model or --simulated"));
    };
    let series = SimulatedSeries::from_text(text, arguments.align);
    let output =
        model.as_ref().map(|model| model.output.clone()).or_else(|| recorded_output(&given.recording, &series));
    let Some(output) = output else {
        let en = "which recorded quantity does the series simulate? Give --model with an output, or record spindle_power_w, axis_current_a or such";
        return Err(CannotRun::new(
            pick_text(en, "仿真序列对应哪个实测量？请用--model指定output，或记录spindle_power_w、axis_current_a等"),
            "",
        ));
    };
    let attached = attach_series(&given.recording, &output, &series, None).map_err(|all| cannot_use_as(&all))?;
    given.recording = attached.recording;
    given.warnings.extend(attached.remarks);
    let model = match model {
        Some(model) => model,
        None => series_model(&output).map_err(|wrong| cannot_use(&wrong))?,
    };
    Ok((model, given))
}

pub(super) fn cannot_use(problems: &[String]) -> CannotRun {
    let head = pick_text("the input cannot be used:", "输入无法使用：");
    CannotRun::new(format!("{head}\n{}", problems.join("\n")), "")
}

pub(super) fn cannot_use_as(problems: &[adapters::bilingual::Bilingual]) -> CannotRun {
    cannot_use(&problems.iter().map(|problem| localize_text(problem).to_owned()).collect::<Vec<_>>())
}

/// Rows that were refused while reading belong to the quality of the recording.
fn note_refusals(diagnosis: &mut Diagnosis, given: &InputRecordings) {
    if given.refused > 0 {
        let column = given.refused_column.clone().unwrap_or_else(|| "time_s".to_owned());
        diagnosis.data_quality.push(twin::quality::Fault {
            kind: twin::quality::FaultKind::RefusedRows,
            column,
            rows: given.refused,
        });
    }
}

fn collect_outputs(arguments: &DiagnoseArguments) -> DiagnosisOutputs {
    DiagnosisOutputs {
        json: arguments.json.clone(),
        html: arguments.html.clone(),
        rows: arguments.rows.clone(),
        accept: arguments.accept.clone(),
        experiment: arguments.experiment.clone(),
        language: language(),
    }
}
