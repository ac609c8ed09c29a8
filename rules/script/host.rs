//! Runs the scripts, one tick at a time.

use super::compile::{ScriptFile, compile_scripts};
use super::deadline::{self, Deadline};
use super::decision::{Alarm, AlarmChange, Decision, OverrideRequest, Published};
use super::declared::{Declared, SettingValues};
use super::engine::{Shared, build_engine};
use super::events::Happenings;
use super::problem::ScriptProblem;
use super::script_set::ScriptSet;
use super::settings::merge_settings;
use super::slot::{Moment, Outputs, Slot};
use super::status::{ScriptStatus, Status};
use adapter_core::Sample;
use adapter_core::clock::TimeNs;
use estimators::{Estimates, Settings};
use rhai::Engine;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Scripts that are not there at the moment and whose memory is kept for them.
const ABSENT_MAX: usize = 64;

/// The scripts in charge. Needs no clock: the time is that of the sample.
///
/// A set that does not compile never gets here. A script that fails while it runs is replaced by its last good version, by the
/// script of its name as it was delivered, or suspended where there is neither; either way its request ends at once and the others go on.
pub struct Host {
    engine: Engine,
    shared: Shared,
    slots: Vec<Slot>,
    alarms: Vec<Alarm>,
    decision: Decision,
    pending: Vec<AlarmChange>,
    refused: Vec<ScriptProblem>,
    settings: Settings,
    files: Arc<[ScriptFile]>,
    values: Arc<SettingValues>,
    foreign: Vec<Option<f64>>,
    /// Channels that stand in for those of scripts that are not there, for trials.
    given: BTreeMap<String, Option<f64>>,
    generation: u64,
    happenings: Happenings,
    deadline: Option<Arc<dyn Deadline>>,
    /// What scripts remembered in an earlier process, until they come into charge.
    remembered: BTreeMap<String, Value>,
}

impl Default for Host {
    fn default() -> Self {
        Self::new()
    }
}

impl Host {
    /// A host without scripts.
    #[must_use]
    pub fn new() -> Self {
        let shared = Shared::default();
        Self {
            engine: build_engine(&shared, true),
            shared,
            slots: Vec::new(),
            alarms: Vec::new(),
            decision: Decision::default(),
            pending: Vec::new(),
            refused: Vec::new(),
            settings: Settings::default(),
            files: Arc::default(),
            values: Arc::default(),
            foreign: Vec::new(),
            given: BTreeMap::new(),
            generation: 0,
            happenings: Happenings::default(),
            deadline: None,
            remembered: BTreeMap::new(),
        }
    }

    /// From now on no run lasts longer than this allows, besides the limit on its operations. For live runs only: with a
    /// clock the same samples need not give the same decisions.
    pub fn set_deadline(&mut self, deadline: Arc<dyn Deadline>) {
        deadline::watch_deadline(&mut self.engine, deadline.clone());
        self.deadline = Some(deadline);
    }

    /// Compiles the files and puts them in charge; when anything is wrong, everything stays as it is.
    ///
    /// # Errors
    /// Everything that is wrong; [`Host::status`] tells it too until a set is accepted.
    pub fn load_scripts(&mut self, files: &[ScriptFile]) -> Result<(), Vec<ScriptProblem>> {
        match compile_scripts(files) {
            Ok(set) => {
                self.install_set(set);
                Ok(())
            }
            Err(problems) => {
                self.record_refusal(problems.clone());
                Err(problems)
            }
        }
    }

    /// Puts a compiled set in charge. Every script goes on with its memory and timers, also one whose text has changed; the
    /// version before it stays ready, with what it remembered.
    pub fn install_set(&mut self, set: ScriptSet) {
        self.refused.clear();
        let mut old = std::mem::take(&mut self.slots);
        for script in set.scripts {
            let before = old.iter().position(|slot| slot.file() == &*script.file).map(|at| old.swap_remove(at));
            let remembered = self.remembered.remove(&*script.file);
            self.slots.push(Slot::install_script(script, before, remembered.as_ref()));
        }
        self.settings = set.settings;
        self.files = set.files;
        self.values = set.values;
        self.generation += 1;
        self.drop_alarms();
    }

    /// Remembers why a set was refused, so that [`Host::status`] says so.
    pub fn record_refusal(&mut self, problems: Vec<ScriptProblem>) {
        self.refused = problems;
    }

    /// Ends the alarms of scripts that are gone and the host's own of those that begin anew.
    fn drop_alarms(&mut self) {
        let slots = &self.slots;
        let stays =
            |alarm: &Alarm| slots.iter().any(|slot| slot.file() == &*alarm.script && slot.can_keep_alarm(&alarm.name));
        for alarm in self.alarms.iter().filter(|alarm| !stays(alarm)) {
            self.pending.push(alarm.to_change(false));
        }
        self.alarms.retain(stays);
    }

    /// The settings of the estimators that the scripts in charge ask for. They change together with
    /// [`Host::generation`].
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The texts of the set that was put in charge last.
    #[must_use]
    pub fn files(&self) -> &[ScriptFile] {
        &self.files
    }

    /// The settings that the scripts in charge declare.
    pub fn declared_settings(&self) -> impl Iterator<Item = &Declared> {
        self.slots.iter().flat_map(|slot| &slot.script().declared)
    }

    /// The values that were chosen for them.
    #[must_use]
    pub fn values(&self) -> &Arc<SettingValues> {
        &self.values
    }

