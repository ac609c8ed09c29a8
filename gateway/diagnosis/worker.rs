//! Beside the tick: looks whether the model file has changed, and diagnoses in the background, one stretch at a time and
//! only with the processor time that nobody else wants.

use super::{outputs, stretch};
use crate::files::{LOOK_EVERY, Mark, Rest, mark};
use crate::history::{self, Reader};
use adapters::clock::TimeNs;
use rules::twin::{self, Model, parse_model, report};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// So long the newest samples may take to become durable before a diagnosis goes on without them.
const WAIT_MAX: Duration = Duration::from_secs(10);
/// A tenth of the claim to the processor that everything else has; with less, a busy box would never finish.
const NICE: i32 = 10;
/// Seed of the resampling: the same stretch and model give the same diagnosis.
const SEED: u64 = 1;

/// A model as read from its file.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// The model.
    pub model: Model,
    /// Its text.
    pub toml: String,
}

/// A stretch to be diagnosed.
#[derive(Debug, Clone)]
pub struct Request {
    /// The model in charge.
    pub model: Model,
    /// Beginning.
    pub from_ns: TimeNs,
    /// End.
    pub to_ns: TimeNs,
}

/// What the worker has to tell.
#[derive(Debug)]
pub enum Report {
    /// The file holds another model.
    Model(Box<Loaded>),
    /// The file has changed and cannot be used, for these reasons.
    Refused(String),
    /// A diagnosis is finished.
    Diagnosed(Box<Finished>),
    /// A stretch could not be diagnosed, for these reasons.
    NotDiagnosed(String),
}

/// A finished diagnosis.
#[derive(Debug, Clone)]
pub struct Finished {
    /// As stored; `at_ns` is for the tick to fill in.
    pub record: history::Diagnosis,
    /// What is missing.
    pub missing: Vec<String>,
    /// Where the improved model was written, if there is one.
    pub improved: Option<PathBuf>,
}

/// The worker, as the tick sees it. It ends when this is dropped.
#[derive(Debug)]
pub struct Worker {
    requests: SyncSender<Request>,
    reports: Receiver<Report>,
}

/// Where the worker finds and leaves things.
#[derive(Debug, Clone)]
pub struct Places {
    /// The model file.
    pub model: PathBuf,
    /// The history.
    pub history: PathBuf,
    /// Where the improved model of a diagnosis goes.
    pub improved: PathBuf,
}

/// Reads a model.
///
/// # Errors
/// Everything that is wrong with it.
pub fn read(path: &Path) -> Result<Loaded, String> {
    let toml = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let problems = |problems: Vec<twin::Problem>| {
        problems.iter().map(|problem| format!("{}, {problem}", path.display())).collect::<Vec<_>>().join("\n")
    };
    let model = parse_model(&toml).map_err(problems)?;
    Ok(Loaded { model, toml })
}

impl Worker {
    /// Starts. `known` is the text of the model that is in charge already.
    ///
    /// # Errors
    /// No thread could be started.
    pub fn start(places: Places, known: String) -> std::io::Result<Self> {
        let (requests, asked) = sync_channel(1);
        let (send, reports) = sync_channel(8);
        let file = FileWatch { path: places.model.clone(), rest: Rest::new(), known };
        std::thread::Builder::new().name("twin".to_owned()).spawn(move || work(file, &places, &asked, &send))?;
        Ok(Self { requests, reports })
    }

    /// Asks for a diagnosis; `false` while one is waiting already.
    pub fn ask(&self, request: Request) -> bool {
        self.requests.try_send(request).is_ok()
    }

    /// What there is to tell since the last call.
    pub fn take(&self) -> Option<Report> {
        self.reports.try_recv().ok()
    }
}

fn work(mut file: FileWatch, places: &Places, asked: &Receiver<Request>, send: &SyncSender<Report>) {
    // On Linux this concerns the calling thread alone, which is what is meant; a refusal costs nothing but niceness.
    let _refused = rustix::process::nice(NICE);
    loop {
        let report = match asked.recv_timeout(LOOK_EVERY) {
            Ok(request) => Some(diagnose(&request, places)),
            Err(RecvTimeoutError::Timeout) => file.look(),
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
    fn look(&mut self) -> Option<Report> {
        if !self.rest.look(mark(&self.path), false) {
            return None;
        }
        let text = std::fs::read_to_string(&self.path).ok()?;
        if text == self.known {
            return None;
        }
        self.known = text;
        Some(read(&self.path).map_or_else(Report::Refused, |loaded| Report::Model(Box::new(loaded))))
    }
}

fn diagnose(request: &Request, places: &Places) -> Report {
    wait_for_samples(&places.history, request.to_ns);
    let recording = match stretch::read(&places.history, request.from_ns, request.to_ns, &request.model.output) {
        Ok(recording) => recording,
        Err(error) => return Report::NotDiagnosed(error.to_string()),
    };
    let examination = twin::examine(&recording, &request.model);
    if !examination.unusable.is_empty() {
        return Report::NotDiagnosed(examination.unusable.join("; "));
    }
    match twin::diagnose(&recording, &request.model, SEED) {
        Ok(diagnosis) => Report::Diagnosed(Box::new(finished(request, places, &diagnosis))),
        Err(problems) => Report::NotDiagnosed(problems.join("; ")),
    }
}

fn finished(request: &Request, places: &Places, diagnosis: &twin::Diagnosis) -> Finished {
    let missing: Vec<String> = diagnosis.missing.iter().map(|missing| missing.effect.clone()).collect();
    let written = (!missing.is_empty())
        .then(|| outputs::put(&places.improved, &twin::write_model(&diagnosis.model)))
        .and_then(Result::ok);
    let record = history::Diagnosis {
        at_ns: request.to_ns,
        from_ns: request.from_ns,
        to_ns: request.to_ns,
        verdict: diagnosis.verdict.word().to_owned(),
        summary: diagnosis.summary.clone(),
        json: report::to_json(diagnosis).to_string(),
    };
    Finished { record, missing, improved: written.map(|()| places.improved.clone()) }
}

/// What was just measured may not be durable yet.
fn wait_for_samples(history: &Path, to_ns: TimeNs) {
    let until = Instant::now() + WAIT_MAX;
    let newest_ns = || Reader::open(history).ok()?.span().ok()?.map(|(_, newest_ns)| newest_ns);
    while newest_ns().is_none_or(|newest_ns| newest_ns < to_ns) && Instant::now() < until {
        std::thread::sleep(Duration::from_millis(200));
    }
}
