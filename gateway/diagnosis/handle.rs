//! The one place where diagnoses are asked for, by the tick and by persons on the page: one at a time, with how far it is, and
//! ended at any moment.

use super::beside::Onset;
use super::child::Stage;
use super::request::{ChildFailure, DiagnosisRequest, LoadedModel};
use super::store::DiagnosisStore;
use super::stretch;
use adapter_core::bilingual::Bilingual;
use adapter_core::clock::{SECOND_NS, TimeNs};
use gateway_base::files::{read_text, replace_durably};
use gateway_history::Reader;
use recording::Recording;
use rules::twin::{live, parse_model};
use std::path::{Path, PathBuf};
use std::process::Child;
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The longest model file that is read.
const MODEL_MAX: usize = 4 << 20;

/// So much of the history tells what a machine delivers: long enough for a cut between two breaks.
const RECENT_NS: i64 = 2 * 3600 * SECOND_NS;
/// And so long that is believed.
const RECENT_FOR: Duration = Duration::from_secs(60);

/// What is being done, or was done last.
#[derive(Debug, Clone, Default)]
pub enum Run {
    /// None was asked for since the start.
    #[default]
    None,
    /// A diagnosis is under way.
    Running(RunningDiagnosis),
    /// It is in the history, under this key.
    Done {
        /// Who asked for it; `None`: the box itself.
        by: Option<String>,
        /// Key of the row, as `store::diagnosis_key` makes it.
        key: String,
        /// How long it took, s.
        seconds: f64,
    },
    /// It could not be made.
    Failed {
        /// Who asked for it.
        by: Option<String>,
        /// The reason in words, for the person who asked.
        what: String,
    },
    /// A person ended it.
    Cancelled {
        /// Name of the person who ended it.
        by: String,
    },
}

/// A diagnosis under way.
#[derive(Debug, Clone)]
pub struct RunningDiagnosis {
    /// Who asked for it; `None`: the box itself.
    pub by: Option<String>,
    /// Beginning of the stretch, ns since 1970.
    pub from_ns: TimeNs,
    /// End of the stretch, ns since 1970.
    pub to_ns: TimeNs,
    /// When it was begun, on the monotonic clock.
    pub since: Instant,
    /// How far it is.
    pub stage: Stage,
    /// Rows of a second that are examined; 0 while that is not known.
    pub rows: usize,
    /// Who wants it ended.
    cancelled: Option<String>,
}

/// Why nothing was begun, cancelled or accepted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DiagnosisRefusal {
    /// What is in the way.
    pub what: String,
    /// What to do next.
    pub next: &'static str,
}

impl DiagnosisRefusal {
    fn new(what: impl Into<String>, next: &'static str) -> Self {
        Self { what: what.into(), next }
    }
}

#[derive(Debug, Default)]
struct DiagnosisState {
    run: Run,
    child: Option<Child>,
    model: Option<LoadedModel>,
    /// Since when the watch sees which kinds of work differ.
    onsets: Vec<Onset>,
    /// Seconds per row of the last one: from these follows about how long the next one takes.
    pace_s: Option<f64>,
    /// What the machine has delivered lately, and when it was read; nothing where nothing is stored that would tell.
    recent: Option<(Instant, Option<Arc<Recording>>)>,
}

/// See the [module](self). Clones are handles of the same diagnoses.
#[derive(Debug, Clone)]
pub struct DiagnosisHandle {
    state: Arc<Mutex<DiagnosisState>>,
    requests: SyncSender<DiagnosisRequest>,
    model: PathBuf,
    history: PathBuf,
    store: DiagnosisStore,
}

impl DiagnosisHandle {
    /// A handle whose requests go there; what the machine delivers is read from the history at that path.
    #[must_use]
    pub fn new(requests: SyncSender<DiagnosisRequest>, model: PathBuf, history: PathBuf, kept: DiagnosisStore) -> Self {
        Self { state: Arc::default(), requests, model, history, store: kept }
    }

    /// A handle of the same diagnoses that asks for none: its thread ends when the others are gone.
    pub(super) fn without_requests(&self) -> Self {
        let (requests, _nobody_listens) = std::sync::mpsc::sync_channel(0);
        Self { requests, ..self.clone() }
    }

    fn lock(&self) -> MutexGuard<'_, DiagnosisState> {
        // The state is complete whenever the lock is free.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What was kept of diagnoses.
    #[must_use]
    pub fn diagnosis_store(&self) -> &DiagnosisStore {
        &self.store
    }

    /// Path of the model file in charge.
    #[must_use]
    pub fn model_path(&self) -> &Path {
        &self.model
    }

    /// Another model has come into force.
    pub fn set_model(&self, loaded: &LoadedModel) {
        self.lock().model = Some(loaded.clone());
    }

