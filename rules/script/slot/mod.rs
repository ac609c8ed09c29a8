//! One active script: its variables, its timers, its last good version.

mod alarms;
mod failure;
mod follows;

use super::collect::{RunOutput, ScriptResult};
use super::deadline::{LATE_MAX, is_late};
use super::decision::{Alarm, Decision, Note, OffsetProposal, OverrideRequest, Published, SCRIPT_STOPPED, StopRequest};
use super::declared::Now;
use super::engine::Shared;
use super::events::Event;
use super::notes::NoteLimit;
use super::problem::{self, ScriptProblem};
use super::running::RunningScript;
use super::script_memory::ScriptMemory;
use super::script_set::Script;
use super::status::{ScriptCondition, ScriptStatus};
use super::timers::{AlarmText, Timers};
use super::variables::{fill_scope, has_absent, scope_of, why_absent};
use super::vocabulary::View;
use adapter_core::Sample;
use adapter_core::clock::{SECOND_NS, TimeNs};
use estimators::Estimates;
use follows::Follows;
use rhai::{Engine, EvalAltResult, ImmutableString, Scope};
use serde_json::Value;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A longer time between two runs is a pause: `dt_s` is 0 after it and timers begin anew.
const PAUSE_NS: i64 = 2 * SECOND_NS;

/// What a tick is about.
pub(super) struct Moment<'a> {
    pub(super) sample: &'a Sample,
    pub(super) estimates: &'a Estimates,
    pub(super) events: &'a [Event],
    /// The channels of other scripts that this one reads, in its order.
    pub(super) foreign: &'a [Option<f64>],
}

/// Where a run leaves its effects.
pub(super) struct Outputs<'a> {
    pub(super) alarms: &'a mut Vec<Alarm>,
    pub(super) decision: &'a mut Decision,
}

/// The version before, with what it remembered when it was replaced. It stays for as long as the new one: a branch that is taken once
/// a month fails in that month.
struct Previous {
    script: Arc<Script>,
    script_memory: ScriptMemory,
}

pub(super) struct Slot {
    script: Arc<Script>,
    previous: Option<Previous>,
    scope: Scope<'static>,
    base: usize,
    running: RunningScript,
    timers: Timers,
    now: Now,
    condition: ScriptCondition,
    request: Option<OverrideRequest>,
    follows: Follows,
    reason: (ImmutableString, Arc<str>),
    stops: Vec<StopRequest>,
    offsets: Vec<OffsetProposal>,
    /// Alarms that the body named in its last run.
    named: Vec<(ImmutableString, AlarmText)>,
    /// Newest values of the channels of its own.
    values: Vec<Option<f64>>,
    notes: NoteLimit,
    runs: u64,
    good_since_ns: Option<TimeNs>,
    ran_ns: Option<TimeNs>,
    /// Runs in a row that the clock has stopped.
    late: u8,
}

impl Slot {
    /// `before` is what stood under this file name until now, `remembered` what the file had in an earlier process.
    pub(super) fn install_script(script: Arc<Script>, before: Option<Self>, remembered: Option<&Value>) -> Self {
        match before {
            Some(before) if before.script.version == script.version && before.condition.is_active() => before,
            Some(before) => {
                let script_memory = before.script_memory();
                let proven = before.good_since_ns.is_some() && !before.condition.is_suspended();
                let standing = Previous { script: before.script, script_memory: script_memory.clone() };
                let previous = if proven { Some(standing) } else { before.previous };
                let previous = previous.filter(|previous| previous.script.version != script.version);
                Self::with_fresh_state(script, previous, script_memory)
            }
            None => {
                Self::with_fresh_state(script, None, remembered.map(ScriptMemory::from_snapshot).unwrap_or_default())
            }
        }
    }

    fn with_fresh_state(script: Arc<Script>, previous: Option<Previous>, script_memory: ScriptMemory) -> Self {
        let scope = scope_of(&script, script_memory.memory);
        Self {
            base: scope.len(),
            scope,
            running: RunningScript::new(),
            values: vec![None; script.channels.len()],
            script,
            previous,
            timers: script_memory.timers,
            now: Now::default(),
            condition: ScriptCondition::Running,
            request: None,
            follows: Follows::default(),
            reason: (ImmutableString::new(), Arc::from("")),
            stops: Vec::new(),
            offsets: Vec::new(),
            named: Vec::new(),
            notes: NoteLimit::default(),
            runs: 0,
            good_since_ns: None,
            ran_ns: None,
            late: 0,
        }
    }

    fn script_memory(&self) -> ScriptMemory {
        ScriptMemory { memory: self.scope.get_value("memory").unwrap_or_default(), timers: self.timers.clone() }
    }

