//! A run that failed or was stopped, and who is in charge then.

use super::{Outputs, Previous, ScriptCondition, Slot};
use crate::compile::{ScriptFile, compile_scripts};
use crate::decision::{AlarmLevel, SCRIPT_STOPPED};
use crate::example_scripts::list_shipped_scripts;
use crate::script_memory::ScriptMemory;
use crate::script_set::Script;
use crate::timers::AlarmText;
use rhai::EvalAltResult;

impl Slot {
    /// The clock has stopped this run: it asks for nothing, and the next one begins anew.
    pub(super) fn leave_out(&mut self, error: &EvalAltResult, outputs: &mut Outputs<'_>) {
        self.withdraw_requests();
        self.values.fill(None);
        self.late += 1;
        outputs.decision.problems.push(self.describe_error(error));
    }

    /// The script failed. True when an older version has come into charge.
    pub(super) fn recover_from_failure(&mut self, error: &EvalAltResult, outputs: &mut Outputs<'_>) -> bool {
        self.withdraw_requests();
        self.values.fill(None);
        let problem = self.describe_error(error);
        let at_ns = outputs.decision.at_ns;
        let previous = self.previous.take().or_else(|| self.as_delivered());
        let next = if previous.is_some() { "the version before it is in charge" } else { "it is suspended" };
        let en = format!("{problem}; {next} until the file is changed");
        let zh = format!("脚本已停止：{problem}");
        let replaced = previous.is_some();
        if let Some(Previous { script, script_memory }) = previous {
            *self = Self {
                condition: ScriptCondition::Reverted(problem.clone()),
                ..Self::with_fresh_state(script, None, script_memory)
            };
        } else {
            self.condition = ScriptCondition::Suspended(Some(problem.clone()));
        }
        outputs.alarms.retain(|alarm| *alarm.script != *self.script.file || *alarm.name != *SCRIPT_STOPPED);
        let text = AlarmText { level: AlarmLevel::Critical, en: en.into(), zh: zh.into() };
        self.begin_alarm(SCRIPT_STOPPED, &text, at_ns, outputs);
        outputs.decision.problems.push(problem);
        replaced
    }

    /// The script of this name as it was delivered, where nothing else has ever been good. It goes on with empty memory: what an
    /// edited one has remembered may mean something else.
    fn as_delivered(&self) -> Option<Previous> {
        let files: Vec<ScriptFile> =
            list_shipped_scripts().into_iter().filter(|file| *file.name == *self.script.file).collect();
        let script = compile_scripts(&files).ok()?.scripts.first()?.clone();
        let fits = |script: &Script| script.version != self.script.version && script.foreign.is_empty();
        fits(&script).then(|| Previous { script, script_memory: ScriptMemory::default() })
    }
}
