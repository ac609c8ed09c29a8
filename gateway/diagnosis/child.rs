//! The child process in which a diagnosis is made. It takes minutes and as much memory as the stretch is long, so it can be ended
//! at any moment, and whatever happens to it, the gateway goes on.
//!
//! The gateway writes one line, the [`DiagnosisJob`], and holds the pipe open: the child ends when the pipe does, so that nothing is left
//! behind by a gateway that was killed. The child answers with a line for every stage and one with the outcome, each a [`ChildMessage`].

use super::beside::{BesideModel, Onset, beside_model, compose_headline};
use super::context::DiagnosisContext;
use super::order::Copies;
use super::preview::{self, PreviewJob};
use super::recordings::read_recordings_as;
use super::series::{SimulatedSeries, attach_series, recorded_output, series_model};
use super::store::DiagnosisStore;
use super::{outputs, stretch};
use crate::series_alignment::AlignBy;
use adapter_core::bilingual::Bilingual;
use adapter_core::clock::{SECOND_NS, TimeNs};
use gateway_history as history;
use recording::Recording;
use rules::twin::diagnosis::Verdict;
use rules::twin::{self, Model, parse_model};
use serde::{Deserialize, Serialize};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::PathBuf;

/// A tenth of the claim to the processor that everything else has; with less, a busy box would never finish.
const NICE: i32 = 10;
/// Seed of the resampling: the same stretch and model give the same diagnosis.
const SEED: u64 = 1;
/// The longest line that is read: a diagnosis as JSON is some ten kilobytes.
const LINE_MAX: u64 = 16 << 20;
/// What is to be diagnosed.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct DiagnosisJob {
    /// The model, `model/1`; empty: the simulated series alone.
    pub toml: String,
    /// What is compared with it.
    pub input: JobInput,
    /// Where report, plan and model are kept.
    pub kept: PathBuf,
}

/// What a diagnosis is made of.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobInput {
    /// A stretch of the history.
    Stretch {
        /// Path of the database, which is only read.
        history: PathBuf,
        /// Beginning of the stretch.
        from_ns: TimeNs,
        /// End of the stretch.
        to_ns: TimeNs,
        /// Since when the watch sees which kinds of work differ.
        onsets: Vec<Onset>,
    },
    /// A file, read under the map beside it.
    File {
        /// Path of the recording; its map lies beside it.
        path: PathBuf,
        /// A simulated series, `FILE:COLUMN`.
        simulated: Option<String>,
        /// When it was asked for.
        at_ns: TimeNs,
    },
}

/// How far it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Until what was just measured is in the history.
    Waiting,
    /// The stretch is read.
    Reading,
    /// The model is fitted and every effect of the catalogue is tried.
    Comparing,
    /// Report, plan and model are written.
    Writing,
}

/// One line of the child.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ChildMessage {
    /// It goes on, with so many rows of a second where that is known.
    Stage(Stage, usize),
    /// It is done: the row of the history (its time is for the tick to fill in) and what is missing.
    Finished(Box<history::Diagnosis>, Vec<String>),
    /// It cannot be done, for these reasons.
    Refused(String),
}

/// What a child may be asked for.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged)]
pub enum ChildJob {
    /// What a recording says about a model, by the twin.
    Diagnosis(Box<DiagnosisJob>),
    /// How a file is understood.
    Preview(PreviewJob),
}

/// Every line of the child until it ends or says the outcome.
pub fn read_messages(output: impl Read, mut said: impl FnMut(ChildMessage)) {
    let mut lines = BufReader::new(output.take(LINE_MAX)).lines();
    while let Some(Ok(line)) = lines.next() {
        if let Ok(it) = serde_json::from_str(&line) {
            said(it);
        }
    }
}

/// The child itself: reads its job, says how it goes, ends when its parent does.
///
/// # Errors
/// There is no job to be read.
pub fn run() -> std::io::Result<()> {
    let _refused = rustix::process::nice(NICE);
    let mut line = String::new();
    let mut input = BufReader::new(std::io::stdin().take(LINE_MAX));
    input.read_line(&mut line)?;
    let job: ChildJob = serde_json::from_str(&line)?;
    std::thread::Builder::new().name("parent".to_owned()).spawn(move || {
        let _until_it_is_gone = std::io::copy(&mut input, &mut std::io::sink());
        std::process::exit(2);
    })?;
    let job = match job {
        ChildJob::Preview(job) => return preview::run_job(&job),
        ChildJob::Diagnosis(job) => job,
    };
    if matches!(job.input, JobInput::File { .. }) {
        gateway_base::limits::limit_memory();
    }
    let outcome = run_job(&job)
        .map_or_else(ChildMessage::Refused, |(row, missing)| ChildMessage::Finished(Box::new(row), missing));
    write_message(&outcome)
}

fn write_message(said: &ChildMessage) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}", serde_json::to_string(said)?)?;
    out.flush()
}

/// What is compared: model, recording, and what is known of how it was read.
struct Compared {
    model: Model,
    recording: Recording,
    reading: Vec<Bilingual>,
    from_ns: TimeNs,
    to_ns: TimeNs,
}

