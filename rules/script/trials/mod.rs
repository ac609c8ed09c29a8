//! Trials: given and expected, written in the script file itself.
//!
//! ```text
//! fn trial_a_heavy_cut_is_slowed_down() {
//!     given(#{ state: "cutting", spindle_load_pct: 95.0 });
//!     after_s(10.0);
//!     expect_override(60.0, 90.0);
//! }
//! ```
//!
//! A trial is a function whose name begins with `trial_`. It sets what the script sees, lets time pass, and says what must
//! have come of it. Nothing else runs: one script, from empty memory, on a clock that begins anew. New scripts come into
//! charge only when all their trials pass.
//!
//! | file | what |
//! |---|---|
//! | `functions` | what a trial can call |
//! | `stage` | the script, its inputs, its clock |

mod functions;
mod stage;

pub use functions::TRIAL_FUNCTIONS;

use super::compiled::{Script, ScriptSet};
use super::engine::{OPERATIONS_MAX, Shared, engine};
use super::problem::{self, Problem};
use super::running::Running;
use rhai::{AST, Engine, Position, Scope};
use stage::{Stage, Theatre};
use std::sync::Arc;

/// How the name of a trial begins.
pub(super) const PREFIX: &str = "trial_";

/// A trial as it stands in a file.
pub(super) struct Trial {
    pub(super) name: String,
    pub(super) at: Position,
    /// As written, to look through.
    pub(super) plain: AST,
    pub(super) ast: AST,
}

/// How a trial went.
#[derive(Debug, Clone, PartialEq)]
pub struct TrialResult {
    /// The file.
    pub file: Arc<str>,
    /// Its name in words: `a heavy cut is slowed down`.
    pub name: String,
    /// Where it begins, line from 1.
    pub line: usize,
    /// How many expectations were met.
    pub met: usize,
    /// How much time passed in it, s.
    pub passed_s: f64,
    /// What was not as expected; `None`: it passed.
    pub problem: Option<Problem>,
}

/// Every trial of every script, in the order of files and lines.
#[must_use]
pub fn trials(set: &ScriptSet) -> Vec<TrialResult> {
    set.scripts.iter().flat_map(of_script).collect()
}

/// May these scripts come into charge?
///
/// # Errors
/// What the trials found.
pub fn prove(set: ScriptSet) -> Result<ScriptSet, Vec<Problem>> {
    let problems: Vec<Problem> = trials(&set).into_iter().filter_map(|result| result.problem).collect();
    if problems.is_empty() { Ok(set) } else { Err(problems) }
}

fn of_script(script: &Arc<Script>) -> Vec<TrialResult> {
    if script.trials.is_empty() {
        return Vec::new();
    }
    let theatre = Theatre::default();
    let mut engine = engine(&Shared::default(), false);
    functions::register(&mut engine, &theatre);
    let mut results: Vec<TrialResult> =
        script.trials.iter().map(|trial| perform(&engine, &theatre, script, trial)).collect();
    results.sort_by_key(|result| result.line);
    results
}

fn perform(engine: &Engine, theatre: &Theatre, script: &Arc<Script>, trial: &Trial) -> TrialResult {
    theatre.open(Stage::new(script));
    let mut scope = Scope::new();
    for (name, value) in &script.constants {
        scope.push_constant_dynamic(name.clone(), value.clone());
    }
    let outcome = Running::new().run_within(engine, &mut scope, &trial.ast, &script.ast);
    let stage = theatre.close();
    let name = trial.name.trim_start_matches(PREFIX).replace('_', " ");
    let problem = match outcome {
        Err(error) => {
            Some(stage.failure.clone().unwrap_or_else(|| problem::of_run(&script.file, &error, OPERATIONS_MAX)))
        }
        Ok(()) if stage.met == 0 => {
            let next = "end it with what must have come of it, such as expect_no_override()";
            Some(Problem::new(&script.file, trial.at, "it expects nothing", next))
        }
        Ok(()) => None,
    };
    let problem = problem.map(|problem| told(problem, &name));
    let line = trial.at.line().unwrap_or_default();
    TrialResult { file: script.file.clone(), name, line, met: stage.met, passed_s: stage.passed_s(), problem }
}

fn told(mut problem: Problem, name: &str) -> Problem {
    problem.what = format!("trial \"{name}\": {}", problem.what);
    if problem.next.is_empty() {
        "mend the script, or the trial where it asks for the wrong thing".clone_into(&mut problem.next);
    }
    problem
}
