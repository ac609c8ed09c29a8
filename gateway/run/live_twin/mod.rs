//! The model beside the running machine: compared every second, watched, and, when the two begin to differ, told and
//! diagnosed in the background.

mod twin_status;

use super::health::Health;
use adapters::clock::{SECOND_NS, TimeNs};
use adapters::{ChannelId, Sample};
use gateway_base::log::{Notice, Severity};
use gateway_base::state_file;
use gateway_config::Config;
use gateway_diagnosis::handle::DiagnosisHandle;
use gateway_diagnosis::request::LoadedModel;
use gateway_diagnosis::store::DiagnosisStore;
use gateway_diagnosis::stretch::ENOUGH_S;
use gateway_diagnosis::words;
use gateway_diagnosis::worker::{self, Finished, Worker, WorkerPaths, WorkerReport};
use gateway_history::{self as history, Alarm, AlarmClear, ExtraSeries, ExtraValue};
use gateway_pipeline::Pipeline;
use rules::twin::diagnosis::find_output_unit;
use rules::twin::live::{self, ComparedSecond, Live, Mismatch, Regime, RegimeStage};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Who raises the alarms and writes the events.
const SOURCE: &str = "twin";
/// What was learned is saved about this often.
const SAVE_EVERY: Duration = Duration::from_secs(600);
/// A diagnosis needs this much of the machine as it is now,
const AFTER_NS: i64 = ENOUGH_S * SECOND_NS;
/// and this much of it as it was.
const BEFORE_NS: i64 = 4 * 3600 * SECOND_NS;
/// Between the beginnings of two diagnoses.
const APART_NS: i64 = 6 * 3600 * SECOND_NS;

/// What is remembered across a restart.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Remembered {
    /// The model under which it was learned.
    toml: String,
    memory: live::LiveState,
    /// A diagnosis that is due or was interrupted.
    #[serde(default)]
    due: Option<Due>,
}

/// A diagnosis to come.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Due {
    /// When it may begin.
    at_ns: TimeNs,
    /// Beginning of the stretch.
    from_ns: TimeNs,
}

/// The model in charge.
struct ActiveModel {
    live: Live,
    loaded: LoadedModel,
}

/// The model beside the running machine, its watch, and the worker that diagnoses.
pub struct Twin {
    paths: WorkerPaths,
    memory: PathBuf,
    active: Option<ActiveModel>,
    /// Unit and end of the name of the stored series; they stay while the box runs.
    suffix: String,
    stored: bool,
    worker: Option<Worker>,
    notices: Vec<Notice>,
    /// A model that has come into force and is not yet in the history.
    new_model: Option<LoadedModel>,
    problem: Option<String>,
    /// Stays until the diagnosis is finished.
    due: Option<Due>,
    begun_ns: Option<TimeNs>,
    diagnosing: bool,
    finished: Option<Finished>,
    saved: Instant,
    /// Differences from before the restart have been raised again.
    raised: bool,
}

impl Twin {
    /// The twin of the configuration; `None` where no model is named. A model that cannot be used is told, and the
    /// worker waits for a better one.
    #[must_use]
    pub fn from_config(config: &Config) -> Option<Self> {
        let model = config.twin.model.clone()?;
        let data_dir = &config.gateway.data_dir;
        let places = WorkerPaths {
            model,
            history: config.history.path.clone(),
            improved: data_dir.join("model-improved.toml"),
            kept: DiagnosisStore::from_data_dir(data_dir),
        };
        let mut twin = Self {
            paths: places,
            memory: data_dir.join("twin.json"),
            active: None,
            suffix: String::new(),
            stored: false,
            worker: None,
            notices: Vec::new(),
            new_model: None,
            problem: None,
            due: None,
            begun_ns: None,
            diagnosing: false,
            finished: None,
            saved: Instant::now(),
            raised: false,
        };
        twin.start_comparison();
        twin.stored = twin.active.is_some();
        Some(twin)
    }

