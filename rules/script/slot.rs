//! One script in charge: its variables, its timers, its last good version.

use super::collect::{Collected, Timers};
use super::compile::Script;
use super::decision::{Alarm, AlarmChange, Decision, Note, OverrideRequest, SCRIPT_STOPPED};
use super::engine::{OPERATIONS_MAX, Shared};
use super::notes::NoteLimit;
use super::problem;
use super::running::Running;
use super::status::{Condition, ScriptStatus};
use super::vocabulary::{Seen, View};
use crate::estimators::Estimates;
use adapters::Sample;
use adapters::clock::{SECOND_NS, TimeNs};
use rhai::{Dynamic, Engine, EvalAltResult, ImmutableString, Map, Scope};
use std::sync::Arc;

/// A new version that has run well for this long needs no older one behind it.
const PROBATION_NS: i64 = 60 * SECOND_NS;
/// A longer time between two runs is a pause: `dt_s` is 0 after it and timers begin anew.
const PAUSE_NS: i64 = 2 * SECOND_NS;

/// Where a run leaves its effects.
pub(super) struct Outputs<'a> {
    pub(super) alarms: &'a mut Vec<Alarm>,
    pub(super) decision: &'a mut Decision,
}

/// One script in charge.
pub(super) struct Slot {
    script: Arc<Script>,
    previous: Option<Arc<Script>>,
    scope: Scope<'static>,
    running: Running,
    timers: Timers,
    condition: Condition,
    request: Option<OverrideRequest>,
    reason: (ImmutableString, Arc<str>),
    notes: NoteLimit,
    runs: u64,
    good_since_ns: Option<TimeNs>,
    ran_ns: Option<TimeNs>,
}

impl Slot {
    /// `before` is what stood under this file name until now.
    pub(super) fn install(script: Arc<Script>, before: Option<Self>) -> Self {
        match before {
            Some(before) if before.script.version == script.version && before.condition.in_charge() => before,
            Some(before) => {
                let proven = before.good_since_ns.is_some() && !before.condition.suspended();
                let previous = if proven { Some(before.script) } else { before.previous };
                Self::fresh(script.clone(), previous.filter(|previous| previous.version != script.version))
            }
            None => Self::fresh(script, None),
        }
    }

    fn fresh(script: Arc<Script>, previous: Option<Arc<Script>>) -> Self {
        Self {
            scope: scope_of(&script),
            running: Running::new(),
            script,
            previous,
            timers: Timers::default(),
            condition: Condition::Running,
            request: None,
            reason: (ImmutableString::new(), Arc::from("")),
            notes: NoteLimit::default(),
            runs: 0,
            good_since_ns: None,
            ran_ns: None,
        }
    }

    pub(super) fn file(&self) -> &str {
        &self.script.file
    }

    pub(super) fn script(&self) -> &Arc<Script> {
        &self.script
    }

    pub(super) fn request(&self) -> Option<&OverrideRequest> {
        self.request.as_ref()
    }

    pub(super) fn withdraw(&mut self) {
        self.request = None;
    }

    /// May an alarm of this name stand on after a set was installed?
    pub(super) fn keeps(&self, name: &str) -> bool {
        name != SCRIPT_STOPPED || !matches!(self.condition, Condition::Running | Condition::Waiting(_))
    }

    /// Runs the script when it is due. True when an older version has come into charge.
    pub(super) fn tick(
        &mut self,
        engine: &Engine,
        shared: &Shared,
        sample: &Sample,
        estimates: &Estimates,
        outputs: &mut Outputs<'_>,
    ) -> bool {
        if self.script.passive || self.condition.suspended() || !self.due(sample.at_ns) {
            return false;
        }
        let view = View { sample, estimates, dt_s: self.elapsed_s(sample.at_ns) };
        self.ran_ns = Some(sample.at_ns);
        self.fill(&view);
        self.exchange(shared, sample.at_ns);
        let outcome = self.running.run(engine, &mut self.scope, &self.script.ast).and_then(|()| self.bounded(engine));
        self.scope.rewind(1 + self.script.reads.len());
        let mut collected = shared.lock();
        std::mem::swap(&mut collected.timers, &mut self.timers);
        self.runs += 1;
        match outcome {
            Ok(()) => self.succeed(&mut collected, outputs),
            Err(error) if problem::is_absence(&error) && self.any_absent(&collected) => {
                self.wait(&error, &view, &collected);
            }
            Err(error) => return self.fail(&error, outputs),
        }
        false
    }