    /// A script that is tried alone sees this in the place of another script's channel. False where it reads no such channel.
    pub(super) fn set_channel_value(&mut self, channel: &str, value: Option<f64>) -> bool {
        let reads = self.slots.iter().any(|slot| slot.script().foreign.iter().any(|name| *name == *channel));
        if reads {
            self.given.insert(channel.to_owned(), value);
        }
        reads
    }

    /// Every script with the version that is in charge, or was when it was suspended. They change together with
    /// [`Host::generation`].
    pub fn versions(&self) -> impl Iterator<Item = (&str, u64)> {
        self.slots.iter().map(|slot| (slot.file(), slot.script().version))
    }

    /// Grows whenever other scripts come into charge.
    #[must_use]
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// Runs every script that is due.
    pub fn run_due_scripts(&mut self, sample: &Sample, estimates: &Estimates) -> &Decision {
        let decision = &mut self.decision;
        decision.at_ns = sample.at_ns;
        decision.alarms.clear();
        decision.notes.clear();
        decision.problems.clear();
        decision.learn_anew.clear();
        decision.alarms.append(&mut self.pending);
        let mut outputs = Outputs { alarms: &mut self.alarms, decision };
        let events = self.happenings.detect_events(sample, estimates);
        let mut replaced = false;
        for at in 0..self.slots.len() {
            let (before, from_here) = self.slots.split_at_mut(at);
            let Some(slot) = from_here.first_mut() else { break };
            if let Some(deadline) = &self.deadline {
                deadline.begin_run();
            }
            slot.look_at(before, &self.given, &mut self.foreign);
            let moment = Moment { sample, estimates, events, foreign: &self.foreign };
            replaced |= slot.run_tick(&self.engine, &self.shared, &moment, &mut outputs);
        }
        self.gather_requests();
        if replaced {
            self.remerge_settings();
        }
        &self.decision
    }

    /// What the scripts ask for now.
    fn gather_requests(&mut self) {
        let Decision { request, stops, offsets, .. } = &mut self.decision;
        *request = OverrideRequest::find_least(self.slots.iter().flat_map(Slot::requests)).cloned();
        stops.clear();
        offsets.clear();
        for slot in &self.slots {
            for request in slot.stops() {
                if !stops.iter().any(|known| known.is_same_request(request)) {
                    stops.push(request.clone());
                }
            }
            for proposal in slot.offsets() {
                if !offsets.iter().any(|known| known.axis == proposal.axis) {
                    offsets.push(proposal.clone());
                }
            }
        }
    }

    /// An older version has come into charge: its settings count again.
    fn remerge_settings(&mut self) {
        let scripts: Vec<_> = self.slots.iter().map(|slot| Arc::clone(slot.script())).collect();
        let mut problems = Vec::new();
        let settings = merge_settings(&scripts, &mut problems);
        if problems.is_empty() {
            self.settings = settings;
        }
        self.generation += 1;
    }

    /// The alarms that stand.
    #[must_use]
    pub fn alarms(&self) -> &[Alarm] {
        &self.alarms
    }

    /// Who is in charge, who is not, and why.
    #[must_use]
    pub fn status(&self) -> Status {
        let scripts: Vec<ScriptStatus> = self.slots.iter().map(Slot::status).collect();
        Status { scripts, refused: self.refused.clone() }
    }

    /// The channels of the scripts' own, each with its newest value.
    pub fn published_channels(&self) -> impl Iterator<Item = Published<'_>> {
        self.slots.iter().flat_map(Slot::published_channels)
    }

    /// What the scripts remember and would have to learn again: `scripts/1`.
    #[must_use]
    pub fn take_snapshot(&self) -> Value {
        let present = self.slots.iter().map(|slot| (slot.file().to_owned(), slot.take_snapshot()));
        let absent = self.remembered.iter().take(ABSENT_MAX).map(|(file, kept)| (file.clone(), kept.clone()));
        json!({ "schema": "scripts/1", "scripts": absent.chain(present).collect::<Map<_, _>>() })
    }

    /// Takes what [`Host::take_snapshot`] gave in an earlier process: each script gets its own when it next comes into charge for
    /// the first time. Whatever cannot be read is left out.
    pub fn restore_snapshot(&mut self, snapshot: &Value) {
        let scripts = snapshot["scripts"].as_object().into_iter().flatten().take(ABSENT_MAX);
        self.remembered = scripts.map(|(file, kept)| (file.clone(), kept.clone())).collect();
    }

    /// Adds an offset that the box itself proposes to the decision of this tick, unless a script proposes one for its axis.
    pub fn add_offset_proposal(&mut self, proposal: super::decision::OffsetProposal) {
        if !self.decision.offsets.iter().any(|known| known.axis == proposal.axis) {
            self.decision.offsets.push(proposal);
        }
    }

    /// Adds a request that comes from outside to the decision of this tick; the least of it and the scripts' counts.
    pub fn add_override_request(&mut self, request: super::decision::OverrideRequest) {
        let least =
            super::decision::OverrideRequest::find_least(self.decision.request.iter().chain([&request])).cloned();
        self.decision.request = least;
    }

    /// The decision of the last tick.
    #[must_use]
    pub fn decision(&self) -> &Decision {
        &self.decision
    }

    /// Every request ends, as when the tick loop has to go on without its scripts.
    pub fn withdraw_requests(&mut self, at_ns: TimeNs) {
        self.decision = Decision { at_ns, ..Decision::default() };
        self.slots.iter_mut().for_each(Slot::withdraw_requests);
    }
}
