//! A script that comes without a trial: it is run for a few seconds in every state, without values and with plain ones. What it
//! decides does not matter; it must come to an end and must not fail.

use super::TrialResult;
use super::trial_context::TrialContext;
use crate::script_set::Script;
use estimators::State;
use rhai::{Dynamic, ImmutableString};
use std::sync::Arc;

/// Seconds in each state. Longer than the usual waiting times of alarms would take too long at a reload.
const EACH_S: f64 = 2.0;

/// The result, where the script runs at all and fails.
pub(super) fn run_smoke_trial(script: &Arc<Script>) -> Option<TrialResult> {
    if script.passive && script.handlers.is_empty() {
        return None;
    }
    let mut stage = TrialContext::new(script);
    let failed = run_through_states(&mut stage, script).is_err();
    let problem = stage.failure.clone().filter(|_| failed)?;
    let (file, name) = (script.file.clone(), "it runs, although no trial is written".to_owned());
    Some(TrialResult { file, name, line: 1, met: 0, passed_s: stage.passed_s(), problem: Some(problem) })
}

fn run_through_states(stage: &mut TrialContext, script: &Script) -> Result<(), String> {
    stage.pass_time(EACH_S)?;
    stage.give_all(script);
    for (turn, state) in State::ALL.into_iter().enumerate() {
        let text = |text: String| Dynamic::from(ImmutableString::from(text));
        stage.give_value("state", &text(state.as_word().to_owned()))?;
        // Handlers run too: another tool and program, one more part, an alarm of the controller.
        stage.give_value("tool", &text(format!("T{}", turn + 1)))?;
        stage.give_value("program", &text(format!("O{}", turn + 1)))?;
        stage.give_value("part_count", &Dynamic::from_float(turn as f64))?;
        stage.give_value("alarm", &text(if turn % 2 == 0 { String::new() } else { "EX1000".to_owned() }))?;
        stage.pass_time(EACH_S)?;
    }
    Ok(())
}