    /// What outlives the process.
    pub(super) fn take_snapshot(&self) -> Value {
        self.script_memory().take_snapshot()
    }

    pub(super) fn file(&self) -> &str {
        &self.script.file
    }

    pub(super) fn script(&self) -> &Arc<Script> {
        &self.script
    }

    pub(super) fn requests(&self) -> impl Iterator<Item = &OverrideRequest> {
        self.request.iter().chain(self.follows.request())
    }

    pub(super) fn stops(&self) -> &[StopRequest] {
        &self.stops
    }

    pub(super) fn offsets(&self) -> &[OffsetProposal] {
        &self.offsets
    }

    /// The channels of its own, each with its newest value.
    pub(super) fn published_channels(&self) -> impl Iterator<Item = Published<'_>> {
        let rows = self.script.channels.iter().zip(&self.values);
        rows.map(|((name, unit), value)| Published { name, unit, script: &self.script.file, value: *value })
    }

    /// The channels of other scripts that it reads: what those before it have published, or what a trial gives.
    pub(super) fn look_at(
        &self,
        before: &[Self],
        given: &BTreeMap<String, Option<f64>>,
        foreign: &mut Vec<Option<f64>>,
    ) {
        let value = |name: &ImmutableString| {
            let published = before.iter().flat_map(Self::published_channels).find(|it| *it.name == **name);
            published.map_or_else(|| given.get(name.as_str()).copied().flatten(), |it| it.value)
        };
        foreign.clear();
        foreign.extend(self.script.foreign.iter().map(value));
    }

    /// Nothing is asked for any more.
    pub(super) fn withdraw_requests(&mut self) {
        self.request = None;
        self.follows.stop_following();
        self.stops.clear();
        self.offsets.clear();
    }

    /// May an alarm of this name stand on after a set was installed?
    pub(super) fn can_keep_alarm(&self, name: &str) -> bool {
        name != SCRIPT_STOPPED || !matches!(self.condition, ScriptCondition::Running | ScriptCondition::Waiting(_))
    }

    /// Runs the handlers of what has happened, and the script when it is due; asks for what it follows. True when an older version
    /// has come into charge.
    pub(super) fn run_tick(
        &mut self,
        engine: &Engine,
        shared: &Shared,
        moment: &Moment<'_>,
        outputs: &mut Outputs<'_>,
    ) -> bool {
        let replaced = self.run_due(engine, shared, moment, outputs);
        self.follows
            .update_request(&View { sample: moment.sample, estimates: moment.estimates, dt_s: 0.0 }, &self.script);
        replaced
    }

    fn run_due(&mut self, engine: &Engine, shared: &Shared, moment: &Moment<'_>, outputs: &mut Outputs<'_>) -> bool {
        let at_ns = moment.sample.at_ns;
        let due = !self.script.passive && self.is_due(at_ns);
        let heard = moment.events.iter().any(|event| self.script.has_handler_for(event));
        if self.condition.is_suspended() || !(due || heard) {
            return false;
        }
        let dt_s = if due { self.elapsed_s(at_ns) } else { 0.0 };
        let view = View { sample: moment.sample, estimates: moment.estimates, dt_s };
        let live = (!self.script.live.is_empty()).then(|| self.now.update_values(&self.script.live, moment.sample));
        fill_scope(&mut self.scope, &self.script, &view, (moment.foreign, live.as_deref().unwrap_or_default()));
        self.exchange_timers(shared, at_ns);
        shared.lock().live = live;
        let outcome = self.run_script(engine, moment.events, due);
        self.scope.rewind(self.base);
        let mut collected = shared.lock();
        std::mem::swap(&mut collected.timers, &mut self.timers);
        match outcome {
            Ok(()) => self.accept_outcome(&mut collected, due, outputs),
            Err(error) if problem::is_absence(&error) && self.any_absent(&collected) => {
                self.wait_for_value(&error, &view, &collected, moment.foreign);
            }
            Err(error) if is_late(&error) && self.late + 1 < LATE_MAX => self.leave_out(&error, outputs),
            Err(error) => return self.recover_from_failure(&error, outputs),
        }
        false
    }

    /// All of it within the operations of one run.
    fn run_script(&mut self, engine: &Engine, events: &[Event], due: bool) -> ScriptResult<()> {
        let script = Arc::clone(&self.script);
        self.running.begin_run(engine, &script.ast);
        for event in events {
            for handler in script.handlers.iter().filter(|handler| handler.kind == event.kind()) {
                for (name, value) in handler.parameters.iter().zip(event.to_parameter_values()) {
                    self.scope.push_dynamic(name.clone(), value);
                }
                self.running.run_statements(engine, &mut self.scope, &script.ast, handler.body.statements())?;
                self.scope.rewind(self.base);
            }
        }
        if due {
            self.runs += 1;
            self.running.run_statements(engine, &mut self.scope, &script.ast, script.body.statements())?;
        }
        // `memory` lives on, so its size is checked after every run.
        self.scope.get("memory").map_or(Ok(()), |memory| engine.ensure_data_size_within_limits(memory))
    }

    fn is_due(&self, at_ns: TimeNs) -> bool {
        // A tick may come a little early; a hundredth of the pace does not make a run wait for the next one.
        let every_ns = self.script.every_ns - self.script.every_ns / 100;
        self.ran_ns.is_none_or(|ran_ns| at_ns < ran_ns || at_ns - ran_ns >= every_ns)
    }

    /// Seconds since the last run; 0 after a pause, and whatever was being timed begins anew then.
    fn elapsed_s(&mut self, at_ns: TimeNs) -> f64 {
        let elapsed_ns = self.ran_ns.replace(at_ns).map_or(0, |ran_ns| at_ns - ran_ns);
        if elapsed_ns < 0 || elapsed_ns > PAUSE_NS.max(3 * self.script.every_ns) {
            self.timers.restart_timing();
            return 0.0;
        }
        elapsed_ns as f64 / SECOND_NS as f64
    }

    fn exchange_timers(&mut self, shared: &Shared, at_ns: TimeNs) {
        let mut collected = shared.lock();
        collected.begin_run(at_ns);
        std::mem::swap(&mut collected.timers, &mut self.timers);
    }

    fn any_absent(&self, collected: &RunOutput) -> bool {
        collected.list_refusals().next().is_some() || has_absent(&self.scope, &self.script)
    }

    fn accept_outcome(&mut self, collected: &mut RunOutput, due: bool, outputs: &mut Outputs<'_>) {
        self.late = 0;
        if matches!(self.condition, ScriptCondition::Waiting(_)) {
            self.condition = ScriptCondition::Running;
        }
        self.good_since_ns.get_or_insert(collected.now_ns);
        if due {
            self.request_override(collected);
            self.named.clear();
            self.named.append(&mut collected.alarms);
        }
        self.ask_to_stop(collected, due);
        outputs.decision.learn_anew.extend(collected.learn_anew.drain(..).map(|program| Arc::from(program.as_str())));
        self.update_alarms(collected.now_ns, outputs);
        self.publish_values(collected);
        for text in collected.notes.drain(..) {
            if let Some(text) = self.notes.admit_note(&text, collected.now_ns) {
                outputs.decision.notes.push(Note { script: self.script.file.clone(), text });
            }
        }
    }

    fn request_override(&mut self, collected: &mut RunOutput) {
        self.propose_offsets(collected);
        self.follows.set_followed_word(collected.follows.take());
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

    fn propose_offsets(&mut self, collected: &mut RunOutput) {
        let Script { file, version, .. } = &*self.script;
        self.offsets.clear();
        self.offsets.extend(collected.offsets.drain(..).map(|(axis, (offset_um, reason))| OffsetProposal {
            axis,
            offset_um,
            reason: Arc::from(reason.as_str()),
            script: file.clone(),
            version: *version,
        }));
    }

    /// A handler asks for one tick, the body for as long as it goes on asking.
    fn ask_to_stop(&mut self, collected: &mut RunOutput, due: bool) {
        let Script { file, version, .. } = &*self.script;
        if due {
            self.stops.clear();
        }
        for (stop, reason) in collected.stops.drain(..) {
            self.stops.retain(|known| known.stop != stop || !stop.is_same_request(&known.reason, &reason));
            let reason = Arc::from(reason.as_str());
            self.stops.push(StopRequest { stop, reason, script: file.clone(), version: *version });
        }
    }

    fn publish_values(&mut self, collected: &mut RunOutput) {
        for (name, value) in collected.published.drain(..) {
            if let Some(at) = self.script.channels.iter().position(|(known, _)| **known == *name) {
                self.values[at] = value;
            }
        }
    }

    fn describe_error(&self, error: &EvalAltResult) -> ScriptProblem {
        problem::of_run_behind(&self.script.file, error, self.script.body.lines)
    }

    /// The script worked on a value that is not there: it asks for nothing, publishes nothing and tries again; alarms stay
    /// as they are.
    fn wait_for_value(
        &mut self,
        error: &EvalAltResult,
        view: &View<'_>,
        collected: &RunOutput,
        foreign: &[Option<f64>],
    ) {
        self.withdraw_requests();
        self.values.fill(None);
        if self.condition != ScriptCondition::Running {
            return;
        }
        let mut problem = self.describe_error(error);
        let absent: Vec<String> = why_absent(&self.script, view, foreign).chain(collected.list_refusals()).collect();
        problem.what = absent.join(", ");
        self.condition = ScriptCondition::Waiting(problem);
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