    /// Since when the watch sees which kinds of work differ from the model in charge.
    pub fn set_onsets(&self, onsets: Vec<Onset>) {
        self.lock().onsets = onsets;
    }

    /// What is being done, and about how long it takes in all, s, where that is known.
    #[must_use]
    pub fn current_run(&self) -> (Run, Option<f64>) {
        let state = self.lock();
        let rows = if let Run::Running(running) = &state.run { running.rows } else { 0 };
        #[expect(clippy::cast_precision_loss, reason = "at most some ten thousand rows")]
        let about_s = state.pace_s.filter(|_| rows > 0).map(|pace_s| pace_s * rows as f64);
        (state.run.clone(), about_s)
    }

    /// Asks for a diagnosis of this stretch under the model in charge.
    ///
    /// # Errors
    /// No model is in charge, or one is under way.
    pub fn request_diagnosis(
        &self,
        by: Option<String>,
        from_ns: TimeNs,
        to_ns: TimeNs,
    ) -> Result<(), DiagnosisRefusal> {
        let none =
            || DiagnosisRefusal::new("no model is in charge", "name one under [twin] model in the configuration");
        let state = self.lock();
        let toml = state.model.as_ref().ok_or_else(none)?.toml.clone();
        let onsets = state.onsets.clone();
        drop(state);
        self.submit_request(DiagnosisRequest { toml, by, from_ns, to_ns, onsets, file: None })
    }

    /// Asks for a diagnosis.
    ///
    /// # Errors
    /// One is under way.
    pub(super) fn submit_request(&self, request: DiagnosisRequest) -> Result<(), DiagnosisRefusal> {
        let mut state = self.lock();
        if let Run::Running(running) = &state.run {
            let who = running.by.as_deref().unwrap_or("the box itself");
            let what = format!("a diagnosis is under way (asked for by {who})");
            return Err(DiagnosisRefusal::new(what, "wait for it or end it; there is one at a time"));
        }
        let (by, from_ns, to_ns) = (request.by.clone(), request.from_ns, request.to_ns);
        let busy = |_| DiagnosisRefusal::new("the thread of the twin does not answer", "try again in a few seconds");
        self.requests.try_send(request).map_err(busy)?;
        let (since, stage) = (Instant::now(), Stage::Waiting);
        state.run = Run::Running(RunningDiagnosis { by, from_ns, to_ns, since, stage, rows: 0, cancelled: None });
        Ok(())
    }

    /// Ends the one under way.
    ///
    /// # Errors
    /// There is none.
    pub fn cancel(&self, by: &str) -> Result<(), DiagnosisRefusal> {
        let mut state = self.lock();
        let Run::Running(running) = &mut state.run else {
            return Err(DiagnosisRefusal::new(
                "no diagnosis is under way",
                "GET /api/v1/diagnosis tells what was done last",
            ));
        };
        running.cancelled = Some(by.to_owned());
        if let Some(child) = &mut state.child {
            let _already_gone = child.kill();
        }
        Ok(())
    }

    /// Who has ended the one under way.
    #[must_use]
    pub fn cancelled_by(&self) -> Option<String> {
        if let Run::Running(running) = &self.lock().run { running.cancelled.clone() } else { None }
    }

    /// The process that does the work; one that was ended meanwhile is killed at once.
    pub(super) fn put_child(&self, mut child: Child) {
        let mut state = self.lock();
        if matches!(&state.run, Run::Running(running) if running.cancelled.is_some()) {
            let _already_gone = child.kill();
        }
        state.child = Some(child);
    }

    /// The process, to be waited for.
    pub(super) fn take_child(&self) -> Option<Child> {
        self.lock().child.take()
    }

    pub(super) fn record_stage(&self, stage: Stage, rows: usize) {
        if let Run::Running(running) = &mut self.lock().run {
            (running.stage, running.rows) = (stage, rows);
        }
    }

    /// Ends the run with the key of the row, or with the failure; what a person has ended counts as cancelled in either case.
    pub(super) fn record_outcome(&self, outcome: Result<String, ChildFailure>) {
        let mut state = self.lock();
        let Run::Running(RunningDiagnosis { by, since, rows, cancelled, .. }) = std::mem::take(&mut state.run) else {
            return;
        };
        let seconds = since.elapsed().as_secs_f64();
        state.run = match (cancelled, outcome) {
            (Some(by), _) => Run::Cancelled { by },
            (None, Err(failure)) => Run::Failed { by, what: failure.to_string() },
            (None, Ok(key)) => {
                #[expect(clippy::cast_precision_loss, reason = "at most some ten thousand rows")]
                let pace_s = (rows > 0).then(|| seconds / rows as f64);
                state.pace_s = pace_s.or(state.pace_s);
                Run::Done { by, key, seconds }
            }
        };
    }

