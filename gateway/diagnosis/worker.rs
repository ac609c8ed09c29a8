//! Beside the tick: looks whether the model file has changed, and has diagnoses made in the background, one stretch at a time, in
//! a process that has only the processor time that nobody else wants.

use super::child::{self, ChildMessage, DiagnosisJob, JobInput, Stage};
use super::child_process::start_child;
use super::handle::DiagnosisHandle;
use super::outputs;
use super::request::{ChildFailure, DiagnosisRequest, LoadedModel};
use super::store::{self, DiagnosisFile, DiagnosisStore};
use adapter_core::clock::TimeNs;
use adapter_core::threads::receive_work_within;
use gateway_base::files::{LOOK_EVERY, Mark, Rest, read_mark};
use gateway_history::Reader;
use rules::twin::{self, parse_model};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Weak};
use std::time::{Duration, Instant};

/// So long the newest samples may take to become durable before a diagnosis goes on without them.
const WAIT_MAX: Duration = Duration::from_secs(10);

/// What the worker has to tell.
#[derive(Debug)]
pub enum WorkerReport {
    /// The file holds another model.
    Model(Box<LoadedModel>),
    /// The file has changed and cannot be used, for these reasons.
    Refused(String),
    /// A diagnosis is finished.
    Diagnosed(Box<Finished>),
    /// A stretch could not be diagnosed, for these reasons; with the person who had asked for it.
    NotDiagnosed(String, Option<String>),
}

/// A diagnosis that the tick has to store and to tell.
#[derive(Debug, Clone)]
pub struct Finished {
    /// The person who had asked for it; `None`: the box itself.
    pub by: Option<String>,
    /// As stored; `at_ns` is for the tick to fill in.
    pub record: gateway_history::Diagnosis,
    /// Kinds of the missing effects, most important first.
    pub missing: Vec<String>,
    /// Where the improved model was written, if there is one.
    pub improved: Option<PathBuf>,
}

/// The worker, as the tick sees it. It ends when this is dropped.
#[derive(Debug)]
pub struct Worker {
    diagnoses: DiagnosisHandle,
    reports: Receiver<WorkerReport>,
    /// The thread ends when this goes, whoever still holds the handle.
    _going_on: Arc<()>,
}

/// Where the worker finds and leaves things.
#[derive(Debug, Clone)]
pub struct WorkerPaths {
    /// Path of the model in charge; the worker watches it for changes.
    pub model: PathBuf,
    /// Path of the database, which the worker only reads.
    pub history: PathBuf,
    /// Where the improved model of a diagnosis goes.
    pub improved: PathBuf,
    /// What is kept of diagnoses.
    pub kept: DiagnosisStore,
}

/// Why there is no model in a file.
#[derive(Debug, thiserror::Error)]
pub enum ModelFileError {
    /// The file cannot be read.
    #[error("{}: {error}", path.display())]
    Unreadable {
        /// The model file that could not be read.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// It is no model that can be used.
    #[error("{}", list_problems(path, problems))]
    Refused {
        /// The model file that was read.
        path: PathBuf,
        /// Everything that is wrong with it.
        problems: Vec<twin::Problem>,
    },
}

/// Every problem on a line of its own.
fn list_problems(path: &Path, problems: &[twin::Problem]) -> String {
    problems.iter().map(|problem| format!("{}, {problem}", path.display())).collect::<Vec<_>>().join("\n")
}

/// Reads a model.
///
/// # Errors
/// Everything that is wrong with it.
pub fn read(path: &Path) -> Result<LoadedModel, ModelFileError> {
    let toml =
        std::fs::read_to_string(path).map_err(|error| ModelFileError::Unreadable { path: path.to_owned(), error })?;
    let refused = |problems| ModelFileError::Refused { path: path.to_owned(), problems };
    let model = parse_model(&toml).map_err(refused)?;
    Ok(LoadedModel { model, toml })
}

impl Worker {
    /// Starts. `known` is the text of the model that is in charge already.
    ///
    /// # Errors
    /// No thread could be started.
    pub fn start(places: WorkerPaths, known: String) -> std::io::Result<Self> {
        let (requests, asked) = sync_channel(1);
        let (send, reports) = sync_channel(8);
        let file = FileWatch { path: places.model.clone(), rest: Rest::new(), known };
        let diagnoses =
            DiagnosisHandle::new(requests, places.model.clone(), places.history.clone(), places.kept.clone());
        let going_on = Arc::new(());
        let (own, still) = (diagnoses.clone(), Arc::downgrade(&going_on));
        let body = move || run_worker(file, &places, (&asked, &own), &send, &still);
        std::thread::Builder::new().name("twin".to_owned()).spawn(body)?;
        Ok(Self { diagnoses, reports, _going_on: going_on })
    }

    /// Where diagnoses are asked for.
    #[must_use]
    pub fn diagnoses(&self) -> &DiagnosisHandle {
        &self.diagnoses
    }