    fn due(&self, at_ns: TimeNs) -> bool {
        // A tick may come a little early; a hundredth of the pace does not make a run wait for the next one.
        let every_ns = self.script.every_ns - self.script.every_ns / 100;
        self.ran_ns.is_none_or(|ran_ns| at_ns < ran_ns || at_ns - ran_ns >= every_ns)
    }

    /// Seconds since the last run; 0 after a pause, and whatever was being timed begins anew then.
    fn elapsed_s(&mut self, at_ns: TimeNs) -> f64 {
        let elapsed_ns = self.ran_ns.map_or(0, |ran_ns| at_ns - ran_ns);
        if elapsed_ns < 0 || elapsed_ns > PAUSE_NS.max(3 * self.script.every_ns) {
            self.timers.restart();
            return 0.0;
        }
        elapsed_ns as f64 / SECOND_NS as f64
    }

    fn fill(&mut self, view: &View<'_>) {
        for word in self.script.reads.iter().filter(|word| !word.writable()) {
            let Some(place) = self.scope.get_mut(word.name) else { continue };
            match word.see(view) {
                Seen::Number(number) => *place = Dynamic::from_float(number),
                Seen::Absent => *place = Dynamic::UNIT,
                Seen::Text(text) => set_text(place, text),
            }
        }
    }

    fn exchange(&mut self, shared: &Shared, at_ns: TimeNs) {
        let mut collected = shared.lock();
        collected.begin(at_ns);
        std::mem::swap(&mut collected.timers, &mut self.timers);
    }

    /// `memory` lives on, so its size is checked after every run.
    fn bounded(&self, engine: &Engine) -> Result<(), Box<EvalAltResult>> {
        self.scope.get("memory").map_or(Ok(()), |memory| engine.ensure_data_size_within_limits(memory))
    }

    fn any_absent(&self, collected: &Collected) -> bool {
        let absent = |name| self.scope.get(name).is_some_and(Dynamic::is_unit);
        collected.refusals().next().is_some()
            || self.script.reads.iter().any(|word| !word.writable() && absent(word.name))
    }

    fn succeed(&mut self, collected: &mut Collected, outputs: &mut Outputs<'_>) {
        if matches!(self.condition, Condition::Waiting(_)) {
            self.condition = Condition::Running;
        }
        let good_since_ns = *self.good_since_ns.get_or_insert(collected.now_ns);
        if self.previous.is_some() && collected.now_ns - good_since_ns > PROBATION_NS {
            self.previous = None;
        }
        self.ask(collected);
        self.raise(collected, outputs);
        self.clear(collected, outputs);
        for text in collected.notes.drain(..) {
            if let Some(text) = self.notes.admit(&text, collected.now_ns) {
                outputs.decision.notes.push(Note { script: self.script.file.clone(), text });
            }
        }
    }

    fn ask(&mut self, collected: &mut Collected) {
        let Some((pct, reason)) = collected.request.take() else {
            self.request = None;
            return;
        };
        if reason != self.reason.0 {
            self.reason = (reason.clone(), Arc::from(reason.as_str()));
        }
        let (reason, script) = (self.reason.1.clone(), self.script.file.clone());
        self.request = Some(OverrideRequest { pct, reason, script, version: self.script.version });
    }

    fn raise(&self, collected: &Collected, outputs: &mut Outputs<'_>) {
        for (name, text) in &collected.alarms {
            let standing = |alarm: &Alarm| *alarm.script == *self.script.file && *alarm.name == **name;
            if !outputs.alarms.iter().any(standing) {
                self.begin_alarm(Arc::from(name.as_str()), Arc::from(text.as_str()), collected.now_ns, outputs);
            }
        }
    }

