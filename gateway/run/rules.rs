//! The scripts of a running box: delivered at the first start, loaded, watched, reloaded.

use super::end::RunFlags;
use super::health::{Health, SCRIPTS_MEMORY};
use adapters::clock::TimeNs;
use gateway_base::log::{Notice, Severity};
use gateway_base::state_file;
use gateway_config::Config;
use gateway_pipeline::Pipeline;
use gateway_scripts::active_scripts;
use gateway_scripts::reload::{Fallback, Reloaded, Reloader, load_now, load_rest, write_shipped_scripts};
use gateway_scripts::settings;
use rules::script::{Host, ScriptProblem, SettingValues, list_shipped_scripts};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::Ordering;

/// Writes the shipped scripts where there are none, loads what is there, and watches it. Whatever is wrong is told, and
/// the box goes on: with the shipped scripts from memory when the directory cannot be read at all.
#[must_use]
pub fn load_scripts(config: &Config) -> (Host, ScriptWatch) {
    let directory = &config.scripts.directory;
    let values = settings::values_path(&config.gateway.data_dir);
    let mut told = Vec::new();
    if let Err(error) = write_shipped_scripts(directory) {
        let text = format!("{}: the shipped scripts cannot be written there: {error}", directory.display());
        told.push(Notice::new(Severity::Warning, "scripts_not_written", text));
    }
    let mut host = Host::new();
    if let Some(remembered) = read_memory(config, &mut told) {
        host.restore_snapshot(&remembered);
    }
    if directory.is_dir() {
        if let Err(problems) = load_now(directory, Some(&values), &mut host) {
            let last = active_scripts::prepare_last_set(&config.gateway.data_dir).and_then(Result::ok);
            let consequence = match load_rest((directory, Some(&values)), last, &problems, &mut host) {
                Fallback::Last(count) => format!("the {count} that were in charge before are in charge again"),
                Fallback::Others(1) => "the other script is in charge".to_owned(),
                Fallback::Others(count) => format!("the other {count} are in charge"),
                Fallback::Shipped => "the shipped scripts are in charge as delivered".to_owned(),
            };
            told.push(build_refusal_notice(&problems, &consequence));
        }
    } else if host.load_scripts(&list_shipped_scripts()).is_ok() {
        told.push(Notice::new(
            Severity::Warning,
            "scripts_from_memory",
            "the shipped scripts are in charge as delivered",
        ));
    }
    let reloader = Reloader::start(directory, Some(&values), config.scripts.reload);
    if let Err(error) = &reloader {
        let text = format!("changed scripts will not be noticed ({error}); start the box again after a change");
        told.push(Notice::new(Severity::Warning, "scripts_not_watched", text));
    }
    let (reloader, data_dir) = (reloader.ok(), config.gateway.data_dir.clone());
    let watched = ScriptWatch { reloader, data_dir, notices: told, told_of: None, failed: BTreeMap::new() };
    watched.save_active_texts(&host);
    (host, watched)
}

/// What the scripts remembered when the box last saved it.
fn read_memory(config: &Config, told: &mut Vec<Notice>) -> Option<serde_json::Value> {
    let state = state_file::read(&config.gateway.data_dir.join(SCRIPTS_MEMORY), |notice| told.push(notice))?;
    serde_json::from_str(&state).ok()
}

fn build_refusal_notice(problems: &[ScriptProblem], consequence: &str) -> Notice {
    let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
    let text = format!("scripts refused, {consequence}:\n  {}", lines.join("\n").replace('\n', "\n  "));
    Notice::new(Severity::Warning, "scripts_refused", text)
}

/// Keeps the scripts of the pipeline as they are on disk.
pub struct ScriptWatch {
    reloader: Option<Reloader>,
    data_dir: PathBuf,
    notices: Vec<Notice>,
    /// The generation whose versions the history has been told.
    told_of: Option<u64>,
    /// What each script has last failed with, since the last reload.
    failed: BTreeMap<String, String>,
}

impl ScriptWatch {
    /// Remembers the texts in charge, for a start at which the directory holds something broken and for backtests.
    fn save_active_texts(&self, host: &Host) {
        if let Err(error) = active_scripts::save_texts(&self.data_dir, host.files()) {
            tracing::warn!("the scripts in charge could not be kept in {}: {error}", self.data_dir.display());
        }
    }

    /// Prints what scripts have failed with at this tick, each once until scripts are reloaded or it fails with something else.
    /// The history has every one.
    pub fn print_failures(&mut self, problems: &[ScriptProblem]) {
        for problem in problems {
            let text = format!("a script was stopped: {problem}");
            if self.failed.get(&problem.file) != Some(&text) {
                Notice::new(Severity::Warning, "script_stopped", text.clone()).write_to_logs();
                self.failed.insert(problem.file.clone(), text);
            }
        }
    }

    /// Takes what has been found on disk since the last tick, whose sample is of `at_ns`. Costs nothing when there is nothing.
    pub fn apply_changes(
        &mut self,
        pipeline: &mut Pipeline,
        health: &mut Health,
        run_flags: &RunFlags,
        (now_ns, at_ns): (TimeNs, TimeNs),
    ) {
        self.apply_reload(pipeline, health, run_flags, now_ns);
        let host = pipeline.scripts();
        if self.told_of.replace(host.generation()) != Some(host.generation()) {
            // By the time of the sample, which is that of the alarms.
            health.keep_record(active_scripts::build_event(host, at_ns).into());
        }
    }

    /// The history is told every setting that has another value: who, before, after.
    fn tell_settings((before, by): (&SettingValues, &str), host: &Host, health: &mut Health, now_ns: TimeNs) {
        let declared: Vec<_> = host.declared_settings().collect();
        let changes = settings::list_changes(before, host.values(), &declared);
        for change in changes {
            let text = format!("{}, by {by}", change.describe_change());
            let notice =
                Notice::new(Severity::Info, settings::KIND, text).with_detail(change.build_detail(by).to_string());
            health.record_event(now_ns, "scripts", &notice);
        }
    }

    fn apply_reload(&mut self, pipeline: &mut Pipeline, health: &mut Health, run_flags: &RunFlags, now_ns: TimeNs) {
        for notice in self.notices.drain(..) {
            health.record_event(now_ns, "scripts", &notice);
        }
        let Some(reloader) = &self.reloader else { return };
        if run_flags.reload.swap(false, Ordering::SeqCst) {
            reloader.request_look();
        }
        let before = pipeline.scripts().values().clone();
        let notice = match reloader.apply_found_scripts(pipeline.scripts_mut()) {
            None => return,
            Some(Ok(Reloaded { count, by })) => {
                self.failed.clear();
                health.put_file(
                    &active_scripts::file_path(&self.data_dir),
                    active_scripts::format_texts(pipeline.scripts().files()),
                );
                Self::tell_settings((&before, &by), pipeline.scripts(), health, now_ns);
                let text = format!("{count} scripts are in charge as they are on disk");
                Notice::new(Severity::Info, "scripts_reloaded", text)
            }
            Some(Err(problems)) => build_refusal_notice(&problems, "the ones before stay in charge"),
        };
        health.record_event(now_ns, "scripts", &notice);
    }
}