    /// What there is to tell since the last call.
    pub fn take_report(&self) -> Option<WorkerReport> {
        self.reports.try_recv().ok()
    }
}

fn run_worker(
    mut file: FileWatch,
    places: &WorkerPaths,
    (asked, diagnoses): (&Receiver<DiagnosisRequest>, &DiagnosisHandle),
    send: &SyncSender<WorkerReport>,
    going_on: &Weak<()>,
) {
    while going_on.strong_count() > 0 {
        let report = match receive_work_within("twin", asked, LOOK_EVERY) {
            Ok(request) => Some(diagnose_stretch(request, places, diagnoses)),
            Err(RecvTimeoutError::Timeout) => file.read_if_changed(),
            Err(RecvTimeoutError::Disconnected) => return,
        };
        if report.is_some_and(|report| send.send(report).is_err()) {
            return;
        }
    }
}

/// Notices another text of the model file.
struct FileWatch {
    path: PathBuf,
    rest: Rest<Mark>,
    known: String,
}

impl FileWatch {
    fn read_if_changed(&mut self) -> Option<WorkerReport> {
        if !self.rest.should_read(read_mark(&self.path), false) {
            return None;
        }
        let text = std::fs::read_to_string(&self.path).ok()?;
        if text == self.known {
            return None;
        }
        self.known = text;
        Some(read(&self.path).map_or_else(
            |error| WorkerReport::Refused(error.to_string()),
            |loaded| WorkerReport::Model(Box::new(loaded)),
        ))
    }
}

fn diagnose_stretch(request: DiagnosisRequest, places: &WorkerPaths, diagnoses: &DiagnosisHandle) -> WorkerReport {
    wait_for_samples(&places.history, request.to_ns, diagnoses);
    let DiagnosisRequest { toml, by, from_ns, to_ns, onsets, .. } = request;
    let input = JobInput::Stretch { history: places.history.clone(), from_ns, to_ns, onsets };
    let job = DiagnosisJob { toml, input, kept: places.kept.directory().to_owned() };
    let found = in_child(&job, diagnoses);
    diagnoses.record_outcome(found.as_ref().map(|(record, _)| store::diagnosis_key(record)).map_err(Clone::clone));
    match found {
        Ok((record, missing)) => WorkerReport::Diagnosed(Box::new(finish_diagnosis(by, places, record, missing))),
        Err(failure) => WorkerReport::NotDiagnosed(failure.to_string(), by),
    }
}

/// Row of the history and what is missing.
pub(super) type FoundDiagnosis = (gateway_history::Diagnosis, Vec<String>);

pub(super) fn in_child(job: &DiagnosisJob, diagnoses: &DiagnosisHandle) -> Result<FoundDiagnosis, ChildFailure> {
    let ended_by = |diagnoses: &DiagnosisHandle| diagnoses.cancelled_by().map(|by| ChildFailure::Ended { by });
    if let Some(ended) = ended_by(diagnoses) {
        return Err(ended);
    }
    let mut child = start_child(job).map_err(|error| ChildFailure::NotStarted(error.to_string()))?;
    let output = child.stdout.take();
    diagnoses.put_child(child);
    let mut outcome = None;
    if let Some(output) = output {
        child::read_messages(output, |said| match said {
            ChildMessage::Stage(stage, rows) => diagnoses.record_stage(stage, rows),
            ChildMessage::Finished(record, missing) => outcome = Some(Ok((*record, missing))),
            ChildMessage::Refused(problem) => outcome = Some(Err(ChildFailure::Refused(problem))),
        });
    }
    let status = diagnoses.take_child().map(|mut child| child.wait());
    let broken = || ChildFailure::BrokeOff(status.and_then(Result::ok).map_or(String::new(), |it| it.to_string()));
    ended_by(diagnoses).map_or_else(|| outcome.unwrap_or_else(|| Err(broken())), Err)
}

fn finish_diagnosis(
    by: Option<String>,
    places: &WorkerPaths,
    record: gateway_history::Diagnosis,
    missing: Vec<String>,
) -> Finished {
    let model = places.kept.read_file(&store::diagnosis_key(&record), DiagnosisFile::Model);
    let written = model.map(|model| outputs::write_output(&places.improved, &model)).and_then(Result::ok);
    Finished { by, record, missing, improved: written.map(|()| places.improved.clone()) }
}

/// What was just measured may not be durable yet.
fn wait_for_samples(history: &Path, to_ns: TimeNs, diagnoses: &DiagnosisHandle) {
    diagnoses.record_stage(Stage::Waiting, 0);
    let until = Instant::now() + WAIT_MAX;
    let newest_ns = || Reader::open(history).ok()?.read_span().ok()?.map(|(_, newest_ns)| newest_ns);
    while newest_ns().is_none_or(|newest_ns| newest_ns < to_ns)
        && diagnoses.cancelled_by().is_none()
        && Instant::now() < until
    {
        std::thread::sleep(Duration::from_millis(200));
    }
}