    fn begin_alarm(&self, name: Arc<str>, text: Arc<str>, since_ns: TimeNs, outputs: &mut Outputs<'_>) {
        let script = self.script.file.clone();
        let alarm = Alarm { name: name.clone(), script: script.clone(), text: text.clone(), since_ns };
        outputs.alarms.push(alarm);
        outputs.decision.alarms.push(AlarmChange { name, script, text, raised: true });
    }

    fn clear(&self, collected: &Collected, outputs: &mut Outputs<'_>) {
        let own = |alarm: &Alarm| *alarm.script == *self.script.file && *alarm.name != *SCRIPT_STOPPED;
        let asked = |alarm: &Alarm| collected.alarms.iter().any(|(name, _)| **name == *alarm.name);
        if !outputs.alarms.iter().any(|alarm| own(alarm) && !asked(alarm)) {
            return;
        }
        for alarm in outputs.alarms.iter().filter(|alarm| own(alarm) && !asked(alarm)) {
            let (name, script, text) = (alarm.name.clone(), alarm.script.clone(), alarm.text.clone());
            outputs.decision.alarms.push(AlarmChange { name, script, text, raised: false });
        }
        outputs.alarms.retain(|alarm| !own(alarm) || asked(alarm));
    }

    /// The script worked on a value that is not there: it asks for nothing and tries again; alarms stay as they are.
    fn wait(&mut self, error: &EvalAltResult, view: &View<'_>, collected: &Collected) {
        self.request = None;
        if self.condition != Condition::Running {
            return;
        }
        let mut problem = problem::of_run(&self.script.file, error, OPERATIONS_MAX);
        let absent = self.script.reads.iter().filter_map(|word| Some((word.name, word.why_absent(view)?)));
        let absent = absent.map(|(name, why)| format!("{name} has no value ({why})"));
        let absent: Vec<String> = absent.chain(collected.refusals()).collect();
        problem.what = absent.join(", ");
        self.condition = Condition::Waiting(problem);
    }

    /// The script failed. True when an older version has come into charge.
    fn fail(&mut self, error: &EvalAltResult, outputs: &mut Outputs<'_>) -> bool {
        self.request = None;
        let problem = problem::of_run(&self.script.file, error, OPERATIONS_MAX);
        let at_ns = outputs.decision.at_ns;
        let previous = self.previous.take();
        let next = if previous.is_some() { "the version before it is in charge" } else { "it is suspended" };
        let text = format!("{problem}; {next} until the file is changed");
        let replaced = previous.is_some();
        if let Some(previous) = previous {
            *self = Self { condition: Condition::Reverted(problem.clone()), ..Self::fresh(previous, None) };
        } else {
            self.condition = Condition::Suspended(Some(problem.clone()));
        }
        outputs.alarms.retain(|alarm| *alarm.script != *self.script.file || *alarm.name != *SCRIPT_STOPPED);
        self.begin_alarm(Arc::from(SCRIPT_STOPPED), Arc::from(text), at_ns, outputs);
        outputs.decision.problems.push(problem);
        replaced
    }

    pub(super) fn status(&self) -> ScriptStatus {
        ScriptStatus {
            file: self.script.file.clone(),
            version: self.script.version,
            condition: self.condition.clone(),
            every_s: (self.script.every_ns > 0).then(|| self.script.every_ns as f64 / SECOND_NS as f64),
            runs: self.runs,
            reads: self.script.reads.iter().map(|word| word.name).collect(),
            thresholds: self.script.thresholds.clone(),
        }
    }
}

/// Only what the script reads; a variable that nobody looks at costs nothing.
fn scope_of(script: &Script) -> Scope<'static> {
    let mut scope = Scope::with_capacity(1 + script.reads.len());
    scope.push("memory", Map::new());
    for word in script.reads.iter().filter(|word| !word.writable()) {
        scope.push_dynamic(word.name, Dynamic::UNIT);
    }
    scope
}

/// Keeps the string that is there when it says the same.
fn set_text(place: &mut Dynamic, text: &str) {
    if place.read_lock::<ImmutableString>().is_none_or(|old| old.as_str() != text) {
        *place = Dynamic::from(ImmutableString::from(text));
    }
}