    fn start_comparison(&mut self) {
        let loaded = worker::read(&self.paths.model);
        let known = loaded.as_ref().map(|loaded| loaded.toml.clone()).unwrap_or_default();
        match loaded {
            Ok(loaded) => {
                let remembered = restore_learned(&self.memory, &mut self.notices);
                self.put_in_charge(loaded, remembered);
            }
            Err(problem) => self.refuse_model(problem.to_string()),
        }
        match Worker::start(self.paths.clone(), known) {
            Ok(worker) => {
                self.active.iter().for_each(|active| worker.diagnoses().set_model(&active.loaded));
                self.worker = Some(worker);
            }
            Err(error) => {
                let text = format!("no thread for the twin ({error}): nothing is diagnosed in the background");
                self.notices.push(Notice::new(Severity::Warning, "twin_alone", text));
            }
        }
    }

    /// Where diagnoses are asked for; `None` where there is no thread for them.
    #[must_use]
    pub fn diagnosis_handle(&self) -> Option<DiagnosisHandle> {
        self.worker.as_ref().map(|worker| worker.diagnoses().clone())
    }

    fn put_in_charge(&mut self, loaded: LoadedModel, before: Remembered) {
        let same = before.toml == loaded.toml;
        let memory = if same { before.memory } else { before.memory.retain_cutting_times() };
        self.due = before.due.filter(|_| same);
        if self.suffix.is_empty() {
            self.suffix = loaded.model.output.rsplit('_').next().unwrap_or("").to_owned();
        }
        let text = format!(
            "{} is compared with the machine: {} in {}",
            loaded.model.name,
            loaded.model.output,
            self.paths.model.display()
        );
        self.notices.push(Notice::new(Severity::Info, "twin_model", text));
        self.problem = None;
        self.new_model = (!same).then(|| loaded.clone());
        self.worker.iter().for_each(|worker| worker.diagnoses().set_model(&loaded));
        self.active = Some(ActiveModel { live: Live::new(loaded.model.clone(), memory), loaded });
    }

    fn refuse_model(&mut self, problem: String) {
        let consequence = if self.active.is_some() { "the one before stays in charge" } else { "nothing is compared" };
        let text = format!("the model cannot be used, {consequence}:\n  {}", problem.replace('\n', "\n  "));
        self.notices.push(Notice::new(Severity::Warning, "twin_refused", text));
        self.problem = Some(problem);
    }

    /// What is stored beside the channels.
    #[must_use]
    pub fn extra_series(&self) -> Vec<ExtraSeries> {
        let Some(ActiveModel { loaded, .. }) = &self.active else { return Vec::new() };
        let unit = find_output_unit(&loaded.model.output);
        let series = |name: &str, en, zh| ExtraSeries::new_number(&format!("{name}_{}", self.suffix), unit, en, zh);
        vec![
            series("twin_expected", "Expected by the simulation", "仿真值"),
            series("twin_residual", "Recorded minus simulated", "实测与仿真之差"),
        ]
    }

    /// The newest values of [`Twin::extra_series`]: both, or neither. A mean over a minute of which the meter was silent for a part would
    /// otherwise be one over other seconds for the simulation than for the difference, and what was recorded would not be their sum.
    #[must_use]
    pub fn extra_values(&self) -> [ExtraValue<'static>; 2] {
        let same_unit = |loaded: &LoadedModel| loaded.model.output.ends_with(&self.suffix);
        let compared = match &self.active {
            Some(ActiveModel { live, loaded }) if same_unit(loaded) => live.compared_second(),
            _ => ComparedSecond::from_reason(live::NoTwin::NotYet),
        };
        let expected = compared.residual.and(compared.expected);
        [expected, compared.residual].map(|value| value.map_err(live::NoTwin::as_word).into())
    }

