//! Runs the scripts, one tick at a time.

use super::compile::{ScriptFile, ScriptSet, compile};
use super::decision::{Alarm, AlarmChange, Decision, OverrideRequest};
use super::engine::{Shared, engine};
use super::problem::Problem;
use super::settings::merge;
use super::slot::{Outputs, Slot};
use super::status::{ScriptStatus, Status};
use crate::estimators::{Estimates, Settings};
use adapters::Sample;
use adapters::clock::TimeNs;
use rhai::Engine;
use std::sync::Arc;

/// The scripts in charge. Needs no clock: the time is that of the sample.
///
/// A set that does not compile never gets here. A script that fails while it runs is replaced by its last good version,
/// or suspended when there is none; either way its request ends at once and the others go on.
pub struct Host {
    engine: Engine,
    shared: Shared,
    slots: Vec<Slot>,
    alarms: Vec<Alarm>,
    decision: Decision,
    pending: Vec<AlarmChange>,
    refused: Vec<Problem>,
    settings: Settings,
    generation: u64,
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
            engine: engine(&shared, true),
            shared,
            slots: Vec::new(),
            alarms: Vec::new(),
            decision: Decision::default(),
            pending: Vec::new(),
            refused: Vec::new(),
            settings: Settings::default(),
            generation: 0,
        }
    }

    /// Compiles the files and puts them in charge; when anything is wrong, everything stays as it is.
    ///
    /// # Errors
    /// Everything that is wrong; [`Host::status`] tells it too until a set is accepted.
    pub fn load(&mut self, files: &[ScriptFile]) -> Result<(), Vec<Problem>> {
        match compile(files) {
            Ok(set) => {
                self.install(set);
                Ok(())
            }
            Err(problems) => {
                self.refuse(problems.clone());
                Err(problems)
            }
        }
    }

    /// Puts a compiled set in charge. A script whose text has not changed goes on with its memory and timers; a changed
    /// one begins anew, and the version before it stays ready until the new one has run well for a minute.
    pub fn install(&mut self, set: ScriptSet) {
        self.refused.clear();
        let mut old = std::mem::take(&mut self.slots);
        for script in set.scripts {
            let before = old.iter().position(|slot| slot.file() == &*script.file).map(|at| old.swap_remove(at));
            self.slots.push(Slot::install(script, before));
        }
        self.settings = set.settings;
        self.generation += 1;
        self.drop_alarms();
    }

    /// Remembers why a set was refused, so that [`Host::status`] says so.
    pub fn refuse(&mut self, problems: Vec<Problem>) {
        self.refused = problems;
    }

    /// Ends the alarms of scripts that are gone and the host's own of those that begin anew.
    fn drop_alarms(&mut self) {
        let slots = &self.slots;
        let stays = |alarm: &Alarm| slots.iter().any(|slot| slot.file() == &*alarm.script && slot.keeps(&alarm.name));
        for alarm in self.alarms.iter().filter(|alarm| !stays(alarm)) {
            let (name, script, text) = (alarm.name.clone(), alarm.script.clone(), alarm.text.clone());
            self.pending.push(AlarmChange { name, script, text, raised: false });
        }
        self.alarms.retain(stays);
    }

    /// The settings of the estimators that the scripts in charge ask for. They change together with
    /// [`Host::generation`].
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Grows whenever other scripts come into charge.
    #[must_use]
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// Runs every script that is due.
    pub fn tick(&mut self, sample: &Sample, estimates: &Estimates) -> &Decision {
        let decision = &mut self.decision;
        decision.at_ns = sample.at_ns;
        decision.alarms.clear();
        decision.notes.clear();
        decision.problems.clear();
        decision.alarms.append(&mut self.pending);
        let mut outputs = Outputs { alarms: &mut self.alarms, decision };
        let mut replaced = false;
        for slot in &mut self.slots {
            replaced |= slot.tick(&self.engine, &self.shared, sample, estimates, &mut outputs);
        }
        self.decision.request = least(self.slots.iter().filter_map(Slot::request)).cloned();
        if replaced {
            self.replaced();
        }
        &self.decision
    }

    /// An older version has come into charge: its settings count again.
    fn replaced(&mut self) {
        let scripts: Vec<_> = self.slots.iter().map(|slot| Arc::clone(slot.script())).collect();
        let mut problems = Vec::new();
        let settings = merge(&scripts, &mut problems);
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

    /// The decision of the last tick.
    #[must_use]
    pub fn decision(&self) -> &Decision {
        &self.decision
    }

    /// Every request ends, as when the tick loop has to go on without its scripts.
    pub fn withdraw(&mut self, at_ns: TimeNs) {
        self.decision = Decision { at_ns, ..Decision::default() };
        self.slots.iter_mut().for_each(Slot::withdraw);
    }
}

/// The least of several requests; one that is no number goes first, because the gate must see and refuse it.
fn least<'a>(requests: impl Iterator<Item = &'a OverrideRequest>) -> Option<&'a OverrideRequest> {
    let key = |request: &OverrideRequest| if request.pct.is_finite() { request.pct } else { f64::NEG_INFINITY };
    requests.min_by(|a, b| key(a).total_cmp(&key(b)))
}