    /// Why the machine cannot be compared with this model while it works; `None` where it can, and where nothing is stored that
    /// would tell.
    #[must_use]
    pub fn find_live_refusal(&self, toml: &str) -> Option<Bilingual> {
        let recent = self.read_recent()?;
        let unfed = live::list_unfed_inputs(&parse_model(toml).ok()?, &recent);
        (!unfed.is_empty()).then(|| {
            let needs = unfed.join("; ");
            Bilingual::new(
                format!("The running machine cannot feed this model: {needs}. Use it for recordings, not for the live comparison."),
                format!("运行中的机床无法为该模型提供输入：{needs}。可用于记录文件，不能用于实时对照。"),
            )
        })
    }

    /// What the machine has delivered lately; read anew after a while.
    fn read_recent(&self) -> Option<Arc<Recording>> {
        let known = self.lock().recent.clone().filter(|(since, _)| since.elapsed() < RECENT_FOR);
        if let Some((_, recent)) = known {
            return recent;
        }
        let recent = self.load_recent().map(Arc::new);
        self.lock().recent = Some((Instant::now(), recent.clone()));
        recent
    }

    fn load_recent(&self) -> Option<Recording> {
        let (_, newest_ns) = Reader::open(&self.history).ok()?.read_span().ok()??;
        let output = self.lock().model.as_ref()?.model.output.clone();
        let recent = stretch::read(&self.history, newest_ns - RECENT_NS, newest_ns, &output).ok()?;
        // A machine that was off all the time tells nothing of what it delivers.
        recent.find_numbers(&output).filter(|numbers| numbers.count_present() > 0)?;
        Some(recent)
    }

    fn path_before(&self) -> PathBuf {
        self.model.with_extension("before.toml")
    }

    /// The name of the model that was in charge before the last one was taken over; `None` where none is kept.
    #[must_use]
    pub fn model_before(&self) -> Option<String> {
        parse_model(&read_text(&self.path_before(), MODEL_MAX).ok()?).ok().map(|model| model.name)
    }

    /// Puts the model of a diagnosis in the place of the one in charge; the one before is kept beside it. Gives what was done, in
    /// words. The box notices the file within two seconds.
    ///
    /// # Errors
    /// The model cannot be used or fed, the file has been changed since, or it cannot be written.
    pub fn accept_model(&self, key: &str, text: &str) -> Result<String, DiagnosisRefusal> {
        if let Some(refusal) = self.find_live_refusal(text) {
            return Err(DiagnosisRefusal::new(
                refusal.en,
                "download the model, and use it with `diagnose` and `simulate`",
            ));
        }
        self.replace_model(text, &format!("of diagnosis {key}"))
    }

    /// Puts the model that was in charge before back in its place; the one that goes is kept in turn, so that a second call undoes
    /// the first. Gives what was done, in words.
    ///
    /// # Errors
    /// None is kept, the file has been changed since, or it cannot be written.
    pub fn restore_model(&self) -> Result<String, DiagnosisRefusal> {
        let none =
            |_| DiagnosisRefusal::new("no model from before is kept", "one is kept as soon as a model is taken over");
        let text = read_text(&self.path_before(), MODEL_MAX).map_err(none)?;
        self.replace_model(&text, "from before")
    }

    fn replace_model(&self, text: &str, origin: &str) -> Result<String, DiagnosisRefusal> {
        let next = "look at the file; `cnc-gateway diagnose --accept` writes one by hand";
        let model =
            parse_model(text).map_err(|wrong| DiagnosisRefusal::new(format!("the kept model: {}", wrong[0]), next))?;
        let before = self.lock().model.clone();
        let now = read_text(&self.model, MODEL_MAX).unwrap_or_default();
        if before.as_ref().is_some_and(|before| before.toml != now) {
            let what = format!("{} has just been changed by somebody else", self.model.display());
            return Err(DiagnosisRefusal::new(what, "look at what is in charge now, and decide again"));
        }
        let permission = "the user of the gateway must be allowed to write the file of [twin] model";
        let cannot =
            |error: std::io::Error| DiagnosisRefusal::new(format!("{}: {error}", self.model.display()), permission);
        replace_durably(&self.path_before(), &now).map_err(cannot)?;
        replace_durably(&self.model, text).map_err(cannot)?;
        let before = before.map_or_else(|| "none".to_owned(), |before| before.model.name);
        Ok(format!(
            "model {:?} {origin} in the place of {before:?}; the one that was in charge is in {}",
            model.name,
            self.path_before().display()
        ))
    }
}