    /// Takes one tick, after the pipeline has.
    pub fn compare_tick(&mut self, sample: &Sample, pipeline: &Pipeline, health: &mut Health) {
        let now_ns = sample.at_ns;
        self.receive_report(health, now_ns);
        self.notices.drain(..).for_each(|notice| health.record_event(now_ns, SOURCE, &notice));
        if let Some(LoadedModel { model, toml }) = self.new_model.take() {
            let origin = self.paths.model.display().to_string();
            health.keep_record(history::Model { at_ns: now_ns, name: model.name, origin, toml }.into());
        }
        // What differed before the restart still does; the history has ended its alarms.
        if !std::mem::replace(&mut self.raised, true) {
            self.list_mismatches().iter().for_each(|mismatch| self.raise_alarm(mismatch, health, now_ns));
            self.tell_onsets();
        }
        let Some(ActiveModel { live, .. }) = &mut self.active else { return };
        let noticed = live.update_with_sample(sample, pipeline.estimates().state);
        match noticed {
            None => {}
            Some(live::Notice::Learned(regime)) => {
                let text =
                    format!("what is usual {} has been learned; it is watched from now on", regime.as_phrases().0);
                health.record_event(now_ns, SOURCE, &Notice::new(Severity::Info, "twin_learned", text));
                self.save_learned(health);
            }
            Some(live::Notice::Begins(mismatch)) => self.report_mismatch(&mismatch, health, now_ns),
            Some(live::Notice::Ends(regime)) => self.report_agreement(regime, health, now_ns),
        }
        self.ask_when_due(now_ns, health);
        if self.saved.elapsed() >= SAVE_EVERY {
            self.save_learned(health);
        }
        if self.stored {
            health.set_twin_values(self.extra_values());
        }
    }

    fn output_names(&self) -> (&'static str, &'static str) {
        let output = self.active.as_ref().map_or("", |active| active.loaded.model.output.as_str());
        let channel = ChannelId::from_name(output).map(|id| id.channel());
        channel.map_or(("the output", "输出"), |channel| (channel.en, channel.zh))
    }