fn read_input(job: &DiagnosisJob) -> Result<Compared, String> {
    let parsed = |text: &str| {
        parse_model(text).map_err(|problems| problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))
    };
    match &job.input {
        JobInput::Stretch { history, from_ns, to_ns, .. } => {
            let model = parsed(&job.toml)?;
            let recording = stretch::read(history, *from_ns, *to_ns, &model.output).map_err(|it| it.to_string())?;
            if recording.count_rows() == 0 {
                return Err("the history holds no sample of this time; choose another one".to_owned());
            }
            let from_ns = begin_ns(&recording).unwrap_or(*from_ns);
            Ok(Compared { model, recording, reading: Vec::new(), from_ns, to_ns: *to_ns })
        }
        JobInput::File { path, simulated, at_ns } => {
            let together =
                |all: Vec<Bilingual>| all.into_iter().map(|problem| problem.en).collect::<Vec<_>>().join("; ");
            let mut model = Some(job.toml.as_str()).filter(|toml| !toml.is_empty()).map(parsed).transpose()?;
            let given = read_recordings_as(&[path.display().to_string()], None, Copies::CountOnce).map_err(together)?;
            let (mut recording, mut reading) = (given.recording, given.warnings);
            if let Some(text) = simulated {
                let series = SimulatedSeries::from_text(text, AlignBy::Auto);
                let output = model
                    .as_ref()
                    .map(|model| model.output.clone())
                    .or_else(|| recorded_output(&recording, &series))
                    .ok_or_else(|| "which recorded quantity does the series simulate? choose a model".to_owned())?;
                let found = attach_series(&recording, &output, &series, None).map_err(together)?;
                recording = found.recording;
                reading.extend(found.remarks);
                model = Some(model.map_or_else(|| series_model(&output).map_err(|wrong| wrong.join("; ")), Ok)?);
            }
            let model = model.ok_or_else(|| "no model was given".to_owned())?;
            let from_ns = recording.start_ns.unwrap_or(*at_ns);
            Ok(Compared { model, recording, reading, from_ns, to_ns: *at_ns })
        }
    }
}

fn run_job(job: &DiagnosisJob) -> Result<(history::Diagnosis, Vec<String>), String> {
    let tell = |stage, rows| write_message(&ChildMessage::Stage(stage, rows)).map_err(|error| error.to_string());
    tell(Stage::Reading, 0)?;
    let Compared { model, mut recording, mut reading, from_ns, to_ns } = read_input(job)?;
    if let Some(thinned) = twin::thin_recording(&recording) {
        reading.push(thinned.describe_thinning(recording.count_rows()));
        recording = thinned.recording;
    }
    tell(Stage::Comparing, recording.count_rows())?;
    let examination = twin::examine_recording(&recording, &model);
    let context = DiagnosisContext::from_recording(&recording, &model, reading);
    if !examination.unusable.is_empty() {
        let doubts = context.doubts.iter().map(|doubt| doubt.text.en.clone());
        return Err(examination.unusable.into_iter().chain(doubts).collect::<Vec<_>>().join("; "));
    }
    let found = twin::diagnose_recording(&recording, &model, SEED).map_err(|problems| problems.join("; "))?;
    let context = context.with_diagnosis(&model, &found);
    tell(Stage::Writing, recording.count_rows())?;
    let beside = match &job.input {
        JobInput::Stretch { onsets, .. } => beside_model(&recording, &model, &found, onsets),
        JobInput::File { .. } => Vec::new(),
    };
    let row = history::Diagnosis {
        at_ns: to_ns,
        from_ns,
        to_ns,
        verdict: found.verdict.as_word().to_owned(),
        summary: describe_finding(&found, &beside),
        json: outputs::diagnosis_to_json(&found, &context).to_string(),
    };
    let kept = DiagnosisStore::from_directory(job.kept.clone());
    kept.write_diagnosis(&row, &found, &recording, (&context, beside))
        .map_err(|error| format!("{}: {error}", kept.directory().display()))?;
    Ok((row, found.missing.iter().map(|missing| missing.effect.clone()).collect()))
}

/// The answer in a sentence. A model that fits only with other parameters does not agree with the machine: what has moved is the
/// finding, and it is told in the place of "it agrees".
fn describe_finding(found: &twin::Diagnosis, beside: &[BesideModel]) -> String {
    let moved: Vec<&str> = beside.iter().filter(|one| one.is_of_parameters()).map(|one| one.en.as_str()).collect();
    if found.verdict != Verdict::NoMismatch || moved.is_empty() {
        return compose_headline(beside, &found.unit, (&found.summary.en, "")).0;
    }
    format!("A parameter of the model has changed: {}. Nothing else is missing.", moved.join("; "))
}

/// When the stretch that was really examined began: of a long one the beginning is left out.
#[expect(clippy::cast_possible_truncation, reason = "seconds of a stretch of eight hours")]
fn begin_ns(recording: &Recording) -> Option<TimeNs> {
    let first_s = recording.time_s.first()?;
    Some(recording.start_ns? + (first_s * SECOND_NS as f64) as i64)
}
