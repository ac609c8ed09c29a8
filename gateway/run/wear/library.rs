//! The models of the library, read on a thread of its own whenever a newer one was stored.

use adapters::threads::receive_work_within;
use gateway_base::log::{Notice, Severity};
use gateway_history::{HistoryError, Reader};
use rules::estimators::wear::WearRecord;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, channel, sync_channel};
use std::time::Duration;

/// Time between two looks at the library.
const LOOK_EVERY: Duration = Duration::from_secs(5);

type WearRecords = Result<Vec<Arc<WearRecord>>, HistoryError>;

/// The models in force.
#[derive(Debug)]
pub(super) struct Library {
    records: Option<Receiver<WearRecords>>,
    /// Dropped with the library: the thread ends.
    _ends: Option<std::sync::mpsc::Sender<()>>,
    models: Vec<Arc<WearRecord>>,
    problem: Option<HistoryError>,
}

impl Library {
    /// Begins to watch; a notice where that is not possible.
    pub(super) fn watch_history(history: &Path) -> (Self, Option<Notice>) {
        let (send, newest) = sync_channel(1);
        let (ends, ended) = channel();
        let history = history.to_owned();
        let started =
            std::thread::Builder::new().name("wear".to_owned()).spawn(move || look_again(&history, &send, &ended));
        let mut library = Self { records: Some(newest), _ends: Some(ends), models: Vec::new(), problem: None };
        let told = started.err().map(|error| {
            library.records = None;
            let text = format!("no thread for the wear models ({error}): no limit of the cutting power is shown");
            Notice::new(Severity::Warning, "wear_alone", text)
        });
        (library, told)
    }

    /// Takes what was found since the last call. True when the models are others than before.
    pub(super) fn take_newest(&mut self) -> bool {
        match self.records.as_ref().and_then(|newest| newest.try_recv().ok()) {
            None => false,
            Some(Ok(models)) => {
                self.models = models;
                true
            }
            Some(Err(problem)) => {
                self.problem = Some(problem);
                false
            }
        }
    }

    /// What went wrong, once.
    pub(super) fn take_problem(&mut self) -> Option<Notice> {
        let problem = self.problem.take()?;
        let text = format!("the wear models cannot be read, the ones before stay in force: {problem}");
        Some(Notice::new(Severity::Warning, "wear_models_refused", text))
    }

    /// The models in force, the newest last.
    pub(super) fn models(&self) -> &[Arc<WearRecord>] {
        &self.models
    }
}

fn look_again(history: &Path, send: &SyncSender<WearRecords>, ended: &Receiver<()>) {
    let mut known = 0;
    let mut said = None;
    loop {
        let found = read_newer_models(history, &mut known);
        let news = match &found {
            Ok(None) => false,
            Ok(Some(_)) => true,
            // The same trouble is told once: what a person would read again is the same.
            Err(problem) => {
                let text = problem.to_string();
                said.replace(text.clone()) != Some(text)
            }
        };
        if news
            && let Some(found) = found.transpose()
            && let Err(TrySendError::Disconnected(_)) = send.try_send(found)
        {
            return;
        }
        match receive_work_within("wear", ended, LOOK_EVERY) {
            Err(std::sync::mpsc::RecvTimeoutError::Timeout) => {}
            _ => return,
        }
    }
}

/// The models in force, when a newer one was stored than is `known`. A history that is not there yet has none.
fn read_newer_models(history: &Path, known: &mut i64) -> Result<Option<Vec<Arc<WearRecord>>>, HistoryError> {
    if !history.exists() {
        return Ok(None);
    }
    let reader = Reader::open(history)?;
    let newest = reader.newest_wear_model()?;
    if newest == *known {
        return Ok(None);
    }
    let models = reader.wear_models()?;
    *known = newest;
    Ok(Some(models.into_iter().filter(|model| model.in_force).map(|model| Arc::new(model.record)).collect()))
}