    fn output_unit(&self) -> &'static str {
        self.active.as_ref().map_or("", |active| find_output_unit(&active.loaded.model.output))
    }

    fn report_mismatch(&mut self, mismatch: &Mismatch, health: &mut Health, now_ns: TimeNs) {
        let (en, _) = words::mismatch_since(mismatch, self.output_names(), self.output_unit());
        health.record_event(now_ns, SOURCE, &Notice::new(Severity::Warning, "twin_mismatch", en));
        self.raise_alarm(mismatch, health, now_ns);
        let onset = mismatch.onset.map(|onset| (words::to_nanoseconds(onset.at_s), words::to_nanoseconds(onset.low_s)));
        let (at_ns, low_ns) = onset.unwrap_or((now_ns - AFTER_NS, now_ns - AFTER_NS));
        let earliest_ns = self.begun_ns.map_or(now_ns, |begun_ns| begun_ns + APART_NS);
        let at_ns = (at_ns + AFTER_NS).max(now_ns).max(earliest_ns);
        self.due.get_or_insert(Due { at_ns, from_ns: low_ns - BEFORE_NS });
        self.tell_onsets();
        self.save_learned(health);
    }

    /// A diagnosis is held against what the watch has seen, from the same moment on.
    fn tell_onsets(&self) {
        let onset = |it: Mismatch| Some((it.regime, words::to_nanoseconds(it.onset?.at_s)));
        let onsets = self.list_mismatches().into_iter().filter_map(onset).collect();
        self.worker.iter().for_each(|worker| worker.diagnoses().set_onsets(Vec::clone(&onsets)));
    }

    fn raise_alarm(&self, mismatch: &Mismatch, health: &mut Health, now_ns: TimeNs) {
        let (en, zh) = words::mismatch_since(mismatch, self.output_names(), self.output_unit());
        let (code, source, severity) = (alarm_code(mismatch.regime), SOURCE.to_owned(), "warning".to_owned());
        health.keep_record(Alarm { at_ns: now_ns, code, source, severity, en, zh }.into());
    }

    fn report_agreement(&mut self, regime: Regime, health: &mut Health, now_ns: TimeNs) {
        let (en, _) = words::describe_agreement(regime, self.output_names());
        health.record_event(now_ns, SOURCE, &Notice::new(Severity::Info, "twin_agrees", en));
        health.keep_record(AlarmClear { at_ns: now_ns, code: alarm_code(regime), source: SOURCE.to_owned() }.into());
        if self.list_mismatches().is_empty() && !self.diagnosing {
            self.due = None;
        }
        self.tell_onsets();
        self.save_learned(health);
    }

    fn list_mismatches(&self) -> Vec<Mismatch> {
        let stages = self.active.iter().flat_map(|active| active.live.list_stages());
        let differing = |(_, stage)| if let RegimeStage::Differing(mismatch) = stage { Some(mismatch) } else { None };
        stages.filter_map(differing).collect()
    }

    fn ask_when_due(&mut self, now_ns: TimeNs, health: &mut Health) {
        let Some(Due { from_ns, .. }) = self.due.filter(|due| now_ns >= due.at_ns && !self.diagnosing) else { return };
        let Some(worker) = &self.worker else { return };
        // While a person's diagnosis is under way, this one waits.
        if worker.diagnoses().request_diagnosis(None, from_ns, now_ns).is_ok() {
            (self.begun_ns, self.diagnosing) = (Some(now_ns), true);
            let text = "a diagnosis of the difference between machine and simulation has begun in the background";
            health.record_event(now_ns, SOURCE, &Notice::new(Severity::Info, "diagnosis_begun", text));
        }
    }

    /// Takes what the worker has to tell.
    fn receive_report(&mut self, health: &mut Health, now_ns: TimeNs) {
        let Some(report) = self.worker.as_ref().and_then(Worker::take_report) else { return };
        match report {
            WorkerReport::Model(loaded) => self.replace_model(*loaded, health, now_ns),
            WorkerReport::Refused(problem) => self.refuse_model(problem),
            WorkerReport::NotDiagnosed(problem, by) => {
                self.was_due(by.as_deref());
                let text = format!("{} could not be made: {problem}", diagnosis_of(by.as_deref()));
                health.record_event(now_ns, SOURCE, &Notice::new(Severity::Warning, "diagnosis_failed", text));
            }
            WorkerReport::Diagnosed(mut finished) => {
                self.was_due(finished.by.as_deref());
                finished.record.at_ns = now_ns;
                let text = format!("{}: {}", diagnosis_of(finished.by.as_deref()), finished.record.summary);
                health.record_event(now_ns, SOURCE, &Notice::new(Severity::Info, "diagnosis_finished", text));
                health.keep_record(finished.record.clone().into());
                self.finished = Some(*finished);
            }
        }
    }

    /// The one that the box itself had asked for is no longer due.
    fn was_due(&mut self, by: Option<&str>) {
        if by.is_none() {
            (self.diagnosing, self.due) = (false, None);
        }
    }

    /// Another model: what the old one differed in is no alarm any more.
    fn replace_model(&mut self, loaded: LoadedModel, health: &mut Health, now_ns: TimeNs) {
        for mismatch in self.list_mismatches() {
            let code = alarm_code(mismatch.regime);
            health.keep_record(AlarmClear { at_ns: now_ns, code, source: SOURCE.to_owned() }.into());
        }
        let memory = self.active.take().map(|before| before.live.to_state()).unwrap_or_default();
        self.put_in_charge(loaded, Remembered { toml: String::new(), memory, due: None });
        self.save_learned(health);
    }

    /// Saves what was learned, beside the tick: a slow disk delays neither it nor the sign of life at the machine.
    pub fn save_learned(&mut self, health: &Health) {
        self.saved = Instant::now();
        let Some(ActiveModel { live, loaded }) = &self.active else { return };
        let remembered = Remembered { toml: loaded.toml.clone(), memory: live.to_state(), due: self.due };
        match serde_json::to_string(&remembered) {
            Ok(text) => health.put_learned(&self.memory, text),
            Err(error) => tracing::warn!("what the twin has learned could not be saved: {error}"),
        }
    }
}

/// Which diagnosis it is, in messages.
fn diagnosis_of(by: Option<&str>) -> String {
    by.map_or_else(|| "diagnosis".to_owned(), |by| format!("diagnosis asked for by {by}"))
}

fn alarm_code(regime: Regime) -> String {
    format!("twin_mismatch_{regime}")
}

/// What was learned before; nothing where that cannot be read.
fn restore_learned(path: &Path, told: &mut Vec<Notice>) -> Remembered {
    let Some(state) = state_file::read(path, |notice| told.push(notice)) else { return Remembered::default() };
    serde_json::from_str(&state).unwrap_or_else(|error| {
        let text = format!("{}: what the twin had learned cannot be read ({error}); it learns anew", path.display());
        told.push(Notice::new(Severity::Warning, "twin_forgot", text));
        Remembered::default()
    })
}
